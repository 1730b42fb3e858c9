"""Sigma points, how covariances are gathered from them, and the roots and downdates that this takes, on numbers."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from kfgen.filters.algebra.factors import cholesky, columns_of, root_of_factors
from kfgen.filters.algebra.measurement import downdate
from kfgen.filters.covariance.parts import Removal
from kfgen.filters.covariance.sqrt.straight import StraightSqrt
from kfgen.filters.sigma.points import PointSet, point_set
from kfgen.ir.interpret import Memory, run
from kfgen.ir.program import Function
from kfgen.ir.schedule import schedule
from kfgen.ir.trace import Trace
from kfgen.model.options import Points
from kfgen.scalars import SCALARS


def points(kind: str, kappa: str | None = None, alpha: str = "1", beta: str = "2") -> Points:
    return Points(kind, True, Fraction(alpha), Fraction(beta), None if kappa is None else Fraction(kappa))


def weights(gamma: Fraction, L: int, beta: Fraction, alpha: Fraction = Fraction(1)) -> tuple[Fraction, Fraction]:
    """Of the centre, in means and in covariances."""
    mean = 1 - L / gamma
    return mean, mean + 1 - alpha**2 + beta


HALF, TENTH = Fraction(1, 2), Fraction(1, 10)
# options; of the dimension L: gamma, and wm0, wc0, wm, wc
KINDS = {
    "merwe": (points("merwe", "0"), lambda L: (L, *weights(Fraction(L), L, Fraction(2)), HALF / L, HALF / L)),
    "merwe-0.1": (
        points("merwe", "1", "0.1"),
        lambda L: (g := TENTH**2 * (L + 1), *weights(g, L, Fraction(2), TENTH), HALF / g, HALF / g),
    ),
    "merwe-0.001": (
        points("merwe", "0", "0.001"),
        lambda L: (g := TENTH**6 * L, *weights(g, L, Fraction(2), TENTH**3), HALF / g, HALF / g),
    ),
    "merwe-beta-0": (
        points("merwe", "1", "0.5", "0"),
        lambda L: (g := HALF**2 * (L + 1), *weights(g, L, Fraction(0), HALF), HALF / g, HALF / g),
    ),
    "julier": (points("julier", "0"), lambda L: (L, 0, 0, HALF / L, HALF / L)),
    "julier-2": (points("julier", "2"), lambda L: (L + 2, *[Fraction(2, L + 2)] * 2, *[HALF / (L + 2)] * 2)),
    "julier-minus": (
        points("julier", "-1/2"), lambda L: (g := L - HALF, *[-HALF / g] * 2, *[HALF / g] * 2)
    ),
    "wiki": (
        points("wiki", "3", "0.5"),
        lambda L: (g := HALF**2 * 3, *weights(g, L, Fraction(2), HALF), HALF / g, HALF / g),
    ),
    "wiki-L": (points("wiki", None), lambda L: (L, *weights(Fraction(L), L, Fraction(2)), HALF / L, HALF / L)),
    "trivial": (
        points("trivial"), lambda L: (L, Fraction(1, 2 * L + 1), HALF / L, Fraction(1, 2 * L + 1), HALF / L)
    ),
    "cubature": (points("cubature"), lambda L: (L, 0, 0, HALF / L, HALF / L)),
}  # fmt: skip


def table(found: PointSet) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, wm, wc of all points, that of the centre first where there is one."""
    points = np.array(found.rows, dtype=float)
    wm, wc = ([float(w) for w in row] for row in (found.wm, found.wc))
    if not found.centre:
        return points, np.array(wm), np.array(wc)
    centre = np.zeros((1, points.shape[1]))
    return np.vstack([centre, points]), np.array([float(1 - sum(found.wm)), *wm]), np.array([float(found.wc0), *wc])


