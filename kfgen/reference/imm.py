"""The reference filter of an imm: the same interface, and the modes and their probabilities beside it."""

from __future__ import annotations

from functools import partial

import numpy as np

from kfgen.reference.algorithm import Estimate
from kfgen.reference.bank import Bank, BankEstimate
from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.filter import ReferenceFilter
from kfgen.reference.mode import ModeView
from kfgen.spec.types import Spec


class ReferenceImm(ReferenceFilter):
    """A bank of filters, in float64 and physical units. As ReferenceFilter, and:

        x (n), P (n, n): of all modes together; sqrt_covariance: that P's, where a mode has `covariance: sqrt`.
        nis: the smallest of the modes' (of the last update, also of a gated one).
        log_likelihood: ln sum_j mu_j exp(l_j) of the last update that was made, mu before it.
        mu (B): the probabilities of the modes; may be set. modes: their own estimates.

    R and Q belong to the modes. set_state, set_covariance and redraw act on all of them, and leave mu.
    """

    def __init__(self, spec: Spec, bank: Bank) -> None:
        assert spec.imm is not None
        self._names = tuple(mode.name for mode in spec.imm.modes)
        self._bank = bank
        super().__init__(spec, bank)

    @property
    def mu(self) -> Vector:
        return self._state.mu.copy()

    @mu.setter
    def mu(self, mu: Vector) -> None:
        self._estimate = self._bank.reweighed(self._estimate, np.array(mu, dtype=np.float64))

    @property
    def modes(self) -> tuple[ModeView, ...]:
        return tuple(
            ModeView(name, options, partial(self._mode_estimate, i), self.nis_of_modes[i])
            for i, (name, options) in enumerate(zip(self._names, self._bank.options, strict=True))
        )

    @property
    def R(self) -> dict[str, Matrix]:
        raise AttributeError(f"filter {self.spec.name} adapts no R of its own; its modes have theirs: modes[i].R")

    @property
    def Q(self) -> Matrix:
        raise AttributeError(f"filter {self.spec.name} adapts no Q of its own; its modes have theirs: modes[i].Q")

    def _mode_estimate(self, index: int) -> Estimate:
        return self._state.modes[index]

    @property
    def _state(self) -> BankEstimate:
        assert isinstance(self._estimate, BankEstimate)
        return self._estimate
