"""The probabilities of modes: identical modes, extreme likelihoods, chains with zeros, angles that are mixed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from imm_banks import TURNING, bank, build, with_transition
from problems import IMM3, one_state

from kfgen.reference import Status, reference
from kfgen.reference.mixing import weighed
from kfgen.reference.status import StepError
from kfgen.spec import loads

SAME = [[0.8, 0.15, 0.05], [0.1, 0.8, 0.1], [0.3, 0.1, 0.6]]
FILTERS = [
    "type: ekf",
    "type: ekf, covariance: full, update: standard",
    "type: ekf, update: joseph, gain_limit: 0.5, consider: [w]",
    "type: ekf, covariance: full, adapt_R: 0.05, adapt_Q: 0.05",
    "type: ekf, robust: chernodarov",
    "type: ekf, covariance: sqrt, adaptive: {chi2: 30}",
    "type: ekf, variance_floor: 0.01, variance_ceiling: 5",
    "type: iekf, iterations: 3",
    "type: ekf2, covariance: full",
    "type: ukf, covariance: full, augment: true",
    "type: ukf, covariance: sqrt, sigma_points: {kind: julier, kappa: 1}",
    "type: ukf, adapt_R: 0.05, sigma_points: {kind: wiki}",
    "type: ukf, sequential: true, robust: {influence: huber}, sigma_points: {kind: cubature}",
]


def logs(kf, one, options: str):
    """The same log through both: predicts in a row, updates in a row, masks, outliers."""
    rng = np.random.default_rng(3)
    for k in range(36):
        if k % 7 != 5:
            u = rng.normal(size=1)
            assert kf.predict(u, 0.1) == one.predict(u, 0.1) < Status.ERROR
            yield k
        z = np.array([np.hypot(*one.x[:2]), np.arctan2(one.x[1], one.x[0])])
        z += rng.normal(size=2) * [0.5, 0.02] * (8.0 if k % 11 == 10 else 1.0)
        if k % 3:
            assert kf.update("radar", z) == one.update("radar", z) < Status.ERROR
            yield k
        if k % 2:
            mask = (0b111, 0b110, 0b001)[k // 2 % 3]
            z = one.x[:3] + rng.normal(size=3)
            assert kf.update("gnss", z, mask=mask) == one.update("gnss", z, mask=mask) < Status.ERROR
            yield k


@pytest.mark.parametrize("options", FILTERS)
def test_identical_modes_are_the_single_filter(options):
    text = f"{TURNING}filter: {{{options}}}\n"
    kf, one = build(bank(text, {"a": "{}", "b": "{}", "c": "{}"}, SAME)), reference(loads(text))
    for _ in logs(kf, one, options):
        scale = np.sqrt(one.P.diagonal())
        assert np.max(np.abs(kf.x - one.x) / np.maximum(np.abs(one.x), scale)) < 1e-12
        np.testing.assert_allclose(kf.P / np.outer(scale, scale), one.P / np.outer(scale, scale), atol=1e-12)
        assert kf.nis == pytest.approx(one.nis, rel=1e-11, abs=1e-12)
        assert kf.log_likelihood == pytest.approx(one.log_likelihood, rel=1e-11, abs=1e-12)
        for mode in kf.modes:
            assert np.max(np.abs(mode.x - one.x) / np.maximum(np.abs(one.x), scale)) < 1e-12


def test_identical_modes_with_kept_points():
    text = IMM3.split("imm:")[0]
    text += "dynamics: {f: {p: p + v*dt + a**2, v: v + a*dt}, Q: {p: 0.01, v: 0.01, a: 0.01}}\n"
    text += "filter: {type: ukf, covariance: full, sigma_points: {kind: julier, kappa: 0.5, redraw: false}}\n"
    kf, one = build(bank(text, {"a": "{}", "b": "{}", "c": "{}"}, SAME)), reference(loads(text))
    rng = np.random.default_rng(2)
    for call in "pupuuppurpruppuup" * 6:
        z = rng.normal(size=1)
        for each in (kf, one):
            status = each.update("position", z) if call == "u" else {"p": each.predict, "r": each.redraw}[call]()
            assert status == 0
        np.testing.assert_allclose(kf.x, one.x, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(kf.P, one.P, rtol=1e-12, atol=1e-12)


def test_a_process_known_exactly_stays_exact():
    """Modes that agree are mixed without a rounding, and a covariance of 0 stays 0."""
    text = one_state("  f: {x: x + 0.1}", z="{h: x, var: 0.3}").replace("var: 0.5", "std: 0")
    kf, one = build(bank(text, {"a": "{}", "b": "{}", "c": "{}"}, SAME)), reference(loads(text))
    for _ in range(50):
        assert kf.predict() == one.predict() == 0
        assert kf.update("s", [7.0]) == one.update("s", [7.0]) == 0
        assert kf.x.tobytes() == one.x.tobytes()
        assert kf.P[0, 0] == 0.0


def still(first: float, second: float, R: str, floor: str = "0", components: int = 1, transition=None) -> str:
    """Two modes that know the state exactly, as two different values; mu tells the likelihoods."""
    z = "{" + ", ".join(f"z{i}: {{h: x, var: {R}}}" for i in range(components)) + "}"
    top = f"""
