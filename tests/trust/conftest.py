from __future__ import annotations

import pytest

from kfgen.report import made
from kfgen.simulate import simulate
from kfgen.spec import loads
from tests.trust.pages import LINEAR


@pytest.fixture(scope="session")
def linear():
    """A linear spec, a log of it, and the report on both."""
    spec = loads(LINEAR)
    log = simulate(spec, 300, 2, {"slow": 3})
    return spec, log, made(spec, [log], target="host")
