/* kfgen build px4.yaml */
#include "px4.h"

#include <math.h>

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "px4 tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "px4 tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool px4_finite(float a)
{
    const uint32_t exponent = 0x7f800000u;
    union { float value; uint32_t bits; } view;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

static float px4_max(float a, float b)
{
    return b > a ? b : a;
}

px4_status_t px4_init(px4_t *kf)
{
    if (kf == NULL) { return PX4_NULL_ARGUMENT; }
    kf->x[PX4_WIND_N] = 0.0f;
    kf->x[PX4_WIND_E] = 0.0f;
    kf->x[PX4_EARTH_X] = 0.21f;
    kf->x[PX4_EARTH_Y] = 0.02f;
    kf->x[PX4_EARTH_Z] = 0.43f;
    for (int i = 5; i < 11; i++) {
        kf->x[i] = 0.0f;
    }
    kf->x[PX4_V_N] = 15.0f;
    kf->x[PX4_V_E] = 0.0f;
    kf->x[PX4_V_D] = 0.0f;
    kf->x[PX4_Q_W] = 1.0f;
    for (int i = 15; i < 24; i++) {
        kf->x[i] = 0.0f;
    }
    for (int i = 0; i < 276; i++) {
        kf->P[i] = 0.0f;
    }
    kf->P[0] = 4.0f;
    kf->P[2] = 4.0f;
    kf->P[5] = 0.0025f;
    kf->P[9] = 0.0025f;
    kf->P[14] = 0.0025f;
    kf->P[20] = 0.0025f;
    kf->P[27] = 0.0025f;
    kf->P[35] = 0.0025f;
    kf->P[44] = 9.0f;
    kf->P[54] = 9.0f;
    kf->P[65] = 9.0f;
    kf->P[77] = 0.25f;
    kf->P[90] = 0.25f;
    kf->P[104] = 0.25f;
    kf->P[119] = 0.0025f;
    kf->P[135] = 0.0025f;
    kf->P[152] = 0.04f;
    kf->P[170] = 0.0001f;
    kf->P[189] = 0.0001f;
    kf->P[209] = 0.0001f;
    kf->P[230] = 0.01f;
    kf->P[252] = 0.01f;
    kf->P[275] = 0.01f;
    kf->nis = 0.0f;
    return PX4_OK;
}

/* Variances below zero: as large as rounding has left them, without correlations. all: none has
   any */
static px4_status_t px4_settle(px4_real_t P[276], int all)
{
    px4_status_t flags = PX4_OK;
    for (int j = 0; j < 23; j++) {
        const float own = P[j * (j + 1) / 2 + j];
        if (own < 0.0f || all > 0) {
            for (int i = 0; i < 23; i++) {
                P[i < j ? j * (j + 1) / 2 + i : i * (i + 1) / 2 + j] = 0.0f;
            }
            P[j * (j + 1) / 2 + j] = fabsf(own);
            flags |= PX4_REGULARIZED;
        }
    }
    return flags;
}

px4_status_t px4_predict(px4_t *kf, const px4_inputs_t *u)
{
    if (kf == NULL || u == NULL) { return PX4_NULL_ARGUMENT; }
    px4_status_t flags = PX4_OK;

    /* arguments */
    if (!px4_finite(u->gyro_x)) { return PX4_NOT_FINITE; }
    if (!px4_finite(u->gyro_y)) { return PX4_NOT_FINITE; }
    if (!px4_finite(u->gyro_z)) { return PX4_NOT_FINITE; }
    if (!px4_finite(u->accel_x)) { return PX4_NOT_FINITE; }
    if (!px4_finite(u->accel_y)) { return PX4_NOT_FINITE; }
    if (!px4_finite(u->accel_z)) { return PX4_NOT_FINITE; }
    const float v_n = kf->x[PX4_V_N];
    const float v_e = kf->x[PX4_V_E];
    const float v_d = kf->x[PX4_V_D];
    const float q_w = kf->x[PX4_Q_W];
    const float q_x = kf->x[PX4_Q_X];
    const float q_y = kf->x[PX4_Q_Y];
    const float q_z = kf->x[PX4_Q_Z];
    const float bg_x = kf->x[PX4_BG_X];
    const float bg_y = kf->x[PX4_BG_Y];
    const float bg_z = kf->x[PX4_BG_Z];
    const float ba_x = kf->x[PX4_BA_X];
    const float ba_y = kf->x[PX4_BA_Y];
    const float ba_z = kf->x[PX4_BA_Z];

    /* model */
    const float t1 = u->accel_x - ba_x;
    const float t2 = u->accel_y - ba_y;
    const float t3 = u->accel_z - ba_z;
    const float t4 = q_y * q_y;
    const float t5 = q_z * q_z;
    const float q_r00 = 1.0f - 2.0f * (t4 + t5);
    const float t6 = q_x * q_y;
    const float t7 = q_w * q_z;
    const float t8 = t6 - t7;
    const float q_r01 = 2.0f * t8;
    const float t9 = q_x * q_z;
    const float t10 = q_w * q_y;
    const float t11 = t9 + t10;
    const float q_r02 = 2.0f * t11;
    const float t12 = t6 + t7;
    const float q_r10 = 2.0f * t12;
    const float t13 = q_x * q_x;
    const float q_r11 = 1.0f - 2.0f * (t13 + t5);
    const float t14 = q_y * q_z;
    const float t15 = q_w * q_x;
    const float t16 = t14 - t15;
    const float q_r12 = 2.0f * t16;
    const float t17 = t9 - t10;
    const float q_r20 = 2.0f * t17;
    const float t18 = t14 + t15;
    const float q_r21 = 2.0f * t18;
    const float q_r22 = 1.0f - 2.0f * (t13 + t4);
    const float p_n_next = kf->x[PX4_P_N] + 0.01f * v_n;
    const float p_e_next = kf->x[PX4_P_E] + 0.01f * v_e;
    const float p_d_next = kf->x[PX4_P_D] + 0.01f * v_d;
    const float f_v_n_q_rx = 0.01f * (q_r02 * t2 - q_r01 * t3);
    const float f_v_n_q_ry = 0.01f * (q_r00 * t3 - q_r02 * t1);
    const float f_v_n_q_rz = 0.01f * (q_r01 * t1 - q_r00 * t2);
    const float v_n_next = v_n + 0.01f * (q_r00 * t1 + q_r01 * t2 + q_r02 * t3);
    const float f_v_e_q_rx = 0.01f * (q_r12 * t2 - q_r11 * t3);
    const float f_v_e_q_ry = 0.01f * (q_r10 * t3 - q_r12 * t1);
    const float f_v_e_q_rz = 0.01f * (q_r11 * t1 - q_r10 * t2);
    const float v_e_next = v_e + 0.01f * (q_r10 * t1 + q_r11 * t2 + q_r12 * t3);
    const float f_v_d_q_rx = 0.01f * (q_r22 * t2 - q_r21 * t3);
    const float f_v_d_q_ry = 0.01f * (q_r20 * t3 - q_r22 * t1);
    const float f_v_d_q_rz = 0.01f * (q_r21 * t1 - q_r20 * t2);
    const float v_d_next = v_d + 0.01f * (9.80665f + q_r20 * t1 + q_r21 * t2 + q_r22 * t3);
    const float t19 = 0.01f * (u->gyro_x - bg_x);
    const float t20 = 0.01f * (u->gyro_y - bg_y);
    const float t21 = 0.01f * (u->gyro_z - bg_z);
    const float angle_2 = t19 * t19 + t20 * t20 + t21 * t21;
    const float half_2 = 0.25f * angle_2;
    const float cos_half = 1.0f - half_2 * (0.5f - 0.010416667f * angle_2);
    const float sinc_half = 1.0f - half_2 * (0.16666667f - 0.0020833334f * angle_2);
    const float t22 = 0.5f * sinc_half;
    const float t23 = t22 * t19;
    const float t24 = t22 * t20;
    const float t25 = t22 * t21;
    const float t26 = q_w * cos_half - q_x * t23 - q_y * t24 - q_z * t25;
    const float t27 = q_w * t23 + q_x * cos_half + q_y * t25 - q_z * t24;
    const float t28 = q_w * t24 - q_x * t25 + q_y * cos_half + q_z * t23;
    const float t29 = q_w * t25 + q_x * t24 - q_y * t23 + q_z * cos_half;
    const float t30 = 0.5f * (3.0f - t26 * t26 - t27 * t27 - t28 * t28 - t29 * t29);
    const float q_w_next = t26 * t30;
    const float q_x_next = t27 * t30;
    const float q_y_next = t28 * t30;
    const float q_z_next = t29 * t30;
    const float t31 = sinc_half * sinc_half * 0.5f;
    const float t32 = 1.0f - angle_2 * t31;
    const float t33 = cos_half * sinc_half;
    const float t34 = t33 * t19;
    const float t35 = t33 * t20;
    const float t36 = t33 * t21;
    const float t37 = t31 * t19;
    const float t38 = t31 * t20;
    const float t39 = t31 * t21;
    const float t40 = t37 * t20;
    const float t41 = t37 * t21;
    const float t42 = t38 * t21;
    const float f_q_rx_q_rx = t32 + t37 * t19;
    const float f_q_rx_q_ry = t40 + t36;
    const float f_q_rx_q_rz = t41 - t35;
    const float f_q_ry_q_rx = t40 - t36;
    const float f_q_ry_q_ry = t32 + t38 * t20;
    const float f_q_ry_q_rz = t42 + t34;
    const float f_q_rz_q_rx = t41 + t35;
    const float f_q_rz_q_ry = t42 - t34;
    const float f_q_rz_q_rz = t32 + t39 * t21;
    const float t43 = 0.16666667f - angle_2 * (0.008333334f - 0.0001984127f * angle_2);
    const float t44 = t43 * t19;
    const float t45 = t43 * t20;
    const float t46 = t44 * t20;
    const float t47 = t44 * t21;
    const float t48 = t45 * t21;
    float x_next[24];
    x_next[8] = p_n_next;
    x_next[9] = p_e_next;
    x_next[10] = p_d_next;
    x_next[11] = v_n_next;
    x_next[12] = v_e_next;
    x_next[13] = v_d_next;
    x_next[14] = q_w_next;
    x_next[15] = q_x_next;
    x_next[16] = q_y_next;
    x_next[17] = q_z_next;
    float product[529];
    for (int j = 0; j < 23; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = kf->P[j * (j + 1) / 2 + i];
            product[23 * j + i] = value;
            product[23 * i + j] = value;
        }
    }

    /* F P F^T: F times every column of P, and again of the transpose */
    for (int side = 0; side < 2; side++) {
        for (int k = 0; k < 23; k++) {
            const float p_p_n = product[23 * k + 8];
            const float p_p_e = product[23 * k + 9];
            const float p_p_d = product[23 * k + 10];
            const float p_v_n = product[23 * k + 11];
            const float p_v_e = product[23 * k + 12];
            const float p_v_d = product[23 * k + 13];
            const float p_q_rx = product[23 * k + 14];
            const float p_q_ry = product[23 * k + 15];
            const float p_q_rz = product[23 * k + 16];
            const float p_bg_x = product[23 * k + 17];
            const float p_bg_y = product[23 * k + 18];
            const float p_bg_z = product[23 * k + 19];
            const float p_ba_x = product[23 * k + 20];
            const float p_ba_y = product[23 * k + 21];
            const float p_ba_z = product[23 * k + 22];
            product[23 * k + 8] = p_p_n + 0.01f * p_v_n;
            product[23 * k + 9] = p_p_e + 0.01f * p_v_e;
            product[23 * k + 10] = p_p_d + 0.01f * p_v_d;
            product[23 * k + 11] = p_v_n + f_v_n_q_rx * p_q_rx + f_v_n_q_ry * p_q_ry
                + f_v_n_q_rz * p_q_rz - 0.01f * q_r00 * p_ba_x - 0.02f * t8 * p_ba_y
                - 0.02f * t11 * p_ba_z;
            product[23 * k + 12] = p_v_e + f_v_e_q_rx * p_q_rx + f_v_e_q_ry * p_q_ry
                + f_v_e_q_rz * p_q_rz - 0.02f * t12 * p_ba_x - 0.01f * q_r11 * p_ba_y
                - 0.02f * t16 * p_ba_z;
            product[23 * k + 13] = p_v_d + f_v_d_q_rx * p_q_rx + f_v_d_q_ry * p_q_ry
                + f_v_d_q_rz * p_q_rz - 0.02f * t17 * p_ba_x - 0.02f * t18 * p_ba_y
                - 0.01f * q_r22 * p_ba_z;
            product[23 * k + 14] = f_q_rx_q_rx * p_q_rx + f_q_rx_q_ry * p_q_ry
                + f_q_rx_q_rz * p_q_rz - 0.01f * (t33 + t44 * t19) * p_bg_x
                - 0.01f * (t46 + t39) * p_bg_y - 0.01f * (t47 - t38) * p_bg_z;
            product[23 * k + 15] = f_q_ry_q_rx * p_q_rx + f_q_ry_q_ry * p_q_ry
                + f_q_ry_q_rz * p_q_rz - 0.01f * (t46 - t39) * p_bg_x
                - 0.01f * (t33 + t45 * t20) * p_bg_y - 0.01f * (t48 + t37) * p_bg_z;
            product[23 * k + 16] = f_q_rz_q_rx * p_q_rx + f_q_rz_q_ry * p_q_ry
                + f_q_rz_q_rz * p_q_rz - 0.01f * (t47 + t38) * p_bg_x - 0.01f * (t48 - t37) * p_bg_y
                - 0.01f * (t33 + t43 * t21 * t21) * p_bg_z;
        }
        if (side < 1) {
            for (int j = 1; j < 23; j++) {
                for (int i = 0; i < j; i++) {
                    const float value_1 = product[23 * j + i];
                    product[23 * j + i] = product[23 * i + j];
                    product[23 * i + j] = value_1;
                }
            }
        }
    }

    /* + Q */
    product[0] = product[0] + 0.0001f;
    product[24] = product[24] + 0.0001f;
    for (int i = 2; i < 8; i++) {
        product[24 * i] = product[24 * i] + 1.0e-10f;
    }
    product[264] = product[264] + 0.00001225f;
    product[288] = product[288] + 0.00001225f;
    product[312] = product[312] + 0.00001225f;
    product[336] = product[336] + 2.25e-8f;
    product[360] = product[360] + 2.25e-8f;
    product[384] = product[384] + 2.25e-8f;
    product[408] = product[408] + 1.0e-10f;
    product[432] = product[432] + 1.0e-10f;
    product[456] = product[456] + 1.0e-10f;
    product[480] = product[480] + 1.0e-7f;
    product[504] = product[504] + 1.0e-7f;
    product[528] = product[528] + 1.0e-7f;
    float trace = 0.0f;
    for (int i = 0; i < 23; i++) {
        trace = trace + product[23 * i + i];
    }
    const float t0 = trace;

    /* guards */
    float check = 0.0f;
    for (int i = 8; i < 18; i++) {
        check = check + x_next[i];
    }
    if (!px4_finite(t0 + check)) { return PX4_NOT_FINITE; }

    /* store */
    for (int i = 8; i < 18; i++) {
        kf->x[i] = x_next[i];
    }
    for (int j = 0; j < 23; j++) {
        for (int i = 0; i < j + 1; i++) {
            kf->P[j * (j + 1) / 2 + i] = product[23 * j + i];
        }
    }
    flags |= px4_settle(kf->P, 0);
    return flags;
}

