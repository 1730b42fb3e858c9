"""Logs: CSV files with the columns `t`, `<input>`, `<sensor>.<component>`; an empty cell: no measurement."""

from __future__ import annotations

import csv
import io
import os
import re
import sys
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from difflib import get_close_matches
from itertools import islice
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kfgen.errors import KfgenError
from kfgen.files import writing
from kfgen.spec.types import Spec

Array = NDArray[np.float64]

# decimal numbers and NaN; float() would also take `1_000`, other scripts' digits and `infinity`
_NUMBER = re.compile(r"[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|nan|inf)", re.ASCII | re.IGNORECASE)
_CHUNK = 1 << 14  # rows that are turned into text at a time
STANDARD_INPUT = "-"
_FEW = 1000  # names among which a misspelt one is looked for
_RATE, _GAP, _GAPS = 0.05, 1.5, 0.01  # of dt: by how much the usual step may differ, what is a gap; how many may be
_ODD = re.compile(r"[^0-9eE.+\-naNA]")


@dataclass(frozen=True)
class Log:
    """Columns of equal length, NaN where a cell is empty.

    columns: name -> float64 [rows]. ignored: names of columns the spec does not know (`true.*` is never among
    them). source: the file, for messages.
    """

    columns: Mapping[str, Array]
    rows: int
    source: str = "<log>"
    ignored: tuple[str, ...] = field(default=())


Source = Log | Mapping[str, ArrayLike] | str | os.PathLike[str]


def held(column: Array, name: str, source: str) -> Array:
    """An input's column whose empty cells take the last value before them; KfgenError where the first is empty."""
    there = ~np.isnan(column)
    if column.size and not there[0]:
        raise KfgenError(f"{source}: input `{name}` is empty in the first row; there is no value to keep")
    last = np.maximum.accumulate(np.where(there, np.arange(column.size), 0))
    return column[last]


def needed_columns(spec: Spec, known: Collection[str] | None = None) -> list[str]:
    """The columns a log must have: `t` for a run-time dt, all inputs, all components of all sensors.

    known: the columns there are, where a sensor of which none is there need not be there at all.
    """
    run_time = spec.dt is not None and spec.dt.run_time
    needed = [*(["t"] if run_time else []), *(each.name for each in spec.inputs)]
    for sensor in spec.measurements:
        names = [f"{sensor.name}.{each.name}" for each in sensor.components]
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


def read(path: str | os.PathLike[str], spec: Spec) -> Log:
    """Read a CSV file: UTF-8 with or without a byte-order mark, a header row, columns in any order.

    `nan` counts as empty, blank lines are skipped. KfgenError (`file:line: ...`) for a missing column, a cell
    that is no number, a row of another length, a file that is no CSV or holds no rows; OSError if it cannot
    be read.
    """
    source = "standard input" if os.fspath(path) == STANDARD_INPUT else os.fspath(path)
    header, rows, lines = _cells(Path(path), source)
    needed = needed_columns(spec)
    _require(header, needed, source)
    if not rows:
        raise KfgenError(f"{source}: the log has a header but no rows")
    wanted = [name for name in header if name in needed or name == "t" or name.startswith("true.")]
    columns = {name: _column(name, header.index(name), rows, lines, source) for name in wanted}
    ignored = tuple(name for name in header if name not in columns)
    if "t" in columns:
        _check_times(columns["t"], lines, source)
    return Log(columns, len(rows), source, ignored)


@contextmanager
def _opened(path: Path) -> Iterator[IO[str]]:
    """A file as text; `-` is standard input."""
    if str(path) != STANDARD_INPUT:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            yield stream
    elif sys.stdin is None:
        raise KfgenError("the log is `-`, but there is no standard input")
    else:
        yield io.TextIOWrapper(io.BytesIO(sys.stdin.buffer.read()), encoding="utf-8-sig", newline="")


def _cells(path: Path, source: str) -> tuple[list[str], list[list[str]], list[int]]:
    rows: list[list[str]] = []
    lines: list[int] = []
    try:
        with _opened(path) as stream:
            reader = csv.reader(stream, strict=True)
            header = [name.strip() for name in next(reader, [])]
            if not any(header):
                raise KfgenError(f"{source}: the log is empty; its first line must name the columns")
            for row in reader:
                if len(row) != len(header):
                    if not any(cell.strip() for cell in row):
                        continue
                    message = f"{len(row)} cells, but the header has {len(header)}"
                    raise KfgenError(f"{source}:{reader.line_num}: {message}")
                rows.append(row)
                lines.append(reader.line_num)
    except UnicodeDecodeError:
        raise KfgenError(f"{source}: not a CSV file (not UTF-8 text)") from None
    except csv.Error as error:
        raise KfgenError(f"{source}:{reader.line_num}: not a CSV file ({error})") from None
    doubled = sorted(name for name, times in Counter(header).items() if name and times > 1)
    if doubled:
        raise KfgenError(f"{source}:1: column `{doubled[0]}` occurs twice")
    return header, rows, lines


def _require(known: Collection[str], needed: Sequence[str], source: str) -> None:
    missing = [name for name in needed if name not in known]
    if not missing:
        return
    text = f"{source}: column {', '.join(f'`{name}`' for name in missing)} is missing"
    some = list(islice(known, _FEW))
    close = [name for each in missing[:_FEW] for name in get_close_matches(each, some, 1)]
    if len(known) == 1 and re.search(r"[;\t]", next(iter(known))):
        text += "; the columns must be separated by commas"
    elif close:
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


def _column(name: str, index: int, rows: Sequence[Sequence[str]], lines: Sequence[int], source: str) -> Array:
    cells = [row[index].strip() or "nan" for row in rows]
    try:
        if not any(map(_ODD.search, cells)):
            return np.array(cells, dtype=np.float64)
    except ValueError:
        pass
    for cell, line in zip(cells, lines, strict=True):
        if not _NUMBER.fullmatch(cell):
            raise KfgenError(f"{source}:{line}: column `{name}`: {cell[:40]!r} is not a number")
    return np.array(cells, dtype=np.float64)


def _check_times(t: Array, lines: Sequence[int], source: str) -> None:
    wrong = np.flatnonzero(~np.isfinite(t))
    if wrong.size:
        raise KfgenError(f"{source}:{lines[wrong[0]]}: column `t`: the time is empty or not finite")


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
