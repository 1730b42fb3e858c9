/* kfgen build cv4.yaml */
#include "cv4.h"

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "cv4 tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "cv4 tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* constants: in flash on AVR too, where what is only const takes RAM */
#if defined(__AVR__)
#include <avr/pgmspace.h>
#define CV4_flash PROGMEM
#define CV4_order(i) ((int)pgm_read_byte(&cv4_order[i]))
#else
#define CV4_flash
#define CV4_order(i) ((int)cv4_order[i])
#endif

/* inner position -> index into x */
static const uint8_t cv4_order[4] CV4_flash = {
    0, 2, 1, 3
};

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool cv4_finite(float a)
{
    const uint32_t exponent = 0x7f800000u;
    union { float value; uint32_t bits; } view;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

cv4_status_t cv4_init(cv4_t *kf)
{
    if (kf == NULL) { return CV4_NULL_ARGUMENT; }
    kf->x[CV4_PX] = 50.0f;
    kf->x[CV4_PY] = 0.0f;
    kf->x[CV4_VX] = 10.0f;
    kf->x[CV4_VY] = 0.0f;
    for (int i = 0; i < 6; i++) {
        kf->U[i] = 0.0f;
    }
    for (int i = 0; i < 4; i++) {
        kf->D[i] = 0.1f;
    }
    kf->nis = 0.0f;
    return CV4_OK;
}

cv4_status_t cv4_predict(cv4_t *kf)
{
    if (kf == NULL) { return CV4_NULL_ARGUMENT; }
    const float px = kf->x[CV4_PX];
    const float py = kf->x[CV4_PY];
    const float vx = kf->x[CV4_VX];
    const float vy = kf->x[CV4_VY];

    /* model */
    const float px_next = px + 0.1f * vx;
    const float py_next = py + 0.1f * vy;

    /* F U, unit upper triangular as F is */
    const float u_px_vx = kf->U[0];
    const float t0 = u_px_vx + 0.1f;
    const float u_px_py = kf->U[1];
    const float u_vx_py = kf->U[2];
    const float t1 = u_px_py + 0.1f * u_vx_py;
    const float u_px_vy = kf->U[3];
    const float u_vx_vy = kf->U[4];
    const float t2 = u_px_vy + 0.1f * u_vx_vy;
    const float u_py_vy = kf->U[5];
    const float t3 = u_py_vy + 0.1f;

    /* process noise */
    const float d_vy = kf->D[3];
    const float d_vy_next = d_vy + 1.0e-6f;
    const float t4 = d_vy * (1.0f / d_vy_next);
    const float t5 = 1.0e-6f * t4;
    const float u_px_vy_next = t4 * t2;
    const float u_vx_vy_next = t4 * u_vx_vy;
    const float u_py_vy_next = t4 * t3;
    const float d_py = kf->D[2];
    const float t6 = d_py + 1.0e-6f;
    const float t7 = d_py * (1.0f / t6);
    const float t8 = 1.0e-6f * t7;
    const float t9 = t5 * t3;
    const float d_py_next = t6 + t3 * t9;
    const float t10 = 1.0f / d_py_next;
    const float t11 = t9 * t10;
    const float t12 = t5 * (t6 * t10);
    const float t13 = t7 * t1;
    const float t14 = t3 * t13 - t2;
    const float u_px_py_next = t13 - t11 * t14;
    const float t15 = t7 * u_vx_py;
    const float t16 = t3 * t15 - u_vx_vy;
    const float u_vx_py_next = t15 - t11 * t16;
    const float d_vx = kf->D[1];
    const float t17 = d_vx + 1.0e-6f;
    const float t18 = d_vx * (1.0f / t17);
    const float t19 = t8 * u_vx_py;
    const float t20 = t17 + u_vx_py * t19;
    const float t21 = 1.0f / t20;
    const float t22 = t12 * t16;
    const float d_vx_next = t20 + t16 * t22;
    const float t23 = 1.0f / d_vx_next;
    const float t24 = t18 * t0;
    const float t25 = u_vx_py * t24 - t1;
    const float t26 = t24 - t19 * t21 * t25;
    const float t27 = t14 - t16 * t26;
    const float u_px_vx_next = t26 + t22 * t23 * t27;
    const float d_px = kf->D[0];
    const float d_px_next = d_px + 1.0e-6f + t0 * (1.0e-6f * t18 * t0)
        + t25 * (t8 * (t17 * t21) * t25) + t27 * (t12 * (t20 * t23) * t27);

    /* guards */
    if (!cv4_finite(px_next + py_next + d_px_next + d_vx_next + d_py_next + d_vy_next)) {
        return CV4_NOT_FINITE;
    }

    /* store */
    kf->x[CV4_PX] = px_next;
    kf->x[CV4_PY] = py_next;
    kf->U[0] = u_px_vx_next;
    kf->U[1] = u_px_py_next;
    kf->U[2] = u_vx_py_next;
    kf->U[3] = u_px_vy_next;
    kf->U[4] = u_vx_vy_next;
    kf->U[5] = u_py_vy_next;
    kf->D[0] = d_px_next;
    kf->D[1] = d_vx_next;
    kf->D[2] = d_py_next;
    kf->D[3] = d_vy_next;
    return CV4_OK;
}

cv4_status_t cv4_update_position(cv4_t *kf, const cv4_position_t *z)
{
    if (kf == NULL || z == NULL) { return CV4_NULL_ARGUMENT; }

    /* innovation */
    const float px = kf->x[CV4_PX];
    const float py = kf->x[CV4_PY];
    const float y_x = z->x - px;
    const float y_y = z->y - py;

    /* gain and covariance: x, y */
    const float d_px = kf->D[0];
    const float t0 = 400.0f + d_px;
    const float t1 = 1.0f / t0;
    const float t2 = d_px * t1;
    const float d_px_next = d_px * (400.0f * t1);
    const float d_vx = kf->D[1];
    const float u_px_vx = kf->U[0];
    const float t3 = d_vx * u_px_vx;
    const float t4 = t0 + u_px_vx * t3;
    const float t5 = 1.0f / t4;
    const float t6 = t3 * t5;
    const float d_vx_next = d_vx * (t0 * t5);
    const float u_px_vx_next = u_px_vx - u_px_vx * t2;
    const float t7 = t2 + t6 * u_px_vx_next;
    const float d_py = kf->D[2];
    const float u_px_py = kf->U[1];
    const float t8 = d_py * u_px_py;
    const float t9 = t4 + u_px_py * t8;
    const float t10 = 1.0f / t9;
    const float t11 = t8 * t10;
    const float t12 = d_py * (t4 * t10);
    const float t13 = 400.0f + t12;
    const float t14 = 1.0f / t13;
    const float t15 = t12 * t14;
    const float d_py_next = t12 * (400.0f * t14);
    const float u_vx_py = kf->U[2];
    const float u_vx_py_next = u_vx_py - u_px_py * t6;
    const float t16 = t6 + t11 * u_vx_py_next;
    const float t17 = t15 * u_vx_py_next;
    const float u_px_py_next = u_px_py - u_px_py * t7;
    const float t18 = t7 + t11 * u_px_py_next;
    const float t19 = t15 * u_px_py_next;
    const float d_vy = kf->D[3];
    const float u_px_vy = kf->U[3];
    const float t20 = d_vy * u_px_vy;
    const float s_x = t9 + u_px_vy * t20;
    const float t21 = 1.0f / s_x;
    const float t22 = t20 * t21;
    const float t23 = d_vy * (t9 * t21);
    const float u_py_vy = kf->U[5];
    const float t24 = u_py_vy - u_px_vy * t11;
    const float t25 = t23 * t24;
    const float s_y = t13 + t24 * t25;
    const float t26 = 1.0f / s_y;
    const float t27 = t25 * t26;
    const float d_vy_next = t23 * (t13 * t26);
    const float u_py_vy_next = t24 - t24 * t15;
    const float u_vx_vy = kf->U[4];
    const float t28 = u_vx_vy - u_px_vy * t16;
    const float u_vx_vy_next = t28 - t24 * t17;
    const float t29 = u_px_vy - u_px_vy * t18;
    const float u_px_vy_next = t29 - t24 * t19;
    const float t30 = (t11 + t22 * t24) * y_x;
    const float nu_y = y_y - t30;
    const float nis = y_x * (y_x * t21) + nu_y * (nu_y * t26);

    /* state and innovation squared */
    const float px_next = px + (t18 + t22 * t29) * y_x + (t19 + t27 * u_px_vy_next) * nu_y;
    const float vx_next = kf->x[CV4_VX] + (t16 + t22 * t28) * y_x
        + (t17 + t27 * u_vx_vy_next) * nu_y;
    const float py_next = py + t30 + (t15 + t27 * u_py_vy_next) * nu_y;
    const float vy_next = kf->x[CV4_VY] + t22 * y_x + t27 * nu_y;

    /* guards */
    if (!cv4_finite(px_next + py_next + vx_next + vy_next + nis + s_x + s_y)) {
        return CV4_NOT_FINITE;
    }
    if (!(s_x > 0.0f) || !(s_y > 0.0f)) { return CV4_NOT_POSITIVE; }

    /* store */
    kf->x[CV4_PX] = px_next;
    kf->x[CV4_PY] = py_next;
    kf->x[CV4_VX] = vx_next;
    kf->x[CV4_VY] = vy_next;
    kf->U[0] = u_px_vx_next;
    kf->U[1] = u_px_py_next;
    kf->U[2] = u_vx_py_next;
    kf->U[3] = u_px_vy_next;
    kf->U[4] = u_vx_vy_next;
    kf->U[5] = u_py_vy_next;
    kf->D[0] = d_px_next;
    kf->D[1] = d_vx_next;
    kf->D[2] = d_py_next;
    kf->D[3] = d_vy_next;
    kf->nis = nis;
    return CV4_OK;
}

cv4_status_t cv4_set_state(cv4_t *kf, const cv4_real_t x[4])
{
    if (kf == NULL || x == NULL) { return CV4_NULL_ARGUMENT; }
    if (!cv4_finite(x[CV4_PX])) { return CV4_NOT_FINITE; }
    if (!cv4_finite(x[CV4_PY])) { return CV4_NOT_FINITE; }
    if (!cv4_finite(x[CV4_VX])) { return CV4_NOT_FINITE; }
    if (!cv4_finite(x[CV4_VY])) { return CV4_NOT_FINITE; }
    kf->x[CV4_PX] = x[CV4_PX];
    kf->x[CV4_PY] = x[CV4_PY];
    kf->x[CV4_VX] = x[CV4_VX];
    kf->x[CV4_VY] = x[CV4_VY];
    return CV4_OK;
}

cv4_status_t cv4_set_covariance(cv4_t *kf, const cv4_real_t P[16])
{
    if (kf == NULL || P == NULL) { return CV4_NULL_ARGUMENT; }
    float p[10];
    float w[10];

    /* the upper triangle, column by column */
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < j + 1; i++) {
            const bool t0 = CV4_order(j) < CV4_order(i);
            const float value = P[4 * (t0 ? CV4_order(j) : CV4_order(i))
                + (t0 ? CV4_order(i) : CV4_order(j))];
            p[j * (j + 1) / 2 + i] = value;
            w[j * (j + 1) / 2 + i] = value;
            if (!cv4_finite(value)) { return CV4_NOT_FINITE; }
        }
    }

    /* factor it: a pivot is zero up to round-off, or positive */
    for (int j = 4 - 1; j >= 0; j--) {
        const float round_off = 4.7683716e-7f * p[j * (j + 1) / 2 + j];
        const float pivot = w[j * (j + 1) / 2 + j];
        if (!(-round_off <= pivot)) { return CV4_NOT_POSITIVE; }
        const float d = round_off < pivot ? pivot : 0.0f;
        w[j * (j + 1) / 2 + j] = d;
        for (int i = j - 1; i >= 0; i--) {
            const float rest = w[j * (j + 1) / 2 + i];
            if (d <= 0.0f && 1.9073486e-6f * p[j * (j + 1) / 2 + j] * p[i * (i + 1) / 2 + i] < rest
                * rest) {
                return CV4_NOT_POSITIVE;
            }
            const float u = d > 0.0f ? rest / d : 0.0f;
            for (int k = 0; k < i + 1; k++) {
                w[i * (i + 1) / 2 + k] = w[i * (i + 1) / 2 + k] - u * w[j * (j + 1) / 2 + k];
            }
            w[j * (j + 1) / 2 + i] = u;
        }
    }

    /* store */
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < j; i++) {
            kf->U[j * (j - 1) / 2 + i] = w[j * (j + 1) / 2 + i];
        }
        kf->D[j] = w[j * (j + 1) / 2 + j];
    }
    return CV4_OK;
}

void cv4_get_covariance(const cv4_t *kf, cv4_real_t P[16])
{
    if (kf == NULL || P == NULL) { return; }
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < j + 1; i++) {
            float sum = kf->D[j];
            if (i < j) {
                sum = sum * kf->U[j * (j - 1) / 2 + i];
            }
            for (int k = j + 1; k < 4; k++) {
                sum = sum + kf->U[k * (k - 1) / 2 + i] * kf->D[k] * kf->U[k * (k - 1) / 2 + j];
            }
            const float value = sum;
            P[4 * CV4_order(i) + CV4_order(j)] = value;
            P[4 * CV4_order(j) + CV4_order(i)] = value;
        }
    }
}
/* kfgen: body b91a3fa72dd3932f4a71d580d28e28b7 */