/* Row i of a symmetric matrix */
static void px4_take_row(const px4_real_t P[276], int i, px4_real_t row[23])
{
    for (int j = 0; j < i + 1; j++) {
        row[j] = P[i * (i + 1) / 2 + j];
    }
    for (int j = i + 1; j < 23; j++) {
        row[j] = P[j * (j + 1) / 2 + i];
    }
}

/* Replace row and column i of a symmetric matrix by factor row */
static void px4_put_row(px4_real_t P[276], int i, const px4_real_t row[23], px4_real_t factor)
{
    for (int j = 0; j < i + 1; j++) {
        P[i * (i + 1) / 2 + j] = row[j] * factor;
    }
    for (int j = i + 1; j < 23; j++) {
        P[j * (j + 1) / 2 + i] = row[j] * factor;
    }
}

px4_status_t px4_update_gnss(px4_t *kf, const px4_gnss_t *z)
{
    if (kf == NULL || z == NULL) { return PX4_NULL_ARGUMENT; }
    px4_status_t flags = PX4_OK;

    /* innovation */
    const float p_n = kf->x[PX4_P_N];
    const float p_e = kf->x[PX4_P_E];
    const float p_d = kf->x[PX4_P_D];
    const float v_n = kf->x[PX4_V_N];
    const float v_e = kf->x[PX4_V_E];
    const float v_d = kf->x[PX4_V_D];
    const float y_p_n = z->p_n - p_n;
    const float y_p_e = z->p_e - p_e;
    const float y_p_d = z->p_d - p_d;
    const float y_v_n = z->v_n - v_n;
    const float y_v_e = z->v_e - v_e;
    const float y_v_d = z->v_d - v_d;

    /* gain and covariance: p_n */
    float c0[23];
    px4_take_row(kf->P, 8, c0);
    const float s_p_n = c0[8] + 0.25f;
    const float inverse_s = 0.9999995f / s_p_n;
    const float share = 0.25f * inverse_s;
    const float step = inverse_s * y_p_n;
    const float t4 = y_p_n * step;
    const bool t5 = !(s_p_n > 0.0f);

    /* gain and covariance: p_e */
    const float nu_p_e = y_p_e - c0[9] * step;
    float c1[23];
    const float factor = inverse_s * c0[9];
    px4_take_row(kf->P, 9, c1);
    for (int i = 0; i < 23; i++) {
        c1[i] = c1[i] - factor * c0[i];
    }
    c1[8] = share * c0[9];
    const float s_p_e = c1[9] + 0.25f;
    const bool t10 = c1[9] < 0.0f;
    const float inverse_s_1 = 0.9999995f / s_p_e;
    const float share_1 = 0.25f * inverse_s_1;
    const float step_1 = inverse_s_1 * nu_p_e;
    const float t3 = t4 + nu_p_e * step_1;

    /* gain and covariance: p_d */
    const float nu_p_d = y_p_d - c0[10] * step - c1[10] * step_1;
    float c2[23];
    const float factor_1 = inverse_s * c0[10];
    const float factor_2 = inverse_s_1 * c1[10];
    px4_take_row(kf->P, 10, c2);
    for (int i = 0; i < 23; i++) {
        c2[i] = c2[i] - factor_1 * c0[i] - factor_2 * c1[i];
    }
    c2[8] = share * c0[10] - inverse_s_1 * c1[8] * c1[10];
    c2[9] = share_1 * c1[10];
    const float s_p_d = c2[10] + 0.64f;
    const bool t9 = c2[10] < 0.0f;
    const float inverse_s_2 = 0.9999995f / s_p_d;
    const float share_2 = 0.64f * inverse_s_2;
    const float step_2 = inverse_s_2 * nu_p_d;
    const float t2 = t3 + nu_p_d * step_2;

    /* gain and covariance: v_n */
    const float nu_v_n = y_v_n - c0[11] * step - c1[11] * step_1 - c2[11] * step_2;
    float c3[23];
    const float factor_3 = inverse_s * c0[11];
    const float factor_4 = inverse_s_1 * c1[11];
    const float factor_5 = inverse_s_2 * c2[11];
    px4_take_row(kf->P, 11, c3);
    for (int i = 0; i < 23; i++) {
        c3[i] = c3[i] - factor_3 * c0[i] - factor_4 * c1[i] - factor_5 * c2[i];
    }
    c3[8] = share * c0[11] - inverse_s_1 * c1[8] * c1[11] - inverse_s_2 * c2[8] * c2[11];
    c3[9] = share_1 * c1[11] - inverse_s_2 * c2[9] * c2[11];
    c3[10] = share_2 * c2[11];
    const float s_v_n = c3[11] + 0.09f;
    const bool t8 = c3[11] < 0.0f;
    const float inverse_s_3 = 0.9999995f / s_v_n;
    const float share_3 = 0.09f * inverse_s_3;
    const float step_3 = inverse_s_3 * nu_v_n;
    const float t1 = t2 + nu_v_n * step_3;

    /* gain and covariance: v_e */
    const float nu_v_e = y_v_e - c0[12] * step - c1[12] * step_1 - c2[12] * step_2
        - c3[12] * step_3;
    float covariance[276];
    for (int k = 0; k < 276; k++) {
        covariance[k] = kf->P[k];
    }
    px4_put_row(covariance, 8, c0, share);
    const float hidden = c0[8];
    c0[8] = 0.0f;
    px4_put_row(covariance, 9, c1, share_1);
    const float hidden_1 = c0[9];
    c0[9] = 0.0f;
    const float hidden_2 = c1[9];
    c1[9] = 0.0f;
    px4_put_row(covariance, 10, c2, share_2);
    const float hidden_3 = c0[10];
    c0[10] = 0.0f;
    const float hidden_4 = c1[10];
    c1[10] = 0.0f;
    const float hidden_5 = c2[10];
    c2[10] = 0.0f;
    px4_put_row(covariance, 11, c3, share_3);
    const float hidden_6 = c0[11];
    c0[11] = 0.0f;
    const float hidden_7 = c1[11];
    c1[11] = 0.0f;
    const float hidden_8 = c2[11];
    c2[11] = 0.0f;
    const float hidden_9 = c3[11];
    c3[11] = 0.0f;
    for (int j = 0; j < 23; j++) {
        const float part = c0[j] * inverse_s;
        const float part_1 = c1[j] * inverse_s_1;
        const float part_2 = c2[j] * inverse_s_2;
        const float part_3 = c3[j] * inverse_s_3;
        for (int i = 0; i < j + 1; i++) {
            covariance[j * (j + 1) / 2 + i] = covariance[j * (j + 1) / 2 + i] - c0[i] * part
                - c1[i] * part_1 - c2[i] * part_2 - c3[i] * part_3;
        }
    }
    c3[11] = hidden_9;
    c2[11] = hidden_8;
    c1[11] = hidden_7;
    c0[11] = hidden_6;
    c2[10] = hidden_5;
    c1[10] = hidden_4;
    c0[10] = hidden_3;
    c1[9] = hidden_2;
    c0[9] = hidden_1;
    c0[8] = hidden;
    float moved[23];
    for (int i = 0; i < 23; i++) {
        moved[i] = c0[i] * step + c1[i] * step_1 + c2[i] * step_2 + c3[i] * step_3;
    }
    px4_take_row(covariance, 12, c0);
    const float s_v_e = c0[12] + 0.09f;
    const bool t7 = c0[12] < 0.0f;
    const float inverse_s_4 = 0.9999995f / s_v_e;
    const float share_4 = 0.09f * inverse_s_4;
    const float step_4 = inverse_s_4 * nu_v_e;
    const float t0 = t1 + nu_v_e * step_4;

    /* gain and covariance: v_d */
    const float nu_v_d = y_v_d - moved[13] - c0[13] * step_4;
    const float factor_6 = inverse_s_4 * c0[13];
    px4_take_row(covariance, 13, c1);
    for (int i = 0; i < 23; i++) {
        c1[i] = c1[i] - factor_6 * c0[i];
    }
    c1[12] = share_4 * c0[13];
    const float s_v_d = c1[13] + 0.25f;
    const bool t6 = c1[13] < 0.0f;
    const float inverse_s_5 = 0.9999995f / s_v_d;
    const float share_5 = 0.25f * inverse_s_5;
    const float step_5 = inverse_s_5 * nu_v_d;
    const float nis = t0 + nu_v_d * step_5;

    /* state and innovation squared */
    const float d_q_rx = moved[14] + c0[14] * step_4 + c1[14] * step_5;
    const float d_q_ry = moved[15] + c0[15] * step_4 + c1[15] * step_5;
    const float d_q_rz = moved[16] + c0[16] * step_4 + c1[16] * step_5;
    const float angle_2 = d_q_rx * d_q_rx + d_q_ry * d_q_ry + d_q_rz * d_q_rz;
    const float wind_n_next = kf->x[PX4_WIND_N] + moved[0] + c0[0] * step_4 + c1[0] * step_5;
    const float wind_e_next = kf->x[PX4_WIND_E] + moved[1] + c0[1] * step_4 + c1[1] * step_5;
    const float earth_x_next = kf->x[PX4_EARTH_X] + moved[2] + c0[2] * step_4 + c1[2] * step_5;
    const float earth_y_next = kf->x[PX4_EARTH_Y] + moved[3] + c0[3] * step_4 + c1[3] * step_5;
    const float earth_z_next = kf->x[PX4_EARTH_Z] + moved[4] + c0[4] * step_4 + c1[4] * step_5;
    const float body_x_next = kf->x[PX4_BODY_X] + moved[5] + c0[5] * step_4 + c1[5] * step_5;
    const float body_y_next = kf->x[PX4_BODY_Y] + moved[6] + c0[6] * step_4 + c1[6] * step_5;
    const float body_z_next = kf->x[PX4_BODY_Z] + moved[7] + c0[7] * step_4 + c1[7] * step_5;
    const float p_n_next = p_n + moved[8] + c0[8] * step_4 + c1[8] * step_5;
    const float p_e_next = p_e + moved[9] + c0[9] * step_4 + c1[9] * step_5;
    const float p_d_next = p_d + moved[10] + c0[10] * step_4 + c1[10] * step_5;
    const float v_n_next = v_n + moved[11] + c0[11] * step_4 + c1[11] * step_5;
    const float v_e_next = v_e + moved[12] + c0[12] * step_4 + c1[12] * step_5;
    const float v_d_next = v_d + moved[13] + c0[13] * step_4 + c1[13] * step_5;
    const float bg_x_next = kf->x[PX4_BG_X] + moved[17] + c0[17] * step_4 + c1[17] * step_5;
    const float bg_y_next = kf->x[PX4_BG_Y] + moved[18] + c0[18] * step_4 + c1[18] * step_5;
    const float bg_z_next = kf->x[PX4_BG_Z] + moved[19] + c0[19] * step_4 + c1[19] * step_5;
    const float ba_x_next = kf->x[PX4_BA_X] + moved[20] + c0[20] * step_4 + c1[20] * step_5;
    const float ba_y_next = kf->x[PX4_BA_Y] + moved[21] + c0[21] * step_4 + c1[21] * step_5;
    const float ba_z_next = kf->x[PX4_BA_Z] + moved[22] + c0[22] * step_4 + c1[22] * step_5;
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
    const float t11 = 0.5f * sinc_half;
    const float t12 = t11 * d_q_rx;
    const float t13 = t11 * d_q_ry;
    const float t14 = t11 * d_q_rz;
    const float t15 = kf->x[PX4_Q_W] * cos_half - kf->x[PX4_Q_X] * t12 - kf->x[PX4_Q_Y] * t13
        - kf->x[PX4_Q_Z] * t14;
    const float t16 = kf->x[PX4_Q_W] * t12 + kf->x[PX4_Q_X] * cos_half + kf->x[PX4_Q_Y] * t14
        - kf->x[PX4_Q_Z] * t13;
    const float t17 = kf->x[PX4_Q_W] * t13 - kf->x[PX4_Q_X] * t14 + kf->x[PX4_Q_Y] * cos_half
        + kf->x[PX4_Q_Z] * t12;
    const float t18 = kf->x[PX4_Q_W] * t14 + kf->x[PX4_Q_X] * t13 - kf->x[PX4_Q_Y] * t12
        + kf->x[PX4_Q_Z] * cos_half;
    const float t19 = 0.5f * (3.0f - t15 * t15 - t16 * t16 - t17 * t17 - t18 * t18);
    const float q_w_next = t15 * t19;
    const float q_x_next = t16 * t19;
    const float q_y_next = t17 * t19;
    const float q_z_next = t18 * t19;

    /* reset: the errors as seen from the new attitude */
    const float t20 = cos_half * sinc_half;
    const float t21 = sinc_half * sinc_half * 0.5f;
    float cubic = 0.16666667f - angle_2
        * (0.008333334f - angle_2 * (0.0001984127f
        - angle_2 * (2.7557319e-6f - 2.5052108e-8f * angle_2)));
    if (angle_2 > 1.0f) {
        cubic = (1.0f - t20) / angle_2;
    }
    const float t22 = t21 * d_q_rx;
    const float t23 = t21 * d_q_ry;
    const float t24 = t21 * d_q_rz;
    const float t25 = cubic * d_q_rx;
    const float t26 = cubic * d_q_ry;
    const float t27 = t25 * d_q_ry;
    const float t28 = t25 * d_q_rz;
    const float t29 = t26 * d_q_rz;
    px4_put_row(covariance, 12, c0, share_4);
    const float hidden_10 = c0[12];
    c0[12] = 0.0f;
    px4_put_row(covariance, 13, c1, share_5);
    const float hidden_11 = c0[13];
    c0[13] = 0.0f;
    const float hidden_12 = c1[13];
    c1[13] = 0.0f;
    for (int j = 0; j < 23; j++) {
        const float part_4 = c0[j] * inverse_s_4;
        const float part_5 = c1[j] * inverse_s_5;
        for (int i = 0; i < j + 1; i++) {
            covariance[j * (j + 1) / 2 + i] = covariance[j * (j + 1) / 2 + i] - c0[i] * part_4
                - c1[i] * part_5;
        }
    }
    c1[13] = hidden_12;
    c0[13] = hidden_11;
    c0[12] = hidden_10;
    float product[529];
    for (int j = 0; j < 23; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = covariance[j * (j + 1) / 2 + i];
            product[23 * j + i] = value;
            product[23 * i + j] = value;
        }
    }

    /* F P F^T: F times every column of P, and again of the transpose */
    for (int side = 0; side < 2; side++) {
        for (int k = 0; k < 23; k++) {
            const float p_q_rx = product[23 * k + 14];
            const float p_q_ry = product[23 * k + 15];
            const float p_q_rz = product[23 * k + 16];
            product[23 * k + 14] = (t20 + t25 * d_q_rx) * p_q_rx + (t27 + t24) * p_q_ry
                + (t28 - t23) * p_q_rz;
            product[23 * k + 15] = (t27 - t24) * p_q_rx + (t20 + t26 * d_q_ry) * p_q_ry
                + (t29 + t22) * p_q_rz;
            product[23 * k + 16] = (t28 + t23) * p_q_rx + (t29 - t22) * p_q_ry
                + (t20 + cubic * d_q_rz * d_q_rz) * p_q_rz;
        }
        if (side < 1) {
            for (int j = 1; j < 23; j++) {
                for (int i = 0; i < j; i++) {
                    const float value_1 = product[23 * j + i];
                    product[23 * j + i] = product[23 * i + j];
                    product[23 * i + j] = value_1;
                }
            }
        }
    }

    /* + Q */
    for (int j = 0; j < 23; j++) {
        for (int i = 0; i < j + 1; i++) {
            covariance[j * (j + 1) / 2 + i] = product[23 * j + i];
        }
    }

    /* guards */
    if (!px4_finite(wind_n_next + wind_e_next + earth_x_next + earth_y_next + earth_z_next
        + body_x_next + body_y_next + body_z_next + p_n_next + p_e_next + p_d_next + v_n_next
        + v_e_next + v_d_next + q_w_next + q_x_next + q_y_next + q_z_next + bg_x_next + bg_y_next
        + bg_z_next + ba_x_next + ba_y_next + ba_z_next + nis + s_p_n + s_p_e + s_p_d + s_v_n
        + s_v_e + s_v_d)) {
        return PX4_NOT_FINITE;
    }
    if (t5) { return PX4_NOT_POSITIVE; }
    if (t10 || t9 || t8 || t7 || t6) {
        flags |= px4_settle(kf->P, 1);
        return flags;
    }

    /* store */
    kf->x[PX4_WIND_N] = wind_n_next;
    kf->x[PX4_WIND_E] = wind_e_next;
    kf->x[PX4_EARTH_X] = earth_x_next;
    kf->x[PX4_EARTH_Y] = earth_y_next;
    kf->x[PX4_EARTH_Z] = earth_z_next;
    kf->x[PX4_BODY_X] = body_x_next;
    kf->x[PX4_BODY_Y] = body_y_next;
    kf->x[PX4_BODY_Z] = body_z_next;
    kf->x[PX4_P_N] = p_n_next;
    kf->x[PX4_P_E] = p_e_next;
    kf->x[PX4_P_D] = p_d_next;
    kf->x[PX4_V_N] = v_n_next;
    kf->x[PX4_V_E] = v_e_next;
    kf->x[PX4_V_D] = v_d_next;
    kf->x[PX4_Q_W] = q_w_next;
    kf->x[PX4_Q_X] = q_x_next;
    kf->x[PX4_Q_Y] = q_y_next;
    kf->x[PX4_Q_Z] = q_z_next;
    kf->x[PX4_BG_X] = bg_x_next;
    kf->x[PX4_BG_Y] = bg_y_next;
    kf->x[PX4_BG_Z] = bg_z_next;
    kf->x[PX4_BA_X] = ba_x_next;
    kf->x[PX4_BA_Y] = ba_y_next;
    kf->x[PX4_BA_Z] = ba_z_next;
    for (int k = 0; k < 276; k++) {
        kf->P[k] = covariance[k];
    }
    kf->nis = nis;
    flags |= px4_settle(kf->P, 0);
    return flags;
}

