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
    data: dict[str, Any] = {"budget": budgets[0], "budget_sigma": _sigma(subject, subject.drives[0])}
    if len(budgets) > 1:
        data["budgets"] = [
            {"log": drive.title, "budget": found, "sigma": _sigma(subject, drive)}
            for drive, found in zip(subject.drives, budgets, strict=True)
        ]
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


def _sigma(subject: Subject, drive: Drive) -> dict[str, float]:
    """Error -> its standard deviation at the end."""
    variances = np.maximum(np.einsum("sii->i", drive.walk.parts), 0.0)
    return {name: float(variance**0.5) for name, variance in zip(subject.names, variances, strict=True)}


def _grid(subject: Subject, drive: Drive, found: dict[str, dict[str, float]]) -> Grid:
    used = [name for name in drive.walk.sources if any(each.get(name, 0.0) >= 5e-4 for each in found.values())]
    rows, bars = [], {}
    sigmas = _sigma(subject, drive)
    for r, (state, unit) in enumerate(zip(subject.names, subject.units, strict=True)):
        row = [state, f"{figure(sigmas[state], 3)} {unit}".strip()]
        for c, name in enumerate(used):
            share = found[state].get(name, 0.0)
            row.append(percent(share) if share >= 5e-4 else "")
            bars[r, c + 2] = share
        rows.append(row)
    caption = f"{drive.title}, after row {drive.walk.rows}"
    return Grid(caption, ("state", "1 σ", *used), rows, right=range(1, len(used) + 2), bars=bars)
