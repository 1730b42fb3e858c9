"""Sigma points in filters that are loops throughout, against the reference: numbers, statuses, bytes after an error."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from sigma_cases import CYCLE, HEADING, MULTIPLIED, STEADY_R, join, points, told, unscented
from variants import built, call

from kfgen.generate import build
from kfgen.ir.program import For, walk
from kfgen.native import NativeFilter
from kfgen.reference import reference
from kfgen.spec import loads
from kfgen.spec.types import Spec
from kfgen.status import ERROR

# model, form, options, how far readings jump: all that gathers, draws, takes away and solves
CASES = {
    "plain": (CYCLE, "ud", "", 0),
    "inflated": (CYCLE, "sqrt", "adaptive: {chi2: 1}, adapt_R: 0.05", 2),
    "learnt": (CYCLE, "full", "adapt_R: 0.05, innovation_floor: 0.1", 0),
    "noises": (MULTIPLIED, "ud", "augment: true", 0),
    "one by one": (MULTIPLIED, "sequential", "robust: huber", 3),
    "angles": (HEADING, "sqrt", points("julier"), 0),
    "negative factors": (HEADING, "ud", points("julier-minus"), 0),
    "negative root": (CYCLE, "sqrt", join("variance_floor: 0.001", points("custom-negative")), 0),
    "negative entries": (CYCLE, "full", points("custom-centre"), 1),
    "kept": (CYCLE, "full", points("julier-1", redraw=False), 1),
    "kept weights": (STEADY_R, "ud", points("custom-triangle", redraw=False), 0),
}  # fmt: skip


BENT = """
kfgen: 1
name: bent
scalar: double
dt: 0.1
states: {a: {init: 1, std: 1}, b: {init: 0.3, std: 1}}
covariances: [[a, b, 0.5]]
dynamics: {f: {a: 0.5*a + 0.1*b}, Q: {a: 0.2, b: 0.2}}
measurements:
  angle: {z: {z: {h: 0.5*sin(a) - 2*a, std: 0.1}}}
filter: {type: ukf, covariance: full, adaptive: {chi2: 8}, adapt_R: 0.01}
code: {unroll: none}
"""


def looped(text: str, form: str, options: str) -> Spec:
    spec = unscented(text, form, options)
    return replace(spec, code=replace(spec.code, unroll="none"))


@cache
def filters() -> dict[str, NativeFilter]:
    return built({name: looped(*case[:3]) for name, case in CASES.items()})


@pytest.mark.parametrize("name", CASES)
def test_numbers_are_those_of_the_reference(name):
    text, form, options, jump = CASES[name]
    kf, ref = filters()[name], reference(unscented(text, form, options))
    kf.init()
    for count, (function, arguments) in enumerate(told(text, 12, jump)):
        before = bytes(kf)
        status = call(kf, function, arguments)
        assert status == call(ref, function, arguments), f"call {count}, {function}"
        if status >= ERROR:
            assert bytes(kf) == before
        sigma = np.sqrt(ref.P.diagonal())
        assert np.max(np.abs(kf.x - ref.x) / sigma) < 1e-9, f"call {count}, {function}"
        assert np.max(np.abs(kf.P - ref.P) / np.outer(sigma, sigma)) < 1e-8, f"call {count}, {function}"
        assert abs(kf.nis - ref.nis) < 1e-8 * (1 + ref.nis)


def ring(n: int, options: str) -> Spec:
    """Each state bends into the next."""
    states = ", ".join(f"x{i}: {{init: {i / 10}, std: 0.5}}" for i in range(n))
    f = ", ".join(f'x{i}: "0.9*x{i} + 0.1*sin(x{(i + 1) % n})"' for i in range(n))
    Q = ", ".join(f"x{i}: 0.01" for i in range(n))
    return loads(
        f"kfgen: 1\nname: ring\nstates: {{{states}}}\ndynamics: {{f: {{{f}}}, Q: {{{Q}}}}}\n"
        "measurements: {s: {z: {a: {h: x0 + x1*x2/5, std: 0.5}, b: {h: x3**2, std: 0.4}}}}\n"
        f"filter: {{type: ukf, {options}}}\ncode: {{unroll: none}}\n"
    )


@pytest.mark.parametrize("options", [
    "covariance: ud", "covariance: sqrt", "covariance: ud, sequential: true",
    "covariance: full, sigma_points: {kind: julier, kappa: -1}",
])  # fmt: skip
def test_the_text_hardly_grows_with_the_states(options):
    lengths = []
    for n in (6, 12):
        made = build(ring(n, options))
        functions = {f.name: f for f in made.code.functions}
        for name in ("predict", "update_s"):
            assert any(isinstance(s, For) for s in walk(functions[name].body)), name
        lengths.append(made.files["ring.c"].count(";"))
    assert lengths[1] < 1.5 * lengths[0], lengths


@pytest.mark.parametrize("z", [-2.0, 9.0])
def test_what_an_update_takes_from_an_inflated_covariance_it_takes_once(z):
    """adapt_R draws points from P after the update, before it is stored."""
    spec = loads(BENT)
    kf, ref = built({"": spec})[""], reference(spec)
    for each in (kf, ref):
        each.predict()
        each.update("angle", [z])
    np.testing.assert_allclose(kf.P, ref.P, rtol=1e-12)
    np.testing.assert_allclose(kf.x, ref.x, rtol=1e-12)
