"""What a bank does beside the algebra: gates, errors, setting, what belongs to a mode and what to all."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from imm_banks import STRAIGHT, TURNING, bank, build
from problems import IMM3, one_state
from scipy.stats import chi2

from kfgen.errors import SpecError
from kfgen.reference import Status, reference
from kfgen.spec import loads

HALF = [[0.9, 0.1], [0.1, 0.9]]
GATE = "    gate: {probability: 0.99, reset_after: 2}\n"
LIMIT = float(chi2.ppf(0.99, 1))


def held(kf) -> bytes:
    """All that a call which is refused must leave: estimates, probabilities, kept points, adapted noise, time."""
    return pickle.dumps((kf._estimate, kf.t, kf.nis, kf.log_likelihood, kf.gate_count))


def apart(gate: str = GATE, **own: str) -> str:
    """Two modes at 0 and 6 with variance 1, and a sensor of variance 1 that sees the state."""
    top = one_state("  f: {x: x}").replace("filter: {type: ekf}\n", gate)
    modes = {
        "low": f"states: {{x: {{init: 0, var: 1}}}}\n{own.get('low', '')}",
        "high": f"states: {{x: {{init: 6, var: 1}}}}\n{own.get('high', '')}",
    }
    return bank(top, modes, HALF)


def test_gate_refuses_what_every_mode_refuses():
    kf = build(apart())
    before = pickle.dumps(kf._estimate)
    for z, nis in ((-5.0, 12.5), (11.0, 12.5)):
        assert kf.update("s", [z]) == Status.GATED
        assert kf.nis == pytest.approx(nis)
    assert kf.gate_count == {"s": 2}
    assert pickle.dumps(kf._estimate) == before
    assert kf.log_likelihood == 0.0
    # the third in a row is taken by all
    assert kf.update("s", [11.0]) == Status.ANOMALY
    assert kf.gate_count == {"s": 0}
    assert [mode.x[0] for mode in kf.modes] == [5.5, 8.5]


def test_what_one_mode_accepts_all_take():
    """The gate is the bank's: a mode that the reading contradicts takes it, and loses its probability."""
    kf = build(apart())
    assert kf.update("s", [7.0]) == 0
    assert kf.nis == pytest.approx(0.5)
    assert [mode.x[0] for mode in kf.modes] == [3.5, 6.5]
    assert [mode.P[0, 0] for mode in kf.modes] == [0.5, 0.5]
    assert kf.mu[0] == pytest.approx(math.exp(-49 / 4) / (math.exp(-49 / 4) + math.exp(-1 / 4)))
    assert kf.gate_count == {"s": 0}


def test_gates_of_the_modes_own():
    """A mode without a gate refuses nothing; of several thresholds and resets the most willing counts."""
    sensor = "measurements:\n  s:\n    z: {z: {h: x, var: 1}}\n"
    z = [-math.sqrt(2.0 * LIMIT) - 0.1]
    kf = build(apart(high=sensor))
    assert kf.update("s", z) == 0
    kf = build(apart(low=sensor + "    gate: {probability: 0.999}\n"))
    assert kf.update("s", z) == 0
    kf = build(apart(low=sensor + "    gate: {probability: 0.9, reset_after: 5}\n"))
    assert [kf.update("s", z) for _ in range(3)] == [Status.GATED, Status.GATED, Status.ANOMALY]
    kf = build(apart(GATE.replace(", reset_after: 2", ""), high=f"{sensor}{GATE.replace('2', '1')}"))
    assert [kf.update("s", z) for _ in range(2)] == [Status.GATED, Status.ANOMALY]


BREAKABLE = """
kfgen: 1
name: breakable
scalar: double
dt: {nominal: 0.5, min: 0.1, max: 1}
parameters: {a: 1, q: 0.1, r: 1, s: 1}
states: {x: {init: 1, var: 0.5}, v: {init: 0.1, var: 0.2}}
dynamics: {f: {x: x + dt*v, v: v/a}, Q: {v: 0.01}}
measurements:
  range: {z: {z: {h: x + x**2/9, var: 0.3}}, gate: {probability: 0.999}}
  other: {z: {z: {h: x, var: r}}}
"""
KINDS = {
    "first": "filter: {type: ekf, adapt_R: 0.1, adapt_Q: 0.1}\nmeasurements:\n  range: {z: {z: {h: x, var: 0.3}}}\n"
    "  other: {z: {z: {h: x, var: 0.2}}}",
    "middle": "filter: {type: ukf, covariance: full}\nmeasurements:\n  range: {z: {z: {h: log(x), var: 0.3}}}\n"
    "  other: {z: {z: {h: x, var: s}}}",
    "last": "dynamics: {f: {x: x + dt*v}, Q: {v: q}}",
}


