"""One of the two that are compared: a spec, or files that were generated from one that is gone."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from kfgen.errors import KfgenError
from kfgen.scalar_names import DOUBLE, FLOAT, is_fixed

if TYPE_CHECKING:
    from kfgen.generate import Generated


@dataclass(frozen=True)
class Side:
    """title: how the user named it. generated: its files, with the spec that tells how to call them. whole: that spec
    is its own."""

    title: str
    generated: Generated
    whole: bool = True

    @property
    def header(self) -> str:
        return self.generated.files[f"{self.generated.spec.name}.h"]


def sides(old: Path, new: Path) -> tuple[Side, Side]:
    """Both, generated. SpecError, KfgenError where neither is a spec or a file is missing."""
    folders = [_is_generated(each) for each in (old, new)]
    if all(folders):
        raise KfgenError("one of the two must be a spec: generated files do not say what a filter is to be run on")
    if folders[0]:
        after = _of_spec(new)
        return _of_files(old, after), after
    before = _of_spec(old)
    return before, _of_files(new, before) if folders[1] else _of_spec(new)


def _is_generated(path: Path) -> bool:
    return path.is_dir() or path.suffix in (".h", ".c")


def _of_spec(path: Path) -> Side:
    from kfgen.generate import build
    from kfgen.spec import load

    return Side(str(path), build(load(path), judge=False))


def _of_files(path: Path, other: Side) -> Side:
    """Files on the disk, to be called as those of the other side are."""
    from kfgen.generate import build

    generated = other.generated
    name = generated.spec.name
    folder = path if path.is_dir() else path.parent
    names = [f"{name}.h", f"{name}.c"]
    missing = [each for each in names if not (folder / each).is_file()]
    if missing:
        raise KfgenError(f"{folder} has no {' and no '.join(missing)}, the files of the filter `{name}`")
    files = {each: (folder / each).read_text(encoding="utf-8", errors="replace") for each in names}
    scalar = _scalar(files[f"{name}.h"], name, generated.spec.scalar)
    if scalar != generated.spec.scalar:
        generated = build(generated.spec, scalar, judge=False)
    return Side(str(path), replace(generated, files=files), whole=False)


def _scalar(header: str, name: str, known: str) -> str:
    found = re.search(rf"typedef\s+(\w+)\s+{name}_real_t\s*;", header)
    if found is None:
        raise KfgenError(f"{name}.h does not declare {name}_real_t: it was not written by kfgen")
    if found.group(1) in (FLOAT, DOUBLE):
        return found.group(1)
    bits = re.search(rf"#define\s+{name.upper()}_FRACTION_BITS\s+(\d+)", header)
    n = int(bits.group(1)) if bits else 16
    return known if is_fixed(known) and known.endswith(f".{n}") else f"q{32 - n}.{n}"
