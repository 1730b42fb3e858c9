"""What a fixed-point filter's files say beside its code: units, the integer routines, what may saturate."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from kfgen.emit.data import Named, Routines
from kfgen.ir.program import Call, Function, roots, walk

_QUIET = frozenset({"q_min", "q_max", "q_sign", "q_count", "q_fma", "q_abs"})
OWN = frozenset({"abs", "min", "max", "sign", "count", "fma", "fit", "mac"})
"""Routines of fixed point that stand in the template of the lowered program."""


@dataclass(frozen=True)
class FixedPoint:
    """What the text of a fixed-point filter says beside its code.

    units: macro's name -> exponent of the value of raw 1. table: the report, in lines. floor: products round down.
    """

    fraction_bits: int
    units: tuple[tuple[str, int], ...]
    table: tuple[str, ...]
    floor: bool
    closure: Callable[[Iterable[str], bool], tuple[str, ...]]
    tables: object
    periods: Mapping[str, float] = field(default_factory=dict)  # macro's name -> after which the quantity repeats


def units(fixed: FixedPoint) -> tuple[Named, ...]:
    """Quantity -> the value of raw 1, and its period where it has one, as C literals."""
    periods = {name: repr(period) for name, period in fixed.periods.items()}
    return tuple(Named(name, value=repr(2.0**e), period=periods.get(name, "")) for name, e in fixed.units)


def routines(fixed: FixedPoint, helpers: Iterable[str]) -> Routines:
    """The routines to define where the code calls these helpers (`q_mul`, ...): those that they need included."""
    used = {op.removeprefix("q_") for op in helpers if op.startswith("q_")}
    used |= {"asr", "moved", "product", "round"} if used & {"fma", "mac"} else set()
    return Routines(fixed.closure(used - OWN, fixed.floor), tuple(sorted(used & OWN)), fixed.tables, fixed.floor)


def may_saturate(f: Function) -> bool:
    """Whether anything in a fixed-point function is given the status."""
    for s in walk(f.body):
        if isinstance(s, Call):
            return True
        stack = list(roots(s))
        while stack:
            node = stack.pop()
            if node.op.startswith("q_") and node.op not in _QUIET:
                return True
            stack += node.args
    return False
