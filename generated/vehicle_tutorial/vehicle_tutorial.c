/* kfgen build vehicle_tutorial.yaml */
#include "vehicle_tutorial.h"

#include <math.h>

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "vehicle_tutorial tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "vehicle_tutorial tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* constants: in flash on AVR too, where what is only const takes RAM */
#if defined(__AVR__)
#include <avr/pgmspace.h>
#define VEHICLE_TUTORIAL_flash PROGMEM
#define VEHICLE_TUTORIAL_order(i) ((int)pgm_read_byte(&vehicle_tutorial_order[i]))
#else
#define VEHICLE_TUTORIAL_flash
#define VEHICLE_TUTORIAL_order(i) ((int)vehicle_tutorial_order[i])
#endif

/* inner position -> index into x */
static const uint8_t vehicle_tutorial_order[4] VEHICLE_TUTORIAL_flash = {
    0, 2, 1, 3
};

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool vehicle_tutorial_finite(float a)
{
    const uint32_t exponent = 0x7f800000u;
    union { float value; uint32_t bits; } view;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

vehicle_tutorial_status_t vehicle_tutorial_init(vehicle_tutorial_t *kf)
{
    if (kf == NULL) { return VEHICLE_TUTORIAL_NULL_ARGUMENT; }
    kf->x[VEHICLE_TUTORIAL_PX] = 0.0f;
    kf->x[VEHICLE_TUTORIAL_PY] = 0.0f;
    kf->x[VEHICLE_TUTORIAL_V] = 5.0f;
    kf->x[VEHICLE_TUTORIAL_TH] = 0.3f;
    for (int i = 0; i < 6; i++) {
        kf->U[i] = 0.0f;
    }
    kf->D[0] = 1.943236f;
    kf->D[1] = 49.466713f;
    kf->D[2] = 1.943236f;
    kf->D[3] = 3.14f;
    kf->nis = 0.0f;
    return VEHICLE_TUTORIAL_OK;
}

vehicle_tutorial_status_t vehicle_tutorial_predict(vehicle_tutorial_t *kf)
{
    if (kf == NULL) { return VEHICLE_TUTORIAL_NULL_ARGUMENT; }
    const float px = kf->x[VEHICLE_TUTORIAL_PX];
    const float py = kf->x[VEHICLE_TUTORIAL_PY];
    const float v = kf->x[VEHICLE_TUTORIAL_V];
    const float th = kf->x[VEHICLE_TUTORIAL_TH];

    /* model */
    const float step = 0.33333334f * v;
    const float cos_th = cosf(th);
    const float f_py_th = step * cos_th;
    const float px_next = px + f_py_th;
    const float f_px_v = 0.33333334f * cos_th;
    const float sin_th = sinf(th);
    const float t0 = step * sin_th;
    const float py_next = py + t0;
    const float f_py_v = 0.33333334f * sin_th;

    /* F U D U^T F^T + Q */
    const float u_px_v = kf->U[0];
    const float t1 = u_px_v + f_px_v;
    const float u_px_py = kf->U[1];
    const float u_v_py = kf->U[2];
    const float t2 = u_px_py + f_px_v * u_v_py;
    const float t3 = f_py_v * u_v_py + 1.0f;
    const float u_px_th = kf->U[3];
    const float u_v_th = kf->U[4];
    const float t4 = u_px_th + f_px_v * u_v_th - t0;
    const float u_py_th = kf->U[5];
    const float t5 = f_py_v * u_v_th + u_py_th + f_py_th;
    const float d_th = kf->D[3];
    const float d_th_next = 0.083333336f + d_th;
    const float t6 = 1.0f / d_th_next;
    const float t7 = d_th * t6;
    const float t8 = d_th * (0.083333336f * t6);
    const float u_px_th_next = t7 * t4;
    const float u_v_th_next = t7 * u_v_th;
    const float u_py_th_next = t7 * t5;
    const float d_py = kf->D[2];
    const float t9 = d_py * t3;
    const float t10 = t9 * t3;
    const bool t11 = t10 > 0.0f;
    const float t12 = t11 ? t9 / t10 : 0.0f;
    const float t13 = t11 ? 0.0f : d_py;
    const float d_v = kf->D[1];
    const float t14 = d_v * f_py_v;
    const float t15 = t10 + f_py_v * t14;
    const bool t16 = t15 > 0.0f;
    const float t17 = t16 ? t14 / t15 : 0.0f;
    const float t18 = t16 ? t10 / t15 : 1.0f;
    const float t19 = d_v * t18;
    const float t20 = t8 * t5;
    const float d_py_next = t15 + t5 * t20;
    const bool t21 = d_py_next > 0.0f;
    const float t22 = t21 ? t20 / d_py_next : 0.0f;
    const float t23 = t21 ? t15 / d_py_next : 1.0f;
    const float t24 = t8 * t23;
    const float t25 = t12 * t2;
    const float t26 = t18 * t25 + t17 * t1;
    const float t27 = t1 - f_py_v * t25;
    const float u_px_py_next = t23 * t26 + t22 * t4;
    const float t28 = t12 * u_v_py;
    const float t29 = t18 * t28 + t17;
    const float t30 = 1.0f - f_py_v * t28;
    const float u_v_py_next = t23 * t29 + t22 * u_v_th;
    const float t31 = u_v_th - t5 * t29;
    const float t32 = t19 * t30;
    const float t33 = 8.333333f + t30 * t32;
    const float t34 = 1.0f / t33;
    const float t35 = t13 * u_v_py;
    const float t36 = t33 + u_v_py * t35;
    const float t37 = 1.0f / t36;
    const float t38 = t24 * t31;
    const float d_v_next = t36 + t31 * t38;
    const float t39 = 1.0f / d_v_next;
    const float t40 = t32 * t34 * t27;
    const float t41 = t2 - u_v_py * t40;
    const float t42 = t40 + t35 * t37 * t41;
    const float t43 = t4 - t5 * t26 - t31 * t42;
    const float u_px_v_next = t42 + t38 * t39 * t43;
    const float d_px = kf->D[0];
    const float d_px_next = d_px + t27 * (t19 * (8.333333f * t34) * t27)
        + t41 * (t13 * (t33 * t37) * t41) + t43 * (t24 * (t36 * t39) * t43);

    /* guards */
    if (!vehicle_tutorial_finite(px_next + py_next + d_px_next + d_v_next + d_py_next
        + d_th_next)) {
        return VEHICLE_TUTORIAL_NOT_FINITE;
    }

    /* store */
    kf->x[VEHICLE_TUTORIAL_PX] = px_next;
    kf->x[VEHICLE_TUTORIAL_PY] = py_next;
    kf->U[0] = u_px_v_next;
    kf->U[1] = u_px_py_next;
    kf->U[2] = u_v_py_next;
    kf->U[3] = u_px_th_next;
    kf->U[4] = u_v_th_next;
    kf->U[5] = u_py_th_next;
    kf->D[0] = d_px_next;
    kf->D[1] = d_v_next;
    kf->D[2] = d_py_next;
    kf->D[3] = d_th_next;
    return VEHICLE_TUTORIAL_OK;
}

vehicle_tutorial_status_t vehicle_tutorial_update_position(vehicle_tutorial_t *kf,
                                                           const vehicle_tutorial_position_t *z)
{
    if (kf == NULL || z == NULL) { return VEHICLE_TUTORIAL_NULL_ARGUMENT; }

    /* innovation */
    const float px = kf->x[VEHICLE_TUTORIAL_PX];
    const float py = kf->x[VEHICLE_TUTORIAL_PY];
    const float y_x = z->x - px;
    const float y_y = z->y - py;

    /* gain and covariance: x, y */
    const float d_px = kf->D[0];
    const float t0 = 0.6477453f + d_px;
    const float t1 = 1.0f / t0;
    const float t2 = d_px * t1;
    const float d_px_next = d_px * (0.6477453f * t1);
    const float d_v = kf->D[1];
    const float u_px_v = kf->U[0];
    const float t3 = d_v * u_px_v;
    const float t4 = t0 + u_px_v * t3;
    const float t5 = 1.0f / t4;
    const float t6 = t3 * t5;
    const float d_v_next = d_v * (t0 * t5);
    const float u_px_v_next = u_px_v - u_px_v * t2;
    const float t7 = t2 + t6 * u_px_v_next;
    const float d_py = kf->D[2];
    const float u_px_py = kf->U[1];
    const float t8 = d_py * u_px_py;
    const float t9 = t4 + u_px_py * t8;
    const float t10 = 1.0f / t9;
    const float t11 = t8 * t10;
    const float t12 = d_py * (t4 * t10);
    const float t13 = 0.6477453f + t12;
    const float t14 = 1.0f / t13;
    const float t15 = t12 * t14;
    const float d_py_next = t12 * (0.6477453f * t14);
    const float u_v_py = kf->U[2];
    const float u_v_py_next = u_v_py - u_px_py * t6;
    const float t16 = t6 + t11 * u_v_py_next;
    const float t17 = t15 * u_v_py_next;
    const float u_px_py_next = u_px_py - u_px_py * t7;
    const float t18 = t7 + t11 * u_px_py_next;
    const float t19 = t15 * u_px_py_next;
    const float d_th = kf->D[3];
    const float u_px_th = kf->U[3];
    const float t20 = d_th * u_px_th;
    const float s_x = t9 + u_px_th * t20;
    const float t21 = 1.0f / s_x;
    const float t22 = t20 * t21;
    const float t23 = d_th * (t9 * t21);
    const float u_py_th = kf->U[5];
    const float t24 = u_py_th - u_px_th * t11;
    const float t25 = t23 * t24;
    const float s_y = t13 + t24 * t25;
    const float t26 = 1.0f / s_y;
    const float t27 = t25 * t26;
    const float d_th_next = t23 * (t13 * t26);
    const float u_py_th_next = t24 - t24 * t15;
    const float u_v_th = kf->U[4];
    const float t28 = u_v_th - u_px_th * t16;
    const float u_v_th_next = t28 - t24 * t17;
    const float t29 = u_px_th - u_px_th * t18;
    const float u_px_th_next = t29 - t24 * t19;
    const float t30 = (t11 + t22 * t24) * y_x;
    const float nu_y = y_y - t30;
    const float nis = y_x * (y_x * t21) + nu_y * (nu_y * t26);

    /* state and innovation squared */
    const float px_next = px + (t18 + t22 * t29) * y_x + (t19 + t27 * u_px_th_next) * nu_y;
    const float v_next = kf->x[VEHICLE_TUTORIAL_V] + (t16 + t22 * t28) * y_x
        + (t17 + t27 * u_v_th_next) * nu_y;
    const float py_next = py + t30 + (t15 + t27 * u_py_th_next) * nu_y;
    const float th_next = kf->x[VEHICLE_TUTORIAL_TH] + t22 * y_x + t27 * nu_y;

    /* guards */
    if (!vehicle_tutorial_finite(px_next + py_next + v_next + th_next + nis + s_x + s_y)) {
        return VEHICLE_TUTORIAL_NOT_FINITE;
    }
    if (!(s_x > 0.0f) || !(s_y > 0.0f)) { return VEHICLE_TUTORIAL_NOT_POSITIVE; }

    /* store */
    kf->x[VEHICLE_TUTORIAL_PX] = px_next;
    kf->x[VEHICLE_TUTORIAL_PY] = py_next;
    kf->x[VEHICLE_TUTORIAL_V] = v_next;
    kf->x[VEHICLE_TUTORIAL_TH] = th_next;
    kf->U[0] = u_px_v_next;
    kf->U[1] = u_px_py_next;
    kf->U[2] = u_v_py_next;
    kf->U[3] = u_px_th_next;
    kf->U[4] = u_v_th_next;
    kf->U[5] = u_py_th_next;
    kf->D[0] = d_px_next;
    kf->D[1] = d_v_next;
    kf->D[2] = d_py_next;
    kf->D[3] = d_th_next;
    kf->nis = nis;
    return VEHICLE_TUTORIAL_OK;
}

vehicle_tutorial_status_t vehicle_tutorial_set_state(vehicle_tutorial_t *kf,
                                                     const vehicle_tutorial_real_t x[4])
{
    if (kf == NULL || x == NULL) { return VEHICLE_TUTORIAL_NULL_ARGUMENT; }
    if (!vehicle_tutorial_finite(x[VEHICLE_TUTORIAL_PX])) { return VEHICLE_TUTORIAL_NOT_FINITE; }
    if (!vehicle_tutorial_finite(x[VEHICLE_TUTORIAL_PY])) { return VEHICLE_TUTORIAL_NOT_FINITE; }
    if (!vehicle_tutorial_finite(x[VEHICLE_TUTORIAL_V])) { return VEHICLE_TUTORIAL_NOT_FINITE; }
    if (!vehicle_tutorial_finite(x[VEHICLE_TUTORIAL_TH])) { return VEHICLE_TUTORIAL_NOT_FINITE; }
    kf->x[VEHICLE_TUTORIAL_PX] = x[VEHICLE_TUTORIAL_PX];
    kf->x[VEHICLE_TUTORIAL_PY] = x[VEHICLE_TUTORIAL_PY];
    kf->x[VEHICLE_TUTORIAL_V] = x[VEHICLE_TUTORIAL_V];
    kf->x[VEHICLE_TUTORIAL_TH] = x[VEHICLE_TUTORIAL_TH];
    return VEHICLE_TUTORIAL_OK;
}

vehicle_tutorial_status_t vehicle_tutorial_set_covariance(vehicle_tutorial_t *kf,
                                                          const vehicle_tutorial_real_t P[16])
{
    if (kf == NULL || P == NULL) { return VEHICLE_TUTORIAL_NULL_ARGUMENT; }
    float p[10];
    float w[10];

    /* the upper triangle, column by column */
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < j + 1; i++) {
            const bool t0 = VEHICLE_TUTORIAL_order(j) < VEHICLE_TUTORIAL_order(i);
            const float value = P[4 * (t0 ? VEHICLE_TUTORIAL_order(j) : VEHICLE_TUTORIAL_order(i))
                + (t0 ? VEHICLE_TUTORIAL_order(i) : VEHICLE_TUTORIAL_order(j))];
            p[j * (j + 1) / 2 + i] = value;
            w[j * (j + 1) / 2 + i] = value;
            if (!vehicle_tutorial_finite(value)) { return VEHICLE_TUTORIAL_NOT_FINITE; }
        }
    }

    /* factor it: a pivot is zero up to round-off, or positive */
    for (int j = 4 - 1; j >= 0; j--) {
        const float round_off = 4.7683716e-7f * p[j * (j + 1) / 2 + j];
        const float pivot = w[j * (j + 1) / 2 + j];
        if (!(-round_off <= pivot)) { return VEHICLE_TUTORIAL_NOT_POSITIVE; }
        const float d = round_off < pivot ? pivot : 0.0f;
        w[j * (j + 1) / 2 + j] = d;
        for (int i = j - 1; i >= 0; i--) {
            const float rest = w[j * (j + 1) / 2 + i];
            if (d <= 0.0f && 1.9073486e-6f * p[j * (j + 1) / 2 + j] * p[i * (i + 1) / 2 + i] < rest
                * rest) {
                return VEHICLE_TUTORIAL_NOT_POSITIVE;
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
    return VEHICLE_TUTORIAL_OK;
}

void vehicle_tutorial_get_covariance(const vehicle_tutorial_t *kf, vehicle_tutorial_real_t P[16])
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
            P[4 * VEHICLE_TUTORIAL_order(i) + VEHICLE_TUTORIAL_order(j)] = value;
            P[4 * VEHICLE_TUTORIAL_order(j) + VEHICLE_TUTORIAL_order(i)] = value;
        }
    }
}
/* kfgen: body 0308ad4cafa461730db0147e9ae1b1ab */
