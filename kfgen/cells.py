"""The cells of a log's file: CSV in the dialects that people have, and Parquet."""

from __future__ import annotations

import csv
import gzip
import io
import re
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from kfgen.errors import KfgenError

Array = NDArray[np.float64]

STANDARD_INPUT = "-"
EMPTY = frozenset({"", "NA", "N/A", "null"})  # cells without a value, beside nan

# decimal numbers and NaN; float() would also take `1_000`, other scripts' digits and `infinity`
_NUMBER = re.compile(r"[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|nan|inf)", re.ASCII | re.IGNORECASE)
_ODD = re.compile(r"[^0-9eE.+\-naNA]")
_DECIMAL_COMMA = re.compile(r"\s*[-+]?\d*,\d+(?:[eE][-+]?\d+)?\s*", re.ASCII)
_DELIMITERS = {";": "semicolons", "\t": "tabs"}
_LOOKED_AT = 200  # rows in which decimal commas are looked for


class Cells(Protocol):
    """A table of cells. header: names of its columns. rows: how many. said: how it was read, where it is not usual."""

    @property
    def header(self) -> Sequence[str]: ...

    @property
    def rows(self) -> int: ...

    @property
    def said(self) -> tuple[str, ...]: ...

    def column(self, name: str) -> Array:
        """A column's numbers, NaN where a cell is empty; KfgenError where one is no number."""
        ...

    def where(self, row: int) -> str:
        """A row, for a message: file, and line where it has lines."""
        ...


@dataclass(frozen=True)
class CsvCells:
    """The cells of a CSV file; lines: of each row. comma: whether numbers have decimal commas."""

    header: Sequence[str]
    cells: Sequence[Sequence[str]]
    lines: Sequence[int]
    source: str
    comma: bool
    said: tuple[str, ...]

    @property
    def rows(self) -> int:
        return len(self.cells)

    def column(self, name: str) -> Array:
        index = self.header.index(name)
        cells = [row[index].strip() for row in self.cells]
        cells = ["nan" if cell in EMPTY else cell for cell in cells]
        if self.comma:
            cells = [cell.replace(",", ".") for cell in cells]
        try:
            if not any(map(_ODD.search, cells)):
                return np.array(cells, dtype=np.float64)
        except ValueError:
            pass
        for row, cell in enumerate(cells):
            if not _NUMBER.fullmatch(cell):
                raise KfgenError(f"{self.where(row)}: column `{name}`: {cell[:40]!r} is not a number")
        return np.array(cells, dtype=np.float64)

    def where(self, row: int) -> str:
        return f"{self.source}:{self.lines[row]}"


@dataclass(frozen=True)
class ParquetCells:
    """The columns of a Parquet file."""

    table: Any
    header: Sequence[str]
    rows: int
    source: str
    said: tuple[str, ...] = ()

    def column(self, name: str) -> Array:
        try:
            values = [np.nan if value is None else value for value in self.table.column(name).to_pylist()]
            return np.array(values, dtype=np.float64)
        except (TypeError, ValueError):
            raise KfgenError(f"{self.source}: column `{name}` does not hold numbers") from None

    def where(self, row: int) -> str:
        return f"{self.source}, row {row + 1}"


def cells_of(path: Path, source: str) -> Cells:
    """The cells of a file, of standard input (`-`), or of a Parquet file (by its ending).

    A CSV file is UTF-8 with or without a byte-order mark, with a header; semicolons or tabs between the cells, and
    decimal commas beside those, are recognised; one that ends in .gz is unpacked. KfgenError for a file that is no
    table, or has rows of another length.
    """
    cells = _parquet(path, source) if path.suffix.lower() in (".parquet", ".pq") else _csv(path, source)
    doubled = sorted(name for name, times in Counter(cells.header).items() if name and times > 1)
    if doubled:
        raise KfgenError(f"{source}:1: column `{doubled[0]}` occurs twice")
    return cells


def _parquet(path: Path, source: str) -> ParquetCells:
    try:
        from pyarrow import ArrowException, parquet
    except ImportError:
        cure = "install it with `pip install 'kfgen[parquet]'`"
        raise KfgenError(f"{source}: a Parquet log needs pyarrow; {cure}") from None
    if not path.exists():
        raise FileNotFoundError(2, "No such file or directory", str(path))
    try:
        table = parquet.read_table(path)
    except ArrowException as error:
        raise KfgenError(f"{source}: not a Parquet file ({str(error).partition(chr(10))[0]})") from None
    return ParquetCells(table, [str(name) for name in table.column_names], table.num_rows, source)


@contextmanager
def _opened(path: Path) -> Iterator[IO[str]]:
    """A file as text, unpacked where it ends in .gz; `-` is standard input."""
    if path.suffix == ".gz":
        with gzip.open(path, "rt", encoding="utf-8-sig", newline="") as stream:
            yield cast("IO[str]", stream)
    elif str(path) != STANDARD_INPUT:
        with path.open(encoding="utf-8-sig", newline="") as text:
            yield text
    elif sys.stdin is None:
        raise KfgenError("the log is `-`, but there is no standard input")
    else:
        yield io.TextIOWrapper(io.BytesIO(sys.stdin.buffer.read()), encoding="utf-8-sig", newline="")


def _csv(path: Path, source: str) -> CsvCells:
    rows: list[list[str]] = []
    lines: list[int] = []
    reader = None
    try:
        with _opened(path) as stream:
            first = stream.readline()
            delimiter = next((each for each in _DELIMITERS if each in first and "," not in first), ",")
            reader = csv.reader(_again(first, stream), strict=True, delimiter=delimiter)
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
    except (gzip.BadGzipFile, EOFError):
        raise KfgenError(f"{source}: not a packed file, though it ends in .gz") from None
    except UnicodeDecodeError:
        raise KfgenError(f"{source}: not a CSV file (not UTF-8 text)") from None
    except csv.Error as error:
        raise KfgenError(f"{source}:{0 if reader is None else reader.line_num}: not a CSV file ({error})") from None
    if delimiter == ",":
        return CsvCells(header, rows, lines, source, False, ())
    comma = any(_DECIMAL_COMMA.fullmatch(cell) for row in rows[:_LOOKED_AT] for cell in row)
    said = f"cells are taken to be separated by {_DELIMITERS[delimiter]}"
    return CsvCells(header, rows, lines, source, comma, (said + ", numbers to have decimal commas" * comma,))


def _again(first: str, stream: IO[str]) -> Iterator[str]:
    """The lines of a stream whose first has been read."""
    yield first
    yield from stream
