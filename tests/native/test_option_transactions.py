"""Filters with options: after an error, and after a gated update, all is what it was, learnt covariances included.

A failure here is the algorithm's: a guard is missing, or stands behind a store.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator
from functools import cache

import numpy as np
from calling import Calls, refused
from emitted import problems
from variants import FORMS, TURN, built, spec_with

from kfgen.native import NativeFilter
from kfgen.status import ERROR, Status, describe

BAD = (math.nan, math.inf, -math.inf)
LEARNING = "robust: chernodarov, adaptive: {chi2: 1}, adapt_R: 0.05, adapt_Q: 0.02"
OPTIONS = [
    ("ud-bierman", LEARNING),
    ("sqrt", LEARNING),
    ("ud-joseph", "type: iekf, consider: [y], gain_limit: 0.4, innovation_floor: 0.5"),
    ("full-joseph", "type: ekf2, robust: {psi: k*tanh(e/k)}, adapt_R: 0.05, variance_ceiling: 1"),
    ("full-standard", "type: ekf2, adaptive: {chi2: 1}"),
]
KEPT = {"x", "U", "D", "P", "S", "Q", "R_fix", "R_course", "residual_fix", "residual_course"}


class Spoiled:
    """A filter that has moved, so that there is something to spoil, and returns to where it was."""

    def __init__(self, kf: NativeFilter) -> None:
        self.kf = kf
        self.calls = Calls(kf)
        for name in ("predict", *self.calls.updates):
            assert self.calls(name) < ERROR
        self.good = kf.copy()

    def back(self) -> None:
        self.kf.struct.ffi.memmove(self.kf.struct.data, self.good.struct.data, len(bytes(self.good)))


def option_of(kf: NativeFilter) -> str:
    return ", ".join(OPTIONS[int(kf.name.rpartition("_")[2])])


@cache
def filters(text: str) -> list[NativeFilter]:
    return list(built({key: spec_with(text, key[1], key[0], "float") for key in OPTIONS}).values())


def spoiled(text: str = TURN) -> Iterator[Spoiled]:
    for kf in filters(text):
        kf.init()
        yield Spoiled(kf)


def test_wrong_arguments():
    """NaN and infinity in every argument; what a mask leaves out may be anything."""
    for each in spoiled():
        kf, calls = each.kf, each.calls
        for name in ("predict", *calls.updates):
            refused(calls, Status.NULL_ARGUMENT, name, kf=None)
            for key, good in calls.vectors[name].items():
                if key == "mask":
                    continue
                refused(calls, Status.NULL_ARGUMENT, name, **{key: None})
                for i, bad in itertools.product(range(len(good)), BAD):
                    if calls.leaves(name, key, i):
                        continue
                    wrong = good.copy()
                    wrong[i] = bad
                    refused(calls, Status.NOT_FINITE, name, **{key: wrong})
                    if name.endswith("_masked"):
                        refused(calls, Status.NOT_FINITE, name, z=wrong, mask=np.array([1 << i]))
                        others = np.array([0b111 & ~(1 << i)])
                        status = calls(name, z=wrong, mask=others)
                        after = bytes(kf)
                        each.back()
                        wrong[i] = 7.0
                        assert calls(name, z=wrong, mask=others) == status < ERROR
                        assert bytes(kf) == after != bytes(each.good)
                        each.back()


def test_spoiled_filters():
    """NaN and infinity in what the options keep: refused without a change, or without a trace in the state."""
    for each in spoiled():
        kf = each.kf
        for field in sorted(kf.struct.fields & KEPT - {"x", "U", "D", "P"}):
            for index, bad in itertools.product(range(len(kf.raw[field])), BAD):
                for name in ("predict", *each.calls.updates):
                    each.back()
                    getattr(kf.struct.data, field)[index] = bad
                    before = bytes(kf)
                    status = each.calls(name)
                    place = f"{kf}: {field}[{index}] = {bad}, {name}: {status:#x}"
                    if status >= ERROR:
                        assert bytes(kf) == before, place
                    elif status != Status.GATED:
                        assert np.isfinite(kf.x).all(), place


def test_what_is_far_too_large():
    """Readings up to the end of a float's range: refused, or everything that the filter keeps is finite."""
    met, wrong = set(), []
    for each in spoiled(re.sub(r"\n    gate: .*", "", TURN)):
        kf = each.kf
        for name, size in itertools.product(each.calls.updates, 10.0 ** np.arange(4, 39, 2)):
            good = each.calls.vectors[name]["z"]
            for part in (slice(None), *range(len(good))):
                each.back()
                z = good.copy()
                z[part] = size
                before = bytes(kf)
                status = each.calls(name, z=z)
                met.add(status)
                if status >= ERROR:
                    assert bytes(kf) == before
                else:
                    bad = {f: v for f, v in kf.raw.items() if f in KEPT and not np.isfinite(v).all()}
                    if bad:
                        wrong.append(f"{option_of(kf)}: {name}({z}): {describe(status)}, {bad}")
    assert not wrong, "\n".join(wrong[:8])
    assert {Status.OK, Status.NOT_FINITE} < met


