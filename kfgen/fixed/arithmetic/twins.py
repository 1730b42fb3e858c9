"""The Python routine of each C routine that code calls."""

from __future__ import annotations

from collections.abc import Callable

from kfgen.fixed.arithmetic import circular, exponential
from kfgen.fixed.arithmetic import operations as basic

TWINS: dict[str, Callable[..., int]] = {
    "narrow": basic.narrow,
    "mul": basic.mul,
    "madd": basic.madd,
    "add": basic.add,
    "sub": basic.sub,
    "shift": basic.shift,
    "gather": basic.gather,
    "stretch": basic.stretch,
    "word": basic.word,
    "rest": basic.rest,
    "div": basic.div,
    "ratio": basic.ratio,
    "reciprocal": basic.reciprocal,
    "sqrt": basic.sqrt,
    "floor": basic.floor,
    "wrap": basic.wrap,
    "hypot": basic.hypot,
    "sin": circular.sin,
    "cos": circular.cos,
    "atan": circular.atan,
    "atan2": circular.atan2,
    "tan": circular.tan,
    "asin": circular.asin,
    "acos": circular.acos,
    "exp": exponential.exp,
    "log": exponential.log,
    "sinh": exponential.sinh,
    "cosh": exponential.cosh,
    "tanh": exponential.tanh,
    "pow": exponential.pow,
}
"""name -> function; the arguments are those of the C routine, `status` last where it has one."""
WITHOUT_STATUS = frozenset({"gather", "stretch", "rest", "madd", "floor", "atan2"})