def test_an_error_in_one_mode_leaves_the_whole_bank():
    kf = build(bank(BREAKABLE, KINDS, np.full((3, 3), 1 / 3).tolist(), mu0=[0.2, 0.3, 0.5]))
    kf.predict(dt=0.5)
    assert kf.update("range", [1.1]) == kf.update("other", [1.0]) == 0
    before = held(kf)
    cases = [
        ({"q": -1.0}, lambda: kf.predict(dt=0.5), Status.NOT_POSITIVE),
        ({"a": 0.0}, lambda: kf.predict(dt=0.5), Status.NOT_FINITE),
        # the first of the error bits, not of the modes
        ({"q": -1.0, "a": 0.0}, lambda: kf.predict(dt=0.5), Status.NOT_FINITE),
        ({"r": -1.0}, lambda: kf.update("other", [1.0]), Status.NOT_POSITIVE),
        ({"s": -1.0}, lambda: kf.update("other", [1.0]), Status.NOT_POSITIVE),
        ({"s": -1.0, "r": math.nan}, lambda: kf.update("other", [1.0]), Status.NOT_FINITE),
        ({}, lambda: kf.update("range", [math.nan]), Status.NOT_FINITE),
        ({}, lambda: kf.set_state([1.0, math.inf]), Status.NOT_FINITE),
        ({}, lambda: kf.set_covariance(-np.eye(2)), Status.NOT_POSITIVE),
        ({}, lambda: kf.predict(dt=math.nan), Status.NOT_FINITE),
    ]
    for changes, call, status in cases:
        kf.parameters.update(changes)
        assert call() == status, changes
        assert held(kf) == before
        kf.parameters.update({"a": 1, "q": 0.1, "r": 1, "s": 1})
    # h of one mode has no value at the new state
    kf.set_state([-1.0, 0.0])
    before = held(kf)
    assert kf.update("range", [1.0]) == Status.NOT_FINITE
    assert held(kf) == before
    assert kf.predict(dt=5.0) == Status.DT_CLAMPED


def test_modes_too_far_apart_to_be_mixed():
    kf = build(apart().replace("init: 6", "init: 1e200"))
    before = held(kf)
    assert kf.predict() == Status.NOT_FINITE
    assert held(kf) == before


def test_flags_of_all_modes():
    text = BREAKABLE.split("  range")[0] + "  range: {z: {z: {h: x, var: 0.3}}}\n"
    modes = {
        "robust": "filter: {type: ekf, robust: chernodarov}",
        "adaptive": "filter: {type: ekf, adaptive: true}",
        "limited": "filter: {type: ekf, variance_floor: 0.01, innovation_floor: 0.1}",
    }
    kf = build(bank(text, modes, np.full((3, 3), 1 / 3).tolist()))
    assert kf.predict(dt=0.01) == Status.DT_CLAMPED
    assert kf.update("range", [20.0]) == Status.GLITCH_LARGE | Status.ANOMALY
    assert kf.set_state([1.0, 0.1]) == kf.set_covariance(1e-3 * np.eye(2)) == 0
    assert kf.predict(dt=0.1) == Status.REGULARIZED


