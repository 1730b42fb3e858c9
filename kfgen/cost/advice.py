"""The compiler flags that an emitted header recommends."""

from __future__ import annotations

from kfgen.emit.data import View


def recommended_flags(view: View) -> list[str]:
    """Those for the filter's file; [] if none."""
    lines = (line.strip() for line in view.advice)
    return next((line.split() for line in lines if line.startswith("-O")), [])
