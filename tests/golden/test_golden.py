"""generated/ is what `kfgen build specs/*.yaml` writes, byte for byte. `pytest --update` rewrites it."""

from __future__ import annotations

import difflib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from kfgen.files import write_all
from kfgen.generate import generate
from kfgen.spec import load

ROOT = Path(__file__).parents[2]
SPECS = sorted((ROOT / "specs").glob("*.yaml"))
GENERATED = ROOT / "generated"
LONGEST = 400  # lines of a diff that are shown


@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_generated_is_up_to_date(path: Path, request: pytest.FixtureRequest) -> None:
    spec = load(path)
    folder = GENERATED / spec.name
    fresh = {folder / name: text for name, text in generate(spec).items()}
    if request.config.getoption("--update"):
        shutil.rmtree(folder, ignore_errors=True)
        write_all(fresh)
    assert _files(folder) == set(fresh), "the files of the folder"
    diff = [line for file, text in fresh.items() for line in _diff(file, text)]
    if diff:
        rest = [f"... {len(diff) - LONGEST} more lines"] if len(diff) > LONGEST else []
        pytest.fail("\n".join([*diff[:LONGEST], *rest, "run `pytest --update` and review the diff"]), pytrace=False)


def test_nothing_else_is_in_generated(request: pytest.FixtureRequest) -> None:
    names = {path.stem for path in SPECS}
    stray = {path for path in GENERATED.iterdir() if path.name not in names}
    if request.config.getoption("--update"):
        for path in stray:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        stray = set()
    assert stray == set()


def test_a_spec_is_named_like_its_file() -> None:
    assert [load(path).name for path in SPECS] == [path.stem for path in SPECS]


@pytest.mark.parametrize("seed", ["2"])
def test_the_same_bytes_in_any_process(seed: str, tmp_path: Path) -> None:
    """Another hash seed, another folder, another locale and clock."""
    environment = {**os.environ, "PYTHONHASHSEED": seed, "LC_ALL": "C", "TZ": f"UTC{seed}"}
    specs = [str(path) for path in SPECS]
    command = [sys.executable, "-m", "kfgen", "build", *specs, "-o", str(tmp_path)]
    subprocess.run(command, cwd=tmp_path, env=environment, check=True, capture_output=True)
    for path in SPECS:
        spec = load(path)
        for name, text in generate(spec).items():
            assert (tmp_path / spec.name / name).read_bytes() == text.encode(), name


def _files(folder: Path) -> set[Path]:
    return set(folder.iterdir()) if folder.is_dir() else set()


def _diff(path: Path, text: str) -> list[str]:
    old = path.read_bytes().decode("utf-8", "replace") if path.exists() else ""
    name = str(path.relative_to(ROOT))
    lines = difflib.unified_diff(old.split("\n"), text.split("\n"), name, f"{name} (fresh)", lineterm="")
    return list(lines)
