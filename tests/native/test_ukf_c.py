"""Unscented filters in the emitted C: they compute what the reference computes, in every form.

A difference in one form is that layout's, one in the factored forms is that of `gather`, one in all of them is
that of the points, of what is taken for linear, or the reference's, whose own tests decide.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from emitted import problems
from sigma_cases import (
    CYCLE,
    EDGE,
    FORMS,
    HEADING,
    KINDS,
    MULTIPLIED,
    PENDULUM,
    STEADY_R,
    TANK,
    WHOLE,
    join,
    points,
    told,
    unscented,
)  # fmt: skip
from variants import TURN, built, call

from kfgen.native import NativeFilter
from kfgen.reference import reference
from kfgen.status import ERROR, Status, describe
from tests.recorded import peer_rows

OK, GATED, ANOMALY = Status.OK, Status.GATED, Status.ANOMALY
REJECTED, REGULARIZED = Status.POINT_REJECTED, Status.REGULARIZED
RADAR = problems.RADAR.replace("probability: 0.9999", "probability: 0.99, reset_after: 1")


@dataclass(frozen=True)
class Case:
    """seen: the flags that the run must raise, and no others. floats: the forms that are run in float as well."""

    text: str
    options: str
    seen: Status = OK
    jump: float = 0.0
    forms: tuple[str, ...] = tuple(FORMS)
    floats: tuple[str, ...] = ()
    steps: int = 12
    tolerance: float = 1e-9


class Errors:
    """The largest differences to the reference: x in sigma, P, nis, log_likelihood and R relative."""

    def __init__(self) -> None:
        self.worst: dict[str, float] = {}

    def add(self, kf: NativeFilter, ref: Any, adapts: bool) -> None:
        sigma = np.sqrt(ref.P.diagonal())
        found = {
            "x": np.max(np.abs(kf.x - ref.x) / sigma),
            "P": np.max(np.abs(kf.P - ref.P) / np.outer(sigma, sigma)),
            "nis": abs(kf.nis - ref.nis) / max(1, ref.nis),
            "log_likelihood": abs(kf.log_likelihood - ref.log_likelihood) / max(1, abs(ref.log_likelihood)),
        }
        for name, R in ref.R.items() if adapts else ():
            found[f"R of {name}"] = np.max(np.abs(kf.R[name] - R)) / np.max(np.abs(R))
        for key, value in found.items():
            self.worst[key] = max(self.worst.get(key, 0.0), float(value))


def unchanged(kf: NativeFilter, before: NativeFilter, gated: bool) -> bool:
    """Bit for bit; nis and the count of rejections aside for a gated update."""
    now = kf.copy()
    for field in kf.struct.fields if gated else ():
        if field == "nis" or field.startswith("gate_count"):
            setattr(now.struct.data, field, getattr(before.struct.data, field))
    return bytes(now) == bytes(before)


def follow(case: Case, form: str, filters: Mapping[str, NativeFilter]) -> dict[str, Errors]:
    """Filters (by scalar) and the reference along the same readings, which a float carries."""
    ref = reference(unscented(case.text, form, case.options))
    errors = {scalar: Errors() for scalar in filters}
    seen = OK
    for count, (name, given) in enumerate(told(case.text, case.steps, case.jump)):
        arguments = {k: v if k == "mask" else np.float64(np.float32(v)) for k, v in given.items()}
        truth = call(ref, name, arguments)
        seen |= Status(truth)
        for scalar, kf in filters.items():
            place = f"{form}, {scalar}, call {count}, {name}"
            before = kf.copy()
            status = call(kf, name, arguments)
            known = {key: f"{value:.0e}" for key, value in errors[scalar].worst.items()}
            assert status == truth, f"{place}: {describe(status)} for {describe(truth)}, errors so far {known}"
            if status >= ERROR or status & GATED:
                assert unchanged(kf, before, gated=status < ERROR), place
            if hasattr(kf.struct.data, f"gate_count_{name}"):
                assert kf.gate_count[name] == ref.gate_count[name], place
            errors[scalar].add(kf, ref, "adapt_R" in case.options)
    assert seen == case.seen, f"{form}: {describe(seen)}"
    return errors


def agree(case: Case) -> None:
    keys = [(form, "double") for form in case.forms] + [(form, "float") for form in case.floats]
    filters = built({key: unscented(case.text, key[0], case.options, key[1]) for key in keys})
    wrong = []
    for form in case.forms:
        given = {scalar: filters[form, scalar] for scalar in ("double", "float") if (form, scalar) in filters}
        for scalar, errors in follow(case, form, given).items():
            print(form, scalar, {key: f"{value:.1e}" for key, value in errors.worst.items()})
            if max(errors.worst.values()) > (case.tolerance if scalar == "double" else 2e-3):
                wrong.append((form, scalar, errors.worst))
    assert not wrong


FLOATS = {"merwe": ("full", "sqrt"), "julier-1": ("ud",)}
UNGATED = re.sub(" +gate: .*\n", "", CYCLE)


@pytest.mark.parametrize("kind", [*KINDS, "custom-centre", "custom-triangle"])
def test_points(kind):
    """Weights of 1e6 cost six digits."""
    agree(Case(UNGATED, points(kind), floats=FLOATS.get(kind, ()), tolerance=1e-6 if kind == "merwe-1e-3" else 1e-9))


@pytest.mark.parametrize("forms", [("full",), ("ud", "sequential", "sqrt")])
def test_points_of_negative_weight(forms):
    """Two that are not in the centre."""
    agree(Case(UNGATED, points("custom-negative"), forms=forms))


KEPT = {"merwe-0.1": ("full", "sequential"), "julier-1": ("ud",), "trivial": ("full",), "cubature": ("sqrt",),
        "custom-centre": ("sequential",), "custom-triangle": ("ud", "sqrt")}  # fmt: skip


@pytest.mark.parametrize("kind", KEPT)
def test_kept_points(kind):
    """Gated updates in a row, two of which must not use them up."""
    agree(Case(CYCLE, points(kind, redraw=False), GATED | ANOMALY, jump=3, forms=KEPT[kind]))


CASES = {
    "adaptive": Case(
        CYCLE, join("adaptive: {chi2: 1}", points("julier-1")), GATED | ANOMALY, jump=3, forms=("ud", "sqrt")
    ),
    "adaptive-kept": Case(
        CYCLE, join("adaptive: {chi2: 1}, adapt_R: 0.05", points("merwe-0.1", redraw=False)), GATED | ANOMALY, jump=3,
        forms=("full", "sequential"), floats=("full",),
    ),
    "floors": Case(
        UNGATED, "variance_floor: {x: 0.02, y: 0.05}, variance_ceiling: {x: 0.08, y: 0.2}, innovation_floor: 0.12",
        REGULARIZED, forms=("full", "sequential", "sqrt"), floats=("sequential",),
    ),
    "floors-kept": Case(
        UNGATED, join("variance_floor: {y: 0.05}, variance_ceiling: {x: 0.02}", points("julier-1", redraw=False)),
        REGULARIZED, forms=("ud",),
    ),
    "reject": Case(
        CYCLE, join('reject: "x > 1.9 and y < 2 or abs(y) > limit"', points("merwe-0.1", redraw=False)), REJECTED,
        forms=("full", "ud"), steps=20,
    ),
    "reject-non-finite": Case(EDGE, "reject: non_finite", REJECTED, forms=("sequential", "sqrt"), floats=("sqrt",)),
    "robust": Case(
        UNGATED, "robust: chernodarov, adaptive: {chi2: 1}, adapt_R: 0.02",
        Status.GLITCH_SMALL | Status.GLITCH_LARGE | ANOMALY, jump=2, forms=("sequential",), floats=("sequential",),
    ),
    "robust-kept": Case(
        CYCLE, join("robust: {influence: huber, k: 1.2}", points("trivial", redraw=False)),
        Status.GLITCH_LARGE | ANOMALY | GATED, jump=1.2, forms=("sequential",),
    ),
    "pendulum": Case(PENDULUM, "", forms=("full", "sequential"), floats=("full",)),
    "pendulum-adapt-R": Case(
        STEADY_R, join("adapt_R: 0.02", points("cubature")), jump=0.2, forms=("ud", "sqrt")
    ),
    "multiplied": Case(MULTIPLIED, points("merwe-0.1"), forms=("full", "sequential")),
    "multiplied-adaptive": Case(
        MULTIPLIED, join("adaptive: {probability: 0.9}, augment: true", points("julier-1")), ANOMALY, jump=0.3,
        forms=("ud", "sqrt"), floats=("sqrt",),
    ),
    "multiplied-custom": Case(MULTIPLIED, points("custom-centre"), forms=("full",), steps=10),
    "noise-inputs": Case(problems.NOISE_INPUTS, points("merwe-0.1"), forms=("full", "ud")),
    "noise-inputs-augmented": Case(
        problems.NOISE_INPUTS, join("augment: true, adaptive: {chi2: 4}", points("cubature")), ANOMALY, jump=0.2,
        forms=("sequential", "sqrt"),
    ),
    "turn": Case(
        TURN, join("augment: true, adaptive: {chi2: 3}, adapt_R: 0.05", points("merwe-0.1")), ANOMALY | GATED, jump=1.5,
        forms=("full",),
    ),
    "heading": Case(HEADING, points("julier-minus"), forms=("full", "sequential"), floats=("full",)),
    "heading-cubature": Case(
        HEADING, join("adaptive: {chi2: 4}", points("cubature")), ANOMALY, jump=0.3, forms=("ud", "sqrt")
    ),
    "heading-kept": Case(HEADING, points("merwe-0.1", redraw=False), forms=("sqrt",)),
    "radar": Case(RADAR, points("merwe-0.1"), forms=("full", "sequential"), floats=("full",)),
    "radar-kept": Case(
        RADAR, join("adaptive: {chi2: 3}", points("julier-1", redraw=False)), ANOMALY | GATED, jump=15,
        forms=("ud", "sqrt"),
    ),
    "tank": Case(TANK, points("merwe"), forms=("sequential", "sqrt"), floats=("sqrt",)),
    "tank-kept": Case(TANK, points("cubature", redraw=False), ANOMALY | GATED, jump=1.2, forms=("full", "ud")),
    "cv4": Case(problems.CV4, "adaptive: {chi2: 0.5}, adapt_R: 0.02", ANOMALY, forms=("full", "sequential")),
    "chain8": Case(problems.chain(8), points("merwe-0.1"), forms=("full", "ud"), steps=6),
    "chain16": Case(problems.chain(16), points("cubature"), forms=("sqrt",), steps=3),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_options(name):
    agree(CASES[name])


def test_bearings_cross_pi():
    """Those of the radar's track, from which two of the cases live."""
    bearings = [arguments["z"][1] for name, arguments in told(RADAR, 12) if name == "radar"]
    assert max(bearings) - min(bearings) > 5