def test_a_gated_update_says_nothing_else():
    """Readings that robust and adaptive updates would flag: GATED alone; only nis and the count have changed."""
    for each in spoiled():
        kf = each.kf
        for name, sensor in each.calls.updates.items():
            each.back()
            m = len(kf.components(sensor))
            count = 1
            setattr(kf.struct.data, f"gate_count_{sensor}", count)
            before = kf.copy()
            z = np.full(m, 60.0) if sensor == "fix" else np.array([0.5, -2.0])
            assert each.calls(name, z=z) == Status.GATED, (option_of(kf), name)
            assert kf.gate_count[sensor] == count + 1
            assert kf.nis > 20
            setattr(kf.struct.data, f"gate_count_{sensor}", count)
            kf.struct.data.nis = before.struct.data.nis
            assert bytes(kf) == bytes(before), (option_of(kf), name)


# R may turn out to be none, Q likewise
VARYING = """
kfgen: 1
name: varying
dt: 0.125
parameters: {r: 0.25, q: 0.01}
states:
  x: {init: 1, var: 0.5}
  y: {init: 2, var: 0.5}
dynamics: {form: discrete, f: {x: x + dt*y - x*y/16}, Q: [[q, 0.001], [0.001, 0.01]]}
measurements:
  s:
    z: {a: {h: x + y**2/16}, b: {h: y}}
    R: [[1, r], [r, 1]]
    partial: true
    gate: {probability: 0.999}
filter: {type: ekf}
"""
VARIANTS = [
    ("ud-bierman", "robust: chernodarov, adaptive: true"),
    ("full-joseph", "type: iekf"),
    ("full-standard", "type: ekf2, adaptive: true"),
    ("ud-joseph", "type: ekf2, consider: [y], gain_limit: 0.5"),
    ("sqrt", "robust: huber, innovation_floor: 0.1"),
]


def test_indefinite_noise():
    for (form, options), kf in built({key: spec_with(VARYING, key[1], key[0], "float") for key in VARIANTS}).items():
        calls = Calls(kf)
        for r in (2.0, -1.5, math.nan):
            kf.init()
            kf.parameters["r"] = r
            error = Status.NOT_FINITE if math.isnan(r) else Status.NOT_POSITIVE
            for name in calls.updates:
                refused(calls, error, name)
                refused(calls, Status.NOT_FINITE, name, z=np.array([math.nan, 0]))
                refused(calls, error, name, z=np.array([1e9, -1e9]))  # before the gate
            for mask in (1, 2):  # alone, each has a variance
                assert kf.update("s", [1.0, 2.0], mask=mask) < ERROR, (form, options)
            assert kf.predict() == 0
        kf.init()
        kf.parameters["q"] = -1.0
        refused(calls, Status.NOT_POSITIVE, "predict")
        assert kf.update("s", [1.0, 2.0]) == 0


