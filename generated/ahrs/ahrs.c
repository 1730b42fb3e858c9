/* kfgen build ahrs.yaml */
#include "ahrs.h"

#include <math.h>

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "ahrs tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "ahrs tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool ahrs_finite(float a)
{
    const uint32_t exponent = 0x7f800000u;
    union { float value; uint32_t bits; } view;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

/* not 0 for what is below zero: a test without a branch */
static uint32_t ahrs_sign_bit(float a)
{
    union { float value; uint32_t bits; } view;
    view.value = a;
    return view.bits & 0x80000000u;
}

static float ahrs_max(float a, float b)
{
    return b > a ? b : a;
}

ahrs_status_t ahrs_init(ahrs_t *kf)
{
    if (kf == NULL) { return AHRS_NULL_ARGUMENT; }
    kf->x[AHRS_Q_W] = 1.0f;
    for (int i = 1; i < 7; i++) {
        kf->x[i] = 0.0f;
    }
    kf->P[0] = 0.09f;
    kf->P[1] = 0.0f;
    kf->P[2] = 0.09f;
    kf->P[3] = 0.0f;
    kf->P[4] = 0.0f;
    kf->P[5] = 0.09f;
    kf->P[6] = 0.0f;
    kf->P[7] = 0.0f;
    kf->P[8] = 0.0f;
    kf->P[9] = 0.0004f;
    for (int i = 10; i < 14; i++) {
        kf->P[i] = 0.0f;
    }
    kf->P[14] = 0.0004f;
    for (int i = 15; i < 20; i++) {
        kf->P[i] = 0.0f;
    }
    kf->P[20] = 0.0004f;
    kf->nis = 0.0f;
    kf->gate_count_accel = 0;
    kf->gate_count_mag = 0;
    kf->initialized = false;
    kf->parameters.gyro_noise = 0.003f;
    kf->parameters.field_x = 15.4f;
    kf->parameters.field_y = 0.0f;
    kf->parameters.field_z = -40.8f;
    return AHRS_OK;
}

/* Variances below zero: as large as rounding has left them, without correlations. all: none has
   any */
static ahrs_status_t ahrs_settle(ahrs_real_t P[21], int all)
{
    ahrs_status_t flags = AHRS_OK;
    for (int j = 0; j < 6; j++) {
        const float own = P[j * (j + 1) / 2 + j];
        if (own < 0.0f || all > 0) {
            for (int i = 0; i < 6; i++) {
                P[i < j ? j * (j + 1) / 2 + i : i * (i + 1) / 2 + j] = 0.0f;
            }
            P[j * (j + 1) / 2 + j] = fabsf(own);
            flags |= AHRS_REGULARIZED;
        }
    }
    return flags;
}

ahrs_status_t ahrs_predict(ahrs_t *kf, const ahrs_inputs_t *u, ahrs_real_t dt)
{
    if (kf == NULL || u == NULL) { return AHRS_NULL_ARGUMENT; }
    ahrs_status_t flags = AHRS_OK;

    /* arguments */
    if (!ahrs_finite(u->gx)) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(u->gy)) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(u->gz)) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(dt)) { return AHRS_NOT_FINITE; }
    const bool t0 = dt < 0.001f;
    if (t0) { flags |= AHRS_DT_CLAMPED; }
    const bool t1 = dt > 0.1f;
    if (t1) { flags |= AHRS_DT_CLAMPED; }
    const float step = t1 ? 0.1f : (t0 ? 0.001f : dt);
    const float b_x = kf->x[AHRS_B_X];
    const float b_y = kf->x[AHRS_B_Y];
    const float b_z = kf->x[AHRS_B_Z];

    /* model */
    const float t2 = step * (kf->parameters.gyro_noise * kf->parameters.gyro_noise);
    const float t3 = 1.0e-9f * step;
    const float t4 = (u->gx - b_x) * step;
    const float t5 = (u->gy - b_y) * step;
    const float t6 = (u->gz - b_z) * step;
    const float angle_2 = t4 * t4 + t5 * t5 + t6 * t6;
    const float half_2 = 0.25f * angle_2;
    float cos_half = 1.0f - half_2 * (0.5f
        - half_2 * (0.041666668f - half_2 * (0.0013888889f - 6.200397e-6f * angle_2)));
    float sinc_half = 1.0f - half_2 * (0.16666667f
        - half_2 * (0.008333334f - 0.000049603175f * angle_2));
    if (half_2 > 0.25f) {
        const float half = sqrtf(half_2);
        cos_half = cosf(half);
        sinc_half = sinf(half) / half;
    }
    const float t7 = 0.5f * sinc_half;
    const float t8 = t7 * t4;
    const float t9 = t7 * t5;
    const float t10 = t7 * t6;
    const float t11 = kf->x[AHRS_Q_W] * cos_half - kf->x[AHRS_Q_X] * t8 - kf->x[AHRS_Q_Y] * t9
        - kf->x[AHRS_Q_Z] * t10;
    const float t12 = kf->x[AHRS_Q_W] * t8 + kf->x[AHRS_Q_X] * cos_half + kf->x[AHRS_Q_Y] * t10
        - kf->x[AHRS_Q_Z] * t9;
    const float t13 = kf->x[AHRS_Q_W] * t9 - kf->x[AHRS_Q_X] * t10 + kf->x[AHRS_Q_Y] * cos_half
        + kf->x[AHRS_Q_Z] * t8;
    const float t14 = kf->x[AHRS_Q_W] * t10 + kf->x[AHRS_Q_X] * t9 - kf->x[AHRS_Q_Y] * t8
        + kf->x[AHRS_Q_Z] * cos_half;
    const float t15 = 0.5f * (3.0f - t11 * t11 - t12 * t12 - t13 * t13 - t14 * t14);
    const float q_w_next = t11 * t15;
    const float q_x_next = t12 * t15;
    const float q_y_next = t13 * t15;
    const float q_z_next = t14 * t15;
    const float t16 = sinc_half * sinc_half * 0.5f;
    const float t17 = 1.0f - angle_2 * t16;
    const float t18 = cos_half * sinc_half;
    const float t19 = t18 * t4;
    const float t20 = t18 * t5;
    const float t21 = t18 * t6;
    const float t22 = t16 * t4;
    const float t23 = t16 * t5;
    const float t24 = t16 * t6;
    const float t25 = t22 * t5;
    const float t26 = t22 * t6;
    const float t27 = t23 * t6;
    const float f_q_rx_q_rx = t17 + t22 * t4;
    const float f_q_rx_q_ry = t25 + t21;
    const float f_q_rx_q_rz = t26 - t20;
    const float f_q_ry_q_rx = t25 - t21;
    const float f_q_ry_q_ry = t17 + t23 * t5;
    const float f_q_ry_q_rz = t27 + t19;
    const float f_q_rz_q_rx = t26 + t20;
    const float f_q_rz_q_ry = t27 - t19;
    const float f_q_rz_q_rz = t17 + t24 * t6;
    float cubic = 0.16666667f - angle_2
        * (0.008333334f - angle_2 * (0.0001984127f
        - angle_2 * (2.7557319e-6f - 2.5052108e-8f * angle_2)));
    if (angle_2 > 1.0f) {
        cubic = (1.0f - t18) / angle_2;
    }
    const float t28 = cubic * t4;
    const float t29 = cubic * t5;
    const float t30 = t28 * t5;
    const float t31 = t28 * t6;
    const float t32 = t29 * t6;
    const float t33 = (t18 + t28 * t4) * step;
    const float t34 = (t30 - t24) * step;
    const float t35 = (t31 + t23) * step;
    const float t36 = (t30 + t24) * step;
    const float t37 = (t18 + t29 * t5) * step;
    const float t38 = (t32 - t22) * step;
    const float t39 = (t31 - t23) * step;
    const float t40 = (t32 + t22) * step;
    const float t41 = (t18 + cubic * t6 * t6) * step;

    /* P = F P F^T + Q: the diagonal first, for the guards */
    const float p_q_rx_b_x = kf->P[6];
    const float p_q_ry_b_x = kf->P[7];
    const float p_q_rz_b_x = kf->P[8];
    const float p_b_x_b_x = kf->P[9];
    const float p_b_x_b_y = kf->P[13];
    const float p_b_x_b_z = kf->P[18];
    const float p_q_rx_b_x_next = p_q_rx_b_x * f_q_rx_q_rx + p_q_ry_b_x * f_q_rx_q_ry
        + p_q_rz_b_x * f_q_rx_q_rz - p_b_x_b_x * t33 - p_b_x_b_y * t36 - p_b_x_b_z * t39;
    const float p_q_rx_b_y = kf->P[10];
    const float p_q_ry_b_y = kf->P[11];
    const float p_q_rz_b_y = kf->P[12];
    const float p_b_y_b_y = kf->P[14];
    const float p_b_y_b_z = kf->P[19];
    const float p_q_rx_b_y_next = p_q_rx_b_y * f_q_rx_q_rx + p_q_ry_b_y * f_q_rx_q_ry
        + p_q_rz_b_y * f_q_rx_q_rz - p_b_x_b_y * t33 - p_b_y_b_y * t36 - p_b_y_b_z * t39;
    const float p_q_rx_b_z = kf->P[15];
    const float p_q_ry_b_z = kf->P[16];
    const float p_q_rz_b_z = kf->P[17];
    const float p_b_z_b_z = kf->P[20];
    const float p_q_rx_b_z_next = p_q_rx_b_z * f_q_rx_q_rx + p_q_ry_b_z * f_q_rx_q_ry
        + p_q_rz_b_z * f_q_rx_q_rz - p_b_x_b_z * t33 - p_b_y_b_z * t36 - p_b_z_b_z * t39;
    const float p_q_rx_q_rx = kf->P[0];
    const float p_q_rx_q_ry = kf->P[1];
    const float p_q_rx_q_rz = kf->P[3];
    const float p_q_ry_q_ry = kf->P[2];
    const float p_q_ry_q_rz = kf->P[4];
    const float p_q_rz_q_rz = kf->P[5];
    const float p_q_rx_q_rx_next = (p_q_rx_q_rx * f_q_rx_q_rx + p_q_rx_q_ry * f_q_rx_q_ry
        + p_q_rx_q_rz * f_q_rx_q_rz - p_q_rx_b_x * t33 - p_q_rx_b_y * t36 - p_q_rx_b_z * t39)
        * f_q_rx_q_rx + (p_q_rx_q_ry * f_q_rx_q_rx + p_q_ry_q_ry * f_q_rx_q_ry
        + p_q_ry_q_rz * f_q_rx_q_rz - p_q_ry_b_x * t33 - p_q_ry_b_y * t36 - p_q_ry_b_z * t39)
        * f_q_rx_q_ry + (p_q_rx_q_rz * f_q_rx_q_rx + p_q_ry_q_rz * f_q_rx_q_ry
        + p_q_rz_q_rz * f_q_rx_q_rz - p_q_rz_b_x * t33 - p_q_rz_b_y * t36 - p_q_rz_b_z * t39)
        * f_q_rx_q_rz - p_q_rx_b_x_next * t33 - p_q_rx_b_y_next * t36 - p_q_rx_b_z_next * t39 + t2;
    const float t42 = p_q_rx_q_rx * f_q_ry_q_rx + p_q_rx_q_ry * f_q_ry_q_ry
        + p_q_rx_q_rz * f_q_ry_q_rz - p_q_rx_b_x * t34 - p_q_rx_b_y * t37 - p_q_rx_b_z * t40;
    const float t43 = p_q_rx_q_ry * f_q_ry_q_rx + p_q_ry_q_ry * f_q_ry_q_ry
        + p_q_ry_q_rz * f_q_ry_q_rz - p_q_ry_b_x * t34 - p_q_ry_b_y * t37 - p_q_ry_b_z * t40;
    const float t44 = p_q_rx_q_rz * f_q_ry_q_rx + p_q_ry_q_rz * f_q_ry_q_ry
        + p_q_rz_q_rz * f_q_ry_q_rz - p_q_rz_b_x * t34 - p_q_rz_b_y * t37 - p_q_rz_b_z * t40;
    const float p_q_ry_b_x_next = p_q_rx_b_x * f_q_ry_q_rx + p_q_ry_b_x * f_q_ry_q_ry
        + p_q_rz_b_x * f_q_ry_q_rz - p_b_x_b_x * t34 - p_b_x_b_y * t37 - p_b_x_b_z * t40;
    const float p_q_ry_b_y_next = p_q_rx_b_y * f_q_ry_q_rx + p_q_ry_b_y * f_q_ry_q_ry
        + p_q_rz_b_y * f_q_ry_q_rz - p_b_x_b_y * t34 - p_b_y_b_y * t37 - p_b_y_b_z * t40;
    const float p_q_ry_b_z_next = p_q_rx_b_z * f_q_ry_q_rx + p_q_ry_b_z * f_q_ry_q_ry
        + p_q_rz_b_z * f_q_ry_q_rz - p_b_x_b_z * t34 - p_b_y_b_z * t37 - p_b_z_b_z * t40;
    const float p_q_ry_q_ry_next = t42 * f_q_ry_q_rx + t43 * f_q_ry_q_ry + t44 * f_q_ry_q_rz
        - p_q_ry_b_x_next * t34 - p_q_ry_b_y_next * t37 - p_q_ry_b_z_next * t40 + t2;
    const float t45 = p_q_rx_q_rx * f_q_rz_q_rx + p_q_rx_q_ry * f_q_rz_q_ry
        + p_q_rx_q_rz * f_q_rz_q_rz - p_q_rx_b_x * t35 - p_q_rx_b_y * t38 - p_q_rx_b_z * t41;
    const float t46 = p_q_rx_q_ry * f_q_rz_q_rx + p_q_ry_q_ry * f_q_rz_q_ry
        + p_q_ry_q_rz * f_q_rz_q_rz - p_q_ry_b_x * t35 - p_q_ry_b_y * t38 - p_q_ry_b_z * t41;
    const float t47 = p_q_rx_q_rz * f_q_rz_q_rx + p_q_ry_q_rz * f_q_rz_q_ry
        + p_q_rz_q_rz * f_q_rz_q_rz - p_q_rz_b_x * t35 - p_q_rz_b_y * t38 - p_q_rz_b_z * t41;
    const float p_q_rz_b_x_next = p_q_rx_b_x * f_q_rz_q_rx + p_q_ry_b_x * f_q_rz_q_ry
        + p_q_rz_b_x * f_q_rz_q_rz - p_b_x_b_x * t35 - p_b_x_b_y * t38 - p_b_x_b_z * t41;
    const float p_q_rz_b_y_next = p_q_rx_b_y * f_q_rz_q_rx + p_q_ry_b_y * f_q_rz_q_ry
        + p_q_rz_b_y * f_q_rz_q_rz - p_b_x_b_y * t35 - p_b_y_b_y * t38 - p_b_y_b_z * t41;
    const float p_q_rz_b_z_next = p_q_rx_b_z * f_q_rz_q_rx + p_q_ry_b_z * f_q_rz_q_ry
        + p_q_rz_b_z * f_q_rz_q_rz - p_b_x_b_z * t35 - p_b_y_b_z * t38 - p_b_z_b_z * t41;
    const float p_q_rz_q_rz_next = t45 * f_q_rz_q_rx + t46 * f_q_rz_q_ry + t47 * f_q_rz_q_rz
        - p_q_rz_b_x_next * t35 - p_q_rz_b_y_next * t38 - p_q_rz_b_z_next * t41 + t2;
    const float p_b_x_b_x_next = p_b_x_b_x + t3;
    const float p_b_y_b_y_next = p_b_y_b_y + t3;
    const float p_b_z_b_z_next = p_b_z_b_z + t3;

    /* guards */
    if (!ahrs_finite(q_w_next + q_x_next + q_y_next + q_z_next + p_q_rx_q_rx_next + p_q_ry_q_ry_next
        + p_q_rz_q_rz_next + p_b_x_b_x_next + p_b_y_b_y_next + p_b_z_b_z_next)) {
        return AHRS_NOT_FINITE;
    }

    /* store */
    kf->x[AHRS_Q_W] = q_w_next;
    kf->x[AHRS_Q_X] = q_x_next;
    kf->x[AHRS_Q_Y] = q_y_next;
    kf->x[AHRS_Q_Z] = q_z_next;
    kf->P[20] = p_b_z_b_z_next;
    kf->P[14] = p_b_y_b_y_next;
    kf->P[9] = p_b_x_b_x_next;
    kf->P[17] = p_q_rz_b_z_next;
    kf->P[12] = p_q_rz_b_y_next;
    kf->P[8] = p_q_rz_b_x_next;
    const uint32_t signs = ahrs_sign_bit(p_q_rz_q_rz_next);
    kf->P[5] = p_q_rz_q_rz_next;
    kf->P[16] = p_q_ry_b_z_next;
    kf->P[11] = p_q_ry_b_y_next;
    kf->P[7] = p_q_ry_b_x_next;
    const float p_q_ry_q_rz_next = t45 * f_q_ry_q_rx + t46 * f_q_ry_q_ry + t47 * f_q_ry_q_rz
        - p_q_rz_b_x_next * t34 - p_q_rz_b_y_next * t37 - p_q_rz_b_z_next * t40;
    kf->P[4] = p_q_ry_q_rz_next;
    const uint32_t signs_1 = signs | ahrs_sign_bit(p_q_ry_q_ry_next);
    kf->P[2] = p_q_ry_q_ry_next;
    kf->P[15] = p_q_rx_b_z_next;
    kf->P[10] = p_q_rx_b_y_next;
    kf->P[6] = p_q_rx_b_x_next;
    const float p_q_rx_q_rz_next = t45 * f_q_rx_q_rx + t46 * f_q_rx_q_ry + t47 * f_q_rx_q_rz
        - p_q_rz_b_x_next * t33 - p_q_rz_b_y_next * t36 - p_q_rz_b_z_next * t39;
    kf->P[3] = p_q_rx_q_rz_next;
    const float p_q_rx_q_ry_next = t42 * f_q_rx_q_rx + t43 * f_q_rx_q_ry + t44 * f_q_rx_q_rz
        - p_q_ry_b_x_next * t33 - p_q_ry_b_y_next * t36 - p_q_ry_b_z_next * t39;
    kf->P[1] = p_q_rx_q_ry_next;
    const uint32_t signs_2 = signs_1 | ahrs_sign_bit(p_q_rx_q_rx_next);
    kf->P[0] = p_q_rx_q_rx_next;
    if (signs_2 != 0u) {
        flags |= ahrs_settle(kf->P, 0);
    }
    return flags;
}

