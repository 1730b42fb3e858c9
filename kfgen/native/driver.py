"""The small C function that runs one filter over a log, compiled into the same library."""

from __future__ import annotations

from functools import lru_cache
from importlib.resources import files
from typing import Any

import jinja2

from kfgen.emit.declarations import Declarations
from kfgen.spec.sensors import readings_of
from kfgen.spec.types import Spec


def declarations(name: str, history: bool = False) -> str:
    """The prototypes of the driver, for cffi."""
    return f"size_t {name}_kfgen_size(void);\n{_signature(name, history)};\n"


def source(spec: Spec, declared: Declarations, history: bool = False) -> str:
    """The driver's C text for a filter, with its past or without; its functions are called with what they take."""
    name = spec.name
    sensors: list[dict[str, Any]] = []
    for sensor, place in readings_of(spec):
        sensors.append(
            {
                "name": sensor.name,
                "fields": range(place.start, place.stop),
                "full": (1 << len(sensor.components)) - 1,
                "u": declared.takes(f"update_{sensor.name}", "u"),
                "masked": declared.has(f"update_{sensor.name}_masked"),
                "masked_u": declared.takes(f"update_{sensor.name}_masked", "u"),
            }
        )
    return _template().render(
        name=name,
        signature=_signature(name, history),
        nx=len(spec.states),
        ne=len(spec.errors),
        nu=len(spec.inputs),
        nz=sum(len(each["fields"]) for each in sensors),
        sensors=sensors,
        has_u=bool(spec.inputs)
        and (declared.takes("predict", "u") or any(each["u"] or each["masked_u"] for each in sensors)),
        predict_u=declared.takes("predict", "u"),
        predict_dt=declared.takes("predict", "dt"),
        covariance=declared.has("get_covariance"),
        modes=len(spec.imm.modes) if spec.imm else 0,
        outputs=[each.name for each in spec.outputs],
        compensated=spec.code.compensated,
        history=history,
        likelihood=spec.code.log_likelihood,
    )


def _signature(name: str, history: bool) -> str:
    real, whole = f"{name}_real_t", f"{name}_history_t *h" if history else f"{name}_t *kf"
    return (
        f"void {name}_kfgen_run({whole}, size_t rows, const uint8_t *step, const {real} *dt, "
        f"const {real} *u, const uint32_t *mask, const uint32_t *age, const {real} *z, {real} *x, {real} *rest, "
        f"{real} *var, {real} *cov, {real} *nis, {real} *ll, {real} *mu, {real} *out, {real} *deviation, "
        f"uint8_t *told, uint32_t *status)"
    )


@lru_cache(maxsize=1)
def _template() -> jinja2.Template:
    text = files("kfgen.native").joinpath("driver.c.j2").read_text(encoding="utf-8")
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, autoescape=False
    )
    return environment.from_string(text)
