"""The oracle: dense textbook filters in numpy float64, built from a spec's expression trees.

It shares nothing with the generator but the spec: derivatives are its own (forward-mode automatic
differentiation), and so is every formula.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kfgen.reference.build import reference
    from kfgen.reference.filter import ReferenceFilter
    from kfgen.reference.imm import ReferenceImm
    from kfgen.reference.log import Run
    from kfgen.reference.rts import Smoothed, smooth
    from kfgen.reference.status import Status

__all__ = ["ReferenceFilter", "ReferenceImm", "Run", "Smoothed", "Status", "reference", "smooth"]

_HOMES = {
    "reference": "build", "smooth": "rts", "Smoothed": "rts", "ReferenceFilter": "filter", "ReferenceImm": "imm",
    "Run": "log", "Status": "status",
}  # fmt: skip


def __getattr__(name: str) -> Any:
    """The filters, loaded when asked for: who needs the model alone does not wait for scipy."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
