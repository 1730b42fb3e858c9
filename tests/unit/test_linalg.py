"""The factored linear algebra on plain numbers, against dense numpy. A failure here is the algorithm's."""

from __future__ import annotations

import numpy as np
import pytest

from kfgen.filters.algebra import linalg
from kfgen.filters.algebra.factors import gram_schmidt, udu
from kfgen.filters.algebra.measurement import Measurement, bierman
from kfgen.filters.algebra.rank_one import rank_one, unit_columns
from kfgen.filters.algebra.symmetric import Symmetric

TYPES = [float, np.float64]


def factors(random: np.random.Generator, n: int, zeros: int = 0) -> tuple[list, list]:
    """A random U and D, of which some pivots are zero."""
    U = np.triu(random.normal(size=(n, n)), 1) + np.eye(n)
    D = random.uniform(0.1, 3, n)
    D[random.choice(n, zeros, replace=False)] = 0.0
    return U.tolist(), D.tolist()


def dense(U: list, D: list) -> np.ndarray:
    n = len(D)
    unit = np.triu(np.array(U, dtype=float), 1) + np.eye(n)
    return unit @ np.diag(np.array(D, dtype=float)) @ unit.T


def joseph(P: np.ndarray, h: np.ndarray, r: float, K: np.ndarray) -> np.ndarray:
    A = np.eye(len(P)) - np.outer(K, h)
    return A @ P @ A.T + r * np.outer(K, K)


@pytest.mark.parametrize("seed", range(12))
def test_bierman_is_the_dense_update(seed):
    random = np.random.default_rng(seed)
    n, m = int(random.integers(1, 7)), int(random.integers(1, 4))
    U, D = factors(random, n, zeros=seed % 3 if n > 2 else 0)
    H = random.normal(size=(m, n)) * (random.random((m, n)) < 0.7)
    R = random.uniform(0.1, 1, m)
    P = dense(U, D)
    gains, s = bierman(U, D, [Measurement(h.tolist(), r) for h, r in zip(H, R, strict=True)])
    for h, r, K, variance in zip(H, R, gains, s, strict=True):
        expected = h @ P @ h + r
        assert variance == pytest.approx(expected, rel=1e-12)
        np.testing.assert_allclose(np.array(K, dtype=float), P @ h / expected, atol=1e-12)
        P = joseph(P, h, r, P @ h / expected)
    np.testing.assert_allclose(dense(U, D), P, atol=1e-12)
    assert min(D) >= 0


def test_bierman_with_an_exact_measurement():
    """r = 0: the measured direction is known afterwards; measured again it is skipped."""
    U, D = [[1, 0.5], [0, 1]], [1.0, 2.0]
    P = dense(U, D)
    gains, s = bierman(U, D, [Measurement([1.0, 0.0], 0.0)])
    np.testing.assert_allclose(gains[0], P[:, 0] / P[0, 0], rtol=1e-15)
    assert s[0] == pytest.approx(P[0, 0])
    np.testing.assert_allclose(dense(U, D), joseph(P, np.array([1.0, 0]), 0, P[:, 0] / P[0, 0]), atol=1e-15)
    U, D = [[1, 0.0], [0, 1]], [0.0, 2.0]
    gains, s = bierman(U, D, [Measurement([1.0, 0.0], 0.0)])
    assert np.all(np.array(gains, dtype=float) == 0)
    assert s == [0.0]
    np.testing.assert_array_equal(dense(U, D), np.diag([0.0, 2.0]))


def test_six_equal_sensors():
    U, D = [[1]], [1e6]
    x = 0.0
    gains, _ = bierman(U, D, [Measurement([1.0], 1.0)] * 6)
    for (k,) in gains:
        x += k * (10 - x)
    assert x == pytest.approx(10, abs=1e-4)
    assert D[0] == pytest.approx(1 / 6, rel=1e-6)


@pytest.mark.parametrize("seed", range(12))
def test_rank_one_is_the_dense_sum(seed):
    random = np.random.default_rng(seed)
    n, k = int(random.integers(1, 7)), int(random.integers(1, 5))
    U, D = factors(random, n, zeros=seed % 3 if n > 2 else 0)
    W = random.normal(size=(k, n)) * (random.random((k, n)) < 0.7)
    d = random.uniform(0, 2, k) * (random.random(k) < 0.8)
    own = [int(random.integers(-1, n)) for _ in range(k)]
    expected = dense(U, D) + (W.T * d) @ W
    rank_one(U, D, [(w.tolist(), float(v), o) for w, v, o in zip(W, d, own, strict=True)])
    np.testing.assert_allclose(dense(U, D), expected, atol=1e-12)
    assert min(D) >= 0


@pytest.mark.parametrize("scalar", TYPES)
def test_rank_one_on_a_zero_matrix(scalar):
    """Zero pivots with zero coefficients lose nothing: 0 + [3, 0][3, 0]^T has P00 = 9."""
    for w in ([3, 0], [0, 3], [3, 1], [0, 0], [1, 3, 0], [0, 2, 0], [5, 0, 1]):
        n = len(w)
        U = [[scalar(i == j) for j in range(n)] for i in range(n)]
        D = [scalar(0)] * n
        rank_one(U, D, [([scalar(v) for v in w], scalar(1), -1)])
        np.testing.assert_allclose(dense(U, D), np.outer(w, w), atol=1e-14)
    U, D = [[1.0, 0.0], [0.0, 1.0]], [0.0, 0.0]
    rank_one(U, D, [([3.0, 0.0], 1.0, -1), ([1.0, 1.0], 0.0, -1)])
    assert dense(U, D)[0, 0] == 9