ahrs_status_t ahrs_update_accel(ahrs_t *kf, const ahrs_accel_t *z)
{
    if (kf == NULL || z == NULL) { return AHRS_NULL_ARGUMENT; }
    ahrs_status_t flags = AHRS_OK;

    /* innovation */
    const float q_w = kf->x[AHRS_Q_W];
    const float q_x = kf->x[AHRS_Q_X];
    const float q_y = kf->x[AHRS_Q_Y];
    const float q_z = kf->x[AHRS_Q_Z];
    const float q_r22 = 1.0f - 2.0f * (q_x * q_x + q_y * q_y);
    const float up_x = 19.5f * (q_x * q_z - q_w * q_y);
    const float up_z = 9.75f * q_r22;
    const float up_y = 19.5f * (q_y * q_z + q_w * q_x);
    const float y_x = z->x - up_x;
    const float y_y = z->y - up_y;
    const float y_z = z->z - up_z;

    /* gain and covariance: x */
    const float p_q_rx_q_rz = kf->P[3];
    const float p_q_rx_q_ry = kf->P[1];
    const float t0 = p_q_rx_q_rz * up_y - p_q_rx_q_ry * up_z;
    const float p_q_ry_q_rz = kf->P[4];
    const float p_q_ry_q_ry = kf->P[2];
    const float t1 = p_q_ry_q_rz * up_y - p_q_ry_q_ry * up_z;
    const float p_q_rz_q_rz = kf->P[5];
    const float t2 = p_q_rz_q_rz * up_y - p_q_ry_q_rz * up_z;
    const float p_q_rz_b_x = kf->P[8];
    const float p_q_ry_b_x = kf->P[7];
    const float t3 = p_q_rz_b_x * up_y - p_q_ry_b_x * up_z;
    const float p_q_rz_b_y = kf->P[12];
    const float p_q_ry_b_y = kf->P[11];
    const float t4 = p_q_rz_b_y * up_y - p_q_ry_b_y * up_z;
    const float p_q_rz_b_z = kf->P[17];
    const float p_q_ry_b_z = kf->P[16];
    const float t5 = p_q_rz_b_z * up_y - p_q_ry_b_z * up_z;
    const float s_x = up_y * t2 - up_z * t1 + 0.09f;
    const float t6 = 0.9999995f / s_x;
    const float t7 = t0 * t6;
    const float t8 = t1 * t6;
    const float t9 = t2 * t6;
    const float t10 = t3 * t6;
    const float t11 = t4 * t6;
    const float t12 = t5 * t6;
    const float t13 = t7 * y_x;
    const float t14 = t9 * y_x;

    /* gain and covariance: y */
    const float p_q_rx_q_rx = kf->P[0];
    const float t15 = p_q_rx_q_rx - t7 * t0;
    const float t16 = p_q_rx_q_rz - t7 * t2;
    const float t17 = t15 * up_z - t16 * up_x;
    const float t18 = p_q_rx_q_ry - t7 * t1;
    const float t19 = p_q_ry_q_rz - t8 * t2;
    const float t20 = t18 * up_z - t19 * up_x;
    const float t21 = p_q_rz_q_rz - t9 * t2;
    const float t22 = t16 * up_z - t21 * up_x;
    const float p_q_rx_b_x = kf->P[6];
    const float t23 = p_q_rx_b_x - t7 * t3;
    const float t24 = p_q_rz_b_x - t9 * t3;
    const float t25 = t23 * up_z - t24 * up_x;
    const float p_q_rx_b_y = kf->P[10];
    const float t26 = p_q_rx_b_y - t7 * t4;
    const float t27 = p_q_rz_b_y - t9 * t4;
    const float t28 = t26 * up_z - t27 * up_x;
    const float p_q_rx_b_z = kf->P[15];
    const float t29 = p_q_rx_b_z - t7 * t5;
    const float t30 = p_q_rz_b_z - t9 * t5;
    const float t31 = t29 * up_z - t30 * up_x;
    const float s_y = up_z * t17 - up_x * t22 + 0.09f;
    const float t32 = 0.9999995f / s_y;
    const float t33 = t17 * t32;
    const float t34 = t20 * t32;
    const float t35 = t22 * t32;
    const float t36 = t25 * t32;
    const float t37 = t28 * t32;
    const float t38 = t31 * t32;
    const float nu_y = y_y - up_z * t13 + up_x * t14;
    const float t39 = t13 + t33 * nu_y;
    const float t40 = t8 * y_x + t34 * nu_y;

    /* gain and covariance: z */
    const float t41 = t15 - t33 * t17;
    const float t42 = t18 - t33 * t20;
    const float t43 = t42 * up_x - t41 * up_y;
    const float t44 = p_q_ry_q_ry - t8 * t1 - t34 * t20;
    const float t45 = t44 * up_x - t42 * up_y;
    const float t46 = t16 - t33 * t22;
    const float t47 = t19 - t34 * t22;
    const float t48 = t47 * up_x - t46 * up_y;
    const float t49 = t23 - t33 * t25;
    const float t50 = p_q_ry_b_x - t8 * t3 - t34 * t25;
    const float t51 = t50 * up_x - t49 * up_y;
    const float t52 = t26 - t33 * t28;
    const float t53 = p_q_ry_b_y - t8 * t4 - t34 * t28;
    const float t54 = t53 * up_x - t52 * up_y;
    const float t55 = t29 - t33 * t31;
    const float t56 = p_q_ry_b_z - t8 * t5 - t34 * t31;
    const float t57 = t56 * up_x - t55 * up_y;
    const float s_z = up_x * t45 - up_y * t43 + 0.09f;
    const float t58 = 0.9999995f / s_z;
    const float t59 = t43 * t58;
    const float t60 = t45 * t58;
    const float t61 = t48 * t58;
    const float t62 = t51 * t58;
    const float t63 = t54 * t58;
    const float t64 = t57 * t58;
    const float nu_z = y_z - up_x * t40 + up_y * t39;
    const float d_q_rx = t39 + t59 * nu_z;
    const float d_q_ry = t40 + t60 * nu_z;
    const float d_q_rz = t14 + t35 * nu_y + t61 * nu_z;
    const float nis = y_x * (y_x * t6) + nu_y * (nu_y * t32) + nu_z * (nu_z * t58);

    /* state and innovation squared */
    const float angle_2 = d_q_rx * d_q_rx + d_q_ry * d_q_ry + d_q_rz * d_q_rz;
    const float b_x_next = kf->x[AHRS_B_X] + t10 * y_x + t36 * nu_y + t62 * nu_z;
    const float b_y_next = kf->x[AHRS_B_Y] + t11 * y_x + t37 * nu_y + t63 * nu_z;
    const float b_z_next = kf->x[AHRS_B_Z] + t12 * y_x + t38 * nu_y + t64 * nu_z;
    const float half_2 = 0.25f * angle_2;
    float cos_half = 1.0f - half_2 * (0.5f
        - half_2 * (0.041666668f - half_2 * (0.0013888889f - 6.200397e-6f * angle_2)));
    float sinc_half = 1.0f - half_2 * (0.16666667f
        - half_2 * (0.008333334f - 0.000049603175f * angle_2));
    if (half_2 > 0.25f) {
        const float half = sqrtf(half_2);
        cos_half = cosf(half);
        sinc_half = sinf(half) / half;
    }
    const float t65 = 0.5f * sinc_half;
    const float t66 = t65 * d_q_rx;
    const float t67 = t65 * d_q_ry;
    const float t68 = t65 * d_q_rz;
    const float t69 = q_w * cos_half - q_x * t66 - q_y * t67 - q_z * t68;
    const float t70 = q_w * t66 + q_x * cos_half + q_y * t68 - q_z * t67;
    const float t71 = q_w * t67 - q_x * t68 + q_y * cos_half + q_z * t66;
    const float t72 = q_w * t68 + q_x * t67 - q_y * t66 + q_z * cos_half;
    const float t73 = 0.5f * (3.0f - t69 * t69 - t70 * t70 - t71 * t71 - t72 * t72);
    const float q_w_next = t69 * t73;
    const float q_x_next = t70 * t73;
    const float q_y_next = t71 * t73;
    const float q_z_next = t72 * t73;

    /* reset: the errors as seen from the new attitude */
    const float t74 = cos_half * sinc_half;
    const float t75 = sinc_half * sinc_half * 0.5f;
    float cubic = 0.16666667f - angle_2
        * (0.008333334f - angle_2 * (0.0001984127f
        - angle_2 * (2.7557319e-6f - 2.5052108e-8f * angle_2)));
    if (angle_2 > 1.0f) {
        cubic = (1.0f - t74) / angle_2;
    }
    const float t76 = t75 * d_q_rx;
    const float t77 = t75 * d_q_ry;
    const float t78 = t75 * d_q_rz;
    const float t79 = cubic * d_q_rx;
    const float t80 = cubic * d_q_ry;
    const float t81 = t79 * d_q_ry;
    const float t82 = t79 * d_q_rz;
    const float t83 = t80 * d_q_rz;
    const float t84 = t74 + t79 * d_q_rx;
    const float t85 = t81 + t78;
    const float t86 = t82 - t77;
    const float t87 = t81 - t78;
    const float t88 = t74 + t80 * d_q_ry;
    const float t89 = t83 + t76;
    const float t90 = t82 + t77;
    const float t91 = t83 - t76;
    const float t92 = t74 + cubic * d_q_rz * d_q_rz;

    /* P = F P F^T + Q: the diagonal first, for the guards */
    const float t93 = t41 - t59 * t43;
    const float t94 = t44 - t60 * t45;
    const float t95 = t21 - t35 * t22 - t61 * t48;
    const float p_b_x_b_x = kf->P[9];
    const float p_b_x_b_x_next = p_b_x_b_x - t10 * t3 - t36 * t25 - t62 * t51;
    const float p_b_y_b_y = kf->P[14];
    const float p_b_y_b_y_next = p_b_y_b_y - t11 * t4 - t37 * t28 - t63 * t54;
    const float p_b_z_b_z = kf->P[20];
    const float p_b_z_b_z_next = p_b_z_b_z - t12 * t5 - t38 * t31 - t64 * t57;

    /* guards */
    if (!ahrs_finite(y_x + y_y + y_z + s_x + s_y + s_z)) { return AHRS_NOT_FINITE; }
    if (s_x < 0.045f || s_y < 0.045f || s_z < 0.045f) {
        flags |= ahrs_settle(kf->P, 1);
        return flags;
    }

    /* gate */
    const bool t96 = nis > 16.266235f;
    if (t96 && kf->gate_count_accel < 50u) {
        kf->nis = nis;
        kf->gate_count_accel = kf->gate_count_accel + 1u;
        return AHRS_GATED;
    }
    if (t96) { flags |= AHRS_ANOMALY; }
    if (!ahrs_finite(nis + q_w_next + q_x_next + q_y_next + q_z_next + b_x_next + b_y_next
        + b_z_next)) {
        return AHRS_NOT_FINITE;
    }

    /* store */
    kf->x[AHRS_Q_W] = q_w_next;
    kf->x[AHRS_Q_X] = q_x_next;
    kf->x[AHRS_Q_Y] = q_y_next;
    kf->x[AHRS_Q_Z] = q_z_next;
    kf->x[AHRS_B_X] = b_x_next;
    kf->x[AHRS_B_Y] = b_y_next;
    kf->x[AHRS_B_Z] = b_z_next;
    const float t97 = t42 - t59 * t45;
    const float t98 = t46 - t59 * t48;
    const float t99 = t47 - t60 * t48;
    const float p_q_rx_q_rx_next = (t93 * t84 + t97 * t85 + t98 * t86) * t84
        + (t97 * t84 + t94 * t85 + t99 * t86) * t85 + (t98 * t84 + t99 * t85 + t95 * t86) * t86;
    const uint32_t signs = ahrs_sign_bit(p_q_rx_q_rx_next);
    kf->P[0] = p_q_rx_q_rx_next;
    const float t100 = t93 * t87 + t97 * t88 + t98 * t89;
    const float t101 = t97 * t87 + t94 * t88 + t99 * t89;
    const float t102 = t98 * t87 + t99 * t88 + t95 * t89;
    const float p_q_rx_q_ry_next = t100 * t84 + t101 * t85 + t102 * t86;
    kf->P[1] = p_q_rx_q_ry_next;
    const float p_q_ry_q_ry_next = t100 * t87 + t101 * t88 + t102 * t89;
    const uint32_t signs_1 = signs | ahrs_sign_bit(p_q_ry_q_ry_next);
    kf->P[2] = p_q_ry_q_ry_next;
    const float t103 = t93 * t90 + t97 * t91 + t98 * t92;
    const float t104 = t97 * t90 + t94 * t91 + t99 * t92;
    const float t105 = t98 * t90 + t99 * t91 + t95 * t92;
    const float p_q_rx_q_rz_next = t103 * t84 + t104 * t85 + t105 * t86;
    kf->P[3] = p_q_rx_q_rz_next;
    const float p_q_ry_q_rz_next = t103 * t87 + t104 * t88 + t105 * t89;
    kf->P[4] = p_q_ry_q_rz_next;
    const float p_q_rz_q_rz_next = t103 * t90 + t104 * t91 + t105 * t92;
    const uint32_t signs_2 = signs_1 | ahrs_sign_bit(p_q_rz_q_rz_next);
    kf->P[5] = p_q_rz_q_rz_next;
    const float t106 = t49 - t59 * t51;
    const float t107 = t50 - t60 * t51;
    const float t108 = t24 - t35 * t25 - t61 * t51;
    const float p_q_rx_b_x_next = t106 * t84 + t107 * t85 + t108 * t86;
    kf->P[6] = p_q_rx_b_x_next;
    const float p_q_ry_b_x_next = t106 * t87 + t107 * t88 + t108 * t89;
    kf->P[7] = p_q_ry_b_x_next;
    const float p_q_rz_b_x_next = t106 * t90 + t107 * t91 + t108 * t92;
    kf->P[8] = p_q_rz_b_x_next;
    kf->P[9] = p_b_x_b_x_next;
    const float t109 = t52 - t59 * t54;
    const float t110 = t53 - t60 * t54;
    const float t111 = t27 - t35 * t28 - t61 * t54;
    const float p_q_rx_b_y_next = t109 * t84 + t110 * t85 + t111 * t86;
    kf->P[10] = p_q_rx_b_y_next;
    const float p_q_ry_b_y_next = t109 * t87 + t110 * t88 + t111 * t89;
    kf->P[11] = p_q_ry_b_y_next;
    const float p_q_rz_b_y_next = t109 * t90 + t110 * t91 + t111 * t92;
    kf->P[12] = p_q_rz_b_y_next;
    const float p_b_x_b_y_next = kf->P[13] - t10 * t4 - t36 * t28 - t62 * t54;
    kf->P[13] = p_b_x_b_y_next;
    kf->P[14] = p_b_y_b_y_next;
    const float t112 = t55 - t59 * t57;
    const float t113 = t56 - t60 * t57;
    const float t114 = t30 - t35 * t31 - t61 * t57;
    const float p_q_rx_b_z_next = t112 * t84 + t113 * t85 + t114 * t86;
    kf->P[15] = p_q_rx_b_z_next;
    const float p_q_ry_b_z_next = t112 * t87 + t113 * t88 + t114 * t89;
    kf->P[16] = p_q_ry_b_z_next;
    const float p_q_rz_b_z_next = t112 * t90 + t113 * t91 + t114 * t92;
    kf->P[17] = p_q_rz_b_z_next;
    const float p_b_x_b_z_next = kf->P[18] - t10 * t5 - t36 * t31 - t62 * t57;
    kf->P[18] = p_b_x_b_z_next;
    const float p_b_y_b_z_next = kf->P[19] - t11 * t5 - t37 * t31 - t63 * t57;
    kf->P[19] = p_b_y_b_z_next;
    kf->P[20] = p_b_z_b_z_next;
    kf->gate_count_accel = 0;
    kf->nis = nis;
    if (signs_2 != 0u) {
        flags |= ahrs_settle(kf->P, 0);
    }
    return flags;
}

