"""Chi-square quantiles and ln(2 pi) to 30 digits, the same on every machine."""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import mpmath

from kfgen.ir.constants import to_fraction, to_mpf


def log_two_pi() -> Fraction:
    """ln(2 pi)."""
    with mpmath.workdps(60):
        return to_fraction(mpmath.log(2 * mpmath.pi))


@cache
def chi2_quantile(probability: Fraction, degrees: int) -> Fraction:
    """x with P(chi-square of `degrees` degrees of freedom <= x) = probability, 0 < probability < 1.

    Bisection on the regularised lower incomplete gamma function, which is monotone.
    """
    with mpmath.workdps(40):
        p = to_mpf(probability)
        half = mpmath.mpf(degrees) / 2

        def tail(x: mpmath.mpf) -> mpmath.mpf:
            # the upper tail keeps its digits where probability is near 1
            return mpmath.gammainc(half, x / 2, mpmath.inf, regularized=True) - (1 - p)

        high = mpmath.mpf(degrees) + 1
        while tail(high) > 0:
            high *= 2
        low = mpmath.mpf(0)
        for _ in range(120):
            middle = (low + high) / 2
            if tail(middle) > 0:
                low = middle
            else:
                high = middle
        return to_fraction((low + high) / 2)
