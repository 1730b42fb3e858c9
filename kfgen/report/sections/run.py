"""The run: the estimates along each log, what the filter refused and what it warned of, the modes of a bank."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from kfgen.plot import beside, measured_as
from kfgen.report.blocks import Block, Grid, Note, Picture, Section, figure
from kfgen.report.figures import BAD, BAND, ESTIMATE, MEASURED, MODES, SMOOTH, TRUTH, few, picture, thin
from kfgen.report.subject import Drive, Subject
from kfgen.status import ERROR, Status

ORDER = 30
MOST = 48  # states that are drawn


def section(subject: Subject) -> Section | None:
    if not subject.drives:
        return None
    blocks: list[Block] = []
    logs = []
    for number, drive in enumerate(subject.drives):
        t = drive.trace.work.t
        skipped = f"; at {drive.walk.skipped} calls the model has no finite derivative" if drive.walk.skipped else ""
        whole = "" if drive.walk.rows == len(t) else f"; the first {drive.walk.rows} rows are linearised one by one"
        seconds = "s" if subject.spec.dt is not None else "steps"
        blocks.append(Note(f"{drive.title}: {len(t)} rows, {figure(float(t[-1] - t[0]))} {seconds}{whole}{skipped}."))
        counts = _counts(subject, drive)
        rows = [(f, flag, kind, str(count)) for f, flag, kind, count in counts]
        if rows:
            blocks.append(
                Grid(f"What the filter said, {drive.title}", ("function", "flag", "kind", "times"), rows, right=(3,))
            )
            blocks.append(_events(subject, drive, f"events{number}"))
        blocks += [_state(subject, drive, i, f"x{number}-{i}") for i in range(min(len(subject.states), MOST))]
        if drive.trace.mu is not None:
            blocks.append(_modes(subject, drive, f"mu{number}"))
        logs.append({
            "log": drive.title, "rows": len(t), "rows_linearised": drive.walk.rows,
            "flags": [{"function": f, "flag": flag, "kind": kind, "times": n} for f, flag, kind, n in counts],
            "end": {
                **{name: {"estimate": float(x)} for name, x in zip(subject.states, drive.x[-1], strict=True)},
                **{name: {"estimate": float(drive.x[-1, subject.states.index(name)]), "sigma": float(s)}
                   if name in subject.states else {"sigma": float(s)}
                   for name, s in zip(subject.names, drive.sigma[-1], strict=True)},
            },
        })  # fmt: skip
    return Section("Run", blocks, {"logs": logs})


def _counts(subject: Subject, drive: Drive) -> list[tuple[str, str, str, int]]:
    """Function, flag, error or warning, times."""
    names = ["predict", *(f"update_{sensor.name}" for sensor in subject.spec.measurements)]
    found = []
    for i, function in enumerate(names):
        status = drive.trace.status[drive.trace.sensor == i - 1]
        for flag in Status:
            number = int(np.count_nonzero(status & flag.value)) if flag else 0
            if number:
                found.append((function, str(flag.name), "error" if flag >= ERROR else "warning", number))
    return found


def _axis(subject: Subject) -> str:
    return "t [s]" if subject.spec.dt is not None else "step"


def _state(subject: Subject, drive: Drive, i: int, key: str) -> Picture:
    state, period = subject.spec.states[i], subject.periods[i]
    t, x, spread = drive.trace.work.t, drive.x[:, i], subject.sigma(drive, i)
    sigma = np.zeros(len(t)) if spread is None else spread
    truth = beside(subject.spec, drive.log, drive.x, state.name, f"true.{state.name}")
    smooth = None if drive.smoothed is None else drive.smoothed[:, i]
    lines = [x, sigma, np.full(len(t), np.nan) if truth is None else truth, x if smooth is None else smooth]
    points = max(120, min(500, 9000 // len(subject.states)))
    ts, xs, ss, true, late = thin(t, *lines, points=points)

    def unbroken(values: np.ndarray) -> np.ndarray:
        if period is None:
            return values
        return np.where(np.abs(np.diff(values, prepend=values[:1])) > period / 2, np.nan, values)

    def draw(axes: Any) -> None:
        if spread is not None:
            axes.fill_between(ts, xs - 2 * ss, xs + 2 * ss, color=BAND, alpha=0.35, linewidth=0, label="2 σ")
        for column in measured_as(subject.spec, state.name):
            seen = beside(subject.spec, drive.log, drive.x, state.name, column)
            if seen is not None:
                axes.plot(
                    *few(t, seen, points),
                    ".",
                    color=MEASURED,
                    markersize=2,
                    alpha=0.6,
                    label="measured",
                )
        if truth is not None:
            axes.plot(ts, unbroken(true), color=TRUTH, linestyle="--", linewidth=1, label="truth")
        axes.plot(ts, unbroken(xs), color=ESTIMATE, label="estimate")
        if smooth is not None:
            axes.plot(ts, unbroken(late), color=SMOOTH, linewidth=0.9, label="smoothed")
        low, high = _focus(x, sigma, truth)
        axes.set_ylim(low, high)
        axes.set_xlabel(_axis(subject))
        axes.set_ylabel(state.name + (f" [{state.unit}]" if state.unit else ""))

    said = f"{state.name} over time: from {figure(float(x[0]))} to {figure(float(x[-1]))} {state.unit}"
    if spread is not None:
        said += f", standard deviation at the end {figure(float(sigma[-1]))}"
    return picture(draw, f"{state.name}, {drive.title}", said, key)


def _focus(x: np.ndarray, sigma: np.ndarray, truth: np.ndarray | None) -> tuple[float, float]:
    """Limits of y by where the estimate goes: a wide first band flattens nothing."""
    finite = np.isfinite(x) & np.isfinite(sigma)
    later = np.flatnonzero(finite)[int(finite.sum()) // 20 :]
    if not later.size:
        return 0.0, 1.0
    values = [x[finite], x[later] - 2 * sigma[later], x[later] + 2 * sigma[later]]
    values += [] if truth is None or not np.isfinite(truth).any() else [truth[np.isfinite(truth)]]
    low, high = min(float(v.min()) for v in values), max(float(v.max()) for v in values)
    margin = 0.06 * (high - low) or 0.1 * max(abs(high), 1.0)
    return (low - margin, high + margin) if math.isfinite(margin) else (0.0, 1.0)


def _modes(subject: Subject, drive: Drive, key: str) -> Picture:
    mu, t = drive.trace.mu, drive.trace.work.t
    assert mu is not None
    assert subject.spec.imm is not None
    names = [mode.name for mode in subject.spec.imm.modes]
    rows = mu[np.maximum(drive.trace.last() - 1, 0)]
    ts, *shares = thin(t, *rows.T, points=300)

    def draw(axes: Any) -> None:
        axes.stackplot(ts, *shares, labels=names, colors=MODES[: len(names)], alpha=0.7)
        axes.set_ylim(0, 1)
        axes.set_xlabel(_axis(subject))
        axes.set_ylabel("probability")

    mean = ", ".join(f"{name} {figure(float(m), 2)}" for name, m in zip(names, rows.mean(axis=0), strict=True))
    return picture(draw, f"Modes, {drive.title}", f"the probabilities of the modes over time; on average {mean}", key)


def _events(subject: Subject, drive: Drive, key: str) -> Picture:
    names = ["predict", *(sensor.name for sensor in subject.spec.measurements)]
    t = drive.trace.work.t
    span = (float(t[0]), float(t[-1]))

    def draw(axes: Any) -> None:
        for kind, colour, mark in (("refused or gated", BAD, "x"), ("warning", MEASURED, "|")):
            bad = Status.GATED.value | ~(ERROR - 1)
            where = (drive.trace.status & np.uint32(bad & 0xFFFFFFFF)) != 0
            chosen = np.flatnonzero(where if kind != "warning" else ~where & (drive.trace.status != 0))
            chosen = chosen[:: max(1, -(-len(chosen) // 600))]
            if chosen.size:
                axes.plot(
                    t[drive.trace.row[chosen]],
                    drive.trace.sensor[chosen] + 1,
                    mark,
                    color=colour,
                    markersize=5,
                    label=kind,
                )
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.5, -0.5)
        axes.set_xlim(*span) if span[1] > span[0] else None
        axes.set_xlabel(_axis(subject))

    said = "when calls were refused, gated, or warned; counts are in the table"
    return picture(draw, f"Flags over time, {drive.title}", said, key, (4.9, 0.9 + 0.25 * len(names)))
