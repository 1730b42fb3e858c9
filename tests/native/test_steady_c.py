"""gain: steady in the emitted C: the gain of the Riccati equation, and nothing else.

A wrong gain is the solver's (kfgen.filters.algebra.riccati); a wrong x with the right gain is the emitter's.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from calling import Calls, refused
from emitted import problems
from scipy.linalg import block_diag, solve_discrete_are
from variants import CODE, built, spec_with

from kfgen.errors import SpecError
from kfgen.generate import generate
from kfgen.native import NativeFilter
from kfgen.reference import reference
from kfgen.spec import loads
from kfgen.status import ERROR, Status

# two sensors, one with a noise input and a full R, inputs, an angle, process noise through an input
TRACK = """
kfgen: 1
name: track
scalar: double
dt: 0.1
states:
  p: {init: 1, var: 2}
  v: {init: 0, var: 1}
  th: {init: 0.3, var: 0.2, kind: angle}
  b: {init: 0, var: 1}
inputs: {a: {}}
noise: {jerk: {var: 0.5}}
dynamics:
  form: discrete
  f: {p: p + dt*v, v: 0.98*v + dt*(a + jerk), th: th + dt*v, b: 0.9*b}
  Q: {p: 0.001, th: 0.002, b: 0.01}
measurements:
  first:
    z:
      x: {h: p + b + 0.5*common}
      y: {h: 2*p - b + a + 0.5*common}
    R: [[0.3, 0.1], [0.1, 0.4]]
    noise: {common: {var: 0.2}}
  second:
    z:
      heading: {h: th, var: 0.1, kind: angle}
    gate: {probability: 0.99}
filter: {type: kf}
"""
BALL = problems.BALL.replace("type: ekf", "type: kf")
SIX = problems.SIX_SENSORS.replace("f: {x: x}", "f: {x: x}\n  Q: {x: 6}")
UNSTABLE = """
kfgen: 1
name: unstable
scalar: double
states: {x: {init: 0, var: 1}, y: {init: 0, var: 1}}
dynamics: {form: discrete, f: {x: 1.25*x + 0.5*y, y: 0.5*y}, Q: [[0.2, 0.1], [0.1, 0.1]]}
measurements:
  s:
    z: {a: {h: x}, b: {h: x - y}}
    R: [[2, 1], [1, 1]]
filter: {type: kf}
"""

# F, Q, and H, R of each sensor
MODELS = {
    TRACK: (
        [[1, 0.1, 0, 0], [0, 0.98, 0, 0], [0, 0.1, 1, 0], [0, 0, 0, 0.9]],
        np.diag([0.001, 0.1**2 * 0.5, 0.002, 0.01]),
        [([[1, 0, 0, 1], [2, 0, 0, -1]], [[0.35, 0.15], [0.15, 0.45]]), ([[0, 0, 1, 0]], [[0.1]])],
    ),
    BALL: (
        [[1, 0.05, 0.05**2 / 2], [0, 1, 0.05], [0, 0, 1]], 1e-4 * np.eye(3), [([[1, 0, 0]], [[0.25]])],
    ),
    SIX: ([[1]], [[6]], [(np.ones((6, 1)), np.eye(6))]),
    UNSTABLE: ([[1.25, 0.5], [0, 0.5]], [[0.2, 0.1], [0.1, 0.1]], [([[1, 0], [1, -1]], [[2, 1], [1, 1]])]),
}  # fmt: skip


@cache
def filters() -> dict[str, NativeFilter]:
    return built({text: loads(text.replace("type: kf", "type: kf, gain: steady") + CODE) for text in MODELS})


def riccati(F, Q, sensors) -> list[tuple[np.ndarray, np.ndarray]]:
    """Gain of each sensor and the covariance after it; scipy's solution, polished by a few steps of the recursion."""
    F, Q = np.array(F, float), np.array(Q, float)
    sensors = [(np.array(H, float), np.array(R, float)) for H, R in sensors]
    P = solve_discrete_are(F.T, np.vstack([H for H, _ in sensors]).T, Q, block_diag(*[R for _, R in sensors]))
    for _ in range(30):
        out = []
        for H, R in sensors:
            K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
            A = np.eye(len(F)) - K @ H
            P = A @ P @ A.T + K @ R @ K.T
            out.append((K, P))
        P = F @ P @ F.T + Q
    return out


def gain(kf: NativeFilter, sensor: str) -> np.ndarray:
    """As the C applies it: the answer to a unit innovation in one component, at x = 0."""
    m, n = len(kf.components(sensor)), len(kf.states)
    u = [0.0] if kf.struct.takes(f"update_{sensor}", "u") else None
    columns = []
    for i in range(m):
        kf.set_state(np.zeros(n))
        assert kf.update(sensor, np.eye(m)[i] * 2.0**-6, u) == 0
        columns.append(kf.x * 2.0**6)
    return np.array(columns).T


@pytest.mark.parametrize("text", MODELS, ids=[loads(text).name for text in MODELS])
def test_scipy(text):
    kf, wanted = filters()[text], riccati(*MODELS[text])
    for sensor, (K, _) in zip(kf.sensors, wanted, strict=True):
        np.testing.assert_allclose(gain(kf, sensor), K, rtol=1e-12, atol=1e-12 * np.max(np.abs(K)))
    P = wanted[-1][1]
    np.testing.assert_allclose(kf.P, P, rtol=1e-12, atol=1e-12 * np.max(np.abs(P)))


