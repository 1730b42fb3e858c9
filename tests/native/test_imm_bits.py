"""Banks as programs, run in Python, against the compiled C, bit for bit; what exp and log have touched, nearly.

The modes use only operations that IEEE 754 defines; mu and what it weighs hang on the platform's exp.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from twin import Twin, compiled_call

from kfgen.generate import build
from kfgen.native import load_filters
from kfgen.override import override
from kfgen.spec import loads
from kfgen.status import Status
from tests.oracle.imm_banks import bank

TOP = """
kfgen: 1
name: bits
scalar: double
dt: {nominal: 0.125, min: 0.0625, max: 0.5}
parameters: {k: 1.5}
states:
  x: {init: 2, var: 0.25, bounds: [-2, 2.5]}
  y: {init: 1, var: 0.25}
  w: {init: 2, var: 0.25, kind: {periodic: 5}}
covariances: [[x, y, 0.0625]]
inputs: {push: {}}
measurements:
  fix:
    z:
      a: {h: x + y**2/32}
      b: {h: "y + table(x, [-2, 0, 2], [1, 0, 0.5])"}
    R: [[0.3, 0.1], [0.1, 0.2]]
    gate: {probability: 0.9, reset_after: 1}
    partial: true
"""
COURSE = "  course: {z: {w: {h: w + x/8, std: 0.1, kind: {periodic: 5}}}}\n"
CODE = "code: {gate_count: true}\n"
LOOPS = "code: {gate_count: true, unroll: none}\n"
DYNAMICS = [
    "noise: {n: {std: 0.25}}\ndynamics: {f: {x: x + dt*y, y: y - dt*x/4 + dt*(push + n), w: w + dt*(1 + x*y/16)}, "
    "Q: {x: 0.01, y: 0.02, w: 0.01}}",
    'noise: {n: {std: 0.5}}\ndynamics: {form: continuous, f: {x: y*(1 + n/4), y: "-x/4 - y/4 + push + '
    'where(x > k, 0.125, 0)*y + t/64"}, integrator: midpoint, Q: {x: 0.01, y: 0.02, w: 0.1}}',
    "dynamics: {f: {w: w - dt*x}, Q: {x: 0.1, y: 0.1, w: 0.01}}",
]
CASES = {
    "layouts": (
        TOP + COURSE,
        ["type: ekf", "type: ukf, adaptive: {chi2: 1}", "type: ekf, covariance: full"],
        [[0.75, 0.125, 0.125], [0.25, 0.5, 0.25], [0, 0.5, 0.5]],
    ),
    "learning": (
        TOP + COURSE,
        ["type: ekf, covariance: sqrt", "type: ekf2, adapt_R: 0.05, adapt_Q: 0.02",
         "type: ukf, sequential: true, robust: chernodarov"],
        [[0.5, 0.5, 0], [0, 0.5, 0.5], [0.25, 0.25, 0.5]],
    ),
    "loops": (
        TOP,
        ["type: ekf", "type: ekf, adaptive: {chi2: 1}", "type: iekf, update: joseph, consider: [w]"],
        [[0.75, 0.125, 0.125], [0.25, 0.5, 0.25], [0, 0.5, 0.5]],
    ),
    "kept": (
        TOP + "initialize: {from: fix, states: {x: a}}\n",
        ["type: ukf, covariance: full, sigma_points: {kind: julier, kappa: 1, redraw: false}",
         "type: ukf, covariance: sqrt, variance_floor: {x: 0.1}, sigma_points: {kind: trivial, redraw: false}",
         "type: iekf, update: joseph, gain_limit: 0.4"],
        [[1, 0, 0], [0, 0, 1], [0, 1, 0]],
    ),
}  # fmt: skip
ULPS = 16  # that exp, log and what follows from them may be apart


def follow(twin: Twin) -> Status:
    random, seen = np.random.default_rng(3), Status.OK
    for k in range(16):
        z = random.normal(size=2) * (1 if k % 4 else 6) + [2, 1]
        z[0] = np.nan if k == 9 else z[0]
        todo = [
            ("predict", {"u": random.normal(size=1), "dt": float(random.uniform(0.03, 0.6))}),
            ("update_fix_masked", {"z": z, "mask": k % 4}) if k % 3 else ("update_fix", {"z": z}),
        ]
        if "update_course" in twin.functions:
            todo.append(("update_course", {"z": random.normal(size=1)}))
        A = random.normal(size=(3, 3))
        if k % 8 == 6:
            todo.append(("set_covariance", {"P": A @ A.T if k < 10 else A + A.T}))
            todo.append(("set_state", {"x": A[0]}))
        if "redraw" in twin.functions and k % 5 == 0:
            todo.insert(1, ("redraw", {}))
        for function, arguments in todo:
            ours, theirs = twin.run(function, **arguments), compiled_call(twin.kf, function, arguments)
            assert ours == theirs, f"{k}, {function}: program {ours:#x}, C {theirs:#x}"
            different = {each.partition(":")[0] for each in twin.differences()}
            assert different <= ({"kf.mu", "kf.x"} if function.startswith("update_") else set()), f"{k}, {function}"
            if different:
                assert twin.errors() < ULPS, f"{k}, {function}"
                twin.copy_fields()
            seen |= Status(theirs)
        assert twin.P.tobytes() == twin.kf.P.tobytes()
    return seen


@pytest.mark.parametrize("scalar", ["float", "double"])
def test_c_is_the_program(scalar):
    """Double differs in spelling only."""
    made = {}
    for name in CASES if scalar == "float" else ("learning",):
        top, filters, transition = CASES[name]
        modes = {f"m{k}": f"{DYNAMICS[k]}\nfilter: {{{each}}}" for k, each in enumerate(filters)}
        code = LOOPS if name == "loops" else CODE
        text = bank(top + code, modes, transition, mu_floor=0 if name == "learning" else 1e-9)
        spec = replace(override(loads(text), scalar), name=f"bits_{name}")
        made[name] = spec, build(spec)
    filters = load_filters([each for _, each in made.values()], flags=["-O0", "-ffp-contract=off"])
    seen = Status.OK
    for (_, each), kf in zip(made.values(), filters, strict=True):
        seen |= follow(Twin(each, kf))
    if scalar == "float":
        wanted = Status.ANOMALY | Status.GATED | Status.REGULARIZED | Status.NOT_FINITE | Status.NOT_POSITIVE
        assert wanted & seen == wanted