px4_status_t px4_update_baro(px4_t *kf, const px4_baro_t *z)
{
    if (kf == NULL || z == NULL) { return PX4_NULL_ARGUMENT; }
    px4_status_t flags = PX4_OK;

    /* innovation */
    const float p_d = kf->x[PX4_P_D];
    const float y_height = z->height + p_d;

    /* gain and covariance */
    float c0[23];
    px4_take_row(kf->P, 10, c0);
    for (int i = 0; i < 23; i++) {
        c0[i] = -c0[i];
    }
    const float s_height = 4.0f - c0[10];
    const float inverse_s = 0.9999995f / s_height;
    const float share = -(4.0f * inverse_s);
    const float step = inverse_s * y_height;
    const float nis = y_height * step;
    const bool t0 = !(s_height > 0.0f);

    /* state and innovation squared */
    const float d_q_rx = c0[14] * step;
    const float d_q_ry = c0[15] * step;
    const float d_q_rz = c0[16] * step;
    const float angle_2 = d_q_rx * d_q_rx + d_q_ry * d_q_ry + d_q_rz * d_q_rz;
    const float wind_n_next = kf->x[PX4_WIND_N] + c0[0] * step;
    const float wind_e_next = kf->x[PX4_WIND_E] + c0[1] * step;
    const float earth_x_next = kf->x[PX4_EARTH_X] + c0[2] * step;
    const float earth_y_next = kf->x[PX4_EARTH_Y] + c0[3] * step;
    const float earth_z_next = kf->x[PX4_EARTH_Z] + c0[4] * step;
    const float body_x_next = kf->x[PX4_BODY_X] + c0[5] * step;
    const float body_y_next = kf->x[PX4_BODY_Y] + c0[6] * step;
    const float body_z_next = kf->x[PX4_BODY_Z] + c0[7] * step;
    const float p_n_next = kf->x[PX4_P_N] + c0[8] * step;
    const float p_e_next = kf->x[PX4_P_E] + c0[9] * step;
    const float p_d_next = p_d + c0[10] * step;
    const float v_n_next = kf->x[PX4_V_N] + c0[11] * step;
    const float v_e_next = kf->x[PX4_V_E] + c0[12] * step;
    const float v_d_next = kf->x[PX4_V_D] + c0[13] * step;
    const float bg_x_next = kf->x[PX4_BG_X] + c0[17] * step;
    const float bg_y_next = kf->x[PX4_BG_Y] + c0[18] * step;
    const float bg_z_next = kf->x[PX4_BG_Z] + c0[19] * step;
    const float ba_x_next = kf->x[PX4_BA_X] + c0[20] * step;
    const float ba_y_next = kf->x[PX4_BA_Y] + c0[21] * step;
    const float ba_z_next = kf->x[PX4_BA_Z] + c0[22] * step;
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
    const float t1 = 0.5f * sinc_half;
    const float t2 = t1 * d_q_rx;
    const float t3 = t1 * d_q_ry;
    const float t4 = t1 * d_q_rz;
    const float t5 = kf->x[PX4_Q_W] * cos_half - kf->x[PX4_Q_X] * t2 - kf->x[PX4_Q_Y] * t3
        - kf->x[PX4_Q_Z] * t4;
    const float t6 = kf->x[PX4_Q_W] * t2 + kf->x[PX4_Q_X] * cos_half + kf->x[PX4_Q_Y] * t4
        - kf->x[PX4_Q_Z] * t3;
    const float t7 = kf->x[PX4_Q_W] * t3 - kf->x[PX4_Q_X] * t4 + kf->x[PX4_Q_Y] * cos_half
        + kf->x[PX4_Q_Z] * t2;
    const float t8 = kf->x[PX4_Q_W] * t4 + kf->x[PX4_Q_X] * t3 - kf->x[PX4_Q_Y] * t2
        + kf->x[PX4_Q_Z] * cos_half;
    const float t9 = 0.5f * (3.0f - t5 * t5 - t6 * t6 - t7 * t7 - t8 * t8);
    const float q_w_next = t5 * t9;
    const float q_x_next = t6 * t9;
    const float q_y_next = t7 * t9;
    const float q_z_next = t8 * t9;

    /* reset: the errors as seen from the new attitude */
    const float t10 = cos_half * sinc_half;
    const float t11 = sinc_half * sinc_half * 0.5f;
    float cubic = 0.16666667f - angle_2
        * (0.008333334f - angle_2 * (0.0001984127f
        - angle_2 * (2.7557319e-6f - 2.5052108e-8f * angle_2)));
    if (angle_2 > 1.0f) {
        cubic = (1.0f - t10) / angle_2;
    }
    const float t12 = t11 * d_q_rx;
    const float t13 = t11 * d_q_ry;
    const float t14 = t11 * d_q_rz;
    const float t15 = cubic * d_q_rx;
    const float t16 = cubic * d_q_ry;
    const float t17 = t15 * d_q_ry;
    const float t18 = t15 * d_q_rz;
    const float t19 = t16 * d_q_rz;
    float covariance[276];
    for (int k = 0; k < 276; k++) {
        covariance[k] = kf->P[k];
    }
    px4_put_row(covariance, 10, c0, share);
    const float hidden = c0[10];
    c0[10] = 0.0f;
    for (int j = 0; j < 23; j++) {
        const float part = c0[j] * inverse_s;
        for (int i = 0; i < j + 1; i++) {
            covariance[j * (j + 1) / 2 + i] = covariance[j * (j + 1) / 2 + i] - c0[i] * part;
        }
    }
    c0[10] = hidden;
    float product[529];
    for (int j = 0; j < 23; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = covariance[j * (j + 1) / 2 + i];
            product[23 * j + i] = value;
            product[23 * i + j] = value;
        }
    }

    /* F P F^T: F times every column of P, and again of the transpose */
    for (int side = 0; side < 2; side++) {
        for (int k = 0; k < 23; k++) {
            const float p_q_rx = product[23 * k + 14];
            const float p_q_ry = product[23 * k + 15];
            const float p_q_rz = product[23 * k + 16];
            product[23 * k + 14] = (t10 + t15 * d_q_rx) * p_q_rx + (t17 + t14) * p_q_ry
                + (t18 - t13) * p_q_rz;
            product[23 * k + 15] = (t17 - t14) * p_q_rx + (t10 + t16 * d_q_ry) * p_q_ry
                + (t19 + t12) * p_q_rz;
            product[23 * k + 16] = (t18 + t13) * p_q_rx + (t19 - t12) * p_q_ry
                + (t10 + cubic * d_q_rz * d_q_rz) * p_q_rz;
        }
        if (side < 1) {
            for (int j = 1; j < 23; j++) {
                for (int i = 0; i < j; i++) {
                    const float value_1 = product[23 * j + i];
                    product[23 * j + i] = product[23 * i + j];
                    product[23 * i + j] = value_1;
                }
            }
        }
    }

    /* + Q */
    for (int j = 0; j < 23; j++) {
        for (int i = 0; i < j + 1; i++) {
            covariance[j * (j + 1) / 2 + i] = product[23 * j + i];
        }
    }

    /* guards */
    if (!px4_finite(wind_n_next + wind_e_next + earth_x_next + earth_y_next + earth_z_next
        + body_x_next + body_y_next + body_z_next + p_n_next + p_e_next + p_d_next + v_n_next
        + v_e_next + v_d_next + q_w_next + q_x_next + q_y_next + q_z_next + bg_x_next + bg_y_next
        + bg_z_next + ba_x_next + ba_y_next + ba_z_next + nis + s_height)) {
        return PX4_NOT_FINITE;
    }
    if (t0) { return PX4_NOT_POSITIVE; }

    /* store */
    kf->x[PX4_WIND_N] = wind_n_next;
    kf->x[PX4_WIND_E] = wind_e_next;
    kf->x[PX4_EARTH_X] = earth_x_next;
    kf->x[PX4_EARTH_Y] = earth_y_next;
    kf->x[PX4_EARTH_Z] = earth_z_next;
    kf->x[PX4_BODY_X] = body_x_next;
    kf->x[PX4_BODY_Y] = body_y_next;
    kf->x[PX4_BODY_Z] = body_z_next;
    kf->x[PX4_P_N] = p_n_next;
    kf->x[PX4_P_E] = p_e_next;
    kf->x[PX4_P_D] = p_d_next;
    kf->x[PX4_V_N] = v_n_next;
    kf->x[PX4_V_E] = v_e_next;
    kf->x[PX4_V_D] = v_d_next;
    kf->x[PX4_Q_W] = q_w_next;
    kf->x[PX4_Q_X] = q_x_next;
    kf->x[PX4_Q_Y] = q_y_next;
    kf->x[PX4_Q_Z] = q_z_next;
    kf->x[PX4_BG_X] = bg_x_next;
    kf->x[PX4_BG_Y] = bg_y_next;
    kf->x[PX4_BG_Z] = bg_z_next;
    kf->x[PX4_BA_X] = ba_x_next;
    kf->x[PX4_BA_Y] = ba_y_next;
    kf->x[PX4_BA_Z] = ba_z_next;
    for (int k = 0; k < 276; k++) {
        kf->P[k] = covariance[k];
    }
    kf->nis = nis;
    flags |= px4_settle(kf->P, 0);
    return flags;
}

