"""This computer's processor, emulated: its C compiler, linked statically, or ziglang."""

from __future__ import annotations

import platform
import struct
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from kfgen.cost.emulated import Emulated, Timing, zig_or_gcc
from kfgen.cost.emulator import RETURN, STACK_TOP, Machine
from kfgen.cost.toolchain import Compiler, Gcc, Zig, has_file
from kfgen.errors import KfgenError
from kfgen.native.compiler import find_compiler

_THREAD = 0x30040000  # what the C library keeps for a thread (errno) lies around here, in the memory of the stack
_RELATIVE = {37: 8, 1032: 8}  # IRELATIVE relocations: of x86-64, of AArch64


@dataclass(frozen=True)
class _X86:
    def open(self) -> Any:
        from unicorn import UC_ARCH_X86, UC_MODE_64, Uc, x86_const

        uc = Uc(UC_ARCH_X86, UC_MODE_64)
        uc.reg_write(x86_const.UC_X86_REG_FS_BASE, _THREAD)
        return uc

    def enter(self, uc: Any, address: int) -> int:
        from unicorn import x86_const

        pointer = (STACK_TOP & ~15) - 8
        uc.mem_write(pointer, struct.pack("<Q", RETURN))
        uc.reg_write(x86_const.UC_X86_REG_RSP, pointer)
        return address

    def stack_pointer(self, uc: Any) -> int:
        from unicorn import x86_const

        pointer: int = uc.reg_read(x86_const.UC_X86_REG_RSP)
        return pointer

    def offsets(self, code: bytes) -> list[int] | None:
        return None

    def result(self, uc: Any) -> int:
        from unicorn import x86_const

        value: int = uc.reg_read(x86_const.UC_X86_REG_RAX)
        return value


@dataclass(frozen=True)
class _Arm64:
    def open(self) -> Any:
        from unicorn import UC_ARCH_ARM64, UC_MODE_ARM, Uc, arm64_const

        uc = Uc(UC_ARCH_ARM64, UC_MODE_ARM)
        uc.reg_write(arm64_const.UC_ARM64_REG_CPACR_EL1, 3 << 20)  # the floating-point unit is on
        uc.reg_write(arm64_const.UC_ARM64_REG_TPIDR_EL0, _THREAD)
        return uc

    def enter(self, uc: Any, address: int) -> int:
        from unicorn import arm64_const

        uc.reg_write(arm64_const.UC_ARM64_REG_SP, STACK_TOP & ~15)
        uc.reg_write(arm64_const.UC_ARM64_REG_LR, RETURN)
        return address

    def stack_pointer(self, uc: Any) -> int:
        from unicorn import arm64_const

        pointer: int = uc.reg_read(arm64_const.UC_ARM64_REG_SP)
        return pointer

    def offsets(self, code: bytes) -> list[int] | None:
        return list(range(0, len(code), 4))

    def result(self, uc: Any) -> int:
        from unicorn import arm64_const

        value: int = uc.reg_read(arm64_const.UC_ARM64_REG_X0)
        return value


_PROCESSORS: Mapping[str, tuple[str, _X86 | _Arm64, str, str]] = {
    "x86_64": ("x86-64", _X86(), "x86_64-freestanding", "elf_x86_64"),
    "aarch64": ("AArch64", _Arm64(), "aarch64-freestanding", "aarch64linux"),
}
_SAME = {"amd64": "x86_64", "arm64": "aarch64"}


def _settle(core: _X86 | _Arm64) -> Any:
    """What a static C library does as it starts: choose the functions that this processor can run."""

    def prepare(machine: Machine) -> None:
        if machine.relocations is None:
            return
        for each in machine.relocations.iter_relocations():
            if each["r_info_type"] in _RELATIVE:
                machine.uc.emu_start(core.enter(machine.uc, each["r_addend"]), RETURN)
                machine.uc.mem_write(each["r_offset"], struct.pack("<Q", core.result(machine.uc)))

    return prepare


def _target() -> Emulated | None:
    machine = platform.machine().lower()
    found = _PROCESSORS.get(_SAME.get(machine, machine))
    if found is None:
        return None
    title, core, target, emulation = found

    def cc() -> Compiler | None:
        try:
            command = find_compiler()
        except KfgenError:
            return None
        if "ziglang" in command or command[0] == "zig":
            return None  # as the next of the compilers, with a library of its own
        if not sys.platform.startswith("linux") or not has_file(command[0], (), "libc.a"):
            return None  # what is not ELF, or cannot be linked statically, cannot be loaded here
        layout = ("-nostartfiles", "-static", "-no-pie", "-Wl,-Ttext-segment=0x10000,--defsym=_start=0")
        return Gcc(command[0], (*command[1:], "-fno-pie"), (), layout)

    clang = Zig(target, "baseline", emulation)
    return Emulated(
        "host", title, core, zig_or_gcc(cc, clang), Timing(0.5),
        "install gcc, or: pip install 'kfgen[cost]'", prepare=_settle(core), left_out="libc.a",
    )  # fmt: skip


TARGETS = [target for target in (_target(),) if target is not None]
