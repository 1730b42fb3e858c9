"""What a filter costs: cross-compiled and emulated, no board needed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from kfgen.cost.advice import recommended_flags
from kfgen.cost.figures import Cost, FunctionCost
from kfgen.cost.job import ROWS, make_job
from kfgen.cost.targets import target_of, targets
from kfgen.logs import Log
from kfgen.spec.types import Spec

__all__ = ["ROWS", "Cost", "FunctionCost", "make_job", "measure", "recommended_flags", "target_of", "targets"]

DEFAULT_TARGET = "cortex-m4f"


def measure(
    spec: Spec,
    files: Mapping[str, str],
    log: Log,
    target: str = DEFAULT_TARGET,
    flags: Sequence[str] = (),
    *,
    compiler: str | None = None,
    rows: int = ROWS,
) -> Cost:
    """Measure emitted files (`<name>.h`, `<name>.c`) over the first rows of a log.

    flags: of the compiler, beside the usual ones. compiler: `gcc` or `zig`; without, the preferred one that is
    installed. Raises KfgenError for an unknown target and for a missing tool, which it names.
    """
    return target_of(target).measure(make_job(spec, files, log, rows), flags, compiler)
