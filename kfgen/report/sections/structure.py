"""The structure: what depends on what, the inner order, and what the sensors can tell."""

from __future__ import annotations

import numpy as np

from kfgen.report.blocks import Block, Grid, Note, Pattern, Section, figure, percent
from kfgen.report.observability import Observability, observability
from kfgen.report.subject import Drive, Subject

ORDER = 20


def section(subject: Subject) -> Section:
    code, states = subject.generated.code, list(subject.names)
    blocks: list[Block] = [Note(f"{code.description}, {subject.spec.scalar}.")]
    order = [code.model.errors[i] for i in code.order]
    if order != states:
        blocks.append(Note(f"Inside, the states stand in the order {', '.join(order)}."))
    data: dict[str, object] = {"structure": {"filter": code.description, "order": order}}
    if not subject.drives:
        return Section("Structure", blocks, data)
    first = subject.drives[0]
    walk = first.walk
    blocks.append(Pattern("F: the state after a step depends on", states, states, walk.F_used.tolist()))
    if walk.Q_used.any():
        blocks.append(Pattern("Noise of a step: correlated", states, states, walk.Q_used.tolist()))
    rows = [f"{s.name}.{name}" for s in subject.spec.measurements for name in s.errors]
    blocks.append(Pattern("H: a measurement depends on", rows, states, np.vstack(list(walk.H_used.values())).tolist()))
    found, without = _seen(subject, first)
    blocks += _told(subject, first, found, without)
    data["observability"] = {**found.as_json(), "without": {name: each.as_json() for name, each in without.items()}}
    return Section("Structure", blocks, data)


def _seen(subject: Subject, drive: Drive) -> tuple[Observability, dict[str, Observability]]:
    sigma = np.sqrt(np.maximum(np.diag(drive.trace.P[0]), 0.0))
    H, names = drive.walk.H, subject.names
    whole = observability(list(H.values()), sigma, names)
    parts = {}
    if len(H) > 1:
        parts = {left: observability([rows for name, rows in H.items() if name != left], sigma, names) for left in H}
    return whole, parts


def _told(subject: Subject, drive: Drive, found: Observability, without: dict[str, Observability]) -> list[Block]:
    n = len(subject.names)
    rest = "all are seen" if found.rank == n else f"{n - found.rank} of their combinations are not seen"
    blocks: list[Block] = [
        Note(
            f"Along {drive.title} (rows 1 to {drive.walk.rows}) the sensors tell {found.rank} of {n} directions of the "
            f"state apart: {rest}.",
            "good" if found.rank == n else "bad",
        ),
        Note(
            "A singular value is by how many standard deviations of noise the measurements, all together, differ for a "
            "start that is off by one of its own in that direction; process noise is left out."
        ),
    ]
    rows = [
        ("all sensors", f"{found.rank} of {n}", figure(found.values[0]), figure(found.values[-1]), _direction(found))
    ]
    for name, each in without.items():
        rows.append(
            (
                f"without {name}",
                f"{each.rank} of {n}",
                figure(each.values[0]),
                figure(each.values[-1]),
                _direction(each),
            )
        )
    head = ("sensors", "rank", "largest", "smallest", "weakest direction (share of its square)")
    blocks.append(Grid("Observability", head, rows, right=(1, 2, 3)))
    return blocks


def _direction(found: Observability) -> str:
    most = sorted(found.weakest.items(), key=lambda pair: -pair[1])
    return ", ".join(f"{name} {percent(weight)}" for name, weight in most if weight >= 0.01)
