"""What a sigma-point filter does beside the algebra: angles, bounds, rejection, gates, limits, errors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import CV4, RADAR, one_state
from scipy.stats import chi2

from kfgen.reference import Status, reference
from kfgen.reference.pivots import bounded, downdated, judge
from kfgen.reference.status import StepError
from kfgen.spec import loads

FORMS = ("full", "ud", "sqrt", "ud, sequential: true")
KINDS = ("{kind: merwe, alpha: 0.5}", "{kind: julier, kappa: 1}", "{kind: cubature}", "{kind: trivial}")


def build(text: str, options: str = ""):
    return reference(loads(text.replace("type: ekf", f"type: ukf{options}")))


# --- angles


HEADING = """
kfgen: 1
name: heading
scalar: double
dt: 0.1
states:
  th: {init: 3.1, std: 0.2, unit: rad, kind: angle}
  om: {init: 0.5, std: 0.3, unit: rad/s}
  d: {init: 179, std: 5, kind: {periodic: 360}}
dynamics:
  form: discrete
  f: {th: "atan2(sin(th + dt*om), cos(th + dt*om))", d: d + 3*om}
  Q: {th: 1e-4, om: 1e-4, d: 0.1}
measurements:
  compass:
    z:
      a: {h: th, std: 0.1, unit: rad, kind: angle}
      b: {h: "atan2(sin(th), cos(th))", std: 0.1, unit: rad, kind: angle}
      c: {h: d + 360*floor(th), std: 1, kind: {periodic: 360}}
