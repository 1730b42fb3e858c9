from __future__ import annotations

import fcntl
import gc
import json
import os
import shutil
import sys
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest

# matrices here are small: a pool of threads in each test process only makes them wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# where the environment asks for no bytecode, each worker would rewrite every test's asserts and each process that a
# test starts would compile the whole package, at every run anew
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# the default walks a heap full of expressions thousands of times and finds next to nothing
gc.set_threshold(100_000, 20, 10)


def pytest_configure() -> None:
    from kfgen.spec import loading

    # of what tests load they have loaded half before; a spec is frozen
    loading._loads = lru_cache(maxsize=1000)(loading._loads)


def pytest_collection_finish() -> None:
    gc.freeze()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--update", action="store_true", help="rewrite generated/ and the README's C from specs instead of comparing"
    )


@pytest.fixture
def needs():
    """Skips where a program is missing; on the build server that is a failure."""

    def need(*programs: str) -> None:
        missing = [each for each in programs if shutil.which(each) is None]
        if missing:
            message = f"not found: {', '.join(missing)}"
            pytest.fail(message) if os.environ.get("CI") else pytest.skip(message)

    return need


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Callable[[Path], Any]], tuple[Path, Any]]:
    """Writes a folder in one worker of a run only: once(name, write) -> the folder, and what write(folder) returned.

    What is returned must survive JSON. The folder is shared: copy it to work in it.
    """
    base = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        base = base.parent

    def made(name: str, write: Callable[[Path], Any]) -> tuple[Path, Any]:
        folder, answer = base / f"once-{name}", base / f"once-{name}.json"
        with (base / f"once-{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not answer.exists():
                folder.mkdir(exist_ok=True)
                answer.write_text(json.dumps(write(folder)))
        return folder, json.loads(answer.read_text())

    return made
