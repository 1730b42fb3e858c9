"""The recording of a function of a bank: what is kf.x to the filter of a mode is kf.modes.<mode>.x to the bank."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from functools import reduce
from operator import or_

from kfgen.ir.program import Function, Store
from kfgen.ir.trace import Array, Trace, Value, Variable


@dataclass
class Scope:
    """A mode: its name, and the names of its fields in the struct.

    given: values that stand for elements of its fields, as path -> index -> value. arrays: local arrays that stand
    for fields, or hold what is given, for loops. renamed: its names of local arrays and variables -> the names that
    they have.
    """

    mode: str
    fields: frozenset[str]
    given: Mapping[str, Mapping[int, Value]] = field(default_factory=dict)
    arrays: dict[str, Array] = field(default_factory=dict)
    renamed: dict[str, str] = field(default_factory=dict)


class BankTrace(Trace):
    """Within `of(scope)`, paths and the names of locals are those of a mode."""

    in_place = False

    def __init__(self, smallest: Fraction | int = 0) -> None:
        super().__init__(smallest)
        self.scope: Scope | None = None
        self.captured: dict[str, dict[int, Value]] | None = None
        self._later: list[tuple[Scope, Value, str]] = []
        self._locals: set[str] = set()

    @contextmanager
    def of(self, scope: Scope) -> Iterator[None]:
        """What is recorded here is code of that mode."""
        outer, self.scope = self.scope, scope
        yield
        self.scope = outer

    @contextmanager
    def capture(self) -> Iterator[dict[str, dict[int, Value]]]:
        """Stores are not made but collected, as path -> index -> value."""
        self.captured, self.stores = {}, False
        yield self.captured
        self.captured, self.stores = None, True

    def later(self, closing: Callable[[], None]) -> None:
        scope = self.scope

        def scoped() -> None:
            outer, self.scope = self.scope, scope
            closing()
            self.scope = outer

        super().later(scoped)

    def materialise(self, scope: Scope, fields: Mapping[str, Mapping[int, Value]]) -> None:
        """Put values that a mode is given into local arrays, which loops can read."""
        with self.of(scope):
            for path, values in fields.items():
                array = self.array(path.removeprefix("kf."), len(values))
                for index, value in values.items():
                    array[index] = value
                scope.arrays[path] = array

    def settle(self) -> None:
        """End with the NOT_POSITIVE that a mode has met: after the NOT_FINITE of any."""
        later, self._later = self._later, []
        for _, condition, why in later:
            super().guard(condition, "NOT_POSITIVE", why)

    # what a mode does --------------------------------------------------------------------------------

    def _path(self, path: str) -> str:
        scope = self.scope
        if scope is None or not path.startswith("kf.") or path[3:] not in scope.fields:
            return path
        return f"kf.modes.{scope.mode}.{path[3:]}"

    def field(self, path: str, kind: str = "real") -> Value:
        return super().field(self._path(path), kind)

    def element(self, path: str, index: int | Value) -> Value:
        scope = self.scope
        if scope is not None and path in scope.given:
            at = index if isinstance(index, int) else index.constant
            return scope.arrays[path][index] if at is None else scope.given[path][int(at)]
        if scope is not None and path in scope.arrays:
            return scope.arrays[path][index]
        return super().element(self._path(path), index)

    def store(self, name: str, index: int | Value | None, value: Value) -> None:
        if self.captured is not None:
            assert isinstance(index, int)
            self.captured.setdefault(name, {})[index] = value
            return
        path = self._path(name)
        if isinstance(index, int) and value.node is super().element(path, index).node:
            return  # it stands there already
        super().store(path, index, value)

    def guard(self, condition: Value, status: str, why: str = "", before: list[Store] | None = None) -> None:
        scope = self.scope
        if scope is not None and not before:
            if status == "NOT_POSITIVE" and self.depth == 0:
                self._later.append((scope, condition, why))
                return
            met = [c for owner, c, _ in self._later if owner is scope]
            if met and status == "NOT_FINITE":  # of a mode the first error counts, whatever comes of it
                condition = condition & ~reduce(or_, met)
        super().guard(condition, status, why, before)

    def section(self, text: str) -> None:
        super().section(text if self.scope is None else f"{self.scope.mode}: {text}")

    def name(self, value: Value, name: str) -> Value:
        return super().name(value, name if self.scope is None else f"{name}_{self.scope.mode}")

    def array(self, name: str, size: int) -> Array:
        return super().array(self._local(name), size)

    def variable(self, name: str, value: Value | int | Fraction) -> Variable:
        return super().variable(self._local(name), value)

    def call(self, callee: Function, args: list[str | tuple[str, int | Value] | Value]) -> None:
        def placed(argument: str | tuple[str, int | Value] | Value) -> str | tuple[str, int | Value] | Value:
            if not isinstance(argument, tuple):
                return argument
            name, offset = argument
            if self.scope is not None and name in self.scope.arrays:
                return self.scope.arrays[name].name, offset
            if self.scope is not None and name in self.scope.renamed:
                return self.scope.renamed[name], offset
            return self._path(name), offset

        super().call(callee, [placed(a) for a in args])

    def _local(self, name: str) -> str:
        """A name for a local array or variable of the mode, which no other has."""
        if self.scope is None:
            return name
        base = own = f"{name}_{self.scope.mode}"
        count = 1
        while own in self._locals:
            count += 1
            own = f"{base}_{count}"
        self._locals.add(own)
        self.scope.renamed[name] = own
        return own
