"""Logs: CSV files with the columns `t`, `<input>`, `<sensor>.<component>`, `<sensor>.<its own input>`; an empty cell:
no measurement."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from itertools import islice
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kfgen.cells import STANDARD_INPUT, cells_of
from kfgen.columns import Columns, Origin
from kfgen.errors import KfgenError
from kfgen.files import writing
from kfgen.spec.sensors import columns_of, late_columns
from kfgen.spec.types import Spec

Array = NDArray[np.float64]

_CHUNK = 1 << 14  # rows that are turned into text at a time
_FEW = 1000  # names among which a misspelt one is looked for
_RATE, _GAP, _GAPS = 0.05, 1.5, 0.01  # of dt: by how much the usual step may differ, what is a gap; how many may be


@dataclass(frozen=True)
class Log:
    """Columns of equal length, NaN where a cell is empty.

    columns: name -> float64 [rows]. ignored: names of columns the spec does not know (`true.*` is never among
    them). source: the file, for messages. said: how it was read, where that is not usual.
    """

    columns: Mapping[str, Array]
    rows: int
    source: str = "<log>"
    ignored: tuple[str, ...] = field(default=())
    said: tuple[str, ...] = field(default=())


Source = Log | Mapping[str, ArrayLike] | str | os.PathLike[str]


def held(column: Array, name: str, source: str) -> Array:
    """An input's column whose empty cells take the last value before them; KfgenError where the first is empty."""
    there = ~np.isnan(column)
    if column.size and not there[0]:
        raise KfgenError(f"{source}: input `{name}` is empty in the first row; there is no value to keep")
    last = np.maximum.accumulate(np.where(there, np.arange(column.size), 0))
    return column[last]


def needed_columns(spec: Spec, known: Collection[str] | None = None) -> list[str]:
    """The columns a log must have: `t` for a run-time dt, all inputs, all components and own inputs of all sensors.

    known: the columns there are, where a sensor of which none is there need not be there at all.
    """
    run_time = spec.dt is not None and spec.dt.run_time
    needed = [*(["t"] if run_time else []), *(each.name for each in spec.inputs)]
    for sensor in spec.measurements:
        names = columns_of(sensor)
        if known is None or any(name in known for name in names):
            needed += names
    return needed


def as_log(source: Source, spec: Spec) -> Log:
    """A Log from a path, a mapping of columns (a dict, a data frame) or a Log. KfgenError says what it lacks.

    Where columns are given in memory, all of a sensor's may be missing: it is never updated. A file must have
    them, since there a misspelt name is likelier.
    """
    if isinstance(source, Log):
        _require(source.columns, needed_columns(spec, source.columns), source.source)
        return source
    if isinstance(source, (str, os.PathLike)):
        return read(source, spec)
    names = list(source.keys())  # a data frame's items() are not what a dict's are
    columns = {str(name): np.asarray(source[name], dtype=np.float64) for name in names}
    lengths = {column.shape for column in columns.values()}
    if len(lengths) > 1 or any(len(shape) != 1 for shape in lengths):
        raise ValueError(f"the columns of a log must be 1-d and of one length, not {sorted(lengths)}")
    _require(columns, needed_columns(spec, columns), "the log")
    return Log(columns, rows=next(iter(lengths))[0] if lengths else 0)


