"""The compiler flags that an emitted header recommends."""

from __future__ import annotations

import re


def recommended_flags(header: str) -> list[str]:
    """Those for the filter's file; [] if none."""
    found = re.search(r"^ \*\s+(-O\S.*)$", header, re.MULTILINE)
    return found[1].split() if found else []