ahrs_status_t ahrs_update_mag(ahrs_t *kf, const ahrs_mag_t *z)
{
    if (kf == NULL || z == NULL) { return AHRS_NULL_ARGUMENT; }
    ahrs_status_t flags = AHRS_OK;

    /* innovation */
    const float q_w = kf->x[AHRS_Q_W];
    const float q_x = kf->x[AHRS_Q_X];
    const float q_y = kf->x[AHRS_Q_Y];
    const float q_z = kf->x[AHRS_Q_Z];
    const float t0 = q_y * q_y;
    const float t1 = q_z * q_z;
    const float q_r00 = 1.0f - 2.0f * (t0 + t1);
    const float t2 = q_x * q_y;
    const float t3 = q_w * q_z;
    const float q_r01 = 2.0f * (t2 - t3);
    const float t4 = q_x * q_z;
    const float t5 = q_w * q_y;
    const float q_r02 = 2.0f * (t4 + t5);
    const float q_r10 = 2.0f * (t2 + t3);
    const float t6 = q_x * q_x;
    const float q_r11 = 1.0f - 2.0f * (t6 + t1);
    const float t7 = q_y * q_z;
    const float t8 = q_w * q_x;
    const float q_r12 = 2.0f * (t7 - t8);
    const float q_r20 = 2.0f * (t4 - t5);
    const float q_r21 = 2.0f * (t7 + t8);
    const float q_r22 = 1.0f - 2.0f * (t6 + t0);
    const float m_x = q_r00 * kf->parameters.field_x + q_r10 * kf->parameters.field_y
        + q_r20 * kf->parameters.field_z;
    const float m_y = q_r01 * kf->parameters.field_x + q_r11 * kf->parameters.field_y
        + q_r21 * kf->parameters.field_z;
    const float m_z = q_r02 * kf->parameters.field_x + q_r12 * kf->parameters.field_y
        + q_r22 * kf->parameters.field_z;
    const float y_x = z->x - m_x;
    const float y_y = z->y - m_y;
    const float y_z = z->z - m_z;

    /* gain and covariance: x */
    const float p_q_rx_q_rz = kf->P[3];
    const float p_q_rx_q_ry = kf->P[1];
    const float t9 = p_q_rx_q_rz * m_y - p_q_rx_q_ry * m_z;
    const float p_q_ry_q_rz = kf->P[4];
    const float p_q_ry_q_ry = kf->P[2];
    const float t10 = p_q_ry_q_rz * m_y - p_q_ry_q_ry * m_z;
    const float p_q_rz_q_rz = kf->P[5];
    const float t11 = p_q_rz_q_rz * m_y - p_q_ry_q_rz * m_z;
    const float p_q_rz_b_x = kf->P[8];
    const float p_q_ry_b_x = kf->P[7];
    const float t12 = p_q_rz_b_x * m_y - p_q_ry_b_x * m_z;
    const float p_q_rz_b_y = kf->P[12];
    const float p_q_ry_b_y = kf->P[11];
    const float t13 = p_q_rz_b_y * m_y - p_q_ry_b_y * m_z;
    const float p_q_rz_b_z = kf->P[17];
    const float p_q_ry_b_z = kf->P[16];
    const float t14 = p_q_rz_b_z * m_y - p_q_ry_b_z * m_z;
    const float s_x = m_y * t11 - m_z * t10 + 9.0f;
    const float t15 = 0.9999995f / s_x;
    const float t16 = t9 * t15;
    const float t17 = t10 * t15;
    const float t18 = t11 * t15;
    const float t19 = t12 * t15;
    const float t20 = t13 * t15;
    const float t21 = t14 * t15;
    const float t22 = t16 * y_x;
    const float t23 = t18 * y_x;

    /* gain and covariance: y */
    const float p_q_rx_q_rx = kf->P[0];
    const float t24 = p_q_rx_q_rx - t16 * t9;
    const float t25 = p_q_rx_q_rz - t16 * t11;
    const float t26 = t24 * m_z - t25 * m_x;
    const float t27 = p_q_rx_q_ry - t16 * t10;
    const float t28 = p_q_ry_q_rz - t17 * t11;
    const float t29 = t27 * m_z - t28 * m_x;
    const float t30 = p_q_rz_q_rz - t18 * t11;
    const float t31 = t25 * m_z - t30 * m_x;
    const float p_q_rx_b_x = kf->P[6];
    const float t32 = p_q_rx_b_x - t16 * t12;
    const float t33 = p_q_rz_b_x - t18 * t12;
    const float t34 = t32 * m_z - t33 * m_x;
    const float p_q_rx_b_y = kf->P[10];
    const float t35 = p_q_rx_b_y - t16 * t13;
    const float t36 = p_q_rz_b_y - t18 * t13;
    const float t37 = t35 * m_z - t36 * m_x;
    const float p_q_rx_b_z = kf->P[15];
    const float t38 = p_q_rx_b_z - t16 * t14;
    const float t39 = p_q_rz_b_z - t18 * t14;
    const float t40 = t38 * m_z - t39 * m_x;
    const float s_y = m_z * t26 - m_x * t31 + 9.0f;
    const float t41 = 0.9999995f / s_y;
    const float t42 = t26 * t41;
    const float t43 = t29 * t41;
    const float t44 = t31 * t41;
    const float t45 = t34 * t41;
    const float t46 = t37 * t41;
    const float t47 = t40 * t41;
    const float nu_y = y_y - m_z * t22 + m_x * t23;
    const float t48 = t22 + t42 * nu_y;
    const float t49 = t17 * y_x + t43 * nu_y;

    /* gain and covariance: z */
    const float t50 = t24 - t42 * t26;
    const float t51 = t27 - t42 * t29;
    const float t52 = t51 * m_x - t50 * m_y;
    const float t53 = p_q_ry_q_ry - t17 * t10 - t43 * t29;
    const float t54 = t53 * m_x - t51 * m_y;
    const float t55 = t25 - t42 * t31;
    const float t56 = t28 - t43 * t31;
    const float t57 = t56 * m_x - t55 * m_y;
    const float t58 = t32 - t42 * t34;
    const float t59 = p_q_ry_b_x - t17 * t12 - t43 * t34;
    const float t60 = t59 * m_x - t58 * m_y;
    const float t61 = t35 - t42 * t37;
    const float t62 = p_q_ry_b_y - t17 * t13 - t43 * t37;
    const float t63 = t62 * m_x - t61 * m_y;
    const float t64 = t38 - t42 * t40;
    const float t65 = p_q_ry_b_z - t17 * t14 - t43 * t40;
    const float t66 = t65 * m_x - t64 * m_y;
    const float s_z = m_x * t54 - m_y * t52 + 9.0f;
    const float t67 = 0.9999995f / s_z;
    const float t68 = t52 * t67;
    const float t69 = t54 * t67;
    const float t70 = t57 * t67;
    const float t71 = t60 * t67;
    const float t72 = t63 * t67;
    const float t73 = t66 * t67;
    const float nu_z = y_z - m_x * t49 + m_y * t48;
    const float d_q_rx = t48 + t68 * nu_z;
    const float d_q_ry = t49 + t69 * nu_z;
    const float d_q_rz = t23 + t44 * nu_y + t70 * nu_z;
    const float nis = y_x * (y_x * t15) + nu_y * (nu_y * t41) + nu_z * (nu_z * t67);

    /* state and innovation squared */
    const float angle_2 = d_q_rx * d_q_rx + d_q_ry * d_q_ry + d_q_rz * d_q_rz;
    const float b_x_next = kf->x[AHRS_B_X] + t19 * y_x + t45 * nu_y + t71 * nu_z;
    const float b_y_next = kf->x[AHRS_B_Y] + t20 * y_x + t46 * nu_y + t72 * nu_z;
    const float b_z_next = kf->x[AHRS_B_Z] + t21 * y_x + t47 * nu_y + t73 * nu_z;
    const float half_2 = 0.25f * angle_2;
    float cos_half = 1.0f - half_2 * (0.5f
        - half_2 * (0.041666668f - half_2 * (0.0013888889f - 6.200397e-6f * angle_2)));
    float sinc_half = 1.0f - half_2 * (0.16666667f
        - half_2 * (0.008333334f - 0.000049603175f * angle_2));
    if (half_2 > 0.25f) {
        const float half = sqrtf(half_2);
        cos_half = cosf(half);
        sinc_half = sinf(half) / half;
    }
    const float t74 = 0.5f * sinc_half;
    const float t75 = t74 * d_q_rx;
    const float t76 = t74 * d_q_ry;
    const float t77 = t74 * d_q_rz;
    const float t78 = q_w * cos_half - q_x * t75 - q_y * t76 - q_z * t77;
    const float t79 = q_w * t75 + q_x * cos_half + q_y * t77 - q_z * t76;
    const float t80 = q_w * t76 - q_x * t77 + q_y * cos_half + q_z * t75;
    const float t81 = q_w * t77 + q_x * t76 - q_y * t75 + q_z * cos_half;
    const float t82 = 0.5f * (3.0f - t78 * t78 - t79 * t79 - t80 * t80 - t81 * t81);
    const float q_w_next = t78 * t82;
    const float q_x_next = t79 * t82;
    const float q_y_next = t80 * t82;
    const float q_z_next = t81 * t82;

    /* reset: the errors as seen from the new attitude */
    const float t83 = cos_half * sinc_half;
    const float t84 = sinc_half * sinc_half * 0.5f;
    float cubic = 0.16666667f - angle_2
        * (0.008333334f - angle_2 * (0.0001984127f
        - angle_2 * (2.7557319e-6f - 2.5052108e-8f * angle_2)));
    if (angle_2 > 1.0f) {
        cubic = (1.0f - t83) / angle_2;
    }
    const float t85 = t84 * d_q_rx;
    const float t86 = t84 * d_q_ry;
    const float t87 = t84 * d_q_rz;
    const float t88 = cubic * d_q_rx;
    const float t89 = cubic * d_q_ry;
    const float t90 = t88 * d_q_ry;
    const float t91 = t88 * d_q_rz;
    const float t92 = t89 * d_q_rz;
    const float t93 = t83 + t88 * d_q_rx;
    const float t94 = t90 + t87;
    const float t95 = t91 - t86;
    const float t96 = t90 - t87;
    const float t97 = t83 + t89 * d_q_ry;
    const float t98 = t92 + t85;
    const float t99 = t91 + t86;
    const float t100 = t92 - t85;
    const float t101 = t83 + cubic * d_q_rz * d_q_rz;

    /* P = F P F^T + Q: the diagonal first, for the guards */
    const float t102 = t50 - t68 * t52;
    const float t103 = t53 - t69 * t54;
    const float t104 = t30 - t44 * t31 - t70 * t57;
    const float p_b_x_b_x = kf->P[9];
    const float p_b_x_b_x_next = p_b_x_b_x - t19 * t12 - t45 * t34 - t71 * t60;
    const float p_b_y_b_y = kf->P[14];
    const float p_b_y_b_y_next = p_b_y_b_y - t20 * t13 - t46 * t37 - t72 * t63;
    const float p_b_z_b_z = kf->P[20];
    const float p_b_z_b_z_next = p_b_z_b_z - t21 * t14 - t47 * t40 - t73 * t66;

    /* guards */
    if (!ahrs_finite(y_x + y_y + y_z + s_x + s_y + s_z)) { return AHRS_NOT_FINITE; }
    if (s_x < 4.5f || s_y < 4.5f || s_z < 4.5f) {
        flags |= ahrs_settle(kf->P, 1);
        return flags;
    }

    /* gate */
    const bool t105 = nis > 16.266235f;
    if (t105 && kf->gate_count_mag < 50u) {
        kf->nis = nis;
        kf->gate_count_mag = kf->gate_count_mag + 1u;
        return AHRS_GATED;
    }
    if (t105) { flags |= AHRS_ANOMALY; }
    if (!ahrs_finite(nis + q_w_next + q_x_next + q_y_next + q_z_next + b_x_next + b_y_next
        + b_z_next)) {
        return AHRS_NOT_FINITE;
    }

    /* store */
    kf->x[AHRS_Q_W] = q_w_next;
    kf->x[AHRS_Q_X] = q_x_next;
    kf->x[AHRS_Q_Y] = q_y_next;
    kf->x[AHRS_Q_Z] = q_z_next;
    kf->x[AHRS_B_X] = b_x_next;
    kf->x[AHRS_B_Y] = b_y_next;
    kf->x[AHRS_B_Z] = b_z_next;
    const float t106 = t51 - t68 * t54;
    const float t107 = t55 - t68 * t57;
    const float t108 = t56 - t69 * t57;
    const float p_q_rx_q_rx_next = (t102 * t93 + t106 * t94 + t107 * t95) * t93
        + (t106 * t93 + t103 * t94 + t108 * t95) * t94
        + (t107 * t93 + t108 * t94 + t104 * t95) * t95;
    const uint32_t signs = ahrs_sign_bit(p_q_rx_q_rx_next);
    kf->P[0] = p_q_rx_q_rx_next;
    const float t109 = t102 * t96 + t106 * t97 + t107 * t98;
    const float t110 = t106 * t96 + t103 * t97 + t108 * t98;
    const float t111 = t107 * t96 + t108 * t97 + t104 * t98;
    const float p_q_rx_q_ry_next = t109 * t93 + t110 * t94 + t111 * t95;
    kf->P[1] = p_q_rx_q_ry_next;
    const float p_q_ry_q_ry_next = t109 * t96 + t110 * t97 + t111 * t98;
    const uint32_t signs_1 = signs | ahrs_sign_bit(p_q_ry_q_ry_next);
    kf->P[2] = p_q_ry_q_ry_next;
    const float t112 = t102 * t99 + t106 * t100 + t107 * t101;
    const float t113 = t106 * t99 + t103 * t100 + t108 * t101;
    const float t114 = t107 * t99 + t108 * t100 + t104 * t101;
    const float p_q_rx_q_rz_next = t112 * t93 + t113 * t94 + t114 * t95;
    kf->P[3] = p_q_rx_q_rz_next;
    const float p_q_ry_q_rz_next = t112 * t96 + t113 * t97 + t114 * t98;
    kf->P[4] = p_q_ry_q_rz_next;
    const float p_q_rz_q_rz_next = t112 * t99 + t113 * t100 + t114 * t101;
    const uint32_t signs_2 = signs_1 | ahrs_sign_bit(p_q_rz_q_rz_next);
    kf->P[5] = p_q_rz_q_rz_next;
    const float t115 = t58 - t68 * t60;
    const float t116 = t59 - t69 * t60;
    const float t117 = t33 - t44 * t34 - t70 * t60;
    const float p_q_rx_b_x_next = t115 * t93 + t116 * t94 + t117 * t95;
    kf->P[6] = p_q_rx_b_x_next;
    const float p_q_ry_b_x_next = t115 * t96 + t116 * t97 + t117 * t98;
    kf->P[7] = p_q_ry_b_x_next;
    const float p_q_rz_b_x_next = t115 * t99 + t116 * t100 + t117 * t101;
    kf->P[8] = p_q_rz_b_x_next;
    kf->P[9] = p_b_x_b_x_next;
    const float t118 = t61 - t68 * t63;
    const float t119 = t62 - t69 * t63;
    const float t120 = t36 - t44 * t37 - t70 * t63;
    const float p_q_rx_b_y_next = t118 * t93 + t119 * t94 + t120 * t95;
    kf->P[10] = p_q_rx_b_y_next;
    const float p_q_ry_b_y_next = t118 * t96 + t119 * t97 + t120 * t98;
    kf->P[11] = p_q_ry_b_y_next;
    const float p_q_rz_b_y_next = t118 * t99 + t119 * t100 + t120 * t101;
    kf->P[12] = p_q_rz_b_y_next;
    const float p_b_x_b_y_next = kf->P[13] - t19 * t13 - t45 * t37 - t71 * t63;
    kf->P[13] = p_b_x_b_y_next;
    kf->P[14] = p_b_y_b_y_next;
    const float t121 = t64 - t68 * t66;
    const float t122 = t65 - t69 * t66;
    const float t123 = t39 - t44 * t40 - t70 * t66;
    const float p_q_rx_b_z_next = t121 * t93 + t122 * t94 + t123 * t95;
    kf->P[15] = p_q_rx_b_z_next;
    const float p_q_ry_b_z_next = t121 * t96 + t122 * t97 + t123 * t98;
    kf->P[16] = p_q_ry_b_z_next;
    const float p_q_rz_b_z_next = t121 * t99 + t122 * t100 + t123 * t101;
    kf->P[17] = p_q_rz_b_z_next;
    const float p_b_x_b_z_next = kf->P[18] - t19 * t14 - t45 * t40 - t71 * t66;
    kf->P[18] = p_b_x_b_z_next;
    const float p_b_y_b_z_next = kf->P[19] - t20 * t14 - t46 * t40 - t72 * t66;
    kf->P[19] = p_b_y_b_z_next;
    kf->P[20] = p_b_z_b_z_next;
    kf->gate_count_mag = 0;
    kf->nis = nis;
    if (signs_2 != 0u) {
        flags |= ahrs_settle(kf->P, 0);
    }
    return flags;
}

