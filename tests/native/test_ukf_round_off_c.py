"""Unscented filters where points spread beyond a turn, and where rounding could lock a filter out.

A failure here is the algorithm's, or the reference's where both are wrong together: right values are stated.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from variants import built

from kfgen.native import NativeFilter
from kfgen.override import override
from kfgen.reference import reference
from kfgen.spec import loads
from kfgen.spec.types import Spec
from kfgen.status import ERROR

FORMS = {
    "full": "covariance: full",
    "ud": "covariance: ud",
    "sqrt": "covariance: sqrt",
    "sequential": "sequential: true",
    "cubature": "covariance: full, sigma_points: {kind: cubature}",
    "julier": "covariance: full, sigma_points: {kind: julier, kappa: 1}",
    "kept": "covariance: full, sigma_points: {redraw: false}",
    "kept-ud": "covariance: ud, sigma_points: {redraw: false, alpha: 1e-3}",
}
MORE = {"adaptive": "covariance: full, adaptive: true", "adapt_R": "covariance: full, adapt_R: 0.1"}
UNROLL = ("full", "none")

WIDE = """
kfgen: 1
name: wide
scalar: double
dt: 0.1
parameters: {bend: 0.5}
states:
  x: {init: 0, std: 1}
  y: {init: 0, std: 1}
  yaw: {init: 0, std: STD, kind: angle}
  v: {init: 0, std: 1}
  b: {init: 0, std: 1}
dynamics: {f: {yaw: YAW, x: X}, Q: {x: 1e-12}}
measurements:
  m: {z: {yaw: {h: H, std: 0.1, kind: angle}, x: {h: x + v + b + y, std: 1}}}
