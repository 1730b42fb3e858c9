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

    if spec.imm is not None:
        refuse(spec.imm.place, "imm", "describe a single filter")
        return out
    if spec.scalar not in ("float", "double"):
        refuse(spec.places.get("scalar", spec.place), f"scalar: {spec.scalar}", "use float or double")
    if filter_.type not in ("kf", "ekf"):
        refuse(place("type"), f"type: {filter_.type}", "use kf or ekf")
        return out
    if filter_.covariance not in ("ud", "full"):
        refuse(place("covariance"), f"covariance: {filter_.covariance}", "use ud or full")
    asked = {
        "gain": filter_.gain, "robust": filter_.robust, "adaptive": filter_.adaptive, "adapt_R": filter_.adapt_R,
        "adapt_Q": filter_.adapt_Q, "innovation_floor": filter_.innovation_floor, "gain_limit": filter_.gain_limit,
        "consider": filter_.consider,
    }  # fmt: skip
    for key, value in asked.items():
        if value:
            refuse(place(key), f"filter.{key}", "leave it out")
    code = spec.code
    for key, wanted in {
        "unroll": code.unroll == "none", "flash": code.flash, "ram": code.ram, "stack": code.stack,
    }.items():  # fmt: skip
        if wanted:
            refuse(code.places.get(key, spec.place), f"code.{key}", "leave it out")
    for sensor in spec.measurements:
        if sensor.partial:
            refuse(sensor.place, f"partial (sensor {sensor.name})", "leave it out")
    return out