px4_status_t px4_update_mag(px4_t *kf, const px4_mag_t *z)
{
    if (kf == NULL || z == NULL) { return PX4_NULL_ARGUMENT; }
    px4_status_t flags = PX4_OK;

    /* innovation */
    const float earth_x = kf->x[PX4_EARTH_X];
    const float earth_y = kf->x[PX4_EARTH_Y];
    const float earth_z = kf->x[PX4_EARTH_Z];
    const float body_x = kf->x[PX4_BODY_X];
    const float body_y = kf->x[PX4_BODY_Y];
    const float body_z = kf->x[PX4_BODY_Z];
    const float q_w = kf->x[PX4_Q_W];
    const float q_x = kf->x[PX4_Q_X];
    const float q_y = kf->x[PX4_Q_Y];
    const float q_z = kf->x[PX4_Q_Z];
    const float t5 = q_y * q_y;
    const float t6 = q_z * q_z;
    const float q_r00 = 1.0f - 2.0f * (t5 + t6);
    const float t7 = q_x * q_y;
    const float t8 = q_w * q_z;
    const float q_r01 = 2.0f * (t7 - t8);
    const float t9 = q_x * q_z;
    const float t10 = q_w * q_y;
    const float q_r02 = 2.0f * (t9 + t10);
    const float q_r10 = 2.0f * (t7 + t8);
    const float t11 = q_x * q_x;
    const float q_r11 = 1.0f - 2.0f * (t11 + t6);
    const float t12 = q_y * q_z;
    const float t13 = q_w * q_x;
    const float q_r12 = 2.0f * (t12 - t13);
    const float q_r20 = 2.0f * (t9 - t10);
    const float q_r21 = 2.0f * (t12 + t13);
    const float q_r22 = 1.0f - 2.0f * (t11 + t5);
    const float h_b_z_q_ry = q_r00 * earth_x + q_r10 * earth_y + q_r20 * earth_z;
    const float h_b_x_q_rz = q_r01 * earth_x + q_r11 * earth_y + q_r21 * earth_z;
    const float h_b_y_q_rx = q_r02 * earth_x + q_r12 * earth_y + q_r22 * earth_z;
    const float h_b_x = body_x + h_b_z_q_ry;
    const float h_b_y = body_y + h_b_x_q_rz;
    const float h_b_z = body_z + h_b_y_q_rx;
    const float y_b_x = z->b_x - h_b_x;
    const float y_b_y = z->b_y - h_b_y;
    const float y_b_z = z->b_z - h_b_z;

    /* gain and covariance: b_x */
    float c0[23];
    px4_take_row(kf->P, 2, c0);
    for (int i = 0; i < 23; i++) {
        c0[i] = q_r00 * c0[i];
    }
    float row[23];
    px4_take_row(kf->P, 3, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + q_r10 * row[i];
    }
    px4_take_row(kf->P, 4, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + q_r20 * row[i];
    }
    px4_take_row(kf->P, 5, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + row[i];
    }
    px4_take_row(kf->P, 15, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] - h_b_y_q_rx * row[i];
    }
    px4_take_row(kf->P, 16, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + h_b_x_q_rz * row[i];
    }
    const float s_b_x = q_r00 * c0[2] + q_r10 * c0[3] + q_r20 * c0[4] + c0[5] - h_b_y_q_rx * c0[15]
        + h_b_x_q_rz * c0[16] + 0.0025f;
    const bool t4 = s_b_x < 0.00125f;
    const float inverse_s = 0.9999995f / s_b_x;
    const float step = inverse_s * y_b_x;
    const float t1 = y_b_x * step;

    /* gain and covariance: b_y */
    const float nu_b_y = y_b_y - q_r01 * (c0[2] * step) - q_r11 * (c0[3] * step)
        - q_r21 * (c0[4] * step) - c0[6] * step - h_b_y_q_rx * (c0[14] * step)
        + h_b_z_q_ry * (c0[16] * step);
    float c1[23];
    const float t14 = h_b_z_q_ry * inverse_s;
    const float factor = q_r01 * inverse_s * c0[2] + q_r11 * inverse_s * c0[3]
        + q_r21 * inverse_s * c0[4] + inverse_s * c0[6] + h_b_y_q_rx * inverse_s * c0[14]
        - t14 * c0[16];
    px4_take_row(kf->P, 2, c1);
    for (int i = 0; i < 23; i++) {
        c1[i] = q_r01 * c1[i];
    }
    px4_take_row(kf->P, 3, row);
    for (int i = 0; i < 23; i++) {
        c1[i] = c1[i] + q_r11 * row[i];
    }
    px4_take_row(kf->P, 4, row);
    for (int i = 0; i < 23; i++) {
        c1[i] = c1[i] + q_r21 * row[i];
    }
    px4_take_row(kf->P, 6, row);
    for (int i = 0; i < 23; i++) {
        c1[i] = c1[i] + row[i];
    }
    px4_take_row(kf->P, 14, row);
    for (int i = 0; i < 23; i++) {
        c1[i] = c1[i] + h_b_y_q_rx * row[i];
    }
    px4_take_row(kf->P, 16, row);
    for (int i = 0; i < 23; i++) {
        c1[i] = c1[i] - h_b_z_q_ry * row[i];
    }
    for (int i = 0; i < 23; i++) {
        c1[i] = c1[i] - factor * c0[i];
    }
    const float s_b_y = q_r01 * c1[2] + q_r11 * c1[3] + q_r21 * c1[4] + c1[6] + h_b_y_q_rx * c1[14]
        - h_b_z_q_ry * c1[16] + 0.0025f;
    const bool t3 = s_b_y < 0.00125f;
    const float inverse_s_1 = 0.9999995f / s_b_y;
    const float step_1 = inverse_s_1 * nu_b_y;
    const float t0 = t1 + nu_b_y * step_1;

    /* gain and covariance: b_z */
    const float nu_b_z = y_b_z - q_r02 * (c0[2] * step + c1[2] * step_1)
        - q_r12 * (c0[3] * step + c1[3] * step_1) - q_r22 * (c0[4] * step + c1[4] * step_1)
        - c0[7] * step - c1[7] * step_1 + h_b_x_q_rz * (c0[14] * step + c1[14] * step_1)
        - h_b_z_q_ry * (c0[15] * step + c1[15] * step_1);
    float c2[23];
    const float factor_1 = q_r02 * inverse_s * c0[2] + q_r12 * inverse_s * c0[3]
        + q_r22 * inverse_s * c0[4] + inverse_s * c0[7] - h_b_x_q_rz * inverse_s * c0[14]
        + t14 * c0[15];
    const float factor_2 = q_r02 * inverse_s_1 * c1[2] + q_r12 * inverse_s_1 * c1[3]
        + q_r22 * inverse_s_1 * c1[4] + inverse_s_1 * c1[7] - h_b_x_q_rz * inverse_s_1 * c1[14]
        + h_b_z_q_ry * inverse_s_1 * c1[15];
    px4_take_row(kf->P, 2, c2);
    for (int i = 0; i < 23; i++) {
        c2[i] = q_r02 * c2[i];
    }
    px4_take_row(kf->P, 3, row);
    for (int i = 0; i < 23; i++) {
        c2[i] = c2[i] + q_r12 * row[i];
    }
    px4_take_row(kf->P, 4, row);
    for (int i = 0; i < 23; i++) {
        c2[i] = c2[i] + q_r22 * row[i];
    }
    px4_take_row(kf->P, 7, row);
    for (int i = 0; i < 23; i++) {
        c2[i] = c2[i] + row[i];
    }
    px4_take_row(kf->P, 14, row);
    for (int i = 0; i < 23; i++) {
        c2[i] = c2[i] - h_b_x_q_rz * row[i];
    }
    px4_take_row(kf->P, 15, row);
    for (int i = 0; i < 23; i++) {
        c2[i] = c2[i] + h_b_z_q_ry * row[i];
    }
    for (int i = 0; i < 23; i++) {
        c2[i] = c2[i] - factor_1 * c0[i] - factor_2 * c1[i];
    }
    const float s_b_z = q_r02 * c2[2] + q_r12 * c2[3] + q_r22 * c2[4] + c2[7] - h_b_x_q_rz * c2[14]
        + h_b_z_q_ry * c2[15] + 0.0025f;
    const bool t2 = s_b_z < 0.00125f;
    const float inverse_s_2 = 0.9999995f / s_b_z;
    const float step_2 = inverse_s_2 * nu_b_z;
    const float nis = t0 + nu_b_z * step_2;

    /* state and innovation squared */
    const float d_q_rx = c0[14] * step + c1[14] * step_1 + c2[14] * step_2;
    const float d_q_ry = c0[15] * step + c1[15] * step_1 + c2[15] * step_2;
    const float d_q_rz = c0[16] * step + c1[16] * step_1 + c2[16] * step_2;
    const float angle_2 = d_q_rx * d_q_rx + d_q_ry * d_q_ry + d_q_rz * d_q_rz;
    const float wind_n_next = kf->x[PX4_WIND_N] + c0[0] * step + c1[0] * step_1 + c2[0] * step_2;
    const float wind_e_next = kf->x[PX4_WIND_E] + c0[1] * step + c1[1] * step_1 + c2[1] * step_2;
    const float earth_x_next = earth_x + c0[2] * step + c1[2] * step_1 + c2[2] * step_2;
    const float earth_y_next = earth_y + c0[3] * step + c1[3] * step_1 + c2[3] * step_2;
    const float earth_z_next = earth_z + c0[4] * step + c1[4] * step_1 + c2[4] * step_2;
    const float body_x_next = body_x + c0[5] * step + c1[5] * step_1 + c2[5] * step_2;
    const float body_y_next = body_y + c0[6] * step + c1[6] * step_1 + c2[6] * step_2;
    const float body_z_next = body_z + c0[7] * step + c1[7] * step_1 + c2[7] * step_2;
    const float p_n_next = kf->x[PX4_P_N] + c0[8] * step + c1[8] * step_1 + c2[8] * step_2;
    const float p_e_next = kf->x[PX4_P_E] + c0[9] * step + c1[9] * step_1 + c2[9] * step_2;
    const float p_d_next = kf->x[PX4_P_D] + c0[10] * step + c1[10] * step_1 + c2[10] * step_2;
    const float v_n_next = kf->x[PX4_V_N] + c0[11] * step + c1[11] * step_1 + c2[11] * step_2;
    const float v_e_next = kf->x[PX4_V_E] + c0[12] * step + c1[12] * step_1 + c2[12] * step_2;
    const float v_d_next = kf->x[PX4_V_D] + c0[13] * step + c1[13] * step_1 + c2[13] * step_2;
    const float bg_x_next = kf->x[PX4_BG_X] + c0[17] * step + c1[17] * step_1 + c2[17] * step_2;
    const float bg_y_next = kf->x[PX4_BG_Y] + c0[18] * step + c1[18] * step_1 + c2[18] * step_2;
    const float bg_z_next = kf->x[PX4_BG_Z] + c0[19] * step + c1[19] * step_1 + c2[19] * step_2;
    const float ba_x_next = kf->x[PX4_BA_X] + c0[20] * step + c1[20] * step_1 + c2[20] * step_2;
    const float ba_y_next = kf->x[PX4_BA_Y] + c0[21] * step + c1[21] * step_1 + c2[21] * step_2;
    const float ba_z_next = kf->x[PX4_BA_Z] + c0[22] * step + c1[22] * step_1 + c2[22] * step_2;
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
    const float t15 = 0.5f * sinc_half;
    const float t16 = t15 * d_q_rx;
    const float t17 = t15 * d_q_ry;
    const float t18 = t15 * d_q_rz;
    const float t19 = q_w * cos_half - q_x * t16 - q_y * t17 - q_z * t18;
    const float t20 = q_w * t16 + q_x * cos_half + q_y * t18 - q_z * t17;
    const float t21 = q_w * t17 - q_x * t18 + q_y * cos_half + q_z * t16;
    const float t22 = q_w * t18 + q_x * t17 - q_y * t16 + q_z * cos_half;
    const float t23 = 0.5f * (3.0f - t19 * t19 - t20 * t20 - t21 * t21 - t22 * t22);
    const float q_w_next = t19 * t23;
    const float q_x_next = t20 * t23;
    const float q_y_next = t21 * t23;
    const float q_z_next = t22 * t23;

    /* reset: the errors as seen from the new attitude */
    const float t24 = cos_half * sinc_half;
    const float t25 = sinc_half * sinc_half * 0.5f;
    float cubic = 0.16666667f - angle_2
        * (0.008333334f - angle_2 * (0.0001984127f
        - angle_2 * (2.7557319e-6f - 2.5052108e-8f * angle_2)));
    if (angle_2 > 1.0f) {
        cubic = (1.0f - t24) / angle_2;
    }
    const float t26 = t25 * d_q_rx;
    const float t27 = t25 * d_q_ry;
    const float t28 = t25 * d_q_rz;
    const float t29 = cubic * d_q_rx;
    const float t30 = cubic * d_q_ry;
    const float t31 = t29 * d_q_ry;
    const float t32 = t29 * d_q_rz;
    const float t33 = t30 * d_q_rz;
    float covariance[276];
    for (int j = 0; j < 23; j++) {
        const float part = c0[j] * inverse_s;
        const float part_1 = c1[j] * inverse_s_1;
        const float part_2 = c2[j] * inverse_s_2;
        for (int i = 0; i < j + 1; i++) {
            covariance[j * (j + 1) / 2 + i] = kf->P[j * (j + 1) / 2 + i] - c0[i] * part
                - c1[i] * part_1 - c2[i] * part_2;
        }
    }
    float product[529];
    for (int j = 0; j < 23; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = covariance[j * (j + 1) / 2 + i];
            product[23 * j + i] = value;
            product[23 * i + j] = value;
        }
    }

    /* F P F^T: F times every column of P, and again of the transpose */
    for (int side = 0; side < 2; side++) {
        for (int k = 0; k < 23; k++) {
            const float p_q_rx = product[23 * k + 14];
            const float p_q_ry = product[23 * k + 15];
            const float p_q_rz = product[23 * k + 16];
            product[23 * k + 14] = (t24 + t29 * d_q_rx) * p_q_rx + (t31 + t28) * p_q_ry
                + (t32 - t27) * p_q_rz;
            product[23 * k + 15] = (t31 - t28) * p_q_rx + (t24 + t30 * d_q_ry) * p_q_ry
                + (t33 + t26) * p_q_rz;
            product[23 * k + 16] = (t32 + t27) * p_q_rx + (t33 - t26) * p_q_ry
                + (t24 + cubic * d_q_rz * d_q_rz) * p_q_rz;
        }
        if (side < 1) {
            for (int j = 1; j < 23; j++) {
                for (int i = 0; i < j; i++) {
                    const float value_1 = product[23 * j + i];
                    product[23 * j + i] = product[23 * i + j];
                    product[23 * i + j] = value_1;
                }
            }
        }
    }

    /* + Q */
    for (int j = 0; j < 23; j++) {
        for (int i = 0; i < j + 1; i++) {
            covariance[j * (j + 1) / 2 + i] = product[23 * j + i];
        }
    }

    /* guards */
    if (!px4_finite(wind_n_next + wind_e_next + earth_x_next + earth_y_next + earth_z_next
        + body_x_next + body_y_next + body_z_next + p_n_next + p_e_next + p_d_next + v_n_next
        + v_e_next + v_d_next + q_w_next + q_x_next + q_y_next + q_z_next + bg_x_next + bg_y_next
        + bg_z_next + ba_x_next + ba_y_next + ba_z_next + nis + s_b_x + s_b_y + s_b_z)) {
        return PX4_NOT_FINITE;
    }
    if (t4 || t3 || t2) {
        flags |= px4_settle(kf->P, 1);
        return flags;
    }

    /* store */
    kf->x[PX4_WIND_N] = wind_n_next;
    kf->x[PX4_WIND_E] = wind_e_next;
    kf->x[PX4_EARTH_X] = earth_x_next;
    kf->x[PX4_EARTH_Y] = earth_y_next;
    kf->x[PX4_EARTH_Z] = earth_z_next;
    kf->x[PX4_BODY_X] = body_x_next;
    kf->x[PX4_BODY_Y] = body_y_next;
    kf->x[PX4_BODY_Z] = body_z_next;
    kf->x[PX4_P_N] = p_n_next;
    kf->x[PX4_P_E] = p_e_next;
    kf->x[PX4_P_D] = p_d_next;
    kf->x[PX4_V_N] = v_n_next;
    kf->x[PX4_V_E] = v_e_next;
    kf->x[PX4_V_D] = v_d_next;
    kf->x[PX4_Q_W] = q_w_next;
    kf->x[PX4_Q_X] = q_x_next;
    kf->x[PX4_Q_Y] = q_y_next;
    kf->x[PX4_Q_Z] = q_z_next;
    kf->x[PX4_BG_X] = bg_x_next;
    kf->x[PX4_BG_Y] = bg_y_next;
    kf->x[PX4_BG_Z] = bg_z_next;
    kf->x[PX4_BA_X] = ba_x_next;
    kf->x[PX4_BA_Y] = ba_y_next;
    kf->x[PX4_BA_Z] = ba_z_next;
    for (int k = 0; k < 276; k++) {
        kf->P[k] = covariance[k];
    }
    kf->nis = nis;
    flags |= px4_settle(kf->P, 0);
    return flags;
}

