"""Robust and adaptive updates against their formulas written out in covariance form, and their edges."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import RADAR, one_state
from scipy.stats import chi2

from kfgen.reference import Status, reference
from kfgen.spec import loads

FORMS = ["ud", "ud, update: joseph", "full", "full, update: standard", "sqrt"]
P0 = np.array([[4.0, 1.0, 0.5], [1.0, 3.0, -0.4], [0.5, -0.4, 2.0]])
H = np.array([[1.0, 0.0, 0.5], [0.3, 1.0, 0.0]])
R = np.array([[0.5, 0.2], [0.2, 0.4]])


def three_states(options: str, extra: str = "") -> str:
    return f"""
kfgen: 1
name: three
scalar: double
dt: 1
{extra}
states:
  a: {{init: 0}}
  b: {{init: 0}}
  c: {{init: 0}}
P0: {P0.tolist()}
dynamics:
  form: discrete
  f: {{a: a + b}}
measurements:
  s:
    z:
      u: {{h: a + 0.5*c}}
      v: {{h: 0.3*a + b}}
    R: {R.tolist()}
filter: {{type: ekf{options}}}
"""


def build(text: str):
    return reference(loads(text))


def chernodarov(e):
    size = abs(e)
    return (e, 1.0) if size <= 3 else (e / 3, 1 / 3) if size <= 6 else (math.copysign(1.0, e), 0.0)


def huber(k):
    return lambda e: (e, 1.0) if abs(e) <= k else (math.copysign(k, e), 0.0)


def treated(y, psi=None, threshold=None, P=P0):
    """x, P, log-likelihood and flags by the formulas for one scalar after another; R = U D U^T."""
    lower = np.linalg.cholesky(R[::-1, ::-1])
    U, D = (lower / lower.diagonal())[::-1, ::-1], (lower.diagonal() ** 2)[::-1]
    rows, y = np.linalg.inv(U) @ H, np.linalg.inv(U) @ y
    x, likelihood, flags = np.zeros(3), 0.0, 0
    for h, r, full in zip(rows, D, y, strict=True):
        nu, g = full - h @ x, 1.0
        if psi is not None:
            value, g = psi(nu / math.sqrt(r))
            nu = math.sqrt(r) * value
            flags |= Status.GLITCH_LARGE if g == 0 else Status.GLITCH_SMALL if g < 1 else 0
        c = g * h @ P @ h
        if threshold is not None and g * nu**2 / threshold > r + c:
            P = P * (1 + (g * nu**2 / threshold - r - c) / c)
            c = g * h @ P @ h
            assert r + c == pytest.approx(g * nu**2 / threshold, rel=1e-12)
            flags |= Status.ANOMALY
        s = r + c
        x = x + P @ h * nu / s
        P = P - g * np.outer(P @ h, P @ h) / s
        likelihood -= 0.5 * (math.log(2 * math.pi) + nu**2 / s + math.log(s))
    return x, P, likelihood, flags


@pytest.mark.parametrize(
    ("options", "psi", "threshold"),
    [
        (", robust: chernodarov", chernodarov, None),
        (", robust: huber", huber(1.345), None),
        (", robust: {influence: huber, k: 2}", huber(2.0), None),
        (", adaptive: true", None, chi2.ppf(0.999, 1)),
        (", adaptive: {probability: 0.5}", None, chi2.ppf(0.5, 1)),
        (", robust: chernodarov, adaptive: true", chernodarov, chi2.ppf(0.997, 1)),
        (", robust: chernodarov, adaptive: {chi2: 0.1}", chernodarov, 0.1),
        (", robust: {psi: 2*tanh(e/2)}, adaptive: {chi2: 0.05}", None, 0.05),
    ],
)
def test_formulas(options, psi, threshold):
    if "tanh" in options:

        def psi(e):
            return 2 * math.tanh(e / 2), 1 - math.tanh(e / 2) ** 2

    rng = np.random.default_rng(4)
    S = H @ P0 @ H.T + R
    seen = Status.OK
    kf = build(three_states(options))
    for k, size in enumerate(np.linspace(0.2, 6.0, 40)):
        kf.init()
        y = size * np.linalg.cholesky(S) @ rng.normal(size=2)
        x, P, likelihood, flags = treated(y, psi, threshold)
        assert kf.update("s", y) == flags, k
        np.testing.assert_allclose(kf.x, x, rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(kf.P, P, rtol=1e-10, atol=1e-12)
        assert kf.log_likelihood == pytest.approx(likelihood, rel=1e-10)
        assert kf.nis == pytest.approx(y @ np.linalg.solve(S, y), rel=1e-10)  # of the plain residual, plain S
        seen |= flags
    glitches = Status.GLITCH_SMALL | Status.GLITCH_LARGE
    doubted = Status.OK if psi is None else Status.GLITCH_LARGE if "huber" in options else glitches
    # what chernodarov leaves of an innovation hardly ever exceeds the default threshold
    inflated = threshold is not None and (psi is None or threshold < 1)
    assert seen == doubted | (Status.ANOMALY if inflated else Status.OK)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", ["kf", "ekf", "ekf2"])
def test_inflation_beside_a_weight_below_1(form, kind):
    """e = 4 has the weight 1/3; the threshold is low enough that the covariance is inflated all the same."""
    options = f", covariance: {form}, robust: chernodarov, adaptive: {{chi2: 0.05}}"
    kf = build(three_states(options).replace("ekf", kind))
    y = [4.0 * math.sqrt(R[0, 0] - R[0, 1] ** 2 / R[1, 1]) + R[0, 1] / R[1, 1] * 0.1, 0.1]
    x, P, _, flags = treated(np.array(y), chernodarov, 0.05)
    assert flags == Status.GLITCH_SMALL | Status.ANOMALY
    assert kf.update("s", y) == flags
    np.testing.assert_allclose(kf.x, x, rtol=1e-12)
    np.testing.assert_allclose(kf.P, P, rtol=1e-11)


@pytest.mark.parametrize(
    ("custom", "equal"),
    [
        ('{psi: "max(-1.345, min(1.345, e))"}', "huber"),
        ('{psi: "where(abs(e) <= k, e, k*sign(e))"}', "{influence: huber, k: 2}"),
        ('{psi: "where(abs(e) <= k, e, k*sign(e))", psi_dot: "abs(e) <= k"}', None),
        ('{psi: "where(abs(e) <= 3, e, where(abs(e) <= 6, e/3, sign(e)))"}', "chernodarov"),
        ('{psi: e*exp(1)/exp(1)}', "none"),
    ],
)
def test_formulas_of_ones_own(custom, equal):
    if equal is None:
        custom = custom.replace('"abs(e) <= k"', '"where(abs(e) <= k, 1, 0)"')
        equal = "{influence: huber, k: 2}"
    extra = "parameters: {k: 2}"
    own, known = (build(three_states(f", robust: {robust}", extra)) for robust in (custom, equal))
    for y in np.random.default_rng(5).normal(scale=5.0, size=(25, 2)):
        own.init()
        known.init()
        assert own.update("s", y) == known.update("s", y)
        np.testing.assert_allclose(own.x, known.x, rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(own.P, known.P, rtol=1e-12, atol=1e-13)


def single(options: str, r: str = "1", extra: str = "", more: str = "") -> str:
    text = one_state("  form: discrete\n  f: {x: x}", z=f"{{h: x, var: {r}}}{more}", extra=extra)
    return text.replace("{type: ekf}", f"{{type: ekf{options}}}")


def test_the_slope_is_derived_and_never_negative():
    kf = build(single(', robust: {psi: "a*e*exp(-e**2/8)"}', extra="parameters: {a: 1}"))
    prior = kf.P[0, 0]
    assert kf.update("s", [1.0 + 1.0]) == Status.GLITCH_SMALL
    psi, g = math.exp(-1 / 8), math.exp(-1 / 8) * (1 - 1 / 4)
    assert kf.x[0] == pytest.approx(1.0 + prior * psi / (1.0 + g * prior), rel=1e-14)
    assert kf.P[0, 0] == pytest.approx(prior - g * prior**2 / (1.0 + g * prior), rel=1e-14)
    kf.init()
    assert kf.update("s", [1.0 - 3.0]) == Status.GLITCH_LARGE  # past its maximum at 2
    assert kf.x[0] == pytest.approx(1.0 - 3.0 * math.exp(-9 / 8) * prior, rel=1e-14)
    assert kf.P[0, 0] == prior
    kf.init()
    kf.parameters["a"] = 2.0
    assert kf.update("s", [1.0 + 1.0]) == 0  # a weight above 1 is not doubt
    assert kf.P[0, 0] == pytest.approx(prior / (1.0 + 2.0 * g * prior), rel=1e-14)
    assert kf.update("s", [math.nan]) == Status.NOT_FINITE


def test_an_exact_measurement_is_believed():
    kf = build(single(", robust: chernodarov", r="0"))
    assert kf.update("s", [1000.0]) == 0
    assert (kf.x[0], kf.P[0, 0]) == (1000.0, 0.0)
    assert kf.update("s", [2000.0]) == 0  # known exactly now: skipped, and not doubted
    assert kf.x[0] == 1000.0
    assert kf.log_likelihood == kf.nis == 0.0


def test_nothing_is_inflated_where_nothing_is_uncertain():
    kf = build(single(", adaptive: true"))
    kf.set_covariance([[0.0]])
    assert kf.update("s", [100.0]) == 0
    assert (kf.x[0], kf.P[0, 0]) == (1.0, 0.0)
    assert kf.nis == 99.0**2
    # a direction that an exact measurement has made known, up to rounding
    two = three_states(", adaptive: true").replace("    R: [[0.5, 0.2], [0.2, 0.4]]\n", "")
    two = two.replace("{h: a + 0.5*c}", "{h: a + 0.3*c, var: 0}")
    two = two.replace("{h: 0.3*a + b}", "{h: 0.7*a + 0.21*c, var: 1}")
    kf = build(two)
    assert kf.update("s", [0.1, 50.0]) == 0
    assert np.max(kf.P) < 5.0


def test_exact_measurements_inflate_too():
    kf = build(single(", adaptive: {chi2: 4}", r="0"))
    assert kf.update("s", [1.0 + 10.0]) == Status.ANOMALY
    assert (kf.x[0], kf.P[0, 0]) == (11.0, 0.0)
    assert kf.log_likelihood == pytest.approx(-0.5 * (math.log(2 * math.pi) + 4.0 + math.log(25.0)))


@pytest.mark.parametrize("options", [", robust: chernodarov", ", adaptive: true", ", robust: huber, adaptive: true"])
def test_the_gate_comes_first(options):
    gate = "\n    gate: {probability: 0.999, reset_after: 1}"
    kf = build(single(options, more=gate))
    x, P = kf.x, kf.P
    assert kf.update("s", [50.0]) == Status.GATED
    assert kf.nis == pytest.approx(49.0**2 / 1.5)
    np.testing.assert_array_equal(kf.x, x)
    np.testing.assert_array_equal(kf.P, P)
    status = kf.update("s", [50.0])  # let in
    assert status & Status.ANOMALY
    assert bool(status & Status.GLITCH_LARGE) == ("robust" in options)
    assert not status & Status.GATED


def test_a_psi_without_a_value_leaves_all_as_it_was():
    kf = build(single(", robust: {psi: e*sqrt(4 - e)}"))
    assert kf.update("s", [3.0]) != Status.NOT_FINITE
    before = kf.x.tobytes(), kf.P.tobytes(), kf.nis, kf.log_likelihood
    assert kf.update("s", [100.0]) == Status.NOT_FINITE
    assert (kf.x.tobytes(), kf.P.tobytes(), kf.nis, kf.log_likelihood) == before
    kf = build(single(', robust: {psi: e, psi_dot: "1/(e - 2)"}'))
    kf.set_state([0.0])
    assert kf.update("s", [2.0]) == Status.NOT_FINITE


def test_a_radar_with_outliers_keeps_its_track():
    rng = np.random.default_rng(8)
    text = RADAR.replace("    gate: {probability: 0.9999}\n", "")
    filters = {o: build(text.replace("type: ekf", f"type: ekf{o}")) for o in ("", ", robust: chernodarov")}
    truth, errors = np.array([-95.0, 25.0, 0.5, -4.0]), dict.fromkeys(filters, 0.0)
    for k in range(40):
        truth[:2] += 0.5 * truth[2:]
        z = np.array([np.hypot(truth[0], truth[1]), np.arctan2(truth[1], truth[0])]) + rng.normal(size=2) * [2.0, 0.02]
        if k % 7 == 6:
            z += [60.0, 0.5]
        z[1] = (z[1] + math.pi) % (2 * math.pi) - math.pi
        for options, kf in filters.items():
            kf.predict()
            assert kf.update("radar", z) < Status.ERROR
            errors[options] += np.sum((kf.x[:2] - truth[:2]) ** 2)
    plain = errors.pop("")
    assert max(errors.values()) < 0.3 * plain
