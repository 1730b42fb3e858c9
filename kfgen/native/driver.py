"""The small C function that runs one filter over a log, compiled into the same library."""

from __future__ import annotations

from functools import lru_cache
from importlib.resources import files

import jinja2

from kfgen.emit.declarations import Declarations
from kfgen.spec.types import Spec


def declarations(name: str) -> str:
    """The prototypes of the driver, for cffi."""
    return f"size_t {name}_kfgen_size(void);\n{_signature(name)};\n"


def source(spec: Spec, declared: Declarations) -> str:
    """The driver's C text for a filter; its functions are called with what they take."""
    name = spec.name
    sensors, first = [], 0
    for sensor in spec.measurements:
        m = len(sensor.components)
        sensors.append(
            {
                "name": sensor.name,
                "m": m,
                "first": first,
                "full": (1 << m) - 1,
                "u": declared.takes(f"update_{sensor.name}", "u"),
                "masked": declared.has(f"update_{sensor.name}_masked"),
                "masked_u": declared.takes(f"update_{sensor.name}_masked", "u"),
            }
        )
        first += m
    return _template().render(
        name=name,
        signature=_signature(name),
        nx=len(spec.states),
        nu=len(spec.inputs),
        nz=first,
        sensors=sensors,
        has_u=bool(spec.inputs)
        and (declared.takes("predict", "u") or any(each["u"] or each["masked_u"] for each in sensors)),
        predict_u=declared.takes("predict", "u"),
        predict_dt=declared.takes("predict", "dt"),
        covariance=declared.has("get_covariance"),
        modes=len(spec.imm.modes) if spec.imm else 0,
        compensated=spec.code.compensated,
        likelihood=spec.code.log_likelihood,
    )


def _signature(name: str) -> str:
    real = f"{name}_real_t"
    return (
        f"void {name}_kfgen_run({name}_t *kf, size_t rows, const uint8_t *step, const {real} *dt, "
        f"const {real} *u, const uint32_t *mask, const {real} *z, {real} *x, {real} *rest, {real} *var, "
        f"{real} *cov, {real} *nis, {real} *ll, {real} *mu, uint32_t *status)"
    )


@lru_cache(maxsize=1)
def _template() -> jinja2.Template:
    text = files("kfgen.native").joinpath("driver.c.j2").read_text(encoding="utf-8")
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, autoescape=False
    )
    return environment.from_string(text)
