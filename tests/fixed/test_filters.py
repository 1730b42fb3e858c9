"""Filters in integers: the bits of the interpreter are those of the C, and the estimate is that of float64."""

from __future__ import annotations

import numpy as np
import pytest

import kfgen
from kfgen import native, simulate
from kfgen.errors import SpecError
from kfgen.fixed.arithmetic.scalar import Fixed
from kfgen.generate import build
from kfgen.ir import interpret
from kfgen.override import override
from kfgen.spec.loading import loads
from kfgen.status import Status
from tests.oracle.problems import ATT, NOISE_INPUTS

BALL = """
kfgen: 1
name: ball
scalar: q16.16
dt: 0.05
states:
  s: {init: 0, var: 1, range: [-200, 200]}
  v: {init: 0, var: 1, range: [-200, 200]}
  g: {init: 6, var: 1, range: [-200, 200]}
dynamics:
  f: {s: s + v*dt + g*dt**2/2, v: v + g*dt}
  Q: {s: 1e-4, v: 1e-4, g: 1e-4}
measurements:
  pos: {z: {s: {h: s, var: 0.25}}}
filter: {type: ekf, covariance: full, update: standard}
"""
TURN = """
kfgen: 1
name: turn
scalar: q16.16
dt: 0.1
states:
  x: {init: 0, std: 3, range: [-10000, 10000]}
  th: {init: 0.001, std: 0.002, kind: angle}
  b: {init: 0, std: 1e-3}
inputs:
  rate: {range: [-0.001, 0.001]}
dynamics:
  f: {x: x + dt*20*sin(th), th: th + dt*(rate - b)}
  Q: {x: 1e-4, th: 1e-10, b: 1e-12}
measurements:
  fix: {z: {x: {h: x, std: 1}}, gate: {probability: 0.999}}
  sight: {z: {a: {h: "atan2(x, 1000)", std: 1e-3, kind: angle}}}
filter: {type: ekf}
"""
FORMS = [("full", "standard"), ("full", "joseph"), ("ud", "bierman"), ("ud", "joseph")]
FLAGS = {name: int(getattr(Status, name)) for name in Status.__members__}


class Twin:
    """The integer program of a filter, interpreted."""

    def __init__(self, generated):
        self.code = generated.code
        self.functions = {f.name: f for f in self.code.functions}
        self.scalar = Fixed(self.code.model.spec.scalar)
        self.memory = interpret.Memory()
        for block in self.code.blocks:
            if block.size is None:
                self.memory.numbers[f"kf.{block.name}"] = 0
            else:
                self.memory.arrays[f"kf.{block.name}"] = [0] * block.size

    def call(self, name):
        self.scalar.status.bits = 0
        flags = interpret.run(self.functions[name], self.scalar, self.memory)
        status = sum(FLAGS[flag] for flag in flags)
        refused = status & 0x700 or "GATED" in flags
        return status if refused else status | self.scalar.status.bits

    def fields(self):
        return {name.removeprefix("kf."): values for name, values in self.memory.arrays.items()
                if name.startswith("kf.")}  # fmt: skip


def raw_field(kf, name):
    """The integers of a field, as its path in the struct names it."""
    if name.startswith("modes."):
        _, mode, field = name.split(".")
        return next(m for m in kf.modes if m.name == mode).raw[field]
    return kf.raw[name]