filter: {type: ekf}
"""


@pytest.mark.parametrize("points", KINDS)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("redraw", ["true", "false"])
def test_circular_means(form, points, redraw):
    """Angles that cross pi between the points give what the same angles far from it do."""
    points = points.replace("}", f", redraw: {redraw}}}")
    options = f", covariance: {form}, sigma_points: {points}"
    here = build(HEADING, options)
    turned = build(HEADING.replace("init: 3.1", "init: 0.1").replace("init: 179", "init: -1"), options)
    rng = np.random.default_rng(3)
    for _ in range(20):
        assert here.predict() == turned.predict() == 0
        z = turned.x[[0, 0, 2]] + rng.normal(size=3) * [0.1, 0.1, 1.0]
        turn = np.array([3.0, 3.0 - 2 * math.pi, 180.0])
        assert here.update("compass", z + turn) == turned.update("compass", z) == 0
        difference = here.x - turned.x
        assert math.remainder(difference[0] - 3.0, 2 * math.pi) == pytest.approx(0.0, abs=1e-10)
        assert difference[1] == pytest.approx(0.0, abs=1e-10)
        assert math.remainder(difference[2] - 180.0, 360.0) == pytest.approx(0.0, abs=1e-8)
        np.testing.assert_allclose(here.P, turned.P, rtol=1e-8, atol=1e-11)
        assert here.nis == pytest.approx(turned.nis, rel=1e-7)
        assert abs(here.x[0]) <= math.pi
        assert abs(here.x[2]) <= 180.0


def test_own_residual_is_the_difference_everywhere():
    """A residual that wraps does what `periodic` does, in the mean and in the spread, too."""
    kind = HEADING.replace(", unit: rad, kind: angle}", "}").replace("      a: {h: th, std: 0.1}\n", "")
    own = kind.replace("h: \"atan2(sin(th), cos(th))\", std: 0.1", "h: \"atan2(sin(th), cos(th))\", std: 0.1, "
                       "residual: \"atan2(sin(z - h), cos(z - h))\"")  # fmt: skip
    angle = kind.replace('cos(th))", std: 0.1', 'cos(th))", std: 0.1, kind: angle')
    for points in KINDS:
        one, other = (build(text, f", sigma_points: {points}") for text in (own, angle))
        for _ in range(20):
            assert one.predict() == other.predict() == 0
            z = [one.x[0] + 0.1, one.x[2]]
            assert one.update("compass", z) == other.update("compass", z) == 0
            np.testing.assert_allclose(one.x, other.x, rtol=1e-11)
            np.testing.assert_allclose(one.P, other.P, rtol=1e-10, atol=1e-14)


def test_cubature_needs_the_image_of_the_mean_only_for_angles():
    """h of the mean, where it is not finite, does no harm to a plain component."""
    dynamics = "  form: discrete\n  f: {x: x}"
    plain = build(one_state(dynamics, z='{h: "(x - 1)**2/abs(x - 1)", var: 1}'), ", sigma_points: {kind: cubature}")
    assert plain.predict() == 0
    assert plain.update("s", [0.5]) == 0
    angle = one_state(dynamics, z='{h: "(x - 1)**2/abs(x - 1)", var: 1, kind: {periodic: 100}}')
    assert build(angle, ", sigma_points: {kind: cubature}").update("s", [0.5]) == Status.NOT_FINITE


# --- bounds, rejection, what is not finite

TANK = one_state(
    "  form: discrete\n  f: {x: x - 0.1*sqrt(x), y: y + 0.1*sqrt(x)}",
    z="{h: sqrt(x) + y, var: 0.01}",
    states="  y: {init: 0, var: 0.2}",
).replace("x: {init: 1, var: 0.5}", "x: {init: 0.2, var: 0.5, bounds: [0, 5]}")


@pytest.mark.parametrize("points", KINDS)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("redraw", ["true", "false"])
def test_bounds(form, points, redraw):
    """Points below 0 are moved to it before sqrt sees them; the covariance stays one."""
    kf = build(TANK, f", covariance: {form}, sigma_points: {points.replace('}', f', redraw: {redraw}}}')}")
    rng = np.random.default_rng(2)
    for _ in range(25):
        assert kf.predict() & ~Status.REGULARIZED == 0
        assert kf.update("s", [0.3 + 0.1 * rng.normal()]) & ~Status.REGULARIZED == 0
        assert 0.0 <= kf.x[0] <= 5.0
        assert np.min(np.linalg.eigvalsh(kf.P)) >= -1e-12


def test_bounds_by_hand():
    """One state, kappa 2: points at x and x +- sqrt(3 P), of which the lower one is moved to the bound."""
    text = one_state("  form: discrete\n  f: {x: 2*x}", z="{h: x**2, var: 1}").replace("0.5}", "0.5, bounds: [0, 4]}")
    kf = build(text, ", sigma_points: {kind: julier, kappa: 2}")
    up, low = 1.0 + math.sqrt(1.5), 0.0
    z = np.array([1.0, up**2, low])
    wm = np.array([2, 0.5, 0.5]) / 3.0
    zp = wm @ z
    # the gain knows the points as they were drawn
    Pxz, S = wm @ (np.array([0.0, 1.0, -1.0]) * math.sqrt(1.5) * (z - zp)), wm @ (z - zp) ** 2 + 1.0
    assert kf.update("s", [zp + 0.1]) == 0
    assert kf.x[0] == pytest.approx(1.0 + 0.1 * Pxz / S, rel=1e-13)
    assert kf.P[0, 0] == pytest.approx(0.5 - Pxz**2 / S, rel=1e-13)
    kf.init()
    images = np.array([2.0, 4.0, 0.0])  # 2 up = 4.45 is beyond the bound, too
    assert kf.predict() == 0
    assert kf.x[0] == pytest.approx(wm @ images, rel=1e-13)
    assert kf.P[0, 0] == pytest.approx(wm @ (images - wm @ images) ** 2, rel=1e-13)


@pytest.mark.parametrize("form", FORMS)
def test_reject(form):
    """A point that the spec rejects counts as the centre's image; so does one that is not finite."""
    text = one_state("  form: discrete\n  f: {x: x/(x - p)}", extra="parameters: {p: 9, limit: 3}")
    points = ", sigma_points: {kind: julier, kappa: 2}"
    off = math.sqrt(1.5)

    def f(x, p):
        return x / (x - p)

    def expected(images):
        mean = images @ [2 / 3, 1 / 6, 1 / 6]
        return mean, (images - mean) ** 2 @ [2 / 3, 1 / 6, 1 / 6]

    plain = build(text, f", covariance: {form}{points}")
    safe = build(text, f", covariance: {form}, reject: non_finite{points}")
    both = build(text, f", covariance: {form}, reject: 'abs(x) > limit'{points}")
    for kf in (plain, safe, both):
        kf.parameters["p"] = 1.0 + off  # the upper point is a pole
    assert plain.predict() == Status.NOT_FINITE
    middle, low = f(1.0, 1.0 + off), f(1.0 - off, 1.0 + off)
    for kf in (safe, both):
        assert kf.predict() == Status.POINT_REJECTED
        mean, variance = expected(np.array([middle, middle, low]))
        assert kf.x[0] == pytest.approx(mean, rel=1e-12)
        assert kf.P[0, 0] == pytest.approx(variance, rel=1e-12)
        kf.init()
        kf.parameters["p"] = 1.0 + 1.1 * off
    middle, up, low = (f(1.0 + k * off, 1.0 + 1.1 * off) for k in (0, 1, -1))
    assert abs(up) > 3.0
    assert safe.predict() == 0
    assert safe.x[0] == pytest.approx(expected(np.array([middle, up, low]))[0], rel=1e-12)
    assert both.predict() == Status.POINT_REJECTED
    assert both.x[0] == pytest.approx(expected(np.array([middle, middle, low]))[0], rel=1e-12)
    for kf in (safe, both):  # the centre is never rejected
        kf.init()
        kf.parameters["p"], kf.parameters["limit"] = 1.0, 1e-9
        assert kf.predict() == Status.NOT_FINITE
    both.parameters["p"] = 9.0
    assert both.predict() == Status.POINT_REJECTED
    assert both.P[0, 0] == 0.0


