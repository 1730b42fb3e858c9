"""The model of a bank of filters: a model for each mode, and the Markov chain between them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import sympy

from kfgen.ir.lower import Lowering
from kfgen.ir.trace import Trace
from kfgen.model.first import build_firsts
from kfgen.model.model import Model, SensorModel, build_model
from kfgen.model.symbolic import to_sympy
from kfgen.spec.modes import mode_specs
from kfgen.spec.types import Spec

Symbolic = Any  # a SymPy expression


@dataclass(frozen=True)
class BankModel:
    """B modes over the same n states.

    head: what all have in common, with the combined x0. transition: (B, B), row i from mode i, as written. sensors:
    each sensor as every mode has it.
    """

    head: Model
    modes: tuple[Model, ...]
    names: tuple[str, ...]
    transition: tuple[tuple[Symbolic, ...], ...]
    mu0: tuple[Fraction, ...]
    mu_floor: Fraction

    @property
    def sensors(self) -> tuple[tuple[SensorModel, ...], ...]:
        return tuple(zip(*(model.sensors for model in self.modes), strict=True))

    def lively(self, smallest: Fraction, unit: Fraction = Fraction(0)) -> bool:
        """Whether mu stays above a number whatever happens: after a prediction mu_j >= min_i M_ij, after an update
        mu_j >= mu_floor, but for normalising. unit: what mu is a multiple of; a floor of one lasts."""
        bound = 2 * len(self.modes) * max(smallest, unit)
        least = sympy.Rational(bound.numerator, bound.denominator)
        constant = all(e.is_number and e > least for row in self.transition for e in row)
        floored = self.mu_floor > (0 if unit else bound)
        return constant and floored and all(m > bound for m in self.mu0)


def build_bank(spec: Spec) -> BankModel:
    """Of a validated spec with `imm`. Raises SpecError as `build_model`."""
    imm = spec.imm
    assert imm is not None
    code = replace(spec.code, log_likelihood=True)  # mu is weighed by it
    models = tuple(build_model(replace(mode, code=code)) for mode in mode_specs(spec))
    first = models[0]
    numbers: dict[str, Symbolic] = {}
    for constant in spec.constants:
        numbers[constant.name] = to_sympy(constant.value.tree, numbers)
    names = {**numbers, **first.symbols}
    if first.dt is not None:
        names["dt"] = sympy.Rational(first.dt.numerator, first.dt.denominator)
    lowering = Lowering(Trace(), {})

    def number(tree: Any) -> Fraction:
        value = lowering(to_sympy(tree, numbers)).constant
        assert value is not None
        return value

    mu0 = [number(e.tree) for e in imm.mu0]
    mu = tuple(m / sum(mu0) for m in mu0)
    time = any(model.uses_time() for model in models)
    head = replace(
        first, spec=spec, x0=_combined(models, mu), keeps_time=time, firsts=build_firsts(spec, names),
    )  # fmt: skip
    return BankModel(
        head=head,
        modes=models,
        names=tuple(mode.name for mode in imm.modes),
        transition=tuple(tuple(to_sympy(e.tree, names) for e in row) for row in imm.transition),
        mu0=mu,
        mu_floor=number(imm.mu_floor.tree),
    )


def _combined(models: tuple[Model, ...], mu: tuple[Fraction, ...]) -> tuple[Fraction, ...]:
    """The mean of the modes' x0, about that of the largest weight."""
    heaviest = models[max(range(len(mu)), key=lambda i: (mu[i], -i))]
    out = []
    for k, (part, base) in enumerate(zip(heaviest.parts, heaviest.x0, strict=True)):
        shift = sum((m * part.local(model.x0[k], base) for model, m in zip(models, mu, strict=True)), Fraction(0))
        out.append(base + shift)
    return tuple(out)
