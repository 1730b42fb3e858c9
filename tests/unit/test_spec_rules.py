"""The arithmetic behind the rules: affine formulas, semidefinite matrices."""

from __future__ import annotations

from fractions import Fraction

import pytest

from kfgen.spec import loads
from kfgen.spec.affine import Affine
from kfgen.spec.contexts import Context
from kfgen.spec.expressions import parse
from kfgen.spec.matrices import is_semidefinite, smallest_eigenvalue

SPEC = loads(
    "kfgen: 1\nname: a\nstates: {x: {init: 0, std: 1}, y: {init: 0, std: 1}}\nparameters: {p: 2}\n"
    "let: {d: p*x, s: x**2}\ndynamics: {}\nmeasurements: {m: {z: {c: {h: x + d, std: 1}}}}\n"
)
KINDS = {"x": "state", "y": "state", "p": "parameter", "d": "definition", "s": "definition"}
CONTEXT = Context(SPEC, SPEC.let, SPEC.measurements, KINDS)


@pytest.mark.parametrize(
    ("text", "affine"),
    [
        ("x + 2*y - 3", True), ("p*x/3", True), ("x/p", True), ("d + y", True), ("3", True),
        ("sin(p)*x", True), ("where(p > 1, x, 2*x)", True), ("(x + 1)**2 - x**2", True),
        ("abs(p)*x", True), ("x*y", False), ("x**2", False), ("s", False), ("sin(x)", False),
        ("abs(x)", False), ("p/x", False), ("where(x > 1, x, 2*x)", False), ("max(x, y)", False),
        ("sqrt(x)", False), ("d*x", False), ("x*y/y", False),
    ],
)  # fmt: skip
def test_affine(text: str, affine: bool) -> None:
    assert Affine(CONTEXT, frozenset("xy")).is_affine(parse(text), {"p": Fraction(2)}) is affine


def test_coefficients() -> None:
    affine = Affine(CONTEXT, frozenset("xy"))
    assert affine.form(parse("p*x + 3")).coefficients == {"p"}
    assert affine.form(parse("d")).coefficients == {"p"}
    assert affine.form(parse("x + p")).coefficients == frozenset()


def fractions(*rows: str) -> list[list[Fraction]]:
    return [[Fraction(entry) for entry in row.split()] for row in rows]


@pytest.mark.parametrize(
    ("rows", "wanted"),
    [
        (["1 0", "0 1"], True),
        (["0 0", "0 0"], True),
        (["1 1", "1 1"], True),
        (["1e-30 0.9e-30", "0.9e-30 1e-30"], True),
        (["1e12 1e-1", "1e-1 1e-13"], True),
        (["3 1.7320508075688772", "1.7320508075688772 1"], True),
        (["1 0.5 0.5", "0.5 1 0.5", "0.5 0.5 1"], True),
        (["1 1.0001", "1.0001 1"], False),
        (["-1e-30 0", "0 1"], False),
        (["0 1e-30", "1e-30 1"], False),
        (["1 -0.9 0.9", "-0.9 1 0.9", "0.9 0.9 1"], False),
        (["1e-12 2e-12", "2e-12 1e-12"], False),
    ],
)
def test_semidefinite(rows: list[str], wanted: bool) -> None:
    matrix = fractions(*rows)
    assert is_semidefinite(matrix) is wanted


def test_smallest_eigenvalue() -> None:
    assert float(smallest_eigenvalue(fractions("1 2", "2 1"))) == pytest.approx(-1)
