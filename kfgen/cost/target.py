"""What a target offers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from kfgen.cost.figures import Cost
from kfgen.cost.job import Job


class Target(Protocol):
    """A processor that a filter can be measured on."""

    @property
    def name(self) -> str:
        """As `--target` has it."""
        ...

    @property
    def title(self) -> str:
        """For the reader."""
        ...

    def takes_gcc_flags(self, compiler: str | None = None) -> bool:
        """Whether the compiler that would be used is a gcc, which header advice is for."""
        ...

    def measure(self, job: Job, flags: Sequence[str] = (), compiler: str | None = None) -> Cost:
        """Compile with further flags, run the calls. compiler: `gcc` or `zig`; the preferred one without.

        KfgenError where a tool is missing or fails; it says what to install.
        """
        ...
