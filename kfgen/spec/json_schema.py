"""The language as JSON Schema (2020-12), made from the same tables that validate a spec: for editors.

It tells the structure: keys, what kind of value each takes, which words it may be. What an expression may use, and what
algebra forbids, only `kfgen` knows.
"""

from __future__ import annotations

import json
from typing import Any

from kfgen.spec.names import MAX_NAME
from kfgen.spec.schema import TOP
from kfgen.spec.shapes import (
    Budget,
    Choice,
    Either,
    Flag,
    Formula,
    Items,
    Key,
    Record,
    Reference,
    Shape,
    Table,
    Text,
    Tuple,
    Whole,
)

DIALECT = "https://json-schema.org/draft/2020-12/schema"
Schema = dict[str, Any]

_NAME = rf"^[A-Za-z][A-Za-z0-9_]{{0,{MAX_NAME - 1}}}$"
_EXPRESSION: Schema = {"type": ["number", "string"]}
_ROW: Schema = {"type": "array", "items": _EXPRESSION}


def json_schema() -> Schema:
    """The schema of a whole spec; each kind of mapping is a definition of its own."""
    return _Writer().whole()


def text() -> str:
    """The schema as a file."""
    return json.dumps(json_schema(), indent=2) + "\n"


class _Writer:
    def __init__(self) -> None:
        self.definitions: dict[str, Schema] = {}
        self.names: dict[int, str] = {}  # id of a record -> its definition

    def whole(self) -> Schema:
        top = self.mapping(TOP)
        return {
            "$schema": DIALECT,
            "title": "kfgen spec, version 1",
            "$comment": "Written by `kfgen schema`.",
            **top,
            "$defs": dict(sorted(self.definitions.items())),
        }

    def schema(self, shape: Shape) -> Schema:
        match shape:
            case Text():
                return {"type": ["string", "number"]}
            case Choice(values):
                return {"enum": list(values)}
            case Flag(off):
                return {"enum": [True, False, off]} if off else {"type": "boolean"}
            case Formula(shaped=True):
                return {"anyOf": [_EXPRESSION, {"type": "array", "items": {"anyOf": [_EXPRESSION, _ROW]}}]}
            case Formula():
                return dict(_EXPRESSION)
            case Whole(low, high):
                if low == high:
                    return {"const": low}
                number = {"type": "integer", "minimum": low} | ({} if high is None else {"maximum": high})
                return {"anyOf": [number, {"type": "string"}]}
            case Budget():
                return {"anyOf": [{"type": "integer", "minimum": 1}, {"type": "string"}]}
            case Reference():
                return {"type": "string"}
            case Items(item, what, length):
                sized = {} if length is None else {"minItems": length, "maxItems": length}
                return {"type": "array", "description": f"A list of {what}.", "items": self.schema(item), **sized}
            case Tuple(items, what):
                count = len(items)
                inner = [self.schema(item) for item in items]
                return {
                    "type": "array", "description": what, "prefixItems": inner, "minItems": count, "maxItems": count,
                }  # fmt: skip
            case Table(of, value):
                return {
                    "type": "object", "description": f"{of}: value", "propertyNames": {"pattern": _NAME},
                    "additionalProperties": self.schema(value),
                }  # fmt: skip
            case Record():
                return self.record(shape)
            case Either(scalar, mapping, sequence):
                return {"anyOf": [self.schema(each) for each in (scalar, mapping, sequence) if each is not None]}
        raise TypeError(f"{type(shape).__name__} has no JSON Schema yet")

    def record(self, record: Record) -> Schema:
        """A reference to a mapping; beside it what a scalar in its place stands for."""
        name = self.names.get(id(record))
        if name is None:
            name, count = record.name, 2
            while name in self.definitions:
                name, count = f"{record.name}_{count}", count + 1
            self.names[id(record)] = name
            self.definitions[name] = {}  # taken, while what is inside is written
            self.definitions[name] = self.mapping(record)
        found: Schema = {"$ref": f"#/$defs/{name}"}
        key = None if record.bare is None else record.key(record.bare)
        if key is not None:
            return {"anyOf": [self.schema(key.shape), found]}
        empty = not any(each.required for each in record.keys)
        return {"anyOf": [found, {"type": "null"}]} if empty else found  # `gyro:` alone

    def mapping(self, record: Record) -> Schema:
        found: Schema = {
            "type": "object",
            "properties": {key.name: self.key(key) for key in record.keys},
            "required": [key.name for key in record.keys if key.required],
            "additionalProperties": False,
        }
        limited = {key.name: _only(key) for key in record.keys if key.only is not None}
        return found | ({"dependentSchemas": limited} if limited else {})

    def key(self, key: Key) -> Schema:
        text = key.doc
        if key.default:
            text += f" Default: {key.default}."
        found = self.schema(key.shape)
        return {"description": text, **{name: value for name, value in found.items() if name != "description"}}


def _only(key: Key) -> Schema:
    """What must hold beside a key that only some choices of another one use."""
    only = key.only
    assert only is not None
    chosen: Schema = {"properties": {only.key: {"enum": list(only.values)}}}
    return chosen if only.default in only.values else {**chosen, "required": [only.key]}
