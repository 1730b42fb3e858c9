"""Random specs of every kind, each from a seed, and how they are written."""

from __future__ import annotations

import json
import random

from tests.campaign.model import Data, Draw
from tests.campaign.options import options

FLOW = ("filter", "dt", "code", "initialize", "fixed")


def text_of(data: Data) -> str:
    """A spec as YAML that a reader can follow: one line an entry, the entries as JSON."""
    lines: list[str] = []
    for key, value in data.items():
        if isinstance(value, dict) and value and key not in FLOW:
            lines.append(f"{key}:")
            lines += [f"  {name}: {json.dumps(entry)}" for name, entry in value.items()]
        else:
            lines.append(f"{key}: {json.dumps(value)}")
    return "\n".join(lines) + "\n"


def draw(seed: int) -> Data:
    """The spec of a seed."""
    drawn = Draw(random.Random(seed))
    data = drawn.spec(f"s{seed}")
    options(drawn, data)
    return data