def peer(name: str) -> np.ndarray:
    return peer_rows(name)


MERWE = KINDS["merwe-0.1"]
KEPT_MERWE, KEPT_JULIER = points("merwe-0.1", redraw=False), points("julier-1", redraw=False)
# covariance, options, file of results
RESULTS = [
    ("full", points("merwe-0.1"), "filterpy_vehicle4_ukf"),
    ("sqrt", points("merwe-0.1"), "filterpy_vehicle4_ukf"),
    ("sqrt", KEPT_MERWE, "filterpy_vehicle4_ukf"),
    ("ud", KEPT_MERWE, "yafl_vehicle4_ukf_full"),
    ("ud", points("merwe-0.1"), "yafl_vehicle4_ukf_full"),
    ("ud", join("adaptive: {probability: 0.999}", KEPT_MERWE), "yafl_vehicle4_ukf_adaptive"),
    ("ud", KEPT_JULIER, "yafl_vehicle4_ukf_full_julier"),
]


def test_other_implementations():
    """|dx| relative to max(|x|, 1e-3 of the largest |x_i| in the run), |dP_ij| to sqrt(P_ii P_jj): 1e-8."""
    filters = built({key: unscented(problems.VEHICLE4, *key[:2]) for key in RESULTS})
    wrong = []
    for key, kf in filters.items():
        result = {int(row[0]): row[1:] for row in peer(key[2])}
        largest = np.max(np.abs([row[:4] for row in result.values()]), axis=0)
        worst = 0.0
        for row, z in enumerate(peer("in_vehicle4")):
            assert kf.predict() == kf.update("gnss", z) == 0, key
            if row in result:
                x, P = result[row][:4], result[row][4:].reshape(4, 4)
                scale = np.sqrt(np.outer(P.diagonal(), P.diagonal()))
                errors = np.abs(kf.x - x) / np.maximum(np.abs(x), 1e-3 * largest), np.abs(kf.P - P) / scale
                worst = max(worst, *(float(np.max(e)) for e in errors))
        if worst > 1e-8:
            wrong.append((key, worst))
    assert not wrong


