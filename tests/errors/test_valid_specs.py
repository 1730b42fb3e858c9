"""Specs that use every key of the language are read, and their defaults filled in."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from kfgen.errors import SpecError
from kfgen.spec import Call, Name, Number, load, loads, warnings, with_scalar
from kfgen.spec.constants import environment_of, value
from kfgen.spec.schema import RECORDS

FOLDER = Path(__file__).with_name("valid")


def test_every_key_is_covered() -> None:
    text = "\n".join(path.read_text() for path in FOLDER.glob("*.yaml"))
    missing = {key.name for record in RECORDS for key in record.keys if f"{key.name}:" not in text}
    assert not missing - {"kfgen"}


def test_vectors_are_their_parts() -> None:
    spec = load(FOLDER / "inertial.yaml")
    assert [state.name for state in spec.states[:8]] == ["p_n", "p_e", "p_d", "v_x", "v_y", "v_z", "q_w", "q_x"]
    assert spec.errors[6:] == ("q_rx", "q_ry", "q_rz", "bg_x", "bg_y", "bg_z")
    assert {group.name: group.parts for group in spec.groups}["g"] == ("g_x", "g_y", "g_z")
    (q,) = spec.rotations
    assert (q.name, q.error, q.reset) == ("q", "body", True)
    assert [value(e.tree) for e in q.variances if e is not None] == [Fraction(1, 100), Fraction(1, 100), 1]
    assert [spec.dynamics.f[name].tree for name in ("p_n", "p_d")] == [Name("v_x"), Name("v_z")]
    assert list(spec.dynamics.f)[6:] == ["q_rx", "q_ry", "q_rz"]
    assert list(spec.dynamics.Q) == ["bg_x", "bg_y", "bg_z"]
    sensors = {sensor.name: sensor for sensor in spec.measurements}
    assert [component.name for component in sensors["gnss"].components] == ["p_n", "p_e", "p_d"]
    assert sensors["star"].errors == ("q_rx", "q_ry", "q_rz")
    assert sensors["star"].rotations[0].error == "reference"
    assert [given.name for given in sensors["pr"].inputs] == ["sat_x", "sat_y", "sat_z", "sigma"]
    assert [output.name for output in spec.outputs] == ["yaw_deg", "speed"]
    ahrs, gnss = spec.initialize
    assert list(ahrs.states) == ["q_w", "q_x", "q_y", "q_z"]
    assert {name: e.tree for name, e in gnss.states.items()} == {f"p_{part}": Name(f"p_{part}") for part in "ned"}
    assert {name: value(e.tree) for name, e in gnss.variance.items()} == {f"p_{part}": 25 for part in "ned"}


BANK = """
kfgen: 1
name: b
dt: 0.1
states: {q: {kind: quaternion, init: [1, 0, 0, 0], std: 0.1, reset: false}, b: {vector: 3, init: 0, std: 0.1}}
inputs: {g: {vector: 3}}
measurements: {m: {z: {a: {h: "unrotate(q, [0, 0, 1])", std: 0.1}}}}
imm:
  modes:
    a: {dynamics: {f: {q: "q*from_rotation_vector(dt*(g - b))"}, Q: {q: 1e-5}}}
    c:
      states: {q: {init: [0, 0, 0, 3], std: [1, 2, 3]}, b: {init: 1, std: [1, 2, 3]}}
      noise: {w: {vector: 3, std: 0.1}}
      dynamics: {f: {q: "q*from_rotation_vector(dt*(g - b + w))"}}
      filter: {type: ukf}
    d: {P0: "diag([1, 1, 1, 2, 2, 2])", dynamics: {f: {}, Q: {q: 1e-4}}, filter: {type: iekf, variance_floor: 1e-9}}
  transition: "(diag([17, 17, 17]) + [[1, 1, 1], [1, 1, 1], [1, 1, 1]])/20"