kfgen: 1
name: still
scalar: double
dt: 1
states: {{x: {{init: 0, var: 0}}}}
dynamics: {{f: {{x: x}}}}
measurements: {{s: {{z: {z}}}}}
"""
    modes = {
        "a": f"states: {{x: {{init: {first!r}, var: 0}}}}",
        "b": f"states: {{x: {{init: {second!r}, var: 0}}}}",
    }
    return bank(top, modes, transition or [[1, 0], [0, 1]], mu0=[0.25, 0.75], mu_floor=floor)


def test_small_likelihoods_do_not_underflow():
    """Both modes a thousand standard deviations off: exp(-5e5) is 0 in any float."""
    kf = build(still(0.0, 1e-7, "1e-6"))
    assert kf.update("s", [1.0]) == 0
    logs = np.array([-0.5e6, -0.5e6 * (1.0 - 1e-7) ** 2])
    ratio = 0.25 * math.exp(logs[0] - logs[1]) / 0.75
    assert kf.mu[0] / kf.mu[1] == pytest.approx(ratio, rel=1e-9)
    assert kf.log_likelihood < -4e5


@pytest.mark.parametrize("R", ["1e-30", "1e-6", "1e60"])
def test_many_components(R):
    """Forty components: likelihoods up to 1e600 and down to 1e-1200."""
    sigma = math.sqrt(float(R))
    kf = build(still(0.0, 0.1 * sigma, R, components=40))
    assert kf.update("s", np.full(40, sigma)) == 0
    ratio = 0.25 / 0.75 * math.exp(-0.5 * 40 * (1.0 - 0.9**2))
    assert kf.mu[0] / kf.mu[1] == pytest.approx(ratio, rel=1e-9)
    first = -20.0 * (math.log(2 * math.pi) + math.log(float(R)) + 1.0)
    expected = first + math.log(0.25 + 0.75 * math.exp(0.5 * 40 * (1.0 - 0.9**2)))
    assert kf.log_likelihood == pytest.approx(expected, rel=1e-12)


def test_a_mode_without_probability_has_no_say():
    """A likelihood that would win by e^8000 changes nothing where the chain gives its mode no probability."""
    kf = build(still(0.0, 1.0, "1e-4", transition=[[1, 0], [1, 0]]))
    assert kf.predict() == 0
    assert list(kf.mu) == [1.0, 0.0]
    # c of the second mode is 0: it keeps its own estimate, the first has mixed
    assert [mode.x[0] for mode in kf.modes] == [0.75, 1.0]
    assert kf.update("s", [2.0]) == 0
    assert list(kf.mu) == [1.0, 0.0]
    assert kf.log_likelihood == pytest.approx(-0.5 * (math.log(2 * math.pi) + kf.x[0] * 0 + math.log(0.1876) +
                                                      1.25**2 / 0.1876))  # fmt: skip


def test_likelihoods_that_are_none():
    """A mode whose likelihood is 0 even as a logarithm has the floor left; all of them together are an error."""
    mu, total = weighed(np.array([0.4, 0.6]), np.array([-math.inf, -3.0]), 0.0)
    assert list(mu) == [0.0, 1.0]
    assert total == pytest.approx(math.log(0.6) - 3.0)
    for logs in ([-math.inf, -math.inf], [math.nan, 0.0], [math.inf, 0.0]):
        with pytest.raises(StepError):
            weighed(np.array([0.4, 0.6]), np.array(logs), 1e-9)


def test_the_floor_revives_a_mode():
    kf = build(still(0.0, 1.0, "1", floor="0.01"))
    for _ in range(3):
        assert kf.update("s", [30.0]) == 0
        assert kf.mu[0] == pytest.approx(0.01 / 1.01)
    assert kf.predict() == 0
    assert kf.mu[0] == pytest.approx(0.01 / 1.01)
    kf.update("s", [0.5])
    assert kf.mu[0] == pytest.approx(0.01 / (0.01 + 1.0 / 1.01))
    ratio = kf.mu[0] / kf.mu[1]
    kf.update("s", [-4.0])
    assert kf.mu[0] / kf.mu[1] == pytest.approx(ratio * math.exp(4.5))


def test_zero_entries_hand_estimates_on():
    """A chain that goes round: mode j starts from the estimate of the mode before it, and from no other."""
    starts = {"a": (1, 1), "b": (5, 2), "c": (9, 3)}
    modes = {name: f"states: {{x: {{init: {x}, var: {var}}}}}" for name, (x, var) in starts.items()}
    cyclic = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]
    kf = build(bank(one_state("  f: {x: x + 10}"), modes, cyclic, mu0=[0.5, 0.3, 0.2]))
    assert kf.predict() == 0
    assert list(kf.mu) == [0.2, 0.5, 0.3]
    assert [mode.x[0] for mode in kf.modes] == [19.0, 11.0, 15.0]
    assert [mode.P[0, 0] for mode in kf.modes] == [3.0, 1.0, 2.0]
    assert kf.x[0] == pytest.approx(0.2 * 19 + 0.5 * 11 + 0.3 * 15)


def test_identity_transition_finds_the_model():
    text = IMM3.replace("[[0.95, 0.05], [0.05, 0.95]]", "[[1, 0], [0, 1]]")
    # without acceleration the richer model is right, too, once it has learnt that: only its simplicity speaks for cv
    for right, a, lack in ((0, 0.0, 1e-3), (1, 0.5, 2e-9)):
        kf, rng = build(text), np.random.default_rng(7)
        kf.set_state([0.0, 1.0, a if right else 0.5])
        for k in range(600):
            t = 0.1 * (k + 1)
            assert kf.predict() == 0
            assert kf.update("position", [t + 0.5 * a * t**2 + rng.normal()]) == 0
        assert kf.mu[right] == pytest.approx(1.0, abs=lack)
        assert kf.mu[1 - right] >= 0.999e-9


def test_probabilities_stay_probabilities():
    kf, rng = build(IMM3), np.random.default_rng(6)
    for k in range(600):
        assert kf.predict() == 0
        if rng.random() < 0.7:
            assert kf.update("position", [rng.normal() * 10.0 ** rng.integers(-3, 7)]) == 0
        assert abs(np.sum(kf.mu) - 1.0) < 4e-16
        assert np.all(kf.mu >= 0.999e-9), k
    for _ in range(1500):  # 0.9**270 is 5e-13; what every step added would show
        assert kf.predict() == 0
        assert abs(np.sum(kf.mu) - 1.0) < 4e-16
    np.testing.assert_allclose(kf.mu, [0.5, 0.5], rtol=1e-12)


def test_transition_of_parameters_and_dt():
    """Evaluated at every predict; rows are normalised, what is no probability is an error."""
    text = bank("parameters: {rate: 0.5}\n" + TURNING.replace("parameters: {slip: 0.2}", "constants: {slip: 0.2}"),
                {"a": "{}", "b": "{}"}, [[1, 0], [0, 1]], mu0=[0.75, 0.25])  # fmt: skip
    kf = reference(with_transition(text, [["1 - rate*dt", "rate*dt"], ["3*rate", "1"]]))
    kf.predict([0.0], 0.2)
    np.testing.assert_allclose(kf.mu, [0.75 * 0.9 + 0.25 * 0.6, 0.75 * 0.1 + 0.25 * 0.4], rtol=1e-14)
    kf.parameters["rate"] = 0.0
    mu = kf.mu
    kf.predict([0.0], 0.2)
    np.testing.assert_allclose(kf.mu, mu, rtol=1e-14)
    for rate, status in ((1.0, 0), (-0.1, Status.NOT_POSITIVE), (math.inf, Status.NOT_FINITE)):
        kf.parameters["rate"] = rate
        before = kf.x.tobytes(), kf.mu.tobytes(), kf.t
        assert kf.predict([0.0], 0.2) == status
        assert (before == (kf.x.tobytes(), kf.mu.tobytes(), kf.t)) == (status != 0)
    empty = reference(with_transition(text, [["rate", "0"], ["0", "rate"]]))
    empty.parameters["rate"] = 0.0
    assert empty.predict([0.0], 0.2) == Status.NOT_POSITIVE


HEADING = """
kfgen: 1
name: heading
scalar: double
dt: 0.1
states:
  th: {init: 3.0, var: 0.05, KIND}
  w: {init: 0.3, var: 0.01}
