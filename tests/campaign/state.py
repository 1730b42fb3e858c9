"""What a campaign has done so far, in a folder, so that another run goes on where one ended."""

from __future__ import annotations

import json
import os
import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from tests.campaign.generate import text_of
from tests.campaign.model import Data


@dataclass
class Failure:
    """A failure as a worker hands it back: the spec as smallest found, and what was called."""

    kind: str
    seed: int
    data: Data
    where: str  # segment and call, or call of the track
    calls: str  # the sequence, as the driver printed it


@dataclass
class Result:
    """What became of one batch of seeds."""

    batch: int
    counts: dict[str, int] = field(default_factory=dict)
    refused: dict[str, int] = field(default_factory=dict)  # message -> how often
    kinds: dict[str, int] = field(default_factory=dict)  # failures by kind
    scalars: dict[str, int] = field(default_factory=dict)
    unfollowed: dict[str, int] = field(default_factory=dict)
    failures: list[Failure] = field(default_factory=list)


class State:
    """Totals and the batches done, kept in `state.json`; failures in `failures/<kind>/`."""

    PARTS = ("counts", "refused", "kinds", "scalars", "unfollowed")

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.done: set[int] = set()
        self.totals: dict[str, Counter[str]] = {part: Counter() for part in self.PARTS}
        folder.mkdir(parents=True, exist_ok=True)
        if self._file.exists():
            kept = json.loads(self._file.read_text())
            self.done = set(kept["done"])
            for part in self.PARTS:
                self.totals[part].update(kept[part])

    @property
    def _file(self) -> Path:
        return self.folder / "state.json"

    def add(self, result: Result) -> None:
        """Take in a batch; the file is replaced as a whole."""
        if result.batch in self.done:
            return
        self.done.add(result.batch)
        for part in self.PARTS:
            self.totals[part].update(getattr(result, part))
        for failure in result.failures:
            self.keep(failure)
        text = json.dumps(
            {"done": sorted(self.done), **{part: dict(self.totals[part]) for part in self.PARTS}}, indent=1
        )
        beside = self._file.with_suffix(".new")
        beside.write_text(text)
        os.replace(beside, self._file)

    def keep(self, failure: Failure) -> Path:
        """The spec, with the kind and the seed above it, and beside it the calls."""
        folder = self.folder / "failures" / slug(failure.kind)
        folder.mkdir(parents=True, exist_ok=True)
        spec = {key: value for key, value in failure.data.items() if key != "campaign"}
        path = folder / f"s{failure.seed}.yaml"
        path.write_text(f"# {failure.kind}\n# seed {failure.seed}, {failure.where}\n{text_of(spec)}")
        if failure.calls:
            path.with_suffix(".calls").write_text(failure.calls)
        return path

    def next_batches(self, count: int) -> list[int]:
        """The first batches that are not done."""
        found: list[int] = []
        batch = 0
        while len(found) < count:
            if batch not in self.done:
                found.append(batch)
            batch += 1
        return found

    def report(self) -> str:
        """Specs, calls, failures by kind."""
        counts = self.totals["counts"]
        lines = [
            f"specs {counts['specs']} ({', '.join(f'{v} {k}' for k, v in sorted(self.totals['scalars'].items()))}), "
            f"refused {counts['refused']}",
            f"hostile and fair calls {counts['calls']:.3e}: OK {counts['ok']:.2e}, warned {counts['warned']:.2e}, "
            f"refused {counts['refused_calls']:.2e}",
            f"calls beside the reference {counts['compared']}; the second oracle followed {counts['followed']} specs",
            f"failing specs {counts['failing']}; failures by kind (specs):",
        ]
        lines += [f"  {often:6d}  {kind}" for kind, often in self.totals["kinds"].most_common()] or ["  none"]
        for part, title in (("refused", "refused"), ("unfollowed", "not followed by the second oracle")):
            if self.totals[part]:
                lines.append(f"{title}:")
                lines += [f"  {often:6d}  {text}" for text, often in self.totals[part].most_common(12)]
        return "\n".join(lines)


def slug(kind: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", kind.lower()).strip("-")[:60]