LATE = """
kfgen: 1
name: late
states: {x: {init: 0.01, var: 0.5}}
dynamics: {form: discrete, f: {x: x}, Q: {x: 0.1}}
measurements:
  s: {z: {z: {h: sqrt(x), var: 0.01}}}
filter: {type: ekf}
"""


def test_errors_at_the_very_end():
    """The update leads to x < 0, where h has no value any more: neither the residual nor the next iterate."""
    specs = {form: spec_with(LATE, "adapt_R: 0.1, adapt_Q: 0.1", form, "float") for form in FORMS}
    for form in ("ud-joseph", "sqrt"):
        specs[f"{form}, iekf"] = spec_with(LATE, "type: iekf, iterations: 2", form, "float")
    for kf in built(specs).values():
        refused(Calls(kf), Status.NOT_FINITE, "update_s", z=np.array([0.0]))
        assert kf.update("s", [0.2]) == 0


def test_a_Q_beyond_the_numbers():
    """A correction whose square overflows, though its nis does not: no Q, and no update."""
    text = LATE.replace("sqrt(x)", "x").replace("var: 0.5", "var: 1e30")
    for form, kf in built({form: spec_with(text, "adapt_Q: 0.1", form, "float") for form in FORMS}).items():
        refused(Calls(kf), Status.NOT_FINITE, "update_s", z=np.array([1e20]))
        assert kf.update("s", [1e19]) == 0, form
        assert np.isfinite(kf.Q).all()


def test_R_stays_positive():
    """Two sensors that are one, a prior of 1e6, noise of 1e-6: 10^5 steps in float with outliers."""
    text = """
kfgen: 1
name: pair
states: {x: {init: 0, var: 1e6}, v: {init: 0, var: 1}}
dynamics: {form: discrete, f: {x: x + v, v: 0.9*v}, Q: {v: 1e-6}}
measurements:
  s: {z: {a: {h: x, var: 1e-6}, b: {h: x, var: 1e-6}}}
filter: {type: ekf}
"""
    steps = 100_000
    random = np.random.default_rng(4)
    z = random.normal(0, 1e-3, (steps, 2))
    z[:, 1] = z[:, 0]
    z[random.random(steps) < 0.001] *= 1e6
    rates = {"ud-bierman": "0.5", "ud-joseph": "1e-4", "full-joseph": "0.5", "full-standard": "1e-4", "sqrt": "0.5"}
    for form, kf in built({f: spec_with(text, f"adapt_R: {r}", f, "float") for f, r in rates.items()}).items():
        for part in np.array_split(z, 20):
            result = kf.run({"s.a": part[:, 0], "s.b": part[:, 1]})
            assert result.counts() == {}, form
            assert np.isfinite(result.x).all(), form
            assert (result.var[1:] >= 0).all(), form
            values = np.linalg.eigvalsh(kf.R["s"])
            assert values[1] > 0, form
            assert values[0] > -1e-7 * values[1], (form, values)


def test_a_million_steps():
    """A robust and adaptive filter over roots, with outliers and gaps: finite and positive to the end."""
    steps = 1_000_000
    random = np.random.default_rng(8)
    z = random.normal(0, 20, (steps, 2))
    z[random.random((steps, 2)) < 0.02] *= 30
    z[random.random(steps) < 0.1] = np.nan
    kf = built({0: spec_with(problems.CV4, "robust: chernodarov, adaptive: true", "sqrt", "float")}, ("-O2",))[0]
    kf.set_state([0, 0, 0, 0])
    result = kf.run({"gnss.x": z[:, 0], "gnss.y": z[:, 1]})
    assert result.counts() == {}
    assert {Status.GLITCH_SMALL, Status.GLITCH_LARGE} <= result.counts(errors=False)["update_gnss"].keys()
    assert np.isfinite(result.x).all()
    assert (result.var > 0).all()
    assert np.isfinite(result.var).all()
    assert np.max(np.abs(result.x[:, :2])) < 30
    assert np.linalg.eigvalsh(kf.P)[0] > 0
