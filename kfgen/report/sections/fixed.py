"""Fixed point: binary points, ranges, and what is known of overflow."""

from __future__ import annotations

from kfgen.report.blocks import Block, Grid, Note, Section, Text, figure
from kfgen.report.subject import Subject

ORDER = 70


def section(subject: Subject) -> Section | None:
    fixed = subject.generated.fixed
    if fixed is None:
        return None
    quantities = [
        {"name": q.name, "lsb": 2.0**q.e, "largest": q.largest, "headroom_bits": q.headroom}
        for q in fixed.formats.report
    ]
    rows = [(str(q["name"]), f"2^{r.e}", figure(r.largest), str(q["headroom_bits"]))
            for q, r in zip(quantities, fixed.formats.report, strict=True)]  # fmt: skip
    certificate = [
        {"function": c.function, "proved": c.proved, "guarded": c.guarded, "at_risk": c.at_risk, "run": c.run}
        for c in fixed.certificates
        if c.proved or c.guarded or c.at_risk
    ]
    held = [(str(c["function"]), str(c["proved"]), str(c["guarded"]), str(c["at_risk"]) if c["run"] else "not run")
            for c in certificate]  # fmt: skip
    blocks: list[Block] = [
        Grid("Quantities", ("quantity", "value of raw 1", "reckoned up to", "bits above"), rows, right=(1, 2, 3)),
        Note(
            "Proved: the result fits, whatever the filter is given in its declared ranges. Guarded: only runs have "
            "shown it; beyond them the operation saturates and says so. At risk: a run came near what the format holds."
        ),
        Grid("Operations", ("function", "proved", "guarded", "at risk"), held, right=(1, 2, 3)),
        *([Text("Where it holds", fixed.told)] if fixed.told else []),
    ]
    return Section("Fixed point", blocks, {"fixed": {"quantities": quantities, "certificate": certificate}})
