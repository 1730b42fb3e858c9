"""Definitions: their shapes follow from their formulas, whatever the order in which they are written."""

from __future__ import annotations

from dataclasses import replace

from kfgen.spec.raw import BAD, Fields, Path
from kfgen.spec.shaping.extents import NUMBER, Extent
from kfgen.spec.shaping.formulas import FormulaReader, Value
from kfgen.spec.shaping.vectors import VectorReader
from kfgen.spec.tree import Expression, names

_PLAIN = frozenset(("part.", "index", "list", "matmul"))


class Definitions:
    """The `let` of the spec and of its modes."""

    def __init__(self, reader: FormulaReader, vectors: VectorReader) -> None:
        self.reader, self.vectors = reader, vectors
        self.lets: dict[Path, Fields] = {}
        self.values: dict[Path, dict[str, Value]] = {}

    def collect(self, lets: list[tuple[Path, Fields]]) -> None:
        self.lets = dict(lets)

    def shapes(self, path: Path) -> list[tuple[str, Extent, tuple[str, ...]]]:
        """name, shape and parts of each definition of a section, those that others use first."""
        let = self.lets[path]
        found = self.values[path] = {}
        known = self.reader.symbols.known
        for name in let.values:
            known.pop(name, None)
        out: list[tuple[str, Extent, tuple[str, ...]]] = []
        for name in _ordered(let):
            value = self.reader.value(let.values[name])
            found[name] = value
            extent = NUMBER if value.bad else value.extent
            parts = self.vectors.names(name, extent)
            out.append((name, extent, parts))
            known[name] = self.vectors.shaped(extent, parts, ())  # for those that follow
        return out

    def flat(self, path: Path) -> Fields:
        let = self.lets[path]
        flat = replace(let, values={}, places={})
        for name, raw in let.values.items():
            value = self.values[path].get(name)
            if value is None:
                flat.values[name] = raw
                continue
            parts = self.vectors.names(name, NUMBER if value.bad else value.extent)
            for part, expression in zip(parts, value.parts, strict=False):
                flat.values[part], flat.places[part] = expression, let.at(name)
        return flat


def _ordered(let: Fields) -> list[str]:
    """Names in an order in which each uses only those before it, as far as there is one."""
    uses: dict[str, list[str]] = {}
    for name, raw in let.values.items():
        if raw is not None:
            uses[name] = [n for n in dict.fromkeys(_names(raw)) if n in let.values]
    order: list[str] = []
    done: set[str] = set()
    for start in uses:
        stack = [(start, iter(uses[start]))] if start not in done else []
        done.add(start)
        while stack:
            name, rest = stack[-1]
            following = next((n for n in rest if n not in done and n in uses), None)
            if following is None:
                order.append(name)
                stack.pop()
            else:
                done.add(following)
                stack.append((following, iter(uses[following])))
    return order


def _names(raw: object) -> list[str]:
    """The names in a formula or a list."""
    if isinstance(raw, Expression):
        return [] if raw.tree == BAD else list(names(raw.tree))
    return [name for item in getattr(raw, "items", ()) for name in _names(item)]
