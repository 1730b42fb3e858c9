"""The errors against the truth, where a log knows it: NEES, and the RMSE of each state against its claimed sigma."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kfgen import statistics
from kfgen.report.blocks import Block, Grid, Note, Picture, Section, figure, percent
from kfgen.report.figures import BAD, BAND, ESTIMATE, few, picture, thin
from kfgen.report.subject import Drive, Subject

Array = NDArray[np.float64]

ORDER = 40
MOST = 48  # errors of rotations that are drawn: the numbers of a quaternion have no standard deviation
ROUND_OFF = 1e-12  # of the largest eigenvalue of the correlations: below it an estimate claims to know exactly


def section(subject: Subject) -> Section | None:
    known = [(n, drive, subject.errors(drive)) for n, drive in enumerate(subject.drives)]
    known = [(n, drive, errors) for n, drive, errors in known if np.isfinite(errors).any()]
    if not known:
        return None
    squares, degrees = zip(*(nees(drive, errors) for _, drive, errors in known), strict=True)
    size = statistics.band(np.concatenate(squares), np.concatenate(degrees))
    rmse = _rmse(subject, [(drive, errors) for _, drive, errors in known])
    blocks: list[Block] = []
    data: dict[str, Any] = {"rmse": rmse}
    if size is not None:
        data["nees"] = {**size.as_json(), "outside": 1.0 - size.inside, "verdict": size.verdict}
        low, high = figure(1 - size.reach), figure(1 + size.reach)
        text = (
            f"The normalised estimation error squared, per degree of freedom, is {figure(size.mean)} on average; "
            f"between {low} and {high} the claimed covariance is right: {size.verdict}. {percent(size.inside)} of the "
            "rows lie within their 95 % band."
        )
        blocks.append(Note(text, "good" if size.verdict == "consistent" else "bad"))
    rows = []
    for name, unit in zip(subject.names, subject.units, strict=True):
        if name in rmse:
            each = rmse[name]
            ratio = each["rmse"] / each["sigma"] if each["sigma"] > 0 else None
            rows.append(
                (
                    name,
                    unit,
                    figure(each["rmse"]),
                    figure(each["sigma"]),
                    figure(ratio, 3),
                    figure(each["bias"], 3),
                )
            )
    blocks.append(
        Grid(
            "Error of each state",
            ("state", "unit", "RMSE", "claimed σ", "ratio", "mean error"),
            rows,
            right=(2, 3, 4, 5),
        )
    )
    turning = {error for rotation in subject.spec.rotations for error in rotation.errors}
    for (n, drive, errors), q, m in zip(known, squares, degrees, strict=True):
        blocks.append(_picture(subject, drive, q, m, f"nees{n}"))
        for i, name in enumerate(subject.names[:MOST]):
            if name in turning and np.isfinite(errors[:, i]).any():
                blocks.append(_error(subject, drive, errors[:, i], i, f"e{n}-{i}"))
    return Section("Consistency with the truth", blocks, data)


def nees(drive: Drive, errors: Array) -> tuple[Array, NDArray[np.int64]]:
    """e^T P^-1 e of each row [r] over the states whose truth is known, and its degrees of freedom: directions in which
    the estimate claims to know exactly are left out."""
    some = np.isfinite(errors).any(axis=0)
    e, P = errors[:, some], drive.P[:, some][:, :, some]
    whole = np.isfinite(e).all(axis=1) & np.isfinite(P).all(axis=(1, 2))
    q, m = np.full(len(e), np.nan), np.zeros(len(e), np.int64)
    sigma = np.sqrt(np.maximum(np.einsum("kii->ki", P[whole]), 0.0))
    scale = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=sigma > 0)
    values, vectors = np.linalg.eigh(P[whole] * scale[:, :, None] * scale[:, None, :])
    kept = values > ROUND_OFF * np.maximum(values[:, -1:], 0.0)
    along = np.einsum("kij,ki->kj", vectors, e[whole] * scale)
    q[whole] = np.sum(np.divide(along**2, values, out=np.zeros_like(along), where=kept), axis=1)
    m[whole] = kept.sum(axis=1)
    return q, m


def _rmse(subject: Subject, known: list[tuple[Drive, Array]]) -> dict[str, dict[str, float]]:
    out = {}
    for i, name in enumerate(subject.names):
        e = np.concatenate([errors[:, i] for _, errors in known])
        var = np.concatenate([drive.sigma[:, i] ** 2 for drive, _ in known])
        there = np.isfinite(e)
        if there.any():
            out[name] = {"rmse": float(np.sqrt(np.mean(e[there] ** 2))), "sigma": float(np.sqrt(np.mean(var[there]))),
                         "bias": float(e[there].mean())}  # fmt: skip
    return out


def _picture(subject: Subject, drive: Drive, q: Array, m: NDArray[np.int64], key: str) -> Picture:
    t = drive.trace.work.t
    low, high = statistics.limits(np.array([float(m.max(initial=1))]))

    def draw(axes: Any) -> None:
        axes.plot(*few(t, np.maximum(q, float(low[0]) / 20), 700), ".", color=ESTIMATE, markersize=2)
        for limit in (low, high):
            axes.axhline(float(limit[0]), color=BAD, linewidth=0.9, linestyle="--")
        axes.set_yscale("log")
        axes.set_xlabel("t [s]" if subject.spec.dt is not None else "step")
        axes.set_ylabel("NEES")

    return picture(
        draw, f"NEES, {drive.title}", "normalised estimation error squared over time with its 95 % band", key
    )


def _error(subject: Subject, drive: Drive, error: Array, i: int, key: str) -> Picture:
    t, e, sigma = thin(drive.trace.work.t, error, drive.sigma[:, i], points=300)
    name = subject.names[i]

    def draw(axes: Any) -> None:
        axes.fill_between(t, -2 * sigma, 2 * sigma, color=BAND, alpha=0.35, linewidth=0, label="2 σ")
        axes.plot(t, e, color=ESTIMATE, label="estimate less truth")
        there = np.isfinite(e) & np.isfinite(sigma)
        settled = np.flatnonzero(there)[int(there.sum()) // 20 :]
        if settled.size:  # a wide first band flattens nothing
            reach = 1.1 * max(float(2 * sigma[settled].max()), float(np.abs(e[there]).max()))
            axes.set_ylim(-reach, reach) if reach > 0 else None
        axes.set_xlabel("t [s]" if subject.spec.dt is not None else "step")
        axes.set_ylabel(f"{name} [rad]")

    rms = figure(float(np.sqrt(np.nanmean(error**2))))
    said = f"rotation error over time within two claimed standard deviations; its root mean square is {rms} rad"
    return picture(draw, f"Error {name}, {drive.title}", said, key)
