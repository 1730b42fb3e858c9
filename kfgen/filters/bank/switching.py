"""The Markov chain of a bank in a trace."""

from __future__ import annotations

import sympy

from kfgen.filters.algebra.dual import Dual, Evaluator
from kfgen.filters.algebra.numbers import assume_positive
from kfgen.filters.bank.trace import BankTrace
from kfgen.filters.frame import guards
from kfgen.filters.steps import process
from kfgen.filters.steps.process import Step
from kfgen.ir.trace import Value
from kfgen.model.bank import BankModel


def switching(t: BankTrace, bank: BankModel, step: Step) -> list[list[Value]]:
    """M (B, B); rows that do not sum to 1 by what they are, are normalised."""
    given = process.parameters_and_inputs(t, bank.head, inputs=False)
    if step.dt is not None:
        given["dt"] = Dual(step.dt)
    evaluator = Evaluator(t, bank.head, given)
    rows = [[evaluator.value(e) for e in row] for row in bank.transition]
    sums = [sum(row[1:], row[0]) for row in rows]
    exact = [sympy.expand(sum(row)) == 1 for row in bank.transition]
    varying = [v for row in rows for v in row if v.constant is None]
    guards.finite(t, varying)
    empty = [total <= 0 for total, ok in zip(sums, exact, strict=True) if not ok]
    guards.positive(t, [*(v < 0 for v in varying), *empty])
    return [
        row if ok else [v / assume_positive(total) for v in row]
        for row, total, ok in zip(rows, sums, exact, strict=True)
    ]
