"""Recorded logs, and what other implementations made of some problems: see tests/data/README.md."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

DATA = Path(__file__).parent / "data"
PEERS = DATA / "peers"


def log_file(name: str) -> Path:
    """The file of a recorded log, packed or not."""
    plain = DATA / f"{name}.csv"
    return plain if plain.exists() else DATA / f"{name}.csv.gz"


def peer_rows(name: str) -> NDArray[np.float64]:
    """The rows of a file of a peer's inputs or results."""
    rows: NDArray[np.float64] = np.loadtxt(PEERS / f"{name}.csv.gz", delimiter=",", skiprows=1, ndmin=2)
    return rows
