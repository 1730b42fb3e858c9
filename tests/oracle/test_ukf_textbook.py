"""Sigma-point filters against a few lines of textbook, on models with everything in them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import chi2

from kfgen.reference import Status, reference
from kfgen.spec import loads

# a pendulum in continuous form whose damping is uncertain, seen by its horizontal and vertical position
PENDULUM = """
kfgen: 1
name: pendulum
scalar: double
dt: 0.05
states:
  th: {init: 1.2, std: 0.3, unit: rad}
  om: {init: 0.5, std: 0.4, unit: rad/s}
inputs: {torque: {}}
noise:
  wd: {std: 0.05}
dynamics:
  form: continuous
  f: {th: om, om: "-9.81*sin(th) - (0.2 + wd)*om + torque"}
  integrator: rk4
  substeps: 2
  Q: {th: 1e-6, om: 1e-4*(1 + om**2)}
measurements:
  camera:
    z:
      x: {h: sin(th)*(1 + e1)}
      y: {h: -cos(th)}
    R: [[0.02, 0.005], [0.005, 0.01 + 0.001*om**2]]
    noise: {e1: {std: 0.1}}
    partial: true
filter: {type: ukf}
"""


def rate(x, w, u):
    return np.array([x[1], -9.81 * np.sin(x[0]) - (0.2 + w[0]) * x[1] + u])


def step(x, w, u, substeps=2, h=0.025):
    for _ in range(substeps):
        k1 = rate(x, w, u)
        k2 = rate(x + h / 2 * k1, w, u)
        k3 = rate(x + h / 2 * k2, w, u)
        k4 = rate(x + h * k3, w, u)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


def seen(x, e):
    return np.array([np.sin(x[0]) * (1 + np.sum(e)), -np.cos(x[0])])


def lower(P):
    return np.linalg.cholesky(P)


def upper(P):
    return np.linalg.cholesky(P[::-1, ::-1])[::-1, ::-1]


def merwe(L, alpha=0.5, beta=2.0, kappa=1.0):
    gamma = alpha**2 * (L + kappa)
    wm = np.r_[1 - L / gamma, np.full(2 * L, 0.5 / gamma)]
    wc = wm.copy()
    wc[0] += 1 - alpha**2 + beta
    return np.sqrt(gamma) * np.vstack([np.zeros(L), np.eye(L), -np.eye(L)]), wm, wc


def cubature(L):
    return np.sqrt(L) * np.vstack([np.eye(L), -np.eye(L)]), np.full(2 * L, 0.5 / L), np.full(2 * L, 0.5 / L)


def trivial(L):
    wm, wc = np.full(2 * L + 1, 1 / (2 * L + 1)), np.full(2 * L + 1, 0.5 / L)
    return np.sqrt(L) * np.vstack([np.zeros(L), np.eye(L), -np.eye(L)]), wm, wc


class Textbook:
    """van der Merwe 2004, with noises as further dimensions; adaptive and adapt_R as the spec language has them."""

    def __init__(self, root, points, redraw=True, probability=None, a=0.0, e=0.0):
        self.x, self.P = np.array([1.2, 0.5]), np.diag([0.09, 0.16])
        self.root, self.points, self.redraw, self.a = root, points, redraw, a
        self.probability, self.e, self.kept, self.R = probability, np.zeros(2), None, None
        self.anomalies = 0
        self.Re = np.array([[e]]) if e else np.zeros((0, 0))

    def draw(self, C):
        offsets, wm, wc = self.points(2 + len(C))
        joint = offsets @ block_diag(self.root(self.P), self.root(C)).T
        return self.x + joint[:, :2], joint[:, 2:], wm, wc

    def predict(self, u):
        X, W, wm, wc = self.draw(np.array([[0.05**2]]))
        Q = np.diag([1e-6, 1e-4 * (1 + self.x[1] ** 2)])
        Y = np.array([step(x, w, u) for x, w in zip(X, W, strict=True)])
        self.x = wm @ Y
        self.P = (wc[:, None] * (Y - self.x)).T @ (Y - self.x) + Q
        self.kept = None if self.redraw else (Y, wm, wc)

    def transform(self, used, fresh=False):
        if self.kept is None or fresh:
            X, E, wm, wc = self.draw(self.Re)
        else:
            X, wm, wc = self.kept
            E = np.zeros((len(X), 0))
        Z = np.array([seen(x, e) for x, e in zip(X, E, strict=True)])[:, used]
        z = wm @ Z
        return z, (wc[:, None] * (Z - z)).T @ (Z - z), (wc[:, None] * (X - self.x)).T @ (Z - z)

    def update(self, measured, used=(0, 1)):
        used = list(used)
        R = np.array([[0.02, 0.005], [0.005, 0.01 + 0.001 * self.x[1] ** 2]]) if self.R is None else self.R.copy()
        z, Pzz, Pxz = self.transform(used)
        e = self.e[used]
        if self.a:
            R[np.ix_(used, used)] *= 1 - self.a
            R[np.ix_(used, used)] += self.a * (Pzz + np.outer(e, e))
            self.R = R
        R = R[np.ix_(used, used)]
        S, y = Pzz + R, measured[used] - z
        self.nis = float(y @ np.linalg.solve(S, y))
        limit = None if self.probability is None else chi2.ppf(self.probability, len(used))
        if limit is not None and self.nis > limit:
            a = float(y @ np.linalg.solve(Pzz, y)) * (1 / limit - 1 / self.nis)
            self.P = (1 + a) * self.P
            z, Pzz, Pxz = self.transform(used, fresh=True)
            S, y = Pzz + R, measured[used] - z
            self.anomalies += 1
        K = Pxz @ np.linalg.inv(S)
        self.x, self.P = self.x + K @ y, self.P - K @ S @ K.T
        self.log_likelihood = -0.5 * (
            len(used) * math.log(2 * math.pi) + y @ np.linalg.solve(S, y) + np.linalg.slogdet(S)[1]
        )
        self.kept = None
        if self.a:
            self.e[used] = measured[used] - self.transform(used)[0]


def run(text, book, steps=60, jump=False):
    kf, rng = reference(loads(text)), np.random.default_rng(6)
    truth, flags = np.array([1.0, 0.0]), []
    for k in range(steps):
        u = float(np.sin(0.1 * k))
        truth = step(truth, [0.05 * rng.normal()], u)
        z = seen(truth, [0.1 * rng.normal()]) + 0.1 * rng.normal(size=2)
        if jump and k % 10 == 5:
            z += 1.0
        assert kf.predict([u]) == 0
        book.predict(u)
        np.testing.assert_allclose(kf.x, book.x, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(kf.P, book.P, rtol=1e-9, atol=1e-10)
        used = [(0, 1), (0,), (1,)][k % 3 if "partial: true" in text else 0]
        mask = sum(1 << i for i in used)
        flags.append(kf.update("camera", z, [u], **({"mask": mask} if "partial: true" in text else {})))
        book.update(z, used)
        np.testing.assert_allclose(kf.x, book.x, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(kf.P, book.P, rtol=1e-9, atol=1e-10)
        assert kf.nis == pytest.approx(book.nis, rel=1e-8)
        assert kf.log_likelihood == pytest.approx(book.log_likelihood, rel=1e-8, abs=1e-8)
        book.x, book.P = kf.x, kf.P  # large corrections make differences grow from step to step
    return kf, flags


RULES = {
    "{kind: merwe, alpha: 0.5, beta: 2, kappa: 1}": merwe,
    "{kind: cubature}": cubature,
    "{kind: trivial}": trivial,
    "{kind: wiki, alpha: 0.9}": lambda L: merwe(L, 0.9, 2.0, 0.0),
    "{kind: julier, kappa: 0.4}": lambda L: merwe(L, 1.0, 0.0, 0.4),
}
ROOTS = {"full": lower, "sqrt": lower, "ud": upper}


# every rule once, every root once: a rule does not know which root it is given
@pytest.mark.parametrize(
    ("form", "kind"), [*(("full", kind) for kind in RULES), *((form, next(iter(RULES))) for form in ("sqrt", "ud"))]
)
def test_augmented_pendulum(form, kind):
    """wd multiplies om, e multiplies sin(th): both are carried. R depends on the state, masks pick from it."""
    text = PENDULUM.replace("type: ukf", f"type: ukf, covariance: {form}, sigma_points: {kind}")
    _, flags = run(text, Textbook(ROOTS[form], RULES[kind], e=0.01))
    assert not any(flags)


ADDITIVE = PENDULUM.replace("*(1 + e1)", "").replace("    noise: {e1: {std: 0.1}}\n", "")


@pytest.mark.parametrize("form", ROOTS)
def test_kept_points(form):
    """redraw: false uses the points of the augmented predict, with their weights, once."""
    points = "{kind: merwe, alpha: 0.5, kappa: 1, redraw: false}"
    text = ADDITIVE.replace("type: ukf", f"type: ukf, covariance: {form}, sigma_points: {points}")
    book = Textbook(ROOTS[form], merwe, redraw=False)
    kf, _ = run(text, book)

    def redrawn():
        other = reference(loads(text.replace(", redraw: false", "")))
        other.set_state(kf.x)
        other.set_covariance(kf.P)
        return other

    def agree(one, other):
        np.testing.assert_allclose(one.x, other.x, rtol=1e-12)
        np.testing.assert_allclose(one.P, other.P, rtol=1e-10)

    z, still = [0.1, -0.9], [0.0]
    for spoil in (
        lambda: kf.update("camera", z, still),
        lambda: kf.set_state(kf.x),
        lambda: kf.set_covariance(kf.P),
        kf.redraw,
    ):
        assert kf.predict(still) == 0
        assert spoil() == 0
        drawn = redrawn()
        assert kf.update("camera", z, still) == drawn.update("camera", z, still) == 0
        agree(kf, drawn)
    # neither an error nor an empty mask spoils them
    assert kf.predict(still) == 0
    drawn = redrawn()
    assert kf.update("camera", [math.nan, 0.0], still) == Status.NOT_FINITE
    assert kf.update("camera", z, still, mask=0) == 0
    book.x, book.P = kf.x, kf.P
    kept = kf._estimate.memory
    assert kept is not None
    book.kept = (kept.points, kept.weights.wm, kept.weights.wc)
    assert kf.update("camera", z, still) == 0
    assert drawn.update("camera", z, still) == 0
    book.update(np.array(z))
    agree(kf, book)
    assert np.max(np.abs(kf.x - drawn.x)) > 1e-6
    with pytest.raises(AttributeError, match="redraw: false"):
        drawn.redraw()


@pytest.mark.parametrize("form", ROOTS)
@pytest.mark.parametrize("redraw", [True, False])
def test_adaptive(form, redraw):
    points = f"{{kind: merwe, alpha: 0.5, kappa: 1, redraw: {str(redraw).lower()}}}"
    options = f"covariance: {form}, adaptive: {{probability: 0.99}}, sigma_points: {points}"
    book = Textbook(ROOTS[form], merwe, redraw, probability=0.99)
    _, flags = run(ADDITIVE.replace("type: ukf", f"type: ukf, {options}"), book, jump=True)
    assert book.anomalies > 5
    assert flags.count(Status.ANOMALY) == book.anomalies


@pytest.mark.parametrize("form", ROOTS)
def test_adapt_R(form):
    text = ADDITIVE.replace(" + 0.001*om**2", "").replace("    partial: true\n", "")
    book = Textbook(ROOTS[form], merwe, a=0.05)
    book.R = np.array([[0.02, 0.005], [0.005, 0.01]])
    options = f"covariance: {form}, adapt_R: 0.05, sigma_points: {{alpha: 0.5, kappa: 1}}"
    kf, _ = run(text.replace("type: ukf", f"type: ukf, {options}"), book, jump=True)
    np.testing.assert_allclose(kf.R["camera"], book.R, rtol=1e-9)