def test_rank_one_keeps_small_numbers():
    """A pivot of 1e-12 under a column of weight 1 keeps its digits (own) in single precision."""
    U = [[np.float32(1), np.float32(0.5)], [np.float32(0), np.float32(1)]]
    D = [np.float32(1e-6), np.float32(1e-12)]
    expected = dense(U, D) + np.outer([0.25, 1], [0.25, 1]) * 1e-3
    rank_one(U, D, [([np.float32(0.25), np.float32(1)], np.float32(1e-3), 1)])
    np.testing.assert_allclose(dense(U, D), expected, rtol=1e-6)
    assert np.linalg.det(dense(U, D)) == pytest.approx(np.linalg.det(expected), rel=1e-3)


@pytest.mark.parametrize("seed", range(10))
def test_gram_schmidt(seed):
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 6))
    m = n + int(random.integers(0, 4))
    W = random.normal(size=(n, m)) * (random.random((n, m)) < 0.8)
    if seed % 3 == 0 and n > 1:
        W[0] = 2 * W[1]  # semidefinite
    d = random.uniform(0.1, 2, m) * (random.random(m) < 0.9)
    U, D = gram_schmidt(W.tolist(), d.tolist())
    np.testing.assert_allclose(dense(U, D), (W * d) @ W.T, atol=1e-10)
    assert min(D) >= 0


@pytest.mark.parametrize("seed", range(10))
def test_udu(seed):
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 7))
    A = random.integers(-3, 4, (n, n if seed % 2 else max(1, n - 1))) / 2
    P = A @ A.T  # of small integers over 4: zero pivots come out exactly
    U, D = udu(P.tolist())
    if seed % 2:
        np.testing.assert_allclose(dense(U, D), P, atol=1e-9)
    elif min(D) >= 0:
        np.testing.assert_allclose(dense(U, D), P, atol=1e-6)


def test_udu_of_semidefinite_matrices():
    for P in (np.zeros((3, 3)), np.ones((3, 3)), np.diag([0.0, 2, 0]), np.array([[4.0, 0, 2], [0, 0, 0], [2, 0, 1]])):
        U, D = udu(P.tolist())
        np.testing.assert_array_equal(dense(U, D), P)
        assert min(D) >= 0


def test_quotients():
    assert linalg.quotients([1.0, 0.0, 3.0], 2.0, 1.0) == [0.5, 0.0, 1.5]
    assert linalg.quotients([0.0, 0.0], 0.0, 0.0) == [0.0, 0.0]
    assert linalg.quotients([1e-30, 0.0], 2e-30, 0.0) == [0.5, 0.0]


def symmetric(P: np.ndarray) -> Symmetric:
    return Symmetric(len(P), lambda i, j: float(P[i, j]))


def full(P: Symmetric) -> np.ndarray:
    return np.array([[P[i, j] for j in range(P.n)] for i in range(P.n)], dtype=float)


@pytest.mark.parametrize("seed", range(10))
def test_symmetric(seed):
    """joseph holds for any gain, downdated for the optimal one; congruent is F P F^T."""
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 6))
    A = random.normal(size=(n, n))
    P = A @ A.T
    h = random.normal(size=n) * (random.random(n) < 0.7)
    if seed % 3 == 0:
        h = 2.0 * np.eye(n)[seed % n]  # a single state
    r = 0.5
    c = P @ h
    K = c / (h @ c + r)
    expected = joseph(P, h, r, K)
    S = symmetric(P)
    assert S.times(h.tolist()) == pytest.approx(c.tolist())
    measured = Measurement(h.tolist(), r)
    np.testing.assert_allclose(full(S.downdated(measured, c.tolist(), K.tolist())), expected, atol=1e-12)
    np.testing.assert_allclose(full(S.joseph(measured, c.tolist(), K.tolist())), expected, atol=1e-12)
    other = K * random.uniform(0, 1, n)  # a gain that has been changed
    made = full(S.joseph(measured, c.tolist(), other.tolist()))
    np.testing.assert_allclose(np.triu(made), np.triu(joseph(P, h, r, other)), atol=1e-12)
    F = random.normal(size=(n, n)) * (random.random((n, n)) < 0.6)
    np.testing.assert_allclose(full(S.congruent(F.tolist())), F @ P @ F.T, atol=1e-12)
    doubled = S.changed(lambda i, j, p: 2 * p if i == j else p)
    np.testing.assert_allclose(full(doubled), P + np.diag(np.diag(P)))


def test_unit_columns_and_dot():
    random = np.random.default_rng(1)
    F, U = random.normal(size=(4, 4)), np.triu(random.normal(size=(4, 4)), 1) + np.eye(4)
    for k in range(4):
        np.testing.assert_allclose(unit_columns(F.tolist(), U.tolist(), k), (F @ U)[:, k], atol=1e-14)
    assert linalg.dot([], []) == 0
    assert linalg.dot([0, 2.0], [5.0, 3.0]) == 6
