"""Private functions of the emitted file for inner loops: how they are made, called, and what they are given."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from kfgen.ir.program import Argument, Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Trace, Value

Passed = str | tuple[str, int | Value] | Value
"""An argument of a call: `kf` or `u` by name, an array from an offset on, a number."""


class Kernels:
    """The private functions of a filter's loops, each traced when it is first called.

    taken: names that locals must not have. smallest: see Trace. several: whether several filters share them; none then
    counts on what only some of these know.
    """

    def __init__(self, smallest: Fraction, taken: frozenset[str], several: bool = False) -> None:
        self.smallest = smallest
        self.taken = taken
        self.several = several
        self.made: dict[str, Function] = {}

    def function(
        self, name: str, arguments: list[Argument], doc: str, body: Callable[[Trace], None], returns: str = "void"
    ) -> Function:
        """The function of a name; body traces it. returns: `status` where it raises flags."""
        if name not in self.made:
            t = Trace(self.smallest)
            body(t)
            names = self.taken | {a.name for a in arguments} | {"x", "kf"}
            self.made[name] = Function(name, arguments, schedule(t, names), doc, returns, private=True)
        return self.made[name]


class Given:
    """An array that a private function is given. What is read stands for its value before any store."""

    def __init__(self, t: Trace, name: str) -> None:
        self.t = t
        self.name = name

    def __getitem__(self, i: int | Value) -> Value:
        return self.t.element(self.name, i)

    def __setitem__(self, i: int | Value, value: Value | int) -> None:
        self.t.store(self.name, i, self.t.value(value))


def array_argument(name: str, size: int, constant: bool = False) -> Argument:
    return Argument(name, "{name}_real_t", pointer=True, constant=constant, size=size)


def number_argument(name: str) -> Argument:
    return Argument(name, "{name}_real_t", pointer=False)


def counter_argument(name: str) -> Argument:
    return Argument(name, "int", pointer=False)


def counter(t: Trace, name: str) -> Value:
    """An integer argument of the function that is traced."""
    return t.wrapped(t.pool.make("field", (), name, "int"))


def integer(t: Trace, value: int) -> Value:
    return t.wrapped(t.pool.integer(value))


def select_counter(condition: Value, a: Value, b: Value | int) -> Value:
    """An integer, a where the condition holds."""
    t = condition.trace
    other = integer(t, b) if isinstance(b, int) else b
    return t.wrapped(t.pool.select(condition.node, a.node, other.node))
