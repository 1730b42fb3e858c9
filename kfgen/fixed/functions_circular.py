"""Sines and angles: the twins of templates/helpers_q_circular.j2, step by step."""

from __future__ import annotations

from kfgen.fixed import tables
from kfgen.fixed.arithmetic import Status, narrow, scale

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


def sine(part: int) -> int:
    """2^62 sin(2 pi part / 2^64)."""
    quadrant = ((part + 2**61) % 2**64) >> 62
    offset = (part - (quadrant << 62)) % 2**64
    below = offset >> 63 == 1
    size = (2**64 - offset if below else offset) + 2**28
    w = _WORD if size >> 61 else size >> 29
    z = w * w >> 32
    negative = quadrant >> 1 == 1
    if quadrant & 1:
        series = tables.cosine()
        value = 2**62 - (z * alternating(z, series) >> (2 + series.exponents[0]))
    else:
        series, inner = tables.sine(), tables.sine().tail
        value = w * series.values[0] >> (2 + series.exponents[0])
        value -= w * (z * alternating(z, inner) >> 32) >> (2 + inner.exponents[0])
        negative = negative != below
    return -value if negative else value


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
    guess = 256 + tables.reciprocals()[(d >> 24) - 128]
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
