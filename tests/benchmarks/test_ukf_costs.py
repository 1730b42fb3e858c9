"""What unscented filters cost on a Cortex-M4F, beside their ceilings."""

from __future__ import annotations

from functools import cache

import pytest

from kfgen.cost import Cost, measure, recommended_flags
from kfgen.generate import build
from kfgen.override import override
from kfgen.simulate import simulate
from kfgen.spec import loads
from tests.oracle import problems

PENDULUM = """
kfgen: 1
name: pendulum
dt: 0.05
states:
  th: {init: 0.4, std: 0.3, unit: rad}
  om: {init: 0, std: 0.4, unit: rad/s}
dynamics:
  form: continuous
  f: {th: om, om: -9.81*sin(th) - 0.2*om}
  integrator: rk4
  Q: {th: 1e-5, om: 1e-3}
measurements:
  tip:
    z: {x: {h: sin(th), std: 0.1}}
filter: {type: ekf}
"""
PROBLEMS = {"pendulum": PENDULUM, "vehicle4": problems.VEHICLE4, "chain8": problems.chain(8)}
# of the full form: instructions of one predict and one update, bytes of flash
CEILINGS = {"pendulum": (2600, 4000), "vehicle4": (4200, 4500), "chain8": (8000, 8000)}
SQRT = 1.6  # times the instructions of the full form


@cache
def cost(name: str, form: str) -> Cost:
    spec = override(loads(PROBLEMS[name].replace("type: ekf", f"type: ukf, {form}")), "float")
    generated = build(spec)
    flags = recommended_flags(generated.view) if len(spec.states) >= 8 else []
    return measure(generated, simulate(spec, 30), flags=flags)


@pytest.mark.usefixtures("_tools")
@pytest.mark.parametrize("name", CEILINGS)
def test_full(name):
    instructions, flash = CEILINGS[name]
    found = cost(name, "covariance: full")
    assert found.step <= instructions
    assert found.flash <= flash


@pytest.mark.usefixtures("_tools")
@pytest.mark.parametrize("name", CEILINGS)
def test_sqrt(name):
    assert cost(name, "covariance: sqrt").step <= SQRT * cost(name, "covariance: full").step


@pytest.mark.usefixtures("_tools")
def test_a_linear_measurement_costs_what_it_costs_an_ekf():
    spec = override(loads(problems.VEHICLE4), "float", filter={"covariance": "full", "update": "standard"})
    plain = measure(build(spec), simulate(spec, 30))
    for function, counts in plain.instructions.items():
        if function.startswith("update_"):
            assert cost("vehicle4", "covariance: full").instructions[function] == counts
