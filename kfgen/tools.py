"""The tools around kfgen: compilers, emulators, Python packages; whether each is here, and what it is for."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import kfgen
from kfgen.errors import KfgenError
from kfgen.native.compiler import find_compiler

_SECONDS = 10  # a tool that does not even tell its version counts as missing


@dataclass(frozen=True)
class Tool:
    """present: whether it is here; version: what it says of itself."""

    name: str
    version: str
    purpose: str
    install: str

    @property
    def present(self) -> bool:
        return bool(self.version)

    def as_json(self) -> dict[str, Any]:
        return {**asdict(self), "present": self.present}


# name, the commands that it may be installed as, what for, what installs it
_COMMANDS = (
    ("arm-none-eabi-gcc", ("arm-none-eabi-gcc",), "cost on Cortex-M", "Debian: gcc-arm-none-eabi"),
    ("RISC-V gcc", ("riscv64-unknown-elf-gcc", "riscv32-unknown-elf-gcc", "riscv-none-elf-gcc"), "cost on RISC-V",
     "Debian: gcc-riscv64-unknown-elf picolibc-riscv64-unknown-elf"),
    ("avr-gcc", ("avr-gcc",), "cost on AVR", "Debian: gcc-avr avr-libc"),
    ("simavr", ("simavr",), "cost on AVR, cycles", "Debian: simavr"),
)  # fmt: skip
_PACKAGES = (
    ("ziglang", "a C compiler where there is no other; cost", "pip install 'kfgen[cost]'"),
    ("unicorn", "cost on Cortex-M and RISC-V: the emulator", "pip install 'kfgen[cost]'"),
    ("pyelftools", "cost on Cortex-M and RISC-V: reads programs", "pip install 'kfgen[cost]'"),
    ("matplotlib", "run --plot", "pip install 'kfgen[plot]'"),
)


def survey() -> list[Tool]:
    """Every tool, the needed ones first. Raises nothing: what cannot be asked is missing."""
    needed = f"Python {sys.version_info.major}.{sys.version_info.minor}.{sys.version_info.micro}"
    found = [Tool("kfgen", f"{kfgen.__version__}, {needed}", "everything", "")]
    found.append(Tool("C compiler", _compiler(), "check, run, compile", "Debian: gcc; or pip install ziglang"))
    found += [Tool(name, _installed(commands), purpose, install) for name, commands, purpose, install in _COMMANDS]
    return found + [Tool(name, _package(name), purpose, install) for name, purpose, install in _PACKAGES]


def _compiler() -> str:
    try:
        return _told(find_compiler())
    except KfgenError:
        return ""


def _installed(commands: Sequence[str]) -> str:
    command = next((each for each in commands if shutil.which(each)), None)
    return "" if command is None else _told([command])


def _told(command: Sequence[str]) -> str:
    """The first line of what a command says of its version; `yes` where it only runs."""
    with suppress(OSError, subprocess.SubprocessError):
        call = [*command, "--version"]
        done = subprocess.run(call, capture_output=True, text=True, errors="replace", timeout=_SECONDS, check=False)
        lines = (done.stdout or done.stderr).strip().splitlines()
        return lines[0][:60] if lines and not done.returncode else "yes"
    return ""


def _package(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""