ahrs_status_t ahrs_update_start(ahrs_t *kf, const ahrs_start_t *z)
{
    if (kf == NULL || z == NULL) { return AHRS_NULL_ARGUMENT; }
    ahrs_status_t flags = AHRS_OK;

    /* arguments */
    if (!ahrs_finite(kf->parameters.field_x)) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(kf->parameters.field_y)) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(kf->parameters.field_z)) { return AHRS_NOT_FINITE; }

    /* the first measurement sets the state */
    if (!kf->initialized) {
        const float t0 = sqrtf(z->a_x * z->a_x + z->a_y * z->a_y + z->a_z * z->a_z);
        const bool t1 = t0 > 0.0f;
        const float q_start_1 = t1 ? z->a_x / t0 : 0.0f;
        const float q_start_2 = t1 ? z->a_y / t0 : 0.0f;
        const float q_start_3 = t1 ? z->a_z / t0 : 0.0f;
        const float t2 = q_start_1 * q_start_1;
        const bool t3 = q_start_3 * q_start_3 < t2;
        const float t4 = t3 ? 0.0f : q_start_2;
        const float t5 = t3 ? q_start_1 : -q_start_3;
        const float t6 = t3 ? -q_start_2 : 0.0f;
        const float q_start_4 = sqrtf(t4 * t4 + t5 * t5 + t6 * t6);
        const bool t7 = q_start_4 > 0.0f;
        const float q_start_5 = t7 ? t6 / q_start_4 : 0.0f;
        const float q_start_6 = t7 ? t5 / q_start_4 : 0.0f;
        const float q_start_7 = t7 ? t4 / q_start_4 : 0.0f;
        const float t8 = 1.0f + q_start_3;
        const float q_start_8 = t2 + q_start_2 * q_start_2 + t8 * t8;
        const bool t9 = q_start_8 > 1.0e-10f;
        const float sqrt_q_start_8 = sqrtf(q_start_8);
        const float q_start_9 = t9 ? t8 / sqrt_q_start_8 : 0.0f;
        const float q_start_10 = t9 ? q_start_2 / sqrt_q_start_8 : q_start_5;
        const float q_start_11 = t9 ? -(q_start_1 / sqrt_q_start_8) : q_start_6;
        const float q_start_12 = t9 ? 0.0f : q_start_7;
        const float t10 = q_start_12 * q_start_12 * 2.0f;
        const float t11 = q_start_10 * q_start_11 * 2.0f;
        const float t12 = q_start_12 * q_start_9 * 2.0f;
        const float q_start_13 = z->b_x * (1.0f - 2.0f * (q_start_11 * q_start_11) - t10)
            + z->b_y * (t11 - t12) + z->b_z
            * (2.0f * (q_start_10 * q_start_12) + 2.0f * (q_start_11 * q_start_9));
        const float q_start_14 = z->b_x * (t11 + t12)
            + z->b_y * (1.0f - 2.0f * (q_start_10 * q_start_10) - t10)
            + z->b_z * (2.0f * (q_start_11 * q_start_12) - 2.0f * (q_start_10 * q_start_9));
        const float t13 = sqrtf(q_start_13 * q_start_13 + q_start_14 * q_start_14);
        const bool t14 = t13 > 0.0f;
        const float q_start_16 = t14 ? q_start_13 / t13 : 0.0f;
        const float q_start_17 = t14 ? q_start_14 / t13 : 0.0f;
        const float t15 = sqrtf(kf->parameters.field_x * kf->parameters.field_x
            + kf->parameters.field_y * kf->parameters.field_y);
        const bool t16 = t15 > 0.0f;
        const float q_start_18 = t16 ? kf->parameters.field_x / t15 : 0.0f;
        const float q_start_19 = t16 ? kf->parameters.field_y / t15 : 0.0f;
        const float t17 = q_start_16 * q_start_19 - q_start_17 * q_start_18;
        const float t18 = 1.0f + q_start_16 * q_start_18 + q_start_17 * q_start_19;
        const float q_start_20 = t17 * t17 + t18 * t18;
        const bool t19 = q_start_20 > 1.0e-10f;
        const float sqrt_q_start_20 = sqrtf(q_start_20);
        const float q_start_21 = t19 ? t17 / sqrt_q_start_20 : 1.0f;
        const float q_start_22 = t19 ? t18 / sqrt_q_start_20 : 0.0f;
        const float q_w_first = q_start_22 * q_start_9 - q_start_21 * q_start_12;
        const float q_x_first = q_start_22 * q_start_10 - q_start_21 * q_start_11;
        const float q_y_first = q_start_21 * q_start_10 + q_start_22 * q_start_11;
        const float q_z_first = q_start_21 * q_start_9 + q_start_22 * q_start_12;
        if (!ahrs_finite(z->a_x)) { return AHRS_NOT_FINITE; }
        if (!ahrs_finite(z->a_y)) { return AHRS_NOT_FINITE; }
        if (!ahrs_finite(z->a_z)) { return AHRS_NOT_FINITE; }
        if (!ahrs_finite(z->b_x)) { return AHRS_NOT_FINITE; }
        if (!ahrs_finite(z->b_y)) { return AHRS_NOT_FINITE; }
        if (!ahrs_finite(z->b_z)) { return AHRS_NOT_FINITE; }
        if (!ahrs_finite(q_w_first)) { return AHRS_NOT_FINITE; }
        if (!ahrs_finite(q_x_first)) { return AHRS_NOT_FINITE; }
        if (!ahrs_finite(q_y_first)) { return AHRS_NOT_FINITE; }
        if (!ahrs_finite(q_z_first)) { return AHRS_NOT_FINITE; }
        const float largest = ahrs_max(ahrs_max(ahrs_max(fabsf(q_w_first), fabsf(q_x_first)),
            fabsf(q_y_first)), fabsf(q_z_first));
        if (largest < 0.0005f) { return AHRS_NOT_POSITIVE; }
        const float part = q_w_first / largest;
        const float part_1 = q_x_first / largest;
        const float part_2 = q_y_first / largest;
        const float part_3 = q_z_first / largest;
        const float t20 = sqrtf(part * part + part_1 * part_1 + part_2 * part_2 + part_3 * part_3);
        const float norm = largest * t20;
        if (norm < 0.001f) { return AHRS_NOT_POSITIVE; }
        const float t21 = 1.0f / t20;
        kf->x[AHRS_Q_W] = part * t21;
        kf->x[AHRS_Q_X] = part_1 * t21;
        kf->x[AHRS_Q_Y] = part_2 * t21;
        kf->x[AHRS_Q_Z] = part_3 * t21;
        kf->P[0] = 0.01f;
        kf->P[1] = 0.0f;
        kf->P[2] = 0.01f;
        kf->P[3] = 0.0f;
        kf->P[4] = 0.0f;
        kf->P[5] = 0.01f;
        kf->P[6] = 0.0f;
        kf->P[7] = 0.0f;
        kf->P[8] = 0.0f;
        kf->P[10] = 0.0f;
        kf->P[11] = 0.0f;
        kf->P[12] = 0.0f;
        kf->P[15] = 0.0f;
        kf->P[16] = 0.0f;
        kf->P[17] = 0.0f;
        kf->nis = 0.0f;
        kf->initialized = true;
        return AHRS_OK;
    }

    /* innovation */
    const float q_w = kf->x[AHRS_Q_W];
    const float q_x = kf->x[AHRS_Q_X];
    const float q_y = kf->x[AHRS_Q_Y];
    const float q_z = kf->x[AHRS_Q_Z];
    const float t22 = q_y * q_y;
    const float t23 = q_z * q_z;
    const float q_r00 = 1.0f - 2.0f * (t22 + t23);
    const float t24 = q_x * q_y;
    const float t25 = q_w * q_z;
    const float q_r01 = 2.0f * (t24 - t25);
    const float t26 = q_x * q_z;
    const float t27 = q_w * q_y;
    const float q_r02 = 2.0f * (t26 + t27);
    const float q_r10 = 2.0f * (t24 + t25);
    const float t28 = q_x * q_x;
    const float q_r11 = 1.0f - 2.0f * (t28 + t23);
    const float t29 = q_y * q_z;
    const float t30 = q_w * q_x;
    const float q_r12 = 2.0f * (t29 - t30);
    const float t31 = t26 - t27;
    const float q_r20 = 2.0f * t31;
    const float t32 = t29 + t30;
    const float q_r21 = 2.0f * t32;
    const float q_r22 = 1.0f - 2.0f * (t28 + t22);
    const float up_x = 19.5f * t31;
    const float up_z = 9.75f * q_r22;
    const float up_y = 19.5f * t32;
    const float m_x = q_r00 * kf->parameters.field_x + q_r10 * kf->parameters.field_y
        + q_r20 * kf->parameters.field_z;
    const float m_y = q_r01 * kf->parameters.field_x + q_r11 * kf->parameters.field_y
        + q_r21 * kf->parameters.field_z;
    const float m_z = q_r02 * kf->parameters.field_x + q_r12 * kf->parameters.field_y
        + q_r22 * kf->parameters.field_z;
    const float y_a_x = z->a_x - up_x;
    const float y_a_y = z->a_y - up_y;
    const float y_a_z = z->a_z - up_z;
    const float y_b_x = z->b_x - m_x;
    const float y_b_y = z->b_y - m_y;
    const float y_b_z = z->b_z - m_z;

    /* gain and covariance: a_x */
    const float t33 = kf->P[3] * up_y - kf->P[1] * up_z;
    const float t34 = kf->P[4] * up_y - kf->P[2] * up_z;
    const float t35 = kf->P[5] * up_y - kf->P[4] * up_z;
    const float t36 = kf->P[8] * up_y - kf->P[7] * up_z;
    const float t37 = kf->P[12] * up_y - kf->P[11] * up_z;
    const float t38 = kf->P[17] * up_y - kf->P[16] * up_z;
    const float s_a_x = up_y * t35 - up_z * t34 + 0.09f;
    const float t39 = 0.9999995f / s_a_x;
    const float t40 = t33 * t39;
    const float t41 = t34 * t39;
    const float t42 = t35 * t39;
    const float t43 = t36 * t39;
    const float t44 = t37 * t39;
    const float t45 = t38 * t39;
    const float t46 = t40 * y_a_x;
    const float t47 = t42 * y_a_x;

    /* gain and covariance: a_y */
    const float t48 = kf->P[0] - t40 * t33;
    const float t49 = kf->P[3] - t40 * t35;
    const float t50 = t48 * up_z - t49 * up_x;
    const float t51 = kf->P[1] - t40 * t34;
    const float t52 = kf->P[4] - t41 * t35;
    const float t53 = t51 * up_z - t52 * up_x;
    const float t54 = kf->P[5] - t42 * t35;
    const float t55 = t49 * up_z - t54 * up_x;
    const float t56 = kf->P[6] - t40 * t36;
    const float t57 = kf->P[8] - t42 * t36;
    const float t58 = t56 * up_z - t57 * up_x;
    const float t59 = kf->P[10] - t40 * t37;
    const float t60 = kf->P[12] - t42 * t37;
    const float t61 = t59 * up_z - t60 * up_x;
    const float t62 = kf->P[15] - t40 * t38;
    const float t63 = kf->P[17] - t42 * t38;
    const float t64 = t62 * up_z - t63 * up_x;
    const float s_a_y = up_z * t50 - up_x * t55 + 0.09f;
    const float t65 = 0.9999995f / s_a_y;
    const float t66 = t50 * t65;
    const float t67 = t53 * t65;
    const float t68 = t55 * t65;
    const float t69 = t58 * t65;
    const float t70 = t61 * t65;
    const float t71 = t64 * t65;
    const float nu_a_y = y_a_y - up_z * t46 + up_x * t47;
    const float t72 = t46 + t66 * nu_a_y;
    const float t73 = t41 * y_a_x + t67 * nu_a_y;

    /* gain and covariance: a_z */
    const float t74 = t48 - t66 * t50;
    const float t75 = t51 - t66 * t53;
    const float t76 = t75 * up_x - t74 * up_y;
    const float t77 = kf->P[2] - t41 * t34 - t67 * t53;
    const float t78 = t77 * up_x - t75 * up_y;
    const float t79 = t49 - t66 * t55;
    const float t80 = t52 - t67 * t55;
    const float t81 = t80 * up_x - t79 * up_y;
    const float t82 = t56 - t66 * t58;
    const float t83 = kf->P[7] - t41 * t36 - t67 * t58;
    const float t84 = t83 * up_x - t82 * up_y;
    const float t85 = t59 - t66 * t61;
    const float t86 = kf->P[11] - t41 * t37 - t67 * t61;
    const float t87 = t86 * up_x - t85 * up_y;
    const float t88 = t62 - t66 * t64;
    const float t89 = kf->P[16] - t41 * t38 - t67 * t64;
    const float t90 = t89 * up_x - t88 * up_y;
    const float s_a_z = up_x * t78 - up_y * t76 + 0.09f;
    const float t91 = 0.9999995f / s_a_z;
    const float t92 = t76 * t91;
    const float t93 = t78 * t91;
    const float t94 = t81 * t91;
    const float t95 = t84 * t91;
    const float t96 = t87 * t91;
    const float t97 = t90 * t91;
    const float nu_a_z = y_a_z - up_x * t73 + up_y * t72;
    const float t98 = t73 + t93 * nu_a_z;
    const float t99 = t47 + t68 * nu_a_y + t94 * nu_a_z;

    /* gain and covariance: b_x */
    const float t100 = t75 - t92 * t78;
    const float t101 = t79 - t92 * t81;
    const float t102 = t101 * m_y - t100 * m_z;
    const float t103 = t77 - t93 * t78;
    const float t104 = t80 - t93 * t81;
    const float t105 = t104 * m_y - t103 * m_z;
    const float t106 = t54 - t68 * t55 - t94 * t81;
    const float t107 = t106 * m_y - t104 * m_z;
    const float t108 = t83 - t93 * t84;
    const float t109 = t57 - t68 * t58 - t94 * t84;
    const float t110 = t109 * m_y - t108 * m_z;
    const float t111 = t86 - t93 * t87;
    const float t112 = t60 - t68 * t61 - t94 * t87;
    const float t113 = t112 * m_y - t111 * m_z;
    const float t114 = t89 - t93 * t90;
    const float t115 = t63 - t68 * t64 - t94 * t90;
    const float t116 = t115 * m_y - t114 * m_z;
    const float s_b_x = m_y * t107 - m_z * t105 + 9.0f;
    const float t117 = 0.9999995f / s_b_x;
    const float t118 = t102 * t117;
    const float t119 = t105 * t117;
    const float t120 = t107 * t117;
    const float t121 = t110 * t117;
    const float t122 = t113 * t117;
    const float t123 = t116 * t117;
    const float nu_b_x = y_b_x - m_y * t99 + m_z * t98;
    const float t124 = t72 + t92 * nu_a_z + t118 * nu_b_x;
    const float t125 = t99 + t120 * nu_b_x;

    /* gain and covariance: b_y */
    const float t126 = t74 - t92 * t76 - t118 * t102;
    const float t127 = t101 - t118 * t107;
    const float t128 = t126 * m_z - t127 * m_x;
    const float t129 = t100 - t118 * t105;
    const float t130 = t104 - t119 * t107;
    const float t131 = t129 * m_z - t130 * m_x;
    const float t132 = t106 - t120 * t107;
    const float t133 = t127 * m_z - t132 * m_x;
    const float t134 = t82 - t92 * t84 - t118 * t110;
    const float t135 = t109 - t120 * t110;
    const float t136 = t134 * m_z - t135 * m_x;
    const float t137 = t85 - t92 * t87 - t118 * t113;
    const float t138 = t112 - t120 * t113;
    const float t139 = t137 * m_z - t138 * m_x;
    const float t140 = t88 - t92 * t90 - t118 * t116;
    const float t141 = t115 - t120 * t116;
    const float t142 = t140 * m_z - t141 * m_x;
    const float s_b_y = m_z * t128 - m_x * t133 + 9.0f;
    const float t143 = 0.9999995f / s_b_y;
    const float t144 = t128 * t143;
    const float t145 = t131 * t143;
    const float t146 = t133 * t143;
    const float t147 = t136 * t143;
    const float t148 = t139 * t143;
    const float t149 = t142 * t143;
    const float nu_b_y = y_b_y - m_z * t124 + m_x * t125;
    const float t150 = t124 + t144 * nu_b_y;
    const float t151 = t98 + t119 * nu_b_x + t145 * nu_b_y;

    /* gain and covariance: b_z */
    const float t152 = t126 - t144 * t128;
    const float t153 = t129 - t144 * t131;
    const float t154 = t153 * m_x - t152 * m_y;
    const float t155 = t103 - t119 * t105 - t145 * t131;
    const float t156 = t155 * m_x - t153 * m_y;
    const float t157 = t127 - t144 * t133;
    const float t158 = t130 - t145 * t133;
    const float t159 = t158 * m_x - t157 * m_y;
    const float t160 = t134 - t144 * t136;
    const float t161 = t108 - t119 * t110 - t145 * t136;
    const float t162 = t161 * m_x - t160 * m_y;
    const float t163 = t137 - t144 * t139;
    const float t164 = t111 - t119 * t113 - t145 * t139;
    const float t165 = t164 * m_x - t163 * m_y;
    const float t166 = t140 - t144 * t142;
    const float t167 = t114 - t119 * t116 - t145 * t142;
    const float t168 = t167 * m_x - t166 * m_y;
    const float s_b_z = m_x * t156 - m_y * t154 + 9.0f;
    const float t169 = 0.9999995f / s_b_z;
    const float t170 = t154 * t169;
    const float t171 = t156 * t169;
    const float t172 = t159 * t169;
    const float t173 = t162 * t169;
    const float t174 = t165 * t169;
    const float t175 = t168 * t169;
    const float nu_b_z = y_b_z - m_x * t151 + m_y * t150;
    const float d_q_rx = t150 + t170 * nu_b_z;
    const float d_q_ry = t151 + t171 * nu_b_z;
    const float d_q_rz = t125 + t146 * nu_b_y + t172 * nu_b_z;
    const float nis = y_a_x * (y_a_x * t39) + nu_a_y * (nu_a_y * t65) + nu_a_z * (nu_a_z * t91)
        + nu_b_x * (nu_b_x * t117) + nu_b_y * (nu_b_y * t143) + nu_b_z * (nu_b_z * t169);

    /* state and innovation squared */
    const float angle_2 = d_q_rx * d_q_rx + d_q_ry * d_q_ry + d_q_rz * d_q_rz;
    const float b_x_next = kf->x[AHRS_B_X] + t43 * y_a_x + t69 * nu_a_y + t95 * nu_a_z
        + t121 * nu_b_x + t147 * nu_b_y + t173 * nu_b_z;
    const float b_y_next = kf->x[AHRS_B_Y] + t44 * y_a_x + t70 * nu_a_y + t96 * nu_a_z
        + t122 * nu_b_x + t148 * nu_b_y + t174 * nu_b_z;
    const float b_z_next = kf->x[AHRS_B_Z] + t45 * y_a_x + t71 * nu_a_y + t97 * nu_a_z
        + t123 * nu_b_x + t149 * nu_b_y + t175 * nu_b_z;
    const float half_2 = 0.25f * angle_2;
    float cos_half = 1.0f - half_2 * (0.5f
        - half_2 * (0.041666668f - half_2 * (0.0013888889f - 6.200397e-6f * angle_2)));
    float sinc_half = 1.0f - half_2 * (0.16666667f
        - half_2 * (0.008333334f - 0.000049603175f * angle_2));
    if (half_2 > 0.25f) {
        const float half = sqrtf(half_2);
        cos_half = cosf(half);
        sinc_half = sinf(half) / half;
    }
    const float t176 = 0.5f * sinc_half;
    const float t177 = t176 * d_q_rx;
    const float t178 = t176 * d_q_ry;
    const float t179 = t176 * d_q_rz;
    const float t180 = q_w * cos_half - q_x * t177 - q_y * t178 - q_z * t179;
    const float t181 = q_w * t177 + q_x * cos_half + q_y * t179 - q_z * t178;
    const float t182 = q_w * t178 - q_x * t179 + q_y * cos_half + q_z * t177;
    const float t183 = q_w * t179 + q_x * t178 - q_y * t177 + q_z * cos_half;
    const float t184 = 0.5f * (3.0f - t180 * t180 - t181 * t181 - t182 * t182 - t183 * t183);
    const float q_w_next = t180 * t184;
    const float q_x_next = t181 * t184;
    const float q_y_next = t182 * t184;
    const float q_z_next = t183 * t184;

    /* reset: the errors as seen from the new attitude */
    const float t185 = cos_half * sinc_half;
    const float t186 = sinc_half * sinc_half * 0.5f;
    float cubic = 0.16666667f - angle_2
        * (0.008333334f - angle_2 * (0.0001984127f
        - angle_2 * (2.7557319e-6f - 2.5052108e-8f * angle_2)));
    if (angle_2 > 1.0f) {
        cubic = (1.0f - t185) / angle_2;
    }
    const float t187 = t186 * d_q_rx;
    const float t188 = t186 * d_q_ry;
    const float t189 = t186 * d_q_rz;
    const float t190 = cubic * d_q_rx;
    const float t191 = cubic * d_q_ry;
    const float t192 = t190 * d_q_ry;
    const float t193 = t190 * d_q_rz;
    const float t194 = t191 * d_q_rz;
    const float t195 = t185 + t190 * d_q_rx;
    const float t196 = t192 + t189;
    const float t197 = t193 - t188;
    const float t198 = t192 - t189;
    const float t199 = t185 + t191 * d_q_ry;
    const float t200 = t194 + t187;
    const float t201 = t193 + t188;
    const float t202 = t194 - t187;
    const float t203 = t185 + cubic * d_q_rz * d_q_rz;

    /* P = F P F^T + Q: the diagonal first, for the guards */
    const float t204 = t152 - t170 * t154;
    const float t205 = t155 - t171 * t156;
    const float t206 = t132 - t146 * t133 - t172 * t159;
    const float p_b_x_b_x = kf->P[9];
    const float p_b_x_b_x_next = p_b_x_b_x - t43 * t36 - t69 * t58 - t95 * t84 - t121 * t110
        - t147 * t136 - t173 * t162;
    const float p_b_y_b_y = kf->P[14];
    const float p_b_y_b_y_next = p_b_y_b_y - t44 * t37 - t70 * t61 - t96 * t87 - t122 * t113
        - t148 * t139 - t174 * t165;
    const float p_b_z_b_z = kf->P[20];
    const float p_b_z_b_z_next = p_b_z_b_z - t45 * t38 - t71 * t64 - t97 * t90 - t123 * t116
        - t149 * t142 - t175 * t168;

    /* guards */
    if (!ahrs_finite(q_w_next + q_x_next + q_y_next + q_z_next + b_x_next + b_y_next + b_z_next
        + nis + s_a_x + s_a_y + s_a_z + s_b_x + s_b_y + s_b_z)) {
        return AHRS_NOT_FINITE;
    }
    if (s_a_x < 0.045f || s_a_y < 0.045f || s_a_z < 0.045f || s_b_x < 4.5f || s_b_y < 4.5f
        || s_b_z < 4.5f) {
        flags |= ahrs_settle(kf->P, 1);
        return flags;
    }

    /* store */
    kf->x[AHRS_Q_W] = q_w_next;
    kf->x[AHRS_Q_X] = q_x_next;
    kf->x[AHRS_Q_Y] = q_y_next;
    kf->x[AHRS_Q_Z] = q_z_next;
    kf->x[AHRS_B_X] = b_x_next;
    kf->x[AHRS_B_Y] = b_y_next;
    kf->x[AHRS_B_Z] = b_z_next;
    const float t207 = t153 - t170 * t156;
    const float t208 = t157 - t170 * t159;
    const float t209 = t158 - t171 * t159;
    const float p_q_rx_q_rx_next = (t204 * t195 + t207 * t196 + t208 * t197) * t195
        + (t207 * t195 + t205 * t196 + t209 * t197) * t196
        + (t208 * t195 + t209 * t196 + t206 * t197) * t197;
    const uint32_t signs = ahrs_sign_bit(p_q_rx_q_rx_next);
    kf->P[0] = p_q_rx_q_rx_next;
    const float t210 = t204 * t198 + t207 * t199 + t208 * t200;
    const float t211 = t207 * t198 + t205 * t199 + t209 * t200;
    const float t212 = t208 * t198 + t209 * t199 + t206 * t200;
    const float p_q_rx_q_ry_next = t210 * t195 + t211 * t196 + t212 * t197;
    kf->P[1] = p_q_rx_q_ry_next;
    const float p_q_ry_q_ry_next = t210 * t198 + t211 * t199 + t212 * t200;
    const uint32_t signs_1 = signs | ahrs_sign_bit(p_q_ry_q_ry_next);
    kf->P[2] = p_q_ry_q_ry_next;
    const float t213 = t204 * t201 + t207 * t202 + t208 * t203;
    const float t214 = t207 * t201 + t205 * t202 + t209 * t203;
    const float t215 = t208 * t201 + t209 * t202 + t206 * t203;
    const float p_q_rx_q_rz_next = t213 * t195 + t214 * t196 + t215 * t197;
    kf->P[3] = p_q_rx_q_rz_next;
    const float p_q_ry_q_rz_next = t213 * t198 + t214 * t199 + t215 * t200;
    kf->P[4] = p_q_ry_q_rz_next;
    const float p_q_rz_q_rz_next = t213 * t201 + t214 * t202 + t215 * t203;
    const uint32_t signs_2 = signs_1 | ahrs_sign_bit(p_q_rz_q_rz_next);
    kf->P[5] = p_q_rz_q_rz_next;
    const float t216 = t160 - t170 * t162;
    const float t217 = t161 - t171 * t162;
    const float t218 = t135 - t146 * t136 - t172 * t162;
    const float p_q_rx_b_x_next = t216 * t195 + t217 * t196 + t218 * t197;
    kf->P[6] = p_q_rx_b_x_next;
    const float p_q_ry_b_x_next = t216 * t198 + t217 * t199 + t218 * t200;
    kf->P[7] = p_q_ry_b_x_next;
    const float p_q_rz_b_x_next = t216 * t201 + t217 * t202 + t218 * t203;
    kf->P[8] = p_q_rz_b_x_next;
    kf->P[9] = p_b_x_b_x_next;
    const float t219 = t163 - t170 * t165;
    const float t220 = t164 - t171 * t165;
    const float t221 = t138 - t146 * t139 - t172 * t165;
    const float p_q_rx_b_y_next = t219 * t195 + t220 * t196 + t221 * t197;
    kf->P[10] = p_q_rx_b_y_next;
    const float p_q_ry_b_y_next = t219 * t198 + t220 * t199 + t221 * t200;
    kf->P[11] = p_q_ry_b_y_next;
    const float p_q_rz_b_y_next = t219 * t201 + t220 * t202 + t221 * t203;
    kf->P[12] = p_q_rz_b_y_next;
    const float p_b_x_b_y_next = kf->P[13] - t43 * t37 - t69 * t61 - t95 * t87 - t121 * t113
        - t147 * t139 - t173 * t165;
    kf->P[13] = p_b_x_b_y_next;
    kf->P[14] = p_b_y_b_y_next;
    const float t222 = t166 - t170 * t168;
    const float t223 = t167 - t171 * t168;
    const float t224 = t141 - t146 * t142 - t172 * t168;
    const float p_q_rx_b_z_next = t222 * t195 + t223 * t196 + t224 * t197;
    kf->P[15] = p_q_rx_b_z_next;
    const float p_q_ry_b_z_next = t222 * t198 + t223 * t199 + t224 * t200;
    kf->P[16] = p_q_ry_b_z_next;
    const float p_q_rz_b_z_next = t222 * t201 + t223 * t202 + t224 * t203;
    kf->P[17] = p_q_rz_b_z_next;
    const float p_b_x_b_z_next = kf->P[18] - t43 * t38 - t69 * t64 - t95 * t90 - t121 * t116
        - t147 * t142 - t173 * t168;
    kf->P[18] = p_b_x_b_z_next;
    const float p_b_y_b_z_next = kf->P[19] - t44 * t38 - t70 * t64 - t96 * t90 - t122 * t116
        - t148 * t142 - t174 * t168;
    kf->P[19] = p_b_y_b_z_next;
    kf->P[20] = p_b_z_b_z_next;
    kf->nis = nis;
    if (signs_2 != 0u) {
        flags |= ahrs_settle(kf->P, 0);
    }
    return flags;
}

