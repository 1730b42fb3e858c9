from __future__ import annotations

import gc
import os
import shutil
import sys

import pytest

# matrices here are small: a pool of threads in each test process only makes them wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# where the environment asks for no bytecode, each worker would rewrite every test's asserts and each process that a
# test starts would compile the whole package, at every run anew
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# the default walks a heap full of expressions thousands of times and finds next to nothing
gc.set_threshold(100_000, 20, 10)


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
