"""The reference filter of an imm: the same interface, and the modes and their probabilities beside it."""

from __future__ import annotations

import numpy as np

from kfgen.reference.algorithm import Estimate
from kfgen.reference.bank import Bank, BankEstimate
from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.filter import ReferenceFilter
from kfgen.reference.linalg import lower_root
from kfgen.spec.types import Filter, Spec


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
        return tuple(ModeView(self, i) for i in range(len(self._names)))

    @property
    def R(self) -> dict[str, Matrix]:
        raise AttributeError(f"filter {self.spec.name} adapts no R of its own; its modes have theirs: modes[i].R")

    @property
    def Q(self) -> Matrix:
        raise AttributeError(f"filter {self.spec.name} adapts no Q of its own; its modes have theirs: modes[i].Q")

    @property
    def _state(self) -> BankEstimate:
        assert isinstance(self._estimate, BankEstimate)
        return self._estimate


class ModeView:
    """One mode of a bank, as it is at present.

    Attributes (arrays are copies): name; x (n), P (n, n), sqrt_covariance (n, n): the mode's own estimate;
    R: sensor -> (m, m), Q (n, n): its adapted noise covariances. As in ReferenceFilter.
    """

    def __init__(self, kf: ReferenceImm, index: int) -> None:
        self._filter, self._index = kf, index
        self.name = kf._names[index]

    @property
    def _estimate(self) -> Estimate:
        return self._filter._state.modes[self._index]

    @property
    def _options(self) -> Filter:
        return self._filter._bank.options[self._index]

    @property
    def x(self) -> Vector:
        return self._estimate.x.copy()

    @property
    def P(self) -> Matrix:
        return self._estimate.P.copy()

    @property
    def sqrt_covariance(self) -> Matrix:
        if self._options.covariance != "sqrt":
            raise self._missing("sqrt_covariance", "covariance: sqrt")
        return lower_root(self._estimate.P)

    @property
    def R(self) -> dict[str, Matrix]:
        R = self._estimate.adapted.R
        if not R:
            raise self._missing("R", "adapt_R")
        return {name: matrix.copy() for name, matrix in R.items()}

    @property
    def Q(self) -> Matrix:
        Q = self._estimate.adapted.Q
        if Q is None:
            raise self._missing("Q", "adapt_Q")
        return Q.copy()

    def _missing(self, what: str, option: str) -> AttributeError:
        return AttributeError(f"mode {self.name} has no {what}; its filter has no `{option}`")