ahrs_status_t ahrs_set_state(ahrs_t *kf, const ahrs_real_t x[7])
{
    if (kf == NULL || x == NULL) { return AHRS_NULL_ARGUMENT; }
    if (!ahrs_finite(x[AHRS_Q_W])) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(x[AHRS_Q_X])) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(x[AHRS_Q_Y])) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(x[AHRS_Q_Z])) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(x[AHRS_B_X])) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(x[AHRS_B_Y])) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(x[AHRS_B_Z])) { return AHRS_NOT_FINITE; }
    const float largest = ahrs_max(ahrs_max(ahrs_max(fabsf(x[AHRS_Q_W]), fabsf(x[AHRS_Q_X])),
        fabsf(x[AHRS_Q_Y])), fabsf(x[AHRS_Q_Z]));
    if (largest < 0.0005f) { return AHRS_NOT_POSITIVE; }
    const float part = x[AHRS_Q_W] / largest;
    const float part_1 = x[AHRS_Q_X] / largest;
    const float part_2 = x[AHRS_Q_Y] / largest;
    const float part_3 = x[AHRS_Q_Z] / largest;
    const float t0 = sqrtf(part * part + part_1 * part_1 + part_2 * part_2 + part_3 * part_3);
    const float norm = largest * t0;
    if (norm < 0.001f) { return AHRS_NOT_POSITIVE; }
    const float t1 = 1.0f / t0;
    kf->x[AHRS_Q_W] = part * t1;
    kf->x[AHRS_Q_X] = part_1 * t1;
    kf->x[AHRS_Q_Y] = part_2 * t1;
    kf->x[AHRS_Q_Z] = part_3 * t1;
    kf->x[AHRS_B_X] = x[AHRS_B_X];
    kf->x[AHRS_B_Y] = x[AHRS_B_Y];
    kf->x[AHRS_B_Z] = x[AHRS_B_Z];
    return AHRS_OK;
}

