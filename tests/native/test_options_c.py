"""Every option of the filters, in the emitted C: it computes what the reference computes, in every form.

A difference in one form is that layout's; the same difference in all forms is the sequence's (robust, adaptive,
floors), the adaptation's, or the reference's, whose own tests decide. Along the way every call that refuses
something is held to leaving the filter as it was.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from emitted import problems
from variants import FORMS, JOSEPH, TURN, built, call, readings, spec_with

from kfgen.native import NativeFilter
from kfgen.reference import reference
from kfgen.status import ERROR, Status, describe

SMALL, LARGE, ANOMALY = Status.GLITCH_SMALL, Status.GLITCH_LARGE, Status.ANOMALY
GATED, REGULARIZED = Status.GATED, Status.REGULARIZED
RADAR = problems.RADAR.replace("probability: 0.9999", "probability: 0.99, reset_after: 2")


@dataclass(frozen=True)
class Case:
    """seen: the flags that the run must raise, and no others."""

    text: str
    options: str
    seen: Status = Status.OK
    forms: tuple[str, ...] = tuple(FORMS)
    steps: int = 50
    glitches: float = 0.15  # how often they begin


SOME = ("ud-joseph", "full-standard", "sqrt")
CASES = {
    "cv4": Case(
        problems.CV4, "robust: chernodarov, adaptive: {chi2: 0.5}, adapt_R: 0.01, adapt_Q: 0.02",
        SMALL | LARGE | ANOMALY,
    ),
    "turn": Case(TURN, "robust: chernodarov, adaptive: {chi2: 1}", SMALL | LARGE | GATED | ANOMALY),
    "turn-adapt": Case(
        TURN, "robust: {psi: k*tanh(e/k)}, adaptive: true, adapt_R: 0.05, adapt_Q: 0.02",
        SMALL | LARGE | GATED | ANOMALY, SOME,
    ),
    "turn-iekf": Case(TURN, "type: iekf, iterations: 3, innovation_floor: 0.4", GATED | ANOMALY | REGULARIZED, SOME),
    "turn-ekf2": Case(
        TURN, "type: ekf2, robust: huber, adaptive: {probability: 0.9}, adapt_R: 0.05", LARGE | GATED | ANOMALY,
        ("ud-bierman", "full-joseph"),
    ),
    "turn-gain": Case(
        TURN, "robust: chernodarov, adaptive: {chi2: 1}, adapt_Q: 0.02, consider: [th], gain_limit: 0.5",
        SMALL | LARGE | GATED | ANOMALY | REGULARIZED, JOSEPH,
    ),
    "turn-gain-iekf": Case(TURN, "type: iekf, consider: [y], gain_limit: 0.3", GATED | ANOMALY | REGULARIZED, JOSEPH),
    "radar": Case(RADAR, "robust: huber, adaptive: {chi2: 3}", LARGE | GATED | ANOMALY, ("ud-joseph", "sqrt")),
    "radar-iekf": Case(RADAR, "type: iekf, iterations: 4", GATED | ANOMALY, ("ud-bierman", "full-standard")),
    "radar-ekf2": Case(
        RADAR, "type: ekf2, adapt_R: 0.02, adapt_Q: 0.02", GATED | ANOMALY, ("ud-bierman", "full-joseph")
    ),
    "noise": Case(
        problems.NOISE_INPUTS, "robust: chernodarov, adaptive: {chi2: 1}", SMALL | LARGE | GATED | ANOMALY,
        ("ud-bierman", "full-standard"), 40,
    ),
    "noise-ekf2": Case(
        problems.NOISE_INPUTS, "type: ekf2, robust: huber, adaptive: {chi2: 1}", LARGE | GATED | ANOMALY,
        ("ud-joseph", "sqrt"), 40,
    ),
    "att": Case(
        problems.ATT, "robust: chernodarov, adaptive: {chi2: 4}", SMALL | LARGE | ANOMALY, ("ud-bierman",),
        steps=25, glitches=0.04,
    ),
}  # fmt: skip


def unchanged(kf: NativeFilter, before: NativeFilter, gated: bool) -> bool:
    """Bit for bit; nis and the count of rejections aside for a gated update."""
    now = kf.copy()
    for field in kf.struct.fields if gated else ():
        if field == "nis" or field.startswith("gate_count"):
            setattr(now.struct.data, field, getattr(before.struct.data, field))
    return bytes(now) == bytes(before)


class Errors:
    """The largest differences to the reference: x in sigma, P, nis, log_likelihood, R and Q relative."""

    def __init__(self) -> None:
        self.worst: dict[str, float] = {}

    def add(self, kf: NativeFilter, ref: Any, options: str) -> None:
        sigma = np.sqrt(ref.P.diagonal())
        found = {
            "x": np.max(np.abs(kf.x - ref.x) / sigma),
            "P": np.max(np.abs(kf.P - ref.P) / np.outer(sigma, sigma)),
            "nis": abs(kf.nis - ref.nis) / max(1, ref.nis),
            "log_likelihood": abs(kf.log_likelihood - ref.log_likelihood) / max(1, abs(ref.log_likelihood)),
        }
        if "adapt_R" in options:
            for name, R in ref.R.items():
                found[f"R of {name}"] = np.max(np.abs(kf.R[name] - R)) / np.max(np.abs(R))
        if "adapt_Q" in options:
            found["Q"] = np.max(np.abs(kf.Q - ref.Q)) / np.max(np.abs(ref.Q))
        for key, value in found.items():
            self.worst[key] = max(self.worst.get(key, 0.0), float(value))


def follow(case: Case, filters: Mapping[str, NativeFilter], scalar: type = np.float64) -> dict[str, Errors]:
    """All filters and the reference along the same readings, which a scalar of this type carries."""
    ref = reference(spec_with(case.text, case.options, case.forms[0]))
    errors = {form: Errors() for form in filters}
    seen = Status.OK
    for count, (name, arguments) in enumerate(readings(case.text, case.steps, 1, case.glitches)):
        arguments = {k: v if k == "mask" else np.asarray(v).astype(scalar).astype(float) for k, v in arguments.items()}
        truth = call(ref, name, arguments)
        seen |= Status(truth)
        for form, kf in filters.items():
            place = f"{form}, call {count}, {name}"
            before = kf.copy()
            status = call(kf, name, arguments)
            assert status == truth, f"{place}: {describe(status)} for {describe(truth)}"
            if status >= ERROR or status & GATED:
                assert unchanged(kf, before, gated=status < ERROR), place
            if ref.gate_count and hasattr(kf.struct.data, f"gate_count_{name}"):
                assert kf.gate_count[name] == ref.gate_count[name], place
            errors[form].add(kf, ref, case.options)
    assert seen == case.seen, describe(seen)
    return errors


@pytest.mark.parametrize("name", CASES)
def test_double(name):
    case = CASES[name]
    filters = built({form: spec_with(case.text, case.options, form) for form in case.forms})
    for form, errors in follow(case, filters).items():
        print(form, {key: f"{value:.1e}" for key, value in errors.worst.items()})
        assert max(errors.worst.values()) < 1e-9, (form, errors.worst)
    x = np.array([kf.x for kf in filters.values()])
    sigma = np.sqrt(next(iter(filters.values())).P.diagonal())
    assert np.max(np.abs(x - x[0]) / sigma) < 1e-9


FLOAT = {
    "cv4": ("ud-bierman", "full-standard"),
    "turn-adapt": ("sqrt",),
    "radar-ekf2": ("full-joseph",),
    "noise": ("ud-bierman",),
}


@pytest.mark.parametrize("name", FLOAT)
def test_float(name):
    """Measured: 9e-5 at most, of sigma and relative to what is compared."""
    case = CASES[name]
    filters = built({form: spec_with(case.text, case.options, form, "float") for form in FLOAT[name]})
    for form, errors in follow(case, filters, np.float32).items():
        print(form, {key: f"{value:.1e}" for key, value in errors.worst.items()})
        assert max(errors.worst.values()) < 1e-3, (form, errors.worst)


def test_the_root_in_and_out():
    """The lower triangle is read, columns lose their sign, what is not finite is refused and changes nothing."""
    kf = built({0: spec_with(TURN, "type: ekf", "sqrt")})[0]
    ref = reference(kf.spec)
    np.testing.assert_allclose(kf.sqrt_covariance, np.linalg.cholesky(ref.P), rtol=1e-14)
    S = np.array([[2, np.nan, np.inf], [1, -3, np.nan], [0.5, -0.25, 0.125]])
    for each in (kf, ref):
        assert each.set_sqrt_covariance(S) == 0
    np.testing.assert_allclose(kf.P, ref.P, rtol=1e-15)
    np.testing.assert_array_equal(kf.sqrt_covariance, [[2, 0, 0], [1, 3, 0], [0.5, 0.25, 0.125]])
    before = bytes(kf)
    for i, j in zip(*np.tril_indices(3), strict=True):
        for bad in (np.nan, np.inf, -np.inf):
            wrong = np.eye(3)
            wrong[i, j] = bad
            assert kf.set_sqrt_covariance(wrong) == Status.NOT_FINITE
    function, ffi = kf.struct.function("set_sqrt_covariance"), kf.struct.ffi
    assert function(kf.struct.data, ffi.NULL) == function(ffi.NULL, ffi.new("double[9]")) == Status.NULL_ARGUMENT
    kf.struct.function("get_sqrt_covariance")(kf.struct.data, ffi.NULL)  # nothing, and no crash
    assert bytes(kf) == before
    A = np.random.default_rng(1).normal(size=(3, 2))
    assert kf.set_covariance(A @ A.T) == 0  # of rank 2
    np.testing.assert_allclose(kf.P, A @ A.T, rtol=1e-12, atol=1e-15)
    assert kf.set_sqrt_covariance(np.zeros((3, 3))) == 0
    assert not kf.P.any()
    with pytest.raises(AttributeError):
        built({0: spec_with(TURN, "type: ekf", "ud-bierman")})[0].set_sqrt_covariance(np.eye(3))


def test_a_floor_that_only_nis_meets():
    """The textbook's s is below the floor, that of the update as it is made is not: REGULARIZED says what was made."""
    text = problems.one_state("  form: discrete\n  f: {x: x}")
    options = "adaptive: {chi2: 1}, innovation_floor: 2"
    forms = ("ud-joseph", "full-standard", "sqrt")
    for form, kf in built({form: spec_with(text, options, form) for form in forms}).items():
        ref = reference(kf.spec)
        for z in (1.5, 4.0):  # s = 1.5 is raised to 2; it is inflated to 9 by an innovation of 3
            kf.init()
            ref.init()
            assert kf.update("s", [z]) == ref.update("s", [z]) == (REGULARIZED if z < 2 else ANOMALY), form
            assert kf.nis == pytest.approx((z - 1) ** 2 / 2)
