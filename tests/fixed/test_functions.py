"""What the routines of fixed point compute is right: against exact fractions, the C library and mpmath."""

from __future__ import annotations

import random
from fractions import Fraction
from math import floor, isqrt

import pytest
from exhaustive import BOUNDS, FUNCTIONS, build, run
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf
from routines import ARGUMENTS, COMPILERS, RANGES, compiled, expected, source

from kfgen.fixed.arithmetic.limits import LIMIT
from kfgen.fixed.arithmetic.operations import SATURATED, Status
from kfgen.fixed.arithmetic.twins import TWINS

# argument's and result's fraction bits; results of FLAT functions wobble by a bit where a step is far below that bit
FORMATS = ((16, 16), (28, 30), (24, 24), (8, 8), (31, 16), (0, 29))
FLAT = {"cosh", "cos", "sin", "tanh", "acos"}
HALF = Fraction(1, 2)


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    return build(tmp_path_factory.mktemp("sampled"), source(FUNCTIONS))


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize(("fa", "fr"), FORMATS)
def test_functions_of_one_argument(program, function, fa, fr):
    """Blocks over all arguments, and the arguments around 0."""
    if function == "floor":
        fr = fa
    gap = 2**32 // 97
    for found in (
        run(program, function, fa, fr, -(2**31), 97 * 150, 150, gap - 150),
        run(program, function, fa, fr, -5000, 10000),
    ):
        assert found.error <= BOUNDS[function], found
        assert found.wrong == 0, found
        assert found.crossed == 0 or (function in FLAT and fr > 24), found


def raw(source: random.Random) -> int:
    return source.randrange(-(2**31), 2**31) >> source.randrange(32)


def rounded(value: Fraction) -> int:
    return max(-LIMIT, min(LIMIT, floor(value + HALF)))


def test_basic_routines_are_what_they_are_said_to_be():
    numbers = random.Random(1)
    for _ in range(500):
        a, b, c, s, t = raw(numbers), raw(numbers), raw(numbers), numbers.randrange(63), numbers.randrange(-62, 63)
        wide = numbers.randrange(-(2**63), 2**63) >> numbers.randrange(64)
        power = Fraction(2) ** t
        status = Status()
        assert TWINS["mul"](a, b, s, status) == rounded(Fraction(a * b, 2**s))
        product = Fraction((a >> 1) * (b >> 1), 2**s)
        assert TWINS["madd"](c, a >> 1, b >> 1, s) == max(-LIMIT, min(LIMIT, c + floor(product + HALF)))
        assert TWINS["narrow"](wide, s, status) == rounded(Fraction(wide, 2**s))
        assert TWINS["shift"](a, t, status) == rounded(a / power)
        assert TWINS["add"](a, b, status) == rounded(Fraction(a + b))
        assert TWINS["sub"](a, b, status) == rounded(Fraction(a - b))
        if b:
            assert TWINS["div"](a, b, t, status) == rounded(a * power / b)
            assert TWINS["reciprocal"](b, s, status) == rounded(Fraction(2**s, b))
        if a > 0:
            root = TWINS["sqrt"](a, t, status)
            assert root == LIMIT or max(root - HALF, Fraction(0)) ** 2 <= a * power < (root + HALF) ** 2


