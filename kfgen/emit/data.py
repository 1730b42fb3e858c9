"""What the templates see: frozen data, already spelled in C. No algorithm, no option logic."""

from __future__ import annotations

from dataclasses import dataclass

from kfgen.emit.struct import Field, Struct


@dataclass(frozen=True)
class Named:
    """A name with a comment, and whatever spelling belongs to it."""

    name: str
    comment: str = ""
    value: str = ""
    index_name: str = ""
    period: str = ""  # of fixed point: after which the quantity repeats


@dataclass(frozen=True)
class SensorView:
    name: str
    NAME: str
    components: int
    fields: tuple[Named, ...]  # the components, and what else comes with a measurement


@dataclass(frozen=True)
class Data:
    """A static const array, or a block of the header's comment."""

    name: str = ""
    title: str = ""
    comment: str = ""
    size: int = 0
    reader: str = ""  # the macro that reads an entry
    lines: tuple[str, ...] = ()


@dataclass(frozen=True)
class FunctionView:
    name: str  # without the prefix
    arguments: tuple[str, ...]  # their names
    doc: str
    comment: tuple[str, ...]  # the doc of a private function
    parameters: tuple[str, ...]
    returns: tuple[str, ...]
    costs: tuple[str, ...]
    prototype: tuple[str, ...]
    definition: tuple[str, ...]
    opening: tuple[str, ...]
    body: tuple[str, ...]
    closing: str
    private: bool


@dataclass(frozen=True)
class ScalarView:
    name: str
    fraction_bits: int | None  # fixed point only
    c_type: str
    helpers: str
    zero: str
    one: str
    ceil: str


@dataclass(frozen=True)
class Routines:
    """What the template of the integer routines is given."""

    ops: tuple[str, ...]
    own: tuple[str, ...]
    tables: object
    floor: bool


@dataclass(frozen=True)
class View:
    name: str
    NAME: str
    guard: str
    command: str
    title: str
    description: tuple[str, ...]
    filter: str
    version: str
    sympy: str
    sha256: str
    ram: int
    scalar: ScalarView
    states: tuple[Named, ...]
    state_table: tuple[str, ...]
    reference: tuple[Data, ...]
    cost_table: tuple[str, ...]
    advice: tuple[str, ...]
    inputs: tuple[Named, ...]
    sensors: tuple[SensorView, ...]
    parameters: tuple[Named, ...]
    outputs: tuple[Named, ...]
    modes: tuple[Struct, ...]
    fields: tuple[Field, ...]
    statuses: tuple[Named, ...]
    functions: tuple[FunctionView, ...]
    constants: tuple[Data, ...]
    tables: tuple[Data, ...]
    helpers: tuple[str, ...]
    uses_math: bool
    units: tuple[Named, ...]  # fixed point: quantity -> the value of raw 1
    routines: Routines | None  # fixed point
