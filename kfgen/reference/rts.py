"""The fixed-interval smoother: a filter forwards over a log, then back over its predictions.

Rauch, Tung & Striebel 1965; for sigma points Sarkka 2008, equations 28 to 35 (the unscented Rauch-Tung-Striebel
smoother). Both are the same recursion: they differ in the covariance of the state before a prediction with that after.
Rotations are smoothed in the tangent space, each covariance as it is seen from where its difference is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kfgen.errors import KfgenError
from kfgen.reference.algorithm import Estimate, Passage
from kfgen.reference.build import reference
from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.filter import ReferenceFilter
from kfgen.reference.linalg import EPS, symmetric
from kfgen.reference.log import Run, replay
from kfgen.reference.model import Context, Model, wrap
from kfgen.reference.outputs import Outputs
from kfgen.reference.sensor import SensorModel
from kfgen.reference.status import Status
from kfgen.spec.sensors import filter_of
from kfgen.spec.types import Spec


@dataclass(frozen=True)
class Smoothed:
    """Estimates that know all of a log of r rows.

    x (r, nx), P (r, n, n): after each row, in the spec's order; rows between which nothing was predicted share one.
    run: the filter's own course. outputs, output_std: name -> (r), what the spec's `outputs` are of them.
    """

    x: Matrix
    P: NDArray[np.float64]
    run: Run
    outputs: Mapping[str, Vector] = field(default_factory=dict)
    output_std: Mapping[str, Vector] = field(default_factory=dict)

    @property
    def var(self) -> Matrix:
        """The variances (r, n)."""
        diagonal: Matrix = np.einsum("kii->ki", self.P)
        return diagonal


class _Forward:
    """A filter that remembers its predictions, and the estimate before each."""

    def __init__(self, kf: ReferenceFilter) -> None:
        self.kf, self.spec, self.model = kf, kf.spec, kf.model
        self.before: list[tuple[Vector, Matrix]] = []
        self.passages: list[Passage] = []

    @property
    def sensors(self) -> Mapping[str, SensorModel]:
        return self.kf.sensors

    @property
    def nis(self) -> float:
        return self.kf.nis

    @property
    def x(self) -> Vector:
        return self.kf.x

    @property
    def P(self) -> Matrix:
        return self.kf.P

    @property
    def mu(self) -> Vector:
        return self.kf.mu

    def predict(self, u: ArrayLike | None = None, dt: float | None = None) -> int:
        before = self.kf.estimate
        status = self.kf.predict(u, dt)
        if status < Status.ERROR and self.kf.estimate is not before:  # it may wait for a first measurement
            passage = self.kf.estimate.passage
            assert passage is not None
            self.before.append((before.x, before.P))
            self.passages.append(passage)
        return status

    @property
    def outputs(self) -> dict[str, float]:
        return self.kf.outputs

    @property
    def output_std(self) -> dict[str, float]:
        return self.kf.output_std

    def update(
        self, sensor: str, z: ArrayLike, u: ArrayLike | None = None, mask: int | Sequence[bool] | None = None,
        inputs: ArrayLike | Mapping[str, float] | None = None,
    ) -> int:  # fmt: skip
        return self.kf.update(sensor, z, u, mask, inputs)


def refusals(spec: Spec) -> Iterator[str]:
    """Why a spec cannot be smoothed, a reason each."""
    if spec.imm is not None:
        yield (
            "imm: its modes are mixed anew in each step, and a way back through them all is no single filter's; "
            "smooth a spec of one of its modes"
        )
        return
    if spec.filter.type == "ekf2":
        yield (
            "type: ekf2: its predictions take up second derivatives, which the smoother's gain, a linear map back, "
            "would leave out; use ekf or ukf"
        )
    options = [spec.filter, *(filter_of(spec.filter, sensor) for sensor in spec.measurements)]
    for name in ("adapt_R", "adapt_Q"):
        if any(getattr(each, name) is not None for each in options):
            yield f"{name}: covariances learnt on the way are not those that hold for the way back; smooth without it"


def smooth(spec: Spec, log: Mapping[str, ArrayLike], seen: Callable[[int], None] = lambda row: None) -> Smoothed:
    """Smooths a log, which is read as `kfgen.reference.log.replay` reads it, from the spec's start.

    A late measurement stands in the log where it was made. seen: called with each row that the filter has done.
    KfgenError where a spec cannot be smoothed, with the reasons.
    """
    reasons = list(refusals(spec))
    if reasons:
        raise KfgenError("\n".join(f"{spec.name} cannot be smoothed: {reason}" for reason in reasons))
    kf = reference(spec)
    forward = _Forward(kf)
    legs: list[int] = []  # of each row: how many predictions came before its end
    moments: list[Context] = []

    def passed(row: int) -> None:
        legs.append(len(forward.passages))
        moments.append(kf.now)
        seen(row)

    run = replay(forward, log, passed)
    x, P = _backward(kf.model, forward, kf.x, kf.P)
    told = Outputs(kf.model)
    places = list(zip((Estimate(x[k], P[k]) for k in legs), moments, strict=True)) if told.names else []
    values = [told.values(*place) for place in places]
    deviations = [told.deviations(*place) for place in places]
    return Smoothed(x[legs], P[legs], run, *(
        {name: np.array([row[name] for row in rows]) for name in told.names} for rows in (values, deviations)
    ))  # fmt: skip


def _backward(model: Model, forward: _Forward, x: Vector, P: Matrix) -> tuple[Matrix, NDArray[np.float64]]:
    """Estimates (k + 1, nx), (k + 1, n, n) before each of k predictions and, x (nx) and P (n, n), at the end.

    G = C P_pred^-1, d = G (x_s [-] x_pred), x_s <- x [+] d, P_s <- P + G (P_s - P_pred) G^T. Of rotations P_s is moved
    first to where the difference is taken, and last to where d leads.
    """
    space = model.space
    steps = len(forward.passages)
    xs, Ps = np.empty((steps + 1, len(x))), np.empty((steps + 1, len(P), len(P)))
    xs[-1], Ps[-1] = x, P
    for k in range(steps - 1, -1, -1):
        passage, (before, spread) = forward.passages[k], forward.before[k]
        G = passage.cross @ inverse(passage.P)
        ahead = space.difference(xs[k + 1], passage.x)
        for i, period in model.turns.items():
            ahead[i] = wrap(float(ahead[i]), period)
        J, d = space.transport(xs[k + 1], passage.x), G @ ahead
        T = space.turned(d)
        xs[k] = model.wrap(space.moved(before, d))
        Ps[k] = symmetric(T @ (spread + G @ (J @ Ps[k + 1] @ J.T - passage.P) @ G.T) @ T.T)
    return xs, Ps


def inverse(P: Matrix) -> Matrix:
    """The inverse (n, n) of a covariance, its pseudo-inverse where it is singular: judged by its correlations."""
    sigma = np.sqrt(np.maximum(P.diagonal(), 0.0))
    scale = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=sigma > 0.0)
    values, vectors = np.linalg.eigh(symmetric(P * np.outer(scale, scale)))
    kept = values > 8.0 * len(P) * EPS * max(float(values[-1]), 0.0)
    root = vectors[:, kept] / np.sqrt(values[kept]) * scale[:, None]
    result: Matrix = root @ root.T
    return result
