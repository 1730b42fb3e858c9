"""What a filter costs: cross-compiled and emulated, no board needed."""

from __future__ import annotations

from collections.abc import Sequence

from kfgen.cost.advice import recommended_flags
from kfgen.cost.figures import Cost, FunctionCost
from kfgen.cost.job import ROWS, make_job
from kfgen.cost.targets import target_of, targets
from kfgen.errors import KfgenError
from kfgen.logs import Log
from kfgen.native.emitted import Emitted

__all__ = ["ROWS", "Cost", "FunctionCost", "make_job", "measure", "recommended_flags", "target_of", "targets"]

DEFAULT_TARGET = "cortex-m4f"


def measure(
    emitted: Emitted,
    log: Log,
    target: str = DEFAULT_TARGET,
    flags: Sequence[str] = (),
    *,
    compiler: str | None = None,
    rows: int = ROWS,
) -> Cost:
    """Measure an emitted filter over the first rows of a log.

    flags: of the compiler, beside the usual ones. compiler: `gcc` or `zig`; without, the preferred one that is
    installed. Raises KfgenError for an unknown target, for a missing tool, which it names, and for flags under
    which the filter's own code cannot be told from the rest.
    """
    found = target_of(target).measure(make_job(emitted, log, rows), flags, compiler)
    for name, size in (("the filter", found.flash), *((n, f.flash) for n, f in found.functions.items() if f.counts)):
        if not size:  # the compiler has left something else than sections of the filter's own: -flto, one section
            told = f" with {' '.join(flags)}" if flags else ""
            raise KfgenError(
                f"{found.name}{told}: {name} cannot be found in the linked program, so nothing is known of its size; "
                "leave out -flto and whatever else moves code between files or sections"
            )
    return found
