"""What the measurements of this folder need."""

from __future__ import annotations

import shutil
from importlib.util import find_spec

GCC = "arm-none-eabi-gcc"


def missing() -> list[str]:
    """What this machine does not have: the figures are those of gcc."""
    return [GCC] * (shutil.which(GCC) is None) + [m for m in ("unicorn", "elftools") if find_spec(m) is None]
