"""A hand-written filter that keeps the contract: what is tested here does not depend on the generator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

import kfgen.native
from kfgen.native import NativeFilter, load_filters
from kfgen.native.compiler import build
from kfgen.spec import load
from kfgen.spec.types import Spec
from tests.native.small import vehicle_small

HERE = Path(__file__).parent


def build_as_one(files: Mapping[str, str], flags: Sequence[str] | None = None) -> Path:
    """Many filters as one unit, which takes half the time: names of one must not clash with those of another.

    That each file compiles on its own is asked where warnings are; a single filter is built as users build it.
    """
    sources = sorted(name for name in files if name.endswith(".c"))
    if len(sources) <= 2 or "vehicle_small.c" in files:  # a filter and its driver; one whose names have no prefix
        return build(files, flags)
    others = {name: text for name, text in files.items() if name not in sources}
    units = {f"{name}.inc": files[name] for name in sources}
    return build({**others, **units, "all.c": "".join(f'#include "{name}"\n' for name in units)}, flags)


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    # one folder for all workers of a run: they share what they build
    base = tmp_path_factory.getbasetemp()
    monkeypatch.setenv("XDG_CACHE_HOME", str(base.parent / "kfgen-test-cache"))
    monkeypatch.setattr(kfgen.native, "build", build_as_one)


@pytest.fixture(scope="session")
def spec() -> Spec:
    return load(HERE / "vehicle_small.yaml")


@pytest.fixture(scope="session")
def files() -> dict[str, str]:
    return dict(vehicle_small(load(HERE / "vehicle_small.yaml")).files)


@pytest.fixture
def kf(spec: Spec) -> NativeFilter:
    return load_filters([vehicle_small(spec)])[0]
