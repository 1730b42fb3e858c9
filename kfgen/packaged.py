"""What comes with kfgen beside its code: package data of an installed kfgen, the folders beside it in a checkout."""

from __future__ import annotations

from functools import cache
from importlib.resources import as_file, files
from pathlib import Path


@cache
def texts(folder: str) -> dict[str, str]:
    """Name -> text of the files of a folder, those of its own folders as `sub/name`, in order."""
    with as_file(files("kfgen") / folder) as packaged:
        root = packaged if packaged.is_dir() else Path(__file__).resolve().parents[1] / folder
        paths = sorted(path for path in root.rglob("*") if path.is_file())
        return {path.relative_to(root).as_posix(): path.read_text(encoding="utf-8") for path in paths}
