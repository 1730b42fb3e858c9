"""Tracing: numbers that record what is done with them.

An algorithm written for numbers runs on `Value`s and leaves a program behind. Structural zeros and ones
fold as it runs, so the algorithm is written in full and what is emitted is what is left.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction

from kfgen.ir.nodes import BOOL, INT, REAL, Constants, Node, Table
from kfgen.ir.program import (
    Assign,
    Call,
    Declare,
    Flag,
    For,
    Function,
    Guard,
    If,
    Section,
    Slice,
    Store,
)  # fmt: skip
from kfgen.ir.recording import Block, RecordingPool

Number = int | Fraction
RAISED = "flags"  # the status of a guard that returns what has been raised


class Value:
    """A number of the traced program: arithmetic and comparisons make further Values."""

    __slots__ = ("node", "trace")

    def __init__(self, trace: Trace, node: Node) -> None:
        self.trace = trace
        self.node = node

    def _binary(self, operation: str, a: Value | Number, b: Value | Number) -> Value:
        t = self.trace
        kind = self.node.kind
        return t.wrapped(getattr(t.pool, operation)(t.node(a, kind), t.node(b, kind)))

    def __add__(self, other: Value | Number) -> Value:
        return self._binary("add", self, other)

    def __radd__(self, other: Number) -> Value:
        return self._binary("add", other, self)

    def __sub__(self, other: Value | Number) -> Value:
        return self._binary("sub", self, other)

    def __rsub__(self, other: Number) -> Value:
        return self._binary("sub", other, self)

    def __mul__(self, other: Value | Number) -> Value:
        return self._binary("mul", self, other)

    def __rmul__(self, other: Number) -> Value:
        return self._binary("mul", other, self)

    def __truediv__(self, other: Value | Number) -> Value:
        return self._binary("div", self, other)

    def __rtruediv__(self, other: Number) -> Value:
        return self._binary("div", other, self)

    def __neg__(self) -> Value:
        return self.trace.wrapped(self.trace.pool.neg(self.node))

    def __lt__(self, other: Value | Number) -> Value:
        return self._binary("less", self, other)

    def __le__(self, other: Value | Number) -> Value:
        return self._binary("less_equal", self, other)

    def __gt__(self, other: Value | Number) -> Value:
        return self._binary("less", other, self)

    def __ge__(self, other: Value | Number) -> Value:
        return self._binary("less_equal", other, self)

    def __and__(self, other: Value) -> Value:
        return self._binary("both", self, other)

    def __or__(self, other: Value) -> Value:
        return self._binary("either", self, other)

    def __invert__(self) -> Value:
        return self.trace.wrapped(self.trace.pool.negate(self.node))

    @property
    def constant(self) -> Fraction | None:
        return self.node.constant

    def __repr__(self) -> str:
        return f"Value({self.node!r})"


class Trace:
    """The recording of one function."""

    in_place = True  # what is loaded is what stands where it will be stored
    stores = True  # stores are made, and not collected

    def __init__(self, smallest: Fraction | int = 0) -> None:
        self.smallest = smallest  # a number not above it counts as zero where it divides
        self.pool = RecordingPool()
        self.blocks: dict[int, Block] = {}  # id(For or If) -> its recorded body
        self.raised: list[tuple[Value, str]] = []  # conditions of warnings, and which
        self.depth = 0  # of loops and branches
        self.names: dict[Node, str] = {}
        self.arguments_at: int | None = None  # where in the body what the function is given is tested
        self.needed: dict[str, Value] = {}  # path of something given -> whether it counts, where it does not always
        self.closings: list[Callable[[], None]] = []  # record what is all but never done, when all else has been
        self.doubts: list[tuple[Value, str]] = []  # conditions under which an assumption made fails, and why
        self.declared: Counter[str] = Counter()
        self.declared_signs: Mapping[str, int] = {}  # of fields, by their path, where a question supposes them
        self.signs: dict[Node, int] = {}  # what is known of the sign of values (see filters.numbers)

        self.zero = self.wrapped(self.pool.zero)
        self.one = self.wrapped(self.pool.one)

    @property
    def block(self) -> Block:
        """What is recorded at present."""
        return self.pool.block

    # values ----------------------------------------------------------------------------------------

    def wrapped(self, node: Node) -> Value:
        return Value(self, node)

    def node(self, value: Value | Number, kind: str = "real") -> Node:
        if isinstance(value, Value):
            return value.node
        return self.pool.integer(int(value)) if kind == INT else self.pool.constant(value)

    def value(self, number: Value | Number) -> Value:
        return self.wrapped(self.node(number))

    def field(self, path: str, kind: str = REAL) -> Value:
        """A number that the function is given: `u.gyro`, `z.x`, `dt`, `kf.nis`."""
        return self.wrapped(self.pool.make("field", (), path, kind))

    def element(self, path: str, index: int | Value) -> Value:
        """An element of an array that the function is given: `kf.x`, `kf.U`, `P`."""
        return self.wrapped(self.pool.make("element", (self.node(index, INT),), path))

    def function(self, op: str, *args: Value | Number) -> Value:
        return self.wrapped(self.pool.function(op, *[self.node(a) for a in args]))

    def wrap(self, a: Value, period: Fraction) -> Value:
        return self.wrapped(self.pool.wrap(a.node, period))

    def table(self, a: Value, table: Table, slope: bool = False) -> Value:
        return self.wrapped(self.pool.table(a.node, table, slope))

    def select(self, condition: Value, a: Value | Number, b: Value | Number) -> Value:
        return self.wrapped(self.pool.select(condition.node, self.node(a), self.node(b)))

    def finite(self, a: Value) -> Value:
        """Whether a number is neither infinite nor NaN."""
        if a.constant is not None:
            return self.wrapped(self.pool.boolean(True))
        return self.wrapped(self.pool.make("finite", (a.node,), kind=BOOL))

    def constants(self, values: tuple[Fraction, ...], index: Value, name: str) -> Value:
        """An entry of a table of constants."""
        return self.wrapped(self.pool.make("lookup", (index.node,), Constants(values, name)))

    def sign(self, value: Value, before: Value | None) -> Value:
        """A word that is not 0 where the sign bit of a number is set, or `before` is not 0: a test without a branch."""
        return self.name(self.wrapped(self.pool.signs(value.node, None if before is None else before.node)), "signs")

    def bit(self, path: str, place: int) -> Value:
        """Whether a bit of an integer argument is set."""
        return self.wrapped(self.pool.make("bit", (), (path, place), BOOL))

    def name(self, value: Value, name: str) -> Value:
        """Keep a value under a name of the model; constants and what has a name keep theirs."""
        if value.node.op not in ("const", "field") and value.node not in self.names:
            self.names[value.node] = name
        return value

    # statements ------------------------------------------------------------------------------------

    def section(self, text: str) -> None:
        self.block.items.append(Section(text))

    def store(self, name: str, index: int | Value | None, value: Value) -> None:
        self.block.items.append(Store(name, None if index is None else self.node(index, INT), value.node))

    def guard(self, condition: Value, status: str, why: str = "", before: list[Store] | None = None) -> None:
        """End with an error where the condition holds; a condition known to be false leaves nothing."""
        if condition.constant == 0:
            return
        self.block.items.append(Guard(condition.node, status, before or [], why))

    def leave(self) -> None:
        """End here, with the flags that have been raised."""
        self.block.items.append(Guard(self.pool.boolean(True), RAISED))

    def flag(self, condition: Value, flag: str) -> None:
        """Warn with this flag where the condition holds."""
        if condition.constant != 0:
            self.raised.append((condition, flag))
            self.block.items.append(Flag(condition.node, flag))

    def call(self, callee: Function, args: list[str | tuple[str, int | Value] | Value]) -> None:
        """Run a private function: `kf` or `u` by name, (array, offset), numbers."""
        given: list[str | Slice | Node] = []
        for a in args:
            if isinstance(a, tuple):
                given.append(Slice(a[0], self.node(a[1], INT)))
            else:
                given.append(a if isinstance(a, str) else a.node)
        self.block.items.append(Call(callee, given))

    def array(self, name: str, size: int) -> Array:
        """A local array, not initialised."""
        self.block.items.append(Declare(name, size))
        return Array(self, name)

    def unique(self, base: str) -> str:
        """A name for a local array or variable that no other one asked for here has."""
        self.declared[base] += 1
        return base if self.declared[base] == 1 else f"{base}_{self.declared[base]}"

    def variable(self, name: str, value: Value | Number) -> Variable:
        """A local that may be assigned again, as loops need."""
        self.block.items.append(Declare(name, None, self.node(value)))
        return Variable(self, name)

    def later(self, closing: Callable[[], None]) -> None:
        """Record something in the end."""
        self.closings.append(closing)

    @contextmanager
    def loop(self, variable: str, start: int | Value, stop: int | Value, down: bool = False) -> Iterator[Value]:
        """A loop over variable = start .. stop - 1 (downwards if asked); yields the counter."""
        counter = self.pool.fresh("counter", (), variable, INT)
        counter.volatile = False
        statement = For(variable, self.node(start, INT), self.node(stop, INT), [], down)
        with self._scope(statement):
            yield self.wrapped(counter)

    @contextmanager
    def when(self, condition: Value, rare: bool = False) -> Iterator[None]:
        """What is done where the condition holds. rare: all but never."""
        with self._scope(If(condition.node, [], rare)):
            yield

    @contextmanager
    def _scope(self, statement: For | If) -> Iterator[None]:
        self.block.items.append(statement)
        outer, self.pool.block = self.block, Block()
        self.blocks[id(statement)] = self.block
        mark = self.pool.mark()
        self.depth += 1
        yield
        self.depth -= 1
        self.pool.forget(mark)  # what was made inside is not in scope outside
        self.pool.block = outer


@dataclass(frozen=True)
class Array:
    """A local array of the traced function."""

    trace: Trace
    name: str

    def __getitem__(self, index: int | Value) -> Value:
        t = self.trace
        return t.wrapped(t.pool.fresh("read", (t.node(index, INT),), self.name, "real"))

    def __setitem__(self, index: int | Value, value: Value | Number) -> None:
        t = self.trace
        t.block.items.append(Assign(self.name, t.node(index, INT), t.node(value)))


@dataclass(frozen=True)
class Variable:
    """A local variable of the traced function."""

    trace: Trace
    name: str

    def get(self) -> Value:
        return self.trace.wrapped(self.trace.pool.fresh("read", (), self.name, "real"))

    def set(self, value: Value | Number) -> None:
        self.trace.block.items.append(Assign(self.name, None, self.trace.node(value)))