def read(path: str | os.PathLike[str], spec: Spec, columns: Columns | None = None) -> Log:
    """Read a file, in whatever `kfgen.cells` reads: a header, columns in any order; `-` is standard input.

    columns: which of the spec's columns come from others, and in what unit. `nan` and `NA` count as empty, blank lines
    are skipped. KfgenError (`file:line: ...`) for a missing column, a cell that is no number, a row of another length,
    a file that is no table or holds no rows; OSError if it cannot be read.
    """
    source = "standard input" if os.fspath(path) == STANDARD_INPUT else os.fspath(path)
    cells = cells_of(Path(path), source)
    origins = dict(columns or {})
    absent = [(name, origin.name) for name, origin in origins.items() if origin.name not in cells.header]
    if absent:
        name, other = absent[0]
        has = f"the log has: {listed(cells.header)}"
        raise KfgenError(f"{source}: column `{other}`, which `{name}` is to come from, is missing ({has})")
    used = {origin.name for origin in origins.values()}
    known = [*origins, *(name for name in cells.header if name not in used and name not in origins)]
    needed = needed_columns(spec)
    _require(known, needed, source)
    if not cells.rows:
        raise KfgenError(f"{source}: the log has a header but no rows")
    found: dict[str, Array] = {}
    wanted = {*needed, *late_columns(spec), "t"}
    for name in known:
        if name in wanted or name.startswith("true."):
            origin = origins.get(name, Origin(name))
            column = cells.column(origin.name)
            found[name] = column if origin == Origin(origin.name) else column * origin.scale + origin.offset
    ignored = tuple(name for name in known if name not in found)
    if "t" in found:
        wrong = np.flatnonzero(~np.isfinite(found["t"]))
        if wrong.size:
            raise KfgenError(f"{cells.where(int(wrong[0]))}: column `t`: the time is empty or not finite")
    return Log(found, cells.rows, source, ignored, cells.said)


def _require(known: Collection[str], needed: Sequence[str], source: str) -> None:
    missing = [name for name in needed if name not in known]
    if not missing:
        return
    text = f"{source}: column {', '.join(f'`{name}`' for name in missing)} is missing"
    some = list(islice(known, _FEW))
    close = [name for each in missing[:_FEW] for name in get_close_matches(each, some, 1)]
    if close:
        text += f"; did you mean `{close[0]}`?"
    raise KfgenError(f"{text} (the log has: {listed(known) or 'nothing'})")


def listed(names: Collection[str], most: int = 40) -> str:
    """Names for a message; of very many the first."""
    more = f", and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(name[:80] for name in islice(names, most)) + more


def check_rate(log: Log, dt: float) -> None:
    """Whether the rows of a log are steps of a filter with a fixed dt in s, those of equal t one step.

    KfgenError where t falls, where the usual step is not dt, or where rows are missing; a log without t passes.
    """
    if "t" not in log.columns or log.rows < 2:
        return
    steps = np.diff(log.columns["t"])
    cure = "resample the log, let dt be an argument (dt: {nominal: ...}), or run it all the same with --any-rate"
    fallen = np.flatnonzero(steps < 0)
    if fallen.size:
        row = int(fallen[0]) + 1
        before = log.columns["t"][row - 1]
        raise KfgenError(f"{log.source}: t falls in row {row + 1}, from {before:g}; sort the rows by t")
    steps = steps[steps != 0]
    if not steps.size:
        return
    usual = float(np.median(steps))
    if abs(usual - dt) > _RATE * dt:
        units = "; is t in milliseconds? It is in seconds" if abs(usual - 1000 * dt) <= _RATE * 1000 * dt else ""
        raise KfgenError(f"{log.source}: the usual step of t is {usual:g} s, but dt is {dt:g} s{units}; {cure}")
    gaps = int(np.count_nonzero(steps > _GAP * dt))
    if gaps > _GAPS * steps.size:
        raise KfgenError(
            f"{log.source}: {gaps} of {steps.size} steps of t are longer than {_GAP:g} dt (the longest "
            f"{steps.max():g} s, dt is {dt:g} s): rows are missing, and one prediction stands for several; {cure}"
        )


def write(path: Path, columns: Mapping[str, NDArray[np.generic]]) -> None:
    """Write columns of equal length as a CSV file, whole or not at all; see `write_to`."""
    with writing(path) as stream:
        write_to(stream, columns)


def write_to(stream: IO[bytes], columns: Mapping[str, NDArray[np.generic]]) -> None:
    """Write columns as CSV: numbers as short as they read back to the same value, NaN as nothing."""
    stream.write((",".join(columns) + "\n").encode())
    rows = len(next(iter(columns.values()), ()))
    for first in range(0, rows, _CHUNK):
        cells = [_text(column[first : first + _CHUNK]) for column in columns.values()]
        stream.write("".join(",".join(row) + "\n" for row in zip(*cells, strict=True)).encode())


def _text(column: NDArray[np.generic]) -> list[str]:
    text = column.astype(str).tolist()
    return ["" if cell == "nan" else cell for cell in text]
