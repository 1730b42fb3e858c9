"""Anywhere in the declared box an integer filter is that of float64: nothing saturates, x and P are near."""

from __future__ import annotations

import math

import numpy as np
import pytest

import kfgen
from kfgen.errors import SpecError
from kfgen.generate import build
from kfgen.override import override
from kfgen.spec.loading import loads
from kfgen.status import Status

HEAD = "kfgen: 1\nscalar: q16.16\n"
PROPORTIONAL = HEAD + """
name: proportional_noise
dt: 1
states: {x: {init: 0, var: 1, range: [-100, 100]}}
initialize: {from: m, states: {x: z}}
dynamics: {f: {}, Q: {x: 0.01*abs(x)}}
measurements: {m: {z: {z: {h: x, var: 0.1, range: [-100, 100]}}}}
filter: {type: kf}
"""
DECLARED = HEAD + """
name: declared_range
dt: 0.01
states:
  w: {init: 0, std: 10, range: [-4000, 4000]}
  a: {init: 0, std: 0.1, range: [-40, 40]}
inputs: {u: {range: [-40, 40]}}
dynamics: {f: {w: w, a: "0.9*a + 0.001*w*cos(u)"}, Q: {w: 0.01, a: 0.0001}}
measurements: {speed: {z: {w: {h: w, std: 1, range: [-4000, 4000]}}}}
filter: {type: ekf, covariance: full, update: standard}
"""
PARAMETERS = HEAD + """
name: parameters
dt: {nominal: 0.1, min: 0.02, max: 1}
parameters: {sigma: {value: 1.0, range: [0.1, 20]}, rate: {value: 0.5, range: [0.05, 5]}}
states: {p: {init: 0, std: 5, range: [-1000, 1000]}, v: {init: 0, std: 2, range: [-50, 50]}}
dynamics: {f: {p: p + dt*v}, Q: {v: rate**2*dt}}
measurements: {m: {z: {p: {h: p, std: sigma, range: [-1000, 1000]}}}}
filter: {type: ekf}
"""
HEIGHT = HEAD + """
name: height
dt: 0.02
states:
  h: {init: 100, std: 20, range: [-100, 9000]}
  v: {init: 0, std: 1, range: [-100, 100]}
  b: {init: 0, std: 0.2, range: [-2, 2]}
inputs: {a: {range: [-40, 40]}}
dynamics: {f: {h: h + dt*v + dt**2/2*(a - b), v: v + dt*(a - b)}, Q: {h: 1e-5, v: 0.0004, b: 1e-7}}
measurements: {baro: {z: {p: {h: "1013.25*(1 - h/44330)**5.255", std: 0.1, range: [250, 1100]}}}}
filter: {type: ekf}
"""
ANGLE = HEAD + """
name: angle
dt: 0.1
states: {th: {init: 0, std: 0.5, kind: angle}, w: {init: 0, std: 0.3}}
dynamics: {f: {th: th + dt*w}, Q: {w: 1e-3}}
measurements: {m: {z: {a: {h: th, std: 0.05, kind: angle}}}}
filter: {type: ekf}
"""


@pytest.fixture(scope="module")
def pairs():
    """Name -> the integer filter and the same in float64."""
    specs = {s.name: s for s in map(loads, (PROPORTIONAL, DECLARED, PARAMETERS, HEIGHT, ANGLE))}
    whole = kfgen.compile_many(list(specs.values()))
    real = kfgen.compile_many([override(s, "double") for s in specs.values()])
    return dict(zip(specs, zip(whole, real, strict=True), strict=True))


def begin(pair, x=None, **parameters):
    kf, ref = (each.copy() for each in pair)
    for each in (kf, ref):
        each.init()
        for name, value in parameters.items():
            each.parameters[name] = value
        if x is not None:
            each.set_state(x)
    return kf, ref


def follows(kf, ref, **given):
    """Both take the same calls; x within 0.1 sigma, variances within 20 %, no flag."""
    sensor, z = given.pop("z")
    for each in (kf, ref):
        status = each.predict(**given) | each.update(sensor, z)
        assert not status & Status.SATURATED
    variances = np.diag(ref.P)
    assert np.max(np.abs(kf.x - ref.x) / np.sqrt(variances)) < 0.1
    assert np.max(np.abs(np.diag(kf.P) / variances - 1)) < 0.2


@pytest.mark.parametrize("place", [-99, -40, 1, 70, 99])
def test_noise_in_proportion_to_a_state(pairs, place):
    kf, ref = begin(pairs["proportional_noise"])
    random = np.random.default_rng(1)
    for _ in range(200):
        follows(kf, ref, z=("m", [place + round(0.3 * random.standard_normal(), 3)]))


@pytest.mark.parametrize(("w", "u"), [(3780, 0), (-3999, 40), (3999, -40), (0, 39)])
def test_corners_of_ranges(pairs, w, u):
    kf, ref = begin(pairs["declared_range"], [w, 0])
    for _ in range(100):
        follows(kf, ref, u=[u], z=("speed", [w]))
    if u == 0:
        assert kf.x[1] == pytest.approx(37.8, abs=0.01)


