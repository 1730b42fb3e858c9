"""How long `kfgen build` takes in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory


def cold_build(spec: str, repeats: int = 3) -> tuple[float, float]:
    """Seconds of wall clock and of processor time of `kfgen build` on a spec's text: the least of some runs."""
    walls, processor = [], []
    with TemporaryDirectory() as folder:
        path = Path(folder, "spec.yaml")
        path.write_text(spec)
        command = [sys.executable, "-m", "kfgen", "build", str(path), "-o", folder]
        for _ in range(repeats):
            start, before = time.perf_counter(), os.times()
            subprocess.run(command, check=True, capture_output=True)
            after = os.times()
            walls.append(time.perf_counter() - start)
            processor.append(
                after.children_user + after.children_system - before.children_user - before.children_system
            )
    return min(walls), min(processor)