def test_a_filter_that_has_settled():
    """Beside the filter that carries its covariance: the same numbers from then on."""
    kf = filters()[TRACK]
    settled = built({0: spec_with(TRACK, "type: kf", "ud-bierman")})[0]
    random = np.random.default_rng(3)
    kf.init()
    for k in range(450):
        a, z, th = random.normal(size=1), random.normal(size=2), random.normal(size=1) * 0.1
        if k == 400:
            assert kf.set_state(settled.x) == 0
        for each in (kf, settled):
            assert each.predict(a) == 0
            assert each.update("first", z, a) == 0
        status = kf.update("second", th)
        assert settled.update("second", th) == status or k < 400
        if k >= 400:
            np.testing.assert_allclose(kf.x, settled.x, rtol=1e-12, atol=1e-12)
            assert kf.nis == pytest.approx(settled.nis, rel=1e-10)
            assert kf.log_likelihood == pytest.approx(settled.log_likelihood, rel=1e-10)
    sigma = np.sqrt(kf.P.diagonal())
    assert np.max(np.abs(kf.P - settled.P) / np.outer(sigma, sigma)) < 1e-12


def test_gate_and_errors():
    kf = filters()[TRACK]
    kf.init()
    assert kf.predict([1.0]) == 0
    calls, before = Calls(kf), kf.copy()
    for bad in (math.nan, math.inf):
        refused(calls, Status.NOT_FINITE, "predict", u=np.array([bad]))
        refused(calls, Status.NOT_FINITE, "update_first", z=np.array([0, bad]))
        refused(calls, Status.NOT_FINITE, "update_first", u=np.array([bad]))
        refused(calls, Status.NOT_FINITE, "update_second", z=np.array([bad]))
    refused(calls, Status.NULL_ARGUMENT, "update_first", z=None)
    refused(calls, Status.NOT_FINITE, "update_first", z=np.array([1e200, 0]))  # nis overflows
    assert kf.update("second", [kf.x[2] + 2.5]) == Status.GATED
    assert kf.gate_count == {"second": 1}
    assert kf.nis > 10
    kf.struct.data.nis, kf.struct.data.gate_count_second = before.struct.data.nis, 0
    assert bytes(kf) == bytes(before)
    assert kf.update("second", [kf.x[2] + 0.1 - 2 * math.pi]) == 0
    with pytest.raises(AttributeError):
        kf.set_covariance(np.eye(4))
    assert not kf.struct.fields & {"U", "D", "P", "S"}
    text = TRACK.replace("type: kf", "type: kf, gain: steady, covariance: sqrt")
    assert "set_sqrt" not in generate(loads(text))["track.h"]


LINEAR = """
kfgen: 1
name: linear
scalar: double
states: {x: {init: 1, var: 1}, y: {init: 0, var: 1}}
dynamics: {form: discrete, f: {x: F, y: G}, Q: {x: QX, y: QY}}
measurements:
  s: {z: {a: {h: HA, var: RA}, b: {h: HB, var: RB}}}
filter: {type: kf, gain: steady}
"""


def linear(F: str, G: str, Q: tuple[str, str], a: tuple[str, str], b: tuple[str, str]) -> str:
    text = LINEAR
    for key, value in {"F": F, "G": G, "QX": Q[0], "QY": Q[1], "HA": a[0], "RA": a[1], "HB": b[0], "RB": b[1]}.items():
        text = text.replace(f" {key},", f" {value},").replace(f" {key}}}", f" {value}}}")
    return text


def test_no_steady_state():
    """The variance of a constant falls for ever."""
    text = problems.one_state("  form: discrete\n  f: {x: x}").replace("type: ekf", "type: kf, gain: steady")
    with pytest.raises(SpecError, match=r"filter\.gain: no steady state"):
        generate(loads(text))


REGULAR = linear("x + y", "0.9*y", ("0.2", "0.1"), ("x + y", "1"), ("x - y", "2"))
CASES = {
    "consider": (REGULAR, "update: joseph, consider: [y]"),
    "gain_limit": (REGULAR, "update: joseph, gain_limit: 0.3"),
    "innovation_floor": (REGULAR, "innovation_floor: 4"),
    "all": (REGULAR, "covariance: full, update: joseph, consider: [y], gain_limit: 0.3, innovation_floor: 4"),
    "exact": (linear("x", "0.5*y", ("1", "1"), ("x", "0"), ("y", "1")), ""),
    "exact twice": (linear("x", "0.5*y", ("1", "1"), ("x", "0"), ("2*x", "0")), ""),
    "dies out": (linear("0.99*x", "0.5*y", ("0", "0"), ("x", "1"), ("y", "1")), ""),
    "slow": (linear("x", "y", ("1e-8", "1e-7"), ("x + y", "1"), ("y", "4")), ""),
}


def test_the_reference():
    """Gains that are not optimal, exact sensors, states without noise: x, P, nis, log_likelihood, statuses."""
    specs = {}
    for name, (text, options) in CASES.items():
        specs[name] = loads(text.replace("gain: steady", f"gain: steady, {options}".rstrip(", ")) + CODE)
    random = np.random.default_rng(2)
    for name, kf in built(specs).items():
        ref = reference(kf.spec)
        np.testing.assert_allclose(kf.P, ref.P, rtol=1e-10, atol=1e-12 * np.max(np.abs(ref.P)) + 1e-30)
        for _ in range(10):
            z = random.normal(size=2)
            assert kf.predict() == ref.predict() == 0
            assert kf.update("s", z) == ref.update("s", z) < ERROR, name
            np.testing.assert_allclose(kf.x, ref.x, rtol=1e-9, atol=1e-11, err_msg=name)
            assert kf.nis == pytest.approx(ref.nis, rel=1e-9), name
            assert kf.log_likelihood == pytest.approx(ref.log_likelihood, rel=1e-9), name
