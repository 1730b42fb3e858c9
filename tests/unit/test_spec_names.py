"""Names that would break the emitted code are refused, and no others."""

from __future__ import annotations

import pytest

from kfgen.errors import SpecError
from kfgen.scalar_names import is_scalar
from kfgen.spec import loads
from kfgen.spec.names import identifiers, wrong_name
from kfgen.spec.reference import markdown
from kfgen.spec.reserved import reserved
from kfgen.spec.schema import RECORDS
from kfgen.spec.tree import VECTOR_FUNCTIONS
from kfgen.spec.vector_guide import EXAMPLE

BASE = "kfgen: 1\nname: car\nscalar: q16.16\nstates: {x: {init: 0, std: 1}}\ndynamics: {}\n"
BASE += (
    "measurements: {gps: {partial: true, z: {east: {h: x, std: 1}}}}\nparameters: {p: 1}\ninputs: {u: {}}\n"
)


RESERVED = """
    int restrict class co_await lambda None sin where pi e t dt NULL INFINITY NAN M_PI EOF errno
    true bool I complex INT32_MAX FLT_EPSILON linux PI HALF_PI TWO_PI DEG_TO_RAD F HIGH LOW INPUT
    OUTPUT B0 B1 B01 B11111111 A0 A15 bit word byte boolean round sq constrain radians degrees cli
    sei interrupts PORTB PB3 SREG TCNT1 isnan and or not DEC HEX OCT BIN D0 D7 D10
"""
FREE = "dec D D16 D100 x px th v_x B2 B010101010 A P Q R D U S h z omega lambda_ y1 gamma beta PX1 i"


@pytest.mark.parametrize("name", RESERVED.split())
def test_reserved(name: str) -> None:
    assert reserved(name)
    assert wrong_name(name)


@pytest.mark.parametrize("name", FREE.split())
def test_free(name: str) -> None:
    assert wrong_name(name) is None


@pytest.mark.parametrize("name", ["e", "t", "dt", "pi", "sin", "where", "table", "n", "d"])
def test_sensors_and_components_stand_in_no_expression(name: str) -> None:
    assert wrong_name(name, in_expressions=False) is None
    base = BASE.replace("gps:", f"{name}:").replace("east", name)
    assert loads(base).measurements[0].components[0].name == name


@pytest.mark.parametrize("name", ["int", "class", "None", "abs", "HEX", "D3", "isnan", "round", "_x", "1"])
def test_sensors_and_components_are_emitted(name: str) -> None:
    assert wrong_name(name, in_expressions=False)


def test_an_index_is_no_type() -> None:
    """TANK_T and tank_t are two names of C, but vehicle_init and VEHICLE_INIT are too easily mistaken."""
    tank = BASE.replace("{x: {", "{T: {").replace("h: x", "h: T")
    assert loads(tank.replace("name: car", "name: t")).states[0].name == "T"
    assert loads(tank.replace("name: car", "name: tank")).states[0].name == "T"
    with pytest.raises(SpecError, match="equal in upper case"):
        loads(BASE.replace("{x: {", "{init: {").replace("h: x", "h: init"))


@pytest.mark.parametrize("name", ["", "_x", "1x", "a b", "ä", "x" * 41, "a-b", "x\n"])
def test_malformed(name: str) -> None:
    assert wrong_name(name)


def test_scalars() -> None:
    good = ["float", "double", *(f"q{32 - n}.{n}" for n in range(8, 25))]
    assert all(is_scalar(text) for text in good)
    bad = ["", "Float", "q16", "q16.16 ", "q0.32", "q25.7", "q7.25", "q16.15", "q016.16", "Q16.16", "int"]
    assert not any(is_scalar(text) for text in bad)


def test_identifiers_are_those_of_the_emitted_code() -> None:
    found = {name for name, _, _ in identifiers(loads(BASE))}
    assert found >= {
        "CAR_NX", "CAR_NU", "CAR_NZ_GPS", "CAR_X", "CAR_OK", "CAR_NOT_POSITIVE", "car_t",
        "car_real_t", "car_inputs_t", "car_gps_t", "car_parameters_t", "car_status_t", "car_init",
        "car_predict", "car_update_gps", "car_update_gps_masked", "car_set_state",
        "car_set_covariance", "car_get_covariance", "CAR_FRACTION_BITS", "CAR_X_LSB", "CAR_X_FROM",
        "CAR_X_TO", "CAR_U_LSB", "CAR_GPS_EAST_LSB", "CAR_P_LSB",
    }  # fmt: skip


def test_the_reference_names_every_key() -> None:
    page = markdown()
    assert all(f"| `{key.name}` |" in page for record in RECORDS for key in record.keys)
    assert page == markdown()
    assert "None" not in page
    assert all(f"`{name}(" in page for name in VECTOR_FUNCTIONS)


def test_the_emitted_names_of_a_rotation() -> None:
    text = EXAMPLE.replace("name: ins", "name: ins\nscalar: q16.16") + "\ncode: {flash: 900k}"
    found = {name for name, _, _ in identifiers(loads(text.replace("[22, 0, -42]", "[0.5, 0, -0.8]")))}
    assert found >= {"INS_NX", "INS_NE", "INS_Q_W", "INS_ERROR_Q_RX", "INS_ERROR_P_N", "INS_Q_RX_LSB", "INS_Q_W_LSB",
                     "INS_RANGE_ANCHOR_X_LSB", "INS_YAW_DEG_LSB", "ins_outputs_t", "ins_get_outputs"}  # fmt: skip
    with pytest.raises(SpecError, match="INS_ERROR_Q_RX"):
        loads(EXAMPLE.replace("  bg: {vector: 3,", "  error_q_rx: {init: 0, std: 1}\n  bg: {vector: 3,"))


def test_the_example_of_the_reference_builds() -> None:
    spec = loads(EXAMPLE)
    assert spec.errors[6:9] == ("q_rx", "q_ry", "q_rz")
    assert [start.sensor for start in spec.initialize] == ["still", "gnss"]
