"""The files, and nothing else."""

from __future__ import annotations

from kfgen.layouts import Package


def arrange(package: Package) -> dict[str, str]:
    return dict(package.sources)
