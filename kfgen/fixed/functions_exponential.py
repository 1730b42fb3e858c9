"""Exponentials and logarithms: the twins of templates/helpers_q_exponential.j2, step by step."""

from __future__ import annotations

from kfgen.fixed import tables
from kfgen.fixed.arithmetic import LIMIT, Status, narrow


def power(x: int) -> tuple[int, int]:
    """e^(x/2^58), |x| < 2^63, as a mantissa of 61 fraction bits near [1, 2] and a power of two."""
    n = (x >> 47) * tables.sixteenths() >> 21
    r = x - n * tables.ln2(54)
    if r < 0:
        n -= 1
        r += tables.ln2(54)
    r >>= 22
    c0, c1, c2 = tables.exponential().values
    e0, e1, e2 = tables.exponential().exponents
    p = c1 + (r * c2 >> 32 >> (4 + e2 - e1))
    p = c0 + (r * p >> 32 >> (4 + e1 - e0))
    e = r + (r * (r * p >> 32) >> 32 >> (4 + e0))
    t = tables.powers()[n & 15]
    return 2**61 + (t << 29) + (e + (e * t >> 32) << 25), n >> 4


def exp(a: int, fa: int, fr: int, status: Status) -> int:
    whole = a >> fa
    if whole < -31:
        return 0
    mantissa, exponent = power(a << (58 - fa)) if whole < 31 else (0, 64)
    s = 61 - exponent - fr
    if s < 31:
        status.saturate()
        return LIMIT
    return narrow(mantissa, s, status) if s < 64 else 0


def logarithm(m: int) -> tuple[int, int]:
    """ln(m/2^31), 2^31 <= m < 2^32, as 2^62 ln(v) and e: v = m/2^(31 + e), e in 0, 1 so that v is near 1."""
    j = (m >> 26) - 32
    upper = j >= tables.UPPER
    u = (m * tables.factors()[j] << (0 if upper else 1)) - 2**39
    small = u >> 4
    coefficients = tables.logarithm()
    g = coefficients[-1]
    for c in reversed(coefficients[:-1]):
        g = c - (small * g >> 35)
    h = small * g >> 30
    return (u << 23) - (small * h >> 9) + tables.logarithms()[j], int(upper)


def log(a: int, fa: int, fr: int, status: Status) -> int:
    if a <= 0:
        status.saturate()
        return -LIMIT
    z = 32 - a.bit_length()
    value, upper = logarithm(a << z)
    return narrow((31 - z - fa + upper) * tables.ln2(58) + (value >> 4), 58 - fr, status)
