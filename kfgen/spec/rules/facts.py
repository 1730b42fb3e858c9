"""What the rules share: values of constant formulas, contexts, and places to report at."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import mpmath

from kfgen.errors import Place
from kfgen.spec.constants import NotConstant, environment_of, keep, value, with_parameters
from kfgen.spec.contexts import Context
from kfgen.spec.operations import NoValue, Value, less, real
from kfgen.spec.problems import Problems
from kfgen.spec.raw import BAD
from kfgen.spec.scopes import Scopes
from kfgen.spec.tree import Expression, Tree
from kfgen.spec.types import Covariance, Dynamics, Filter, Matrix, Noise, Sensor, Spec, State
from kfgen.spec.walk import Walker


@dataclass(frozen=True)
class Model:
    """One filter to be built: the whole spec, or one mode of an imm."""

    states: tuple[State, ...]
    covariances: tuple[Covariance, ...]
    P0: Matrix | None
    noise: tuple[Noise, ...]
    noise_covariance: Matrix | None
    dynamics: Dynamics
    measurements: tuple[Sensor, ...]
    filter: Filter
    context: Context
    prefix: str = ""  # of the key paths that are its own


class Facts:
    def __init__(self, walker: Walker, spec: Spec, scopes: Scopes) -> None:
        self.walker, self.spec, self.scopes = walker, spec, scopes
        self.problems: Problems = walker.problems
        self.constant = environment_of(spec, folded=False)
        self.folded = with_parameters(spec, self.constant)
        self.fixed_dt = spec.dt is not None and not spec.dt.run_time
        self._known: dict[int, dict[str, Value]] = {}

    def add(self, place: Place, message: str, hint: str = "") -> None:
        self.problems.add(place, message, hint)

    def at(self, *paths: str, otherwise: Place | None = None) -> Place:
        """The place of the first of some key paths that was written."""
        for path in paths:
            if path in self.walker.keys:
                return self.walker.keys[path]
        return otherwise or self.spec.place

    def written(self, path: str) -> bool:
        return path in self.walker.keys

    def empty(self, path: str) -> bool:
        """Whether a collection was written, could be read, and has nothing in it."""
        return path in self.walker.empty

    def broken(self, path: str) -> bool:
        """Whether the value of a key was written, but could not be read."""
        return path in self.walker.broken

    # --- values

    def known(self, context: Context) -> dict[str, Value]:
        """Values of constants, a fixed dt and the definitions that rest on nothing else."""
        found = self._known.get(id(context))
        if found is None:
            found = dict(self.constant)
            for definition in context.let:
                keep(found, definition.name, definition.value.tree)
            self._known[id(context)] = found
        return found

    def tree(self, tree: Tree, known: dict[str, Value] | None = None) -> Value | None:
        """The value of a constant tree; None where it has none (reported elsewhere if a mistake)."""
        try:
            return value(tree, self.constant if known is None else known)
        except (NotConstant, NoValue):
            return None

    def value(self, expression: Expression | None, known: dict[str, Value] | None = None) -> Value | None:
        if expression is None or expression.tree == BAD:
            return None
        return self.tree(expression.tree, known)

    def check_range(
        self,
        expression: Expression | None,
        what: str,
        low: int | None = None,
        high: int | None = None,
        *,
        strict: bool = True,
    ) -> Value | None:
        """Report a constant outside (low, high), or, not `strict`, outside [low, high]."""
        number = self.value(expression)
        if number is None or expression is None:
            return None
        above = low is None or less(Fraction(low), number, or_equal=not strict)
        below = high is None or less(number, Fraction(high), or_equal=not strict)
        if above and below:
            return number
        if low is not None and high is not None:
            wanted = f"between {low} and {high}" + (" (both excluded)" if strict else "")
        elif low is not None:
            wanted = f"greater than {low}" if strict else f"at least {low}"
        else:
            wanted = f"less than {high}" if strict else f"at most {high}"
        self.add(expression.place, f"{what} is {show(number)}", f"write a number {wanted}")
        return None

    # --- models

    def models(self) -> Iterator[Model]:
        s = self.spec
        if s.imm is None:
            yield Model(
                s.states, s.covariances, s.P0, s.noise, s.noise_covariance, s.dynamics, s.measurements,
                s.filter, self.scopes.contexts[""],
            )  # fmt: skip
            return
        for m in s.imm.modes:
            yield Model(
                m.states, m.covariances, m.P0, m.noise, m.noise_covariance, m.dynamics, m.measurements,
                m.filter, self.scopes.contexts[m.name], f"imm.modes.{m.name}.",
            )  # fmt: skip


def show(number: Value) -> str:
    """A value in a message."""
    text = mpmath.nstr(real(number), 6)
    return str(text.removesuffix(".0"))
