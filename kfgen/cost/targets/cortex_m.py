"""ARM Cortex-M: arm-none-eabi-gcc with newlib, or ziglang.

Cycles: ARM's technical reference manuals; a division or a square root of the FPU takes 14. The usual instruction's
are rough: loads, taken branches and the wait states of a flash decide.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from kfgen.cost.emulated import Emulated, Timing, zig_or_gcc
from kfgen.cost.emulator import RETURN, STACK_TOP, compressed_offsets
from kfgen.cost.toolchain import Compiler, Gcc, Zig, installed_gcc

# vdiv and vsqrt, the first half-word in the lower two bytes
_SINGLE = ((0x0F50FFB0, 0x0A00EE80), (0x0FD0FFBF, 0x0AC0EEB1))
_DOUBLE = ((0x0F50FFB0, 0x0B00EE80), (0x0FD0FFBF, 0x0BC0EEB1))


@dataclass(frozen=True)
class _Core:
    model: str

    def open(self) -> Any:
        from unicorn import UC_ARCH_ARM, UC_MODE_MCLASS, UC_MODE_THUMB, Uc, arm_const

        if self.model == "M7":  # that of unicorn has no FPU for doubles; this one has, and executes the same code
            uc = Uc(UC_ARCH_ARM, UC_MODE_THUMB)
            uc.ctl_set_cpu_model(arm_const.UC_CPU_ARM_MAX)
            uc.reg_write(arm_const.UC_ARM_REG_C1_C0_2, 0xF << 20)
            uc.reg_write(arm_const.UC_ARM_REG_FPEXC, 1 << 30)
            return uc
        uc = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
        uc.ctl_set_cpu_model(getattr(arm_const, f"UC_CPU_ARM_CORTEX_{self.model}"))
        return uc

    def enter(self, uc: Any, address: int) -> int:
        from unicorn import arm_const

        uc.reg_write(arm_const.UC_ARM_REG_SP, STACK_TOP)
        uc.reg_write(arm_const.UC_ARM_REG_LR, RETURN | 1)
        return address | 1

    def stack_pointer(self, uc: Any) -> int:
        from unicorn import arm_const

        pointer: int = uc.reg_read(arm_const.UC_ARM_REG_SP)
        return pointer

    def offsets(self, code: bytes) -> list[int] | None:
        # where conditions skip instructions (it), only the processor knows which are executed
        return compressed_offsets(code, 0xE800, 0xFFFF, at_least=True) if self.model == "M0" else None


def _target(name: str, gcc_options: str, cpu: str, timing: Timing) -> Emulated:
    core = name.removeprefix("cortex-").removesuffix("f")
    machine = (f"-mcpu=cortex-{core}", "-mthumb", *gcc_options.split())
    hard = "-mfloat-abi=hard" in machine

    def gcc() -> Compiler | None:
        command = installed_gcc(["arm-none-eabi-gcc"], machine)
        layout = ("-nostartfiles", "-Wl,-Ttext=0x8000,-Tdata=0x20000000")
        return None if command is None else Gcc(command, machine, ("-specs=nosys.specs",), layout)

    target = f"thumb-freestanding-{'eabihf' if hard else 'eabi'}"
    clang = Zig(target, cpu, "armelf", ("-mfloat-abi=hard",) if hard else ())
    title = f"Cortex-{core.upper()}" + (" with FPU" if hard else "")
    return Emulated(
        name, title, _Core(core.upper()), zig_or_gcc(gcc, clang), timing,
        "install arm-none-eabi-gcc with newlib, or: pip install 'kfgen[cost]'",
    )  # fmt: skip


_FPU = "-mfpu={} -mfloat-abi=hard"

TARGETS = [
    _target("cortex-m4f", _FPU.format("fpv4-sp-d16"), "cortex_m4+vfp4d16sp",
            Timing(1.25, [(*each, 14) for each in _SINGLE])),
    _target("cortex-m0", "", "cortex_m0", Timing(1.4)),
    _target("cortex-m3", "", "cortex_m3", Timing(1.4)),
    _target("cortex-m7", _FPU.format("fpv5-d16"), "cortex_m7+fp_armv8d16",
            Timing(0.8, [*((*each, 14) for each in _SINGLE), *((*each, 28) for each in _DOUBLE)])),
    _target("cortex-m33", _FPU.format("fpv5-sp-d16"), "cortex_m33+fp_armv8d16sp",
            Timing(1.2, [(*each, 14) for each in _SINGLE])),
]  # fmt: skip
