"""Chi-square quantiles against SciPy."""

from __future__ import annotations

from fractions import Fraction

import pytest
from scipy.stats import chi2

from kfgen.quantiles import chi2_quantile


@pytest.mark.parametrize("degrees", [1, 2, 3, 6, 12, 40])
@pytest.mark.parametrize("probability", ["0.001", "0.5", "0.95", "0.997", "0.999", "0.999999"])
def test_against_scipy(probability, degrees):
    expected = chi2.ppf(float(probability), degrees)
    if float(probability) > 0.9:  # where 1 - p has fewer digits than p
        expected = chi2.isf(float(1 - Fraction(probability)), degrees)
    assert float(chi2_quantile(Fraction(probability), degrees)) == pytest.approx(expected, rel=1e-12)


def test_known_values():
    assert float(chi2_quantile(Fraction("0.999"), 1)) == pytest.approx(10.827566170662733, rel=1e-15)
    assert float(chi2_quantile(Fraction("0.997"), 1)) == pytest.approx(8.807468393511947, rel=1e-14)
    # two degrees of freedom: -2 ln(1 - p)
    assert float(chi2_quantile(1 - Fraction(1, 1024), 2)) == pytest.approx(20 * 0.6931471805599453, rel=1e-15)
