"""What lies at the corners of the declared box: outages at the largest step, noises of nothing, masks, large ratios."""

from __future__ import annotations

import numpy as np
import pytest
from test_extremes import text as extreme
from test_filters import ATT

import kfgen
from kfgen.check import check
from kfgen.commands.check import report
from kfgen.errors import SpecError
from kfgen.generate import build
from kfgen.override import override
from kfgen.simulate import simulate
from kfgen.spec.loading import loads
from kfgen.status import Status

HEAD = "kfgen: 1\nscalar: q16.16\n"
OUTAGE = HEAD + """
name: outage
dt: {nominal: 0.1, min: 0.01, max: 2}
parameters: {sa: {value: 0.5, range: [0, 3]}, sp: {value: 2, range: [1, 10]}}
states:
  p: {init: 0, std: 5, range: [-1000, 1000]}
  v: {init: 0, std: 2, range: [-40, 40]}
  b: {init: 0, std: 0.1, range: [-1, 1]}
inputs: {a: {range: [-10, 10]}}
dynamics:
  f: {p: p + dt*v + dt**2/2*(a - b), v: v + dt*(a - b)}
  Q: {p: sa**2*dt**3/3, v: sa**2*dt, b: 1e-5*dt}
measurements: {m: {z: {p: {h: p, std: sp}}}}
filter: {type: ekf}
"""
MASKS = HEAD + """
name: masks
dt: 0.05
states:
  x: {init: 0, std: 5, range: [-100, 100]}
  y: {init: 0, std: 5, range: [-100, 100]}
  yaw: {init: 0, std: 0.5, kind: angle}
  v: {init: 5, std: 1, range: [-20, 20]}
inputs: {gyro: {range: [-3, 3]}, acc: {range: [-8, 8]}}
dynamics:
  f: {x: x + dt*v*cos(yaw), y: y + dt*v*sin(yaw), yaw: yaw + dt*gyro, v: v + dt*acc}
  Q: {x: 1e-3*dt, y: 1e-3*dt, yaw: 1e-3*dt, v: 0.1*dt}
measurements:
  gnss: {z: {x: {h: x, std: 1}, y: {h: y, std: 1}}, partial: true, robust: {influence: huber}}
  odo: {z: {v: {h: v, std: 0.2}}}
filter: {type: ekf}
"""
FALL = HEAD + """
name: fall
dt: {nominal: 0.2, min: 0.05, max: 0.5}
parameters: {s: {value: 0.1, range: [0, 0.5]}}
states:
  h: {init: 30, std: 3, range: [5, 100]}
  v: {init: 0, std: 2, range: [-30, 30]}
  k: {init: 0.02, std: 0.005, range: [0.005, 0.05]}
dynamics: {f: {h: h + dt*v, v: v - dt*k*v*abs(v)}, Q: {h: 1e-3*dt, v: s**2*dt, k: 1e-8*dt}}
measurements: {rng: {z: {d: {h: sqrt(h**2 + 25), std: 0.2}}}}
filter: {type: ukf, covariance: full}
"""
SILENT = HEAD + """
name: silent
dt: 0.1
states: {p: {init: 1, std: 5}, v: {init: 0, std: 1}, k: {init: 0.1, std: 0.01}}
dynamics: {f: {p: p + dt*v, v: v - dt*k*v*abs(v)}, Q: {p: 0.01, v: 0.01, k: 1e-6}}
measurements: {m: {z: {a: {h: sqrt(p**2 + 25), std: 0.5}, b: {h: v*p, std: 1}}}}
filter: {type: ekf, covariance: full, update: joseph, adaptive: true}
"""
BANK = HEAD + """
name: two_modes
dt: 0.1
states: {p: {init: 0, std: 100}, v: {init: 0, std: 10}}
measurements: {m: {z: {p: {h: p, std: 0.1}}}}
imm:
  modes:
    calm: {dynamics: {f: {p: p + dt*v}, Q: {v: 1e-3}}, filter: {type: ekf}}
    wild: {dynamics: {f: {p: p + dt*v}, Q: {v: 1}}, filter: {type: ekf}}
  transition: [[0.95, 0.05], [0.05, 0.95]]
"""
WANDER = HEAD + """
name: wander
dt: 0.1
states: {p: {init: 0, std: 5, range: [-20, 20]}, v: {init: 0, std: 2}}
dynamics: {f: {p: p + dt*v}, Q: {v: 0.5}}
measurements: {m: {z: {p: {h: p, std: 0.5}}}}
filter: {type: kf}
"""
PENDULUM = HEAD + """
name: pendulum
dt: 0.1
states: {{th: {{init: 0.1, std: 0.2, kind: angle}}, w: {{init: 0, std: 0.5, range: [-10, 10]}}}}
dynamics:
  {{form: continuous, integrator: rk4, substeps: {substeps}, f: {{th: w, w: -9.81*sin(th) - 0.1*w}}, Q: {{w: 0.01}}}}
measurements: {{enc: {{z: {{s: {{h: sin(th), std: 0.02}}}}}}}}
filter: {{type: ekf}}
"""
ADAPTED = HEAD + """
name: adapted
dt: 0.1
states: {p: {init: 0, std: 3, range: [-200, 200]}, v: {init: 0, std: 2, range: [-20, 20]}}
dynamics: {f: {p: p + dt*v}, Q: {v: 0.05}}
measurements: {m: {z: {p: {h: p, std: 0.5}}}}
filter: {type: ekf, adapt_R: 0.01}
"""


