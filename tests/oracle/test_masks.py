"""A masked update is the update of a sensor that has only the components in use."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.stats import chi2

from kfgen.reference import Status, reference
from kfgen.spec import loads

COMPONENTS = {
    "a": '{h: "x**2/4 + v"}',
    "b": '{h: "atan2(v, x) + 0.3*n1", kind: angle}',
    "c": '{h: "x*v + n1*n2"}',
    "d": '{h: v, residual: "sinh(z - h)"}',
}
R = np.array([[0.3, 0.1, 0.05, 0.0], [0.1, 0.2, -0.05, 0.02], [0.05, -0.05, 0.4, 0.1], [0.0, 0.02, 0.1, 0.25]])


def spec(names: str, options: str, partial: bool, gate: str = "") -> str:
    used = ["abcd".index(name) for name in names]
    z = "\n".join(f"      {name}: {COMPONENTS[name]}" for name in names)
    return f"""
kfgen: 1
name: masked
scalar: double
dt: 0.5
states:
  x: {{init: -1.2, var: 0.3}}
  v: {{init: 0.1, var: 0.2}}
covariances: [[x, v, 0.1]]
dynamics:
  form: discrete
  f: {{x: x + dt*v}}
  Q: {{v: 0.05}}
measurements:
  s:
    z:
{z}
    R: {R[np.ix_(used, used)].tolist()}
    noise: {{n1: {{}}, n2: {{}}}}
    noise_covariance: [[0.1, 0.02], [0.02, 0.2]]
    partial: {str(partial).lower()}
{gate}
filter: {{{options}}}
"""


def build(text: str):
    return reference(loads(text))


OPTIONS = [
    "type: ekf",
    "type: ekf, covariance: sqrt",
    "type: ekf, covariance: full, update: standard",
    "type: ekf, robust: chernodarov",
    "type: ekf, robust: huber, adaptive: {chi2: 0.5}",
    "type: ekf, adaptive: {probability: 0.6}, innovation_floor: 0.7",
    "type: ekf, update: joseph, consider: [v], gain_limit: 0.4",
    "type: iekf, iterations: 4",
    "type: iekf, covariance: full, consider: [v]",
    "type: ekf2",
    "type: ekf2, robust: huber, adapt_Q: 0.1",
]


@pytest.mark.parametrize("options", OPTIONS)
def test_as_a_sensor_of_fewer_components(options):
    whole = build(spec("abcd", options, True))
    rng = np.random.default_rng(7)
    seen = 0
    for size in range(1, 5):
        for used in itertools.combinations(range(4), size):
            part = build(spec("".join("abcd"[i] for i in used), options, False))
            whole.init()
            for _ in range(2):
                z = rng.normal(size=4) * [1, 1, 2, 1]
                masked = np.where(np.isin(np.arange(4), used), z, math.nan)
                whole.predict()
                part.predict()
                status = whole.update("s", masked, mask=sum(1 << i for i in used))
                assert status == part.update("s", z[list(used)])
                seen |= status
                np.testing.assert_allclose(whole.x, part.x, rtol=1e-12, atol=1e-14)
                np.testing.assert_allclose(whole.P, part.P, rtol=1e-11, atol=1e-14)
                assert whole.nis == pytest.approx(part.nis, rel=1e-11)
                assert whole.log_likelihood == pytest.approx(part.log_likelihood, rel=1e-11)
    assert seen < Status.ERROR
    wanted = {
        "robust": Status.GLITCH_LARGE,
        "adaptive": Status.ANOMALY,
        "innovation_floor|gain_limit": Status.REGULARIZED,
    }
    for named, flag in wanted.items():
        assert bool(seen & flag) == any(option in options for option in named.split("|"))


@pytest.mark.parametrize("options", OPTIONS[:1] + OPTIONS[4:5] + OPTIONS[7:10])
def test_the_gate_counts_what_is_used(options):
    gate = "    gate: {probability: 0.99}"
    for used in ((0,), (1, 3), (0, 1, 2, 3)):
        limit = chi2.ppf(0.99, len(used))
        mask = sum(1 << i for i in used)
        kf = build(spec("abcd", options, True, gate))
        before = kf.x.tobytes(), kf.P.tobytes()
        statuses = set()
        for size in np.linspace(0.0, 3.0, 60):
            kf.init()
            status = kf.update("s", [0.4 + 2 * size, 3.0 - size, -0.1 + size, 0.1 + size], mask=mask)
            assert (status == Status.GATED) == (kf.nis > limit)
            if status == Status.GATED:
                assert (kf.x.tobytes(), kf.P.tobytes()) == before
            statuses.add(status == Status.GATED)
        assert statuses == {True, False}


def test_nothing_in_use_is_nothing_done():
    kf = build(spec("abcd", OPTIONS[4], True, "    gate: {probability: 0.99}"))
    kf.update("s", [1.0, 1.0, 1.0, 1.0])
    before = kf.x.tobytes(), kf.P.tobytes(), kf.nis, kf.log_likelihood, dict(kf.gate_count)
    assert kf.update("s", [math.nan] * 4, mask=0) == 0
    assert kf.update("s", [math.inf] * 4, mask=[False] * 4) == 0
    assert (kf.x.tobytes(), kf.P.tobytes(), kf.nis, kf.log_likelihood, dict(kf.gate_count)) == before


def test_masks_by_bits_and_by_truth():
    one, other = (build(spec("abcd", OPTIONS[0], True)) for _ in range(2))
    assert one.update("s", [1.0, 2.0, 3.0, 4.0], mask=0b1010) == 0
    assert other.update("s", [9.0, 2.0, 9.0, 4.0], mask=[False, True, False, True]) == 0
    np.testing.assert_array_equal(one.x, other.x)
    assert one.update("s", [1.0, math.nan, 3.0, 4.0], mask=0b1010) == Status.NOT_FINITE


def test_initialize_wants_its_components():
    text = spec("abcd", OPTIONS[0], True).replace("dynamics:", "initialize: {from: s, states: {x: a, v: d}}\ndynamics:")
    kf = build(text)
    assert kf.update("s", [5.0, 0.0, 0.0, 6.0], mask=0b0111) == 0  # an update like any other
    assert kf.nis > 0
    assert kf.update("s", [5.0, math.nan, math.nan, 6.0], mask=0b1001) == 0
    np.testing.assert_array_equal(kf.x, [5.0, 6.0])


def test_adapted_R_of_a_part():
    """What is learnt of the components in use, and of the correlations with the others; all else stays."""
    kf = build(spec("abcd", "type: ekf, adapt_R: 0.25", True))
    x, P = kf.x, kf.P
    H = np.array([x / 2 * [1, 0] + [0, 1], [0, 1]])  # of a and d
    assert kf.update("s", [0.5, math.nan, math.nan, 0.2], mask=0b1001) == 0
    expected = R.copy()
    for i, j in itertools.product(range(4), range(4)):
        if {i, j} <= {0, 3}:
            k = [0, 3].index(i), [0, 3].index(j)
            expected[i, j] = 0.75 * R[i, j] + 0.25 * (H @ P @ H.T)[k]
        elif i in (0, 3) or j in (0, 3):
            expected[i, j] = 0.75 * R[i, j]
    np.testing.assert_allclose(kf.R["s"], expected, rtol=1e-13, atol=1e-16)
    e = np.array([0.5 - kf.x[0] ** 2 / 4 - kf.x[1], 0.0, 0.0, math.sinh(0.2 - kf.x[1])])
    before, P, x = kf.R["s"], kf.P, kf.x
    assert kf.update("s", [0.5, 3.0, 0.1, 0.2]) == 0
    slopes = np.array(
        [
            [x[0] / 2, 1],
            [-x[1] / (x @ x), x[0] / (x @ x)],
            [x[1], x[0]],
            [0, 1],
        ]
    )
    expected = 0.75 * before + 0.25 * (slopes @ P @ slopes.T + np.outer(e, e))
    np.testing.assert_allclose(kf.R["s"], expected, rtol=1e-12, atol=1e-15)
