"""The chi-square quantile, by the inverse of the incomplete gamma function (scipy.stats takes a second to import)."""

from __future__ import annotations

from scipy.special import gammaincinv


def chi2_quantile(probability: float, degrees: int) -> float:
    """What a chi-square variable of so many degrees of freedom does not exceed with this probability."""
    return 2.0 * float(gammaincinv(degrees / 2, probability))
