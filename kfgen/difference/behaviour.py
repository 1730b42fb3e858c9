"""Two compiled filters over one track."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from kfgen.difference.interface import changes
from kfgen.errors import KfgenError
from kfgen.geometry import part_of
from kfgen.logs import Log, needed_columns

if TYPE_CHECKING:
    from kfgen.difference.side import Side
    from kfgen.native import NativeFilter, RunResult
    from kfgen.spec.types import Spec

# what two builds of one filter need of each other to be called alike
_CALLED = ("_t.", "_real_t", "_status_t", "_init", "_predict", "_update_", "_get_covariance")


@dataclass(frozen=True)
class Behaviour:
    """states: name -> the largest difference of x in the state's unit, the same in the old filter's standard
    deviations, and the largest relative difference of its variance. calls: function -> rows whose status differs."""

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
    names = [name for name in before[0].states if name in after[0].states]
    states = {name: _difference(name, before, after) for name in names}
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
    (kf,) = load_filters([side.generated])
    return kf, kf.run(replace(log))


def _difference(
    name: str, before: tuple[NativeFilter, RunResult], after: tuple[NativeFilter, RunResult]
) -> tuple[float, float, float]:
    i, j = before[0].states.index(name), after[0].states.index(name)
    with np.errstate(all="ignore"):
        period = _period(before[0].spec, i)
        local = part_of(period).local
        x = np.abs([local(float(a), float(b)) for a, b in zip(after[1].x[:, j], before[1].x[:, i], strict=True)])
        variance = before[1].var[:, i]
        sigma = np.where(x == 0, 0.0, x / np.sqrt(variance))
        apart = np.abs(after[1].var[:, j] - variance)
        relative = np.where(apart == 0, 0.0, apart / variance)
    return _largest(x), _largest(sigma), _largest(relative)


def _largest(values: Any) -> float:
    """NaN is the largest of all."""
    return float(np.max(np.where(np.isnan(values), np.inf, values), initial=0.0))


def _period(spec: Spec, i: int) -> float | None:
    from kfgen.spec.constants import value

    period = spec.states[i].period
    return None if period is None else float(value(period.tree, spec))
