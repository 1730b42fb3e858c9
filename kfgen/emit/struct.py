"""The filter's struct as C declares it, and its size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby

from kfgen.filters.base import Block
from kfgen.scalars import Scalar

_MODES = "modes."


@dataclass(frozen=True)
class Field:
    """A field: its comment is padded to those around it. fields: those of a struct without a name."""

    name: str
    type: str
    dimension: str = ""
    comment: str = ""
    fields: tuple[Field, ...] = ()


@dataclass(frozen=True)
class Struct:
    """A type of its own: the fields of a mode."""

    name: str
    mode: str
    fields: tuple[Field, ...]


def fields(prefix: str, blocks: Sequence[Block], parameters: bool) -> tuple[Field, ...]:
    """The fields of the filter; the modes of a bank stand in a struct `modes`."""
    rows: list[Field] = []
    for modes, group in groupby(blocks, key=lambda block: block.name.startswith(_MODES)):
        if modes:
            names = dict.fromkeys(block.name.split(".")[1] for block in group)
            inner = tuple(Field(name, mode_type(prefix, name)) for name in names)
            rows.append(Field("modes", "struct", fields=inner, comment="the filters of the modes"))
            continue
        for block in group:
            if block.name == "nis" and parameters:
                text = "may be changed while the filter runs"
                rows.append(Field("parameters", f"{prefix}_parameters_t", comment=text))
            rows.append(_field(prefix, block))
    return _aligned(rows)


def modes(prefix: str, blocks: Sequence[Block]) -> tuple[Struct, ...]:
    """The types of the modes of a bank."""
    found: dict[str, list[Field]] = {}
    for block in blocks:
        if block.name.startswith(_MODES):
            _, mode, name = block.name.split(".")
            field = _field(prefix, block)
            found.setdefault(mode, []).append(Field(name, field.type, field.dimension, field.comment))
    return tuple(Struct(mode_type(prefix, mode), mode, _aligned(rows)) for mode, rows in found.items())


def mode_type(prefix: str, mode: str) -> str:
    return f"{prefix}_mode_{mode}_t"


def _field(prefix: str, block: Block) -> Field:
    types = {"real": f"{prefix}_real_t", "uint32": "uint32_t", "bool": "bool"}
    return Field(block.name, types[block.kind], "" if block.size is None else f"[{block.size}]", block.doc)


def _aligned(rows: list[Field]) -> tuple[Field, ...]:
    """Comments in one column."""
    width = max(_width(r) for r in rows if not r.fields)
    pads = [1 if r.fields else width - _width(r) + 1 for r in rows]
    return tuple(replace(r, comment=" " * pad + f"/* {r.comment} */") for r, pad in zip(rows, pads, strict=True))


def _width(field: Field) -> int:
    return len(field.type + field.name + field.dimension)


def ram(scalar: Scalar, blocks: Sequence[Block], parameters: int) -> int:
    """sizeof of the struct, with natural alignment."""
    size, align = 0, 1

    def put(bytes_: int, alignment: int) -> None:
        nonlocal size, align
        size = -(-size // alignment) * alignment + bytes_
        align = max(align, alignment)

    for mode, group in groupby(blocks, key=lambda block: block.name.rpartition(".")[0]):
        if mode:
            inner = [Block(block.name.rpartition(".")[2], block.size, "", block.kind) for block in group]
            widest = max(_bytes(scalar, block) for block in inner)
            put(ram(scalar, inner, 0), widest)
            continue
        for block in group:
            put(_bytes(scalar, block) * (block.size or 1), _bytes(scalar, block))
    if parameters:
        put(scalar.size * parameters, scalar.size)
    return -(-size // align) * align


def _bytes(scalar: Scalar, block: Block) -> int:
    return {"real": scalar.size, "uint32": 4, "bool": 1}[block.kind]
