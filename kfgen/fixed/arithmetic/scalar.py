"""q<m>.<n> as a scalar type: how integers are spelled, and what its operations give, bit for bit."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from fractions import Fraction
from typing import Any

from kfgen.fixed.arithmetic.limits import FINE, INSIDE, LEAST, LIMIT
from kfgen.fixed.arithmetic.operations import NEAREST, Status, scale
from kfgen.fixed.arithmetic.twins import TWINS, WITHOUT_STATUS

PREFIX = "q_"


class Fixed:
    """int32_t, every value with a binary point of its own, which the program knows and the number does not."""

    helpers = "helpers/q.j2"
    helper_ops = frozenset({"segment"})
    silent_ops = frozenset({"q_abs", "q_min", "q_max", "q_sign", "q_count", "q_fma"}) | {
        f"q_{name}" for name in WITHOUT_STATUS
    }
    uniform = False
    c_type = "int32_t"
    size = 4
    epsilon = Fraction(1, 2**26)
    smallest = Fraction(0)

    def __init__(self, name: str, rounding: str = NEAREST) -> None:
        self.name = name
        self.bits = int(name.partition(".")[2])
        self.probability = Fraction(1, 2 ** max(self.bits, FINE))
        self.rounding = rounding
        self.status = Status()

    def literal(self, value: Fraction) -> str:
        assert value.denominator == 1, "a constant of the integer program"
        return "INT32_MIN" if value == LEAST else str(int(value))

    def nearest(self, value: Fraction) -> Fraction:
        return value

    def function(self, op: str) -> str:
        return op

    def convert(self, value: Any) -> Any:
        return int(value)

    def quiet(self) -> AbstractContextManager[object]:
        return nullcontext()

    def evaluate(self, op: str, data: Any, args: list[Any]) -> Any:
        if op == "q_mac":
            return self._mac(args, data[0])
        if op == "q_fma":
            c, a, b = args
            assert -INSIDE <= a <= INSIDE, "factors that were proved to be small are not"
            assert -INSIDE <= b <= INSIDE, "factors that were proved to be small are not"
            return self._proved(c + scale(a * b, data[0], self.rounding))
        if op.startswith(PREFIX):
            if op == "q_fit":
                return self._inside(args[0])
            if op in _OPERATIONS:
                return _OPERATIONS[op](data, *args)
            name = op.removeprefix(PREFIX)
            given = [*args, *(data or ())]
            if name in _ROUNDED:
                return TWINS[name](*given, self.status, self.rounding)
            if name in WITHOUT_STATUS:
                return TWINS[name](*given)
            return TWINS[name](*given, self.status)
        value = _OPERATIONS[op](data, *args)
        return value if isinstance(value, bool) else self._proved(value)

    def _mac(self, args: list[int], s: int) -> int:
        """c + a b / 2^s, clipped."""
        c, a, b = args
        assert -INSIDE <= c <= INSIDE
        assert -INSIDE <= a <= INSIDE
        assert -INSIDE <= b <= INSIDE
        return self._inside(c + scale(a * b, s, self.rounding))

    def _inside(self, value: int) -> int:
        if -INSIDE <= value <= INSIDE:
            return value
        self.status.saturate()
        return -INSIDE if value < 0 else INSIDE

    def _proved(self, value: int) -> int:
        if not LEAST <= value <= LIMIT:
            raise OverflowError("a value that was proved to fit does not")
        return value


_ROUNDED = {"mul", "madd", "shift", "narrow"}
_OPERATIONS: dict[str, Callable[..., Any]] = {
    "add": lambda d, a, b: a + b,
    "sub": lambda d, a, b: a - b,
    "mul": lambda d, a, b: a * b,
    "neg": lambda d, a: -a,
    "lt": lambda d, a, b: a < b,
    "le": lambda d, a, b: a <= b,
    "not": lambda d, a: not a,
    "segment": lambda d, a: sum(1 for v in d.x[:-1] if v <= a) + (d.x[-1] < a),
    "table_x": lambda d, i: int(d.starts()[i]),
    "table_y": lambda d, i: int(d.values()[i]),
    "table_slope": lambda d, i: int(d.slopes()[i]),
    "q_min": lambda d, a, b: min(a, b),
    "q_max": lambda d, a, b: max(a, b),
    "q_sign": lambda d, a: (a > 0) - (a < 0),
    "q_abs": lambda d, a: min(abs(a), LIMIT),
    "q_count": lambda d, a: min(a, LIMIT),
}