def test_measurement_points_are_never_replaced():
    text = one_state("  form: discrete\n  f: {x: x}", z="{h: log(x), var: 1}")
    kf = build(text, ", reject: non_finite, sigma_points: {kind: julier, kappa: 2}")
    before = kf.x, kf.P
    assert kf.update("s", [0.0]) == Status.NOT_FINITE  # x - sqrt(3 P) < 0
    np.testing.assert_array_equal((kf.x, kf.P[0]), (before[0], before[1][0]))


@pytest.mark.parametrize("points", KINDS)
def test_a_pole_at_the_mean_is_no_rounding(points):
    """Where h has no slope, or an endless one, at the mean, the points see a finite one."""
    dynamics = "  form: discrete\n  f: {x: x + abs(x)**0.3 - abs(x)**0.3}"
    text = one_state(dynamics, z="{h: sign(x)*abs(x)**0.2, var: 0.01}")
    for start in ("0", "1e-200", "1e-30"):
        kf = build(text.replace("init: 1", f"init: {start}"), f", sigma_points: {points}")
        assert kf.predict() == 0
        assert kf.P[0, 0] == pytest.approx(0.5, rel=1e-6)
        assert kf.update("s", [1.0]) == 0
        assert 0.2 < kf.x[0] < 2.0


# --- gates, limits, masks


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("redraw", ["true", "false"])
def test_gate(form, redraw):
    """A gated update changes nothing, kept points included."""
    kf = build(RADAR, f", covariance: {form}, sigma_points: {{kind: julier, redraw: {redraw}}}")
    twin = build(RADAR, f", covariance: {form}, sigma_points: {{kind: julier, redraw: {redraw}}}")
    assert kf.predict() == twin.predict() == 0
    x, P = kf.x, kf.P
    assert kf.update("radar", [500.0, 3.0]) == Status.GATED
    assert kf.nis > chi2.ppf(0.9999, 2)
    np.testing.assert_array_equal(kf.x, x)
    np.testing.assert_array_equal(kf.P, P)
    z = [float(np.hypot(*x[:2])), float(np.arctan2(x[1], x[0]))]
    assert kf.update("radar", z) == twin.update("radar", z) == 0
    np.testing.assert_array_equal(kf.x, twin.x)
    np.testing.assert_array_equal(kf.P, twin.P)