def follow(text, scalar="q16.16", steps=120, driven=(), **chosen):
    """Run C, interpreter and reference side by side; the largest error in sigma. driven: sensors that take inputs."""
    spec = override(loads(text) if "\n" in text else kfgen.load(text), scalar, filter=chosen)
    generated = build(spec)
    kf = native.load_filters([generated])[0]
    twin, ref = Twin(generated), kfgen.reference(override(spec, "double"))
    twin.call("init")
    log = simulate.simulate(spec, steps, seed=5)
    units, value = kf.struct.units, kf.struct.value
    worst = 0.0
    for k in range(steps):
        raw = value.to_raw(np.array([log.columns[name][k] for name in kf.inputs]), units.u)
        u = value.to_physical(raw, units.u)
        twin.memory.numbers.update({f"u.{n}": int(r) for n, r in zip(kf.inputs, raw, strict=True)})
        given = {"u": u} if kf.inputs else {}
        if spec.dt is not None and spec.dt.run_time:
            raw = value.to_raw(np.array(log.columns["t"][k] - log.columns["t"][k - 1] if k else 0.4), units.dt)
            twin.memory.numbers["dt"] = int(raw)
            given["dt"] = float(value.to_physical(raw, units.dt))
        assert kf.predict(**given) == twin.call("predict")
        ref.predict(**given)
        for sensor, components in kf.sensors.items():
            raw = value.to_raw(np.array([log.columns[f"{sensor}.{c}"][k] for c in components]), units.z[sensor])
            twin.memory.numbers.update({f"z.{c}": int(r) for c, r in zip(components, raw, strict=True)})
            z = value.to_physical(raw, units.z[sensor])
            inputs = {"u": u} if sensor in driven else {}
            assert kf.update(sensor, z, **inputs) == twin.call(f"update_{sensor}")
            ref.update(sensor, z, **inputs)
        for name, values in twin.fields().items():
            assert raw_field(kf, name).tolist() == values, (k, name)
        if spec.imm is not None:
            assert np.all(kf.raw["mu"] >= 0)
            assert abs(np.sum(kf.raw["mu"]) - (1 << twin.scalar.bits)) <= len(kf.mu)
            assert np.max(np.abs(kf.mu - ref.mu)) < 0.05
        worst = max(worst, float(np.max(np.abs(kf.x - ref.x) / np.sqrt(np.diag(ref.P)))))
        assert np.all(np.linalg.eigvalsh(kf.P) > 0)
    return worst


@pytest.mark.parametrize(("covariance", "update"), FORMS)
def test_ball(covariance, update):
    assert follow(BALL, covariance=covariance, update=update) < 0.02


@pytest.mark.parametrize(("covariance", "update"), FORMS[::2])
def test_constant_velocity(covariance, update):
    assert follow("specs/cv4.yaml", covariance=covariance, update=update) < 0.02


def test_correlated_readings_and_conditions_that_are_known():
    """A guard that cannot fail leaves a factor of 1, and the digits of the other one are all there."""
    assert follow(NOISE_INPUTS, steps=30, driven=("gnss",)) < 0.01


def test_noise_that_does_not_reach_all_states():
    """That of three rates on a quaternion has no spread along it: a pivot of nothing but round-off."""
    kf, ref = (kfgen.compile(loads(ATT), scalar, flags=["-O0"]) for scalar in ("q16.16", "double"))
    log = simulate.simulate(loads(ATT), 60, seed=22).columns
    for k in range(60):
        u = [log[name][k] for name in kf.inputs]
        z = [log[f"imu.{c}"][k] for c in kf.sensors["imu"]]
        for each in (kf, ref):
            each.predict(u)
            each.update("imu", z)
        assert np.max(np.abs(kf.x - ref.x) / np.sqrt(np.diag(ref.P))) < 0.05


def test_metres_beside_radians_need_no_hint():
    assert follow(TURN) < 0.05


@pytest.mark.parametrize("scalar", ["q8.24", "q20.12"])
def test_other_formats(scalar):
    assert follow(BALL, scalar) < 0.02


def test_sigma_points():
    assert follow("specs/pendulum.yaml", steps=60) < 0.1


