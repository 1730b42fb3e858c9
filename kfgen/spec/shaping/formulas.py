"""Raw formulas, as the walker left them -> expressions of numbers: one for each part of what is wanted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from kfgen.errors import Place
from kfgen.spec.lexer import ExpressionError
from kfgen.spec.raw import BAD, Fields, Formulas, Listed, Written
from kfgen.spec.shaping.algebra import listed
from kfgen.spec.shaping.expand import Expander, fitted
from kfgen.spec.shaping.extents import NUMBER, Extent, Shaped, ShapeError
from kfgen.spec.shaping.symbols import Here, Symbols
from kfgen.spec.tree import Expression
from kfgen.spec.types import Definition
from kfgen.spec.walk import Walker

Local = Mapping[str, Shaped]


class Value:
    """A formula that has been expanded: its shape, and an expression for each part."""

    def __init__(self, extent: Extent, parts: tuple[Expression, ...], suffixes: tuple[str, ...], unknown: bool) -> None:
        self.extent, self.parts, self.suffixes, self.unknown = extent, parts, suffixes, unknown

    @property
    def bad(self) -> bool:
        return any(part.tree == BAD for part in self.parts)


class FormulaReader:
    """Expands the formulas of a spec, and remembers what became of each."""

    def __init__(self, walker: Walker, symbols: Symbols) -> None:
        self.walker, self.symbols = walker, symbols
        self.problems = walker.problems
        self.written = {w.expression.place: w for w in walker.formulas}
        self.finished: dict[Place, tuple[Expression, ...]] = {}

    def value(self, raw: Formulas, local: Local | None = None, own: list[Definition] | None = None) -> Value:
        """A formula or a list, whatever its shape."""
        if isinstance(raw, Listed):
            return self._list(raw, local, own)
        written = self.written.get(raw.place)
        if raw.tree == BAD or written is None:
            return Value(NUMBER, (raw,), (), True)
        here = Here(self.symbols, written.scope, written.path, raw.place, local, own)
        try:
            found = Expander(here, self.walker.parsed[raw.place]).whole()
        except ExpressionError as error:
            if not here.unknown:
                self.problems.add(self.walker.offset_place(raw, error.offset), error.message, error.hint)
            return Value(NUMBER, (replace(raw, tree=BAD),), (), True)
        parts = tuple(replace(raw, tree=tree) if tree is not raw.tree else raw for tree in found.parts)
        self.finished[raw.place] = parts
        return Value(found.extent, parts, found.suffixes, here.unknown)

    def _list(self, raw: Listed, local: Local | None, own: list[Definition] | None) -> Value:
        items = [self.value(item, local, own) for item in raw.items]
        unknown = any(item.unknown for item in items)
        bad = Value(NUMBER, (Expression(BAD, "", raw.place),), (), True)
        if any(item.bad for item in items):
            return bad
        try:
            trees = [Shaped(item.extent, tuple(part.tree for part in item.parts)) for item in items]
            extent = listed(trees).extent
        except ShapeError as error:
            if not unknown:
                self.problems.add(raw.place, error.message, error.hint)
            return bad
        return Value(extent, tuple(part for item in items for part in item.parts), (), unknown)

    def number(self, raw: Expression, local: Local | None = None, own: list[Definition] | None = None) -> Expression:
        """A formula where one number is wanted."""
        return self.parts(raw, NUMBER, "a number is wanted here", "write one number, or one part of it", local, own)[0]

    def parts(
        self, raw: Any, extent: Extent, what: str, hint: str, local: Local | None = None,
        own: list[Definition] | None = None, spread: bool = True,
    ) -> tuple[Expression, ...]:  # fmt: skip
        """The parts of a formula where a shape is wanted: a number stands for all, unless not `spread`."""
        if raw is None:
            return (None,) * extent.size  # type: ignore[return-value] # reported: stays silent
        return self.fit(self.value(raw, local, own), raw.place, extent, what, hint, spread)

    def fit(
        self, value: Value, place: Place, extent: Extent, what: str, hint: str, spread: bool = True
    ) -> tuple[Expression, ...]:
        if value.bad:
            return (value.parts[0],) * extent.size
        trees = Shaped(value.extent, tuple(part.tree for part in value.parts))
        if fitted(trees, extent, spread) is None:
            bad = Expression(BAD, value.parts[0].text, place)
            if not value.unknown:
                self.problems.add(place, f"{what}, not {value.extent}", hint)
            return (bad,) * extent.size
        return value.parts * (extent.size if value.extent == NUMBER else 1)

    def plain(self, raw: Any, local: Local | None = None) -> Any:
        """Raw data of any kind in which every formula is a number."""
        if isinstance(raw, Expression):
            return self.number(raw, local)
        if isinstance(raw, Listed):
            self.value(raw, local)
            return None
        if isinstance(raw, tuple):
            return tuple(self.plain(each, local) for each in raw)
        if isinstance(raw, Fields):
            return replace(raw, values={key: self.plain(each, local) for key, each in raw.values.items()})
        return raw

    def finish(self) -> None:
        """Leave the walker with what became of its formulas."""
        formulas: list[Written] = []
        for w in self.walker.formulas:
            parts = self.finished.get(w.expression.place)
            formulas.append(replace(w, parts=parts if parts is not None else (replace(w.expression, tree=BAD),)))
        self.walker.formulas = formulas
        finished = {place: parts[0] for place, parts in self.finished.items()}
        self.walker.whole = [(finished.get(e.place, e), shape) for e, shape in self.walker.whole]
