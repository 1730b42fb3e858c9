"""An independent measurement of a filter on a Cortex-M4F, which shares no code with kfgen.cost.

The C is cross-compiled by arm-none-eabi-gcc, linked with newlib, and run in the unicorn emulator, which counts
every instruction between the call of a function and its return, those of library functions included. The
functions are called at their addresses with their arguments in registers, as the ABI has it: nothing of the
harness is in the figures.
"""

from __future__ import annotations

import re
import struct
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from kfgen.logs import Log
from kfgen.spec.types import Spec
from kfgen.status import ERROR, describe

GCC = "arm-none-eabi-gcc"
CPU = ("-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")
FLAGS = ("-O2", "-std=gnu99", "-fno-math-errno", "-ffunction-sections", "-fdata-sections")

FLASH, RAM, SIZE = 0x8000, 0x20000000, 0x100000  # where code and data go; bytes that each may take
STACK, STACK_TOP = 0x8000, RAM + SIZE - 0x100
RETURN = 0x00300000  # nothing is there: a function that returns to it has ended
PAINT = b"\xa5"


@dataclass(frozen=True)
class Cost:
    """instructions: function -> count of each of its calls. flash, ram, stack: bytes."""

    instructions: Mapping[str, Sequence[int]]
    flash: int
    ram: int
    stack: int

    @property
    def step(self) -> float:
        """The instructions of one call of each function: the mean over the log."""
        return sum(sum(counts) / len(counts) for counts in self.instructions.values())


def measure(spec: Spec, files: Mapping[str, str], log: Log, flags: Sequence[str] = ()) -> Cost:
    """Run a float filter over a log, row by row: predict, then its updates. An error of the filter is raised."""
    name = spec.name
    functions = ["predict", *(f"update_{sensor.name}" for sensor in spec.measurements)]
    with TemporaryDirectory() as folder:
        elf, flash = _build(Path(folder), name, files, functions, spec, flags)
        machine = _Machine(elf)
    ram = struct.unpack("<I", machine.read(machine.symbols["bench_size"], 4))[0]
    machine.call(f"{name}_init", ["bench_kf"])
    counts: dict[str, list[int]] = {function: [] for function in functions}
    stack = 0
    steps = _steps(spec, log)
    for row in range(log.rows):
        machine.write("bench_u", [log.columns[each.name][row] for each in spec.inputs])
        calls: list[tuple[str, list[str]]] = []
        if steps[row] > 0:
            calls.append(("predict", ["bench_kf"] + ["bench_u"] * bool(spec.inputs)))
        for sensor in spec.measurements:
            z = [log.columns[f"{sensor.name}.{each.name}"][row] for each in sensor.components]
            if any(value != value for value in z):
                continue
            machine.write(f"bench_{sensor.name}", z)
            calls.append((f"update_{sensor.name}", ["bench_kf", f"bench_{sensor.name}", "bench_u"]))
        for function, arguments in calls:
            count, depth = machine.call(f"{name}_{function}", arguments, steps[row])
            counts[function].append(count)
            stack = max(stack, depth)
    return Cost(counts, flash, ram, stack)


def _steps(spec: Spec, log: Log) -> list[float]:
    """The step that leads to each row, 10 ms to the first; 1 where it is compiled in."""
    if spec.dt is None or not spec.dt.run_time:
        return [1.0] * log.rows
    t = [float(each) for each in log.columns["t"]]
    return [0.01, *(after - before for before, after in pairwise(t))]


