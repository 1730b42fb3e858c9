"""Exponentials and logarithms: the twins of templates/helpers/q_exponential.j2, step by step."""

from __future__ import annotations

from kfgen.fixed.arithmetic import tables
from kfgen.fixed.arithmetic.circular import inverse
from kfgen.fixed.arithmetic.limits import LIMIT
from kfgen.fixed.arithmetic.operations import Status, narrow, scale


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


def scaled(m: int, s: int, status: Status) -> int:
    """m / 2^s, m >= 2^61, s of any size."""
    if s < 31:
        status.saturate()
        return LIMIT
    return narrow(m, s, status) if s < 64 else 0


def exp(a: int, fa: int, fr: int, status: Status) -> int:
    whole = a >> fa
    if whole < -31:
        return 0
    if whole > 30:
        status.saturate()
        return LIMIT
    mantissa, exponent = power(a << (58 - fa))
    return scaled(mantissa, 61 - fr - exponent, status)


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


def sinh(a: int, fa: int, fr: int, status: Status) -> int:
    value = _hyperbolic(a, fa, fr, -1, status)
    return -value if a < 0 else value


def cosh(a: int, fa: int, fr: int, status: Status) -> int:
    return _hyperbolic(a, fa, fr, 1, status)


def _hyperbolic(a: int, fa: int, fr: int, sign: int, status: Status) -> int:
    # of |a|: a negative sine must be rounded as the C does, from its own side
    size = abs(a)
    if size >> fa > 22:
        status.saturate()
        return LIMIT
    (grown, up), (shrunk, down) = power(size << (58 - fa)), power(-(size << (58 - fa)))
    twice = grown + sign * (shrunk >> (up - down))
    s = 62 - fr - up
    if s < 0:
        status.saturate()
        return LIMIT
    return -narrow(-twice, s, status) if a < 0 and sign < 0 else narrow(twice, s, status)


def tanh(a: int, fa: int, fr: int, status: Status) -> int:
    size, part = abs(a), 0
    if size == 0:
        return 0
    if size >> fa < 12:
        mantissa, exponent = power(-(size << (59 - fa)))
        part = scale(mantissa, 29 - exponent)
    ratio = 2**33
    if part:
        n = 2**32 - part
        ratio = n + (inverse((2**32 + part) >> 1) * n >> 32)
    return narrow(-ratio if a < 0 else ratio, 33 - fr, status)


def pow(a: int, fa: int, b: int, fb: int, fr: int, status: Status) -> int:
    if b == 0:
        return narrow(2**31, 31 - fr, status)
    if a == 0:
        if b > 0:
            return 0
        status.saturate()
        return LIMIT
    if a < 0 and abs(b) % (1 << fb):
        status.saturate()
        return 0
    z = 32 - abs(a).bit_length()
    log, upper = logarithm(abs(a) << z)
    n = 31 - z - fa + upper
    s = fb + 4 if n == 0 else fb
    if n:
        log = n * tables.ln2(58) + (log >> 4)
    size = abs(b) * abs(log)
    shrinks = (log < 0) != (b < 0)
    if size >> (63 + s):
        value = 0
        if not shrinks:
            status.saturate()
            value = LIMIT
    else:
        x = size >> s
        mantissa, exponent = power(-x if shrinks else x)
        value = scaled(mantissa, 61 - fr - exponent, status)
    return -value if a < 0 and abs(b) >> fb & 1 else value
