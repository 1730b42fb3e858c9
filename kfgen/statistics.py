"""What tells whether innovations and errors are what a filter claims: quantiles, bands, whiteness, normality."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, gammaincinv, ndtri

Array = NDArray[np.float64]

TWO_SIDED = 0.95  # of the bands


def chi2_quantile(probability: float, degrees: float) -> float:
    """What a chi-square variable of so many degrees of freedom does not exceed with this probability."""
    return 2.0 * float(gammaincinv(degrees / 2, probability))


def chi2_tail(x: float, degrees: float) -> float:
    """The probability that a chi-square variable exceeds x."""
    return float(chdtrc(degrees, x))


def normal_quantile(probability: float) -> float:
    """That of the standard normal distribution."""
    return float(ndtri(probability))


@dataclass(frozen=True)
class Band:
    """Normalised squares (of innovations or errors) of N vectors against the chi-square distribution.

    mean: per degree of freedom, expected 1. error: its standard error, by the squares themselves, widened by their
    correlation from vector to vector. inside: the share within the two-sided 95 % band of a single vector. number: N.
    """

    mean: float
    error: float
    inside: float
    number: int

    @property
    def reach(self) -> float:
        """Half of the 95 % interval of the mean."""
        return normal_quantile(0.5 + TWO_SIDED / 2) * self.error

    def as_json(self) -> dict[str, float | int | list[float]]:
        """low, high: between which the mean lies where the covariance is right. interval: of the mean."""
        return {
            "mean": self.mean, "low": 1.0 - self.reach, "high": 1.0 + self.reach, "inside": self.inside,
            "interval": [self.mean - self.reach, self.mean + self.reach], "number": self.number,
        }  # fmt: skip

    @property
    def verdict(self) -> str:
        """In a word: what the mean says of the claimed covariance."""
        if abs(self.mean - 1.0) <= self.reach:
            return "consistent"
        return "optimistic" if self.mean > 1.0 else "cautious"


def band(squares: Array, degrees: Array) -> Band | None:
    """Of squares [N] with so many degrees of freedom [N] each; None where there are none."""
    keep = np.isfinite(squares) & (degrees > 0)
    q, m = squares[keep], degrees[keep].astype(np.float64)
    if not q.size:
        return None
    mean = float(q.sum() / m.sum())
    deviations = q - mean * m
    spread = float(deviations @ deviations) if q.size > 1 else float(2.0 * m.sum())
    inflation = 1.0 + 2.0 * float(_positive_run(autocorrelation(deviations, q.size // 4)).sum())
    low, high = limits(m)
    inside = float(np.mean((q >= low) & (q <= high)))
    return Band(mean, math.sqrt(spread * inflation) / float(m.sum()), inside, int(q.size))


def limits(degrees: Array) -> tuple[Array, Array]:
    """The two-sided 95 % band [N] of squares with so many degrees of freedom [N]."""
    tail = (1.0 - TWO_SIDED) / 2
    low, high = (np.asarray(2.0 * gammaincinv(degrees / 2, p), np.float64) for p in (tail, 1.0 - tail))
    return low, high


def _positive_run(values: Array) -> Array:
    """The values up to the first that is not positive: beyond it they are noise."""
    ends = np.flatnonzero(values <= 0.0)
    return values[: int(ends[0])] if ends.size else values


def autocorrelation(values: Array, lags: int) -> Array:
    """Of values [N] without their mean, at lags 1..lags; 0 where they do not vary."""
    deviations = values - values.mean() if values.size else values
    power = float(deviations @ deviations)
    if power <= 0.0:
        return np.zeros(max(lags, 0))
    size = 1 << (2 * len(deviations) - 1).bit_length()
    spectrum = np.fft.rfft(deviations, size)
    products: Array = np.fft.irfft(spectrum * np.conj(spectrum), size)[1 : lags + 1]
    return products / power


def lags_of(number: int) -> int:
    """How many lags a test of N values looks at: min(20, N/5)."""
    return max(0, min(20, number // 5))


def ljung_box(values: Array, lags: int | None = None) -> tuple[float, int] | None:
    """Q and its degrees of freedom, of the hypothesis that values [N] are white (Ljung & Box 1978); None for too few.

    Q = N (N + 2) sum r_k^2 / (N - k) over lags k is chi-square of as many degrees of freedom as there are lags; those
    of independent series add up.
    """
    number = len(values)
    lags = lags_of(number) if lags is None else lags
    if lags < 1 or number <= lags + 1 or float(np.ptp(values)) == 0.0:
        return None
    r = autocorrelation(values, lags)
    return number * (number + 2) * float(np.sum(r**2 / (number - np.arange(1, lags + 1)))), lags


def jarque_bera(values: Array) -> tuple[float, float, float] | None:
    """Skewness, excess kurtosis, and the p-value of the hypothesis that values [N] are normal; None for too few.

    Jarque & Bera 1980: N/6 (skewness^2 + excess^2/4) is chi-square of 2 degrees of freedom.
    """
    number = len(values)
    if number < 8 or float(np.ptp(values)) == 0.0:
        return None
    z = (values - values.mean()) / values.std()
    skewness, excess = float(np.mean(z**3)), float(np.mean(z**4)) - 3.0
    return skewness, excess, chi2_tail(number / 6.0 * (skewness**2 + excess**2 / 4.0), 2)
