"""A mode of a bank: its filter, and where its fields stand in the struct."""

from __future__ import annotations

from dataclasses import dataclass, replace

from kfgen.filters.bank.trace import Scope
from kfgen.filters.base import Block
from kfgen.filters.kinds.single import SingleFilter
from kfgen.model import Model


@dataclass(frozen=True)
class Mode:
    """blocks: the fields that are the mode's own."""

    name: str
    filter: SingleFilter
    blocks: tuple[Block, ...]

    def scope(self) -> Scope:
        return Scope(self.name, frozenset(block.name for block in self.blocks))

    def fields(self) -> list[Block]:
        """Its blocks as fields of the bank."""
        return [
            replace(block, name=f"modes.{self.name}.{block.name}",
                    entries=tuple(f"{entry}_{self.name}" for entry in block.entries))
            for block in self.blocks
        ]  # fmt: skip

    @property
    def model(self) -> Model:
        return self.filter.model

    def path(self, field: str) -> str:
        return f"kf.modes.{self.name}.{field}"