PLAIN = """
kfgen: 1
name: plain
scalar: double
dt: 0.1
parameters: {g: 0.5}
states:
  x: {init: 1, var: 0.5}
  y: {init: 0.2, var: 0.5}
inputs: {push: {}}
dynamics:
  form: discrete
  f: {x: "0.9*x + 0.1*y + F"}
  Q: {x: 0.1, y: 0.1}
measurements:
  fix:
    z: {a: {h: "x + H", var: 0.25RESIDUAL}, b: {h: y, var: 1}}
filter: {type: ukf}
"""


def plain(f: str = "0", h: str = "0", residual: str = "") -> str:
    text = f', residual: "{residual}"' if residual else ""
    return PLAIN.replace("RESIDUAL", text).replace("+ F", f"+ {f}").replace("+ H", f"+ {h}")


STEPS = {
    "sign": "sign(y)", "floor": "floor(2*y)", "where": "where(y > 0.3, 1, 0)", "abs": "abs(y)/2", "min": "min(x, y)",
    "table": "table(y, [-1, 0, 1], [0, 1, 0])",
}  # fmt: skip


@pytest.mark.parametrize("name", STEPS)
def test_what_bends_without_a_slope_is_not_linear(name):
    """Steps have the derivative 0: their points differ all the same."""
    step = STEPS[name]
    for text in (plain(f=step), plain(h=step)):
        agree(Case(text, "", forms=("full", "sequential"), steps=8))