dynamics: {f: {th: th + w*dt, w: w}, Q: {th: 0.002}}
measurements: {compass: {z: {z: {h: th, var: 0.04, KIND}}}}
filter: {covariance: full}
"""
TURNS = {"one": "{}", "two": "dynamics: {f: {th: th - 2*w*dt, w: w}, Q: {th: 0.02}}\nfilter: {type: ukf}"}


def test_angles_around_pi_are_those_of_a_line():
    """A heading that crosses pi several times: as a plain state on the line it has no seam to cross."""
    kinds, M = ("kind: angle", "doc: x"), [[0.9, 0.1], [0.2, 0.8]]
    angle, line = (build(bank(HEADING.replace("KIND", kind), TURNS, M)) for kind in kinds)
    rng, th, sides = np.random.default_rng(4), 3.0, set()
    for k in range(200):
        th += 0.1 * (0.3 if k // 40 % 2 == 0 else -0.6)
        z = th + 0.2 * rng.normal()
        assert angle.predict() == line.predict() == 0
        assert angle.update("compass", [math.remainder(z, 2 * math.pi)]) == line.update("compass", [z]) == 0
        difference = angle.x - line.x
        assert abs(math.remainder(difference[0], 2 * math.pi)) < 1e-10
        assert abs(difference[1]) < 1e-10
        np.testing.assert_allclose(angle.P, line.P, rtol=1e-9, atol=1e-13)
        np.testing.assert_allclose(angle.mu, line.mu, rtol=1e-9)
        sides.add(tuple(mode.x[0] > 0 for mode in angle.modes))
        assert -math.pi < angle.x[0] <= math.pi
    assert len(sides) >= 3  # both sides of the seam, and one mode on either


def test_angles_are_mixed_about_the_likeliest_mode():
    """Three headings a third of a turn apart have no mean of their own: the largest weight decides."""
    modes = {
        name: f"states: {{th: {{init: {th}, var: 0.05}}, w: {{init: 0, var: 0.01}}}}"
        for name, th in (("a", 0), ("b", 2), ("c", -2.5))
    }
    for mu0, base in (([0.4, 0.35, 0.25], 0), ([0.25, 0.4, 0.35], 2), ([0.3, 0.3, 0.4], -2.5), ([0.4, 0.4, 0.2], 0)):
        kf = build(bank(HEADING.replace("KIND", "kind: angle"), modes, np.eye(3).tolist(), mu0=mu0))
        near = [base + math.remainder(th - base, 2 * math.pi) for th in (0, 2, -2.5)]
        mean = float(np.dot(mu0, near))
        assert kf.x[0] == pytest.approx(math.remainder(mean, 2 * math.pi))
        assert kf.P[0, 0] == pytest.approx(0.05 + np.dot(mu0, (np.array(near) - mean) ** 2))


def test_angles_of_any_period():
    text = HEADING.replace("KIND", "kind: {periodic: 10}").replace("3.0", "4.9")
    modes = {"a": "{}", "b": "states: {th: {init: -4.9, var: 0.05}, w: {init: 0.3, var: 0.01}}"}
    kf = build(bank(text, modes, [[0.5, 0.5], [0.5, 0.5]], mu0=[0.25, 0.75]))
    assert kf.x[0] == pytest.approx(-4.95)
    assert kf.P[0, 0] == pytest.approx(0.05 + 0.25 * 0.75 * 0.2**2)
    assert kf.predict() == 0
    assert [mode.x[0] for mode in kf.modes] == pytest.approx([-4.95 + 0.03] * 2)
