"""Which C routine needs which: the emitted file holds those that its code calls, and what these call."""

from __future__ import annotations

from collections.abc import Iterable

NEEDS: dict[str, tuple[str, ...]] = {
    "sar": (),
    "sar32": (),
    "bits": (),
    "asr": ("sar32", "bits"),
    "limit": (),
    "round": ("sar",),
    "clamp": ("limit",),
    "scale": ("round",),
    "narrow": ("scale", "clamp"),
    "near": ("narrow",),
    "product": (),
    "moved": (),
    "part": ("product", "sar"),
    "mul": ("part", "clamp", "moved", "bits"),
    "madd": ("part", "bits"),
    "gather": ("product", "round"),
    "stretch": ("sar", "round"),
    "word": ("round", "clamp"),
    "rest": ("round",),
    "add": ("limit", "bits"),
    "sub": ("limit", "bits"),
    "lift": ("limit", "bits"),
    "shift": ("sar32", "lift"),
    "leading": (),
    "wide": (),
    "mulh": ("wide",),
    "signed": ("limit",),
    "estimate": ("asr",),
    "inverse": ("estimate", "mulh"),
    "div": ("leading", "inverse", "mulh", "signed", "limit"),
    "ratio": ("product", "leading", "div"),
    "reciprocal": ("leading", "estimate", "signed", "limit"),
    "root": ("mulh", "asr"),
    "sqrt": ("leading", "root", "limit", "signed"),
    "floor": ("bits",),
    "wrap": ("near",),
    "hypot": ("leading", "wide", "root", "signed"),
    "turn": ("wide", "mulh"),
    "octant": ("wide", "mulh"),
    "sine": ("octant",),
    "sin": ("turn", "sine", "near"),
    "cos": ("turn", "sine", "near"),
    "angle": ("leading", "wide", "inverse", "mulh"),
    "atan2": ("angle", "round"),
    "atan": ("angle", "near"),
    "tan": ("turn", "octant", "leading", "inverse", "mulh", "wide", "near", "limit"),
    "arc": ("wide", "leading", "root", "angle"),
    "asin": ("arc", "near"),
    "acos": ("arc", "near"),
    "power": ("sar", "sar32", "mulh"),
    "scaled": ("near", "limit"),
    "exp": ("power", "sar32", "scaled", "limit"),
    "logarithm": ("wide", "product", "sar"),
    "sinh": ("power", "near", "limit"),
    "cosh": ("power", "near", "limit"),
    "tanh": ("power", "round", "inverse", "mulh", "near"),
    "pow": ("leading", "logarithm", "sar", "wide", "power", "scaled", "near", "limit"),
    "log": ("logarithm", "leading", "near", "limit"),
}
"""Routine -> those that it calls itself. In the order of their definitions."""


ROUNDING_DOWN = {"scale": ("sar",), "near": ("round", "clamp")}
"""What is different where products and shifts round down, and the functions do not."""


def closure(ops: Iterable[str], floor: bool = False) -> tuple[str, ...]:
    """The routines that code which calls `ops` needs, in the order of NEEDS. KeyError for one that does not exist."""
    needs = {**NEEDS, **ROUNDING_DOWN} if floor else NEEDS
    needed: set[str] = set()
    waiting = list(ops)
    while waiting:
        op = waiting.pop()
        if op not in needed:
            needed.add(op)
            waiting += needs[op]
    return tuple(op for op in NEEDS if op in needed)