@pytest.mark.parametrize("L", [1, 2, 3, 5])
@pytest.mark.parametrize("kind", KINDS)
def test_weights(kind, L):
    """They are those of the table; those of the mean sum to 1, the points have the mean 0 and unit covariance."""
    options, expected = KINDS[kind]
    gamma, wm0, wc0, wm, wc = expected(L)
    found = point_set(options, L)
    assert len(found.rows) == 2 * L
    assert set(found.wm) == {wm}
    assert set(found.wc) == {wc}
    assert found.uniform
    assert found.centre == (kind != "cubature")
    assert sum(found.wm) + (wm0 if found.centre else 0) == 1
    assert found.wc0 == wc0
    for row in found.rows:
        assert sum(1 for v in row if v) == 1
        assert float(max(abs(v) for v in row)) == pytest.approx(math.sqrt(gamma), rel=1e-15)
    rows, _, spread = table(found)
    np.testing.assert_allclose(rows.T @ (spread[:, None] * rows), np.eye(L), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(rows.sum(axis=0), 0, atol=1e-12)
    assert found.exact


def gathered(found: PointSet, deviations: np.ndarray) -> np.ndarray:
    """Of the deviations (count, k) of images from that of the centre, as the emitted code has it."""
    delta = np.array([float(w) for w in found.wm]) @ deviations
    rest = deviations - found.theta * delta
    P = rest.T @ (np.array([float(w) for w in found.wc])[:, None] * rest)
    return P + float(found.extra) * np.outer(delta, delta)


CUSTOM = {
    "centre": ([[0, 0], [2, 0], [-2, 0], [0, 1], [0, -1]], ["0.2", "0.1", "0.3", "0.3", "0.1"],
               ["-0.7", "0.125", "0.125", "0.5", "0.5"]),
    "negative": ([[2, 0], [0, 1], [0, 0], [-2, 0], [0, -1]], ["0.2"] * 5, ["0.5", "-0.125", "0.3", "0.5", "-0.125"]),
    "without": ([["1.5", "0.5"], ["-0.5", 1], ["-1", "-1.5"]], ["0.5", "0.25", "0.25"], ["0.25", "0.5", "0.125"]),
}  # fmt: skip


def custom(name: str) -> Points:
    rows, wm, wc = CUSTOM[name]
    return Points(
        "custom", True, rows=tuple(tuple(Fraction(v) for v in row) for row in rows),
        wm=tuple(Fraction(w) for w in wm), wc=tuple(Fraction(w) for w in wc),
    )  # fmt: skip


@pytest.mark.parametrize("kind", [*KINDS, *CUSTOM])
def test_gathered_covariances(kind):
    """The textbook's sum over random images of all points: no function, just numbers."""
    random = np.random.default_rng(len(kind))
    for L in [2] if kind in CUSTOM else [1, 2, 4]:
        found = point_set(custom(kind) if kind in CUSTOM else KINDS[kind][0], L)
        rows, wm, wc = table(found)
        assert sum(wm) == pytest.approx(1, abs=1e-9)
        images = random.normal(size=(len(rows), 3))
        mean = wm @ images
        textbook = (images - mean).T @ (wc[:, None] * (images - mean))
        base = images[0] if found.centre else random.normal(size=3)  # any does
        deviations = (images - base)[1:] if found.centre else images - base
        size = np.max(np.abs(wc)) * np.max(np.abs(images - mean)) ** 2
        np.testing.assert_allclose(gathered(found, deviations), textbook, rtol=1e-9, atol=1e-11 * size)


def test_nothing_is_subtracted_where_it_need_not_be():
    """However small alpha is: beta - alpha^2 of the mean's shift is added. A centre below 0 is seen from the mean."""
    for L in (1, 2, 5):
        for kind, (options, _) in KINDS.items():
            assert point_set(options, L).positive == (kind not in ("julier-minus", "merwe-beta-0")), (kind, L)
        for kind, alpha in (("merwe-0.1", TENTH), ("merwe-0.001", TENTH**3)):
            found = point_set(KINDS[kind][0], L)
            assert (found.theta, found.extra) == (0, 2 - alpha**2)
    assert not point_set(custom("negative"), 2).positive
    assert not point_set(custom("centre"), 2).positive
    assert point_set(custom("without"), 2).positive


def test_custom_points():
    """The centre is taken out, those of negative weight come last; exact only with the moments of a Gaussian."""
    found = point_set(custom("negative"), 2)
    assert [float(w) for w in found.wc] == [0.5, 0.5, -0.125, -0.125]
    assert found.rows == [[2, 0], [-2, 0], [0, 1], [0, -1]]
    assert found.wc0 == Fraction(3, 10)
    assert found.centre
    assert not found.exact
    assert not found.uniform
    assert not point_set(custom("without"), 2).centre
    root = "1.4142135623730951"
    rows = [["0", "0"], [root, "0"], [f"-{root}", "0"], ["0", root], ["0", f"-{root}"]]
    options = Points(
        "custom", True, rows=tuple(tuple(Fraction(v) for v in row) for row in rows),
        wm=(Fraction(0), *[Fraction(1, 4)] * 4), wc=(Fraction(0), *[Fraction(1, 4)] * 4),
    )  # fmt: skip
    assert point_set(options, 2).exact  # but for the rounding of a root that was written in decimals


# roots and downdates


def dense(U: list, D: list) -> np.ndarray:
    unit = np.triu(np.array(U, dtype=float), 1) + np.eye(len(D))
    return unit @ np.diag(np.array(D, dtype=float)) @ unit.T


def numbers(A: np.ndarray) -> list:
    return [[np.float64(v) for v in row] for row in A]


EPS = float(np.finfo(float).eps)


@pytest.mark.parametrize("seed", range(12))
def test_downdate(seed):
    """U D U^T - c c^T / s, of which most, or nothing but rounding, is left."""
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 6))
    U = numbers(np.triu(random.integers(-2, 3, (n, n)), 1) + np.eye(n))
    D = [np.float64(v) for v in 2.0 ** random.integers(-2, 3, n)]
    P = dense(U, D)
    h = random.integers(-2, 3, n) + 0.5  # of few digits: what is left is then left by the downdate
    c, share = P @ h, (0.5, 0.99, 1.0)[seed % 3]
    s = np.float64(h @ c / share)
    failed, gone = downdate(U, D, [np.float64(v) for v in c], s, 8 * n * EPS)
    assert not failed
    assert not gone  # the last digit is exact
    sigma = np.sqrt(P.diagonal())
    np.testing.assert_allclose(dense(U, D) / np.outer(sigma, sigma), (P - np.outer(c, c) / s) / np.outer(sigma, sigma),
                               atol=1e-12)  # fmt: skip
    assert min(D) >= 0
    U, D = numbers(np.eye(n)), [np.float64(1)] * n
    assert downdate(U, D, [np.float64(1.01)] + [np.float64(0)] * (n - 1), np.float64(1), 8 * n * EPS)[0]


