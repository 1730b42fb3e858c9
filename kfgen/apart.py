"""How far estimates are apart, row by row: of numbers their difference, of angles the shortest way, of rotations the
three numbers of their error."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kfgen.spec.constants import value
from kfgen.spec.types import Rotation, Spec

Array = NDArray[np.float64]


def differences(spec: Spec, a: Array, b: Array) -> Array:
    """a [-] b [N, n] in the coordinates of `spec.errors`; a, b [N, nx]. NaN where a number that it takes is."""
    names = [state.name for state in spec.states]
    rotations = {rotation.errors[0]: rotation for rotation in spec.rotations}
    columns: list[Array] = []
    for name in spec.errors:
        if name in names:
            i = names.index(name)
            period = spec.states[i].period
            columns.append(_shortest(a[:, i] - b[:, i], None if period is None else float(value(period.tree, spec))))
        elif name in rotations:
            rotation = rotations[name]
            places = [names.index(part) for part in rotation.parts]
            columns += list(_turned(rotation, a[:, places], b[:, places]).T)
    return np.column_stack(columns) if columns else np.empty((len(a), 0))


def _shortest(d: Array, period: float | None) -> Array:
    """In (-period/2, period/2]."""
    if period is None:
        return d
    near: Array = d - period * np.ceil(d / period - 0.5)
    return near


def _turned(rotation: Rotation, a: Array, b: Array) -> Array:
    """log(b^-1 a), or log(a b^-1) for an error in the reference frame [N, 3] (Sola 2017, section 4.4)."""
    with np.errstate(invalid="ignore", divide="ignore"):
        a, b = (q / np.linalg.norm(q, axis=1, keepdims=True) for q in (a, b))
    w = np.einsum("ij,ij->i", a, b)
    u, v = a[:, 1:], b[:, 1:]
    across = np.cross(u, v) if rotation.error == "body" else np.cross(v, u)
    v = b[:, :1] * u - a[:, :1] * v + across
    v = np.where(w[:, None] < 0, -v, v)  # of the two quaternions of the turn the nearer one
    half = np.linalg.norm(v, axis=1)
    angle = 2.0 * np.arctan2(half, np.abs(w))
    scale = np.divide(angle, half, out=np.full_like(half, 2.0), where=half > 1e-150)
    turned: Array = v * np.where(np.isfinite(half), scale, np.nan)[:, None]
    return turned
