"""What the language allows and this version does not emit yet."""

from __future__ import annotations

from kfgen.errors import Mistake, Place
from kfgen.spec.types import Spec


def unbuilt(spec: Spec) -> list[Mistake]:
    """One mistake for each thing asked for that is not built yet."""
    out: list[Mistake] = []
    filter_ = spec.filter

    def refuse(place: Place, what: str, hint: str = "") -> None:
        out.append(Mistake(place, f"{what} is not built yet", hint))

    def place(key: str) -> Place:
        return filter_.places.get(key, filter_.place)

    if spec.imm is not None and spec.scalar not in ("float", "double"):
        refuse(spec.places.get("scalar", spec.place), f"imm with scalar: {spec.scalar}", "use float or double")
    code = spec.code
    if spec.imm is not None and (code.unroll == "none" or code.flash):
        for key in ("unroll", "flash"):
            if key in code.places:
                refuse(code.places[key], f"code.{key} with imm", "leave it out")
    for key, wanted in {
        "ram": code.ram, "stack": code.stack,
    }.items():  # fmt: skip
        if wanted:
            refuse(code.places.get(key, spec.place), f"code.{key}", "leave it out")
    return out
