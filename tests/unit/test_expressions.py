"""The whitelist parser: what it accepts, what it makes of it, and where it says that something is wrong."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kfgen.spec.constants import NotConstant, value
from kfgen.spec.expressions import parse
from kfgen.spec.lexer import ExpressionError, positions
from kfgen.spec.operations import NoValue
from kfgen.spec.tree import FUNCTIONS, Call, Name, Number, names


def number(text: str | int) -> Number:
    return Number(Fraction(text))


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("0.5*0.1**2", Fraction(1, 200)),
        ("-2**2", -4),
        ("(-2)**2", 4),
        ("2**3**2", 512),
        ("2**-1", Fraction(1, 2)),
        ("1 - 2 - 3", -4),
        ("8/4/2", 1),
        ("2 + 3*4", 14),
        ("+5 - -5", 10),
        (".5 + 5.", Fraction(11, 2)),
        ("1e3 + 1E-3 + 1.5e+1", Fraction("1015.001")),
        ("007", 7),
        ("0e999999999999999999", 0),
        ("sqrt(4/9)", Fraction(2, 3)),
        ("4**0.5", 2),
        ("4**-1.5", Fraction(1, 8)),
        ("hypot(3, 4)", 5),
        ("abs(-3) + sign(-2) + min(1, 2) + max(1, 2)", 5),
        ("floor(-1.5)", -2),
        ("where(1 < 2 and not 3 <= 2, 1, 1/0)", 1),
        ("where(1 > 2 or 2 >= 3, 1/0, 2)", 2),
        ("table(1.5, [1, 2, 3], [10, 20, 40])", 15),
        ("table(9, [1, 2, 3], [10, 20, 40])", 40),
        ("table(-9, [1, 2, 3], [10, 20, 40])", 10),
        ("sin(0) + cos(0) + tan(0) + exp(0) + log(1) + atan2(0, 1) + tanh(0)", 2),
        ("-" * 100 + "1", 1),
        ("where(1 < 2, " * 100 + "1" + ", 2)" * 100, 1),
        ("abs(" * 100 + "1" + ")" * 100, 1),
        ("1**" * 100 + "1", 1),
        ("(" * 100 + "1" + ")" * 100, 1),
        ("1-" * 999 + "1", -998),
        ("*".join(["2"] * 20 + ["1"] * 100), 2**20),
    ],
)
def test_exact_values(text: str, wanted: Fraction | int) -> None:
    found = value(parse(text))
    assert isinstance(found, Fraction)
    assert found == wanted


@pytest.mark.parametrize("name", sorted(n for n, count in FUNCTIONS.items() if count == 1))
def test_functions_agree_with_libm(name: str) -> None:
    own = {"abs": abs, "sign": lambda x: math.copysign(1, x)}
    wanted = own.get(name) or getattr(math, name)
    for x in ("0.3", "0.7"):
        assert float(value(parse(f"{name}({x})"))) == pytest.approx(wanted(float(x)), rel=1e-15)


def test_constants_have_sixty_digits() -> None:
    assert str(value(parse("pi")))[:10] == "3.14159265"
    difference = value(parse("exp(1) - e"))
    assert abs(difference) < 1e-55


def test_trees() -> None:
    assert parse("a*b + 2") == Call("add", (Call("mul", (Name("a"), Name("b"))), number(2)))
    assert parse("-a**2") == Call("neg", (Call("pow", (Name("a"), number(2))),))
    assert parse("a < b", condition=True) == Call("lt", (Name("a"), Name("b")))
    assert parse("table(a, [1, 2], [3, 4])").args == (Name("a"), number(1), number(2), number(3), number(4))
    assert list(names(parse("x + y*x"))) == ["x", "y", "x"]
    assert positions("x + xx*x", "x") == [0, 7]


@pytest.mark.parametrize(
    ("text", "offset", "message"),
    [
        ("", 0, "empty"),
        ("   ", 0, "empty"),
        ("x^2", 1, "`^`"),
        ("x = 2", 2, "`=`"),
        ("x == 2", 2, "`==`"),
        ("x != 2", 2, "`!=`"),
        ("x // 2", 2, "`//`"),
        ("x % 2", 2, "`%`"),
        ("x.y", 1, "a vector is no number"),
        ("x .y", 2, "`.`"),
        ("x.y(1)", 1, "`.`"),
        ("2x", 1, "an operator is missing"),
        ("a b", 2, "an operator is missing"),
        ("2(3)", 1, "an operator is missing"),
        ("0x1F", 0, "decimal"),
        ("0b1", 0, "decimal"),
        ("1_000", 0, "underscores"),
        ("2j", 0, "complex"),
        ("1e", 0, "exponent"),
        ("1.2.3", 0, "not a number"),
        ("1e999999", 0, "out of range"),
        ("1e-999999", 0, "out of range"),
        ("9" * 2000, 0, "too long"),
        ("a < b < c", 6, "chained"),
        ("a < b", 0, "a condition is not a number"),
        ("1 + (a < b)", 2, "wants numbers"),
        ("where(a, 1, 2)", 6, "a condition is wanted"),
        ("not a", 0, "wants a condition"),
        ("where(a and b > 1, 1, 2)", 8, "joins conditions"),
        ("x if a else b", 2, "`if` is not allowed"),
        ("lambda", 0, None),
        ("sin", 0, "has no arguments"),
        ("sin()", 0, "takes 1 argument, not 0"),
        ("sin(1, 2)", 0, "takes 1 argument, not 2"),
        ("atan(y, x)", 0, "takes 1 argument"),
        ("max(1, 2, 3)", 0, "takes 2 arguments"),
        ("f(x)", 0, "no function `f`"),
        ("__import__(1)", 0, "no function"),
        ("(x", 0, "not closed"),
        ("sin(x", 3, "not closed"),
        ("x)", 1, "no matching"),
        ("x +", 3, "ends too early"),
        ("* x", 0, "unexpected `*`"),
        ("[1]", 0, "a vector is no number"),
        ("[]", 0, "the list is empty"),
        ("[1, 2", 0, "`[` is not closed"),
        ("a[1]", 1, "a vector is no number"),
        ("a[-1]", 2, "an index is a whole number"),
        ("a[x]", 2, "an index is a whole number"),
        ("a[0, 0, 0]", None, ""),
        ("1]", 1, "`]` has no matching"),
        ("rotate(q)", 0, "`rotate` takes 2 arguments, not 1"),
        ("rotat(q, v)", 0, "no function"),
        ("table(x, [1], [2])", 0, "at least two points"),
        ("table(x, [1, 2], [2])", 0, "2 and 1 entries"),
        ("table(x, 1, 2)", 9, "wants a list"),
        ("table(x)", 0, "a value and two lists"),
        ("x**65", 3, "at most 64"),
        ("x**-65", 3, "at most 64"),
        ("π", 0, "`π`"),
        ("ｘ", 0, "may not stand"),
        ("x\x00", 1, "U+0000"),
        ("x; y", 1, "`;`"),
        ("x := 1", 2, "`:`"),
        ("'x'", 0, "`'`"),
        ("-" * 101 + "1", 100, "nested deeper than 100"),
        ("1 + not (a < b)", 4, "before `not`"),
        ("where(1 < 2, " * 101 + "1" + ", 2)" * 101, None, "nested deeper"),
        ("(" * 101 + "1" + ")" * 101, 100, "nested deeper than 100"),
        ("1+" * 1000 + "1", None, "more than 2000 nodes"),
        ("x" * 10_001, 0, "longer than 10000"),
    ],
)
def test_mistakes(text: str, offset: int | None, message: str | None) -> None:
    if message is None:
        parse(text)  # a plain name to the grammar; the rules for names refuse it
        return
    with pytest.raises(ExpressionError) as caught:
        parse(text)
    assert message in caught.value.message
    if offset is not None:
        assert caught.value.offset == offset


@pytest.mark.parametrize(
    "text",
    ["1/0", "sqrt(-1)", "log(0)", "asin(2)", "(-1)**0.5", "0**-1", "2**64**64", "exp(1e10)", "1e300**64",
     "sinh(1e300)", "2**(64 + 1)", "table(1, [2, 1], [0, 0])"],
)  # fmt: skip
def test_no_value(text: str) -> None:
    with pytest.raises(NoValue):
        value(parse(text))


def test_not_constant() -> None:
    with pytest.raises(NotConstant) as caught:
        value(parse("1 + x"))
    assert caught.value.name == "x"


def test_towers_do_not_hang() -> None:
    known: dict[str, object] = {"a": Fraction(3)}
    for _ in range(300):  # each exact value would be 64 times longer than the one before
        try:
            known["a"] = value(parse("a**64"), known)
        except NoValue:
            return
    pytest.fail("the values should have become too large")


def test_long_chains_stay_shallow_and_exact() -> None:
    draw = random.Random(1)
    for operators in ("+-", "*/"):
        text = "7"
        for _ in range(400):
            text += draw.choice(operators) + str(draw.randint(1, 9))
        tree = parse(text)
        depth, level = 0, [tree]
        while level:
            depth, level = depth + 1, [a for n in level if isinstance(n, Call) for a in n.args]
        assert depth < 40
        wanted = Fraction(7)
        for operator, digit in zip(text[1::2], text[2::2], strict=True):
            other = Fraction(digit)
            wanted = {"+": wanted + other, "-": wanted - other, "*": wanted * other, "/": wanted / other}[
                operator
            ]
        assert abs(value(tree) - wanted) <= abs(wanted) * Fraction(1, 10**50)


@settings(max_examples=200, derandomize=True, deadline=None, database=None)
@given(st.lists(st.tuples(st.integers(0, 9).map(str), st.sampled_from("+-*")).map("".join)).map("".join))
def test_precedence_is_that_of_python(chain: str) -> None:
    text = chain + "1"
    wanted = 0
    for sign, term in _terms(text):
        product = 1
        for factor in term.split("*"):
            product *= int(factor)
        wanted += sign * product
    assert value(parse(text)) == wanted


def _terms(text: str) -> list[tuple[int, str]]:
    found: list[tuple[int, str]] = []
    sign, start = 1, 0
    for i, c in enumerate(text + "+"):
        if c in "+-":
            found.append((sign, text[start:i]))
            sign, start = (1 if c == "+" else -1), i + 1
    return found
