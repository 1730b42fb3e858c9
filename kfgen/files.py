"""Files that appear whole or not at all: written beside their place, flushed to disk, then renamed."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO


def write_all(files: Mapping[Path, str | bytes]) -> None:
    """Write several files; none is replaced before all of them are safely on the disk.

    Missing folders are made. Text is written as UTF-8 with `\\n` line ends on every platform. Raises OSError.
    """
    written: list[tuple[Path, Path]] = []  # (temporary, target)
    try:
        for path, content in files.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            with _beside(path) as (temporary, stream):
                written.append((temporary, path))
                stream.write(content.encode() if isinstance(content, str) else content)
        for temporary, path in written:
            os.replace(temporary, _real(path))
    finally:
        for temporary, _ in written:
            with suppress(FileNotFoundError):
                temporary.unlink()


@contextmanager
def writing(path: Path) -> Iterator[IO[bytes]]:
    """A binary stream whose content appears at `path` when the block ends without an exception.

    What is not a regular file (`/dev/null`, a pipe) is written to directly: renaming would replace the
    device.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        with path.open("wb") as stream:
            yield stream
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary: Path | None = None
    try:
        with _beside(path) as (temporary, stream):
            yield stream
        os.replace(temporary, _real(path))
        temporary = None
    finally:
        if temporary is not None:
            with suppress(FileNotFoundError):
                temporary.unlink()


@contextmanager
def _beside(path: Path) -> Iterator[tuple[Path, IO[bytes]]]:
    target = _real(path)
    if target.is_dir():
        raise IsADirectoryError(21, "is a folder, not a file", str(path))
    temporary = target.with_name(f".{target.name[:80]}.{secrets.token_hex(6)}.tmp")
    try:
        stream = temporary.open("xb")
    except OSError as error:  # name what the user asked for, not the temporary file
        raise OSError(error.errno, error.strerror, str(path)) from None
    with stream:
        yield temporary, stream
        stream.flush()
        os.fsync(stream.fileno())


def _real(path: Path) -> Path:
    """Where a path leads: a symbolic link stays one, its target is replaced."""
    return Path(os.path.realpath(path))