@pytest.mark.parametrize("redraw", ["true", "false"])
def test_the_second_update_draws_its_points(redraw):
    kf = build(RADAR, f", sigma_points: {{kind: julier, redraw: {redraw}}}")
    drawn = build(RADAR, ", sigma_points: {kind: julier}")
    assert kf.predict() == 0
    z = [float(np.hypot(*kf.x[:2])), float(np.arctan2(kf.x[1], kf.x[0]))]
    assert kf.update("radar", z) == 0
    drawn.set_state(kf.x)
    drawn.set_covariance(kf.P)
    assert kf.update("radar", z) == drawn.update("radar", z) == 0
    np.testing.assert_allclose(kf.x, drawn.x, rtol=1e-12)


@pytest.mark.parametrize("form", FORMS)
def test_kept_points_lack_what_was_added(form):
    """By hand: P = 0.5 + 0.3, of which the kept points know 0.5."""
    text = one_state("  form: discrete\n  f: {x: x}\n  Q: {x: 0.3}")
    kf = build(text, f", covariance: {form}, sigma_points: {{redraw: false}}")
    assert kf.predict() == 0
    assert kf.update("s", [2.0]) == 0
    # one by one, H = 0.5 / 0.8
    S = 0.5**2 / 0.8 + 1.0 if "sequential" in form else 0.5 + 1.0
    assert kf.x[0] == pytest.approx(1.0 + 0.5 / S, rel=1e-13)
    assert kf.P[0, 0] == pytest.approx(0.8 - 0.5**2 / S, rel=1e-13)
    assert kf.nis == pytest.approx(1.0 / S, rel=1e-13)


@pytest.mark.parametrize("form", FORMS)
def test_innovation_floor(form):
    """The noise of a component is raised until its innovation variance is the floor's."""
    text = CV4.replace("var: 400", "var: 0.01")
    kf = build(text, f", covariance: {form}, innovation_floor: 0.5")
    raised = build(text.replace("var: 0.01", "var: 0.4"), f", covariance: {form}")
    for f in (kf, raised):
        f.set_covariance(0.1 * np.eye(4))
    assert kf.update("gnss", [51.0, -1.0]) == Status.REGULARIZED
    assert raised.update("gnss", [51.0, -1.0]) == 0
    np.testing.assert_allclose(kf.x, raised.x, rtol=1e-12)
    np.testing.assert_allclose(kf.P, raised.P, rtol=1e-12)
    assert kf.nis == pytest.approx(raised.nis)
    assert kf.log_likelihood == pytest.approx(raised.log_likelihood)


@pytest.mark.parametrize("form", FORMS)
def test_floor_and_ceiling(form):
    """As in every filter, and in the coordinates of its form: where P is diagonal they are the same."""
    kf = build(CV4, f", covariance: {form}, variance_floor: {{vx: 1}}, variance_ceiling: {{vy: 0.05}}")
    assert kf.predict() == Status.REGULARIZED
    plain = build(CV4, f", covariance: {form}")
    assert plain.predict() == 0
    assert kf.P[2, 2] > 0.99
    assert kf.P[3, 3] < 0.051
    assert np.min(np.linalg.eigvalsh(kf.P)) > 0.0


@pytest.mark.parametrize("form", FORMS)
def test_points_are_not_kept_against_a_ceiling(form):
    """P cut down after predict, the points are drawn from it: their own spread would leave it indefinite."""
    text, limit = one_state("  form: discrete\n  f: {x: 10*x}"), "variance_ceiling: 3, sigma_points: {redraw: "
    kf, drawn = (build(text, f", covariance: {form}, {limit}{redraw}}}") for redraw in ("false", "true"))
    assert kf.predict() == drawn.predict() == Status.REGULARIZED
    assert kf.update("s", [9.0]) == drawn.update("s", [9.0]) == 0
    np.testing.assert_allclose(kf.x, drawn.x, rtol=1e-13)
    np.testing.assert_allclose(kf.P, [[0.75]], rtol=1e-13)


