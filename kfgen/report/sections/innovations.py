"""The innovations: their size against what is claimed, whether they are white, whether they are normal."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kfgen import statistics
from kfgen.report.blocks import Block, Grid, Note, Picture, Section, figure, percent
from kfgen.report.figures import BAD, ESTIMATE, FAINT, INK, few, picture
from kfgen.report.subject import Drive, Subject
from kfgen.statistics import Band

Array = NDArray[np.float64]

ORDER = 35
WHAT = (
    "The normalised innovation squared, per degree of freedom, is 1 on average where the filter claims what is so; "
    "above, it is too sure of itself (optimistic), below, too cautious. The interval is the 95 % one of the mean, by "
    "the spread and the correlation of the values themselves."
)
BANK = (
    " Of a bank it is that of the combined estimate, by the likeliest mode's sensor, in the rows that were linearised; "
    "the filter's own nis is the smallest of its modes'."
)
DOUBT = 0.01  # a p-value below this
MOST = 24  # components that are drawn


def section(subject: Subject) -> Section | None:
    if not subject.drives:
        return None
    found: dict[str, dict[str, Any]] = {}
    rows: list[tuple[str, ...]] = []
    blocks: list[Block] = []
    told: list[Note] = []
    for i, sensor in enumerate(subject.spec.measurements):
        squares, degrees = (
            np.concatenate(each) for each in zip(*(nis(subject, d, i) for d in subject.drives), strict=True)
        )
        size = statistics.band(squares, degrees)
        if size is None:
            told.append(Note(f"{sensor.name}: no measurement"))
            continue
        white, normal = _white(subject, sensor.name), _normal(subject, sensor.name)
        gated = sum(int((~drive.walk.innovations[sensor.name].taken).sum()) for drive in subject.drives)
        found[sensor.name] = {**size.as_json(), "outside": 1.0 - size.inside, "whiteness_p": white, "rejected": gated,
                              "skewness": normal[0], "excess_kurtosis": normal[1], "normality_p": normal[2],
                              "verdict": size.verdict}  # fmt: skip
        rows.append(_row(sensor.name, size, white, normal))
        told.append(_verdict(sensor.name, size, white))
    head = (
        "sensor",
        "number",
        "mean NIS",
        "consistent within",
        "in 95 % band",
        "whiteness p",
        "skewness",
        "excess",
        "normality p",
    )
    blocks.append(Note(WHAT + (BANK if subject.spec.imm is not None else "")))
    if rows:
        blocks.append(Grid("Normalised innovation squared", head, rows, right=range(1, 9)))
    blocks += told
    for number, drive in enumerate(subject.drives):
        for i, sensor in enumerate(subject.spec.measurements):
            if sensor.name in found and (subject.degrees(drive, i) > 0).any():
                blocks += _pictures(subject, drive, i, f"{number}-{i}")
    return Section("Innovations", blocks, {"nis": found})


def nis(subject: Subject, drive: Drive, i: int) -> tuple[Array, NDArray[np.int64]]:
    """The normalised innovations squared of a sensor, gated ones too, and their degrees of freedom."""
    if subject.spec.imm is None:
        calls = subject.degrees(drive, i)
        return drive.trace.nis[calls > 0], calls[calls > 0]
    seen = drive.walk.innovations[subject.spec.measurements[i].name]
    return np.nansum(seen.e**2, axis=1), np.isfinite(seen.e).sum(axis=1)


def _row(name: str, size: Band, white: float | None, normal: tuple[float | None, ...]) -> tuple[str, ...]:
    low, high = 1 - size.reach, 1 + size.reach
    within = f"{figure(low)} … {figure(high)}"
    tests = [figure(each, 2) for each in (white, *normal)]
    return name, str(size.number), figure(size.mean), within, percent(size.inside), *tests


def _verdict(name: str, size: Band, white: float | None) -> Note:
    cure = {
        "consistent": "the claimed covariance fits",
        "optimistic": "the errors are larger than claimed: more measurement or process noise, or a model error",
        "cautious": "the errors are smaller than claimed: less noise would do",
    }[size.verdict]
    text = f"{name}: {size.verdict} (mean {figure(size.mean, 3)}); {cure}."
    if white is not None and white < DOUBT:
        text += " The innovations are correlated from one to the next: something is not modelled, or the gain is wrong."
    return Note(text, "good" if size.verdict == "consistent" and (white is None or white >= DOUBT) else "bad")


def _white(subject: Subject, name: str) -> float | None:
    """Ljung-Box over the whitened components that were taken, of all logs together."""
    Q, lags = 0.0, 0
    for drive in subject.drives:
        for column in _taken(drive, name).T:
            tested = statistics.ljung_box(column[np.isfinite(column)])
            if tested is not None:
                Q, lags = Q + tested[0], lags + tested[1]
    return statistics.chi2_tail(Q, lags) if lags else None


def _normal(subject: Subject, name: str) -> tuple[float | None, float | None, float | None]:
    values = np.concatenate([_taken(drive, name).ravel() for drive in subject.drives])
    tested = statistics.jarque_bera(values[np.isfinite(values)])
    return (None, None, None) if tested is None else tested


def _taken(drive: Drive, name: str) -> Array:
    seen = drive.walk.innovations[name]
    return seen.e[seen.taken]


def _pictures(subject: Subject, drive: Drive, i: int, key: str) -> list[Picture]:
    sensor = subject.spec.measurements[i]
    out = [_nis(subject, drive, i, f"nis{key}")]
    seen = drive.walk.innovations[sensor.name]
    units = {component.name: component.unit for component in sensor.components}
    for k, name in enumerate(sensor.errors[:MOST]):
        if np.isfinite(seen.y[:, k]).any():
            out.append(
                _innovation(subject, drive, i, k, f"{sensor.name}.{name}", units.get(name, "rad"), f"y{key}-{k}")
            )
    if statistics.lags_of(int(seen.taken.sum())) > 0:
        out.append(_autocorrelation(drive, sensor.name, list(sensor.errors), f"acf{key}"))
    return out


def _axis(subject: Subject) -> str:
    return "t [s]" if subject.spec.dt is not None else "step"


def _nis(subject: Subject, drive: Drive, i: int, key: str) -> Picture:
    if subject.spec.imm is None:
        calls = np.flatnonzero(subject.degrees(drive, i) > 0)
        t = drive.trace.work.t[drive.trace.row[calls]]
    else:
        t = drive.walk.innovations[subject.spec.measurements[i].name].t
    q, m = nis(subject, drive, i)
    keep = np.isfinite(q) & (m > 0)
    t, q, m = t[keep], q[keep], m[keep]
    low, high = statistics.limits(np.array([float(m.max(initial=1))]))
    outside = float(np.mean((q < low) | (q > high))) if q.size else math.nan

    def draw(axes: Any) -> None:
        floor = max(float(low[0]) / 20, 1e-3)
        axes.plot(*few(t, np.maximum(q, floor), 700), ".", color=ESTIMATE, markersize=2, label="NIS")
        for limit in (low, high):
            axes.axhline(float(limit[0]), color=BAD, linewidth=0.9, linestyle="--")
        axes.set_yscale("log")
        axes.set_xlabel(_axis(subject))
        axes.set_ylabel("NIS")

    name = subject.spec.measurements[i].name
    band = f"{figure(float(low[0]))} to {figure(float(high[0]))}"
    said = f"normalised innovation squared over time with its 95 % band, {band}; {percent(outside)} lie outside"
    return picture(draw, f"NIS of {name}, {drive.title}", said, key)


def _innovation(subject: Subject, drive: Drive, i: int, k: int, name: str, unit: str, key: str) -> Picture:
    seen = drive.walk.innovations[subject.spec.measurements[i].name]
    there = np.flatnonzero(np.isfinite(seen.y[:, k]))
    there = there[:: max(1, -(-len(there) // 500))]
    t, y, s, taken = seen.t[there], seen.y[there, k], seen.sigma[there, k], seen.taken[there]

    def draw(axes: Any) -> None:
        axes.fill_between(t, -2 * s, 2 * s, color=FAINT, alpha=0.3, linewidth=0, label="2 σ claimed")
        axes.plot(t[taken], y[taken], ".", color=ESTIMATE, markersize=2.5, label="innovation")
        if not taken.all():
            axes.plot(t[~taken], y[~taken], "x", color=BAD, markersize=4, label="rejected")
        reach = 1.15 * max(
            float(np.quantile(np.abs(y[taken]), 0.995)) if taken.any() else 1.0, 2.5 * float(np.median(s))
        )
        axes.set_ylim(-reach, reach) if reach > 0 else None
        axes.set_xlabel(_axis(subject))
        axes.set_ylabel(name + (f" [{unit}]" if unit else ""))

    spread = figure(float(np.std(y[taken]))) if taken.any() else "–"
    said = f"innovations over time within two claimed standard deviations; their own is {spread} {unit}"
    return picture(draw, f"Innovation {name}, {drive.title}", said, key)


def _autocorrelation(drive: Drive, name: str, components: list[str], key: str) -> Picture:
    e = _taken(drive, name)
    bound, columns = 1.0, []
    for k, component in enumerate(components):
        values = e[np.isfinite(e[:, k]), k]
        lags = statistics.lags_of(len(values))
        if lags:
            columns.append((component, statistics.autocorrelation(values, lags)))
            bound = statistics.normal_quantile(0.975) / math.sqrt(len(values))

    def draw(axes: Any) -> None:
        width = 0.8 / max(len(columns), 1)
        for j, (component, r) in enumerate(columns):
            x = np.arange(1, len(r) + 1) + (j - (len(columns) - 1) / 2) * width
            axes.bar(x, r, width, color=ESTIMATE if j % 2 == 0 else FAINT, label=component)
        for sign in (-bound, bound):
            axes.axhline(sign, color=BAD, linewidth=0.9, linestyle="--")
        axes.axhline(0, color=INK, linewidth=0.6)
        axes.xaxis.get_major_locator().set_params(integer=True)
        axes.set_xlabel("lag, measurements")
        axes.set_ylabel("autocorrelation")

    largest = max((float(np.abs(r).max()) for _, r in columns), default=0.0)
    most = f"white ones stay within {figure(bound, 2)}, the largest is {figure(largest, 2)}"
    return picture(draw, f"Autocorrelation of {name}, {drive.title}", f"of the whitened innovations; {most}", key)
