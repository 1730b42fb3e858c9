"""The cost: per function, on the target."""

from __future__ import annotations

from typing import Any

from kfgen.report.blocks import Block, Grid, Note, Section, figure
from kfgen.report.subject import Subject

ORDER = 60


def section(subject: Subject) -> Section | None:
    summary = subject.generated.summary
    blocks: list[Block] = []
    if summary.rows:
        names = list(dict.fromkeys(op for _, counts in summary.rows for op in counts))
        rows = [(function, *(str(counts.get(op, "")) for op in names)) for function, counts in summary.rows]
        blocks.append(
            Grid("Arithmetic operations of the code", ("function", *names), rows, right=range(1, len(names) + 1))
        )
    operations = {function: dict(counts) for function, counts in summary.rows}
    data: dict[str, Any] = {"operations": operations, "ram": summary.ram, "cost": None}
    blocks.append(Note(f"A filter takes {summary.ram} bytes of RAM."))
    if subject.no_cost:
        blocks.append(Note(f"Not measured on a target: {subject.no_cost}"))
        data["cost_missing"] = subject.no_cost
    if subject.cost:
        data["cost"] = subject.cost
        blocks += _measured(subject)
    return Section("Cost", blocks, data)


def _measured(subject: Subject) -> list[Block]:
    blocks: list[Block] = []
    plain, recommended = subject.cost, subject.cost.get("recommended")
    for found, flags in ((plain, "-O2 -fno-math-errno"), (recommended, "with the flags that the header recommends")):
        if not found:
            continue
        head = ["function", f"mean {found['unit']}", "worst", "flash", "stack"]
        rows = []
        for function, each in found["functions"].items():
            mean = "not called" if each["mean"] is None else figure(each["mean"], 6)
            rows.append([function, mean, figure(each["worst"], 6), str(each["flash"]), str(each["stack"])])
            if subject.mhz is not None:
                rows[-1].insert(3, figure(each["microseconds_estimate"], 3))
        if subject.mhz is not None:
            head.insert(3, f"µs at {subject.mhz:g} MHz")
        blocks.append(Grid(f"{found['target']}, {found['compiler']}: {flags}", head, rows, right=range(1, len(head))))
        blocks.append(
            Note(
                f"Flash {found['flash']} bytes, {found['flash_linked']} with the library functions that it calls; RAM "
                f"{found['ram']} bytes a filter; stack {found['stack']} bytes. Counted in an emulator; a time is an "
                "estimate that leaves out caches and the wait states of a flash."
            )
        )
    return blocks
