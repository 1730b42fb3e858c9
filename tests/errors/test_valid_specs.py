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