filter: {type: ukf}
"""


def forms_of(text: str, options: str, scalar: str = "double") -> dict[str, Spec]:
    """In straight-line code and in loops."""
    text = text.replace("{type: ukf", "{type: ukf, " + options)
    return {how: override(loads(f"{text}code: {{unroll: {how}}}\n"), scalar) for how in UNROLL}


def seeing(text: str, sensors: list[str], form: str, scalar: str = "double") -> list[tuple[str, Spec, str]]:
    """A spec with sensors in place of SENSORS, and the name of one to be used alone; one spec of all where the form
    allows it, so that as few as possible are built."""
    options = {**FORMS, **MORE}[form]
    own = {f"m{k}": f"m{k}: {{z: {sensor}}}" for k, sensor in enumerate(sensors)}
    alone = "redraw: false" in options
    out = []
    for name, line in own.items():
        each = text.replace("SENSORS", line if alone else ", ".join(own.values()))
        out += [(how, spec, name) for how, spec in forms_of(each, options, scalar).items()]
    return out


def each_alone(cases: list[tuple[str, Spec, str]]) -> list[tuple[str, Spec, str, NativeFilter]]:
    """With the filters, which share what they are copied from."""
    filters = built({(spec.sha256, spec.scalar): spec for _, spec, _ in cases})
    return [(how, spec, name, filters[spec.sha256, spec.scalar].copy()) for how, spec, name in cases]


def wide(std: float, yaw: str = "yaw", x: str = "x", h: str = "yaw") -> str:
    return WIDE.replace("STD", repr(std)).replace("YAW", yaw).replace("X}", f"{x}}}").replace("H,", f"{h},")


PASSED_ON = [("yaw", "x", 0.0), ("yaw + dt*b", "x + dt*v*cos(b)", 0.01), ("yaw + bend*v*v", "x", 0.5)]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("yaw", "x", "added"), PASSED_ON)
def test_an_angle_that_is_passed_on_linearly_keeps_its_variance(form, yaw, x, added):
    """However wide it is, in predict and in the innovation; what bends beside it makes no difference."""
    text = wide(1.8, yaw, x).replace("{type: ukf", "{type: ukf, " + FORMS[form])
    for how, first in built(forms_of(wide(1.8, yaw, x), FORMS[form])).items():
        for std in (1.8, 2.5):
            kf, ref = first.copy(), reference(loads(text))
            if std != 1.8:
                for each in (kf, ref):
                    assert each.set_covariance(np.diag([1.0, 1.0, std**2, 1.0, 1.0])) == 0
            assert kf.predict() == ref.predict() == 0
            if "v*v" not in yaw:
                assert ref.P[2, 2] == pytest.approx(std**2 + added)
            assert kf.P[2, 2] == pytest.approx(ref.P[2, 2], rel=1e-6), how
            assert kf.P[2, 2] > 0.99 * std**2
            assert kf.update("m", [0.3, 0.2]) == ref.update("m", [0.3, 0.2]) == 0
            np.testing.assert_allclose(kf.x, ref.x, rtol=1e-6, atol=1e-9)
            np.testing.assert_allclose(kf.P, ref.P, rtol=1e-6, atol=1e-8)
            assert ref.P[2, 2] == pytest.approx(0.01 * std**2 / (std**2 + 0.01), rel=0.01) or added


@pytest.mark.parametrize("form", FORMS)
def test_an_image_that_jumps_is_wrapped(form):
    """A bearing less the heading, across the back: linear in the heading, but atan2 jumps."""
    bearing = '"atan2(0.1*y, x - 10) - yaw"'
    text = wide(0.2, h=bearing).replace("x: {init: 0, std: 1}", "x: {init: 0, std: 0.1}")
    for how, kf in built(forms_of(text, FORMS[form])).items():
        ref = reference(loads(text.replace("{type: ukf", "{type: ukf, " + FORMS[form])))
        assert kf.predict() == ref.predict() == 0
        assert kf.update("m", [math.pi, 0.0]) == ref.update("m", [math.pi, 0.0]) == 0
        assert abs(ref.x[2]) < 0.01
        assert 0.005 < ref.P[2, 2] < 0.012
        np.testing.assert_allclose(kf.x, ref.x, rtol=1e-6, atol=1e-8, err_msg=how)
        np.testing.assert_allclose(kf.P, ref.P, rtol=1e-6, atol=1e-8, err_msg=how)


EXACT = """
kfgen: 1
name: exact
scalar: double
dt: 1
states: {x: {init: 0, std: 1}, v: {init: 0, std: 1}}
dynamics: {f: {}, Q: {x: 0}}
measurements: {SENSORS}
filter: {type: ukf, adaptive: true}
"""


@pytest.mark.parametrize("form", ["full", "ud", "sqrt", "sequential", "cubature", "kept"])
@pytest.mark.parametrize("scalar", ["double", "float"])
def test_a_direction_that_is_known_is_not_measured_again(form, scalar):
    """Without noise and with an innovation that cannot be: skipped, whatever `adaptive` thinks of it."""
    known = ["{z: {h: 0.3*x + 0.7*v, std: 0}}", "{z: {h: 2*x - 0.7*v, std: 0}}"]
    for how, spec, name, kf in each_alone(seeing(EXACT, known, form, scalar)):
        for each in (kf, reference(spec)):
            assert each.update(name, [1.0]) < ERROR
            x, P = each.x, each.P
            assert each.update(name, [2.0]) & ~1 == 0, how
            np.testing.assert_allclose(each.x, x, atol=1e-6)
            np.testing.assert_allclose(each.P, P, atol=1e-6)
            assert each.nis == 0.0


SINGULAR = """
kfgen: 1
name: singular_noise
scalar: double
dt: 0.1
states: {p: {init: 1, std: 1}, v: {init: 0, std: 1}}
dynamics: {f: {p: p + dt*v, v: "v - dt*sin(p)"}, Q: {p: 1e-4, v: 1e-4}}
measurements: {SENSORS}
filter: {type: ukf}
"""


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("h", [("p*abs(p)", "sin(v)"), ("p*abs(p)", "p*abs(p)"), ("sin(p)", "p*v")])
def test_no_measurement_locks_a_filter_out(form, h):
    """Singular noise, repeated sensors, a noise far below the state's, none at all."""
    z = 0.3 + 1e-4 * np.random.default_rng(5).normal(size=(30, 2))
    noises = ("[[0.01, 0.01], [0.01, 0.01]]", "[[1e-8, 0], [0, 1e-8]]", "[[0, 0], [0, 1e-8]]")
    sensors = [f"{{y: {{h: {h[0]}}}, w: {{h: {h[1]}}}}}, R: {R}" for R in noises]
    cases = [case for scalar in ("double", "float") for case in seeing(SINGULAR, sensors, form, scalar)]
    references = [("reference", spec, name, reference(spec))
                  for how, spec, name in cases if (spec.scalar, how) == ("double", "full")]  # fmt: skip
    for how, spec, name, kf in [*each_alone(cases), *references]:
        label = (how, spec.scalar, name)
        for reading in z:
            assert kf.predict() < ERROR, label
            assert kf.update(name, reading) < ERROR, label
            assert np.all(kf.P.diagonal() >= 0.0), label


