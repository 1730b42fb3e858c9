"""What layouts have in common that are emitted as loops over arrays: local arrays, private functions, the gain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.linalg import Vector
from kfgen.filters.algebra.numbers import Number, is_positive, is_zero, select
from kfgen.filters.covariance.base import GainChange, Rolled
from kfgen.filters.frame import guards
from kfgen.filters.frame.runs import put
from kfgen.filters.frame.triangles import upper_start
from kfgen.filters.steps.adapt import AdaptedQ
from kfgen.ir.program import Argument, Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Array, Trace, Value

Given = str | tuple[str, int | Value] | Value


@dataclass
class Space:
    """The local arrays of one function, each declared when it is first asked for."""

    t: Trace
    arrays: dict[str, Array] = field(default_factory=dict)
    h: set[int] = field(default_factory=set)  # where the array of a row of H is not zero

    def array(self, name: str, size: int) -> Array:
        if name not in self.arrays:
            self.arrays[name] = self.t.array(name, size)
        return self.arrays[name]

    def anew(self, name: str, size: int, moved: Vector | None) -> Array:
        """An array of a gain, to be written. What gains before it have moved the state by is then no longer read from
        it; moved: that, if there were any."""
        waiting = moved if isinstance(moved, Displacement) else None
        known = self.arrays.get(name)
        if waiting is not None and any(gain == known for gain, _ in waiting.terms):
            waiting.settle()
        return self.array(name, size)

    def row(self, h: Vector) -> tuple[int, int]:
        """Have the array `h` hold a row; the first and the last of its entries that are not zero."""
        n, t = len(h), self.t
        new = "h" not in self.arrays
        array = self.array("h", n)
        seen = {i for i, x in enumerate(h) if not is_zero(x)}
        if new:
            with t.loop("i", 0, n) as i:
                array[i] = 0
        for place in sorted(self.h - seen):
            array[place] = 0
        for place in sorted(seen):
            array[place] = t.value(h[place])
        self.h = seen
        return min(seen, default=n), max(seen, default=n)


class Column(list[Number]):
    """A gain whose entries are those of a local array times a factor. As a list, they are made when asked for."""

    def __init__(self, space: Space, array: Array, n: int, factor: Value | None = None) -> None:
        self.space = space
        self.array = array
        self.factor = factor
        super().__init__(linalg.times(array[i], 1 if factor is None else factor) for i in range(n))


class Displacement(list[Number]):
    """What the state has been moved by, in the inner order: the local array `moved`, if it is in use, and gains times
    innovations that have not been added to it yet.

    square: nu^2 / s of the last measurement.
    """

    def __init__(
        self, space: Space, n: int, array: Array | None, terms: list[tuple[Array, Value]],
        square: Value | None = None,
    ) -> None:  # fmt: skip
        self.space = space
        self.n = n
        self.array = array
        self.terms = terms
        self.square = square
        super().__init__(self.at(i) for i in range(n))

    def at(self, i: int | Value) -> Number:
        total: Number = 0 if self.array is None else self.array[i]
        for gain, step in self.terms:
            total = linalg.plus(total, gain[i] * step)
        return total

    def settle(self) -> None:
        """Add what is left to the array, before an array of a gain is used anew."""
        array = self.space.array("moved", self.n)
        with self.space.t.loop("i", 0, self.n) as i:
            array[i] = self.at(i)
        self.array, self.terms = array, []
        self[:] = [array[i] for i in range(self.n)]

    def state(self, place: Callable[[Value], Value]) -> list[Value]:
        """x with it, in the spec's order. place: from an inner position to a state."""
        t = self.space.t
        x = self.space.array("x_next", self.n)
        with t.loop("i", 0, self.n) as i:
            at = place(i)
            x[at] = t.element("kf.x", at) + self.at(i)
        return [x[i] for i in range(self.n)]


def displaced(moved: Vector, gain: Vector, nu: Value) -> Vector:
    """moved + K nu."""
    if isinstance(gain, Displacement):  # already done
        return gain
    if not isinstance(gain, Column):
        return [linalg.plus(m, linalg.times(k, nu)) for m, k in zip(moved, gain, strict=True)]
    space, n = gain.space, len(gain)
    step = space.t.name(nu if gain.factor is None else gain.factor * nu, "step")
    if isinstance(moved, Displacement):
        return Displacement(space, n, moved.array, [*moved.terms, (gain.array, step)])
    return Displacement(space, n, None, [(gain.array, step)])


def learnt(t: Trace, layout: Rolled, Q: AdaptedQ, moved: Displacement) -> Callable[[], None]:
    """Test that the next Q is finite; what stores it."""
    field, n = f"kf.{Q.kept.field}", moved.n
    total = t.variable(t.unique("trace"), 0)
    with t.loop("i", 0, n) as i:
        value = t.element(field, upper_start(i) + i)
        for gain, step in moved.terms:
            dx = gain[i] * step
            value = value + dx * dx
        total.set(total.get() + value)
    guards.finite(t, [total.get()])
    sure = all(is_positive(d) for d in Q.kept.factors(t)[1]) if Q.kept.factored else False
    return lambda: layout.learn(moved, field, Q.rate, sure)


def at_rest(space: Space, n: int) -> Array:
    """The array of a Displacement, at zero."""
    array = space.array("moved", n)
    with space.t.loop("i", 0, n) as i:
        array[i] = 0
    return array


def kept_in_array(t: Trace, x: list[Value], before: list[Value]) -> list[Value]:
    """The new state in a local array until it is stored, but for what has not moved."""
    array = t.array("x_next", len(x))
    moved = {i for i, (value, old) in enumerate(zip(x, before, strict=True)) if value.node is not old.node}
    for i in sorted(moved):
        array[i] = x[i]
    return [array[i] if i in moved else value for i, value in enumerate(x)]


def changed_gain(t: Trace, change: GainChange, gain: Array, difference: Array | None, n: int) -> None:
    """The gain as consider and gain_limit make it, in place; difference: what it has changed by."""
    limit = change.limit
    with t.loop("i", 0, n) as i:
        k = t.name(gain[i], "k_i")
        new = k
        if limit is not None:
            new = t.name(select(k > limit, limit, select(k < -limit, -limit, k)), "k_limited")
            gain[i] = new
        if difference is not None:
            difference[i] = new - k
    for place in sorted(change.considered):
        if difference is not None:
            difference[place] = difference[place] - gain[place]
        gain[place] = 0


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
        self, name: str, arguments: list[Argument], doc: str, body: Callable[[Trace], None]
    ) -> Function:
        """The function of a name; body traces it."""
        if name not in self.made:
            t = Trace(self.smallest)
            body(t)
            names = self.taken | {a.name for a in arguments} | {"x", "kf"}
            self.made[name] = Function(name, arguments, schedule(t, names), doc, returns="void", private=True)
        return self.made[name]


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


def next_gain(space: Space, name: str, n: int, moved: Vector | None, steps: bool) -> Array:
    """The array of a gain; steps: one of its own for every measurement, since all are asked for in the end."""
    if not steps:
        return space.anew(name, n, moved)
    before = len(moved.terms) if isinstance(moved, Displacement) else 0
    return space.array(f"{name}_{before}" if before else name, n)


def select_counter(condition: Value, a: Value, b: Value | int) -> Value:
    """An integer, a where the condition holds."""
    t = condition.trace
    other = integer(t, b) if isinstance(b, int) else b
    return t.wrapped(t.pool.select(condition.node, a.node, other.node))


def fill(t: Trace, array: Array, values: Vector) -> None:
    """All entries of an array."""
    put(t, array.__setitem__, values)
