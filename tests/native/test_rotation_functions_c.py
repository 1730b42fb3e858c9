"""Functions of rotations in C: values and derivatives are the reference's, at 0 and at pi."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from kfgen.generate import build
from kfgen.native import NativeFilter, load_filters
from kfgen.reference import reference
from kfgen.spec import loads

SPEC = """
kfgen: 1
name: turning_SCALAR
scalar: SCALAR
constants: {north: [0.6, 0, 0.8], down: [0, 0, 1]}
dt: 0.1
states:
  a: {vector: 3, init: 0, std: [0.1, 0.2, 0.3], range: [-3.2, 3.2]}
  b: {vector: 3, init: [0.3, -0.2, 1], std: [0.1, 0.1, 0.2], range: [-2, 2]}
let: {q: from_rotation_vector(a)}
dynamics: {f: {a: 0.999*a, b: 0.999*b}, Q: {a: 1e-3, b: 1e-3}}
measurements:
  numbers: {z: {q: {h: "q.w*[1, 1, 1]", std: 0.3}, x: {h: "[q.x, q.y, q.z]", std: 0.3}}}
  logs: {z: {r: {h: rotation_vector(q), std: 0.3},
             c: {h: "rotation_vector(conjugate(q)*from_rotation_vector([0, 0, 0.5]))", std: 0.3}}}
  turned: {z: {turned: {h: "rotate(q, b)", std: 0.3}, back: {h: "unrotate(q, north)", std: 0.3}}}
  angles: {z: {r: {h: roll(q), std: 0.3, kind: angle}, p: {h: pitch(q), std: 0.3},
               y: {h: yaw(q), std: 0.3, kind: angle}}}
  euler: {z: {e: {h: "rotate(from_euler(a.x, a.y, a.z), b)", std: 0.3}}}
  between: {z: {b: {h: "rotate(rotation_between(down, b), north)", std: 0.3}}}
  pair: {z: {p: {h: "rotate(triad(b, north, down, north), [1, 1, 0])", std: 0.3}}}
  crossed: {z: {c: {h: "cross(a, b) + skew(b) @ a + outer(a, b) @ b", std: 0.3}, n: {h: "norm(a + b)", std: 0.3}}}
"""
SCALARS = {"double": 1e-9, "float": 2e-4, "q8.24": 2e-5}
NEAR = [0.0, 1e-300, 1e-30, 1e-9, 1e-4, 0.4999, 0.5001, 1.0, math.pi - 1e-3, math.pi - 1e-7]


@cache
def filters() -> dict[str, NativeFilter]:
    specs = [loads(SPEC.replace("_SCALAR", "_" + s.replace(".", "")).replace("SCALAR", s)) for s in SCALARS]
    return dict(zip(SCALARS, load_filters([build(spec) for spec in specs]), strict=True))


def compared(scalar: str, a: np.ndarray, b: np.ndarray) -> None:
    kf = filters()[scalar].copy()
    kf.init()
    ref = reference(kf.spec)
    x = np.array([*a, *b])
    P = np.diag(np.array([0.01, 0.04, 0.09, 0.01, 0.01, 0.04]))
    tolerance = SCALARS[scalar]
    for sensor in kf.spec.measurements:
        for each in (kf, ref):
            each.set_state(x)
            each.set_covariance(P)
            each.update(sensor.name, np.linspace(-0.3, 0.4, len(sensor.components)))
        sigma = np.sqrt(np.diag(ref.P))
        assert kf.x / sigma == pytest.approx(ref.x / sigma, abs=tolerance), (sensor.name, a)
        assert np.asarray(kf.P) / np.outer(sigma, sigma) == pytest.approx(ref.P / np.outer(sigma, sigma), abs=tolerance)


@pytest.mark.parametrize("size", NEAR)
def test_near_0_and_pi(size: float) -> None:
    draw = np.random.default_rng(1)
    for _ in range(4):
        axis = draw.normal(size=3)
        compared("double", size * axis / np.linalg.norm(axis), draw.normal(size=3))


@pytest.mark.parametrize("scalar", ["float", "q8.24"])
def test_rounded_scalars(scalar: str) -> None:
    draw = np.random.default_rng(2)
    for size in (0.0, 0.1, 0.9, 2.0, 3.0):
        axis = draw.normal(size=3)
        compared(scalar, size * axis / np.linalg.norm(axis), draw.uniform(-1, 1, 3))