FAR = """
kfgen: 1
name: distant
scalar: float
dt: 0.1
states: {p: {init: 0, std: 100}, v: {init: 0, std: 100}, a: {init: 0, std: 100}}
dynamics:
  f: {p: p + dt*v + dt**2/2*a, v: v + dt*a, a: a - 0.01*sin(a)}
  Q: {p: 1e-6, v: 1e-6, a: 1e-6}
measurements: {SENSORS}
filter: {type: ukf}
"""


@pytest.mark.parametrize("form", ["full", "cubature", "julier", "kept", "adaptive", "adapt_R"])
def test_variances_far_above_the_noise(form):
    """P0 / R up to 1e14, which a float cannot hold: no error, no negative variance, and the filter converges."""
    second = ["p + 1e-9*p*abs(p)", "2*p + 1e-3*v"]
    sensors = [f"{{p: {{h: {second[0]}, std: 0.01}}, q: {{h: {q}, std: 0.01}}}}" for q in second]
    for how, _, name, first in each_alone(seeing(FAR, sensors, form, "float")):
        for std in (100, 1e5):
            kf, rng = first.copy(), np.random.default_rng(3)
            if std != 100:
                assert kf.set_covariance(std**2 * np.eye(3)) == 0
            for k in range(50):
                p = 5 + 0.2 * (k + 1)
                z = [p, p if name == "m0" else 2 * p + 2e-3] + 0.01 * rng.normal(size=2)
                assert kf.predict() < ERROR, (how, k)
                assert kf.update(name, z) < ERROR, (how, k)
                assert np.all(kf.P.diagonal() >= 0.0), (how, k)
            assert abs(kf.x[0] - 15.0) < 0.1, how


WEAK = """
kfgen: 1
name: weak
scalar: double
dt: 0.1
states: {a: {init: 0.5, std: 1.8}, b: {init: -1, std: 3}, c: {init: 0.3, std: 1.5}, d: {init: 1, std: 2.8}}
covariances: [[a, b, 4.9], [a, c, 1.1], [b, c, 2.5], [a, d, -4.4], [b, d, -8], [c, d, -2.2]]
dynamics: {f: {a: a + dt*b}, Q: {a: 0.01, b: 0.01, c: 0.01, d: 0.01}}
measurements: {SENSORS}
filter: {type: ukf}
"""


@pytest.mark.parametrize("last", ["-2*b + 0.5*c + 0.2*tanh(b - d)", "c*d + d", "b + 1e-3*a*c"])
def test_what_rounding_leaves_of_a_slope_is_none(last):
    """An exact component after another: its slopes by regression are round-off where h does not have the state, and
    may not drown what is known of it."""
    sensors = [f"{{p: {{h: a, std: 0.1}}, q: {{h: b + 0.5*c, std: 1}}, r: {{h: '{last}', std: 0*(1 + a**2)}}}}"]
    for how, spec, name, kf in each_alone(seeing(WEAK, sensors, "sequential")):
        ref = reference(spec)
        for k in range(4):
            z = [0.4 + 0.1 * k, -0.8, 1.7]
            assert kf.update(name, z) == ref.update(name, z) == 0, how
            sigma = np.sqrt(ref.P.diagonal())
            assert np.abs((kf.x - ref.x) / sigma).max() < 1e-8, (how, k)
            assert np.abs((kf.P - ref.P) / np.outer(sigma, sigma)).max() < 1e-8, (how, k)
            assert kf.predict() == ref.predict() == 0
