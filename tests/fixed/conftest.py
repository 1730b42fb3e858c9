from __future__ import annotations

from collections.abc import Iterator

import pytest

from kfgen.native import compiler


@pytest.fixture(autouse=True, scope="module")
def _quick_builds() -> Iterator[None]:
    """Integers, and doubles without contraction, are the same at every level: `test_targets` asks that of all."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiler, "DEFAULT_FLAGS", ("-O1",))
        yield
