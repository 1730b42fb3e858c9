"""INT32_MIN and INT32_MAX in every argument: flagged, harmless, and forgotten as a float64 filter forgets them."""

from __future__ import annotations

import numpy as np
import pytest

from kfgen import native
from kfgen.override import override
from kfgen.simulate import simulate
from kfgen.spec import loads
from kfgen.status import Status

TRACK = """
kfgen: 1
name: {name}
scalar: q16.16
dt: 0.1
states:
  p: {{init: 0, std: 1, range: [-200, 200]}}
  v: {{init: 0, std: 1, range: [-50, 50]}}
inputs: {{a: {{range: [-5, 5]}}}}
measurements:
  pos: {{z: {{d: {{h: p, std: 0.3}}}}{gate}}}
"""
MOTION = """
dynamics:
  f: {p: p + dt*v, v: 0.99*v + dt*a - 0.05*sin(p/20)}
  Q: {p: 1e-3, v: 0.02}
"""
MODES = """
imm:
  modes:
    calm: {dynamics: {f: {p: p + dt*v, v: 0.99*v + dt*a}, Q: {p: 1e-3, v: 1e-2}}, filter: {type: ekf}}
    wild: {dynamics: {f: {p: p + dt*v, v: 0.99*v + dt*a}, Q: {p: 1e-3, v: 0.5}}, filter: {type: ekf}}
  transition: [[0.95, 0.05], [0.05, 0.95]]
"""
GATE = ", gate: {probability: 0.9999}"
FILTERS = {
    "full": "filter: {type: ekf, covariance: full, update: standard}",
    "ud": "filter: {type: ekf, covariance: ud, update: bierman}",
    "ud_joseph": "filter: {type: ekf, covariance: ud, update: joseph}",
    "points": "filter: {type: ukf, covariance: sqrt}",
    "bank": MODES,
}
AT, AFTER = 40, 240  # the row before which it happens, rows until it is forgotten
LIMITS = (-(2**31), 2**31 - 1)


def text(name, gate=""):
    model = FILTERS[name] if name == "bank" else MOTION + FILTERS[name]
    return TRACK.format(name=f"{name}_gated" if gate else name, gate=gate) + model


@pytest.fixture(scope="module")
def pairs():
    """Name -> the integer filter, under the undefined behaviour sanitizer, and the same in float64, at row AT."""
    specs = {name: loads(text(name)) for name in FILTERS}
    specs |= {f"{name}_gated": loads(text(name, GATE)) for name in ("ud", "bank")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CC", "gcc")
        integers = native.compile_many(list(specs.values()), flags=["-O1", "-fsanitize=undefined"])
    floats = native.compile_many([override(spec, "double") for spec in specs.values()])
    found = dict(zip(specs, zip(integers, floats, strict=True), strict=True))
    for kf, ref in found.values():
        run(kf, ref, 0, AT)
    return found


LOG = simulate(override(loads(text("ud")), "double"), AT + AFTER, seed=31).columns


def step(kf, ref, k, a=None, z=None):
    """One row in both, of numbers that the integers can hold; the flags of the integers."""
    value, units = kf.struct.value, kf.struct.units
    u = value.to_physical(value.to_raw(np.array([LOG["a"][k]]), units.u), units.u) if a is None else [a]
    z = value.to_physical(value.to_raw(np.array([LOG["pos.d"][k]]), units.z["pos"]), units.z["pos"]) if z is None else z
    flags = kf.predict(u) | kf.update("pos", z)
    ref.predict(u)
    ref.update("pos", z)
    return flags


def run(kf, ref, first, last):
    flags = 0
    for k in range(first, last):
        flags |= step(kf, ref, k)
    return flags


def follows(kf, ref):
    deviations = np.sqrt(np.diag(ref.P))
    assert np.max(np.abs(kf.x - ref.x) / deviations) < 0.05
    assert np.allclose(np.sqrt(np.diag(kf.P)), deviations, rtol=0.02)
    assert np.all(np.linalg.eigvalsh(kf.P) > 0)


@pytest.mark.parametrize("raw", LIMITS)
@pytest.mark.parametrize("name", FILTERS)
def test_arguments(pairs, name, raw, needs, capfd):
    needs("gcc")
    for what in ("z", "a"):
        kf, ref = (each.copy() for each in pairs[name])
        unit = kf.struct.units.z["pos"] if what == "z" else kf.struct.units.u
        flags = step(kf, ref, AT, **{what: raw * float(unit[0]) if what == "a" else raw * unit})
        assert flags & ~int(Status.POINT_REJECTED) in (0, Status.SATURATED)
        assert what == "a" or flags & Status.SATURATED  # nis, at least
        run(kf, ref, AT + 1, AT + AFTER)
        follows(kf, ref)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("raw", LIMITS)
@pytest.mark.parametrize("name", FILTERS)
def test_states(pairs, name, raw, needs, capfd):
    needs("gcc")
    for chosen in ((0,), (1,), (0, 1)):
        kf, ref = (each.copy() for each in pairs[name])
        x = kf.x
        x[list(chosen)] = raw * kf.struct.units.x[list(chosen)]
        assert kf.set_state(x) & ~int(Status.SATURATED) == 0
        assert np.array_equal(kf.x, x)
        ref.set_state(x)
        assert run(kf, ref, AT, AT + AFTER) & Status.SATURATED
        follows(kf, ref)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("name", FILTERS)
def test_covariances(pairs, name, needs, capfd):
    """The largest is held as far as it goes; what is no covariance changes nothing."""
    needs("gcc")
    kf, ref = (each.copy() for each in pairs[name])
    before = kf.P
    assert kf.set_covariance(LIMITS[0] * kf.struct.units.P) == Status.NOT_POSITIVE
    assert np.array_equal(kf.P, before)
    assert kf.set_covariance(np.diag(np.diag(LIMITS[1] * kf.struct.units.P))) in (Status.OK, Status.SATURATED)
    assert np.all(np.diag(kf.P) > 10 * np.diag(before))
    assert np.all(np.linalg.eigvalsh(kf.P) > 0)
    ref.set_covariance(kf.P)
    run(kf, ref, AT, AT + AFTER)
    follows(kf, ref)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("raw", LIMITS)
@pytest.mark.parametrize("name", ["ud_gated", "bank_gated"])
def test_gates_ignore_them(pairs, name, raw, needs, capfd):
    needs("gcc")
    kf, ref = (each.copy() for each in pairs[name])
    value, units = kf.struct.value, kf.struct.units
    u = value.to_physical(value.to_raw(np.array([LOG["a"][AT]]), units.u), units.u)
    kf.predict(u)
    ref.predict(u)
    before = kf.x
    z = raw * units.z["pos"]
    assert kf.update("pos", z) == ref.update("pos", z) == Status.GATED
    assert np.array_equal(kf.x, before)
    for k in range(AT + 1, AT + 30):
        step(kf, ref, k)
        follows(kf, ref)
    assert capfd.readouterr().err == ""
