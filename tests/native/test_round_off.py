"""What round-off may not do: no variance is negative, and no filter that has answered OK is locked out.

float32, where P0 is far from R, after gaps in time and outliers, against ud in float64.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import factorial

import numpy as np
import pytest
from twin import Twin, compiled_call
from variants import FORMS

from kfgen.generate import Generated, build
from kfgen.native import NativeFilter, load_filters
from kfgen.spec import loads
from kfgen.status import Status

MOTION = {
    1: "",
    2: "p: p + dt*v",
    3: "p: p + dt*v + dt**2/2*a, v: v + dt*a",
    4: "p: p + dt*v + dt**2/2*a + dt**3/6*j, v: v + dt*a + dt**2/2*j, a: a + dt*j",
}  # fmt: skip
SIGMA = 0.01
FULL = ("full-joseph", "full-standard")


def step(axes: int, order: int, dt: float) -> np.ndarray:
    """F of chains of integrators side by side."""
    one = np.array([[dt ** (j - i) / factorial(j - i) if j >= i else 0.0 for j in range(order)] for i in range(order)])
    return np.kron(np.eye(axes), one)


@dataclass(frozen=True)
class Case:
    """axes chains of `order` states, the rows of H (in p and v of the axes, by name), P0 / R, further options.

    exact: the first component is. dense: rows of several states at a ratio where float keeps a filter alive, no more.
    """

    axes: int
    order: int
    rows: tuple[str, ...]
    ratio: float
    options: str = ""
    exact: bool = False
    dense: bool = False

    @property
    def names(self) -> list[str]:
        ends = [""] if self.axes == 1 else ["x", "y"]
        return [state + end for end in ends for state in "pvaj"[: self.order]]

    def text(self, name: str, form: str, scalar: str, unroll: str) -> str:
        std = self.ratio**0.5 * SIGMA
        ends = [""] if self.axes == 1 else ["x", "y"]
        f = ", ".join(re.sub(r"\b([pvaj])\b", rf"\g<1>{end}", MOTION[self.order]) for end in ends)
        states = ", ".join(f"{s}: {{init: 0, std: {std}}}" for s in self.names)
        z = ", ".join(f"z{k}: {{h: {row}, std: {0 if self.exact and k == 0 else SIGMA}}}"
                      for k, row in enumerate(self.rows))  # fmt: skip
        Q = ", ".join(f"{s}: 1e-6" for s in self.names)
        return f"""
