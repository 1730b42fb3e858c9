"""What is said of formats: units by name for the header, and a table for the user."""

from __future__ import annotations

from kfgen.filters.base import FilterCode
from kfgen.filters.steps.outputs import FUNCTION, VALUE
from kfgen.fixed.formats.formats import Formats
from kfgen.model import Model


def units(code: FilterCode, formats: Formats) -> tuple[tuple[str, int], ...]:
    """Name of what the user reads or writes -> the exponent of the value of raw 1."""
    spec = code.model.spec
    out = [(s.name, formats.arrays.state(i)) for i, s in enumerate(spec.states)]
    out += [(each.name, ("number", f"u.{each.name}")) for each in spec.inputs]
    out += [(each.name, ("number", f"kf.parameters.{each.name}")) for each in spec.parameters]
    out += [
        (f"{s.name}_{c.name}", ("number", f"update_{s.name}", f"z.{c.name}"))
        for s in spec.measurements for c in s.fields
    ]  # fmt: skip
    out += [(output.name, ("number", FUNCTION, f"{VALUE}.{output.name}")) for output in spec.outputs]
    if spec.dt is not None and spec.dt.run_time:
        out.append(("dt", ("number", "dt")))
    return tuple((name.upper(), formats.fixed[cell]) for name, cell in out)


def periods(model: Model) -> dict[str, float]:
    """Name of an angle, or of what else repeats -> its period."""
    found = dict(zip(model.states, model.periods, strict=True))
    for sensor in model.sensors:
        names = (f"{sensor.name}_{c.name}" for c in sensor.spec.components)
        found |= dict(zip(names, sensor.periods, strict=True))
    return {name.upper(): float(period) for name, period in found.items() if period is not None}


def table(formats: Formats) -> tuple[str, ...]:
    """A line for each quantity: its unit, its range, the bits above that."""
    width = max((len(q.name) for q in formats.report), default=0)
    return tuple(
        f"{q.name:<{width}}  2^{q.e:<4} to {q.largest:<9.4g} {q.headroom:>2} bits {q.raised}".rstrip()
        for q in formats.report
    )
