"""Unscented filters as programs, run in Python, against the compiled C, bit for bit. A failure here is the
printer's: loops, calls of private functions, tables of weights, branches, flags and guards inside of them.

The model uses only operations that IEEE 754 defines to the last bit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sigma_cases import join, points, told, unscented
from twin import Twin, compiled_call

from kfgen.generate import build
from kfgen.native import load_filters
from kfgen.status import Status

BITS = """
kfgen: 1
name: bits
scalar: double
dt: 0.125
parameters: {k: 1.5, edge: 1.8}
states:
  x: {init: 2, var: 0.25}
  y: {init: 1, var: 0.25}
covariances: [[x, y, 0.0625]]
inputs: {push: {}}
noise: {n: {std: 0.25}}
dynamics:
  form: continuous
  f: {x: y*(1 + n/4), y: "-x/4 - y/4 + push + 0.25*n + where(x > k, 0.125, 0)*y"}
  integrator: midpoint
  Q: {x: 0.01, y: 0.02}
measurements:
  fix:
    z:
      a: {h: x + y**2/32 + 0.25*s*x}
      b: {h: "y + table(x, [-2, 0, 2], [1, 0, 0.5])"}
    R: [[0.3, 0.1], [0.1, 0.2]]
    noise: {s: {std: 0.5}}
    gate: {probability: 0.9, reset_after: 1}
  course:
    z: {w: {h: y + x*x/8, std: 0.25, kind: {periodic: 5}}}
filter: {type: ukf}
"""
# kept points are those of one sensor without noise inputs
ALONE = BITS[: BITS.index("  course:")].replace(" + 0.25*s*x", "").replace(
    "    noise: {s: {std: 0.5}}", "    partial: true"
) + ("filter: {type: ukf}\n")
BENT = BITS.replace("y: {init: 1, var: 0.25}", "y: {init: 2, var: 0.25, kind: {periodic: 5}}").replace(
    "x: {init: 2, var: 0.25}", "x: {init: 2, var: 0.25, bounds: [-2, 2.5]}"
)
CASES = {
    "full": (BITS, "full", join("adaptive: {chi2: 1}, adapt_R: 0.05", points("merwe-0.1"))),
    "ud": (BITS, "ud", join('reject: "x > edge"', points("julier-1"))),
    "sequential": (BITS, "sequential", "robust: chernodarov, adaptive: {chi2: 1}, adapt_R: 0.05"),
    "sqrt": (BENT, "sqrt", join("adaptive: {chi2: 1}, variance_floor: {x: 0.1}", points("cubature"))),
    "weights": (BITS, "full", join("adaptive: {chi2: 1}", points("custom-centre"))),
    "kept": (ALONE, "ud", join("adaptive: {chi2: 1}", points("trivial", redraw=False))),
    "kept-weights": (
        ALONE, "sqrt", join("reject: x > edge, variance_ceiling: 0.5", points("custom-centre", redraw=False)),
    ),
    "negative": (BENT, "full", join("innovation_floor: 0.7", points("julier-minus"))),
}  # fmt: skip
NO_LOGARITHM = "code: {gate_count: true}"
LOOPS = "code: {gate_count: true, unroll: none}"


def follow(twin: Twin, text: str) -> Status:
    seen = Status.OK
    for count, (name, arguments) in enumerate(told(text, 6, jump=2)):
        function = name if name == "predict" else f"update_{name}" + ("_masked" if "mask" in arguments else "")
        if count % 7 == 6:  # what has to be refused
            arguments = {k: np.full_like(v, np.nan) if k == "z" else v for k, v in arguments.items()}
        ours, theirs = twin.run(function, **arguments), compiled_call(twin.kf, function, arguments)
        assert ours == theirs, f"call {count}, {function}: program {ours:#x}, C {theirs:#x}"
        assert not twin.differences(), f"call {count}, {function}"
        seen |= Status(theirs)
    if "redraw" in twin.functions:
        twin.kf.predict([0.1])
        twin.run("predict", u=[0.1])
        assert twin.kf.raw["kept"]
        assert twin.kf.redraw() == twin.run("redraw")
        assert not twin.differences()
        assert not twin.kf.raw["kept"]
    return seen


# what is compiled: all; what differs in spelling only; in loops
PARTS = {"float": tuple(CASES), "double": ("full", "kept-weights"),
         "loops": ("ud", "sequential", "sqrt", "weights", "kept-weights", "negative")}  # fmt: skip


@pytest.mark.parametrize("part", PARTS)
def test_c_is_the_program(part):
    made = {}
    for name in PARTS[part]:
        text, form, options = CASES[name]
        code = LOOPS if part == "loops" else NO_LOGARITHM
        spec = unscented(text, form, options, "double" if part == "double" else "float", code)
        spec = replace(spec, name=f"bits_{name.replace('-', '_')}")
        made[name] = spec, build(spec)
    flags = ["-O1", "-ffp-contract=off"]
    filters = load_filters([each for _, each in made.values()], flags=flags)
    seen = Status.OK
    for name, kf in zip(made, filters, strict=True):
        met = follow(Twin(made[name][1], kf), CASES[name][0])
        print(name, met)
        seen |= met
    if part != "double":
        wanted = Status.ANOMALY | Status.GATED | Status.REGULARIZED | Status.POINT_REJECTED | Status.NOT_FINITE
        assert wanted & seen == wanted
        assert seen & (Status.GLITCH_SMALL | Status.GLITCH_LARGE)