kfgen: 1
name: {name}
scalar: {scalar}
dt: {{nominal: 0.1, min: 0.001, max: 1000}}
states: {{{states}}}
dynamics: {{f: {{{f}}}, Q: {{{Q}}}}}
measurements: {{m: {{z: {{{z}}}}}}}
filter: {{type: ekf, {FORMS[form]}{self.options}}}
code: {{unroll: {unroll}}}
"""

    def H(self) -> np.ndarray:
        units = dict(zip(self.names, np.eye(len(self.names)), strict=True))
        return np.array([eval(row, {}, units) for row in self.rows])


CASES = [
    *(Case(1, n, ("p",), ratio) for n in (1, 2, 3, 4) for ratio in (1e8, 1e11, 1e14)),
    *(Case(1, 3, ("p", "p + 0.5*v", "p"), ratio) for ratio in (1e8, 1e14)),
    Case(1, 4, ("p", "v"), 1e12),
    Case(2, 2, ("px", "py"), 1e13),
    *(Case(2, 3, ("0.8*px + 0.6*py", "py", "px"), ratio) for ratio in (1e10, 1e12)),
    Case(2, 3, ("px + vy", "py - vx"), 1e14, dense=True),
    Case(1, 3, ("p", "p + v"), 1e10, exact=True),
    *(Case(1, n, ("p",), ratio, ", adaptive: true") for n in (2, 3) for ratio in (1e6, 1e12)),
    Case(1, 2, ("p",), 1e10, ", adapt_Q: 0.01"),
    Case(1, 3, ("p",), 1e10, ", innovation_floor: 1e-4"),
    Case(1, 3, ("p",), 1e10, ", variance_floor: 1e-9, variance_ceiling: 1e6"),
]  # fmt: skip
SCARCE = [CASES[1], CASES[9], *CASES[12:14], CASES[18], CASES[19]]  # what make test has time for, in loops


def named(texts: Callable[[Case, int], str], cases: list[Case]) -> list[Generated]:
    return [build(loads(texts(case, k))) for k, case in enumerate(cases)]


@cache
def truth() -> list[NativeFilter]:
    return load_filters(named(lambda case, k: case.text(f"true_{k}", "ud-bierman", "double", "full"), CASES))


@pytest.mark.parametrize("form", FULL)
def test_no_filter_is_locked_out(form):
    judge(form, "full", CASES, truth())


@pytest.mark.parametrize("form", FULL)
def test_none_in_loops_is(form):
    judge(form, "none", SCARCE, [truth()[CASES.index(case)] for case in SCARCE])


def judge(form: str, unroll: str, cases: list[Case], true_ones: list[NativeFilter]) -> None:
    floats = load_filters(named(lambda case, k: case.text(f"float_{k}", form, "float", unroll), cases))
    for case, kf, true in zip(cases, floats, true_ones, strict=True):
        rng = np.random.default_rng(1)
        true.init()
        x = np.zeros(len(case.names))
        x[:2] = (5, 2)[: len(x)]
        for k in range(200):
            dt = 100.0 if k in (60, 100) else 0.1
            x = step(case.axes, case.order, dt) @ x
            noise = SIGMA * rng.standard_normal(len(case.rows))
            if case.exact:
                noise[0] = 0
            if "adaptive" in case.options and k == 80:
                noise += 1000.0
            for each in (kf, true):
                assert each.predict(dt=dt) < Status.NULL_ARGUMENT, f"{case}, step {k}"
                assert each.update("m", case.H() @ x + noise) < Status.NULL_ARGUMENT, f"{case}, step {k}"
            assert (np.diag(kf.P) >= 0).all(), f"{case}, step {k}"
        if case.dense:
            continue
        variance, ours = np.diag(true.P), np.diag(kf.P)
        known = variance < 1e-20  # what is measured exactly
        sigma = np.maximum(np.sqrt(variance), 4 * np.spacing(np.float32(np.abs(true.x))))
        assert (np.abs(kf.x - true.x)[~known] <= 3 * sigma[~known]).all(), case
        assert (ours[~known] >= 0.1 * variance[~known]).all(), case
        assert (ours[~known] <= 10 * variance[~known]).all(), case


def test_what_mends_is_the_program():
    """Bit for bit, also where variances are settled, and where correlations are given up."""
    case, rng = Case(2, 3, ("px + vy", "py - vx"), 1e14), np.random.default_rng(1)
    kinds = [(form, unroll) for form in FULL for unroll in ("full", "none")]
    made = [build(loads(case.text(f"bits_{k}", kind[0], "float", kind[1]))) for k, kind in enumerate(kinds)]
    for each, kf in zip(made, load_filters(made, flags=["-O0", "-ffp-contract=off"]), strict=True):
        twin, met = Twin(each, kf), Status.OK
        for k in range(40):
            if k == 20:  # no covariance: px + vy has a variance below zero
                n = len(case.names)
                kf.struct.data.P = [float(i == j) - 3.0 * (i == 0 and j == 4) for j in range(n) for i in range(j + 1)]
                twin.copy_fields()
            z = np.array([5, 6], dtype=np.float32) + np.float32(0.2 * k + SIGMA * rng.standard_normal())
            for function, arguments in (("predict", {"dt": 0.1}), ("update_m", {"z": z})):
                before = kf.x.copy()
                ours, theirs = twin.run(function, **arguments), compiled_call(kf, function, arguments)
                assert ours == theirs, f"step {k}, {function}"
                assert not twin.differences(), f"step {k}, {function}"
                met |= Status(theirs)
                if (k, function) == (20, "update_m"):
                    assert theirs == Status.REGULARIZED
                    np.testing.assert_array_equal(kf.x, before)
                    np.testing.assert_array_equal(kf.P, np.diag(np.diag(kf.P)))
        assert met == Status.REGULARIZED


def test_a_variance_written_below_zero_is_an_error():
    """Where it is seen; elsewhere it is settled."""
    case = Case(1, 2, ("p",), 1.0)
    for kf in load_filters([build(loads(case.text(f"hand_{form[5:]}", form, "float", "full"))) for form in FULL]):
        kf.struct.data.P = (-1.0, 0.0, 1.0)
        assert kf.update("m", [5.0]) == Status.NOT_POSITIVE
        kf.struct.data.P = (1.0, 0.0, -1.0)
        assert kf.update("m", [5.0]) == Status.REGULARIZED
        assert (np.diag(kf.P) >= 0).all()
        kf.struct.data.P = (1.0, 0.0, -2000.0)
        assert kf.predict(dt=0.1) == Status.REGULARIZED
        assert (np.diag(kf.P) >= 0).all()


BANK = """
kfgen: 1
name: bank_NUMBER
scalar: SCALAR
dt: 0.1
states: {p: {init: 0, std: 1000}, v: {init: 0, std: 1000}, a: {init: 0, std: 1000}}
measurements: {pos: {z: {p: {h: p, std: 0.01}}}}
imm:
  modes:
    cv:
      dynamics: {f: {p: p + dt*v, a: 0.5*a}, Q: {p: 1e-6, v: 1e-6, a: 1e-6}}
      filter: {type: ekf, FORM}
    ca:
      dynamics: {f: {p: p + dt*v + dt**2/2*a, v: v + dt*a}, Q: {p: 1e-6, v: 1e-6, a: 1e-6}}
      filter: {type: ekf, FORM}
  transition: [[0.95, 0.05], [0.05, 0.95]]
"""


def test_no_bank_is_locked_out():
    forms = [("ud-bierman", "double"), *((form, "float") for form in FULL)]
    texts = [BANK.replace("NUMBER", str(k)).replace("FORM", FORMS[form]).replace("SCALAR", scalar)
             for k, (form, scalar) in enumerate(forms)]  # fmt: skip
    true, *floats = load_filters([build(loads(text)) for text in texts])
    rng = np.random.default_rng(1)
    for k in range(200):
        z = [5 + 0.2 * k + SIGMA * rng.standard_normal()]
        for kf in (true, *floats):
            assert kf.predict() < Status.NULL_ARGUMENT, f"step {k}"
            assert kf.update("pos", z) < Status.NULL_ARGUMENT, f"step {k}"
            assert (np.diag(kf.P) >= 0).all(), f"step {k}"
    for kf in floats:
        assert (np.abs(kf.x - true.x) <= 3 * np.sqrt(np.diag(true.P))).all()
        assert (np.diag(kf.P) >= 0.1 * np.diag(true.P)).all()
        assert (np.diag(kf.P) <= 10 * np.diag(true.P)).all()
