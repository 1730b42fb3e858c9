"""What a filter's header declares, for who loads or calls the filter: as C, and what there is by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from kfgen.emit.data import View
from kfgen.emit.history import HistoryView
from kfgen.emit.render import render_c


@dataclass(frozen=True)
class Declarations:
    """The declarations of one header.

    prefix: of all names. real: the C type of its numbers: `float`, `double` or `int32_t`. text: its types and
    functions as C without a directive, which is what cffi reads. functions: name without the prefix -> the
    names of its arguments in order. Fixed point: fraction_bits, and units, quantity (`PX`, `GNSS_X`) -> the
    physical value of raw 1. history: what its header declares, where there is one.
    """

    prefix: str
    real: str
    text: str
    functions: Mapping[str, tuple[str, ...]]
    fraction_bits: int | None = None
    units: Mapping[str, float] = field(default_factory=dict)
    history: str = ""

    def has(self, function: str) -> bool:
        return function in self.functions

    def takes(self, function: str, argument: str) -> bool:
        """Whether there is such a function, and it has an argument of that name."""
        return argument in self.functions.get(function, ())


def declarations(view: View, history: HistoryView | None = None) -> Declarations:
    """What the header of a view declares."""
    return Declarations(
        view.name,
        view.scalar.c_type,
        render_c("c/declarations.j2", v=view),
        {function.name: function.arguments for function in view.functions if not function.private},
        view.scalar.fraction_bits,
        {unit.name: float(unit.value) for unit in view.units},
        "" if history is None else render_c("c/history_declarations.j2", v=view, h=history),
    )
