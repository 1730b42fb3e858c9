"""The C routines of fixed point compute what their Python twins do, to the last bit, under every compiler."""

from __future__ import annotations

import random
from functools import cache

import pytest
from routines import ARGUMENTS, COMPILERS, NEEDS, RANGES, closure, compiled, expected

from kfgen.fixed.arithmetic.operations import FLOOR

EXTREMES = (-(2**31), -(2**31) + 1, 2**31 - 1, 0, 1, -1, 2**30, -(2**30), 65536, -65536)
BUILDS = [(compiler, (level,)) for compiler in COMPILERS for level in ("-O0", "-O2", "-O3")]
UNDEFINED = ("-O1", "-fsanitize=undefined")  # gcc's, whose run-time library a shared one may use
ROUNDS_DOWN = ("narrow", "mul", "madd", "shift")


def number(source: random.Random, letter: str) -> int:
    """Of the kind that ARGUMENTS names; sizes of all orders, extremes and neighbours of powers of two often."""
    if letter == "m":
        return max(1 - 2**30, number(source, "i") >> 1)
    if letter == "l":
        return number(source, "w") >> 11
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


@cache
def columns(op: str, n: int = 1000) -> list[list[int]]:
    source = random.Random(op)
    return [[number(source, letter) for _ in range(n)] for letter in ARGUMENTS[op]]


@cache
def wanted(op: str, floor: bool = False) -> tuple[list[int], list[int]]:
    return expected(op, *columns(op), **({"rounding": FLOOR} if floor and op in ROUNDS_DOWN else {}))


@pytest.mark.parametrize(("compiler", "flags"), BUILDS)
def test_python_and_c_agree(compiler, flags):
    routines = compiled(compiler, flags)
    for op in ARGUMENTS:
        assert routines(op, *columns(op)) == wanted(op), op


def test_rounding_down():
    routines = compiled(COMPILERS[0], ("-O1",), True)
    for op in ARGUMENTS:
        assert routines(op, *columns(op)) == wanted(op, True), op


@pytest.mark.parametrize("target", [(), ("-D__ARM_ARCH_6M__", "-D__AVR__")], ids=["host", "narrow multiplier"])
def test_nothing_undefined(target, capfd):
    """Here, and in the code for processors that multiply to 32 bits."""
    routines = compiled("gcc", (*UNDEFINED, *target))
    for op in ARGUMENTS:
        assert routines(op, *columns(op)) == wanted(op), op
    assert capfd.readouterr().err == ""


def test_needs_are_in_the_order_of_definition():
    seen: set[str] = set()
    for op, needs in NEEDS.items():
        assert set(needs) <= seen, op
        seen.add(op)
    assert closure(["narrow"]) == ("sar", "limit", "round", "clamp", "scale", "narrow")
