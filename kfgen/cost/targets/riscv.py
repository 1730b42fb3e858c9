"""32-bit RISC-V: riscv64-unknown-elf-gcc with picolibc (or another gcc with newlib), or ziglang."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from kfgen.cost.emulated import Emulated, Timing, zig_or_gcc
from kfgen.cost.emulator import RETURN, STACK_TOP, compressed_offsets
from kfgen.cost.toolchain import Compiler, Gcc, Zig, has_file, installed_gcc

_NAMES = ("riscv64-unknown-elf-gcc", "riscv32-unknown-elf-gcc", "riscv-none-elf-gcc")
_FS = 3 << 13  # mstatus: the floating-point unit is on


@dataclass(frozen=True)
class _Core:
    def open(self) -> Any:
        from unicorn import UC_ARCH_RISCV, UC_MODE_RISCV32, Uc, riscv_const

        uc = Uc(UC_ARCH_RISCV, UC_MODE_RISCV32)
        uc.reg_write(riscv_const.UC_RISCV_REG_MSTATUS, uc.reg_read(riscv_const.UC_RISCV_REG_MSTATUS) | _FS)
        return uc

    def enter(self, uc: Any, address: int) -> int:
        from unicorn import riscv_const

        uc.reg_write(riscv_const.UC_RISCV_REG_SP, STACK_TOP & ~15)
        uc.reg_write(riscv_const.UC_RISCV_REG_RA, RETURN)
        return address

    def stack_pointer(self, uc: Any) -> int:
        from unicorn import riscv_const

        pointer: int = uc.reg_read(riscv_const.UC_RISCV_REG_SP)
        return pointer

    def offsets(self, code: bytes) -> list[int] | None:
        return compressed_offsets(code, 3, 3, at_least=False)


def _target(name: str, abi: str, cpu: str, timing: Timing) -> Emulated:
    machine = (f"-march={name}", f"-mabi={abi}")
    pico = ("--specs=picolibc.specs",)
    memory = {"flash": 0x10000, "flash_size": 0x400000, "ram": 0x20000000, "ram_size": 0x100000}  # picolibc's names
    placed = ("-nostartfiles", ",".join(["-Wl", *(f"--defsym=__{key}={value:#x}" for key, value in memory.items())]))
    layout = ("-nostartfiles", "-Wl,-Ttext=0x10000,-Tdata=0x20000000")

    def gcc() -> Compiler | None:
        for command in _NAMES:
            if installed_gcc([command], machine, "picolibc.specs"):
                return Gcc(command, (*machine, *pico), (), placed)
            if installed_gcc([command], machine) and has_file(command, machine, "nosys.specs"):
                return Gcc(command, machine, ("-specs=nosys.specs",), layout)
        return None

    clang = Zig("riscv32-freestanding", cpu, "elf32lriscv", (f"-mabi={abi}",))
    return Emulated(
        name, f"RISC-V {name}", _Core(), zig_or_gcc(gcc, clang), timing,
        "install riscv64-unknown-elf-gcc with picolibc, or: pip install 'kfgen[cost]'",
    )  # fmt: skip


# fdiv.s and fsqrt.s
_SLOW = ((0xFE00007F, 0x18000053, 20), (0xFE00007F, 0x58000053, 20))

TARGETS = [
    _target("rv32imc", "ilp32", "generic_rv32+m+c", Timing(1.3)),
    _target("rv32imafc", "ilp32f", "generic_rv32+m+a+f+c", Timing(1.3, _SLOW)),
]
