from __future__ import annotations

import os

import pytest

from tests.benchmarks.tools import missing


@pytest.fixture(scope="session")
def _tools() -> None:
    if missing():
        message = f"not found: {', '.join(missing())}"
        pytest.fail(message) if os.environ.get("CI") else pytest.skip(message)
