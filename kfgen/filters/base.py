"""What a filter hands to the emitter: its storage and its functions. Everything emitted derives from these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from kfgen.ir.nodes import Constants, Table
from kfgen.ir.program import Argument, Function
from kfgen.model import Model
from kfgen.model.model import SensorModel


@dataclass(frozen=True)
class Block:
    """A field of the filter's struct: `size` numbers (None: a single one).

    compact: what is initially the same nearly everywhere is set everywhere first. entries: what each number is called
    where it is read by its place (`p_px_vx`); empty where numbers are read in loops.
    points: of fixed point, the exponent of each number's raw 1.
    """

    name: str
    size: int | None
    doc: str
    kind: str = "real"  # real | uint32 | bool
    initial: tuple[Fraction, ...] = ()
    compact: bool = False
    entries: tuple[str, ...] = ()
    points: tuple[int, ...] = ()


@dataclass(frozen=True)
class ModeNote:
    """A mode of a bank. order: inner position -> state, where the generator has chosen it."""

    name: str
    description: str
    order: tuple[int, ...]
    model: Model


@dataclass(frozen=True)
class FilterCode:
    """A filter ready to print."""

    model: Model
    blocks: tuple[Block, ...]
    functions: tuple[Function, ...]
    order: tuple[int, ...]  # inner position -> state of the spec
    description: str  # "EKF, U D U^T covariance, Bierman update"
    notes: tuple[str, ...] = ()
    constants: Mapping[str, tuple[int, ...]] = field(default_factory=dict)  # static const tables of indices
    tables: Mapping[Table, str] = field(default_factory=dict)
    lookups: Mapping[Constants, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()  # for the build's table
    modes: tuple[ModeNote, ...] = ()  # of a bank
    forms: Mapping[str, str] = field(default_factory=dict)  # function -> loops or unrolled, where that was chosen


KF = Argument("kf", "{name}_t", pointer=True, constant=False, doc="filter")
CONST_KF = Argument("kf", "{name}_t", pointer=True, doc="filter")
INPUTS = Argument("u", "{name}_inputs_t", pointer=True)
MASK = Argument("mask", "uint32_t", pointer=False, doc="bit i: use component i")
DT = Argument("dt", "{name}_real_t", pointer=False, doc="time step [s]")


def sensor_argument(sensor: str) -> Argument:
    return Argument("z", "{name}_" + sensor + "_t", pointer=True, doc="measurement")


def image_of(sensor: SensorModel) -> str:
    """The name of an array of what is measured at a point: z, where that is not the measurement itself."""
    return "seen_z" if sensor.inputs else "z"
