"""What commands print as figures, as plain data for `--json`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click
import numpy as np

if TYPE_CHECKING:
    from kfgen.check import Outcome
    from kfgen.commands.built import Built
    from kfgen.native.run import RunResult
    from kfgen.status import Status

json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON, and nothing else on standard output.")


def tell(data: Any) -> None:
    """Print data as JSON; what is not finite is null, which JSON has."""
    click.echo(json.dumps(_finite(data), indent=2, allow_nan=False))


def _finite(data: Any) -> Any:
    if isinstance(data, Mapping):
        return {name: _finite(value) for name, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not np.isfinite(data) else data


def of_build(built: Sequence[Built]) -> list[dict[str, Any]]:
    """A filter each; flash and stack as predicted for a Cortex-M4F."""
    return [_filter(each) for each in built]


def _filter(each: Built) -> dict[str, Any]:
    spec, summary = each.spec, each.generated.summary
    found = summary.prediction
    functions = {
        name: {
            "flash": found.flash.get(name), "stack": found.stack.get(name), "operations": dict(counts),
            "form": summary.forms.get(name),
        }
        for name, counts in summary.rows
    }  # fmt: skip
    return {
        "name": spec.name, "scalar": spec.scalar, "states": len(spec.states), "errors": len(spec.errors),
        "inputs": len(spec.inputs), "sensors": {s.name: len(s.components) for s in spec.measurements},
        "ram": summary.ram, "predicted": dict(found.totals), "functions": functions, "notes": list(summary.notes),
        "files": [str(path) for path in each.files],
    }  # fmt: skip


def of_check(outcome: Outcome) -> dict[str, Any]:
    """error_x in standard deviations, error_P relative to sqrt(P_ii P_jj)."""
    return {
        "name": outcome.name, "scalar": outcome.scalar, "passed": outcome.passed, "tolerance": outcome.tolerance,
        "steps": outcome.steps, "calls": outcome.calls, "not_compared": outcome.lost + outcome.outside,
        "error_x": {"error": outcome.x.error, "where": outcome.x.where},
        "error_P": {"error": outcome.P.error, "where": outcome.P.where},
        "differences": list(outcome.differences), "coarse": list(outcome.coarse),
        "certificate": list(outcome.certificate),
    }  # fmt: skip


def of_run(result: RunResult) -> dict[str, Any]:
    """What the filter refused and warned of, the mean NIS of each sensor, and what came late."""
    nis = {name: float(np.nanmean(n)) for name, n in result.nis.items() if not np.isnan(n).all()}
    late = {name: dict(zip(("count", "mean", "most"), found, strict=True)) for name, found in result.late().items()}
    return {
        "rows": len(result.t), "errors": _named(result.counts(True)), "warnings": _named(result.counts(False)),
        "nis": nis, "late": late,
    }  # fmt: skip


def _named(counts: Mapping[str, Mapping[Status, int]]) -> dict[str, dict[str, int]]:
    return {name: {str(flag.name): number for flag, number in found.items()} for name, found in counts.items()}
