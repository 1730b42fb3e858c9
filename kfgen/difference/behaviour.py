"""Two compiled filters over one track."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kfgen.apart import differences
from kfgen.difference.interface import changes
from kfgen.errors import KfgenError
from kfgen.logs import Log, needed_columns
from kfgen.spec.sensors import late_columns

if TYPE_CHECKING:
    from kfgen.difference.side import Side
    from kfgen.native import NativeFilter, RunResult

# what two builds of one filter need of each other to be called alike
_CALLED = ("_t.", "_real_t", "_status_t", "_init", "_predict", "_update_", "_get_covariance")


@dataclass(frozen=True)
class Behaviour:
    """states: name -> the largest difference of x in the state's unit, the same in the old filter's standard
    deviations, and the largest relative difference of its variance; of a quaternion the three of its error. calls:
    function -> rows whose status differs."""

    rows: int
    states: Mapping[str, tuple[float, float, float]]
    calls: Mapping[str, int]

    def as_json(self) -> dict[str, Any]:
        keys = ("x", "sigma", "variance")
        found = {name: dict(zip(keys, values, strict=True)) for name, values in self.states.items()}
        return {"rows": self.rows, "states": found, "status": dict(self.calls)}


def behave(old: Side, new: Side, log: Log) -> Behaviour:
    """Run both over a log and compare the states that both have. KfgenError where that cannot be."""
    for side, other in ((old, new), (new, old)):
        if side.whole:
            continue
        apart = [each.item for each in changes(side.header, other.header) if _is_called(each.item)]
        if apart:
            raise KfgenError(f"{side.title} is called otherwise: {', '.join(apart[:4])}")
    before, after = (_run(side, log) for side in (old, new))
    states = _differences(before, after)
    both = [function for function in before[1].calls if function in after[1].calls]
    counts = {name: int(np.count_nonzero(before[1].calls[name] != after[1].calls[name])) for name in both}
    return Behaviour(log.rows, states, {name: count for name, count in counts.items() if count})


def _is_called(item: str) -> bool:
    return any(word in item for word in _CALLED)


def _run(side: Side, log: Log) -> tuple[NativeFilter, RunResult]:
    from kfgen.native import load_filters

    spec = side.generated.spec
    missing = [name for name in needed_columns(spec, log.columns) if name not in log.columns]
    if missing:
        raise KfgenError(f"the track has no column `{missing[0]}`, which {side.title} needs; give one with --log")
    late = spec.history is not None and any(name in log.columns for name in late_columns(spec))
    (kf,) = load_filters([side.generated], history=late)
    return kf, kf.run(replace(log))


def _differences(
    before: tuple[NativeFilter, RunResult], after: tuple[NativeFilter, RunResult]
) -> dict[str, tuple[float, float, float]]:
    """Of the states that both have, a quaternion's by its error as the old filter has it."""
    spec, found = before[0].spec, {}
    known, states = set(after[0].states), after[0].states
    shared = np.full((len(after[1].x), len(spec.states)), np.nan)
    for i, state in enumerate(spec.states):
        if state.name in known:
            shared[:, i] = after[1].x[:, states.index(state.name)]
    errors = after[0].spec.errors
    with np.errstate(all="ignore"):
        apart = np.abs(differences(spec, shared, before[1].x))
        for i, name in enumerate(spec.errors):
            if name not in errors:
                continue
            x, variance = apart[:, i], before[1].var[:, i]
            moved = np.abs(after[1].var[:, errors.index(name)] - variance)
            sigma = np.where(x == 0, 0.0, x / np.sqrt(variance))
            relative = np.where(moved == 0, 0.0, moved / variance)
            found[name] = _largest(x), _largest(sigma), _largest(relative)
    return found


def _largest(values: Any) -> float:
    """NaN is the largest of all."""
    return float(np.max(np.where(np.isnan(values), np.inf, values), initial=0.0))
