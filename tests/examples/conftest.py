"""The specs in specs/, run as firmware would run them, over recorded logs."""

from __future__ import annotations

import os

# the matrices are small: threads of the linear algebra library only wait for each other, where tests run in
# parallel for a hundred times as long
os.environ["OPENBLAS_NUM_THREADS"] = "1"

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import kfgen
from kfgen.logs import Log, read
from kfgen.native import NativeFilter
from kfgen.simulate import simulate
from tests.recorded import log_file

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    # one folder for all workers of a run: they share what they build
    base = tmp_path_factory.getbasetemp()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base.parent / "kfgen-test-cache"))
        yield


@pytest.fixture(scope="session")
def build() -> Callable[..., NativeFilter]:
    """Compiles specs/<name>.yaml; each call gives an initialised filter of its own."""
    return lambda name, **overrides: kfgen.compile(ROOT / "specs" / f"{name}.yaml", **overrides)


@pytest.fixture(scope="session")
def recorded() -> Callable[[NativeFilter, str], Log]:
    """A recorded log, read for a filter."""

    def find(kf: NativeFilter, name: str) -> Log:
        return read(log_file(name), kf.spec)

    return find


@pytest.fixture(scope="session")
def consistency() -> Callable[..., tuple[float, float]]:
    """Mean NEES at the end of simulated runs per state, mean NIS per component: both 1 for a right filter."""

    def measure(kf: NativeFilter, steps: int, seeds: int) -> tuple[float, float]:
        nees, nis = [], []
        for seed in range(seeds):
            log = simulate(kf.spec, steps, seed=seed)
            kf.init()
            result = kf.run(log)
            error = kf.x - truth(kf, log)[-1]
            nees.append(error @ np.linalg.solve(kf.P, error) / error.size)
            nis += [values / len(kf.components(sensor)) for sensor, values in result.nis.items()]
        return float(np.mean(nees)), float(np.nanmean(np.concatenate(nis)))

    return measure


def truth(kf: NativeFilter, log: Log) -> NDArray[np.float64]:
    """[rows, n] the true states of a simulated log."""
    return np.column_stack([log.columns[f"true.{name}"] for name in kf.states])