def test_chi2_replaces_the_quantile():
    text = CV4.replace("var: 400", "var: 0.1")
    one = build(text, f", adaptive: {{chi2: {float(chi2.ppf(0.95, 2))!r}}}")
    other = build(text, ", adaptive: {probability: 0.95}")
    for kf in (one, other):
        assert kf.update("gnss", [53.0, -1.0]) == Status.ANOMALY
        # the inflated filter is as surprised as it may be, and nis is that of the plain one
        assert kf.nis == pytest.approx(10.0 / 0.2)
    np.testing.assert_allclose(one.P, other.P, rtol=1e-12)
    default = build(text, ", adaptive: true")
    assert default.update("gnss", [50.0 + math.sqrt(0.2 * chi2.ppf(0.999, 2) * 0.999), 0.0]) == 0
    default.init()
    assert default.update("gnss", [50.0 + math.sqrt(0.2 * chi2.ppf(0.999, 2) * 1.001), 0.0]) == Status.ANOMALY


def test_inflation_meets_the_threshold():
    """Where S is a multiple of Pzz, the innovation's new chi-square is the threshold itself."""
    kf = build(CV4.replace("var: 400", "var: 0.3"), ", adaptive: {chi2: 4}")
    assert kf.update("gnss", [52.0, -1.0]) == Status.ANOMALY
    a = 5.0 / 0.1 * (1.0 / 4.0 - 1.0 / (5.0 / 0.4))
    P = 0.1 * (1.0 + a)
    assert abs(P + 0.3 - 5.0 / 4.0) < 1e-14
    assert kf.P[0, 0] == pytest.approx(P * 0.3 / (P + 0.3), rel=1e-12)
    assert kf.x[0] == pytest.approx(50.0 + 2.0 * P / (P + 0.3), rel=1e-12)


def test_nothing_to_inflate():
    """What is known exactly is not doubted: no flag."""
    kf = build(CV4.replace("var: 0.1", "var: 0").replace("var: 400", "var: 1"), ", adaptive: {chi2: 4}")
    assert kf.update("gnss", [90.0, 0.0]) == 0
    assert kf.x[0] == 50.0