@pytest.fixture(scope="module")
def pairs():
    """Name -> the integer filter and the same in float64."""
    specs = {s.name: s for s in map(loads, (OUTAGE, FALL, extreme("points"), ATT))}
    whole = kfgen.compile_many([override(s, "q16.16") for s in specs.values()])
    real = kfgen.compile_many([override(s, "double") for s in specs.values()])
    return dict(zip(specs, zip(whole, real, strict=True), strict=True))


def near(kf, ref):
    variances = np.diag(ref.P)
    assert np.max(np.abs(kf.x - ref.x) / np.sqrt(variances)) < 0.1
    lsb = np.diag(kf.struct.units.P)
    assert np.max((np.abs(np.diag(kf.P) - variances) - lsb) / variances) < 0.2


@pytest.mark.parametrize("sa", [0, 0.5, 3])
@pytest.mark.parametrize("sp", [1, 10])
@pytest.mark.parametrize("dt", [0.01, 2])
def test_outages_at_the_ends_of_the_step(pairs, dt, sp, sa):
    kf, ref = (each.copy() for each in pairs["outage"])
    for each in (kf, ref):
        each.init()
        each.parameters["sa"], each.parameters["sp"] = sa, sp
    for k in range(80):
        dark = 20 <= k < 40
        for each in (kf, ref):
            status = each.predict([1 if k % 2 else -1], dt)
            status |= 0 if dark else each.update("m", [0.3 * (-1) ** k])
            assert not status & Status.SATURATED
        near(kf, ref)


@pytest.mark.parametrize("s", [0, 0.5])
@pytest.mark.parametrize("h", [6, 99])
def test_states_of_different_size_in_a_full_sigma_point_filter(pairs, h, s):
    kf, ref = (each.copy() for each in pairs["fall"])
    for each in (kf, ref):
        each.init()
        each.parameters["s"] = s
        each.set_state([h, 0, 0.02])
    for k in range(60):
        for each in (kf, ref):
            status = each.predict(dt=0.5 if k % 3 else 0.05)
            assert not (status | each.update("rng", [(h * h + 25) ** 0.5])) & Status.SATURATED
        near(kf, ref)


@pytest.mark.parametrize("name", ["points", "att"])
def test_what_is_round_off_in_real_numbers_saturates_nothing(pairs, name):
    kf, ref = (each.copy() for each in pairs[name])
    log = simulate(ref.spec, 60, seed=4).columns
    result = kf.run(log)
    assert not np.any(result.status & Status.SATURATED)


def test_an_update_with_weights_and_masks():
    assert check(loads(MASKS)).passed


def test_a_bound_of_a_correlation_keeps_small_variances_apart():
    """Where an update may have lost its digits, and in the formats of the elements."""
    source = build(loads(FALL)).files["fall.c"]
    assert "fall_limit_correlations" not in source.replace("fall_limit_correlations_", "")
    assert source.count("fall_q_sqrt(kf->P[") == 6


def test_a_product_with_nothing_ends():
    with pytest.raises(SpecError, match=r"cannot carry `k`.*1 bit is missing"):
        build(loads(SILENT))


def test_what_a_check_may_find_wrong_is_said():
    (told,) = build(loads(BANK)).fixed.told
    assert "carries `p` within" in told
    assert "bits missing; start with a smaller std" in told
    assert build(loads(BANK.replace("std: 100}", "std: 5}"))).fixed.told == ()


def test_a_check_tells_a_track_that_leaves_its_range_from_a_wrong_filter():
    outcome = check(loads(WANDER))
    assert outcome.passed
    assert 0 < outcome.outside < outcome.steps
    assert any(isinstance(part, str) and "steps not compared: there the model's own track" in part
               for part in report(outcome))  # fmt: skip
    assert check(override(loads(WANDER), "double")).outside == 0


def test_more_substeps_than_can_be_tried_are_refused_at_once():
    text = PENDULUM.format(substeps=1000)
    with pytest.raises(SpecError, match=r"1000 substeps are about .* use at most [0-9]+ substeps, or float"):
        build(loads(text))
    assert build(loads(PENDULUM.format(substeps=3))).fixed.told == ()


def test_an_adapted_noise_says_that_it_was_clipped():
    kf = kfgen.compile(loads(ADAPTED))
    kf.init()

    def status():
        struct = kf.struct
        return struct.function("get_R_m")(struct.data, struct.ffi.new("adapted_real_t[1]"))

    kf.update("m", [10.0])
    assert status() == Status.OK
    for k in range(40):
        kf.predict()
        kf.update("m", [(-1) ** k * 1000.0])
    assert status() == Status.SATURATED
    kf.init()
    assert status() == Status.OK
