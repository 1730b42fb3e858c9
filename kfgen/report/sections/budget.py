"""The error budget: where each state's variance comes from."""

from __future__ import annotations

from typing import Any

import numpy as np

from kfgen.report.blocks import Block, Grid, Note, Section, figure, percent
from kfgen.report.subject import Drive, Subject

ORDER = 50


def section(subject: Subject) -> Section | None:
    if not subject.drives:
        return None
    blocks: list[Block] = [
        Note(
            "How much of the variance of each state, after the last row that was analysed, comes from each cause, by "
            "linear covariance analysis: each part of the error goes through the filter's own gains by itself. It is "
            "exact for a linear filter, and of first order for a curved one. The shares of a state sum to 1."
        )
    ]
    budgets = [shares(subject, drive) for drive in subject.drives]
    for drive, found in zip(subject.drives, budgets, strict=True):
        blocks.append(_grid(subject, drive, found))
    data: dict[str, Any] = {"budget": budgets[0]}
    return Section("Error budget", blocks, data)


def shares(subject: Subject, drive: Drive) -> dict[str, dict[str, float]]:
    """Error -> source -> share of its variance; causes without a share are left out."""
    walk, out = drive.walk, {}
    variances = np.einsum("sii->si", walk.parts)
    for i, state in enumerate(subject.names):
        total = float(variances[:, i].sum())
        if total <= 0.0:  # known exactly from the start on
            out[state] = {"start": 1.0}
            continue
        out[state] = {name: float(v / total) for name, v in zip(walk.sources, variances[:, i], strict=True) if v > 0}
    return out


def _grid(subject: Subject, drive: Drive, found: dict[str, dict[str, float]]) -> Grid:
    used = [name for name in drive.walk.sources if any(each.get(name, 0.0) >= 5e-4 for each in found.values())]
    variances = np.einsum("sii->i", drive.walk.parts)
    rows, bars = [], {}
    for r, (state, unit, variance) in enumerate(
        zip(subject.names, subject.units, variances, strict=True)
    ):
        row = [state, f"{figure(float(max(variance, 0.0)) ** 0.5, 3)} {unit}".strip()]
        for c, name in enumerate(used):
            share = found[state].get(name, 0.0)
            row.append(percent(share) if share >= 5e-4 else "")
            bars[r, c + 2] = share
        rows.append(row)
    caption = f"{drive.title}, after row {drive.walk.rows}"
    return Grid(caption, ("state", "1 σ", *used), rows, right=range(1, len(used) + 2), bars=bars)
