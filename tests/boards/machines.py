"""Programs on emulated boards: how each is compiled and run. A program is a `main` that returns its status.

The folder of a program holds its sources; of AVR's the part of `main` is in `tests`, whose result is told by the
serial line.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
EMBEDDED = ("-O1", "-std=gnu99", "-fno-math-errno", "-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections")


@dataclass(frozen=True)
class Board:
    """A compiler and a machine. compile: with all options but the sources'; run: the emulator before the program."""

    tools: tuple[str, str]
    compile: tuple[str, ...]
    run: tuple[str, ...]

    def status(self, folder: Path, sources: Sequence[str], *flags: str) -> int:
        """Compile the sources of a folder, run the program, and return its status."""
        program = "program.elf"
        _done(folder, self.tools[0], *EMBEDDED, *flags, *sources, *self.compile, "-o", program)
        command = [self.tools[1], *self.run, program]
        ended = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, errors="replace", timeout=120, check=False
        )
        if self.tools[1] != "simavr":
            return ended.returncode
        (told,) = re.findall(r"<(\d{4})>", ended.stdout + ended.stderr)
        return int(told)


def _done(folder: Path, *command: str) -> None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr[:3000]


def _cortex(machine: str, board: str, *more: str) -> Board:
    return Board(
        ("arm-none-eabi-gcc", "qemu-system-arm"),
        (*machine.split(), "-mthumb", *more, str(HERE / "cortex_m.c"), "-lm", "-specs=nosys.specs", "-nostartfiles",
         "-Wl,--section-start=.vectors=0,-Ttext=0x400,-Tdata=0x20000000,-e,start,-u,vectors"),
        ("-M", board, "-nographic", "-semihosting-config", "enable=on,target=native", "-kernel"),
    )  # fmt: skip


def _riscv(architecture: str, abi: str) -> Board:
    return Board(
        ("riscv64-unknown-elf-gcc", "qemu-system-riscv32"),
        (f"-march={architecture}", f"-mabi={abi}", "--specs=picolibc.specs", str(HERE / "riscv.c"), "-lm",
         "-nostartfiles",
         "-Wl,--section-start=.vectors=0x80000000,--defsym=__flash=0x80001000,--defsym=__flash_size=0x200000",
         "-Wl,--defsym=__ram=0x80200000,--defsym=__ram_size=0x100000,-e,_start"),
        ("-M", "virt", "-bios", "none", "-nographic", "-kernel"),
    )  # fmt: skip


BOARDS = {
    "m0": _cortex("-mcpu=cortex-m0", "microbit", "-DSTACK=0x20004000u"),
    "m3": _cortex("-mcpu=cortex-m3", "mps2-an385"),
    "m4": _cortex("-mcpu=cortex-m4", "mps2-an386"),
    "m4f": _cortex("-mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard", "mps2-an386"),
    "rv32": _riscv("rv32imc", "ilp32"),
    "avr": Board(("avr-gcc", "simavr"), ("-mmcu=atmega2560", str(HERE / "avr.c"), "-lm"),
                 ("-m", "atmega2560", "-f", "16000000")),
}  # fmt: skip
