"""A whole state or measurement: its parts one after the other, numbers (x) and errors (d) each in their order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from kfgen.geometry.part import Part
from kfgen.geometry.rotation import Rotation


@dataclass(frozen=True)
class Space:
    """Parts: of one number each, or rotations of four numbers and three errors."""

    parts: tuple[Part | Rotation, ...]

    @cached_property
    def rotations(self) -> tuple[tuple[int, int, Rotation], ...]:
        """Where the numbers of each rotation begin, where its errors do, and its geometry."""
        return tuple((i, j, part) for i, j, part in self._places() if isinstance(part, Rotation))

    @cached_property
    def singles(self) -> tuple[tuple[int, int, Part], ...]:
        """The same of parts that are one number."""
        return tuple((i, j, part) for i, j, part in self._places() if not isinstance(part, Rotation))

    @property
    def flat(self) -> bool:
        return all(part.flat for part in self.parts)

    @cached_property
    def size(self) -> int:
        """How many numbers."""
        return len(self.singles) + 4 * len(self.rotations)

    @cached_property
    def dimension(self) -> int:
        """How many errors."""
        return len(self.singles) + 3 * len(self.rotations)

    @cached_property
    def errors_of(self) -> tuple[int | None, ...]:
        """Number -> its error; None for those of a rotation."""
        out: list[int | None] = [None] * self.size
        for i, j, _ in self.singles:
            out[i] = j
        return tuple(out)

    @cached_property
    def numbers_of(self) -> tuple[int | None, ...]:
        """Error -> its number; None for those of a rotation."""
        out: list[int | None] = [None] * self.dimension
        for i, j, _ in self.singles:
            out[j] = i
        return tuple(out)

    def placed(self, x: Sequence[Any]) -> list[Any]:
        """x as it is stored, in its chart."""
        return self._each(x, lambda part, a: part.placed(a))

    def normalised(self, x: Sequence[Any]) -> list[Any]:
        """x in its chart, whatever the norms of its quaternions are."""
        return self._each(x, lambda part, a: part.normalised(a) if isinstance(part, Rotation) else part.placed(a))

    def retract(self, x: Sequence[Any], d: Sequence[Any]) -> list[Any]:
        """x [+] d."""
        out = list(x)
        for i, j, part in self.singles:
            out[i] = part.retract(x[i], d[j])
        for i, j, rotation in self.rotations:
            out[i : i + 4] = rotation.retract(x[i : i + 4], d[j : j + 3])
        return out

    def local(self, a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
        """a [-] b."""
        out: list[Any] = [None] * self.dimension
        for i, j, part in self.singles:
            out[j] = part.local(a[i], b[i])
        for i, j, rotation in self.rotations:
            out[j : j + 3] = rotation.local(a[i : i + 4], b[i : i + 4])
        return out

    def _each(self, x: Sequence[Any], change: Any) -> list[Any]:
        out = list(x)
        for i, _, part in self.singles:
            out[i] = change(part, x[i])
        for i, _, rotation in self.rotations:
            out[i : i + 4] = change(rotation, x[i : i + 4])
        return out

    def _places(self) -> Iterator[tuple[int, int, Part | Rotation]]:
        i = j = 0
        for part in self.parts:
            yield i, j, part
            i += 4 if isinstance(part, Rotation) else 1
            j += part.dimension
