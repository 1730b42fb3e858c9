"""What the language allows and this version does not emit yet."""

from __future__ import annotations

from kfgen.errors import Mistake, Place
from kfgen.spec.types import Spec


def unbuilt(spec: Spec) -> list[Mistake]:
    """One mistake for each thing asked for that is not built yet."""
    out: list[Mistake] = []

    def refuse(place: Place, what: str, hint: str = "") -> None:
        out.append(Mistake(place, f"{what} is not built yet", hint))

    code = spec.code
    if spec.scalar not in ("float", "double"):
        for key in ("flash", "ram", "stack"):
            if getattr(code, key) is not None:
                refuse(code.places.get(key, spec.place), f"code.{key} with scalar: {spec.scalar}", "leave it out")
    return out
