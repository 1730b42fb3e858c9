/* kfgen build tracker.yaml */
#include "tracker.h"

#include <math.h>

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "tracker tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "tracker tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* constants: in flash on AVR too, where what is only const takes RAM */
#if defined(__AVR__)
#include <avr/pgmspace.h>
#define TRACKER_flash PROGMEM
#define TRACKER_order(i) ((int)pgm_read_byte(&tracker_order[i]))
#else
#define TRACKER_flash
#define TRACKER_order(i) ((int)tracker_order[i])
#endif

/* inner position -> index into x */
static const uint8_t tracker_order[4] TRACKER_flash = {
    0, 2, 1, 3
};

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool tracker_finite(float a)
{
    const uint32_t exponent = 0x7f800000u;
    union { float value; uint32_t bits; } view;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

tracker_status_t tracker_init(tracker_t *kf)
{
    if (kf == NULL) { return TRACKER_NULL_ARGUMENT; }
    for (int i = 0; i < 4; i++) {
        kf->x[i] = 0.0f;
    }
    for (int i = 0; i < 6; i++) {
        kf->U[i] = 0.0f;
    }
    for (int i = 0; i < 4; i++) {
        kf->D[i] = 100.0f;
    }
    kf->nis = 0.0f;
    kf->log_likelihood = 0.0f;
    kf->initialized = false;
    return TRACKER_OK;
}

tracker_status_t tracker_predict(tracker_t *kf)
{
    if (kf == NULL) { return TRACKER_NULL_ARGUMENT; }
    const float px = kf->x[TRACKER_PX];
    const float py = kf->x[TRACKER_PY];
    const float vx = kf->x[TRACKER_VX];
    const float vy = kf->x[TRACKER_VY];

    /* model */
    const float px_next = px + 0.1f * vx;
    const float py_next = py + 0.1f * vy;

    /* F U, unit upper triangular as F is */
    const float u_px_vx = kf->U[0];
    const float t0 = u_px_vx + 0.1f;
    const float u_px_py = kf->U[1];
    const float u_vx_py = kf->U[2];
    const float t1 = u_px_py + 0.1f * u_vx_py;
    const float u_vx_vy = kf->U[4];
    const float t2 = 0.1f * u_vx_vy;
    const float u_px_vy = kf->U[3];
    const float t3 = u_px_vy + t2;
    const float u_py_vy = kf->U[5];
    const float t4 = u_py_vy + 0.1f;

    /* process noise */
    const float d_vy = kf->D[3];
    const float d_vy_next = d_vy + 0.01f;
    const float t5 = 1.0f / d_vy_next;
    const float t6 = d_vy * t5;
    const float u_px_vy_next = t6 * t3;
    const float t7 = 0.1f * t3;
    const float u_vx_vy_next = t6 * u_vx_vy;
    const float u_py_vy_next = t6 * t4 + 0.0005f * t5;
    const float t8 = 0.005f - 0.1f * t4;
    const float t9 = t6 * t8;
    const float d_py = kf->D[2];
    const float d_py_next = d_py + t8 * t9;
    const bool t10 = d_py_next > 0.0f;
    const float t11 = t10 ? t9 / d_py_next : 0.0f;
    const float t12 = t10 ? d_py / d_py_next : 1.0f;
    const float t13 = t6 * t12;
    const float u_px_py_next = t12 * t1 - t11 * t7;
    const float u_vx_py_next = t12 * u_vx_py - t11 * t2;
    const float t14 = t2 + t8 * u_vx_py;
    const float d_vx = kf->D[1];
    const float t15 = d_vx + 0.01f;
    const float t16 = 1.0f / t15;
    const float t17 = d_vx * t16;
    const float t18 = t13 * t14;
    const float d_vx_next = t15 + t14 * t18;
    const float t19 = 1.0f / d_vx_next;
    const float t20 = t17 * t0 + 0.0005f * t16;
    const float t21 = 0.005f - 0.1f * t0;
    const float t22 = t14 * t20 - t7 - t8 * t1;
    const float u_px_vx_next = t20 - t18 * t19 * t22;
    const float d_px = kf->D[0];
    const float d_px_next = d_px + t21 * (t17 * t21) + t22 * (t13 * (t15 * t19) * t22);

    /* guards */
    if (!tracker_finite(px_next + py_next + d_px_next + d_vx_next + d_py_next + d_vy_next)) {
        return TRACKER_NOT_FINITE;
    }

    /* store */
    kf->x[TRACKER_PX] = px_next;
    kf->x[TRACKER_PY] = py_next;
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
    return TRACKER_OK;
}

tracker_status_t tracker_update_fix(tracker_t *kf, const tracker_fix_t *z)
{
    if (kf == NULL || z == NULL) { return TRACKER_NULL_ARGUMENT; }
    tracker_status_t flags = TRACKER_OK;

    /* the first measurement sets the state */
    if (!tracker_finite(z->x + z->y)) { return TRACKER_NOT_FINITE; }
    if (!kf->initialized) {
        kf->x[TRACKER_PX] = z->x;
        kf->x[TRACKER_PY] = z->y;
        kf->nis = 0.0f;
        kf->initialized = true;
        return TRACKER_OK;
    }

    /* innovation */
    const float px = kf->x[TRACKER_PX];
    const float py = kf->x[TRACKER_PY];
    const float y_x = z->x - px;
    const float y_y = z->y - py;

    /* gain and covariance: x, y */
    const float u_px_vx = kf->U[0];
    const float d_vx = kf->D[1];
    const float t0 = u_px_vx * (d_vx * u_px_vx);
    const float d_px = kf->D[0];
    const float t1 = 9.0f + d_px + t0;
    const float d_py = kf->D[2];
    const float u_px_py = kf->U[1];
    const float t2 = d_py * u_px_py;
    const float t3 = u_px_py * t2;
    const float t4 = t1 + t3;
    const float t5 = 1.0f / t4;
    const float t6 = t2 * t5;
    const float d_vy = kf->D[3];
    const float u_px_vy = kf->U[3];
    const float t7 = d_vy * u_px_vy;
    const float t8 = u_px_vy * t7;
    const float s_x = t4 + t8;
    const float t9 = 1.0f / s_x;
    const float u_py_vy = kf->U[5];
    const float t10 = u_py_vy - u_px_vy * t6;
    const float s_y = 9.0f + d_py * (t1 * t5) + t10 * (d_vy * (t4 * t9) * t10);
    const float nu_y = y_y - (t6 + t7 * t9 * t10) * y_x;
    const float nis = y_x * (y_x * t9) + nu_y * (nu_y * (1.0f / s_y));

    /* guards */
    if (!tracker_finite(y_x + y_y + s_x + s_y)) { return TRACKER_NOT_FINITE; }
    if (!(s_x > 0.0f) || !(s_y > 0.0f)) { return TRACKER_NOT_POSITIVE; }

    /* gain and covariance: x */
    const float size_x = fabsf(y_x);
    const bool glitch_x = size_x > 9.0f;
    const bool large_x = size_x > 18.0f;
    if (glitch_x && !large_x) { flags |= TRACKER_GLITCH_SMALL; }
    if (large_x) { flags |= TRACKER_GLITCH_LARGE; }
    const float weighed_x = glitch_x ? (large_x ? (y_x > 0.0f ? 3.0f : -3.0f) : 0.33333334f * y_x)
        : y_x;
    const float weight_x = glitch_x ? (large_x ? 0.0f : 0.33333334f) : 1.0f;
    const float t11 = weight_x * (d_px + t0 + t3 + t8);
    const bool t12 = t11 > 1.1754944e-38f;
    const float excess_x = 0.11354f * (weight_x * (weighed_x * weighed_x)) - t11 - 9.0f;
    const bool inflate_x = excess_x > 0.0f && t12;
    if (inflate_x) { flags |= TRACKER_ANOMALY; }
    const float inflation_x = inflate_x ? 1.0f + excess_x * (t12 ? 1.0f / t11 : 0.0f) : 1.0f;
    const float t13 = d_px * inflation_x;
    const float t14 = d_vx * inflation_x;
    const float t15 = d_py * inflation_x;
    const float t16 = d_vy * inflation_x;
    const float t17 = 9.0f + weight_x * t13;
    const float t18 = 1.0f / t17;
    const float t19 = t13 * t18;
    const float t20 = weight_x * u_px_vx;
    const float t21 = t14 * u_px_vx;
    const float t22 = t17 + t20 * t21;
    const float t23 = 1.0f / t22;
    const float t24 = t21 * t23;
    const float u_px_vx_next = u_px_vx - t20 * t19;
    const float t25 = t19 + t24 * u_px_vx_next;
    const float t26 = weight_x * u_px_py;
    const float t27 = t15 * u_px_py;
    const float t28 = t22 + t26 * t27;
    const float t29 = 1.0f / t28;
    const float t30 = t27 * t29;
    const float t31 = t15 * (t22 * t29);
    const float u_vx_py = kf->U[2];
    const float u_vx_py_next = u_vx_py - t26 * t24;
    const float t32 = t24 + t30 * u_vx_py_next;
    const float u_px_py_next = u_px_py - t26 * t25;
    const float t33 = t25 + t30 * u_px_py_next;
    const float t34 = weight_x * u_px_vy;
    const float t35 = t16 * u_px_vy;
    const float s_x_1 = t28 + t34 * t35;
    const float t36 = 1.0f / s_x_1;
    const float t37 = t35 * t36;
    const float t38 = t16 * (t28 * t36);
    const float t39 = u_py_vy - t34 * t30;
    const float u_vx_vy = kf->U[4];
    const float t40 = u_vx_vy - t34 * t32;
    const float t41 = u_px_vy - t34 * t33;
    const float t42 = (t30 + t37 * t39) * weighed_x;

    /* gain and covariance: y */
    const float nu_y_1 = y_y - t42;
    const float size_y = fabsf(nu_y_1);
    const bool glitch_y = size_y > 9.0f;
    const bool large_y = size_y > 18.0f;
    if (glitch_y && !large_y) { flags |= TRACKER_GLITCH_SMALL; }
    if (large_y) { flags |= TRACKER_GLITCH_LARGE; }
    const float weighed_y = glitch_y ? (large_y ? (nu_y_1 > 0.0f ? 3.0f : -3.0f)
        : 0.33333334f * nu_y_1) : nu_y_1;
    const float weight_y = glitch_y ? (large_y ? 0.0f : 0.33333334f) : 1.0f;
    const float t43 = weight_y * (t31 + t39 * (t38 * t39));
    const bool t44 = t43 > 1.1754944e-38f;
    const float excess_y = 0.11354f * (weight_y * (weighed_y * weighed_y)) - t43 - 9.0f;
    const bool inflate_y = excess_y > 0.0f && t44;
    if (inflate_y) { flags |= TRACKER_ANOMALY; }
    const float inflation_y = inflate_y ? 1.0f + excess_y * (t44 ? 1.0f / t43 : 0.0f) : 1.0f;
    const float d_px_next = t13 * (9.0f * t18) * inflation_y;
    const float d_vx_next = t14 * (t17 * t23) * inflation_y;
    const float t45 = t31 * inflation_y;
    const float t46 = t38 * inflation_y;
    const float t47 = 9.0f + weight_y * t45;
    const float t48 = 1.0f / t47;
    const float t49 = t45 * t48;
    const float d_py_next = t45 * (9.0f * t48);
    const float t50 = t49 * u_vx_py_next;
    const float t51 = t49 * u_px_py_next;
    const float t52 = weight_y * t39;
    const float t53 = t46 * t39;
    const float s_y_1 = t47 + t52 * t53;
    const float t54 = 1.0f / s_y_1;
    const float t55 = t53 * t54;
    const float d_vy_next = t46 * (t47 * t54);
    const float u_py_vy_next = t39 - t52 * t49;
    const float u_vx_vy_next = t40 - t52 * t50;
    const float u_px_vy_next = t41 - t52 * t51;
    const float t56 = 0.5f * (weighed_x * (weighed_x * t36) + logf(s_x_1) + 1.837877f
        + weighed_y * (weighed_y * t54) + logf(s_y_1) + 1.837877f);
    const float px_next = px + (t33 + t37 * t41) * weighed_x
        + (t51 + t55 * u_px_vy_next) * weighed_y;
    const float vx_next = kf->x[TRACKER_VX] + (t32 + t37 * t40) * weighed_x
        + (t50 + t55 * u_vx_vy_next) * weighed_y;
    const float py_next = py + t42 + (t49 + t55 * u_py_vy_next) * weighed_y;
    const float vy_next = kf->x[TRACKER_VY] + t37 * weighed_x + t55 * weighed_y;

    /* guards */
    if (!tracker_finite(nis + px_next + py_next + vx_next + vy_next + s_x_1 + s_y_1 - t56)) {
        return TRACKER_NOT_FINITE;
    }
    if (!(s_x_1 > 0.0f) || !(s_y_1 > 0.0f)) { return TRACKER_NOT_POSITIVE; }

    /* store */
    kf->x[TRACKER_PX] = px_next;
    kf->x[TRACKER_PY] = py_next;
    kf->x[TRACKER_VX] = vx_next;
    kf->x[TRACKER_VY] = vy_next;
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
    kf->log_likelihood = -t56;
    return flags;
}

tracker_status_t tracker_update_fix_masked(tracker_t *kf, const tracker_fix_t *z, uint32_t mask)
{
    if (kf == NULL || z == NULL) { return TRACKER_NULL_ARGUMENT; }
    tracker_status_t flags = TRACKER_OK;
    const bool t0 = (mask & 0x1u) != 0u;
    const bool t1 = (mask & 0x2u) != 0u;
    if (!(t0 || t1)) { return TRACKER_OK; }

    /* the first measurement sets the state */
    if (!tracker_finite((t0 ? z->x : 0.0f) + (t1 ? z->y : 0.0f))) { return TRACKER_NOT_FINITE; }
    if (!(kf->initialized || !t0 || !t1)) {
        kf->x[TRACKER_PX] = z->x;
        kf->x[TRACKER_PY] = z->y;
        kf->nis = 0.0f;
        kf->initialized = true;
        return TRACKER_OK;
    }

    /* innovation */
    const float px = kf->x[TRACKER_PX];
    const float py = kf->x[TRACKER_PY];
    const float y_x = z->x - px;
    const float y_y = z->y - py;
    const float y = t0 ? y_x : 0.0f;
    const float y_1 = t1 ? y_y : 0.0f;
    const float t2 = t0 ? 1.0f : 0.0f;
    const float t3 = t1 ? 1.0f : 0.0f;
    const float t4 = t0 ? 9.0f : 1.0f;
    const float t5 = t1 ? 9.0f : 1.0f;

    /* gain and covariance: x, y */
    const float d_px = kf->D[0];
    const float t6 = t2 * (d_px * t2);
    const float u_px_vx = kf->U[0];
    const float t7 = u_px_vx * t2;
    const float d_vx = kf->D[1];
    const float t8 = t7 * (d_vx * t7);
    const float t9 = t4 + t6 + t8;
    const float u_px_py = kf->U[1];
    const float t10 = u_px_py * t2;
    const float d_py = kf->D[2];
    const float t11 = d_py * t10;
    const float t12 = t10 * t11;
    const float t13 = t9 + t12;
    const float t14 = 1.0f / t13;
    const float t15 = t11 * t14;
    const float u_px_vy = kf->U[3];
    const float t16 = u_px_vy * t2;
    const float d_vy = kf->D[3];
    const float t17 = d_vy * t16;
    const float t18 = t16 * t17;
    const float s_x = t13 + t18;
    const float t19 = 1.0f / s_x;
    const float u_py_vy = kf->U[5];
    const float t20 = u_py_vy - t16 * t15;
    const float t21 = t20 * t3;
    const float s_y = t5 + t3 * (d_py * (t9 * t14) * t3) + t21 * (d_vy * (t13 * t19) * t21);
    const float nu_y = y_1 - t3 * ((t15 + t17 * t19 * t20) * y);
    const float nis = y * (y * t19) + nu_y * (nu_y * (1.0f / s_y));

    /* guards */
    if (!tracker_finite(y + y_1 + s_x + s_y)) { return TRACKER_NOT_FINITE; }
    if (!(s_x > 0.0f) || !(s_y > 0.0f)) { return TRACKER_NOT_POSITIVE; }

    /* gain and covariance: x */
    const float t22 = sqrtf(t4);
    const float size_x = fabsf(y);
    const bool glitch_x = 3.0f * t22 < size_x && t0;
    const bool large_x = 6.0f * t22 < size_x && t0;
    if (glitch_x && !large_x) { flags |= TRACKER_GLITCH_SMALL; }
    if (large_x) { flags |= TRACKER_GLITCH_LARGE; }
    const float weighed_x = glitch_x ? (large_x ? (y > 0.0f ? t22 : -t22) : 0.33333334f * y) : y;
    const float weight_x = glitch_x ? (large_x ? 0.0f : 0.33333334f) : 1.0f;
    const float t23 = weight_x * (t6 + t8 + t12 + t18);
    const bool t24 = t23 > 1.1754944e-38f;
    const float excess_x = 0.11354f * (weight_x * (weighed_x * weighed_x)) - t23 - t4;
    const bool inflate_x = excess_x > 0.0f && t24;
    if (inflate_x) { flags |= TRACKER_ANOMALY; }
    const float inflation_x = inflate_x ? 1.0f + excess_x * (t24 ? 1.0f / t23 : 0.0f) : 1.0f;
    const float t25 = d_px * inflation_x;
    const float t26 = d_vx * inflation_x;
    const float t27 = d_py * inflation_x;
    const float t28 = d_vy * inflation_x;
    const float t29 = t25 * t2;
    const float t30 = t4 + weight_x * t2 * t29;
    const float t31 = 1.0f / t30;
    const float t32 = t29 * t31;
    const float t33 = weight_x * t7;
    const float t34 = t26 * t7;
    const float t35 = t30 + t33 * t34;
    const float t36 = 1.0f / t35;
    const float t37 = t34 * t36;
    const float u_px_vx_next = u_px_vx - t33 * t32;
    const float t38 = t32 + t37 * u_px_vx_next;
    const float t39 = weight_x * t10;
    const float t40 = t27 * t10;
    const float t41 = t35 + t39 * t40;
    const float t42 = 1.0f / t41;
    const float t43 = t40 * t42;
    const float t44 = t27 * (t35 * t42);
    const float u_vx_py = kf->U[2];
    const float u_vx_py_next = u_vx_py - t39 * t37;
    const float t45 = t37 + t43 * u_vx_py_next;
    const float u_px_py_next = u_px_py - t39 * t38;
    const float t46 = t38 + t43 * u_px_py_next;
    const float t47 = weight_x * t16;
    const float t48 = t28 * t16;
    const float s_x_1 = t41 + t47 * t48;
    const float t49 = 1.0f / s_x_1;
    const float t50 = t48 * t49;
    const float t51 = t28 * (t41 * t49);
    const float t52 = u_py_vy - t47 * t43;
    const float u_vx_vy = kf->U[4];
    const float t53 = u_vx_vy - t47 * t45;
    const float t54 = u_px_vy - t47 * t46;
    const float t55 = (t43 + t50 * t52) * weighed_x;

    /* gain and covariance: y */
    const float nu_y_1 = y_1 - t3 * t55;
    const float t56 = sqrtf(t5);
    const float size_y = fabsf(nu_y_1);
    const bool glitch_y = 3.0f * t56 < size_y && t1;
    const bool large_y = 6.0f * t56 < size_y && t1;
    if (glitch_y && !large_y) { flags |= TRACKER_GLITCH_SMALL; }
    if (large_y) { flags |= TRACKER_GLITCH_LARGE; }
    const float weighed_y = glitch_y ? (large_y ? (nu_y_1 > 0.0f ? t56 : -t56)
        : 0.33333334f * nu_y_1) : nu_y_1;
    const float weight_y = glitch_y ? (large_y ? 0.0f : 0.33333334f) : 1.0f;
    const float t57 = t52 * t3;
    const float t58 = weight_y * (t3 * (t44 * t3) + t57 * (t51 * t57));
    const bool t59 = t58 > 1.1754944e-38f;
    const float excess_y = 0.11354f * (weight_y * (weighed_y * weighed_y)) - t58 - t5;
    const bool inflate_y = excess_y > 0.0f && t59;
    if (inflate_y) { flags |= TRACKER_ANOMALY; }
    const float inflation_y = inflate_y ? 1.0f + excess_y * (t59 ? 1.0f / t58 : 0.0f) : 1.0f;
    const float d_px_next = t25 * (t4 * t31) * inflation_y;
    const float d_vx_next = t26 * (t30 * t36) * inflation_y;
    const float t60 = t44 * inflation_y;
    const float t61 = t51 * inflation_y;
    const float t62 = t60 * t3;
    const float t63 = t5 + weight_y * t3 * t62;
    const float t64 = 1.0f / t63;
    const float t65 = t62 * t64;
    const float d_py_next = t60 * (t5 * t64);
    const float t66 = t65 * u_vx_py_next;
    const float t67 = t65 * u_px_py_next;
    const float t68 = weight_y * t57;
    const float t69 = t61 * t57;
    const float s_y_1 = t63 + t68 * t69;
    const float t70 = 1.0f / s_y_1;
    const float t71 = t69 * t70;
    const float d_vy_next = t61 * (t63 * t70);
    const float u_py_vy_next = t52 - t68 * t65;
    const float u_vx_vy_next = t53 - t68 * t66;
    const float u_px_vy_next = t54 - t68 * t67;
    const float t72 = 0.5f * ((t0 ? weighed_x * (weighed_x * t49) + logf(s_x_1) + 1.837877f : 0.0f)
        + (t1 ? weighed_y * (weighed_y * t70) + logf(s_y_1) + 1.837877f : 0.0f));
    const float px_next = px + (t46 + t50 * t54) * weighed_x
        + (t67 + t71 * u_px_vy_next) * weighed_y;
    const float vx_next = kf->x[TRACKER_VX] + (t45 + t50 * t53) * weighed_x
        + (t66 + t71 * u_vx_vy_next) * weighed_y;
    const float py_next = py + t55 + (t65 + t71 * u_py_vy_next) * weighed_y;
    const float vy_next = kf->x[TRACKER_VY] + t50 * weighed_x + t71 * weighed_y;

    /* guards */
    if (!tracker_finite(nis + px_next + py_next + vx_next + vy_next + s_x_1 + s_y_1 - t72)) {
        return TRACKER_NOT_FINITE;
    }
    if (!(s_x_1 > 0.0f) || !(s_y_1 > 0.0f)) { return TRACKER_NOT_POSITIVE; }

    /* store */
    kf->x[TRACKER_PX] = px_next;
    kf->x[TRACKER_PY] = py_next;
    kf->x[TRACKER_VX] = vx_next;
    kf->x[TRACKER_VY] = vy_next;
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
    kf->log_likelihood = -t72;
    return flags;
}

tracker_status_t tracker_set_state(tracker_t *kf, const tracker_real_t x[4])
{
    if (kf == NULL || x == NULL) { return TRACKER_NULL_ARGUMENT; }
    if (!tracker_finite(x[TRACKER_PX])) { return TRACKER_NOT_FINITE; }
    if (!tracker_finite(x[TRACKER_PY])) { return TRACKER_NOT_FINITE; }
    if (!tracker_finite(x[TRACKER_VX])) { return TRACKER_NOT_FINITE; }
    if (!tracker_finite(x[TRACKER_VY])) { return TRACKER_NOT_FINITE; }
    kf->x[TRACKER_PX] = x[TRACKER_PX];
    kf->x[TRACKER_PY] = x[TRACKER_PY];
    kf->x[TRACKER_VX] = x[TRACKER_VX];
    kf->x[TRACKER_VY] = x[TRACKER_VY];
    return TRACKER_OK;
}

tracker_status_t tracker_set_covariance(tracker_t *kf, const tracker_real_t P[16])
{
    if (kf == NULL || P == NULL) { return TRACKER_NULL_ARGUMENT; }
    float p[10];
    float w[10];

    /* the upper triangle, column by column */
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < j + 1; i++) {
            const bool t0 = TRACKER_order(j) < TRACKER_order(i);
            const float value = P[4 * (t0 ? TRACKER_order(j) : TRACKER_order(i))
                + (t0 ? TRACKER_order(i) : TRACKER_order(j))];
            p[j * (j + 1) / 2 + i] = value;
            w[j * (j + 1) / 2 + i] = value;
            if (!tracker_finite(value)) { return TRACKER_NOT_FINITE; }
        }
    }

    /* factor it: a pivot is zero up to round-off, or positive */
    for (int j = 4 - 1; j >= 0; j--) {
        const float round_off = 4.7683716e-7f * p[j * (j + 1) / 2 + j];
        const float pivot = w[j * (j + 1) / 2 + j];
        if (!(-round_off <= pivot)) { return TRACKER_NOT_POSITIVE; }
        const float d = round_off < pivot ? pivot : 0.0f;
        w[j * (j + 1) / 2 + j] = d;
        for (int i = j - 1; i >= 0; i--) {
            const float rest = w[j * (j + 1) / 2 + i];
            if (d <= 0.0f && 1.9073486e-6f * p[j * (j + 1) / 2 + j] * p[i * (i + 1) / 2 + i] < rest
                * rest) {
                return TRACKER_NOT_POSITIVE;
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
    return TRACKER_OK;
}

void tracker_get_covariance(const tracker_t *kf, tracker_real_t P[16])
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
            P[4 * TRACKER_order(i) + TRACKER_order(j)] = value;
            P[4 * TRACKER_order(j) + TRACKER_order(i)] = value;
        }
    }
}
/* kfgen: body cf6ebe29d0f14c079593f97d29c01b25 */
