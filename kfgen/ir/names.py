"""Names that a local of the emitted C must not take."""

from __future__ import annotations

_BASE = ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "pow",
         "fabs", "floor", "ceil", "hypot", "fmin", "fmax", "fma")  # fmt: skip
LIBRARY_NAMES = frozenset(name + suffix for name in _BASE for suffix in ("", "f"))
"""Functions of <math.h>."""
# names that a local must not take: what the text around it uses, functions of <math.h>
_TAKEN = """kf flags order i j k sum p w total real j0 j1 jn y0 y1 yn gamma signgam erf erfc log2 log10 exp2
cbrt round trunc isnan isinf isfinite NULL int8_t int16_t int32_t uint8_t uint16_t uint32_t"""
RESERVED = LIBRARY_NAMES | frozenset(_TAKEN.split())
