"""Sines and angles: the twins of templates/helpers/q_circular.j2, step by step."""

from __future__ import annotations

from math import isqrt
from typing import NamedTuple

from kfgen.fixed.arithmetic import tables
from kfgen.fixed.arithmetic.limits import LIMIT
from kfgen.fixed.arithmetic.operations import Status, narrow, scale

_WORD = 2**32 - 1


def alternating(z: int, series: tables.Series) -> int:
    """c0 - z (c1 - z (c2 - ...)) for z < 1 of 32 bits, as 32 bits beyond the first coefficient's exponent."""
    value = series.values[-1]
    for coefficient, gap in series.steps:
        value = coefficient - (z * value >> 32 >> gap)
    return value


def turn(a: int, fa: int) -> int:
    size, (c0, c1, c2) = abs(a), tables.turn()
    low = size * c1 + (size * c2 >> 32)
    high = size * c0 + (low >> 32)
    part = (high << (32 - fa)) | ((low & _WORD) >> fa)
    return (-part if a < 0 else part) % 2**64


class Octant(NamedTuple):
    """A part of a turn as the nearest quarter and the distance from it: 2^61 is an eighth, in w 2^32."""

    quadrant: int
    w: int
    size: int
    below: bool


def octant(part: int) -> Octant:
    quadrant = ((part + 2**61) % 2**64) >> 62
    size = (part - (quadrant << 62)) % 2**64
    below = size >> 63 == 1
    if below:
        size = 2**64 - size
    nearest = size + 2**28
    return Octant(quadrant, _WORD if nearest >> 61 else nearest >> 29, size, below)


def bend(z: int) -> int:
    return z * alternating(z, tables.sine().tail) >> 32


def versine(z: int) -> int:
    return z * alternating(z, tables.cosine()) >> (2 + tables.cosine().exponents[0])


def near_zero(w: int, z: int) -> int:
    values, exponents = tables.sine()
    return (w * values[0] >> (2 + exponents[0])) - (w * bend(z) >> (2 + exponents[1]))


def sine(part: int) -> int:
    """2^62 sin(2 pi part / 2^64)."""
    o = octant(part)
    z = o.w * o.w >> 32
    odd = o.quadrant & 1 == 1
    size = 2**62 - versine(z) if odd else near_zero(o.w, z)
    return -size if (o.quadrant >> 1 == 1) != (not odd and o.below) else size


def sin(a: int, fa: int, fr: int, status: Status) -> int:
    return narrow(sine(turn(a, fa)), 62 - fr, status)


def cos(a: int, fa: int, fr: int, status: Status) -> int:
    return narrow(sine((turn(a, fa) + 2**62) % 2**64), 62 - fr, status)


def inverse(d: int) -> int:
    """floor((2^64 - 1)/d) - 2^32, 2^31 <= d < 2^32."""
    return (2**64 - 1) // d - 2**32


def angle(y: int, x: int) -> int:
    """2^60 atan(y/x), 0 <= x, y <= 2^32 - 1, not both 0."""
    swap = y > x
    n, d = (x, y) if swap else (y, x)
    z = 32 - d.bit_length()
    n, d = n << z, d << z
    guess = 256 + tables.quotients()[(d >> 24) - 128]
    j = ((n >> 24) * guess + 2048) >> 12
    above, below = 16 * n - j * d, 16 * d + j * n
    size = abs(above)
    if below >> 36:
        size, below = size >> 1, below >> 1
    below >>= 4
    u = size + (inverse(below) * size >> 32)
    square = u * u >> 32
    series = tables.arctangent()
    c0, c1 = series.values
    p = c0 - (square * c1 >> 32 >> (8 + series.exponents[1] - series.exponents[0]))
    small = (u << 24) - (u * (square * p >> 32) >> 32 << (16 - series.exponents[0]))
    value = (tables.angles()[j] << 28) + (-small if above < 0 else small)
    return tables.pi(59) - value if swap else value


def atan2(y: int, x: int, fr: int) -> int:
    """The angle of (x, y) in (-pi, pi]; 0 <= fr <= 29. 0 for (0, 0)."""
    if y == 0 and x == 0:
        return 0
    value = angle(abs(y), abs(x))
    if x < 0:
        value = tables.pi(60) - value
    return scale(-value if y < 0 else value, 60 - fr)


def atan(a: int, fa: int, fr: int, status: Status) -> int:
    value = angle(abs(a), 1 << fa)
    return narrow(-value if a < 0 else value, 60 - fr, status)


def _upper(a: int) -> int:
    return min(_WORD, (a + 2**31) >> 32)


def tan(a: int, fa: int, fr: int, status: Status) -> int:
    o = octant(turn(a, fa))
    z = o.w * o.w >> 32
    c = min(_WORD, (2**62 - versine(z) + 2**29) >> 30)
    if not o.quadrant & 1:
        n = (near_zero(o.w, z) + 2**29) >> 30
        ratio = n + (inverse(c) * n >> 32)
        return narrow(-ratio if o.below else ratio, 32 - fr, status)
    if o.size == 0:
        status.saturate()
        return LIMIT
    values, exponents = tables.sine()
    zs = 64 - o.size.bit_length()
    factor = values[0] - ((bend(z) + 2 ** (exponents[1] - 1)) >> exponents[1])
    sine = _upper(o.size << zs) * factor
    zp = 64 - sine.bit_length()
    ratio = 2 * (c + (inverse(_upper(sine << zp)) * c >> 32)) + 1
    s = 36 - zs - zp - fr
    if s < 0:
        status.saturate()
        return LIMIT if o.below else -LIMIT
    return narrow(ratio if o.below else -ratio, s, status)


def arc(b: int, other: bool) -> int:
    """2^60 asin(b / 2^31), 0 <= b <= 2^31, or 2^60 acos of it."""
    if b in (0, 2**31):
        return tables.pi(59) if (b == 0) == other else 0
    square = (2**31 - b) * (2**31 + b) << 2
    z = (64 - square.bit_length()) // 2
    x = isqrt((square << 2 * z >> 32) << 32) >> z
    return angle(x, 2 * b) if other else angle(2 * b, x)


def leg(a: int, fa: int, status: Status) -> int:
    if abs(a) > 1 << fa:
        status.saturate()
        return 2**31
    return abs(a) << (31 - fa)


def asin(a: int, fa: int, fr: int, status: Status) -> int:
    value = arc(leg(a, fa, status), False)
    return narrow(-value if a < 0 else value, 60 - fr, status)


def acos(a: int, fa: int, fr: int, status: Status) -> int:
    value = arc(leg(a, fa, status), True)
    return narrow(tables.pi(60) - value if a < 0 else value, 60 - fr, status)