ahrs_status_t ahrs_set_covariance(ahrs_t *kf, const ahrs_real_t P[36])
{
    if (kf == NULL || P == NULL) { return AHRS_NULL_ARGUMENT; }
    float p[21];
    float w[21];

    /* the upper triangle, column by column */
    for (int j = 0; j < 6; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = P[6 * i + j];
            p[j * (j + 1) / 2 + i] = value;
            w[j * (j + 1) / 2 + i] = value;
            if (!ahrs_finite(value)) { return AHRS_NOT_FINITE; }
        }
    }

    /* factor it: a pivot is zero up to round-off, or positive */
    for (int j = 6 - 1; j >= 0; j--) {
        const float round_off = 7.1525574e-7f * p[j * (j + 1) / 2 + j];
        const float pivot = w[j * (j + 1) / 2 + j];
        if (!(-round_off <= pivot)) { return AHRS_NOT_POSITIVE; }
        const float d = round_off < pivot ? pivot : 0.0f;
        w[j * (j + 1) / 2 + j] = d;
        for (int i = j - 1; i >= 0; i--) {
            const float rest = w[j * (j + 1) / 2 + i];
            if (d <= 0.0f && 2.861023e-6f * p[j * (j + 1) / 2 + j] * p[i * (i + 1) / 2 + i] < rest
                * rest) {
                return AHRS_NOT_POSITIVE;
            }
            const float u = d > 0.0f ? rest / d : 0.0f;
            for (int k = 0; k < i + 1; k++) {
                w[i * (i + 1) / 2 + k] = w[i * (i + 1) / 2 + k] - u * w[j * (j + 1) / 2 + k];
            }
            w[j * (j + 1) / 2 + i] = u;
        }
    }

    /* store */
    for (int k = 0; k < 21; k++) {
        kf->P[k] = p[k];
    }
    return AHRS_OK;
}

void ahrs_get_covariance(const ahrs_t *kf, ahrs_real_t P[36])
{
    if (kf == NULL || P == NULL) { return; }
    for (int j = 0; j < 6; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = kf->P[j * (j + 1) / 2 + i];
            P[6 * i + j] = value;
            P[6 * j + i] = value;
        }
    }
}
/* kfgen: body 169efe00f4005826f0551b8e74f700e9 */
