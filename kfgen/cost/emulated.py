"""Targets that are compiled, linked and emulated by unicorn."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from kfgen.cost.emulator import Call, Core, Machine
from kfgen.cost.figures import Cost, FunctionCost
from kfgen.cost.job import Job
from kfgen.cost.toolchain import Compiler, Linked, Placed, has_zig, in_flash
from kfgen.errors import KfgenError
from kfgen.status import ERROR

DRIVER = "kfgen_driver.c"
_EXTRA = "install it with: pip install 'kfgen[cost]'"


@dataclass(frozen=True)
class Timing:
    """Cycles of an instruction: `usual`, the mean of a core's; slow ones by pattern (mask, value, cycles)."""

    usual: float
    slow: Sequence[tuple[int, int, int]] = ()

    def of(self, instruction: int) -> float:
        """Of the instruction in four bytes, little-endian."""
        return next((cycles for mask, value, cycles in self.slow if instruction & mask == value), self.usual)


@dataclass(frozen=True)
class Emulated:
    """A processor: how to compile for it, how it is emulated, how long its instructions take.

    compilers: those that are there, the preferred one first, by name. install: what to install where there is none.
    """

    name: str
    title: str
    core: Core
    compilers: Callable[[], Mapping[str, Compiler]]
    timing: Timing
    install: str
    ram: int = 0x20000000
    prepare: Callable[[Machine], None] = field(default=lambda machine: None)
    left_out: str = ""  # a library that does not count
    unit: str = "instructions"

    def compiler(self, wanted: str | None = None) -> Compiler:
        """The preferred compiler, or the one wanted. KfgenError says what to install."""
        found = self.compilers()
        if wanted is None and found:
            return next(iter(found.values()))
        if wanted in found:
            return found[wanted or ""]
        missing = f"no {wanted} for {self.name}" if wanted else f"no compiler for {self.name}"
        raise KfgenError(f"{missing} found; {self.install}")

    def takes_gcc_flags(self, compiler: str | None = None) -> bool:
        return self.compiler(compiler).gcc

    def measure(self, job: Job, flags: Sequence[str] = (), compiler: str | None = None) -> Cost:
        """Compile with further `flags`, and run the calls. KfgenError where a tool is missing or fails."""
        for module, package in (("unicorn", "unicorn"), ("elftools", "pyelftools")):
            if find_spec(module) is None:
                raise KfgenError(f"the Python package {package} is not installed; {_EXTRA}")
        chosen = self.compiler(compiler)
        linked = self._linked(job, chosen, flags, list(job.functions))
        sizes = linked
        if not all(job.functions.values()):  # those that do not count in the flash are run all the same
            sizes = self._linked(job, chosen, flags, [name for name, counts in job.functions.items() if counts])
        machine = self._machine(linked)
        init, calls, errors = _run(job, machine)
        own = f"{job.name}.o"
        flash, linked_flash = _flash(sizes.sections, own, self.left_out)
        functions = {
            function: FunctionCost(
                tuple(call.instructions for call in calls[function]), _of_function(linked.sections, job, function, own),
                max((call.stack for call in calls[function]), default=0), self._cycles(machine, calls[function]),
            )
            for function in job.functions
        }  # fmt: skip
        return Cost(
            job.name, job.scalar, self.name, chosen.title, tuple(flags), self.unit, functions, flash, linked_flash,
            machine.word(f"{job.prefix}size"), errors, chosen.remark(job.files[f"{job.name}.c"]),
            shared(job, functions, flash), init.stack,
        )  # fmt: skip

    def load(self, job: Job, flags: Sequence[str] = (), compiler: str | None = None) -> Machine:
        """The program on the processor, for who runs it otherwise."""
        linked = self._linked(job, self.compiler(compiler), flags, list(job.functions))
        return self._machine(linked)

    def _linked(self, job: Job, chosen: Compiler, flags: Sequence[str], functions: Sequence[str]) -> Linked:
        with TemporaryDirectory(prefix="kfgen-") as name:
            folder = Path(name)
            for file, text in {**job.files, DRIVER: job.driver()}.items():
                (folder / file).write_text(text, encoding="utf-8", newline="\n")
            objects = [chosen.compile(folder, f"{job.name}.c", flags), chosen.compile(folder, DRIVER)]
            return chosen.link(folder, objects, _roots(job, functions), f"{job.name}_init")

    def _machine(self, linked: Linked) -> Machine:
        machine = Machine(linked.program, self.core, self.ram)
        self.prepare(machine)
        return machine

    def _cycles(self, machine: Machine, calls: Sequence[Call]) -> float | None:
        """An estimate, the mean of the calls."""
        if not calls:
            return None
        total = 0.0
        words: dict[int, float] = {}
        for call in calls:
            new = [at for at in call.visits if at not in words]
            words |= {at: self.timing.of(word) for at, word in machine.fetch(new).items()}
            total += sum(times * words[at] for at, times in call.visits.items())
        return total / len(calls)


def shared(job: Job, functions: Mapping[str, FunctionCost], flash: int) -> int:
    """What of a filter's flash is not of its functions."""
    return flash - sum(each.flash for name, each in functions.items() if job.functions[name])


def _roots(job: Job, functions: Sequence[str]) -> list[str]:
    called = [f"{job.prefix}{function}" for function in ("init", *functions)]
    return [*called, *(f"{job.prefix}{each}" for each in ("kf", "status", "size", *job.variables))]


def _run(job: Job, machine: Machine) -> tuple[Call, dict[str, list[Call]], int]:
    p = job.prefix

    def call(function: str) -> Call:
        return machine.call(f"{p}{function}", f"{job.name}_{function}")

    init = call("init")
    if machine.word(f"{p}status") >= ERROR:
        raise KfgenError(f"{job.name}_init returned {machine.word(f'{p}status'):#x}")
    calls: dict[str, list[Call]] = {function: [] for function in job.functions}
    errors = 0
    for step in job.steps:
        for variable, values in step.values.items():
            if variable in job.variables:
                machine.write(f"{p}{variable}", values)
        calls[step.function].append(call(step.function))
        errors += machine.word(f"{p}status") >= ERROR
    return init, calls, errors


def _flash(sections: Sequence[Placed], own: str, left_out: str) -> tuple[int, int]:
    """Bytes of the filter's own code and constants, and with the libraries."""
    sizes = in_flash(sections)
    drivers = Path(DRIVER).with_suffix(".o").name
    others = [n for origin, n in sizes.items() if origin != drivers and not (left_out and left_out in origin)]
    return sizes.get(own, 0), sum(others)


def _of_function(sections: Sequence[Placed], job: Job, function: str, own: str) -> int:
    name = f"{job.name}_{function}"
    return sum(s.size for s in sections if s.origin == own and function_of(s.section) == name)


def function_of(section: str) -> str:
    """The function of a section `.text.<function>`, parts that the compiler has split off included."""
    if not section.startswith(".text."):
        return ""
    return section.removeprefix(".text.").removeprefix("unlikely.").partition(".")[0]


def zig_or_gcc(gcc: Callable[[], Compiler | None], zig: Compiler) -> Callable[[], Mapping[str, Compiler]]:
    """The compilers of a target that are installed: a gcc first, else ziglang."""

    def compilers() -> Mapping[str, Compiler]:
        found: dict[str, Compiler] = {}
        installed = gcc()
        if installed is not None:
            found["gcc"] = installed
        if has_zig():
            found["zig"] = zig
        return found

    return compilers