@pytest.mark.parametrize("robust", ["chernodarov", "huber", "{psi: tanh(e)}"])
@pytest.mark.parametrize("also", ["", ", adaptive: true", ", adapt_R: 0.01", ", innovation_floor: 900"])
def test_sequential_is_an_ekf_on_a_linear_model(robust, also):
    kf = build(CV4, f", sequential: true, robust: {robust}{also}")
    ekf = reference(loads(CV4.replace("type: ekf", f"type: ekf, robust: {robust}{also}")))
    rng, seen = np.random.default_rng(1), 0
    for k in range(32):
        z = [50.0 + k + 20.0 * rng.normal() + (300.0 if k % 9 == 4 else 0.0), 20.0 * rng.standard_t(2)]
        assert kf.predict() == ekf.predict() == 0
        flags = kf.update("gnss", z)
        assert flags == ekf.update("gnss", z)
        seen |= flags
        np.testing.assert_allclose(kf.x, ekf.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(kf.P, ekf.P, rtol=1e-9, atol=1e-11)
        assert kf.nis == pytest.approx(ekf.nis, rel=1e-8)
        assert kf.log_likelihood == pytest.approx(ekf.log_likelihood, rel=1e-8)
    assert seen


# --- errors


def test_errors_leave_the_filter_as_it_was():
    dynamics = "  form: discrete\n  f: {x: x/a}\n  Q: {x: q}"
    text = one_state(dynamics, "parameters: {a: 1, q: 0, r: 1}", "{h: log(x), var: r}")
    text = text.replace("var: 0.5}", "var: 0.01}")
    for form in FORMS:
        kf = build(text, f", covariance: {form}, sigma_points: {{redraw: false}}")
        assert kf.predict() == 0
        before = kf.x.tobytes(), kf.P.tobytes(), kf.t, kf.nis
        kept = kf._estimate.memory
        kf.parameters["a"] = 0.0
        assert kf.predict() == Status.NOT_FINITE
        kf.parameters["a"], kf.parameters["q"] = 1.0, -1.0
        assert kf.predict() == Status.NOT_POSITIVE
        kf.parameters["a"] = 0.0
        assert kf.predict() == Status.NOT_FINITE
        kf.parameters["r"] = -0.1
        assert kf.update("s", [0.0]) == Status.NOT_POSITIVE
        kf.parameters["r"] = math.nan
        assert kf.update("s", [0.0]) == Status.NOT_FINITE
        assert kf.update("s", [math.inf]) == Status.NOT_FINITE
        assert before == (kf.x.tobytes(), kf.P.tobytes(), kf.t, kf.nis)
        assert kf._estimate.memory is kept
        kf.set_state([-1.0])
        kf.parameters["r"] = -1.0
        assert kf.update("s", [0.0]) == Status.NOT_FINITE


@pytest.mark.parametrize("form", ["full", "ud", "sqrt"])
def test_indefinite_predictions(form):
    """A negative centre weight can make P, or S, indefinite: the step is refused."""
    text = one_state("  form: discrete\n  f: {x: x**2, y: y}", z="{h: x**2, var: 0}", states="  y: {init: 0, var: 1}")
    text = text.replace("init: 1", "init: 0")
    options = f", covariance: {form}, sigma_points: {{kind: julier, kappa: -1.9}}"
    kf = build(text, options)
    # gamma = 0.1, w0 = -19, others 5: x^2 has mean P, variance P^2 (gamma - 1) < 0
    assert kf.predict() == Status.NOT_POSITIVE
    assert kf.update("s", [0.0]) == Status.NOT_POSITIVE
    np.testing.assert_array_equal(kf.P, np.diag([0.5, 1.0]))
    # noise makes up for it
    kf = build(text.replace("y: y}", "y: y}\n  Q: {x: 1}").replace("var: 0}", "var: 9}"), options)
    assert kf.predict() == 0
    assert kf.P[0, 0] == pytest.approx(1.0 - 0.9 * 0.25)


# --- parts


def test_downdate():
    """The known case whose result a published library has wrong: 2.440, not 2.557."""
    S, gone = downdated(np.array([[3.0, 0.0], [1.0, 2.5]]), np.array([1.0, 0.8]), np.zeros(2))
    np.testing.assert_allclose(S @ S.T, [[8.0, 2.2], [2.2, 6.61]], rtol=1e-14)
    assert not gone
    S, gone = downdated(np.array([[2.0, 0.0], [1.0, 1.0]]), np.array([2.0, 1.0]), np.zeros(2))
    np.testing.assert_array_equal(S, [[0.0, 0.0], [0.0, 1.0]])
    assert gone
    with pytest.raises(StepError):
        downdated(np.array([[2.0, 0.0], [1.0, 1.0]]), np.array([2.1, 1.0]), np.zeros(2))
    S, gone = downdated(np.array([[0.0, 0.0], [0.0, 2.0]]), np.array([0.0, 1.0]), np.zeros(2))
    np.testing.assert_allclose(S, [[0.0, 0.0], [0.0, math.sqrt(3.0)]], rtol=1e-15)
    assert not gone


def test_rounding_is_told_from_what_is_indefinite():
    P = np.array([[1.0, 1.0], [1.0, 1.0 - 1e-9]])
    with pytest.raises(StepError):
        judge(P, np.ones(2))
    judge(P, np.array([1.0, 1e6]))
    judge(np.diag([1.0, 0.0]), np.array([1.0, 0.0]))


def test_variances_are_none_up_to_their_rounding():
    P = np.array([[4.0, 1.0, 1.0], [1.0, 1e-15, 1.0], [1.0, 1.0, -1e-15]])
    np.testing.assert_array_equal(bounded(P, np.zeros(3))[:2, :2], P[:2, :2])
    np.testing.assert_array_equal(bounded(P, np.zeros(3))[2], np.zeros(3))
    np.testing.assert_array_equal(bounded(P, np.full(3, 1e-14)), np.diag([4.0, 0.0, 0.0]))
