"""What a form of the covariance offers to the filters: one protocol, whether it is emitted straight or in loops.

A new form is a folder beside `ud`, `full` and `sqrt`: how it is stored, and a class of these methods for each way to
emit it. `P` is how a form holds a covariance while a function is traced: factors, entries, local arrays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, Protocol, Self, TypeVar

from kfgen.filters.algebra.limits import Limits
from kfgen.filters.algebra.linalg import Rows, Vector
from kfgen.filters.algebra.numbers import Number
from kfgen.filters.algebra.symmetric import Symmetric
from kfgen.filters.base import Block
from kfgen.filters.covariance.noise import Additive
from kfgen.filters.covariance.parts import Columns, Gain, Gatherer, Gathering, Mixer, Motion, Removal, Scalar
from kfgen.ir.program import Function
from kfgen.ir.trace import Array, Trace, Value

P = TypeVar("P")


class Form(Protocol[P]):
    """A covariance of n states in the filter's inner order: how it is stored, predicted, updated."""

    n: int
    title: str  # "U D U^T"
    order: list[int]  # inner position -> state of the spec
    reorders: bool  # whether that order is the generator's choice, for the header to tell
    factored: bool  # whether it is kept as factors; so then is an adapted Q or R
    group: int  # scalar measurements that are best updated together
    indexed: bool  # whether steps read its fields by counters, so that what stands for them has to be an array

    @property
    def tables(self) -> Mapping[str, tuple[int, ...]]:
        """Of indices that its code looks up; known when the functions have been traced."""
        ...

    # in the struct

    def blocks(self, P0: list[list[Fraction]], names: Sequence[str]) -> list[Block]:
        """The fields of the struct that hold it, with the values of P0 (n, n). names: of the states."""
        ...

    def named(self, blocks: list[Block]) -> list[Block]:
        """The same fields; without names for their numbers where these are read by counters."""
        ...

    def get(self, t: Trace, i: Value, j: Value) -> Value:
        """P_ij of the struct for loop counters i <= j."""
        ...

    def put(self, t: Trace, P: Array, factors: Array) -> None:
        """Store a covariance given as the upper triangle of P and of its factors (D on the diagonal, U above)."""
        ...

    def functions(self, taken: frozenset[str], outdated: str) -> list[Function]:
        """Further functions of the filter that this form offers. outdated: as in CovarianceCode."""
        ...

    def load(self, t: Trace) -> P:
        """The covariance as it stands in the struct."""
        ...

    def kept(self, t: Trace, x: list[Value], before: list[Value]) -> list[Value]:
        """The new state (n,) until it is stored: as it is, or in a local array."""
        ...

    def store(self, t: Trace, P: P, names: list[str], after_predict: bool) -> None:
        """Into the struct. names: of the states, for the locals."""
        ...

    # steps

    def predict(self, t: Trace, P: P, F: Rows, Q: Additive, noise: list[tuple[Vector, Value]]) -> P:
        """F P F^T + Q + sum of d w w^T over the noise columns (w, d). F: (n, n)."""
        ...

    def at_rest(self, t: Trace, P: P) -> Motion:
        """No motion, before P is updated."""
        ...

    def update(self, t: Trace, P: P, measurements: list[Scalar], motion: Any) -> tuple[P, Sequence[Gain]]:
        """Scalar measurements one after another, at most `group`. motion: by those before, from at_rest on. The P that
        is given stays as it is."""
        ...

    def plain(self) -> Self:
        """The same form, without what `consider` and `gain_limit` make of gains."""
        ...

    def entries(self, P: P) -> Symmetric:
        """P as a dense matrix; what is not asked for is not computed."""
        ...

    def variance(self, P: P, h: Vector) -> Number:
        """h P h^T, not below zero."""
        ...

    def inflated(self, P: P, a: Number) -> P:
        """a P."""
        ...

    def tolerance(self, P: P, h: Vector) -> Value | int:
        """How far below zero h P h^T may come out by round-off."""
        ...

    def limit(self, t: Trace, P: P, floors: Limits, ceilings: Limits, epsilon: Fraction) -> P:
        """variance_floor and variance_ceiling of P_ii, floors first, flagged REGULARIZED. epsilon: of the scalar."""
        ...

    def evidence(self, P: P, after_predict: bool) -> list[Value]:
        """Values that, together with x and nis, are finite only if all of P is."""
        ...

    # sigma points

    def root(self, t: Trace, P: P, tolerance: Fraction, stored: bool, in_loops: bool) -> Array | Columns:
        """A root of P: an array with its columns one after another, in the spec's order, or its columns.

        A pivot up to `tolerance` of its diagonal is a direction without spread. stored: P is that of the struct, which
        loops may then read; in_loops: whether they are to.
        """
        ...

    def gatherer(self, t: Trace, Q: Additive, noise: list[tuple[Vector, Value]], how: Gathering) -> Gatherer[P]:
        """What takes deviations in, from Q and the columns (w, d) of noise that is not additive on."""
        ...

    def downdated(self, t: Trace, P: P, c: Vector, s: Number, how: Removal, prior: P) -> tuple[P, Value]:
        """P - c c^T / s, s > 0, and the condition under which that is indefinite beyond round-off.

        prior: P before all of an update, to which round-off is relative.
        """
        ...

    def bounded(self, t: Trace, P: P, prior: P, share: Value, tolerance: Fraction) -> tuple[P, Value]:
        """P after a whole vector, of which P_jj >= share prior_jj is known, and whether it may be round-off: where the
        share is below `tolerance`. limit_correlations is then called when P has been stored."""
        ...

    def limit_correlations(self, t: Trace) -> None:
        """Of the P that has been stored: |P_ij| <= sqrt(P_ii P_jj)."""
        ...

    def loosen(self, t: Trace) -> None:
        """Forget the correlations of the P in the struct, where it was found that rounding has spoilt them."""
        ...

    def indefinite(self, P: P, tolerance: Fraction) -> tuple[P, list[Value]]:
        """P, and conditions under which a pivot of it is negative by more than rounding leaves."""
        ...

    # mixtures

    def straight(self) -> Straight[Any]:
        """The same covariance in straight-line code."""
        ...

    def mixer(self, forms: Sequence[Form[Any]]) -> Mixer | None:
        """What mixes this covariance with those of other modes in loops; None: it is done entry by entry."""
        ...


class Straight(Form[P], Protocol[P]):
    """A form in straight-line code, of which all numbers can be had."""

    def factors(self, P: P) -> tuple[Rows, Vector]:
        """U, D with U D U^T = P; fresh lists, since they are built upon."""
        ...

    def columns(self, P: P) -> list[tuple[Vector, Number]]:
        """P as a sum of d w w^T over columns (w, d)."""
        ...

    def from_factors(self, t: Trace, U: Rows, D: Vector) -> P:
        """U D U^T."""
        ...

    def from_entries(self, P: Symmetric) -> P:
        """A dense matrix."""
        ...


class Solving(Form[P], Protocol[P]):
    """A form that gives P^-1 c: what a sequential filter of sigma points regresses by."""

    def solved(self, t: Trace, P: P, columns: list[Vector], tolerance: Fraction) -> Rows:
        """P^-1 c for each of some c (n,); nothing of directions without spread, up to `tolerance` of the variance."""
        ...
