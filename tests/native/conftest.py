"""A hand-written filter that keeps the contract: what is tested here does not depend on the generator."""

from __future__ import annotations

from pathlib import Path

import pytest

from kfgen.native import NativeFilter, load_filters
from kfgen.spec import load
from kfgen.spec.types import Spec

HERE = Path(__file__).parent


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    # one folder for all workers of a run: they share what they build
    base = tmp_path_factory.getbasetemp()
    monkeypatch.setenv("XDG_CACHE_HOME", str(base.parent / "kfgen-test-cache"))


@pytest.fixture(scope="session")
def spec() -> Spec:
    return load(HERE / "vehicle_small.yaml")


@pytest.fixture(scope="session")
def files() -> dict[str, str]:
    return {name: (HERE / name).read_text() for name in ("vehicle_small.h", "vehicle_small.c")}


@pytest.fixture
def kf(spec: Spec, files: dict[str, str]) -> NativeFilter:
    return load_filters([(spec, files)])[0]
