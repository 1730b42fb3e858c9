"""What the tests of filter options share: the five forms, specs with options, their filters by few compiler calls.

A case is the text of a spec and the options of its filter; it is built in every form that it is allowed in.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from kfgen.generate import Generated, build
from kfgen.native import NativeFilter, load_filters
from kfgen.native.run import plan
from kfgen.override import override
from kfgen.reference import reference
from kfgen.simulate import simulate
from kfgen.spec import loads
from kfgen.spec.types import Spec

FORMS = {
    "ud-bierman": "covariance: ud, update: bierman",
    "ud-joseph": "covariance: ud, update: joseph",
    "full-joseph": "covariance: full, update: joseph",
    "full-standard": "covariance: full, update: standard",
    "sqrt": "covariance: sqrt",
}
JOSEPH = ("ud-joseph", "full-joseph")  # of consider and gain_limit
# of the sensors' noise
DEVIATIONS = {
    "gnss": 20.0, "radar": np.array([2, 0.02]), "fix": 0.6, "course": 0.1, "compass": 0.05,
    "imu": np.array([0.2, 0.2, 0.2, 0.02, 0.02, 0.02]),
}  # fmt: skip
CODE = "code: {log_likelihood: true, gate_count: true}"

# Two sensors, three states, one of them an angle that turns; full Q and R, noise inputs on both sides, a wrapped
# component, gates, masks. Constant Q and R, so that all options apply.
TURN = """
kfgen: 1
name: turn
scalar: double
dt: 0.125
parameters: {k: 1.5}
states:
  x: {init: 4, var: 0.5}
  y: {init: 3, var: 0.5}
  th: {init: 3, var: 0.2, kind: angle}
covariances: [[x, y, 0.125]]
inputs: {rate: {unit: rad/s}}
noise: {w: {std: 0.1}}
dynamics:
  form: discrete
  f: {x: x + dt*cos(th), y: y + dt*sin(th), th: th + dt*(rate + w) + 0.02}
  Q: [[0.01, 0.002, 0], [0.002, 0.01, 0], [0, 0, 0.001]]
measurements:
  fix:
    z:
      px: {h: x}
      py: {h: y + x**2/32}
      area: {h: "x*y/8 + 0.25*n*x"}
    R: [[0.3, 0.1, 0.05], [0.1, 0.2, -0.05], [0.05, -0.05, 0.4]]
    noise: {n: {std: 0.5}}
    partial: true
    gate: {probability: 0.99, reset_after: 2}
  course:
    z:
      th: {h: th, std: 0.1, kind: angle}
      bearing: {h: "atan2(y, x)", std: 0.1, kind: angle}
    gate: {probability: 0.999}
filter: {type: ekf}
"""


def with_options(text: str, options: str, form: str = "", code: str = CODE) -> str:
    """A spec with another filter. options: as in the language (`robust: huber`), type: ekf where none is given."""
    kind = "" if "type:" in options else "type: ekf"
    keys = ", ".join(part for part in (kind, options, FORMS.get(form, "")) if part)
    changed, count = re.subn(r"^filter: .*$", f"filter: {{{keys}}}\n{code}", text, flags=re.MULTILINE)
    assert count == 1
    return changed


@cache
def _loaded(text: str, options: str, code: str) -> Spec:
    return loads(with_options(text, options, "full-joseph", code))  # which every option allows


def spec_with(text: str, options: str, form: str, scalar: str = "double", code: str = CODE) -> Spec:
    """The same, loaded; in one of FORMS."""
    covariance, _, update = form.partition("-")
    changes = {"covariance": covariance, "update": update or None}
    return override(_loaded(text, options, code), scalar, filter=changes)


def generated(specs: Mapping[Any, Spec]) -> dict[Any, Generated]:
    """Their names are made distinct by a number."""
    return {key: build(replace(spec, name=f"{spec.name}_{k}")) for k, (key, spec) in enumerate(specs.items())}


def compiled(made: Mapping[Any, Generated], flags: tuple[str, ...] = ("-O0",)) -> dict[Any, NativeFilter]:
    """By one call of the compiler."""
    filters = load_filters(list(made.values()), flags=flags)
    return dict(zip(made, filters, strict=True))


def built(specs: Mapping[Any, Spec], flags: tuple[str, ...] = ("-O0",)) -> dict[Any, NativeFilter]:
    return compiled(generated(specs), flags)


def readings(text: str, steps: int, seed: int, glitches: float = 0.15) -> Iterator[tuple[str, dict[str, Any]]]:
    """Calls along a track of the spec's own model: (`predict`, arguments), (sensor, arguments).

    Now and then a sensor errs for one to four steps, by 4, 8 or 40 of its standard deviations. The second sensor
    measures in every other step, where the log is long enough. Partial sensors are masked at random, and may be
    masked to nothing; what is masked out is NaN.
    """
    spec = loads(re.sub(r"^filter: .*$", "filter: {type: ekf}", text, flags=re.MULTILINE))
    every = {sensor.name: 1 + i % 2 for i, sensor in enumerate(spec.measurements)}
    work = plan(spec, simulate(spec, steps, seed, every), 0.1)
    ref, random = reference(spec), np.random.default_rng(seed)
    run_time = spec.dt is not None and spec.dt.run_time
    left, size = 0, 0.0
    for row in range(steps):
        u = {"u": work.u[row]} if spec.inputs else {}
        if work.step[row]:
            yield "predict", {**u, **({"dt": work.dt[row]} if run_time else {})}
        first = 0
        for i, sensor in enumerate(spec.measurements):
            m = len(sensor.components)
            z = work.z[row, first : first + m].copy()
            first += m
            if not work.mask[row, i]:
                continue
            if left == 0 and random.random() < glitches:
                left, size = int(random.integers(1, 5)), float(random.choice([4, 8, 40]))
            if left:
                left -= 1
                z += size * random.choice([-1, 0, 1], m) * DEVIATIONS[sensor.name]
            arguments = {"z": z, **(u if ref.sensors[sensor.name].takes_inputs else {})}
            if sensor.partial and random.random() < 0.6:
                mask = int(random.integers(0, 1 << m))
                z[[not mask >> k & 1 for k in range(m)]] = np.nan
                arguments["mask"] = mask
            yield sensor.name, arguments


def call(kf: Any, name: str, arguments: Mapping[str, Any]) -> int:
    """Of a compiled filter or of a reference."""
    return int(kf.predict(**arguments) if name == "predict" else kf.update(name, **arguments))
