from __future__ import annotations

from collections.abc import Iterator

import pytest

from kfgen.native import compiler


@pytest.fixture(autouse=True, scope="module")
def _quick_builds() -> Iterator[None]:
    """Integers are the same at every level, which `test_targets` asks of filters of each kind; -O1 compiles sooner."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiler, "DEFAULT_FLAGS", ("-O1",))
        yield
