"""The arithmetic of fixed point: what the C routines `<prefix>_q_<op>` of templates/helpers/q.j2 compute, bit for bit.

A raw value r with f fraction bits stands for r * 2^-f. Raw values are plain ints in the range of an int32_t.
Everything rounds to nearest, ties upwards: floor(v + 1/2); `mul`, `madd`, `shift` and `narrow` round down instead
where `rounding` is "floor". A result that does not fit saturates to -LIMIT or LIMIT and is flagged.
"""

from __future__ import annotations

from math import isqrt

from kfgen.fixed.arithmetic.limits import LIMIT

LONGEST = 2**48
"""What a term of a sum of 64 bits is cut off at."""
SATURATED = 0x20
"""The bit of a status that says so."""
NEAREST, FLOOR = "nearest", "floor"


class Status:
    """A mask of sticky flags, as the `uint32_t *status` of the C routines."""

    def __init__(self) -> None:
        self.bits = 0

    def saturate(self) -> None:
        self.bits |= SATURATED


def clamp(value: int, status: Status) -> int:
    if -LIMIT <= value <= LIMIT:
        return value
    status.saturate()
    return LIMIT if value > 0 else -LIMIT


def scale(value: int, s: int, rounding: str = NEAREST) -> int:
    """value / 2^s, rounded, unbounded; s of either sign."""
    if s <= 0:
        return value << -s
    return value >> s if rounding == FLOOR else (value + (1 << (s - 1))) >> s


def add(a: int, b: int, status: Status) -> int:
    return clamp(a + b, status)


def sub(a: int, b: int, status: Status) -> int:
    return clamp(a - b, status)


def narrow(a: int, s: int, status: Status, rounding: str = NEAREST) -> int:
    """a / 2^s of an int64_t a, 0 <= s <= 63."""
    return clamp(scale(a, s, rounding), status)


def mul(a: int, b: int, s: int, status: Status, rounding: str = NEAREST) -> int:
    """a b / 2^s, 0 <= s <= 62."""
    return clamp(scale(a * b, s, rounding), status)


def madd(c: int, a: int, b: int, s: int, rounding: str = NEAREST) -> int:
    """c + a b / 2^s, |a|, |b| < 2^30, 0 <= s <= 62: the product is rounded, the sum saturates, without a flag."""
    return max(-LIMIT, min(LIMIT, c + scale(a * b, s, rounding)))


def shift(a: int, s: int, status: Status, rounding: str = NEAREST) -> int:
    """a / 2^s, -62 <= s <= 62."""
    return clamp(scale(a, s, rounding), status)


def gather(w: int, a: int, b: int, s: int) -> int:
    """w + a b / 2^s of an int64_t w, 0 <= s <= 62; the product, rounded to nearest, is cut off at 2^48."""
    return w + max(-LONGEST, min(LONGEST, scale(a * b, s)))


def stretch(w: int, b: int, s: int) -> int:
    """w b / 2^s of an int64_t w, cut off at 2^47, 17 <= s <= 62; the result is cut off at 2^48."""
    w = max(-LONGEST // 2, min(LONGEST // 2, w))
    product = (w >> 16) * b + scale((w & 0xFFFF) * b, 16)
    return max(-LONGEST, min(LONGEST, scale(product, s - 16)))


def word(w: int, s: int, status: Status) -> int:
    """w / 2^s of an int64_t w, to nearest whatever the rounding is."""
    return clamp(scale(w, s), status)


def rest(w: int, s: int) -> int:
    """What is left of w beside its word, in -2^(s - 1) ... 2^(s - 1) - 1."""
    return w - (scale(w, s) << s)


def div(a: int, b: int, s: int, status: Status) -> int:
    """a 2^s / b, -62 <= s <= 62; a/0 is a's limit and 0/0 is 0, both flagged."""
    if b == 0:
        status.saturate()
        return LIMIT * ((a > 0) - (a < 0))
    numerator, denominator = (a << s, b) if s >= 0 else (a, b << -s)
    return clamp((2 * numerator + denominator) // (2 * denominator), status)


def ratio(a: int, b: int, d: int, s: int, status: Status) -> int:
    """a b 2^s / d, of the product its 31 highest bits, -62 <= s <= 62; otherwise as `div`."""
    product = a * b
    drop = max(0, product.bit_length() - 31)
    top = abs(product) >> drop
    return div(top if product >= 0 else -top, d, s + drop, status)


def reciprocal(b: int, s: int, status: Status) -> int:
    """2^s / b, 0 <= s <= 62; 1/0 is LIMIT, flagged."""
    return div(1, b, s, status)


def sqrt(a: int, s: int, status: Status) -> int:
    """The square root of a 2^s, -62 <= s <= 62; of a negative number 0, flagged."""
    if a < 0:
        status.saturate()
        return 0
    return clamp((isqrt(scale(a, -(s + 2), FLOOR)) + 1) >> 1, status)


def floor(a: int, fa: int) -> int:
    """The largest whole number <= a; -LIMIT where that is -2^31."""
    return max(a >> fa << fa, -LIMIT)


def wrap(a: int, half: int, status: Status) -> int:
    """a in (-half, half] by whole periods 2 half; half has 32 fraction bits more than a, 1 <= half / 2^32 < 2^31."""
    value = a << 32
    if -half < value <= half:
        return a
    turns = -((half - value) // (2 * half))  # ceil((value - half) / period)
    most = half >> 32
    return max(-most, min(most, narrow(value - turns * 2 * half, 32, status)))


def hypot(a: int, b: int, status: Status) -> int:
    """sqrt(a^2 + b^2), of the sum's 31 or 32 highest bits."""
    square = a * a + b * b
    spare = max(0, (square.bit_length() - 31) // 2 * 2)
    root = isqrt(square >> spare << 32)
    return clamp(scale(root, 16 - spare // 2), status)