px4_status_t px4_update_airspeed(px4_t *kf, const px4_airspeed_t *z)
{
    if (kf == NULL || z == NULL) { return PX4_NULL_ARGUMENT; }
    px4_status_t flags = PX4_OK;

    /* innovation */
    const float wind_n = kf->x[PX4_WIND_N];
    const float wind_e = kf->x[PX4_WIND_E];
    const float v_n = kf->x[PX4_V_N];
    const float v_e = kf->x[PX4_V_E];
    const float v_d = kf->x[PX4_V_D];
    const float q_w = kf->x[PX4_Q_W];
    const float q_x = kf->x[PX4_Q_X];
    const float q_y = kf->x[PX4_Q_Y];
    const float q_z = kf->x[PX4_Q_Z];
    const float t1 = v_n - wind_n;
    const float t2 = v_e - wind_e;
    const float t3 = q_y * q_y;
    const float t4 = q_z * q_z;
    const float q_r00 = 1.0f - 2.0f * (t3 + t4);
    const float t5 = q_x * q_y;
    const float t6 = q_w * q_z;
    const float q_r01 = 2.0f * (t5 - t6);
    const float t7 = q_x * q_z;
    const float t8 = q_w * q_y;
    const float q_r02 = 2.0f * (t7 + t8);
    const float q_r10 = 2.0f * (t5 + t6);
    const float t9 = q_x * q_x;
    const float q_r11 = 1.0f - 2.0f * (t9 + t4);
    const float t10 = q_y * q_z;
    const float t11 = q_w * q_x;
    const float q_r12 = 2.0f * (t10 - t11);
    const float q_r20 = 2.0f * (t7 - t8);
    const float q_r21 = 2.0f * (t10 + t11);
    const float q_r22 = 1.0f - 2.0f * (t9 + t3);
    const float air_x = q_r00 * t1 + q_r10 * t2 + q_r20 * v_d;
    const float air_y = q_r01 * t1 + q_r11 * t2 + q_r21 * v_d;
    const float air_z = q_r02 * t1 + q_r12 * t2 + q_r22 * v_d;
    const float h_speed = sqrtf(air_x * air_x + air_y * air_y + air_z * air_z);
    const float t12 = h_speed > 0.0f ? 1.0f / h_speed : 0.0f;
    const float t13 = air_x * t12;
    const float t14 = air_y * t12;
    const float h_speed_q_rz = t13 * air_y - t14 * air_x;
    const float t15 = air_z * t12;
    const float h_speed_q_rx = t14 * air_z - t15 * air_y;
    const float h_speed_q_ry = t15 * air_x - t13 * air_z;
    const float h_speed_v_n = t13 * q_r00 + t14 * q_r01 + t15 * q_r02;
    const float h_speed_v_e = t13 * q_r10 + t14 * q_r11 + t15 * q_r12;
    const float h_speed_v_d = t13 * q_r20 + t14 * q_r21 + t15 * q_r22;
    const float y_speed = z->speed - h_speed;

    /* gain and covariance */
    float c0[23];
    px4_take_row(kf->P, 0, c0);
    for (int i = 0; i < 23; i++) {
        c0[i] = -(h_speed_v_n * c0[i]);
    }
    float row[23];
    px4_take_row(kf->P, 1, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] - h_speed_v_e * row[i];
    }
    px4_take_row(kf->P, 11, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + h_speed_v_n * row[i];
    }
    px4_take_row(kf->P, 12, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + h_speed_v_e * row[i];
    }
    px4_take_row(kf->P, 13, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + h_speed_v_d * row[i];
    }
    px4_take_row(kf->P, 14, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + h_speed_q_rx * row[i];
    }
    px4_take_row(kf->P, 15, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + h_speed_q_ry * row[i];
    }
    px4_take_row(kf->P, 16, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + h_speed_q_rz * row[i];
    }
    const float s_speed = h_speed_v_n * c0[11] - h_speed_v_n * c0[0] - h_speed_v_e * c0[1]
        + h_speed_v_e * c0[12] + h_speed_v_d * c0[13] + h_speed_q_rx * c0[14]
        + h_speed_q_ry * c0[15] + h_speed_q_rz * c0[16] + 1.96f;
    const bool t0 = s_speed < 0.98f;
    const float inverse_s = 0.9999995f / s_speed;
    const float step = inverse_s * y_speed;
    const float nis = y_speed * step;

    /* state and innovation squared */
    const float d_q_rx = c0[14] * step;
    const float d_q_ry = c0[15] * step;
    const float d_q_rz = c0[16] * step;
    const float angle_2 = d_q_rx * d_q_rx + d_q_ry * d_q_ry + d_q_rz * d_q_rz;
    const float wind_n_next = wind_n + c0[0] * step;
    const float wind_e_next = wind_e + c0[1] * step;
    const float earth_x_next = kf->x[PX4_EARTH_X] + c0[2] * step;
    const float earth_y_next = kf->x[PX4_EARTH_Y] + c0[3] * step;
    const float earth_z_next = kf->x[PX4_EARTH_Z] + c0[4] * step;
    const float body_x_next = kf->x[PX4_BODY_X] + c0[5] * step;
    const float body_y_next = kf->x[PX4_BODY_Y] + c0[6] * step;
    const float body_z_next = kf->x[PX4_BODY_Z] + c0[7] * step;
    const float p_n_next = kf->x[PX4_P_N] + c0[8] * step;
    const float p_e_next = kf->x[PX4_P_E] + c0[9] * step;
    const float p_d_next = kf->x[PX4_P_D] + c0[10] * step;
    const float v_n_next = v_n + c0[11] * step;
    const float v_e_next = v_e + c0[12] * step;
    const float v_d_next = v_d + c0[13] * step;
    const float bg_x_next = kf->x[PX4_BG_X] + c0[17] * step;
    const float bg_y_next = kf->x[PX4_BG_Y] + c0[18] * step;
    const float bg_z_next = kf->x[PX4_BG_Z] + c0[19] * step;
    const float ba_x_next = kf->x[PX4_BA_X] + c0[20] * step;
    const float ba_y_next = kf->x[PX4_BA_Y] + c0[21] * step;
    const float ba_z_next = kf->x[PX4_BA_Z] + c0[22] * step;
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
    const float t16 = 0.5f * sinc_half;
    const float t17 = t16 * d_q_rx;
    const float t18 = t16 * d_q_ry;
    const float t19 = t16 * d_q_rz;
    const float t20 = q_w * cos_half - q_x * t17 - q_y * t18 - q_z * t19;
    const float t21 = q_w * t17 + q_x * cos_half + q_y * t19 - q_z * t18;
    const float t22 = q_w * t18 - q_x * t19 + q_y * cos_half + q_z * t17;
    const float t23 = q_w * t19 + q_x * t18 - q_y * t17 + q_z * cos_half;
    const float t24 = 0.5f * (3.0f - t20 * t20 - t21 * t21 - t22 * t22 - t23 * t23);
    const float q_w_next = t20 * t24;
    const float q_x_next = t21 * t24;
    const float q_y_next = t22 * t24;
    const float q_z_next = t23 * t24;

    /* reset: the errors as seen from the new attitude */
    const float t25 = cos_half * sinc_half;
    const float t26 = sinc_half * sinc_half * 0.5f;
    float cubic = 0.16666667f - angle_2
        * (0.008333334f - angle_2 * (0.0001984127f
        - angle_2 * (2.7557319e-6f - 2.5052108e-8f * angle_2)));
    if (angle_2 > 1.0f) {
        cubic = (1.0f - t25) / angle_2;
    }
    const float t27 = t26 * d_q_rx;
    const float t28 = t26 * d_q_ry;
    const float t29 = t26 * d_q_rz;
    const float t30 = cubic * d_q_rx;
    const float t31 = cubic * d_q_ry;
    const float t32 = t30 * d_q_ry;
    const float t33 = t30 * d_q_rz;
    const float t34 = t31 * d_q_rz;
    float covariance[276];
    for (int j = 0; j < 23; j++) {
        const float part = c0[j] * inverse_s;
        for (int i = 0; i < j + 1; i++) {
            covariance[j * (j + 1) / 2 + i] = kf->P[j * (j + 1) / 2 + i] - c0[i] * part;
        }
    }
    float product[529];
    for (int j = 0; j < 23; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = covariance[j * (j + 1) / 2 + i];
            product[23 * j + i] = value;
            product[23 * i + j] = value;
        }
    }

    /* F P F^T: F times every column of P, and again of the transpose */
    for (int side = 0; side < 2; side++) {
        for (int k = 0; k < 23; k++) {
            const float p_q_rx = product[23 * k + 14];
            const float p_q_ry = product[23 * k + 15];
            const float p_q_rz = product[23 * k + 16];
            product[23 * k + 14] = (t25 + t30 * d_q_rx) * p_q_rx + (t32 + t29) * p_q_ry
                + (t33 - t28) * p_q_rz;
            product[23 * k + 15] = (t32 - t29) * p_q_rx + (t25 + t31 * d_q_ry) * p_q_ry
                + (t34 + t27) * p_q_rz;
            product[23 * k + 16] = (t33 + t28) * p_q_rx + (t34 - t27) * p_q_ry
                + (t25 + cubic * d_q_rz * d_q_rz) * p_q_rz;
        }
        if (side < 1) {
            for (int j = 1; j < 23; j++) {
                for (int i = 0; i < j; i++) {
                    const float value_1 = product[23 * j + i];
                    product[23 * j + i] = product[23 * i + j];
                    product[23 * i + j] = value_1;
                }
            }
        }
    }

    /* + Q */
    for (int j = 0; j < 23; j++) {
        for (int i = 0; i < j + 1; i++) {
            covariance[j * (j + 1) / 2 + i] = product[23 * j + i];
        }
    }

    /* guards */
    if (!px4_finite(wind_n_next + wind_e_next + earth_x_next + earth_y_next + earth_z_next
        + body_x_next + body_y_next + body_z_next + p_n_next + p_e_next + p_d_next + v_n_next
        + v_e_next + v_d_next + q_w_next + q_x_next + q_y_next + q_z_next + bg_x_next + bg_y_next
        + bg_z_next + ba_x_next + ba_y_next + ba_z_next + nis + s_speed)) {
        return PX4_NOT_FINITE;
    }
    if (t0) {
        flags |= px4_settle(kf->P, 1);
        return flags;
    }

    /* store */
    kf->x[PX4_WIND_N] = wind_n_next;
    kf->x[PX4_WIND_E] = wind_e_next;
    kf->x[PX4_EARTH_X] = earth_x_next;
    kf->x[PX4_EARTH_Y] = earth_y_next;
    kf->x[PX4_EARTH_Z] = earth_z_next;
    kf->x[PX4_BODY_X] = body_x_next;
    kf->x[PX4_BODY_Y] = body_y_next;
    kf->x[PX4_BODY_Z] = body_z_next;
    kf->x[PX4_P_N] = p_n_next;
    kf->x[PX4_P_E] = p_e_next;
    kf->x[PX4_P_D] = p_d_next;
    kf->x[PX4_V_N] = v_n_next;
    kf->x[PX4_V_E] = v_e_next;
    kf->x[PX4_V_D] = v_d_next;
    kf->x[PX4_Q_W] = q_w_next;
    kf->x[PX4_Q_X] = q_x_next;
    kf->x[PX4_Q_Y] = q_y_next;
    kf->x[PX4_Q_Z] = q_z_next;
    kf->x[PX4_BG_X] = bg_x_next;
    kf->x[PX4_BG_Y] = bg_y_next;
    kf->x[PX4_BG_Z] = bg_z_next;
    kf->x[PX4_BA_X] = ba_x_next;
    kf->x[PX4_BA_Y] = ba_y_next;
    kf->x[PX4_BA_Z] = ba_z_next;
    for (int k = 0; k < 276; k++) {
        kf->P[k] = covariance[k];
    }
    kf->nis = nis;
    flags |= px4_settle(kf->P, 0);
    return flags;
}

