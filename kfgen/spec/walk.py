"""Node graph + schema -> checked raw data: every key known, used and of the right type, every formula parsed.

A value whose mistake has been reported is None (a formula: `BAD`), and stays silent from then on.
"""

from __future__ import annotations

import re
from typing import Any

from kfgen.errors import Place
from kfgen.spec.expressions import parse_source
from kfgen.spec.findings import Findings
from kfgen.spec.hints import meant_key, missing_key_hint, unknown_key_hint, wanted_words
from kfgen.spec.lexer import ExpressionError
from kfgen.spec.nodes import Bad, Mapping, Node, Scalar, Sequence
from kfgen.spec.problems import did_you_mean, short
from kfgen.spec.raw import BAD, Fields, Formulas, Listed, Path, Word, Written, path_text
from kfgen.spec.shapes import (
    Budget,
    Choice,
    Either,
    Flag,
    Formula,
    Items,
    Record,
    Reference,
    Shape,
    Table,
    Text,
    Tuple,
    Whole,
)
from kfgen.spec.tree import Expression, Name

_BUDGET = re.compile(r"(\d+)\s*([kK])\Z", re.ASCII)


class Walker(Findings):
    """Walks nodes by shapes."""

    # --- values

    def value(self, node: Node, shape: Shape, path: Path) -> Any:
        """The checked value of a node; None where it has been reported."""
        place = self.place(node, path)
        self.values[place.path] = place
        if isinstance(node, Mapping | Sequence) and not node.items:
            self.empty.add(place.path)
        found = self.checked(node, shape, path)
        if found is None:
            self.broken.add(place.path)
        return found

    def checked(self, node: Node, shape: Shape, path: Path) -> Any:
        if isinstance(shape, Record):
            return self.record(node, shape, path)
        if isinstance(shape, Formula | Whole):
            if isinstance(shape, Formula) and shape.shaped and isinstance(node, Sequence):
                return self.listed(node, shape, path)
            return self.formula(node, shape, path)
        if isinstance(node, Bad):
            return None
        if isinstance(shape, Either):
            return self.either(node, shape, path)
        if isinstance(shape, Table):
            return self.table(node, shape, path)
        if isinstance(shape, Items | Tuple):
            return self.items(node, shape, path)
        return self.scalar(node, shape, path)

    def either(self, node: Node, shape: Either, path: Path) -> Any:
        by_kind = {Scalar: shape.scalar, Mapping: shape.mapping, Sequence: shape.sequence}
        chosen = by_kind.get(type(node))
        if chosen is None or (isinstance(node, Scalar) and node.kind == "null"):
            wanted = " or ".join(wanted_words(s) for s in by_kind.values() if s is not None)
            self.wrong(node, path, wanted)
            return None
        return self.value(node, chosen, path)

    def scalar(self, node: Node, shape: Shape, path: Path) -> Any:
        if not isinstance(node, Scalar):
            self.wrong(node, path, wanted_words(shape))
            return None
        if isinstance(shape, Text):
            return self.text(node, path)
        if isinstance(shape, Flag):
            if node.kind == "text" and node.text == shape.off:
                return False
            if node.kind == "boolean":
                return node.text.lower() == "true"
            meant = {"yes": "true", "on": "true", "no": "false", "off": "false"}.get(node.text.lower())
            self.wrong(node, path, "true or false", f"write {meant}" if meant else "")
        elif isinstance(shape, Choice):
            if node.text in shape.values and node.kind == "text":
                return node.text
            if node.kind == "text":
                hint = did_you_mean(node.text, shape.values, "write one of")
                if not hint.startswith("write"):
                    hint += " (one of: " + ", ".join(shape.values) + ")"
                self.problems.add(self.place(node, path), f"{short(node.text)} is not known here", hint)
            else:
                self.wrong(node, path, "one of " + ", ".join(shape.values))
        elif isinstance(shape, Reference):
            if node.kind == "text":
                word = Word(node.text, self.place(node, path))
                self.references.append((shape, word, path))
                return word
            self.wrong(node, path, f"the name of a {shape.words}")
        elif isinstance(shape, Budget):
            return self.budget(node, path)
        return None

    def budget(self, node: Scalar, path: Path) -> Expression | int | None:
        match = _BUDGET.match(node.text)
        if match and len(match.group(1)) <= 9:
            size = int(match.group(1)) * 1024
            if size:
                return size
        if node.kind == "text" and re.fullmatch(r"\d+\s*[a-zA-Z]+", node.text):
            self.problems.add(
                self.place(node, path),
                f"the size {short(node.text)} is not known",
                "write bytes, or k as in 16k",
            )
            return None
        return self.formula(node, Whole(1, 2**40), path)

    def listed(self, node: Sequence, shape: Formula, path: Path) -> Formulas:
        """A vector written as a list, or a matrix as a list of rows."""
        place = self.place(node, path)
        if not node.items:
            self.problems.add(place, "the list is empty", "write a list of numbers: [0, 0, 1]")
            return Expression(BAD, "", place)
        return Listed(tuple(self.value(item, shape, (*path, f"[{i}]")) for i, item in enumerate(node.items)), place)

    def formula(self, node: Node, shape: Formula | Whole, path: Path) -> Expression:
        """A number or an expression; its tree is BAD where it has been reported."""
        place = self.place(node, path)
        scope = shape.scope if isinstance(shape, Formula) else "constant"
        condition = isinstance(shape, Formula) and shape.condition
        words = shape.words if isinstance(shape, Formula) else ()
        bad = Expression(BAD, "", place)
        if isinstance(node, Bad):
            return bad
        wanted = "a condition" if condition else "a number or an expression"
        if not isinstance(node, Scalar):
            self.wrong(node, path, wanted)
            return bad
        if node.kind == "boolean":
            self.wrong(node, path, wanted, "booleans are not numbers")
            return bad
        if node.kind == "null":
            self.wrong(node, path, wanted)
            return bad
        if node.text in words:
            return Expression(Name(node.text), node.text, place)
        self.sources[place] = node
        try:
            source = parse_source(node.text, condition, free=scope in ("initialize", "residual"))
        except ExpressionError as error:
            at = self.problems.at(*node.position(error.offset), place.path)
            self.problems.add(at, error.message, error.hint)
            return bad
        self.parsed[place] = source
        expression = Expression(source.tree, node.text, place)
        self.formulas.append(Written(expression, scope, path))
        if isinstance(shape, Whole):
            self.whole.append((expression, shape))
        return expression

    # --- collections

    def items(self, node: Node, shape: Items | Tuple, path: Path) -> tuple[Any, ...] | None:
        if not isinstance(node, Sequence):
            self.wrong(node, path, f"a list of {shape.what}" if isinstance(shape, Items) else shape.what)
            return None
        length = shape.length if isinstance(shape, Items) else len(shape.items)
        if length is not None and len(node.items) != length:
            if not any(isinstance(item, Bad) for item in node.items):
                what = f"{length} entries are wanted here, not {len(node.items)}"
                self.problems.add(self.place(node, path), what, f"write {shape.what}")
            return None
        shapes = shape.items if isinstance(shape, Tuple) else (shape.item,) * len(node.items)
        found = []
        for i, (item, item_shape) in enumerate(zip(node.items, shapes, strict=True)):
            found.append(self.value(item, item_shape, (*path, f"[{i}]")))
        return tuple(found)

    def table(self, node: Node, shape: Table, path: Path) -> Fields | None:
        if not isinstance(node, Mapping):
            self.wrong(node, path, f"a mapping ({shape.words}: value)")
            return None
        fields = Fields(self.keys.get(path_text(path)) or self.place(node, path), path)
        for key, value in node.items:
            inner = (*path, key.text)
            place = self.problems.at(key.line, key.column, path_text(inner))
            fields.places[key.text] = self.keys[path_text(inner)] = place
            fields.values[key.text] = self.value(value, shape.value, inner)
            if shape.declares:
                self.declared.append((shape.of, key.text, place, inner))
            else:
                self.references.append((Reference(shape.of), Word(key.text, place), inner))
        return fields

    def record(self, node: Node, shape: Record, path: Path) -> Fields:
        fields = Fields(self.keys.get(path_text(path)) or self.place(node, path), path)
        bare = isinstance(node, Sequence) or (isinstance(node, Scalar) and node.kind != "null")
        if bare and shape.bare is not None:  # a value alone
            key = shape.key(shape.bare)
            assert key is not None
            fields.values[shape.bare] = self.value(node, key.shape, path)
            fields.places[shape.bare] = fields.place
            return fields
        if not isinstance(node, Mapping):
            fields.bad = True
            if not isinstance(node, Bad):
                keys = ", ".join(f"{k.name}: ..." for k in shape.keys if k.required) or f"{shape.keys[0].name}: ..."
                if not (isinstance(node, Scalar) and node.kind == "null" and not any(k.required for k in shape.keys)):
                    self.wrong(node, path, "a mapping", f"write {{{keys}}}")
                else:
                    fields.bad = False  # `gyro:` alone: nothing is required
            return fields
        known = [key.name for key in shape.keys]
        for name, value in node.items:
            key = shape.key(name.text)
            inner = (*path, name.text)
            place = self.problems.at(name.line, name.column, path_text(inner))
            if key is None:
                hint = unknown_key_hint(name.text, known, value.text if isinstance(value, Scalar) else "")
                self.problems.add(place, f"unknown key {short(name.text)}", hint)
                self.meant.add(path_text((*path, meant_key(name.text, known))))
                if isinstance(value, Mapping):
                    self.doubtful.update(inner_key.text for inner_key, _ in value.items)
                continue
            fields.places[key.name] = self.keys[path_text(inner)] = place
            fields.values[key.name] = self.value(value, key.shape, inner)
        self.unused(fields, shape)
        for key in shape.keys:
            if key.required and key.name not in fields:
                where = path_text((*path, key.name))
                if where not in self.meant:
                    place = Place(self.problems.file, fields.place.line, fields.place.column, where)
                    self.problems.add(place, f"the key `{key.name}` is missing", missing_key_hint(key))
        return fields

    def unused(self, fields: Fields, shape: Record) -> None:
        """Keys that the chosen type, form or kind does not use are mistakes, even at their defaults."""
        for key in shape.keys:
            only = key.only
            if only is None or key.name not in fields:
                continue
            if only.key in fields and fields.get(only.key) is None:
                continue  # that choice is itself a mistake
            chosen = fields.get(only.key, only.default)
            chosen = "periodic" if isinstance(chosen, Fields) else chosen
            if chosen in only.values:
                continue
            text = f"`{key.name}` is not used by {only.subject} `{chosen}`"
            if only.reason(chosen):
                text += f": {only.reason(chosen)}"
            hint = f"remove it, or choose `{only.key}: {' | '.join(only.values)}`"
            self.problems.add(fields.places[key.name], text, hint)
