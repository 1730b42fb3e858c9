"""A view of one mode of a bank."""

from __future__ import annotations

from collections.abc import Callable

from kfgen.reference.algorithm import Estimate
from kfgen.reference.dual import Matrix, Vector
from kfgen.reference.linalg import lower_root
from kfgen.spec.types import Filter


class ModeView:
    """One mode of a bank, as it is at present.

    Attributes (arrays are copies): name; x (n), P (n, n), sqrt_covariance (n, n): the mode's own estimate; nis: of the
    last update that was made;
    R: sensor -> (m, m), Q (n, n): its adapted noise covariances. As in ReferenceFilter.
    """

    def __init__(self, name: str, options: Filter, estimate: Callable[[], Estimate], nis: float) -> None:
        self.name = name
        self.nis = nis
        self._options = options
        self._estimate = estimate

    @property
    def x(self) -> Vector:
        return self._estimate().x.copy()

    @property
    def P(self) -> Matrix:
        return self._estimate().P.copy()

    @property
    def sqrt_covariance(self) -> Matrix:
        if self._options.covariance != "sqrt":
            raise self._missing("sqrt_covariance", "covariance: sqrt")
        return lower_root(self._estimate().P)

    @property
    def R(self) -> dict[str, Matrix]:
        R = self._estimate().adapted.R
        if not R:
            raise self._missing("R", "adapt_R")
        return {name: matrix.copy() for name, matrix in R.items()}

    @property
    def Q(self) -> Matrix:
        Q = self._estimate().adapted.Q
        if Q is None:
            raise self._missing("Q", "adapt_Q")
        return Q.copy()

    def _missing(self, what: str, option: str) -> AttributeError:
        return AttributeError(f"mode {self.name} has no {what}; its filter has no `{option}`")


def is_root(options: Filter) -> bool:
    return options.covariance == "sqrt"


def keeps_points(options: Filter) -> bool:
    return options.sigma_points is not None and not options.sigma_points.redraw