def _build(
    folder: Path, name: str, files: Mapping[str, str], functions: Sequence[str], spec: Spec, flags: Sequence[str]
) -> tuple[bytes, int]:
    """Compile and link; the program, and the bytes of flash that the filter itself takes in it."""
    for file, text in files.items():
        (folder / file).write_text(text)
    inputs = [f"{name}_inputs_t bench_u;"] if spec.inputs else ["float bench_u;"]
    sensors = [f"{name}_{sensor.name}_t bench_{sensor.name};" for sensor in spec.measurements]
    lines = [f'#include "{name}.h"', f"{name}_t bench_kf;", *inputs, *sensors]
    (folder / "bench.c").write_text("\n".join([*lines, f"const uint32_t bench_size = sizeof({name}_t);\n"]))
    for source in (f"{name}.c", "bench.c"):
        _run(folder, GCC, *CPU, *FLAGS, *flags, "-c", source)
    data = ["kf", "u", "size", *(sensor.name for sensor in spec.measurements)]
    roots = [*(f"{name}_{each}" for each in ("init", *functions)), *(f"bench_{each}" for each in data)]
    _run(
        folder, GCC, *CPU, f"{name}.o", "bench.o", "-lm", "-specs=nosys.specs", "-nostartfiles", "-o", "bench.elf",
        "-Wl,--gc-sections,-Map=bench.map", f"-Wl,-Ttext={FLASH:#x},-Tdata={RAM:#x},-e,{name}_init",
        *(f"-Wl,-u,{root}" for root in roots),
    )  # fmt: skip
    return (folder / "bench.elf").read_bytes(), _flash((folder / "bench.map").read_text(), f"{name}.o")


def _run(folder: Path, *command: str) -> None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}\n{done.stderr}")


def _flash(linker_map: str, origin: str) -> int:
    """The bytes of .text and .rodata sections that come from an object file and were not collected."""
    placed = linker_map.split("Linker script and memory map", 1)[1]
    section = re.compile(rf"^ \.(?:text|rodata)\S*\s+0x[0-9a-f]+\s+0x([0-9a-f]+) {re.escape(origin)}$", re.MULTILINE)
    return sum(int(size, 16) for size in section.findall(placed))


class _Machine:
    """A Cortex-M4F with a program in it."""

    def __init__(self, program: bytes) -> None:
        import io

        from elftools.elf.elffile import ELFFile
        from unicorn import UC_ARCH_ARM, UC_HOOK_CODE, UC_MODE_MCLASS, UC_MODE_THUMB, Uc, arm_const

        self.arm = arm_const
        self.uc = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
        self.uc.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M4)
        self.uc.mem_map(0, RETURN + 0x1000)
        self.uc.mem_map(RAM, SIZE)
        elf = ELFFile(io.BytesIO(program))
        for segment in elf.iter_segments("PT_LOAD"):
            self.uc.mem_write(segment["p_vaddr"], segment.data())
        self.symbols = {each.name: each["st_value"] for each in elf.get_section_by_name(".symtab").iter_symbols()}
        self.count = 0
        # before anything runs: blocks that are translated without the hook never get it
        self.uc.hook_add(UC_HOOK_CODE, self._counted)

    def _counted(self, *_: Any) -> None:
        self.count += 1

    def read(self, address: int, size: int) -> bytes:
        return bytes(self.uc.mem_read(address, size))

    def write(self, symbol: str, values: Sequence[float]) -> None:
        self.uc.mem_write(self.symbols[symbol], struct.pack(f"<{len(values)}f", *values))

    def call(self, function: str, pointers: Sequence[str], dt: float = 0.0) -> tuple[int, int]:
        """Call a function with pointers in r0, r1, r2 and dt in s0: its instructions, its bytes of stack."""
        arm = self.arm
        for register, pointer in zip((arm.UC_ARM_REG_R0, arm.UC_ARM_REG_R1, arm.UC_ARM_REG_R2), pointers, strict=False):
            self.uc.reg_write(register, self.symbols[pointer])
        self.uc.reg_write(arm.UC_ARM_REG_S0, struct.unpack("<I", struct.pack("<f", dt))[0])
        self.uc.reg_write(arm.UC_ARM_REG_SP, STACK_TOP)
        self.uc.reg_write(arm.UC_ARM_REG_LR, RETURN | 1)
        self.uc.mem_write(STACK_TOP - STACK, PAINT * STACK)
        self.count = 0
        self.uc.emu_start(self.symbols[function] | 1, RETURN)
        status = self.uc.reg_read(arm.UC_ARM_REG_R0)
        if status >= ERROR:
            raise RuntimeError(f"{function}: {describe(status)}")
        return self.count, len(self.read(STACK_TOP - STACK, STACK).lstrip(PAINT))
