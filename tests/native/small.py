"""Filters that are written by hand, as if they had been emitted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from kfgen.emit.declarations import Declarations
from kfgen.spec.types import Spec

HERE = Path(__file__).parent
FUNCTIONS = {
    "init": ("kf",),
    "predict": ("kf", "u", "dt"),
    "update_gnss": ("kf", "z"),
    "update_gnss_masked": ("kf", "z", "mask"),
    "update_compass": ("kf", "z"),
    "set_state": ("kf", "x"),
    "set_covariance": ("kf", "P"),
    "get_covariance": ("kf", "P"),
}
"""Of vehicle_small."""


@dataclass(frozen=True)
class Written:
    """A filter as `kfgen.native.load_filters` takes it."""

    spec: Spec
    files: Mapping[str, str]
    declarations: Declarations


def vehicle_small(spec: Spec, files: Mapping[str, str] | None = None) -> Written:
    """vehicle_small in the name and scalar of a spec; `files`: other ones with the same declarations."""
    texts = {}
    for ending in ("h", "c"):
        text = (HERE / f"vehicle_small.{ending}").read_text()
        text = text.replace("vehicle_small", spec.name).replace("VEHICLE_SMALL", spec.name.upper())
        texts[f"{spec.name}.{ending}"] = text.replace("float ", f"{spec.scalar} ")
    types = between(texts[f"{spec.name}.h"], "typedef", "#ifdef __cplusplus\n}")
    types = types.replace(f"[{spec.name.upper()}_NX]", "[3]")
    declared = Declarations(spec.name, spec.scalar, types, FUNCTIONS)
    return Written(spec, texts if files is None else files, declared)


def between(text: str, start: str, end: str) -> str:
    """A text from the first line that begins with `start` (included) to `end`."""
    return text[text.index(f"\n{start}") : text.index(end)]
