"""variance_floor and variance_ceiling limit P_ii itself: the same numbers in every form, whatever the order of the
states."""

from __future__ import annotations

from functools import cache

import numpy as np
from variants import FORMS

from kfgen.generate import Generated, build
from kfgen.native import load_filters
from kfgen.reference import reference
from kfgen.spec import loads
from kfgen.status import Status

LIMITS = ("variance_floor: {a: 0.5, c: 0.01}, variance_ceiling: {b: 0.8}",
          "variance_ceiling: {a: 0.2, b: 0.3, c: 0.1}, variance_floor: {b: 0.1}")  # fmt: skip


@cache
def limited() -> list[tuple[str, Generated]]:
    out = []
    for form, chosen in FORMS.items():
        for options in LIMITS:
            for unroll in ("full", "none"):
                text = f"""
kfgen: 1
name: limited_{len(out)}
scalar: double
dt: 0.1
states: {{a: {{init: 1, std: 1}}, b: {{init: 0.5, std: 0.5}}, c: {{init: -0.3, std: 0.7}}}}
covariances: [[a, b, 0.2]]
dynamics: {{f: {{a: a + dt*b - dt*c**2, b: b + dt*c, c: c - dt*b}}, Q: {{a: 1e-3, b: 1e-3, c: 1e-3}}}}
measurements: {{m: {{z: {{x: {{h: a, std: 0.1}}, y: {{h: b + c**2, std: 0.2}}}}}}, o: {{z: {{w: {{h: c, std: 0.1}}}}}}}}
filter: {{type: ekf, {chosen}, {options}}}
code: {{unroll: {unroll}}}
"""
                out.append((f"{form}, {options}, {unroll}", build(loads(text))))
    return out


def test_limits_are_those_of_the_variances():
    """In every form, straight and in loops: what the reference does."""
    met = Status.OK
    for (what, made), kf in zip(limited(), load_filters([made for _, made in limited()]), strict=True):
        ref, rng = reference(made.code.model.spec), np.random.default_rng(2)
        for k in range(40):
            assert kf.predict() == ref.predict(), f"{what}, step {k}"
            sensor, z = ("m", rng.standard_normal(2)) if k % 3 == 0 else ("o", rng.standard_normal(1))
            status = kf.update(sensor, z)
            assert status == ref.update(sensor, z), f"{what}, step {k}"
            np.testing.assert_allclose(kf.P, ref.P, rtol=1e-9, atol=1e-12, err_msg=f"{what}, step {k}")
            met |= Status(status)
    assert met & Status.REGULARIZED