BANK = """
kfgen: 1
name: bank
scalar: q16.16
dt: 0.1
states:
  p: {init: 0, var: 0.1}
  v: {init: 0, var: 0.1}
  a: {init: 0, var: 0.1}
measurements:
  position: {z: {z: {h: p, var: 1}}}
imm:
  modes:
    cv:
      dynamics: {form: discrete, f: {p: p + v*dt}, Q: {p: 1e-6, v: 1e-6, a: 1e-6}}
      filter: {type: ekf}
    ca:
      dynamics: {form: discrete, f: {p: p + (v + a*dt/2)*dt, v: v + a*dt}, Q: {p: 1e-6, v: 1e-6, a: 1e-6}}
      filter: {type: ekf, covariance: full, update: joseph}
  transition: [[0.95, 0.05], [0.05, 0.95]]
  mu0: [0.5, 0.5]
"""


def test_banks():
    assert follow(BANK, steps=80) < 0.02


def test_banks_of_curved_models_and_dt():
    assert follow("specs/beetle.yaml", steps=40) < 0.1


def test_no_mode_is_stuck_at_zero():
    """A mode that explains nothing for long keeps the least there is, and is back when it is the better one."""
    kf = kfgen.compile(loads(BANK.replace("[[0.95, 0.05], [0.05, 0.95]]", "[[1, 0], [0, 1]]")))
    least = 1 << 26
    for k in range(400):
        kf.predict()
        kf.update("position", [0.0 if k < 100 else 0.02 * (k - 100) ** 2 / 2])
        least = min(least, ((kf.raw["mu"] << 10) + kf.raw["rest"]).min())
    assert least == 1
    assert kf.mu[1] > 0.99


def test_what_cannot_be_carried_is_refused_by_name():
    spec = loads(BALL.replace("init: 0, var: 1,", "init: 0, var: 1e14,", 1).replace("1e-4, v: 1e-4", "1e-9, v: 1e-9"))
    with pytest.raises(SpecError, match=r"q16.16 cannot carry `\w+`.*missing"):
        kfgen.generate(spec)


def test_units_are_those_asked_for():
    spec = loads(BALL + "fixed: {scale: {s: 64}}\n")
    kf = kfgen.compile(spec)
    kf.set_state([64.0, 0.0, 0.0])
    assert kf.raw["x"][0] == 1 << 16


def test_no_floating_point_and_no_libm():
    files = kfgen.generate(loads(TURN))
    text = files["turn.c"]
    assert "math.h" not in text
    assert not {"float", "double"} & set(text.replace("(", " ").split())


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("what", ["z", "x"])
def test_extreme_arguments_are_followed(what, sign):
    spec = loads(BALL)
    kf, ref = kfgen.compile(spec), kfgen.reference(override(spec, "double"))
    log = simulate.simulate(spec, 60, seed=5)
    flags = 0
    for k in range(60):
        kf.predict()
        ref.predict()
        z = log.columns["pos.s"][k : k + 1]
        if k == 20 and what == "z":
            z = sign * (2.0**31 - 1) * kf.struct.units.z["pos"]
        if k == 20 and what == "x":
            kf.set_state(sign * (2.0**31 - 1) * kf.struct.units.x)
            ref.set_state(kf.x)
        flags |= kf.update("pos", z)
        ref.update("pos", z)
    assert flags == Status.SATURATED  # nis, at least
    assert np.max(np.abs(kf.x - ref.x) / np.sqrt(np.diag(ref.P))) < 0.02


def test_adapted_covariances_of_sensors_of_different_sizes() -> None:
    text = BALL.replace("filter: {type: ekf, covariance: full, update: standard}", """  three:
    z: {a: {h: s, var: 1}, b: {h: v, var: 1}, c: {h: s + v, var: 1}}
  one: {z: {a: {h: v, var: 1}}}
filter: {type: ekf, covariance: full, update: standard, adapt_R: 0.001}""")
    kf = native.compile(loads(text))
    assert {name: R.shape for name, R in kf.R.items()} == {"pos": (1, 1), "three": (3, 3), "one": (1, 1)}
    kf.predict()
    assert kf.update("three", [0.1, 0.2, 0.3]) == Status.OK
