"""The outputs: what the firmware reads, along each log, with their standard deviations."""

from __future__ import annotations

from typing import Any

import numpy as np

from kfgen.report.blocks import Block, Picture, Section, figure
from kfgen.report.figures import BAND, ESTIMATE, picture, thin
from kfgen.report.subject import Drive, Subject
from kfgen.spec.types import Output

ORDER = 32
MOST = 24  # that are drawn


def section(subject: Subject) -> Section | None:
    if not subject.drives or not subject.spec.outputs:
        return None
    blocks: list[Block] = [
        _picture(subject, drive, output, f"out{number}-{i}")
        for number, drive in enumerate(subject.drives)
        for i, output in enumerate(subject.spec.outputs[:MOST])
    ]
    last = subject.drives[0]
    end = {}
    for output in subject.spec.outputs:
        value, deviation = _along(last, output.name)
        end[output.name] = {"value": float(value[-1]), "sigma": float(deviation[-1])}
    return Section("Outputs", blocks, {"outputs": end})


def _along(drive: Drive, name: str) -> tuple[np.ndarray, np.ndarray]:
    """The value and its standard deviation after each row."""
    rows = drive.trace.last() - 1
    known = rows >= 0
    value, deviation = (
        np.where(known, numbers[name][np.maximum(rows, 0)], np.nan)
        for numbers in (drive.trace.outputs, drive.trace.output_std)
    )
    return value, deviation


def _picture(subject: Subject, drive: Drive, output: Output, key: str) -> Picture:
    value, deviation = _along(drive, output.name)
    t, y, s = thin(drive.trace.work.t, value, deviation)

    def draw(axes: Any) -> None:
        axes.fill_between(t, y - 2 * s, y + 2 * s, color=BAND, alpha=0.35, linewidth=0, label="2 σ")
        axes.plot(t, y, color=ESTIMATE, label="value")
        there = value[np.isfinite(value)]
        low, high = (float(there.min()), float(there.max())) if there.size else (0.0, 1.0)
        reach = 3 * float(np.nan_to_num(np.nanmedian(deviation))) if np.isfinite(deviation).any() else 0.0
        if high - low + reach > 0 and np.isfinite(high - low + reach):
            axes.set_ylim(low - reach - 0.06 * (high - low), high + reach + 0.06 * (high - low))
        axes.set_xlabel("t [s]" if subject.spec.dt is not None else "step")
        axes.set_ylabel(output.name + (f" [{output.unit}]" if output.unit else ""))

    said = f"{output.name} over time; at the end {figure(float(value[-1]))} {output.unit}, its standard deviation "
    return picture(draw, f"{output.name}, {drive.title}", f"{said}{figure(float(deviation[-1]))}", key)