px4_status_t px4_update_sideslip(px4_t *kf, const px4_sideslip_t *z)
{
    if (kf == NULL || z == NULL) { return PX4_NULL_ARGUMENT; }
    px4_status_t flags = PX4_OK;

    /* innovation */
    const float wind_n = kf->x[PX4_WIND_N];
    const float wind_e = kf->x[PX4_WIND_E];
    const float v_n = kf->x[PX4_V_N];
    const float v_e = kf->x[PX4_V_E];
    const float v_d = kf->x[PX4_V_D];
    const float q_w = kf->x[PX4_Q_W];
    const float q_x = kf->x[PX4_Q_X];
    const float q_y = kf->x[PX4_Q_Y];
    const float q_z = kf->x[PX4_Q_Z];
    const float t1 = v_n - wind_n;
    const float t2 = v_e - wind_e;
    const float t3 = q_y * q_y;
    const float t4 = q_z * q_z;
    const float q_r00 = 1.0f - 2.0f * (t3 + t4);
    const float t5 = q_x * q_y;
    const float t6 = q_w * q_z;
    const float q_r01 = 2.0f * (t5 - t6);
    const float t7 = q_x * q_z;
    const float t8 = q_w * q_y;
    const float q_r02 = 2.0f * (t7 + t8);
    const float q_r10 = 2.0f * (t5 + t6);
    const float t9 = q_x * q_x;
    const float q_r11 = 1.0f - 2.0f * (t9 + t4);
    const float t10 = q_y * q_z;
    const float t11 = q_w * q_x;
    const float q_r12 = 2.0f * (t10 - t11);
    const float q_r20 = 2.0f * (t7 - t8);
    const float q_r21 = 2.0f * (t10 + t11);
    const float q_r22 = 1.0f - 2.0f * (t9 + t3);
    const float air_x = q_r00 * t1 + q_r10 * t2 + q_r20 * v_d;
    const float air_y = q_r01 * t1 + q_r11 * t2 + q_r21 * v_d;
    const float t12 = q_r02 * t1 + q_r12 * t2 + q_r22 * v_d;
    const float t13 = sqrtf(air_x * air_x + 1.0f);
    const float h_beta = air_y / t13;
    const float t14 = 1.0f / t13;
    const float t15 = air_x * air_y * (t13 > 0.0f ? t14 : 0.0f) / (t13 * t13);
    const float h_beta_q_ry = t15 * t12;
    const float h_beta_q_rx = t14 * t12;
    const float t16 = t15 * air_y + t14 * air_x;
    const float h_beta_v_n = t14 * q_r01 - t15 * q_r00;
    const float h_beta_v_e = t14 * q_r11 - t15 * q_r10;
    const float h_beta_v_d = t14 * q_r21 - t15 * q_r20;
    const float y_beta = z->beta - h_beta;

    /* gain and covariance */
    float c0[23];
    px4_take_row(kf->P, 0, c0);
    for (int i = 0; i < 23; i++) {
        c0[i] = -(h_beta_v_n * c0[i]);
    }
    float row[23];
    px4_take_row(kf->P, 1, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] - h_beta_v_e * row[i];
    }
    px4_take_row(kf->P, 11, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + h_beta_v_n * row[i];
    }
    px4_take_row(kf->P, 12, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + h_beta_v_e * row[i];
    }
    px4_take_row(kf->P, 13, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + h_beta_v_d * row[i];
    }
    px4_take_row(kf->P, 14, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + h_beta_q_rx * row[i];
    }
    px4_take_row(kf->P, 15, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + h_beta_q_ry * row[i];
    }
    px4_take_row(kf->P, 16, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] - t16 * row[i];
    }
    const float s_beta = h_beta_v_n * c0[11] - h_beta_v_n * c0[0] - h_beta_v_e * c0[1]
        + h_beta_v_e * c0[12] + h_beta_v_d * c0[13] + h_beta_q_rx * c0[14] + h_beta_q_ry * c0[15]
        - t16 * c0[16] + 0.09f;
    const bool t0 = s_beta < 0.045f;
    const float inverse_s = 0.9999995f / s_beta;
    const float step = inverse_s * y_beta;
    const float nis = y_beta * step;

    /* state and innovation squared */
    const float d_q_rx = c0[14] * step;
    const float d_q_ry = c0[15] * step;
    const float d_q_rz = c0[16] * step;
    const float angle_2 = d_q_rx * d_q_rx + d_q_ry * d_q_ry + d_q_rz * d_q_rz;
    const float wind_n_next = wind_n + c0[0] * step;
    const float wind_e_next = wind_e + c0[1] * step;
    const float earth_x_next = kf->x[PX4_EARTH_X] + c0[2] * step;
    const float earth_y_next = kf->x[PX4_EARTH_Y] + c0[3] * step;
    const float earth_z_next = kf->x[PX4_EARTH_Z] + c0[4] * step;
    const float body_x_next = kf->x[PX4_BODY_X] + c0[5] * step;
    const float body_y_next = kf->x[PX4_BODY_Y] + c0[6] * step;
    const float body_z_next = kf->x[PX4_BODY_Z] + c0[7] * step;
    const float p_n_next = kf->x[PX4_P_N] + c0[8] * step;
    const float p_e_next = kf->x[PX4_P_E] + c0[9] * step;
    const float p_d_next = kf->x[PX4_P_D] + c0[10] * step;
    const float v_n_next = v_n + c0[11] * step;
    const float v_e_next = v_e + c0[12] * step;
    const float v_d_next = v_d + c0[13] * step;
    const float bg_x_next = kf->x[PX4_BG_X] + c0[17] * step;
    const float bg_y_next = kf->x[PX4_BG_Y] + c0[18] * step;
    const float bg_z_next = kf->x[PX4_BG_Z] + c0[19] * step;
    const float ba_x_next = kf->x[PX4_BA_X] + c0[20] * step;
    const float ba_y_next = kf->x[PX4_BA_Y] + c0[21] * step;
    const float ba_z_next = kf->x[PX4_BA_Z] + c0[22] * step;
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
    const float t17 = 0.5f * sinc_half;
    const float t18 = t17 * d_q_rx;
    const float t19 = t17 * d_q_ry;
    const float t20 = t17 * d_q_rz;
    const float t21 = q_w * cos_half - q_x * t18 - q_y * t19 - q_z * t20;
    const float t22 = q_w * t18 + q_x * cos_half + q_y * t20 - q_z * t19;
    const float t23 = q_w * t19 - q_x * t20 + q_y * cos_half + q_z * t18;
    const float t24 = q_w * t20 + q_x * t19 - q_y * t18 + q_z * cos_half;
    const float t25 = 0.5f * (3.0f - t21 * t21 - t22 * t22 - t23 * t23 - t24 * t24);
    const float q_w_next = t21 * t25;
    const float q_x_next = t22 * t25;
    const float q_y_next = t23 * t25;
    const float q_z_next = t24 * t25;

    /* reset: the errors as seen from the new attitude */
    const float t26 = cos_half * sinc_half;
    const float t27 = sinc_half * sinc_half * 0.5f;
    float cubic = 0.16666667f - angle_2
        * (0.008333334f - angle_2 * (0.0001984127f
        - angle_2 * (2.7557319e-6f - 2.5052108e-8f * angle_2)));
    if (angle_2 > 1.0f) {
        cubic = (1.0f - t26) / angle_2;
    }
    const float t28 = t27 * d_q_rx;
    const float t29 = t27 * d_q_ry;
    const float t30 = t27 * d_q_rz;
    const float t31 = cubic * d_q_rx;
    const float t32 = cubic * d_q_ry;
    const float t33 = t31 * d_q_ry;
    const float t34 = t31 * d_q_rz;
    const float t35 = t32 * d_q_rz;
    float covariance[276];
    for (int j = 0; j < 23; j++) {
        const float part = c0[j] * inverse_s;
        for (int i = 0; i < j + 1; i++) {
            covariance[j * (j + 1) / 2 + i] = kf->P[j * (j + 1) / 2 + i] - c0[i] * part;
        }
    }
    float product[529];
    for (int j = 0; j < 23; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = covariance[j * (j + 1) / 2 + i];
            product[23 * j + i] = value;
            product[23 * i + j] = value;
        }
    }

    /* F P F^T: F times every column of P, and again of the transpose */
    for (int side = 0; side < 2; side++) {
        for (int k = 0; k < 23; k++) {
            const float p_q_rx = product[23 * k + 14];
            const float p_q_ry = product[23 * k + 15];
            const float p_q_rz = product[23 * k + 16];
            product[23 * k + 14] = (t26 + t31 * d_q_rx) * p_q_rx + (t33 + t30) * p_q_ry
                + (t34 - t29) * p_q_rz;
            product[23 * k + 15] = (t33 - t30) * p_q_rx + (t26 + t32 * d_q_ry) * p_q_ry
                + (t35 + t28) * p_q_rz;
            product[23 * k + 16] = (t34 + t29) * p_q_rx + (t35 - t28) * p_q_ry
                + (t26 + cubic * d_q_rz * d_q_rz) * p_q_rz;
        }
        if (side < 1) {
            for (int j = 1; j < 23; j++) {
                for (int i = 0; i < j; i++) {
                    const float value_1 = product[23 * j + i];
                    product[23 * j + i] = product[23 * i + j];
                    product[23 * i + j] = value_1;
                }
            }
        }
    }

    /* + Q */
    for (int j = 0; j < 23; j++) {
        for (int i = 0; i < j + 1; i++) {
            covariance[j * (j + 1) / 2 + i] = product[23 * j + i];
        }
    }

    /* guards */
    if (!px4_finite(wind_n_next + wind_e_next + earth_x_next + earth_y_next + earth_z_next
        + body_x_next + body_y_next + body_z_next + p_n_next + p_e_next + p_d_next + v_n_next
        + v_e_next + v_d_next + q_w_next + q_x_next + q_y_next + q_z_next + bg_x_next + bg_y_next
        + bg_z_next + ba_x_next + ba_y_next + ba_z_next + nis + s_beta)) {
        return PX4_NOT_FINITE;
    }
    if (t0) {
        flags |= px4_settle(kf->P, 1);
        return flags;
    }

    /* store */
    kf->x[PX4_WIND_N] = wind_n_next;
    kf->x[PX4_WIND_E] = wind_e_next;
    kf->x[PX4_EARTH_X] = earth_x_next;
    kf->x[PX4_EARTH_Y] = earth_y_next;
    kf->x[PX4_EARTH_Z] = earth_z_next;
    kf->x[PX4_BODY_X] = body_x_next;
    kf->x[PX4_BODY_Y] = body_y_next;
    kf->x[PX4_BODY_Z] = body_z_next;
    kf->x[PX4_P_N] = p_n_next;
    kf->x[PX4_P_E] = p_e_next;
    kf->x[PX4_P_D] = p_d_next;
    kf->x[PX4_V_N] = v_n_next;
    kf->x[PX4_V_E] = v_e_next;
    kf->x[PX4_V_D] = v_d_next;
    kf->x[PX4_Q_W] = q_w_next;
    kf->x[PX4_Q_X] = q_x_next;
    kf->x[PX4_Q_Y] = q_y_next;
    kf->x[PX4_Q_Z] = q_z_next;
    kf->x[PX4_BG_X] = bg_x_next;
    kf->x[PX4_BG_Y] = bg_y_next;
    kf->x[PX4_BG_Z] = bg_z_next;
    kf->x[PX4_BA_X] = ba_x_next;
    kf->x[PX4_BA_Y] = ba_y_next;
    kf->x[PX4_BA_Z] = ba_z_next;
    for (int k = 0; k < 276; k++) {
        kf->P[k] = covariance[k];
    }
    kf->nis = nis;
    flags |= px4_settle(kf->P, 0);
    return flags;
}