def test_downdate_of_what_is_known():
    """A zero pivot from which nothing is taken stays as it is."""
    U, D = numbers(np.array([[1, 0.5, 0], [0, 1, 0], [0, 0, 1]])), [np.float64(v) for v in (2, 0, 3)]
    P = dense(U, D)
    c = [np.float64(v) for v in (1, 0, 1.5)]
    failed, gone = downdate(U, D, c, np.float64(4), 24 * EPS)
    assert not failed
    assert not gone
    np.testing.assert_allclose(dense(U, D), P - np.outer(c, c) / 4, atol=1e-15)
    assert D[1] == 0


def rooted(P: np.ndarray) -> tuple[np.ndarray, bool]:
    """The lower root of P and whether that failed, by a program run on doubles: it branches where numbers cannot."""
    t, n = Trace(), len(P)
    S, failures = cholesky(lambda i, j: t.element("kf.P", i * n + j), n, Fraction(8 * n * EPS))
    for condition in failures:
        t.flag(condition, "NOT_POSITIVE")
    for i in range(n):
        for j in range(n):
            t.store("kf.S", i * n + j, t.value(S[i][j]))
    memory = Memory({"kf.P": list(P.ravel()), "kf.S": [None] * (n * n)})
    flags = run(Function("test", [], schedule(t), ""), SCALARS["double"], memory)
    return np.array(memory.arrays["kf.S"], dtype=float).reshape(n, n), bool(flags)


@pytest.mark.parametrize("seed", range(8))
def test_cholesky(seed):
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 6))
    rank = n if seed % 2 else n - 1
    A = random.integers(-3, 4, (n, rank)).astype(float)
    P = A @ A.T
    S, failed = rooted(P)
    assert not failed
    np.testing.assert_array_equal(np.triu(S, 1), 0)
    np.testing.assert_allclose(S @ S.T, P, atol=1e-6 if rank < n else 1e-12)
    if rank == n and np.linalg.eigvalsh(P)[0] > 1e-6:
        np.testing.assert_allclose(S, np.linalg.cholesky(P), atol=1e-10)
        plain, failures = cholesky(lambda i, j: np.float64(P[i, j]), n, 8 * n * EPS)
        np.testing.assert_allclose(np.array(plain, dtype=float), S, atol=1e-12)
        assert not any(failures)