RESIDUALS = {"t": "(z - h)/(1 + t)", "input": "(z - h)*(1 + push**2)", "parameter": "g*(z - h)", "state": "(z - h)*y"}


@pytest.mark.parametrize("uses", RESIDUALS)
def test_residuals_of_the_sensors_own(uses):
    """What h itself does not use."""
    agree(Case(plain(h="y**2", residual=RESIDUALS[uses]), "", forms=("full", "sequential"), steps=8))


WIDE = "[[0, 0], [2, 0], [-2, 0], [0, 2], [0, -2]]"
MOMENTS = {
    # weighted second moments of 2 and of 1/2 times the covariance; a weighted mean that is not 0
    "wide": (f"{WIDE}, wm: [0, 0.25, 0.25, 0.25, 0.25], wc: [0, 0.25, 0.25, 0.25, 0.25]", WHOLE),
    "narrow": (f"{WIDE}, wm: [0, 0.25, 0.25, 0.25, 0.25], wc: [0, 1/16, 1/16, 1/16, 1/16]", tuple(FORMS)),
    "aside": ("[[0.2, 0.1], [1, 0], [-1, 0], [0, 1], [0, -1]], wm: [0.2, 0.2, 0.2, 0.2, 0.2], "
              "wc: [0.2, 0.2, 0.2, 0.2, 0.2]", tuple(FORMS)),
}  # fmt: skip


@pytest.mark.parametrize("name", MOMENTS)
def test_custom_points_of_other_moments(name):
    """Where they say more than the covariance knows, the update is refused."""
    rows, forms = MOMENTS[name]
    seen = Status.NOT_POSITIVE if name == "wide" else OK
    agree(
        Case(
            plain(f="y**2/8", h="y**2/8"), f"sigma_points: {{kind: custom, points: {rows}}}", seen, forms=forms, steps=8
        )
    )