"""


def test_modes_have_vectors_of_their_own() -> None:
    spec = loads(BANK)
    assert spec.imm is not None
    a, c, d = spec.imm.modes
    assert [value(e.tree) for r in c.rotations for e in r.variances if e is not None] == [1, 4, 9]
    assert [value(state.init.tree) for state in c.states] == [0, 0, 0, 1, 1, 1, 1]
    assert a.rotations == spec.rotations
    assert d.rotations[0].variances == (None, None, None)
    assert d.P0 is not None
    assert len(d.P0) == len(d.P0[0]) == 6
    assert list(d.filter.variance_floor) == list(spec.errors)
    with pytest.raises(SpecError, match="the state `q` is missing") as caught:
        loads(BANK.replace("q: {init: [0, 0, 0, 3], std: [1, 2, 3]}, b", "b"))
    assert len(caught.value.mistakes) == 1


def test_vehicle() -> None:
    spec = load(FOLDER / "vehicle.yaml")
    assert [s.name for s in spec.states] == ["px", "py", "v", "th", "course", "b"]
    px = spec.states[0]
    assert px.variance is not None
    assert px.variance.tree == Call("pow", (Name("stdx"), Number(Fraction(2))))
    assert px.place.path == "states.px"
    assert (px.place.line, px.place.column) == (18, 3)
    assert [d.name for d in spec.let] == ["c", "d", "s"]  # each uses only those before it
    assert spec.dt is not None
    assert spec.dt.run_time
    assert spec.inputs[1].name == "spare"
    assert spec.filter.update == "joseph"
    assert set(spec.filter.variance_floor) == {s.name for s in spec.states}
    assert spec.filter.robust is not None
    assert spec.filter.robust.influence == "custom"
    assert spec.code.flash == 16 * 1024
    assert spec.code.compensated == ("px", "py")
    assert spec.code.stack == 512
    assert spec.measurements[0].gate is not None
    assert spec.measurements[0].gate.reset_after == 5
    assert spec.measurements[1].components[0].variance is None
    assert spec.measurements[3].R is not None
    (start,) = spec.initialize
    assert {state: e.tree for state, e in start.states.items()} == {"px": Name("x"), "py": Name("y")}
    assert spec.states[3].kind == "angle"
    assert spec.states[4].period is not None
    known = environment_of(spec)
    assert known["varx"] == Fraction("1.394") ** 2
    assert value(spec.states[2].init.tree, known) == Fraction(1, 2)
    assert warnings(spec) == []


def test_continuous_ukf() -> None:
    spec = load(FOLDER / "continuous_ukf.yaml")
    assert [n.density for n in spec.noise] == [True, True]
    assert spec.states[0].variance is None
    assert spec.P0 is not None
    assert spec.filter.update is None
    assert spec.filter.sigma_points is not None
    assert spec.filter.adaptive is not None
    assert spec.dynamics.substeps == 2
    assert spec.measurements[0].components[0].variance is None


def test_imm_modes_are_complete() -> None:
    spec = load(FOLDER / "imm.yaml")
    assert spec.imm is not None
    cv, ca, iterated, second, cubature = spec.imm.modes
    assert cv.dynamics is spec.dynamics
    assert cv.filter.type == "kf"
    assert cv.states == spec.states
    assert ca.noise_covariance is not None
    assert [n.variance for n in ca.noise] == [None, None]
    assert iterated.states[0].variance != spec.states[0].variance
    assert iterated.filter.iterations == 2
    assert iterated.measurements != spec.measurements
    assert [s.variance for s in second.states] == [None, None]
    assert second.P0 is not None
    assert second.filter.update == "joseph"
    assert cubature.filter.sigma_points is not None
    assert not cubature.filter.sigma_points.redraw


def test_defaults_by_type() -> None:
    base = "kfgen: 1\nname: a\nstates: {x: {init: 0, std: 1}}\ndynamics: {}\n"
    base += "measurements: {m: {z: {c: {h: x, std: 1}}}}\n"
    assert loads(base).filter.update == "bierman"
    assert loads(base + "filter: {covariance: full}").filter.update == "joseph"
    assert loads(base + "filter: {covariance: sqrt}").filter.update is None
    assert loads(base + "filter: {type: iekf}").filter.iterations == 3
    assert loads(base + "filter: {type: ekf, robust: huber}").filter.robust is not None
    assert loads(base + "filter: {type: ekf, robust: none, adaptive: false}").filter.adaptive is None
    points = loads(base + "filter: {type: ukf, sigma_points: {kind: wiki}}").filter.sigma_points
    assert points is not None
    assert points.alpha is not None
    assert points.kappa is None  # the number of dimensions, which differs between predict and update


def test_bytes_text_and_line_ends_are_the_same() -> None:
    data = (FOLDER / "vehicle.yaml").read_bytes()
    assert loads(data).states == loads(data.decode()).states
    assert loads(data.replace(b"\n", b"\r\n")).states == loads(data).states
    assert loads(b"\xef\xbb\xbf" + data).states == loads(data).states
    assert loads(data).sha256 != loads(data + b"\n").sha256


def test_warning_for_a_small_alpha() -> None:
    text = (FOLDER / "continuous_ukf.yaml").read_text().replace("alpha: 0.1", "alpha: 1e-3")
    spec = loads(text)
    assert [w.place.path for w in warnings(spec)] == ["filter.sigma_points.alpha"]
    assert warnings(with_scalar(spec, "double")) == []


def test_another_scalar() -> None:
    spec = load(FOLDER / "vehicle.yaml")
    assert with_scalar(spec, "q8.24").scalar == "q8.24"
    with pytest.raises(SpecError, match="there is no scalar `half`"):
        with_scalar(spec, "half")
    clash = (
        (FOLDER / "vehicle.yaml").read_text().replace("  b: {init", "  px_lsb: {init: 0, std: 1}\n  b: {init")
    )
    with pytest.raises(SpecError, match="VEHICLE_PX_LSB"):
        with_scalar(loads(clash), "q16.16")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    cases = {
        tmp_path / "missing.yaml": "no such file",
        tmp_path: "is a directory",
    }
    (tmp_path / "big.yaml").write_bytes(b"#" * 1_000_001)
    cases[tmp_path / "big.yaml"] = "larger than"
    (tmp_path / "latin.yaml").write_bytes(b"kfgen: 1\nname: \xe9")
    cases[tmp_path / "latin.yaml"] = r":2:7: the byte 0xe9 is not UTF-8"
    for path, text in cases.items():
        with pytest.raises(SpecError, match=text) as caught:
            load(path)
        assert len(caught.value.mistakes) == 1
