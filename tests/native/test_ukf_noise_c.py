"""Noise inputs that unscented filters carry as dimensions of their points, in the emitted C: against what is known
of products of Gaussians, and where their variance is none.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from calling import Calls
from sigma_cases import FORMS, points, unscented
from variants import built

from kfgen.native import NativeFilter
from kfgen.reference import reference
from kfgen.status import ERROR, describe

# x of relative uncertainty 0.05 grows by a random 5 %; so does its reading
GROWTH = """
kfgen: 1
name: growth
scalar: double
states: {x: {init: 10, std: 0.5}}
noise: {w: {std: 0.05}}
dynamics: {form: discrete, f: {x: x*(1 + w)}}
measurements:
  s:
    z: {z: {h: x*(1 + v)}}
    noise: {v: {std: 0.05}}
filter: {type: ukf}
"""


@pytest.mark.parametrize("form", FORMS)
def test_a_product_of_gaussians(form):
    """Mean and variance in closed form, and of a million samples, within 1 %; of the reading likewise."""
    mean, variance = 10.0, 0.25
    exact = (variance + mean**2) * (1 + 0.05**2) - mean**2
    random = np.random.default_rng(1)
    x = random.normal(mean, math.sqrt(variance), 1_000_000) * (1 + random.normal(0, 0.05, 1_000_000))
    assert exact == pytest.approx(np.var(x), rel=0.01)
    for kf in built(
        {kind: unscented(GROWTH, form, points(kind)) for kind in ("merwe", "merwe-0.1", "cubature")}
    ).values():
        assert kf.predict() == 0
        assert kf.x[0] == pytest.approx(mean, rel=1e-9)
        assert kf.x[0] == pytest.approx(np.mean(x), rel=0.01)
        assert kf.P[0, 0] == pytest.approx(exact, rel=0.01)
        P = kf.P[0, 0]
        z = x * (1 + random.normal(0, 0.05, len(x)))
        assert kf.update("s", [np.mean(z) + np.std(z)]) == 0
        assert kf.nis == pytest.approx(1, rel=0.02 if form != "sequential" else 0.05)
        assert P - kf.P[0, 0] == pytest.approx(P**2 / np.var(z), rel=0.02)


# w and v multiply: both are carried; e2 adds. Their variances are parameters
FREE = """
kfgen: 1
name: free
scalar: double
parameters: {a: 0.1, b: 0.2, q: 1}
states: {x: {init: 1, var: 0.5}, y: {init: 2, var: 0.25}}
noise: NOISE
dynamics: {form: discrete, f: {x: "x*(1 + w)/q + v*y"}, Q: {x: 0.1, y: 0.1}}
measurements:
  s:
    z: {z: {h: "x*(1 + e1) + e2", var: 0.5}}
    noise: {e1: {var: a}, e2: {var: b}}
filter: {type: ukf}
"""
APART = FREE.replace("NOISE", "{w: {var: a}, v: {var: b}}")
ADDED = APART.replace("+ v*y", "+ v")  # v shifts, and is not carried
TWO = APART.replace('var: 0.5}}\n    noise', 'var: 0.5}, z2: {h: y + 0.5*e2, var: 0.25}}\n    noise')
CORRELATED = FREE.replace("NOISE", "{w: {}, v: {}}\nnoise_covariance: [[a, 0.1], [0.1, b]]")


@cache
def _free(text: str) -> dict[str, NativeFilter]:
    return built({form: unscented(text, form) for form in FORMS})


def differ(text: str, form: str, changes: dict[str, float], update: bool) -> str:
    """How the C departs from the reference, with these parameters; empty: it does not."""
    kf, ref = _free(text)[form].copy(), reference(unscented(text, form))
    kf.init()
    for name, value in changes.items():
        kf.parameters[name] = ref.parameters[name] = value
    before = bytes(kf)
    z = [1.5, 2.0][: len(kf.components("s"))]
    found, truth = (each.update("s", z) if update else each.predict() for each in (kf, ref))
    if found != truth:
        return f"{changes}: {describe(found)} for {describe(truth)}"
    if found >= ERROR:
        return "" if bytes(kf) == before else f"{changes}: the filter has changed"
    close = np.allclose(kf.x, ref.x, rtol=1e-10, atol=0) and np.allclose(kf.P, ref.P, rtol=1e-9, atol=1e-12)
    return "" if close else f"{changes}: {kf.x}, {kf.P} for {ref.x}, {ref.P}"


VALUES = (-1.0, -1e-3, 0.0, 2.0, math.nan, math.inf)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("which", ["apart", "added", "correlated", "measured", "measured two"])
def test_variances_that_are_none(form, which):
    """NOT_FINITE before NOT_POSITIVE, and neither where they are 0; a covariance of 0.1 needs a b of 0.01."""
    texts = {"added": ADDED, "correlated": CORRELATED, "measured two": TWO}
    text, update = texts.get(which, APART), which.startswith("measured")
    cases = [{name: value} for name in ("a", "b") for value in VALUES]
    if not update:
        cases += [{"a": -1.0, "q": 0.0}, {"q": 0.0}, {"a": 0.1, "b": 0.1}, {"a": 0.0099, "b": 1.0}]
    wrong = [each for changes in cases if (each := differ(text, form, changes, update))]
    assert not wrong, "\n".join(wrong)


def test_a_filter_keeps_no_noise():
    """The same step from the same estimate gives the same result, whatever was carried before."""
    for kf in _free(APART).values():
        kf.init()
        calls = Calls(kf)
        assert calls("predict") == 0
        once = bytes(kf)
        kf.init()
        kf.parameters["a"] = 5.0
        assert calls("predict") == 0
        kf.init()
        assert calls("predict") == 0
        assert bytes(kf) == once
