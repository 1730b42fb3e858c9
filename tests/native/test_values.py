from __future__ import annotations

import numpy as np
import pytest

from kfgen.emit.declarations import Declarations
from kfgen.errors import KfgenError
from kfgen.native import load_filters
from kfgen.native.values import Fixed, Units, value_of
from kfgen.spec import loads
from kfgen.status import Status
from tests.native.small import Written

SPEC = """
kfgen: 1
name: level
scalar: q16.16
parameters: {gain: {value: 0.5}}
dt: {nominal: 0.1}
states: {h: {init: 1, std: 2, unit: m}}
inputs: {flow: {unit: m/s}}
dynamics: {f: {h: h + dt*flow}, Q: {h: 0.01}}
measurements:
  gauge: {z: {d: {h: h, std: 0.5, unit: m}}}
"""

HEADER = """
#include <stddef.h>
#include <stdint.h>
#define LEVEL_FRACTION_BITS 16
#define LEVEL_H_LSB 0.0009765625
#define LEVEL_FLOW_LSB 0.0000152587890625
#define LEVEL_GAUGE_D_LSB 0.0009765625
#define LEVEL_GAIN_LSB 0.0000152587890625
#define LEVEL_DT_LSB 0.0000152587890625
#define LEVEL_H_FROM(v) ((int32_t)((v) / LEVEL_H_LSB))
typedef int32_t level_real_t;
typedef struct { level_real_t flow; } level_inputs_t;
typedef struct { level_real_t d; } level_gauge_t;
typedef struct { level_real_t gain; } level_parameters_t;
typedef struct {
    level_real_t x[1], P[1];
    level_parameters_t parameters;
    level_real_t nis;
} level_t;
uint32_t level_init(level_t *kf);
uint32_t level_predict(level_t *kf, const level_inputs_t *u, level_real_t dt);
uint32_t level_update_gauge(level_t *kf, const level_gauge_t *z);
uint32_t level_set_state(level_t *kf, const level_real_t x[1]);
void level_get_covariance(const level_t *kf, level_real_t P[1]);
"""

# takes the measurement as the state; enough to see what crosses the border
CODE = """
#include "level.h"
uint32_t level_init(level_t *kf)
{
    kf->x[0] = 1024; kf->P[0] = 64; kf->parameters.gain = 32768; kf->nis = 0;
    return 0u;
}
uint32_t level_predict(level_t *kf, const level_inputs_t *u, level_real_t dt)
{
    kf->x[0] = u->flow; kf->P[0] = dt;
    return 0u;
}
uint32_t level_update_gauge(level_t *kf, const level_gauge_t *z)
{
    kf->x[0] = z->d; kf->nis = 65536;
    return 0u;
}
uint32_t level_set_state(level_t *kf, const level_real_t x[1]) { kf->x[0] = x[0]; return 0u; }
void level_get_covariance(const level_t *kf, level_real_t P[1]) { P[0] = kf->P[0]; }
"""


UNITS = {"H": 2.0**-10, "FLOW": 2.0**-16, "GAUGE_D": 2.0**-10, "GAIN": 2.0**-16, "DT": 2.0**-16}
DECLARED = Declarations(
    "level",
    "int32_t",
    HEADER[HEADER.index("typedef") :],
    {
        "init": ("kf",),
        "predict": ("kf", "u", "dt"),
        "update_gauge": ("kf", "z"),
        "set_state": ("kf", "x"),
        "get_covariance": ("kf", "P"),
    },
    16,
    UNITS,
)


@pytest.fixture
def level():
    return load_filters([Written(loads(SPEC), {"level.h": HEADER, "level.c": CODE}, DECLARED)])[0]


def test_units_of_a_fixed_point_filter():
    units = Units(loads(SPEC), value_of(DECLARED))
    assert units.x == [2.0**-10]
    assert units.P == [[2.0**-20 * 2**16]]
    assert units.one == 2.0**-16


def test_physical_values_cross_the_border(level):
    assert level.x == [1.0]
    assert level.P == [[64 * 2.0**-4]]
    assert level.parameters["gain"] == 0.5
    level.parameters["gain"] = 0.25
    assert level.raw["parameters"]["gain"] == 16384
    assert level.update("gauge", [3.0]) == 0
    assert level.raw["x"].tolist() == [3072]
    assert level.raw["x"].dtype == np.int32
    assert level.nis == 1.0
    level.predict([1.0], 0.5)
    assert level.raw["x"].tolist() == [65536]
    assert level.raw["P"].tolist() == [32768]


def test_values_round_to_nearest_and_saturate(level):
    level.update("gauge", [0.6 / 1024])
    assert level.raw["x"].tolist() == [1]
    level.update("gauge", [1e12])
    assert level.raw["x"].tolist() == [2**31 - 1]
    level.set_state([-1e12])
    assert level.raw["x"].tolist() == [-(2**31)]


def test_what_has_no_fixed_point_value_is_not_finite(level):
    before = bytes(level)
    assert level.update("gauge", [float("nan")]) == Status.NOT_FINITE
    assert level.predict([float("inf")], 0.1) == Status.NOT_FINITE
    assert level.predict([0.0], float("nan")) == Status.NOT_FINITE
    assert level.set_state([float("nan")]) == Status.NOT_FINITE
    with pytest.raises(ValueError, match="fixed point"):
        level.parameters["gain"] = float("inf")
    assert bytes(level) == before


def test_a_log_in_fixed_point(level):
    nan, inf = float("nan"), float("inf")
    log = {"t": [0, 1, 2, 3], "flow": [0, 1, inf, 1], "gauge.d": [5, nan, nan, inf]}
    result = level.run(log)
    np.testing.assert_array_equal(result.x[:, 0], [5, 64, 64, 64])
    np.testing.assert_array_equal(result.status, [0, 0, Status.NOT_FINITE, Status.NOT_FINITE])
    np.testing.assert_array_equal(result.nis["gauge"], [1, nan, nan, nan])
    assert result.counts() == {"predict": {Status.NOT_FINITE: 1}, "update_gauge": {Status.NOT_FINITE: 1}}


def test_a_missing_unit_is_told():
    with pytest.raises(KfgenError, match="H_LSB"):
        Fixed({}, 16).unit("h")
