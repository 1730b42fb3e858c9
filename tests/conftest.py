from __future__ import annotations

import os

import pytest

# matrices here are small: a pool of threads in each test process only makes them wait for each other
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--update", action="store_true", help="rewrite generated/ and the README's C from specs instead of comparing"
    )