def test_setting_acts_on_all_modes():
    kf = build(IMM3)
    for z in (1.0, 2.0, -3.0):
        kf.predict()
        kf.update("position", [z])
    mu = kf.mu
    P = np.diag([1.0, 2.0, 3.0]) + 0.1
    assert kf.set_covariance(P) == 0
    assert all(np.array_equal(mode.P, P) for mode in kf.modes)
    spread = np.subtract(*(mode.x for mode in kf.modes))
    np.testing.assert_allclose(kf.P, P + mu[0] * mu[1] * np.outer(spread, spread), rtol=1e-13)
    assert kf.set_state([1.0, 2.0, 3.0]) == 0
    for each in (kf, *kf.modes):
        np.testing.assert_array_equal(each.x, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(kf.P, P, rtol=1e-14)
    np.testing.assert_array_equal(kf.mu, mu)
    assert kf.init() == 0
    np.testing.assert_array_equal(kf.mu, [0.5, 0.5])
    np.testing.assert_array_equal(kf.P, 0.1 * np.eye(3))


def test_initial_estimates_of_the_modes_are_combined():
    kf = build(apart())
    assert kf.x[0] == 3.0
    assert kf.P[0, 0] == 10.0
    assert [mode.name for mode in kf.modes] == ["low", "high"]
    kf = build(apart().replace("  transition", "  mu0: [0.9, 0.1]\n  transition"))
    assert kf.x[0] == pytest.approx(0.6)


def test_first_reading_sets_the_states_of_all_modes():
    kf = build(apart("initialize: {from: s, states: {x: z}}\n"))
    mu = kf.mu
    assert kf.update("s", [2.5]) == 0
    assert [mode.x[0] for mode in kf.modes] == [2.5, 2.5]
    assert (kf.x[0], kf.P[0, 0], kf.nis) == (2.5, 1.0, 0.0)
    np.testing.assert_array_equal(kf.mu, mu)
    assert kf.update("s", [2.5]) == 0
    assert kf.P[0, 0] == 0.5


def test_adapted_noise_belongs_to_a_mode():
    """Mixing leaves it alone: the mode that adapts has what a single filter at its estimates has learnt."""
    adapting = "filter: {type: ekf, adapt_R: 0.2, adapt_Q: 0.1}"
    text = bank(IMM3.split("imm:")[0] + "dynamics: {f: {p: p + v*dt}, Q: {p: 0.1, v: 0.1, a: 0.1}}\n",
                {"a": adapting, "b": "filter: {type: ukf}", "c": adapting.replace("0.2", "0.3")},
                np.full((3, 3), 1 / 3).tolist())  # fmt: skip
    kf, rng = build(text), np.random.default_rng(1)
    R, e, Q = np.eye(1), np.zeros(1), 0.1 * np.eye(3)
    for _ in range(30):
        assert kf.predict() == 0
        np.testing.assert_allclose(kf.modes[0].R["position"], R, rtol=1e-12)
        x, P, z = kf.modes[0].x, kf.modes[0].P, rng.normal(size=1)
        assert kf.update("position", z) == 0
        R = 0.8 * R + 0.2 * (P[:1, :1] + np.outer(e, e))
        dx = kf.modes[0].x - x
        Q = 0.9 * Q + 0.1 * np.outer(dx, dx)
        e = z - kf.modes[0].x[:1]
        np.testing.assert_allclose(kf.modes[0].R["position"], R, rtol=1e-12)
        np.testing.assert_allclose(kf.modes[0].Q, Q, rtol=1e-12)
    assert not np.allclose(kf.modes[2].R["position"], R, rtol=1e-3)
    kf.set_state([0.0, 0.0, 0.0])
    np.testing.assert_allclose(kf.modes[0].R["position"], R, rtol=1e-12)
    for wanting in (lambda: kf.modes[1].R, lambda: kf.modes[1].Q, lambda: kf.R, lambda: kf.Q):
        with pytest.raises(AttributeError):
            wanting()
    kf.init()
    np.testing.assert_array_equal(kf.modes[0].R["position"], np.eye(1))


def test_what_any_mode_has_the_bank_offers():
    modes = {
        "root": "filter: {type: ekf, covariance: sqrt}",
        "kept": "filter: {type: ukf, sigma_points: {redraw: false}}",
    }
    top = IMM3.split("imm:")[0] + "dynamics: {f: {p: p + v*dt + v**2}}\n"
    kf = build(bank(top, modes, HALF))
    S = np.array([[2.0, 0, 0], [1, 3, 0], [0.5, 0.1, 1]])
    assert kf.set_sqrt_covariance(S) == 0
    np.testing.assert_allclose(kf.sqrt_covariance, S, rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(kf.modes[0].sqrt_covariance, S, rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(kf.modes[1].P, S @ S.T)
    with pytest.raises(AttributeError, match="kept has no sqrt_covariance"):
        kf.modes[1].sqrt_covariance  # noqa: B018
    kf.predict()
    assert kf._estimate.modes[1].memory is not None
    assert kf.redraw() == 0
    assert kf._estimate.modes[1].memory is None
    plain = build(IMM3)
    for wanting in (lambda: plain.sqrt_covariance, plain.redraw, lambda: plain.set_sqrt_covariance(np.eye(3))):
        with pytest.raises(AttributeError):
            wanting()
    single = reference(loads(one_state("  f: {x: x}")))
    for name in ("mu", "modes"):
        with pytest.raises(AttributeError, match=f"no {name}; its spec has no `imm`"):
            getattr(single, name)


def test_inputs_of_one_mode_are_those_of_the_bank():
    own = "measurements:\n  radar: {z: {range: {h: px, std: 1}, bearing: {h: py + a, std: 1, kind: angle}}}\n" \
          "  gnss: {z: {x: {h: px, std: 1}, y: {h: py, std: 1}, speed: {h: v, std: 1}}, partial: true}"  # fmt: skip
    kf = build(bank(TURNING, {"plain": "{}", "own": own}, HALF))
    with pytest.raises(TypeError, match="takes u"):
        kf.update("radar", [30.0, 1.0])
    assert kf.update("radar", [30.0, 1.0], [0.0]) == 0
    assert kf.update("gnss", [-30.0, 5.0, 4.0]) == 0


def test_run():
    kf, hand = (build(bank(TURNING, {"turn": "{}", "straight": f"{STRAIGHT}noise: {{}}"}, HALF)) for _ in range(2))
    nan = math.nan
    log = {
        "t": [0.0, 0.2, 0.5],
        "a": [0.0, 0.1, 0.2],
        "radar.range": [30.0, nan, 31.0],
        "radar.bearing": [3.0, nan, 2.9],
        "gnss.x": [nan, -31.0, nan],
        "gnss.y": [nan, 5.0, nan],
    }
    result = kf.run(log)
    hand.update("radar", [30.0, 3.0])
    np.testing.assert_array_equal(result.mu[0], hand.mu)
    hand.predict([0.1], 0.2)
    hand.update("gnss", [-31.0, 5.0, nan], mask=0b011)
    np.testing.assert_array_equal(result.mu[1], hand.mu)
    assert result.nis["gnss"][1] == hand.nis
    hand.predict([0.2], 0.5 - 0.2)
    hand.update("radar", [31.0, 2.9])
    np.testing.assert_array_equal(result.x[2], hand.x)
    np.testing.assert_array_equal(result.var[2], hand.P.diagonal())
    np.testing.assert_array_equal(result.mu[2], hand.mu)
    assert list(result.status) == [0, 0, 0]
    assert reference(loads(one_state("  f: {x: x}"))).run({"s.z": [1.0]}).mu is None


def test_bounds_hold_for_what_is_combined():
    text = one_state("  f: {x: 1.5*x}").replace("var: 0.5}", "var: 0.5, bounds: [-3.3, 1.1]}")
    modes = {"a": "{}", "b": "dynamics: {f: {x: 1.7*x}}", "c": "dynamics: {f: {x: x/3}}"}
    kf, rng = build(bank(text, modes, [[0.7, 0.2, 0.1]] * 3)), np.random.default_rng(3)
    for _ in range(200):
        assert kf.predict() == 0
        assert kf.update("s", rng.normal(size=1) * 5) == 0
        assert -3.3 <= kf.x[0] <= 1.1


def test_steady_gain_is_refused():
    steady = "filter: {type: kf, gain: steady}"
    text = bank(one_state("  f: {x: x/2}\n  Q: {x: 1}"), {"a": steady, "b": "{}", "c": steady}, [[1, 0, 0]] * 3)
    with pytest.raises(SpecError, match=r"gain: steady.*does not go with imm") as caught:
        reference(loads(text))
    assert len(caught.value.mistakes) == 2
    assert caught.value.mistakes[0].place.path == "imm.modes.a.filter.gain"
