"""Pictures of a run: estimates with their 2-sigma bands, measurements, and the truth where the log has it."""

from __future__ import annotations

import io
import math
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kfgen.errors import KfgenError
from kfgen.files import write_all
from kfgen.logs import Log
from kfgen.spec.constants import value
from kfgen.spec.tree import Name
from kfgen.spec.types import Output, Spec

if TYPE_CHECKING:
    from kfgen.native.run import RunResult

Array = NDArray[np.float64]

ESTIMATE, BAND, MEASURED, TRUTH = "#1f5fa8", "#9dc1e8", "#d9822b", "#2f2f2f"
_POSITIONS = (("px", "py"), ("x", "y"), ("pn", "pe"), ("east", "north"), ("e", "n"), ("pos_x", "pos_y"),
              ("p_x", "p_y"), ("p_e", "p_n"), ("p_east", "p_north"), ("pos_e", "pos_n"))  # fmt: skip
_MOST_POINTS = 20_000


def require_matplotlib() -> None:
    """KfgenError where matplotlib is not installed."""
    if find_spec("matplotlib") is None:
        raise KfgenError("--plot needs matplotlib; install it with `pip install kfgen[plot]`")


def draw(path: Path, spec: Spec, log: Log, result: RunResult) -> None:
    """Draw a run into `path`, whose ending chooses the format (png, svg, pdf); KfgenError for another.

    One panel a state over time, and one an output; states that are two coordinates of a position (px, py; x, y; east,
    north) have a panel of their track; a bank has its modes' probabilities.
    """
    require_matplotlib()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    form = path.suffix.lstrip(".").lower() or "png"
    known = FigureCanvasAgg.get_supported_filetypes()
    if form not in known:
        raise KfgenError(f"{path}: cannot draw a .{form} file; end it in .png, .svg or .pdf")
    track = position(spec)
    panels = len(spec.states) + len(spec.outputs) + (result.mu is not None)
    rows = max(panels, 3) if track else panels
    size = (14.0 if track else 9.0, min(1.0 + 1.75 * rows, 60.0))
    figure = Figure(figsize=size, dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(rows, 2, width_ratios=(1.35, 1)) if track else figure.add_gridspec(rows, 1)
    keep = _thinned(len(result.t))
    first = None
    for i in range(len(spec.states)):
        axes = figure.add_subplot(grid[i, 0], sharex=first)
        first = first or axes
        _state(axes, spec, log, result, i, keep)
    for i, output in enumerate(spec.outputs):
        axes = figure.add_subplot(grid[len(spec.states) + i, 0], sharex=first)
        first = first or axes
        _output(axes, output, result, keep)
    if result.mu is not None and spec.imm is not None:
        axes = figure.add_subplot(grid[panels - 1, 0], sharex=first)
        _modes(axes, [mode.name for mode in spec.imm.modes], result.t[keep], result.mu[keep])
    figure.align_ylabels(figure.axes)
    states = figure.axes[: len(spec.states)]
    columns = list(figure.axes)
    for axes in columns[:-1]:
        axes.tick_params(labelbottom=False)
    columns[-1].set_xlabel("t [s]" if spec.dt is not None else "step")
    if track:
        # no taller than three panels: equal axes would only add empty space
        _track(figure.add_subplot(grid[:3, 1]), spec, log, result, track)
    handles: dict[str, Any] = {}
    for axes in states:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(
        handles.values(),
        handles.keys(),
        loc="outside upper right",
        ncols=len(handles),
        frameon=False,
        fontsize=9,
    )
    figure.suptitle(spec.name, x=0.01, ha="left", fontsize=13, fontweight="bold")
    buffer = io.BytesIO()
    # without metadata of the moment: the same run gives the same bytes
    figure.savefig(buffer, format=form, metadata={"Date": None} if form == "svg" else None)
    write_all({path: buffer.getvalue()})


def position(spec: Spec) -> tuple[int, int] | None:
    """The indices of two states that are the coordinates of a position, by their names."""
    index = {state.name.lower(): i for i, state in enumerate(spec.states)}
    for first, second in _POSITIONS:
        if first in index and second in index:
            return index[first], index[second]
    return None


def measured_as(spec: Spec, state: str) -> list[str]:
    """The columns of the components that measure a state directly (`h: px`)."""
    return [
        f"{sensor.name}.{component.name}"
        for sensor in spec.measurements
        for component in sensor.components
        if isinstance(component.h.tree, Name) and component.h.tree.name == state
    ]


def beside(spec: Spec, log: Log, x: Array, state: str, column: str) -> Array | None:
    """A column of a log that tells of a state, beside estimates x [N, nx]; None where there is none.

    q and -q are one rotation: the numbers of a quaternion are those of the two that is nearer to the estimate.
    """
    values = log.columns.get(column)
    mine = next((rotation.parts for rotation in spec.rotations if state in rotation.parts), None)
    if values is None or mine is None:
        return values
    head, _, part = column.partition(".")
    measured = [rotation.parts for sensor in spec.measurements if sensor.name == head for rotation in sensor.rotations]
    theirs = mine if head == "true" else next((parts for parts in measured if part in parts), None)
    if theirs is None or any(f"{head}.{each}" not in log.columns for each in theirs):
        return values
    names = [each.name for each in spec.states]
    whole = np.column_stack([log.columns[f"{head}.{each}"] for each in theirs])
    side = np.einsum("ij,ij->i", x[:, [names.index(each) for each in mine]], whole)
    return np.where(side < 0, -values, values)


def _thinned(rows: int) -> slice:
    return slice(None, None, max(1, math.ceil(rows / _MOST_POINTS)))


def _state(axes: Any, spec: Spec, log: Log, result: RunResult, i: int, keep: slice) -> None:
    state = spec.states[i]
    period = math.inf if state.period is None else float(value(state.period.tree, spec))
    t, x = result.t[keep], result.x[keep, i]
    sigma = np.zeros_like(x)
    if state.name in spec.errors:  # the numbers of a quaternion have no variance of their own
        sigma = np.sqrt(np.maximum(result.var[keep, spec.errors.index(state.name)], 0.0))
    axes.fill_between(t, x - 2 * sigma, x + 2 * sigma, color=BAND, alpha=0.55, linewidth=0, label="2 sigma")
    for column in measured_as(spec, state.name):
        measured = beside(spec, log, result.x, state.name, column)
        if measured is not None:
            _dots(axes, result.t, measured)
    truth = beside(spec, log, result.x, state.name, f"true.{state.name}")
    if truth is not None:
        axes.plot(t, _unbroken(truth[keep], period), color=TRUTH, linewidth=1.0, linestyle="--", label="truth")
    axes.plot(t, _unbroken(x, period), color=ESTIMATE, linewidth=1.3, label="estimate")
    axes.set_ylabel(state.name + (f" [{state.unit}]" if state.unit else ""))
    _focus(axes, x, sigma, truth)
    _plain(axes)


def _output(axes: Any, output: Output, result: RunResult, keep: slice) -> None:
    t, value = result.t[keep], result.outputs[output.name][keep]
    deviation = result.output_std[output.name][keep]
    axes.fill_between(t, value - 2 * deviation, value + 2 * deviation, color=BAND, alpha=0.55, linewidth=0)
    axes.plot(t, value, color=ESTIMATE, linewidth=1.3)
    axes.set_ylabel(output.name + (f" [{output.unit}]" if output.unit else ""))
    _focus(axes, value, deviation, None)
    _plain(axes)


def _focus(axes: Any, x: Array, sigma: Array, truth: Array | None) -> None:
    """Limit y to where the estimate goes: neither a wide first band nor an outlier may flatten the rest."""
    with np.errstate(invalid="ignore"):
        low, high = x - 2 * sigma, x + 2 * sigma
    finite = np.isfinite(low) & np.isfinite(high)
    if not finite.any():
        return
    later = np.flatnonzero(finite)[finite.sum() // 20 :]
    values = [x[finite], low[later], high[later]] + ([] if truth is None else [truth[np.isfinite(truth)]])
    bottom, top = min(map(np.min, values)), max(map(np.max, values))
    margin = 0.06 * (top - bottom) or max(abs(top), 1.0) * 0.1
    axes.set_ylim(bottom - margin, top + margin)


def _dots(axes: Any, t: Array, z: Array) -> None:
    there = np.isfinite(z)
    size = float(np.clip(3000 / max(there.sum(), 1), 3, 16))
    axes.scatter(t[there], z[there], s=size, color=MEASURED, alpha=0.6, linewidths=0, label="measured", zorder=1.5)


def _modes(axes: Any, names: list[str], t: Array, mu: Array) -> None:
    axes.stackplot(t, mu.T, labels=names, alpha=0.75)
    axes.set_ylim(0, 1)
    axes.set_ylabel("mode")
    axes.legend(loc="center left", fontsize=8, framealpha=0.8)
    _plain(axes)


def _track(axes: Any, spec: Spec, log: Log, result: RunResult, track: tuple[int, int]) -> None:
    first, second = (spec.states[i] for i in track)
    columns = [measured_as(spec, state.name) for state in (first, second)]
    for east, north in zip(*columns, strict=False):
        if east in log.columns and north in log.columns:
            _dots(axes, log.columns[east], np.where(np.isnan(log.columns[east]), np.nan, log.columns[north]))
    truth = [log.columns.get(f"true.{state.name}") for state in (first, second)]
    if truth[0] is not None and truth[1] is not None:
        axes.plot(*truth, color=TRUTH, linewidth=1.0, linestyle="--", label="truth")
    axes.plot(result.x[:, track[0]], result.x[:, track[1]], color=ESTIMATE, linewidth=1.3, label="estimate")
    axes.plot(*result.x[0, list(track)], marker="o", color=ESTIMATE, markersize=5, linestyle="none")
    for state, label in ((first, axes.set_xlabel), (second, axes.set_ylabel)):
        label(state.name + (f" [{state.unit}]" if state.unit else ""))
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title("track", fontsize=10)
    _plain(axes)


def _unbroken(x: Array, period: float) -> Array:
    """A periodic line with gaps where it wraps, so that no stroke crosses the panel."""
    return np.where(np.abs(np.diff(x, prepend=x[:1])) > period / 2, np.nan, x)


def _plain(axes: Any) -> None:
    axes.grid(color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.margins(x=0.01)
