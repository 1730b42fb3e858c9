"""The reference's exponential, logarithm and matrix of rotations, and their derivatives, against 50 digits."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest

from kfgen.errors import NOWHERE
from kfgen.reference import rotations
from kfgen.reference.dual import hessian, jacobian, values, variables
from kfgen.reference.evaluate import Scope
from kfgen.reference.manifold import Manifold
from kfgen.spec.tree import Call, Expression, Number
from tests.oracle.attitude import rotation
from tests.oracle.error_state import compose, exp, left_jacobian, log, matrix, right_jacobian
from tests.oracle.formulas import call

m = mpmath.MPContext()
m.dps = 50

# rotation vectors: none, nearly none, on both sides of where the series ends, half a turn, more than a turn
ANGLES = [0.0, 1e-160, 1e-12, 1e-4, 0.1, 0.999999, 1.000001, 3.0, math.pi - 1e-9, math.pi, 4.0, 7.0]
AXIS = np.array([0.48, -0.6, 0.64])


def precise_exp(*d):
    angle = m.sqrt(sum(v * v for v in d))
    factor = m.sin(angle / 2) / angle if angle else m.mpf(1) / 2
    return [m.cos(angle / 2), *(factor * v for v in d)]


def precise_log(w, *v):
    size = m.sqrt(sum(part * part for part in v))
    return [2 * m.atan2(size, w) / size * part for part in v]


def slopes(f, at, i, *orders):
    """A partial derivative of component i."""
    return float(m.diff(lambda *x: f(*x)[i], tuple(map(m.mpf, at)), orders))


def unit(*places):
    return tuple(sum(place == k for place in places) for k in range(4))


def check(numbers, f, at, k, second):
    """Values, gradients and (second) Hessians of numbers of k variables."""
    assert np.allclose(values(numbers), [float(v) for v in f(*map(m.mpf, at))], rtol=1e-15, atol=1e-16)
    found = jacobian(numbers, k)
    for i in range(len(numbers)):
        expected = [slopes(f, at, i, *unit(a)[:k]) for a in range(k)]
        assert np.allclose(found[i], expected, rtol=0, atol=1e-13)
        if second:
            expected = [[slopes(f, at, i, *unit(a, b)[:k]) for b in range(k)] for a in range(k)]
            assert np.allclose(hessian(numbers[i], k), expected, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("angle", [a for a in ANGLES if a > 1e-6 or a == 0])
def test_exponential(angle):
    d = angle * AXIS
    if angle:
        check(rotations.exponential(variables(d, order=2)), precise_exp, d, 3, True)
        return
    # exp(d) = 1 + d/2 - |d|^2/8 + ...
    found = rotations.exponential(variables(d, order=2))
    assert np.array_equal(values(found), [1, 0, 0, 0])
    assert np.array_equal(jacobian(found, 3), np.vstack([np.zeros(3), np.eye(3) / 2]))
    assert np.array_equal(hessian(found[0], 3), -np.eye(3) / 4)
    assert not any(hessian(number, 3).any() for number in found[1:])


@pytest.mark.parametrize("angle", ANGLES)
def test_exponential_of_floats(angle):
    assert np.allclose(rotations.exponential(list(angle * AXIS)), exp(angle * AXIS), rtol=0, atol=1e-15)


@pytest.mark.parametrize("angle", [1e-5, 0.1, 0.27, 0.29, 1.0, 3.0, math.pi - 1e-9, math.pi - 1e-3])
def test_logarithm(angle):
    q = exp(angle * AXIS) * 1.25  # its length makes no difference
    check(rotations.logarithm(variables(q, order=2)), precise_log, q, 4, angle > 0.01)
    assert np.allclose(values(rotations.logarithm(variables(-q))), angle * AXIS, rtol=1e-15)


def test_logarithm_at_its_ends():
    found = rotations.logarithm(variables([1.0, 0.0, 0.0, 0.0], order=2))
    assert np.array_equal(values(found), [0, 0, 0])
    assert np.array_equal(jacobian(found, 4), np.hstack([np.zeros((3, 1)), 2 * np.eye(3)]))
    half = rotations.logarithm(variables([0.0, *AXIS]))
    assert np.allclose(values(half), math.pi * AXIS, rtol=1e-15)
    assert np.isfinite(jacobian(half, 4)).all()
    none = rotations.logarithm(variables([0.0] * 4, order=2))
    assert np.array_equal(values(none), [0, 0, 0])
    assert np.isfinite(jacobian(none, 4)).all()


def test_what_is_not_finite_stays_so():
    for bad in (math.nan, math.inf, -math.inf):
        assert not np.isfinite(values(rotations.exponential([bad, 0.0, 1.0]))).any()
        assert not np.isfinite(values(rotations.logarithm([1.0, bad, 0.0, 0.0]))).all()
        assert not np.isfinite(values(rotations.exponential(variables([1e200, 0.0, 1.0])))).any()


def test_matrix():
    q = exp(2.0 * AXIS)
    found = [[rotations.entry(i, j, list(q)) for j in range(3)] for i in range(3)]
    assert np.allclose(found, matrix(q), rtol=0, atol=1e-15)


def test_constants_are_folded_exactly():
    scope = Scope({}, ())

    def folded(op, *arguments):
        exact = scope.constant(Expression(exact_numbers(call(op, *arguments).tree), "", NOWHERE))
        assert exact is not None
        return exact

    assert folded("rotation", 0, 1, "0.6", 0, 0, "0.8") == Fraction(-24, 25)
    assert folded("from_rotation_vector", 0, 0, 0, 0) == 1
    assert folded("rotation_vector", 2, -1, 0, 0, 0) == 0
    q, d = exp(2.0 * AXIS), 2.0 * AXIS
    for k in range(3):
        assert float(folded("rotation_vector", k, *q)) == pytest.approx(d[k], rel=1e-15)
        assert float(folded("rotation_vector", k, *-q)) == pytest.approx(d[k], rel=1e-15)
        for j in range(3):
            assert float(folded("rotation", k, j, *q)) == pytest.approx(matrix(q)[k, j], abs=1e-15)
    for k in range(4):
        assert float(folded("from_rotation_vector", k, *d)) == pytest.approx(q[k], rel=1e-15)


def exact_numbers(tree):
    """With numbers that were written as text."""
    if isinstance(tree, Call):
        return Call(tree.op, tuple(exact_numbers(argument) for argument in tree.args))
    return tree if isinstance(tree, Number) else Number(Fraction(tree.name))


@pytest.mark.parametrize("error", ["body", "reference"])
@pytest.mark.parametrize("angle", ANGLES)
def test_the_error_as_seen_from_elsewhere(error, angle):
    """T(d) is the textbook's Jacobian of the exponential, and J its inverse."""
    space, d = Manifold(["q_w", "q_x", "q_y", "q_z", "b"], [rotation((1, 1, 1), error, reset=False)]), angle * AXIS
    expected = right_jacobian(d) if error == "body" else left_jacobian(d)
    T = space.turned(np.append(d, 5.0))
    assert np.allclose(T[:3, :3], expected, rtol=0, atol=1e-14)
    assert T[3, 3] == 1
    assert np.array_equal(space.turned(np.append(d, 5.0), always=False), np.eye(4))
    if 1e-100 < angle < math.pi - 1e-6:
        q = np.array([0.5, -0.5, 0.5, 0.5])
        near = compose(q, exp(d)) if error == "body" else compose(exp(d), q)
        J = space.transport(np.append(near, 1.0), np.append(q, 2.0))
        assert np.allclose(J[:3, :3] @ expected, np.eye(3), rtol=0, atol=1e-13)
        assert np.allclose(space.difference(np.append(near, 1.0), np.append(q, 2.0)), [*d, -1], rtol=0, atol=1e-15)
        assert np.allclose(log(compose([0.5, 0.5, -0.5, -0.5], near)) if error == "body" else d, d, atol=1e-15)
