"""A list of numbers some of which are unit quaternions, and its tangent space: three errors in the place of four.

With x a point of n numbers and d an error of k: x [+] d is x + d for a number, q exp(d) for a quaternion with body
error, exp(d) q with reference error; a [-] b is the inverse (Sola 2017, section 4.4; He, Xu & Zhang 2021).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from kfgen.reference import rotations
from kfgen.reference.dual import Matrix, Number, Vector, jacobian, value_of, values, variables
from kfgen.reference.status import Status, StepError
from kfgen.spec.types import Rotation

Numbers = list[Number]
_Turned = Callable[[Sequence[Number], Sequence[Number], Rotation], Numbers]

# a quaternion with a norm below this has no direction that means anything
_SHORTEST = 1e-3


@dataclass(frozen=True)
class Block:
    """Consecutive numbers with their errors: one of each, or four and three. rotation: None for a number."""

    numbers: slice
    errors: slice
    rotation: Rotation | None

    @property
    def number(self) -> int:
        """The index of the first number."""
        return int(self.numbers.start)

    @property
    def error(self) -> int:
        """The index of the first error."""
        return int(self.errors.start)


class Manifold:
    """Attributes: names (n) of the numbers; errors (k), those of the errors; blocks, in order; rotations, those of
    quaternions; real (k): which errors are of numbers."""

    def __init__(self, names: Sequence[str], among: Sequence[Rotation]) -> None:
        self.names = tuple(names)
        self.blocks = tuple(_blocks(self.names, {rotation.parts[0]: rotation for rotation in among}))
        self.rotations = tuple(block for block in self.blocks if block.rotation is not None)
        self.errors = tuple(name for block in self.blocks for name in _errors(self.names, block))
        self.n, self.k = len(self.names), len(self.errors)
        self.real = np.array([not block.rotation for block in self.blocks for _ in _errors(self.names, block)], bool)

    def part(self, used: Sequence[int]) -> Manifold:
        """The same of some of the numbers (indices): those of a quaternion come together, or not at all."""
        if len(used) == self.n:
            return self
        kept = [block.rotation for block in self.rotations if block.rotation is not None and block.number in used]
        return Manifold([self.names[i] for i in used], kept)

    def rows(self, used: Sequence[int]) -> tuple[int, ...]:
        """The errors (indices) of some of the numbers (indices)."""
        wanted = set(used)
        return tuple(
            error for block in self.blocks if block.number in wanted for error in range(self.k)[block.errors]
        )

    def whole(self, wanted: Sequence[int]) -> tuple[int, ...]:
        """Numbers (indices) without the quaternions of which some are missing."""
        chosen = set(wanted)
        return tuple(i for block in self.blocks if chosen.issuperset(b := range(self.n)[block.numbers]) for i in b)

    # --- on numbers with derivatives

    def plus(self, x: Sequence[Number], d: Sequence[Number]) -> Numbers:
        """x [+] d."""
        return self._combined(x, d, _turned)

    def along(self, x: Sequence[Number], d: Sequence[Number]) -> Numbers:
        """x moved by what the body itself does, q exp(d), whichever error a quaternion has."""
        return self._combined(x, d, lambda q, r, _: rotations.product(q, rotations.exponential(r)))

    def minus(self, a: Sequence[Number], b: Sequence[Number]) -> Numbers:
        """a [-] b; what is periodic is not wrapped."""
        result: Numbers = []
        for block in self.blocks:
            if block.rotation is None:
                result.append(a[block.number] - b[block.number])
            else:
                inverse = rotations.conjugate(b[block.numbers])
                pair = (inverse, a[block.numbers]) if _body(block.rotation) else (a[block.numbers], inverse)
                result += rotations.logarithm(rotations.product(*pair))
        return result

    def unwound(self, u: Sequence[Number], rate: Sequence[Number]) -> Numbers:
        """The rate (k) of u where x.along(u) moves at `rate`: see rotations.unwound."""
        result = list(rate)
        for block in self.rotations:
            result[block.errors] = rotations.unwound(u[block.errors], rate[block.errors])
        return result

    def _combined(self, x: Sequence[Number], d: Sequence[Number], turned: _Turned) -> Numbers:
        result: Numbers = []
        for block in self.blocks:
            if block.rotation is None:
                result.append(x[block.number] + d[block.error])
            else:
                result += turned(x[block.numbers], d[block.errors], block.rotation)
        return result

    # --- on vectors

    def moved(self, x: Vector, d: Vector) -> Vector:
        """x [+] d (n), normalised."""
        return self.normalised(values(self.plus(x.tolist(), d.tolist())))

    def difference(self, a: Vector, b: Vector) -> Vector:
        """a [-] b (k)."""
        return values(self.minus(a.tolist(), b.tolist()))

    def normalised(self, x: Vector) -> Vector:
        """x (n) with quaternions of norm 1; one of norm 0 becomes NaN."""
        if not self.rotations:
            return x
        x = x.copy()
        for block in self.rotations:
            x[block.numbers] = x[block.numbers] / math.hypot(*x[block.numbers])
        return x

    def judge(self, x: Vector) -> None:
        """Raises StepError NOT_FINITE, or NOT_POSITIVE where a quaternion in x (n) is too short to be one."""
        if not np.isfinite(x).all():
            raise StepError(Status.NOT_FINITE)
        if any(math.hypot(*x[block.numbers]) < _SHORTEST for block in self.rotations):
            raise StepError(Status.NOT_POSITIVE)

    def around(self, x: Vector) -> Numbers:
        """x [+] d as numbers of the variables d (k) at 0."""
        return self.plus(x.tolist(), at_zero(self.k))

    def transport(self, a: Vector, b: Vector) -> Matrix:
        """d((a [+] d) [-] b)/dd (k, k) at 0: what takes errors at a to errors at b."""
        if not self.rotations:
            return np.eye(self.k)
        return jacobian(self.minus(self.around(a), b.tolist()), self.k)

    def turned(self, d: Vector, always: bool = True) -> Matrix:
        """T (k, k): d log(exp(-d) exp(d + e))/de, or d log(exp(d + e) exp(-d))/de with reference error, the error as
        seen from x [+] d (Mueller, Hehn & D'Andrea 2017). always: also of the rotations with `reset: false`."""
        T = np.eye(self.k)
        for block in self.rotations:
            assert block.rotation is not None
            if always or block.rotation.reset:
                step = d[block.errors]
                moved = rotations.exponential([s + e for s, e in zip(step.tolist(), at_zero(3), strict=True)])
                back = rotations.conjugate(rotations.exponential(step.tolist()))
                pair = (back, moved) if _body(block.rotation) else (moved, back)
                T[block.errors, block.errors] = jacobian(rotations.logarithm(rotations.product(*pair)), 3)
        return T

    def from_body(self, x: Vector) -> Matrix:
        """(k, k): takes what the body sees of its rotations to the errors at x (n): R(q) with reference error."""
        B = np.eye(self.k)
        for block in self.rotations:
            assert block.rotation is not None
            if not _body(block.rotation):
                q = x[block.numbers].tolist()
                B[block.errors, block.errors] = [
                    [value_of(rotations.entry(i, j, q)) for j in range(3)] for i in range(3)
                ]
        return B

    def turning(self, A: Matrix, rate: Vector) -> Matrix:
        """The Jacobian (k, k) of the error's rate as the body sees it, where that of the rate (k) is A: an error e of a
        body that turns at w moves by -w x e."""
        A = A.copy()
        for block in self.rotations:
            x, y, z = rate[block.errors]
            A[block.errors, block.errors] -= np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return A

    def flat(self, x: Vector) -> Vector:
        """The numbers of x (n) in the places of their errors (k); 0 for rotations."""
        return np.array([0.0 if b.rotation else x[b.number] for b in self.blocks for _ in _errors(self.names, b)])

    def size(self, x: Vector) -> Vector:
        """|x| (k) as far as rounding goes by it: 1 for the errors of a quaternion."""
        return np.where(self.real, np.abs(self.flat(x)), 1.0)


def at_zero(k: int) -> Numbers:
    """k variables at 0."""
    return variables([0.0] * k)


def _turned(q: Sequence[Number], d: Sequence[Number], rotation: Rotation) -> Numbers:
    turn = rotations.exponential(d)
    return rotations.product(q, turn) if _body(rotation) else rotations.product(turn, q)


def _body(rotation: Rotation) -> bool:
    return rotation.error == "body"


def _blocks(names: Sequence[str], first: dict[str, Rotation]) -> Iterator[Block]:
    i = k = 0
    while i < len(names):
        rotation = first.get(names[i])
        a, b = (1, 1) if rotation is None else (4, 3)
        yield Block(slice(i, i + a), slice(k, k + b), rotation)
        i, k = i + a, k + b


def _errors(names: Sequence[str], block: Block) -> tuple[str, ...]:
    return (names[block.number],) if block.rotation is None else block.rotation.errors