@pytest.mark.parametrize(
    ("op", "arguments", "result"),
    [
        ("div", (5, 0, 3), LIMIT),
        ("div", (-5, 0, 3), -LIMIT),
        ("div", (0, 0, 3), 0),
        ("div", (-(2**31), 1, 0), -LIMIT),
        ("reciprocal", (0, 3), LIMIT),
        ("sqrt", (-1, 3), 0),
        ("log", (0, 16, 16), -LIMIT),
        ("log", (-5, 16, 16), -LIMIT),
        ("asin", (65537, 16, 16), rounded(Fraction(102944))),
        ("acos", (-65537, 16, 16), 205887),
        ("exp", (2**31 - 1, 16, 16), LIMIT),
        ("sinh", (-(2**31), 16, 16), -LIMIT),
        ("mul", (-(2**31), -(2**31), 30), LIMIT),
        ("shift", (-(2**31), 0), -LIMIT),
        ("shift", (1, -31), LIMIT),
        ("add", (-(2**31), 0), -LIMIT),
        ("pow", (0, 16, -65536, 16, 16), LIMIT),
        ("pow", (-65536, 16, 32768, 16, 16), 0),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_flagged(op, arguments, result):
    status = Status()
    assert (TWINS[op](*arguments, status), status.bits) == (result, SATURATED)


@pytest.mark.parametrize(
    ("op", "arguments", "result"),
    [
        ("exp", (-(2**31), 16, 16), 0),
        ("exp", (-(2**31), 27, 30), 121),
        ("exp", (0, 16, 30), 2**30),
        ("pow", (0, 16, 0, 16, 16), 65536),
        ("pow", (0, 16, 65536, 16, 16), 0),
        ("pow", (-3 << 16, 16, 3 << 16, 16, 16), -27 << 16),
        ("sqrt", (9 << 16, 16), 3 << 16),
        ("sin", (0, 16, 16), 0),
        ("tanh", (0, 16, 30), 0),
        ("hypot", (3 << 16, -4 << 16), 5 << 16),
        ("wrap", (-(3 << 16), 3 << 48), 3 << 16),
    ],
)  # fmt: skip
def test_values_that_are_known(op, arguments, result):
    status = Status()
    assert (TWINS[op](*arguments, status), status.bits) == (result, 0)


def test_angles_of_vectors():
    numbers = random.Random(2)
    assert TWINS["atan2"](0, 0, 16) == 0
    assert TWINS["atan2"](0, -5, 16) == 205887
    with mp.workprec(100):
        for _ in range(1500):
            y, x, fr = raw(numbers), raw(numbers), numbers.randrange(30)
            assert abs(TWINS["atan2"](y, x, fr) - mp.atan2(y, x) * 2**fr) < 1


def test_lengths_of_vectors():
    numbers = random.Random(3)
    for _ in range(1500):
        a, b = raw(numbers), raw(numbers)
        square, status = a * a + b * b, Status()
        got = TWINS["hypot"](a, b, status)
        if square >= (LIMIT + 1) ** 2:
            assert (got, status.bits) == (LIMIT, SATURATED)
        else:
            assert abs(got - isqrt(square << 40) / 2**20) < 2


def test_powers():
    numbers = random.Random(4)
    with mp.workprec(160):
        for _ in range(800):
            fa, fb = numbers.randrange(31), numbers.randrange(32)
            near = (1 << fa) + (raw(numbers) >> numbers.randrange(31 - fa, 32))  # of 1, where errors grow most
            a = max(1, min(LIMIT, near if numbers.random() < 0.5 else abs(raw(numbers))))
            log = mp.log(mpf(a) / 2**fa)
            b = raw(numbers) if log == 0 else int(numbers.uniform(-21, 21) / log * 2**fb)
            b = max(-LIMIT, min(LIMIT, b))
            exact = mp.exp(log * b / mpf(2) ** fb)
            fr = max(0, min(30, int(31 - mp.log(exact, 2)) - numbers.choice((0, 0, 1, 5))))
            status = Status()
            got = TWINS["pow"](a, fa, b, fb, fr, status)
            assert abs(got - min(exact * 2**fr, LIMIT)) < 2, (a, fa, b, fb, fr)


def test_wrapping():
    """Whole periods, however many; the nearest number; once is enough."""
    numbers = random.Random(5)
    with mp.workprec(200):
        pi = int(mp.floor(mp.pi * 2**61))
    for _ in range(1500):
        bits = numbers.randrange(30)
        half = pi >> (29 - bits) if numbers.random() < 0.5 else numbers.randrange(2**32, 2**63) >> numbers.randrange(31)
        half = max(half, 2**32)
        a, status, exact = raw(numbers), Status(), Fraction(half, 2**32)
        got = TWINS["wrap"](a, half, status)
        assert -exact < got <= exact
        turns = Fraction(a - got) / (2 * exact)
        off = abs(turns - floor(turns + HALF)) * 2 * exact
        assert off <= HALF or (off < 1 and exact - abs(got) < 1)
        assert TWINS["wrap"](got, half, status) == got
        assert status.bits == 0
    assert TWINS["wrap"](-(2**31), 2**62, Status()) == -(2**31) + 2**31


_ANY = st.one_of(st.integers(-(2**31), 2**31 - 1), st.sampled_from((-(2**31), -LIMIT, LIMIT, 0, 1, -1)))
_LETTERS = {
    "i": _ANY,
    "m": st.integers(1 - 2**30, 2**30 - 1),
    "w": st.one_of(st.integers(-(2**63), 2**63 - 1), _ANY),
    "h": st.integers(2**32, 2**63 - 1),
} | {letter: st.integers(*limits) for letter, limits in RANGES.items() if letter != "m"}


@settings(max_examples=250, deadline=None, derandomize=True)
@given(st.data())
def test_python_is_c(data):
    op = data.draw(st.sampled_from(sorted(ARGUMENTS)))
    columns = [[data.draw(_LETTERS[letter])] for letter in ARGUMENTS[op]]
    assert compiled(COMPILERS[0], ("-O2",))(op, *columns) == expected(op, *columns)