def test_cholesky_of_semidefinite_and_indefinite_matrices():
    for P in (np.zeros((3, 3)), np.ones((3, 3)), np.diag([0.0, 2, 0]), np.array([[4.0, 0, 2], [0, 0, 0], [2, 0, 1]])):
        S, failed = rooted(P)
        assert not failed
        np.testing.assert_allclose(S @ S.T, P, atol=1e-15)
    for P in (np.diag([1.0, -1e-3]), np.diag([-1.0, 1.0])):
        assert rooted(P)[1]
    # what rounding may leave of correlations where variances are small beside what they have been
    S, failed = rooted(np.array([[1.0, 2], [2, 1]]))
    assert not failed
    np.testing.assert_array_equal(S, [[1, 0], [2, 0]])


def test_roots_of_factors():
    U, D = [[1, 0.5, -1], [0, 1, 2], [0, 0, 1]], [4.0, 0, 0.25]
    root = root_of_factors(U, D)
    np.testing.assert_allclose(np.array(root, float) @ np.array(root, float).T, dense(U, D))
    np.testing.assert_array_equal(np.array(columns_of(root), float).T, np.triu(np.array(root, float)))


def downdated(S: np.ndarray, w: list, s: float = 1.0, tolerance: float = 1e-14) -> tuple[np.ndarray, bool, bool]:
    """By the layout, on exact numbers: the new lower S, whether it failed, whether a pivot has gone."""
    t, n = Trace(), len(S)
    inner = [[t.value(Fraction(float(S[n - 1 - i, n - 1 - j]))) for j in range(n)] for i in range(n)]
    c = [t.value(Fraction(v)) for v in reversed(w)]
    how = Removal(Fraction(tolerance), sure=False, definite=False)
    rows, failed = StraightSqrt(n).downdated(t, inner, c, t.value(Fraction(s)), how, inner)
    values = [[float(t.value(v).constant) for v in row] for row in rows]
    flagged = any(condition.constant != 0 for condition, _ in t.raised)
    return np.array(values)[::-1, ::-1], failed.constant != 0, flagged


def test_the_downdate_of_a_root():
    """The known case whose result a published library has wrong: 2.440, not 2.557."""
    S, failed, gone = downdated(np.array([[3.0, 0.0], [1.0, 2.5]]), [1, "0.8"])
    np.testing.assert_allclose(S @ S.T, [[8.0, 2.2], [2.2, 6.61]], rtol=1e-14)
    assert S[1, 1] == pytest.approx(2.4495, abs=0.01)
    assert not failed
    assert not gone
    S, failed, gone = downdated(np.array([[3.0, 0.0], [1.0, 2.5]]), [2, "1.6"], 4)
    np.testing.assert_allclose(S @ S.T, [[8.0, 2.2], [2.2, 6.61]], rtol=1e-14)
    S, failed, gone = downdated(np.array([[2.0, 0.0], [1.0, 1.0]]), [2, 1])
    np.testing.assert_allclose(S, [[0.0, 0.0], [0.0, 1.0]], atol=1e-14)
    assert gone
    assert not failed
    assert downdated(np.array([[2.0, 0.0], [1.0, 1.0]]), ["2.1", 1])[1]
    S, failed, gone = downdated(np.array([[0.0, 0.0], [0.0, 2.0]]), [0, 1])
    np.testing.assert_allclose(S, [[0.0, 0.0], [0.0, math.sqrt(3.0)]], rtol=1e-15)
    assert not failed
    assert not gone


@pytest.mark.parametrize("seed", range(6))
def test_random_downdates_of_a_root(seed):
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 5))
    S = np.tril(random.normal(size=(n, n)), -1) + np.diag(random.uniform(0.5, 2, n))
    w = 0.9 * S @ (lambda v: v / np.linalg.norm(v))(random.normal(size=n))
    new, failed, gone = downdated(S, [float(v) for v in w])
    np.testing.assert_allclose(new @ new.T, S @ S.T - np.outer(w, w), atol=1e-12)
    assert not failed
    assert not gone