px4_status_t px4_update_flow(px4_t *kf, const px4_flow_t *z)
{
    if (kf == NULL || z == NULL) { return PX4_NULL_ARGUMENT; }
    px4_status_t flags = PX4_OK;

    /* arguments */
    if (!px4_finite(z->height)) { return PX4_NOT_FINITE; }

    /* innovation */
    const float v_n = kf->x[PX4_V_N];
    const float v_e = kf->x[PX4_V_E];
    const float v_d = kf->x[PX4_V_D];
    const float q_w = kf->x[PX4_Q_W];
    const float q_x = kf->x[PX4_Q_X];
    const float q_y = kf->x[PX4_Q_Y];
    const float q_z = kf->x[PX4_Q_Z];
    const float t3 = q_y * q_y;
    const float t4 = q_z * q_z;
    const float q_r00 = 1.0f - 2.0f * (t3 + t4);
    const float t5 = q_x * q_y;
    const float t6 = q_w * q_z;
    const float q_r01 = 2.0f * (t5 - t6);
    const float t7 = q_x * q_z;
    const float t8 = q_w * q_y;
    const float q_r02 = 2.0f * (t7 + t8);
    const float q_r10 = 2.0f * (t5 + t6);
    const float t9 = q_x * q_x;
    const float q_r11 = 1.0f - 2.0f * (t9 + t4);
    const float t10 = q_y * q_z;
    const float t11 = q_w * q_x;
    const float q_r12 = 2.0f * (t10 - t11);
    const float q_r20 = 2.0f * (t7 - t8);
    const float q_r21 = 2.0f * (t10 + t11);
    const float q_r22 = 1.0f - 2.0f * (t9 + t3);
    const float t12 = q_r01 * v_n + q_r11 * v_e + q_r21 * v_d;
    const float t13 = q_r00 * v_n + q_r10 * v_e + q_r20 * v_d;
    const float h_x = t12 / z->height;
    const float t14 = 1.0f / z->height;
    const float h_x_q_rx = t14 * (q_r02 * v_n + q_r12 * v_e + q_r22 * v_d);
    const float t15 = t14 * t13;
    const float h_x_v_n = t14 * q_r01;
    const float h_x_v_e = t14 * q_r11;
    const float h_x_v_d = t14 * q_r21;
    const float t16 = t14 * t12;
    const float t17 = t14 * q_r00;
    const float t18 = t14 * q_r10;
    const float t19 = t14 * q_r20;
    const float y_x = z->x - h_x;
    const float y_y = z->y + t13 / z->height;

    /* gain and covariance: x */
    float c0[23];
    px4_take_row(kf->P, 11, c0);
    for (int i = 0; i < 23; i++) {
        c0[i] = h_x_v_n * c0[i];
    }
    float row[23];
    px4_take_row(kf->P, 12, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + h_x_v_e * row[i];
    }
    px4_take_row(kf->P, 13, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + h_x_v_d * row[i];
    }
    px4_take_row(kf->P, 14, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] + h_x_q_rx * row[i];
    }
    px4_take_row(kf->P, 16, row);
    for (int i = 0; i < 23; i++) {
        c0[i] = c0[i] - t15 * row[i];
    }
    const float s_x = h_x_v_n * c0[11] + h_x_v_e * c0[12] + h_x_v_d * c0[13] + h_x_q_rx * c0[14]
        - t15 * c0[16] + 0.0225f;
    const bool t2 = s_x < 0.01125f;
    const float inverse_s = 0.9999995f / s_x;
    const float step = inverse_s * y_x;
    const float t0 = y_x * step;

    /* gain and covariance: y */
    const float nu_y = y_y - h_x_q_rx * (c0[15] * step) + t17 * (c0[11] * step)
        + t18 * (c0[12] * step) + t19 * (c0[13] * step) + t16 * (c0[16] * step);
    float c1[23];
    const float factor = h_x_q_rx * inverse_s * c0[15] - t17 * inverse_s * c0[11]
        - t18 * inverse_s * c0[12] - t19 * inverse_s * c0[13] - t16 * inverse_s * c0[16];
    px4_take_row(kf->P, 11, c1);
    for (int i = 0; i < 23; i++) {
        c1[i] = -(t17 * c1[i]);
    }
    px4_take_row(kf->P, 12, row);
    for (int i = 0; i < 23; i++) {
        c1[i] = c1[i] - t18 * row[i];
    }
    px4_take_row(kf->P, 13, row);
    for (int i = 0; i < 23; i++) {
        c1[i] = c1[i] - t19 * row[i];
    }
    px4_take_row(kf->P, 15, row);
    for (int i = 0; i < 23; i++) {
        c1[i] = c1[i] + h_x_q_rx * row[i];
    }
    px4_take_row(kf->P, 16, row);
    for (int i = 0; i < 23; i++) {
        c1[i] = c1[i] - t16 * row[i];
    }
    for (int i = 0; i < 23; i++) {
        c1[i] = c1[i] - factor * c0[i];
    }
    const float s_y = h_x_q_rx * c1[15] - t17 * c1[11] - t18 * c1[12] - t19 * c1[13] - t16 * c1[16]
        + 0.0225f;
    const bool t1 = s_y < 0.01125f;
    const float inverse_s_1 = 0.9999995f / s_y;
    const float step_1 = inverse_s_1 * nu_y;
    const float nis = t0 + nu_y * step_1;

    /* state and innovation squared */
    const float d_q_rx = c0[14] * step + c1[14] * step_1;
    const float d_q_ry = c0[15] * step + c1[15] * step_1;
    const float d_q_rz = c0[16] * step + c1[16] * step_1;
    const float angle_2 = d_q_rx * d_q_rx + d_q_ry * d_q_ry + d_q_rz * d_q_rz;
    const float wind_n_next = kf->x[PX4_WIND_N] + c0[0] * step + c1[0] * step_1;
    const float wind_e_next = kf->x[PX4_WIND_E] + c0[1] * step + c1[1] * step_1;
    const float earth_x_next = kf->x[PX4_EARTH_X] + c0[2] * step + c1[2] * step_1;
    const float earth_y_next = kf->x[PX4_EARTH_Y] + c0[3] * step + c1[3] * step_1;
    const float earth_z_next = kf->x[PX4_EARTH_Z] + c0[4] * step + c1[4] * step_1;
    const float body_x_next = kf->x[PX4_BODY_X] + c0[5] * step + c1[5] * step_1;
    const float body_y_next = kf->x[PX4_BODY_Y] + c0[6] * step + c1[6] * step_1;
    const float body_z_next = kf->x[PX4_BODY_Z] + c0[7] * step + c1[7] * step_1;
    const float p_n_next = kf->x[PX4_P_N] + c0[8] * step + c1[8] * step_1;
    const float p_e_next = kf->x[PX4_P_E] + c0[9] * step + c1[9] * step_1;
    const float p_d_next = kf->x[PX4_P_D] + c0[10] * step + c1[10] * step_1;
    const float v_n_next = v_n + c0[11] * step + c1[11] * step_1;
    const float v_e_next = v_e + c0[12] * step + c1[12] * step_1;
    const float v_d_next = v_d + c0[13] * step + c1[13] * step_1;
    const float bg_x_next = kf->x[PX4_BG_X] + c0[17] * step + c1[17] * step_1;
    const float bg_y_next = kf->x[PX4_BG_Y] + c0[18] * step + c1[18] * step_1;
    const float bg_z_next = kf->x[PX4_BG_Z] + c0[19] * step + c1[19] * step_1;
    const float ba_x_next = kf->x[PX4_BA_X] + c0[20] * step + c1[20] * step_1;
    const float ba_y_next = kf->x[PX4_BA_Y] + c0[21] * step + c1[21] * step_1;
    const float ba_z_next = kf->x[PX4_BA_Z] + c0[22] * step + c1[22] * step_1;
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
    const float t20 = 0.5f * sinc_half;
    const float t21 = t20 * d_q_rx;
    const float t22 = t20 * d_q_ry;
    const float t23 = t20 * d_q_rz;
    const float t24 = q_w * cos_half - q_x * t21 - q_y * t22 - q_z * t23;
    const float t25 = q_w * t21 + q_x * cos_half + q_y * t23 - q_z * t22;
    const float t26 = q_w * t22 - q_x * t23 + q_y * cos_half + q_z * t21;
    const float t27 = q_w * t23 + q_x * t22 - q_y * t21 + q_z * cos_half;
    const float t28 = 0.5f * (3.0f - t24 * t24 - t25 * t25 - t26 * t26 - t27 * t27);
    const float q_w_next = t24 * t28;
    const float q_x_next = t25 * t28;
    const float q_y_next = t26 * t28;
    const float q_z_next = t27 * t28;

    /* reset: the errors as seen from the new attitude */
    const float t29 = cos_half * sinc_half;
    const float t30 = sinc_half * sinc_half * 0.5f;
    float cubic = 0.16666667f - angle_2
        * (0.008333334f - angle_2 * (0.0001984127f
        - angle_2 * (2.7557319e-6f - 2.5052108e-8f * angle_2)));
    if (angle_2 > 1.0f) {
        cubic = (1.0f - t29) / angle_2;
    }
    const float t31 = t30 * d_q_rx;
    const float t32 = t30 * d_q_ry;
    const float t33 = t30 * d_q_rz;
    const float t34 = cubic * d_q_rx;
    const float t35 = cubic * d_q_ry;
    const float t36 = t34 * d_q_ry;
    const float t37 = t34 * d_q_rz;
    const float t38 = t35 * d_q_rz;
    float covariance[276];
    for (int j = 0; j < 23; j++) {
        const float part = c0[j] * inverse_s;
        const float part_1 = c1[j] * inverse_s_1;
        for (int i = 0; i < j + 1; i++) {
            covariance[j * (j + 1) / 2 + i] = kf->P[j * (j + 1) / 2 + i] - c0[i] * part
                - c1[i] * part_1;
        }
    }
    float product[529];
    for (int j = 0; j < 23; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = covariance[j * (j + 1) / 2 + i];
            product[23 * j + i] = value;
            product[23 * i + j] = value;
        }
    }

    /* F P F^T: F times every column of P, and again of the transpose */
    for (int side = 0; side < 2; side++) {
        for (int k = 0; k < 23; k++) {
            const float p_q_rx = product[23 * k + 14];
            const float p_q_ry = product[23 * k + 15];
            const float p_q_rz = product[23 * k + 16];
            product[23 * k + 14] = (t29 + t34 * d_q_rx) * p_q_rx + (t36 + t33) * p_q_ry
                + (t37 - t32) * p_q_rz;
            product[23 * k + 15] = (t36 - t33) * p_q_rx + (t29 + t35 * d_q_ry) * p_q_ry
                + (t38 + t31) * p_q_rz;
            product[23 * k + 16] = (t37 + t32) * p_q_rx + (t38 - t31) * p_q_ry
                + (t29 + cubic * d_q_rz * d_q_rz) * p_q_rz;
        }
        if (side < 1) {
            for (int j = 1; j < 23; j++) {
                for (int i = 0; i < j; i++) {
                    const float value_1 = product[23 * j + i];
                    product[23 * j + i] = product[23 * i + j];
                    product[23 * i + j] = value_1;
                }
            }
        }
    }

    /* + Q */
    for (int j = 0; j < 23; j++) {
        for (int i = 0; i < j + 1; i++) {
            covariance[j * (j + 1) / 2 + i] = product[23 * j + i];
        }
    }

    /* guards */
    if (!px4_finite(wind_n_next + wind_e_next + earth_x_next + earth_y_next + earth_z_next
        + body_x_next + body_y_next + body_z_next + p_n_next + p_e_next + p_d_next + v_n_next
        + v_e_next + v_d_next + q_w_next + q_x_next + q_y_next + q_z_next + bg_x_next + bg_y_next
        + bg_z_next + ba_x_next + ba_y_next + ba_z_next + nis + s_x + s_y)) {
        return PX4_NOT_FINITE;
    }
    if (t2 || t1) {
        flags |= px4_settle(kf->P, 1);
        return flags;
    }

    /* store */
    kf->x[PX4_WIND_N] = wind_n_next;
    kf->x[PX4_WIND_E] = wind_e_next;
    kf->x[PX4_EARTH_X] = earth_x_next;
    kf->x[PX4_EARTH_Y] = earth_y_next;
    kf->x[PX4_EARTH_Z] = earth_z_next;
    kf->x[PX4_BODY_X] = body_x_next;
    kf->x[PX4_BODY_Y] = body_y_next;
    kf->x[PX4_BODY_Z] = body_z_next;
    kf->x[PX4_P_N] = p_n_next;
    kf->x[PX4_P_E] = p_e_next;
    kf->x[PX4_P_D] = p_d_next;
    kf->x[PX4_V_N] = v_n_next;
    kf->x[PX4_V_E] = v_e_next;
    kf->x[PX4_V_D] = v_d_next;
    kf->x[PX4_Q_W] = q_w_next;
    kf->x[PX4_Q_X] = q_x_next;
    kf->x[PX4_Q_Y] = q_y_next;
    kf->x[PX4_Q_Z] = q_z_next;
    kf->x[PX4_BG_X] = bg_x_next;
    kf->x[PX4_BG_Y] = bg_y_next;
    kf->x[PX4_BG_Z] = bg_z_next;
    kf->x[PX4_BA_X] = ba_x_next;
    kf->x[PX4_BA_Y] = ba_y_next;
    kf->x[PX4_BA_Z] = ba_z_next;
    for (int k = 0; k < 276; k++) {
        kf->P[k] = covariance[k];
    }
    kf->nis = nis;
    flags |= px4_settle(kf->P, 0);
    return flags;
}