@pytest.mark.parametrize("dt", [0.02, 0.1, 1.0])
@pytest.mark.parametrize("sigma", [0.1, 20])
@pytest.mark.parametrize("rate", [0.05, 5])
def test_parameters_and_steps(pairs, dt, sigma, rate):
    kf, ref = begin(pairs["parameters"], [-900, 40], sigma=sigma, rate=rate)
    for k in range(40):
        follows(kf, ref, dt=dt, z=("m", [-900 + 40 * dt * (k + 1)]))


@pytest.mark.parametrize("h", [-90, 100, 5000, 8900])
def test_powers(pairs, h):
    kf, ref = begin(pairs["height"], [h, 0, 0])
    for _ in range(60):
        follows(kf, ref, u=[0.1], z=("baro", [1013.25 * (1 - h / 44330) ** 5.255]))


def test_angles_are_wrapped_where_they_come_in(pairs):
    kf, ref = begin(pairs["angle"])
    for k in range(60):
        for each in (kf, ref):
            each.predict()
            each.update("m", [41 + 0.01 * math.sin(k)])
    assert np.max(np.abs(kf.x - ref.x)) < 1e-4
    for each in (kf, ref):
        each.set_state([-41.0, 0.0])
    assert kf.x[0] == pytest.approx(ref.x[0], abs=1e-6)
    log = {"m.a": np.full(20, 41.0)}
    assert np.max(np.abs(kf.run(log).x - ref.run(log).x)) < 1e-4


def test_getters_say_what_does_not_fit():
    files = kfgen.generate(loads(DECLARED))
    assert "declared_range_status_t declared_range_get_covariance(" in files["declared_range.h"]
    assert "void declared_range_get_covariance(" in kfgen.generate(loads(DECLARED), "float")["declared_range.h"]


def test_what_32_bits_cannot_hold_is_refused_with_a_range_that_would_do():
    text = PARAMETERS.replace("[-1000, 1000]}, v", "[-1e9, 1e9]}, v").replace("std: 5,", "std: 0.5,")
    with pytest.raises(SpecError, match=r"cannot carry `\w`.*bits? (are )?missing.*would fit"):
        build(loads(text.replace("sigma: {value: 1.0", "sigma: {value: 0.1")))


def test_no_range_is_proposed_that_leaves_nothing():
    text = """kfgen: 1
name: heater
scalar: q16.16
filter: {type: ekf, covariance: full}
dt: {nominal: 0.1, min: 0.01, max: 1}
states:
  Ta: {init: 20, std: 1e3, range: [-40, 120]}
  Tp: {init: 20, std: 1e3, range: [-40, 400]}
  k: {init: 0.05, std: 0.02, range: [0.01, 0.2]}
inputs: {P: {range: [0, 100]}}
dynamics: {form: continuous, f: {Tp: 0.02*P - k*(Tp - Ta), Ta: 0, k: 0}, Q: {Tp: 1e-3*dt, Ta: 1e-4*dt, k: 1e-8*dt}}
measurements: {ambient: {z: {ta: {h: Ta, std: 1e-3}}}, plate: {z: {tp: {h: Tp, std: 0.5}}, robust: huber}}
"""
    with pytest.raises(SpecError) as refused:
        build(loads(text))
    assert "would fit" not in str(refused.value)
    assert "a smaller std, give what sees it a larger one" in str(refused.value)


def test_a_sensor_that_never_measures_anything_is_refused():
    text = ANGLE.replace("init: 0, std: 0.3", "init: -2, std: 0.01")
    text = text.replace("m: {z:", "n: {z: {b: {h: log(w), std: 1}}}, m: {z:")
    with pytest.raises(SpecError, match="`n` has no value in any run"):
        build(loads(text))


def test_the_log_of_a_spec_counts_whatever_is_done(tmp_path):
    (tmp_path / "drive.csv").write_text("m.a\n" + "".join(f"{0.001 * k}\n" for k in range(50)))
    text = HEAD + """
name: logged
dt: 1
states: {p: {init: 0, std: 1}}
dynamics: {f: {}, Q: {p: 0.01}}
measurements: {m: {z: {a: {h: p, std: 1}}}}
filter: {type: kf}
"""
    (tmp_path / "drive.csv").write_text("m.a\n" + "".join(f"{100 * k}\n" for k in range(50)))
    path = tmp_path / "logged.yaml"
    path.write_text(text + "fixed: {log: drive.csv}\n")
    named, given = kfgen.load(path), loads(text)
    log = tmp_path / "drive.csv"
    assert np.array_equal(kfgen.compile(named).struct.units.x, kfgen.compile(given, log=log).struct.units.x)
    assert not np.array_equal(kfgen.compile(named).struct.units.x, kfgen.compile(given).struct.units.x)
    log.unlink()
    with pytest.raises(SpecError, match=r"fixed.log: the log .*drive.csv cannot be read"):
        build(named)


def test_the_certificate_names_the_widest_run():
    lines = build(loads(DECLARED)).fixed.certified()
    assert lines[0].split() == ["operations", "proved", "guarded", "at", "risk"]
    assert "w -4000 to 4000" in lines[-1]
