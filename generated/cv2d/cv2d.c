/* kfgen build cv2d.yaml */
#include "cv2d.h"

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "cv2d tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "cv2d tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* constants: in flash on AVR too, where what is only const takes RAM */
#if defined(__AVR__)
#include <avr/pgmspace.h>
#define CV2D_flash PROGMEM
#define CV2D_order(i) ((int)pgm_read_byte(&cv2d_order[i]))
#else
#define CV2D_flash
#define CV2D_order(i) ((int)cv2d_order[i])
#endif

/* inner position -> index into x */
static const uint8_t cv2d_order[4] CV2D_flash = {
    0, 2, 1, 3
};

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool cv2d_finite(float a)
{
    const uint32_t exponent = 0x7f800000u;
    union { float value; uint32_t bits; } view;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

cv2d_status_t cv2d_init(cv2d_t *kf)
{
    if (kf == NULL) { return CV2D_NULL_ARGUMENT; }
    for (int i = 0; i < 4; i++) {
        kf->x[i] = 0.0f;
    }
    for (int i = 0; i < 6; i++) {
        kf->U[i] = 0.0f;
    }
    kf->D[0] = 100.0f;
    kf->D[1] = 9.0f;
    kf->D[2] = 100.0f;
    kf->D[3] = 9.0f;
    kf->nis = 0.0f;
    kf->parameters.agility = 0.3f;
    return CV2D_OK;
}

cv2d_status_t cv2d_predict(cv2d_t *kf, cv2d_real_t dt)
{
    if (kf == NULL) { return CV2D_NULL_ARGUMENT; }
    cv2d_status_t flags = CV2D_OK;
    if (!cv2d_finite(dt)) { return CV2D_NOT_FINITE; }
    const bool t0 = dt < 0.001f;
    if (t0) { flags |= CV2D_DT_CLAMPED; }
    const bool t1 = dt > 10.0f;
    if (t1) { flags |= CV2D_DT_CLAMPED; }
    const float step = t1 ? 10.0f : (t0 ? 0.001f : dt);
    const float vx = kf->x[CV2D_VX];
    const float vy = kf->x[CV2D_VY];

    /* model */
    const float px_next = kf->x[CV2D_PX] + vx * step;
    const float py_next = kf->x[CV2D_PY] + vy * step;
    const float t2 = 0.21132487f * step;
    const float t3 = kf->parameters.agility * kf->parameters.agility * (0.5f * step);
    const float t4 = 0.7886751f * step;

    /* F U, unit upper triangular as F is */
    const float u_px_vx = kf->U[0];
    const float t5 = u_px_vx + step;
    const float u_px_py = kf->U[1];
    const float u_vx_py = kf->U[2];
    const float t6 = u_px_py + step * u_vx_py;
    const float u_px_vy = kf->U[3];
    const float u_vx_vy = kf->U[4];
    const float t7 = u_px_vy + step * u_vx_vy;
    const float u_py_vy = kf->U[5];
    const float t8 = u_py_vy + step;

    /* process noise */
    const float d_vy = kf->D[3];
    const float t9 = d_vy + t3;
    const bool t10 = t9 > 0.0f;
    const float t11 = t10 ? d_vy / t9 : 1.0f;
    const float t12 = t3 * t11;
    const float d_vy_next = t9 + t3;
    const bool t13 = d_vy_next > 0.0f;
    const float t14 = t13 ? t9 / d_vy_next : 1.0f;
    const float t15 = t3 * t14;
    const float t16 = t11 * t7;
    const float u_px_vy_next = t14 * t16;
    const float t17 = t11 * u_vx_vy;
    const float u_vx_vy_next = t14 * t17;
    const float t18 = t11 * t8 + (t10 ? t3 / t9 : 0.0f) * t2;
    const float t19 = t2 - t8;
    const float u_py_vy_next = t14 * t18 + (t13 ? t3 / d_vy_next : 0.0f) * t4;
    const float t20 = t4 - t18;
    const float t21 = t12 * t19;
    const float d_py = kf->D[2];
    const float t22 = d_py + t19 * t21;
    const bool t23 = t22 > 0.0f;
    const float t24 = t23 ? t21 / t22 : 0.0f;
    const float t25 = t23 ? d_py / t22 : 1.0f;
    const float t26 = t12 * t25;
    const float t27 = t15 * t20;
    const float d_py_next = t22 + t20 * t27;
    const bool t28 = d_py_next > 0.0f;
    const float t29 = t28 ? t27 / d_py_next : 0.0f;
    const float t30 = t28 ? t22 / d_py_next : 1.0f;
    const float t31 = t15 * t30;
    const float t32 = t25 * t6 - t24 * t7;
    const float t33 = t7 + t19 * t6;
    const float u_px_py_next = t30 * t32 - t29 * t16;
    const float t34 = t16 + t20 * t32;
    const float t35 = t25 * u_vx_py - t24 * u_vx_vy;
    const float t36 = u_vx_vy + t19 * u_vx_py;
    const float u_vx_py_next = t30 * t35 - t29 * t17;
    const float t37 = t17 + t20 * t35;
    const float d_vx = kf->D[1];
    const float t38 = d_vx + t3;
    const bool t39 = t38 > 0.0f;
    const float t40 = t39 ? d_vx / t38 : 1.0f;
    const float t41 = t26 * t36;
    const float t42 = t38 + t36 * t41;
    const bool t43 = t42 > 0.0f;
    const float t44 = t43 ? t38 / t42 : 1.0f;
    const float t45 = t42 + t3;
    const bool t46 = t45 > 0.0f;
    const float t47 = t46 ? t42 / t45 : 1.0f;
    const float t48 = t31 * t37;
    const float d_vx_next = t45 + t37 * t48;
    const bool t49 = d_vx_next > 0.0f;
    const float t50 = t49 ? t45 / d_vx_next : 1.0f;
    const float t51 = t40 * t5 + (t39 ? t3 / t38 : 0.0f) * t2;
    const float t52 = t2 - t5;
    const float t53 = t44 * t51 - (t43 ? -(t41 / t42) : 0.0f) * t33;
    const float t54 = t36 * t51 - t33;
    const float t55 = t47 * t53 + (t46 ? t3 / t45 : 0.0f) * t4;
    const float t56 = t4 - t53;
    const float u_px_vx_next = t50 * t55 - (t49 ? -(t48 / d_vx_next) : 0.0f) * t34;
    const float t57 = t37 * t55 - t34;
    const float d_px = kf->D[0];
    const float d_px_next = d_px + t52 * (t3 * t40 * t52) + t54 * (t26 * t44 * t54)
        + t56 * (t3 * t47 * t56) + t57 * (t31 * t50 * t57);

    /* guards */
    if (!cv2d_finite(px_next + py_next + d_px_next + d_vx_next + d_py_next + d_vy_next)) {
        return CV2D_NOT_FINITE;
    }

    /* store */
    kf->x[CV2D_PX] = px_next;
    kf->x[CV2D_PY] = py_next;
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
    return flags;
}

cv2d_status_t cv2d_update_camera(cv2d_t *kf, const cv2d_camera_t *z)
{
    if (kf == NULL || z == NULL) { return CV2D_NULL_ARGUMENT; }

    /* innovation */
    const float px = kf->x[CV2D_PX];
    const float py = kf->x[CV2D_PY];
    const float y_x = z->x - px;
    const float y_y = z->y - py;

    /* gain and covariance: x, y */
    const float d_px = kf->D[0];
    const float t0 = 0.25f + d_px;
    const float t1 = 1.0f / t0;
    const float t2 = d_px * t1;
    const float d_px_next = d_px * (0.25f * t1);
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
    const float t13 = 0.25f + t12;
    const float t14 = 1.0f / t13;
    const float t15 = t12 * t14;
    const float d_py_next = t12 * (0.25f * t14);
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
    const float vx_next = kf->x[CV2D_VX] + (t16 + t22 * t28) * y_x
        + (t17 + t27 * u_vx_vy_next) * nu_y;
    const float py_next = py + t30 + (t15 + t27 * u_py_vy_next) * nu_y;
    const float vy_next = kf->x[CV2D_VY] + t22 * y_x + t27 * nu_y;

    /* guards */
    if (!cv2d_finite(y_x + y_y + s_x + s_y)) { return CV2D_NOT_FINITE; }
    if (!(s_x > 0.0f) || !(s_y > 0.0f)) { return CV2D_NOT_POSITIVE; }

    /* gate */
    if (nis > 18.420681f) {
        kf->nis = nis;
        return CV2D_GATED;
    }
    if (!cv2d_finite(nis + px_next + py_next + vx_next + vy_next)) { return CV2D_NOT_FINITE; }

    /* store */
    kf->x[CV2D_PX] = px_next;
    kf->x[CV2D_PY] = py_next;
    kf->x[CV2D_VX] = vx_next;
    kf->x[CV2D_VY] = vy_next;
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
    return CV2D_OK;
}

cv2d_status_t cv2d_set_state(cv2d_t *kf, const cv2d_real_t x[4])
{
    if (kf == NULL || x == NULL) { return CV2D_NULL_ARGUMENT; }
    if (!cv2d_finite(x[CV2D_PX])) { return CV2D_NOT_FINITE; }
    if (!cv2d_finite(x[CV2D_PY])) { return CV2D_NOT_FINITE; }
    if (!cv2d_finite(x[CV2D_VX])) { return CV2D_NOT_FINITE; }
    if (!cv2d_finite(x[CV2D_VY])) { return CV2D_NOT_FINITE; }
    kf->x[CV2D_PX] = x[CV2D_PX];
    kf->x[CV2D_PY] = x[CV2D_PY];
    kf->x[CV2D_VX] = x[CV2D_VX];
    kf->x[CV2D_VY] = x[CV2D_VY];
    return CV2D_OK;
}

cv2d_status_t cv2d_set_covariance(cv2d_t *kf, const cv2d_real_t P[16])
{
    if (kf == NULL || P == NULL) { return CV2D_NULL_ARGUMENT; }
    float p[10];
    float w[10];

    /* the upper triangle, column by column */
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < j + 1; i++) {
            const bool t0 = CV2D_order(j) < CV2D_order(i);
            const float value = P[4 * (t0 ? CV2D_order(j) : CV2D_order(i))
                + (t0 ? CV2D_order(i) : CV2D_order(j))];
            p[j * (j + 1) / 2 + i] = value;
            w[j * (j + 1) / 2 + i] = value;
            if (!cv2d_finite(value)) { return CV2D_NOT_FINITE; }
        }
    }

    /* factor it: a pivot is zero up to round-off, or positive */
    for (int j = 4 - 1; j >= 0; j--) {
        const float round_off = 4.7683716e-7f * p[j * (j + 1) / 2 + j];
        const float pivot = w[j * (j + 1) / 2 + j];
        if (!(-round_off <= pivot)) { return CV2D_NOT_POSITIVE; }
        const float d = round_off < pivot ? pivot : 0.0f;
        w[j * (j + 1) / 2 + j] = d;
        for (int i = j - 1; i >= 0; i--) {
            const float rest = w[j * (j + 1) / 2 + i];
            if (d <= 0.0f && 1.9073486e-6f * p[j * (j + 1) / 2 + j] * p[i * (i + 1) / 2 + i] < rest
                * rest) {
                return CV2D_NOT_POSITIVE;
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
    return CV2D_OK;
}

void cv2d_get_covariance(const cv2d_t *kf, cv2d_real_t P[16])
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
            P[4 * CV2D_order(i) + CV2D_order(j)] = value;
            P[4 * CV2D_order(j) + CV2D_order(i)] = value;
        }
    }
}
/* kfgen: body 94e142efe89abd43e8c0455054280cf4 */
