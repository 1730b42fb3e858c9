from __future__ import annotations

import cffi
import pytest

from kfgen.errors import KfgenError
from kfgen.native.header import float_of, parse


def test_reads_macros_functions_and_the_scalar(files):
    header = parse(files["vehicle_small.h"], "vehicle_small")
    assert header.real == "float"
    assert header.macros["VEHICLE_SMALL_NZ_GNSS"] == 2
    assert header.functions["vehicle_small_predict"] == ("kf", "u", "dt")
    assert header.functions["vehicle_small_get_covariance"] == ("kf", "P")
    assert header.takes("predict", "dt")
    assert not header.takes("update_gnss", "u")
    assert header.has("update_gnss_masked")
    assert not header.has("update_compass_masked")


def test_the_declarations_are_what_cffi_takes(files):
    header = parse(files["vehicle_small.h"], "vehicle_small")
    ffi = cffi.FFI()
    ffi.cdef(header.cdef)
    assert ffi.sizeof("vehicle_small_t") == 4 * (3 + 6 + 1 + 1 + 1)
    assert "trap" not in header.cdef


ODD = """
#ifndef F_H
#define F_H 1
#include <stdint.h>
#ifdef __FAST_MATH__
#error "no"
#endif
#if defined(__cplusplus)
extern "C" {
#else
typedef int f_only_c_t;
#endif
#define F_LONG(a) \\
    ((a) + 1)
#define F_N (4)
#define F_PX_LSB 0.0000152587890625
enum { F_A = 1u << 3, F_B };
typedef int32_t f_real_t;
static inline int f_helper(int a) { if (a) { return 1; } return 0; }
typedef struct { struct { f_real_t x[F_N]; } modes; uint32_t count; } f_t;
extern uint32_t f_init(f_t *kf);
void f_get_covariance(const f_t *kf, f_real_t P[F_N * F_N]);
#ifdef __cplusplus
}
#endif
#endif
"""


def test_odd_but_legal_headers():
    header = parse(ODD, "f")
    assert header.macros["F_PX_LSB"] == 2.0**-16
    assert set(header.functions) == {"f_init", "f_get_covariance"}
    ffi = cffi.FFI()
    ffi.cdef(header.cdef)
    assert ffi.sizeof("f_t") == 20
    assert ffi.typeof("f_only_c_t").cname == "int"


def test_a_header_without_the_filter_is_refused():
    with pytest.raises(KfgenError, match="other_real_t"):
        parse("typedef int x;", "other")


@pytest.mark.parametrize(
    ("text", "value"), [("4", 4), ("(-3)", -3), ("0x10u", 16), ("0.5f", 0.5), ("1e-3", 1e-3), ("0xfUL", 15)]
)
def test_numbers_of_c(text, value):
    assert float_of(text) == value
