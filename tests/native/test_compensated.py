"""`code: {compensated: ..}`: far from the origin a float filter stays beside the double one."""

from __future__ import annotations

import numpy as np
import pytest

from kfgen.check import check
from kfgen.errors import SpecError
from kfgen.generate import build
from kfgen.native import NativeFilter, load_filters
from kfgen.override import override
from kfgen.spec import loads
from kfgen.spec.types import Spec
from kfgen.status import Status

DRIVE = """
kfgen: 1
name: drive
dt: 0.01
states:
  x: {init: 4.2e6, std: 10, unit: m}
  y: {init: -6.1e6, std: 10, unit: m, bounds: [-7e6, 7e6]}
  vx: {init: 15, std: 1, unit: m/s}
  vy: {init: -8, std: 1, unit: m/s}
noise: {ax: {std: 0.1}, ay: {std: 0.1}}
dynamics:
  form: discrete
  f: {x: x + dt*vx, y: y + dt*vy, vx: vx + dt*ax, vy: vy + dt*ay}
  Q: {x: 1e-6, y: 1e-6}
measurements:
  gnss: {z: {x: {h: x, std: 3}, y: {h: y, std: 3}}, gate: {probability: 0.9999}}
  mast: {z: {r: {h: "sqrt((x - 4.2e6)**2 + (y + 6.1e6)**2 + 1e4)", std: 2}}}
filter: {type: ekf}
code: {compensated: [x, y]}
"""
CONTINUOUS = "  form: continuous\n  integrator: %s\n  f: {x: vx, y: vy, vx: ax, vy: ay}"
DISCRETE = "  form: discrete\n  f: {x: x + dt*vx, y: y + dt*vy, vx: vx + dt*ax, vy: vy + dt*ay}"
KINDS = {
    "ud": "",
    "joseph": "covariance: full",
    "standard": "covariance: full, update: standard",
    "sqrt": "covariance: sqrt",
    "ekf2": "type: ekf2",
    "iekf": "type: iekf, iterations: 3",
    "adaptive": "adaptive: true",
    "robust": "robust: {influence: huber, k: 4}",  # where a reading is near k, round-off decides
    "adapt_Q": "adapt_Q: 0.001",
}
MODELS = {"discrete": DISCRETE, **{name: CONTINUOUS % name for name in ("euler", "midpoint", "rk4", "exact")}}


def spec(model: str = "discrete", options: str = "", code: str = "compensated: [x, y]", dt: str = "0.01") -> Spec:
    kind = "" if "type:" in options else "type: ekf, "
    text = DRIVE.replace(DISCRETE, MODELS[model]).replace("{type: ekf}", f"{{{kind}{options}}}")
    return loads(text.replace("compensated: [x, y]", code).replace("dt: 0.01", f"dt: {dt}"))


def drive(rows: int = 1500) -> dict[str, np.ndarray]:
    """A car at 17 m/s, a fix in every 20th row; readings as floats have them."""
    random = np.random.default_rng(1)
    t = np.arange(1, rows + 1) * 0.01
    x, y = 4.2e6 + 15 * t, -6.1e6 - 8 * t
    r = np.sqrt((x - 4.2e6) ** 2 + (y + 6.1e6) ** 2 + 1e4) + random.normal(0, 2, rows)
    log = {"t": t, "gnss.x": x + random.normal(0, 3, rows), "gnss.y": y + random.normal(0, 3, rows), "mast.r": r}
    for name, column in log.items():
        if name != "t":
            column[np.arange(rows) % 20 != (10 if name == "mast.r" else 0)] = np.nan
            log[name] = column.astype(np.float32).astype(float)
    return log


@pytest.fixture(scope="module")
def filters() -> dict[tuple[str, str], tuple[NativeFilter, NativeFilter]]:
    """Of every kind and of every model, straight and in loops: the float filter and the double one."""
    cases = {(kind, code): spec("discrete", options, f"compensated: true, unroll: {code}")
             for kind, options in KINDS.items() for code in ("full", "none")}  # fmt: skip
    cases |= {(model, "full"): spec(model) for model in MODELS}
    cases["run-time", "full"] = spec(dt="{nominal: 0.01, min: 0.001, max: 0.1}")
    single, double = (
        load_filters([build(override(s, scalar, name=f"{scalar[0]}{k}")) for k, s in enumerate(cases.values())],
                     flags=[level])
        for scalar, level in (("float", "-O2"), ("double", "-O0"))
    )  # fmt: skip
    return dict(zip(cases, zip(single, double, strict=True), strict=True))


def test_float_stays_beside_double(filters) -> None:
    log = drive()
    for case, (single, double) in filters.items():
        apart = np.abs(single.run(log).x - double.run(log).x).max(axis=0)
        assert apart[:2].max() < 0.05, case
        assert apart[2:].max() < 0.01, case


def test_without_it_float_does_not() -> None:
    log = drive()
    plain = [build(override(spec(code="gate_count: false"), scalar, name=scalar[0])) for scalar in ("float", "double")]
    single, double = load_filters(plain)
    assert np.abs(single.run(log).x - double.run(log).x)[:, :2].max() > 3


def test_what_is_left_over_is_part_of_the_state(filters) -> None:
    kf, _ = filters["discrete", "full"]
    kf.init()
    for _ in range(3):
        kf.predict()
    assert kf.x[:2] == pytest.approx([4.2e6 + 0.45, -6.1e6 - 0.24], abs=1e-6)
    assert kf.raw["x"][0] + float(kf.raw["x_rest"][0]) == pytest.approx(4.2e6 + 0.45, abs=1e-6)
    assert kf.copy().x.tolist() == kf.x.tolist()
    before = bytes(kf)
    assert kf.update("gnss", [np.nan, 0.0]) == Status.NOT_FINITE
    assert bytes(kf) == before
    assert kf.update("gnss", [5.2e6, -6.1e6]) == Status.GATED
    assert kf.raw["x_rest"].tolist() == np.frombuffer(before, np.float32)[-2:].tolist() or kf.x[0] < 4.3e6
    kf.set_state([4.2e6, 0.0, 1.0, 1.0])
    assert kf.raw["x_rest"].tolist() == [0.0, 0.0]
    kf.predict()
    kf.init()
    assert kf.raw["x_rest"].tolist() == [0.0, 0.0]


def test_a_bound_leaves_nothing_over(filters) -> None:
    kf, _ = filters["discrete", "full"]
    kf.set_state([4.2e6, 7e6 - 0.5, 0.0, 90.0])
    kf.predict()
    kf.predict()
    assert kf.x[1] == 7e6


def test_check_passes() -> None:
    assert check(spec(), 200).passed


@pytest.mark.parametrize(
    ("options", "code", "says"),
    [
        ("type: ukf", "compensated: true", "points are drawn about x"),
        ("", "compensated: [x, z]", "z"),
        ("", "compensated: [x, x]", "twice"),
        ("", "compensated: 1", "compensated"),
    ],
)
def test_what_it_does_not_go_with(options: str, code: str, says: str) -> None:
    with pytest.raises(SpecError, match=says):
        spec(options=options, code=code)


def test_not_in_fixed_point() -> None:
    with pytest.raises(SpecError, match=r"fixed point carries on"):
        loads(DRIVE.replace("dt: 0.01", "dt: 0.01\nscalar: q24.8"))
