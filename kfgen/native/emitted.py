"""What is needed of a filter to compile and call it; `kfgen.generate.Generated` has it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from kfgen.emit.declarations import Declarations
from kfgen.spec.types import Spec


class Emitted(Protocol):
    """A filter's C (`<name>.h`, `<name>.c` among files), its spec, and what its header declares."""

    @property
    def spec(self) -> Spec: ...

    @property
    def files(self) -> Mapping[str, str]: ...

    @property
    def declarations(self) -> Declarations: ...
