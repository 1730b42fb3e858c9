"""The C routines of fixed point compute what their Python twins do, to the last bit, under every compiler."""

from __future__ import annotations

import random
import shutil

import pytest
from routines import ARGUMENTS, NEEDS, RANGES, closure, compiled, expected

EXTREMES = (-(2**31), -(2**31) + 1, 2**31 - 1, 0, 1, -1, 2**30, -(2**30), 65536, -65536)
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
BUILDS = [(compiler, (level,)) for compiler in COMPILERS for level in ("-O0", "-O2", "-O3")]
UNDEFINED = ("-O1", "-fsanitize=undefined")  # gcc's, whose run-time library a shared one may use
ROUNDS_DOWN = ("narrow", "mul", "madd", "shift")


def number(source: random.Random, letter: str) -> int:
    """Of the kind that ARGUMENTS names; sizes of all orders, extremes and neighbours of powers of two often."""
    if letter == "m":
        return max(1 - 2**30, number(source, "i") >> 1)
    if letter in RANGES:
        return source.randint(*RANGES[letter])
    if letter == "h":
        return source.randrange(2**32, 2**63) >> source.randrange(32) | 2**32
    bits = 64 if letter == "w" else 32
    kind = source.random()
    if kind < 0.15:
        return source.choice(EXTREMES) if bits == 32 else source.choice((-(2**63), 2**63 - 1, *EXTREMES))
    if kind < 0.4:
        value = source.choice((1, -1)) * (1 << source.randrange(bits)) + source.randrange(-2, 3)
        return max(-(1 << (bits - 1)), min((1 << (bits - 1)) - 1, value))
    return source.randrange(-(1 << (bits - 1)), 1 << (bits - 1)) >> source.randrange(bits)


def columns(op: str, n: int = 4000) -> list[list[int]]:
    source = random.Random(op)
    return [[number(source, letter) for _ in range(n)] for letter in ARGUMENTS[op]]


@pytest.mark.parametrize("op", ARGUMENTS)
def test_python_and_c_agree(op, capfd):
    given = columns(op)
    wanted = expected(op, *given)
    for compiler, flags in BUILDS:
        assert compiled(compiler, flags)(op, *given) == wanted, (compiler, flags)
    assert compiled("gcc", UNDEFINED)(op, *given) == wanted
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("op", ROUNDS_DOWN)
def test_rounding_down(op):
    given = columns(op)
    assert compiled(COMPILERS[0], ("-O2",), True)(op, *given) == expected(op, *given, rounding="floor")


def test_needs_are_in_the_order_of_definition():
    seen: set[str] = set()
    for op, needs in NEEDS.items():
        assert set(needs) <= seen, op
        seen.add(op)
    assert closure(["narrow"]) == ("sar", "limit", "round", "clamp", "scale", "narrow")