px4_status_t px4_set_state(px4_t *kf, const px4_real_t x[24])
{
    if (kf == NULL || x == NULL) { return PX4_NULL_ARGUMENT; }
    if (!px4_finite(x[PX4_WIND_N])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_WIND_E])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_EARTH_X])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_EARTH_Y])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_EARTH_Z])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_BODY_X])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_BODY_Y])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_BODY_Z])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_P_N])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_P_E])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_P_D])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_V_N])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_V_E])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_V_D])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_Q_W])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_Q_X])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_Q_Y])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_Q_Z])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_BG_X])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_BG_Y])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_BG_Z])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_BA_X])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_BA_Y])) { return PX4_NOT_FINITE; }
    if (!px4_finite(x[PX4_BA_Z])) { return PX4_NOT_FINITE; }
    const float largest = px4_max(px4_max(px4_max(fabsf(x[PX4_Q_W]), fabsf(x[PX4_Q_X])),
        fabsf(x[PX4_Q_Y])), fabsf(x[PX4_Q_Z]));
    if (largest < 0.0005f) { return PX4_NOT_POSITIVE; }
    const float part = x[PX4_Q_W] / largest;
    const float part_1 = x[PX4_Q_X] / largest;
    const float part_2 = x[PX4_Q_Y] / largest;
    const float part_3 = x[PX4_Q_Z] / largest;
    const float t0 = sqrtf(part * part + part_1 * part_1 + part_2 * part_2 + part_3 * part_3);
    const float norm = largest * t0;
    if (norm < 0.001f) { return PX4_NOT_POSITIVE; }
    const float t1 = 1.0f / t0;
    kf->x[PX4_WIND_N] = x[PX4_WIND_N];
    kf->x[PX4_WIND_E] = x[PX4_WIND_E];
    kf->x[PX4_EARTH_X] = x[PX4_EARTH_X];
    kf->x[PX4_EARTH_Y] = x[PX4_EARTH_Y];
    kf->x[PX4_EARTH_Z] = x[PX4_EARTH_Z];
    kf->x[PX4_BODY_X] = x[PX4_BODY_X];
    kf->x[PX4_BODY_Y] = x[PX4_BODY_Y];
    kf->x[PX4_BODY_Z] = x[PX4_BODY_Z];
    kf->x[PX4_P_N] = x[PX4_P_N];
    kf->x[PX4_P_E] = x[PX4_P_E];
    kf->x[PX4_P_D] = x[PX4_P_D];
    kf->x[PX4_V_N] = x[PX4_V_N];
    kf->x[PX4_V_E] = x[PX4_V_E];
    kf->x[PX4_V_D] = x[PX4_V_D];
    kf->x[PX4_Q_W] = part * t1;
    kf->x[PX4_Q_X] = part_1 * t1;
    kf->x[PX4_Q_Y] = part_2 * t1;
    kf->x[PX4_Q_Z] = part_3 * t1;
    kf->x[PX4_BG_X] = x[PX4_BG_X];
    kf->x[PX4_BG_Y] = x[PX4_BG_Y];
    kf->x[PX4_BG_Z] = x[PX4_BG_Z];
    kf->x[PX4_BA_X] = x[PX4_BA_X];
    kf->x[PX4_BA_Y] = x[PX4_BA_Y];
    kf->x[PX4_BA_Z] = x[PX4_BA_Z];
    return PX4_OK;
}

px4_status_t px4_set_covariance(px4_t *kf, const px4_real_t P[529])
{
    if (kf == NULL || P == NULL) { return PX4_NULL_ARGUMENT; }
    float p[276];
    float w[276];

    /* the upper triangle, column by column */
    for (int j = 0; j < 23; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = P[23 * i + j];
            p[j * (j + 1) / 2 + i] = value;
            w[j * (j + 1) / 2 + i] = value;
            if (!px4_finite(value)) { return PX4_NOT_FINITE; }
        }
    }

    /* factor it: a pivot is zero up to round-off, or positive */
    for (int j = 23 - 1; j >= 0; j--) {
        const float round_off = 2.7418137e-6f * p[j * (j + 1) / 2 + j];
        const float pivot = w[j * (j + 1) / 2 + j];
        if (!(-round_off <= pivot)) { return PX4_NOT_POSITIVE; }
        const float d = round_off < pivot ? pivot : 0.0f;
        w[j * (j + 1) / 2 + j] = d;
        for (int i = j - 1; i >= 0; i--) {
            const float rest = w[j * (j + 1) / 2 + i];
            if (d <= 0.0f && 0.000010967255f * p[j * (j + 1) / 2 + j]
                * p[i * (i + 1) / 2 + i] < rest * rest) {
                return PX4_NOT_POSITIVE;
            }
            const float u = d > 0.0f ? rest / d : 0.0f;
            for (int k = 0; k < i + 1; k++) {
                w[i * (i + 1) / 2 + k] = w[i * (i + 1) / 2 + k] - u * w[j * (j + 1) / 2 + k];
            }
            w[j * (j + 1) / 2 + i] = u;
        }
    }

    /* store */
    for (int k = 0; k < 276; k++) {
        kf->P[k] = p[k];
    }
    return PX4_OK;
}

void px4_get_covariance(const px4_t *kf, px4_real_t P[529])
{
    if (kf == NULL || P == NULL) { return; }
    for (int j = 0; j < 23; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = kf->P[j * (j + 1) / 2 + i];
            P[23 * i + j] = value;
            P[23 * j + i] = value;
        }
    }
}

px4_status_t px4_get_outputs(const px4_t *kf, px4_outputs_t *value, px4_outputs_t *std)
{
    if (kf == NULL || value == NULL) { return PX4_NULL_ARGUMENT; }
    const float q_w = kf->x[PX4_Q_W];
    const float q_x = kf->x[PX4_Q_X];
    const float q_y = kf->x[PX4_Q_Y];
    const float q_z = kf->x[PX4_Q_Z];

    /* outputs */
    const float t0 = q_z * q_z;
    const float q_r00 = 1.0f - 2.0f * (q_y * q_y + t0);
    const float t1 = q_x * q_y;
    const float t2 = q_w * q_z;
    const float q_r01 = 2.0f * (t1 - t2);
    const float q_r02 = 2.0f * (q_x * q_z + q_w * q_y);
    const float q_r10 = 2.0f * (t1 + t2);
    const float q_r11 = 1.0f - 2.0f * (q_x * q_x + t0);
    const float q_r12 = 2.0f * (q_y * q_z - q_w * q_x);
    const float heading = atan2f(q_r10, q_r00);
    if (!px4_finite(heading)) { return PX4_NOT_FINITE; }
    if (std != NULL) {
        /* their standard deviations: sqrt(J P J^T) */
        const float t3 = q_r00 * q_r00 + q_r10 * q_r10;
        const float t4 = t3 > 0.0f ? 1.0f / t3 : 0.0f;
        const float t5 = q_r10 * t4;
        const float t6 = q_r00 * t4;
        const float t7 = t5 * q_r02 - t6 * q_r12;
        const float t8 = t6 * q_r11 - t5 * q_r01;
        const float t9 = t7 * (kf->P[135] * t7 + kf->P[151] * t8)
            + t8 * (kf->P[151] * t7 + kf->P[152] * t8);
        const float var_heading = t9 < 0.0f ? 0.0f : t9;
        if (!px4_finite(var_heading)) { return PX4_NOT_FINITE; }
        std->heading = sqrtf(var_heading > 0.0f ? var_heading : 0.0f);
    }
    value->heading = heading;
    return PX4_OK;
}
/* kfgen: body 9dc2c4729a7b1fc55c4a443083108f16 */
