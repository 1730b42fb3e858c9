"""A spec with what was generated of it, and where that belongs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kfgen.generate import Generated
    from kfgen.spec.types import Spec


@dataclass(frozen=True)
class Built:
    """A spec, what was generated from it, and where its files belong."""

    spec: Spec
    generated: Generated
    texts: Mapping[str, str]  # below the folder
    folder: Path

    @property
    def files(self) -> dict[Path, str]:
        return {self.folder / name: text for name, text in self.texts.items()}
