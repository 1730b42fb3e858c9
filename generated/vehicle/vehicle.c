/* kfgen build vehicle.yaml */
#include "vehicle.h"

#include <math.h>

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "vehicle tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "vehicle tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* constants: in flash on AVR too, where what is only const takes RAM */
#if defined(__AVR__)
#include <avr/pgmspace.h>
#define VEHICLE_flash PROGMEM
#define VEHICLE_order(i) ((int)pgm_read_byte(&vehicle_order[i]))
#else
#define VEHICLE_flash
#define VEHICLE_order(i) ((int)vehicle_order[i])
#endif

/* inner position -> index into x */
static const uint8_t vehicle_order[5] VEHICLE_flash = {
    0, 1, 2, 4, 3
};

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool vehicle_finite(float a)
{
    const uint32_t exponent = 0x7f800000u;
    union { float value; uint32_t bits; } view;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

/* a in (-half, half], by whole turns of 2 half */
static float vehicle_wrap(float a, float half)
{
    if (a > half || a <= -half) {
        a -= (half + half) * ceilf((a - half) / (half + half));
        if (a > half || a <= -half) { a = half; } /* the last bit of a turn */
    }
    return a;
}

vehicle_status_t vehicle_init(vehicle_t *kf)
{
    if (kf == NULL) { return VEHICLE_NULL_ARGUMENT; }
    for (int i = 0; i < 5; i++) {
        kf->x[i] = 0.0f;
    }
    for (int i = 0; i < 10; i++) {
        kf->U[i] = 0.0f;
    }
    kf->D[0] = 9.0f;
    kf->D[1] = 9.0f;
    kf->D[2] = 3.24f;
    kf->D[3] = 0.0001f;
    kf->D[4] = 25.0f;
    kf->nis = 0.0f;
    kf->gate_count_gnss = 0;
    kf->gate_count_speed = 0;
    kf->initialized = false;
    kf->parameters.gyro_noise = 0.003f;
    kf->parameters.accel_noise = 0.5f;
    kf->parameters.accel_offset = 1.75f;
    kf->parameters.gnss_std = 3.0f;
    return VEHICLE_OK;
}

vehicle_status_t vehicle_predict(vehicle_t *kf, const vehicle_inputs_t *u, vehicle_real_t dt)
{
    if (kf == NULL || u == NULL) { return VEHICLE_NULL_ARGUMENT; }
    vehicle_status_t flags = VEHICLE_OK;

    /* arguments */
    if (!vehicle_finite(u->yaw_rate)) { return VEHICLE_NOT_FINITE; }
    if (!vehicle_finite(u->accel)) { return VEHICLE_NOT_FINITE; }
    if (!vehicle_finite(dt)) { return VEHICLE_NOT_FINITE; }
    const bool t0 = dt < 0.001f;
    if (t0) { flags |= VEHICLE_DT_CLAMPED; }
    const bool t1 = dt > 0.5f;
    if (t1) { flags |= VEHICLE_DT_CLAMPED; }
    const float step = t1 ? 0.5f : (t0 ? 0.001f : dt);
    const float heading = kf->x[VEHICLE_HEADING];
    const float speed = kf->x[VEHICLE_SPEED];
    const float gyro_bias = kf->x[VEHICLE_GYRO_BIAS];

    /* model */
    const float t2 = u->yaw_rate - gyro_bias;
    const float t3 = kf->parameters.accel_offset - u->accel;
    const float t4 = 0.5f * step;
    const float t5 = heading + t2 * t4;
    const float t6 = speed + t3 * t4;
    const float cos_heading = cosf(t5);
    const float t7 = t6 * cos_heading;
    const float sin_heading = sinf(t5);
    const float t8 = t6 * sin_heading;
    const float f_y_heading = t7 * step;
    const float t9 = t8 * step;
    const float f_x_gyro_bias = t8 * t4 * step;
    const float f_x_speed = cos_heading * step;
    const float x_next = kf->x[VEHICLE_X] + f_y_heading;
    const float t10 = t7 * t4 * step;
    const float f_y_speed = sin_heading * step;
    const float y_next = kf->x[VEHICLE_Y] + t9;
    const float heading_next = heading + t2 * step;
    const float speed_next = speed + t3 * step;
    const float t11 = kf->parameters.gyro_noise * kf->parameters.gyro_noise * step;
    const float t12 = kf->parameters.accel_noise * kf->parameters.accel_noise * step;
    const float t13 = 1.0e-10f * step;

    /* F U, unit upper triangular as F is */
    const float u_x_heading = kf->U[1];
    const float t14 = u_x_heading - t9;
    const float u_y_heading = kf->U[2];
    const float t15 = u_y_heading + f_y_heading;
    const float u_x_gyro_bias = kf->U[3];
    const float u_heading_gyro_bias = kf->U[5];
    const float t16 = u_x_gyro_bias - t9 * u_heading_gyro_bias + f_x_gyro_bias;
    const float u_y_gyro_bias = kf->U[4];
    const float t17 = u_y_gyro_bias + f_y_heading * u_heading_gyro_bias - t10;
    const float t18 = u_heading_gyro_bias - step;
    const float u_x_speed = kf->U[6];
    const float u_heading_speed = kf->U[8];
    const float u_gyro_bias_speed = kf->U[9];
    const float t19 = u_x_speed - t9 * u_heading_speed + f_x_gyro_bias * u_gyro_bias_speed
        + f_x_speed;
    const float u_y_speed = kf->U[7];
    const float t20 = u_y_speed + f_y_heading * u_heading_speed - t10 * u_gyro_bias_speed
        + f_y_speed;
    const float t21 = u_heading_speed - step * u_gyro_bias_speed;

    /* process noise */
    const float d_speed = kf->D[4];
    const float d_speed_next = d_speed + t12;
    const float t22 = d_speed_next > 0.0f ? d_speed / d_speed_next : 1.0f;
    const float t23 = t12 * t22;
    const float u_x_speed_next = t22 * t19;
    const float u_y_speed_next = t22 * t20;
    const float u_heading_speed_next = t22 * t21;
    const float u_gyro_bias_speed_next = t22 * u_gyro_bias_speed;
    const float t24 = t23 * u_gyro_bias_speed;
    const float d_gyro_bias = kf->D[3];
    const float t25 = d_gyro_bias + u_gyro_bias_speed * t24;
    const bool t26 = t25 > 0.0f;
    const float t27 = t26 ? -(t24 / t25) : 0.0f;
    const float t28 = t26 ? d_gyro_bias / t25 : 1.0f;
    const float t29 = t23 * t28;
    const float d_gyro_bias_next = t25 + t13;
    const float t30 = t25 * (1.0f / d_gyro_bias_next);
    const float t31 = t13 * t30;
    const float t32 = t28 * t16 - t27 * t19;
    const float t33 = u_gyro_bias_speed * t16 - t19;
    const float u_x_gyro_bias_next = t30 * t32;
    const float t34 = t28 * t17 - t27 * t20;
    const float t35 = u_gyro_bias_speed * t17 - t20;
    const float u_y_gyro_bias_next = t30 * t34;
    const float t36 = t28 * t18 - t27 * t21;
    const float t37 = u_gyro_bias_speed * t18 - t21;
    const float u_heading_gyro_bias_next = t30 * t36;
    const float d_heading = kf->D[2];
    const float t38 = d_heading + t11;
    const float t39 = t38 > 0.0f ? d_heading / t38 : 1.0f;
    const float t40 = t11 * t39;
    const float t41 = t29 * t37;
    const float t42 = t38 + t37 * t41;
    const bool t43 = t42 > 0.0f;
    const float t44 = t43 ? t41 / t42 : 0.0f;
    const float t45 = t43 ? t38 / t42 : 1.0f;
    const float t46 = t29 * t45;
    const float t47 = t31 * t36;
    const float d_heading_next = t42 + t36 * t47;
    const bool t48 = d_heading_next > 0.0f;
    const float t49 = t48 ? -(t47 / d_heading_next) : 0.0f;
    const float t50 = t48 ? t42 / d_heading_next : 1.0f;
    const float t51 = t31 * t50;
    const float t52 = t39 * t14;
    const float t53 = t45 * t52 + t44 * t33;
    const float t54 = t33 - t37 * t52;
    const float u_x_heading_next = t50 * t53 - t49 * t32;
    const float t55 = t36 * t53 - t32;
    const float t56 = t39 * t15;
    const float t57 = t45 * t56 + t44 * t35;
    const float t58 = t35 - t37 * t56;
    const float u_y_heading_next = t50 * t57 - t49 * t34;
    const float t59 = t36 * t57 - t34;
    const float t60 = t40 * t15;
    const float d_y = kf->D[1];
    const float t61 = d_y + t15 * t60;
    const bool t62 = t61 > 0.0f;
    const float t63 = t62 ? d_y / t61 : 1.0f;
    const float t64 = t46 * t58;
    const float t65 = t61 + t58 * t64;
    const bool t66 = t65 > 0.0f;
    const float t67 = t66 ? t61 / t65 : 1.0f;
    const float t68 = t51 * t59;
    const float d_y_next = t65 + t59 * t68;
    const bool t69 = d_y_next > 0.0f;
    const float t70 = t69 ? t65 / d_y_next : 1.0f;
    const float u_x_y = kf->U[0];
    const float t71 = t63 * u_x_y - (t62 ? -(t60 / t61) : 0.0f) * t14;
    const float t72 = t15 * u_x_y - t14;
    const float t73 = t67 * t71 + (t66 ? t64 / t65 : 0.0f) * t54;
    const float t74 = t54 - t58 * t71;
    const float u_x_y_next = t70 * t73 + (t69 ? t68 / d_y_next : 0.0f) * t55;
    const float t75 = t55 - t59 * t73;
    const float d_x = kf->D[0];
    const float d_x_next = d_x + t72 * (t40 * t63 * t72) + t74 * (t46 * t67 * t74)
        + t75 * (t51 * t70 * t75);

    /* guards */
    if (!vehicle_finite(x_next + y_next + heading_next + speed_next + d_x_next + d_y_next
        + d_heading_next + d_gyro_bias_next + d_speed_next)) {
        return VEHICLE_NOT_FINITE;
    }

    /* store */
    kf->x[VEHICLE_X] = x_next;
    kf->x[VEHICLE_Y] = y_next;
    kf->x[VEHICLE_HEADING] = vehicle_wrap(heading_next, 3.1415927f);
    kf->x[VEHICLE_SPEED] = speed_next;
    kf->U[0] = u_x_y_next;
    kf->U[1] = u_x_heading_next;
    kf->U[2] = u_y_heading_next;
    kf->U[3] = u_x_gyro_bias_next;
    kf->U[4] = u_y_gyro_bias_next;
    kf->U[5] = u_heading_gyro_bias_next;
    kf->U[6] = u_x_speed_next;
    kf->U[7] = u_y_speed_next;
    kf->U[8] = u_heading_speed_next;
    kf->U[9] = u_gyro_bias_speed_next;
    kf->D[0] = d_x_next;
    kf->D[1] = d_y_next;
    kf->D[2] = d_heading_next;
    kf->D[3] = d_gyro_bias_next;
    kf->D[4] = d_speed_next;
    return flags;
}

vehicle_status_t vehicle_update_gnss(vehicle_t *kf, const vehicle_gnss_t *z)
{
    if (kf == NULL || z == NULL) { return VEHICLE_NULL_ARGUMENT; }
    vehicle_status_t flags = VEHICLE_OK;

    /* arguments */
    if (!vehicle_finite(kf->parameters.gnss_std)) { return VEHICLE_NOT_FINITE; }

    /* the first measurement sets the state */
    if (!vehicle_finite(z->x + z->y)) { return VEHICLE_NOT_FINITE; }
    if (!kf->initialized) {
        kf->x[VEHICLE_X] = z->x;
        kf->x[VEHICLE_Y] = z->y;
        kf->nis = 0.0f;
        kf->initialized = true;
        return VEHICLE_OK;
    }

    /* innovation */
    const float x = kf->x[VEHICLE_X];
    const float y = kf->x[VEHICLE_Y];
    const float y_x = z->x - x;
    const float y_y = z->y - y;
    const float t0 = kf->parameters.gnss_std * kf->parameters.gnss_std;

    /* gain and covariance: x, y */
    const float d_x = kf->D[0];
    const float t1 = t0 + d_x;
    const bool t2 = t1 > 1.1754944e-38f;
    const float t3 = t2 ? 1.0f / t1 : 0.0f;
    const float t4 = d_x * t3;
    const float d_x_next = d_x * (t2 ? t0 * t3 : 1.0f);
    const float d_y = kf->D[1];
    const float u_x_y = kf->U[0];
    const float t5 = d_y * u_x_y;
    const float t6 = t1 + u_x_y * t5;
    const bool t7 = t6 > 1.1754944e-38f;
    const float t8 = t7 ? 1.0f / t6 : 0.0f;
    const float t9 = t5 * t8;
    const float t10 = d_y * (t7 ? t1 * t8 : 1.0f);
    const float t11 = t0 + t10;
    const bool t12 = t11 > 1.1754944e-38f;
    const float t13 = t12 ? 1.0f / t11 : 0.0f;
    const float t14 = t10 * t13;
    const float d_y_next = t10 * (t12 ? t0 * t13 : 1.0f);
    const float u_x_y_next = u_x_y - u_x_y * t4;
    const float t15 = t4 + t9 * u_x_y_next;
    const float t16 = t14 * u_x_y_next;
    const float d_heading = kf->D[2];
    const float u_x_heading = kf->U[1];
    const float t17 = d_heading * u_x_heading;
    const float t18 = t6 + u_x_heading * t17;
    const bool t19 = t18 > 1.1754944e-38f;
    const float t20 = t19 ? 1.0f / t18 : 0.0f;
    const float t21 = t17 * t20;
    const float t22 = d_heading * (t19 ? t6 * t20 : 1.0f);
    const float u_y_heading = kf->U[2];
    const float t23 = u_y_heading - u_x_heading * t9;
    const float t24 = t22 * t23;
    const float t25 = t11 + t23 * t24;
    const bool t26 = t25 > 1.1754944e-38f;
    const float t27 = t26 ? 1.0f / t25 : 0.0f;
    const float t28 = t24 * t27;
    const float d_heading_next = t22 * (t26 ? t11 * t27 : 1.0f);
    const float t29 = t9 + t21 * t23;
    const float u_y_heading_next = t23 - t23 * t14;
    const float t30 = t14 + t28 * u_y_heading_next;
    const float t31 = u_x_heading - u_x_heading * t15;
    const float t32 = t15 + t21 * t31;
    const float u_x_heading_next = t31 - t23 * t16;
    const float t33 = t16 + t28 * u_x_heading_next;
    const float d_gyro_bias = kf->D[3];
    const float u_x_gyro_bias = kf->U[3];
    const float t34 = d_gyro_bias * u_x_gyro_bias;
    const float t35 = t18 + u_x_gyro_bias * t34;
    const bool t36 = t35 > 1.1754944e-38f;
    const float t37 = t36 ? 1.0f / t35 : 0.0f;
    const float t38 = t34 * t37;
    const float t39 = d_gyro_bias * (t36 ? t18 * t37 : 1.0f);
    const float u_y_gyro_bias = kf->U[4];
    const float t40 = u_y_gyro_bias - u_x_gyro_bias * t29;
    const float t41 = t39 * t40;
    const float t42 = t25 + t40 * t41;
    const bool t43 = t42 > 1.1754944e-38f;
    const float t44 = t43 ? 1.0f / t42 : 0.0f;
    const float t45 = t41 * t44;
    const float d_gyro_bias_next = t39 * (t43 ? t25 * t44 : 1.0f);
    const float u_heading_gyro_bias = kf->U[5];
    const float t46 = u_heading_gyro_bias - u_x_gyro_bias * t21;
    const float t47 = t21 + t38 * t46;
    const float u_heading_gyro_bias_next = t46 - t40 * t28;
    const float t48 = t28 + t45 * u_heading_gyro_bias_next;
    const float t49 = t29 + t38 * t40;
    const float u_y_gyro_bias_next = t40 - t40 * t30;
    const float t50 = t30 + t45 * u_y_gyro_bias_next;
    const float t51 = u_x_gyro_bias - u_x_gyro_bias * t32;
    const float t52 = t32 + t38 * t51;
    const float u_x_gyro_bias_next = t51 - t40 * t33;
    const float t53 = t33 + t45 * u_x_gyro_bias_next;
    const float d_speed = kf->D[4];
    const float u_x_speed = kf->U[6];
    const float t54 = d_speed * u_x_speed;
    const float s_x = t35 + u_x_speed * t54;
    const bool t55 = s_x > 1.1754944e-38f;
    const float t56 = 1.0f / s_x;
    const float t57 = t55 ? t56 : 0.0f;
    const float t58 = t54 * t57;
    const float t59 = d_speed * (t55 ? t35 * t57 : 1.0f);
    const float u_y_speed = kf->U[7];
    const float t60 = u_y_speed - u_x_speed * t49;
    const float t61 = t59 * t60;
    const float s_y = t42 + t60 * t61;
    const bool t62 = s_y > 1.1754944e-38f;
    const float t63 = 1.0f / s_y;
    const float t64 = t62 ? t63 : 0.0f;
    const float t65 = t61 * t64;
    const float d_speed_next = t59 * (t62 ? t42 * t64 : 1.0f);
    const float u_gyro_bias_speed = kf->U[9];
    const float t66 = u_gyro_bias_speed - u_x_speed * t38;
    const float u_gyro_bias_speed_next = t66 - t60 * t45;
    const float u_heading_speed = kf->U[8];
    const float t67 = u_heading_speed - u_x_speed * t47;
    const float u_heading_speed_next = t67 - t60 * t48;
    const float u_y_speed_next = t60 - t60 * t50;
    const float t68 = u_x_speed - u_x_speed * t52;
    const float u_x_speed_next = t68 - t60 * t53;
    const float t69 = (t49 + t58 * t60) * y_x;
    const float nu_y = y_y - t69;
    const float nis = (t55 ? y_x * (y_x * t56) : 0.0f) + (t62 ? nu_y * (nu_y * t63) : 0.0f);

    /* state and innovation squared */
    const float x_next = x + (t52 + t58 * t68) * y_x + (t53 + t65 * u_x_speed_next) * nu_y;
    const float y_next = y + t69 + (t50 + t65 * u_y_speed_next) * nu_y;
    const float heading_next = kf->x[VEHICLE_HEADING] + (t47 + t58 * t67) * y_x
        + (t48 + t65 * u_heading_speed_next) * nu_y;
    const float gyro_bias_next = kf->x[VEHICLE_GYRO_BIAS] + (t38 + t58 * t66) * y_x
        + (t45 + t65 * u_gyro_bias_speed_next) * nu_y;
    const float speed_next = kf->x[VEHICLE_SPEED] + t58 * y_x + t65 * nu_y;

    /* guards */
    if (!vehicle_finite(y_x + y_y + s_x + s_y)) { return VEHICLE_NOT_FINITE; }
    if (s_x < 0.0f || s_y < 0.0f) { return VEHICLE_NOT_POSITIVE; }

    /* gate */
    const bool t70 = nis > 13.815511f;
    if (t70 && kf->gate_count_gnss < 10u) {
        kf->nis = nis;
        kf->gate_count_gnss = kf->gate_count_gnss + 1u;
        return VEHICLE_GATED;
    }
    if (t70) { flags |= VEHICLE_ANOMALY; }
    if (!vehicle_finite(nis + x_next + y_next + heading_next + speed_next + gyro_bias_next)) {
        return VEHICLE_NOT_FINITE;
    }

    /* store */
    kf->x[VEHICLE_X] = x_next;
    kf->x[VEHICLE_Y] = y_next;
    kf->x[VEHICLE_HEADING] = vehicle_wrap(heading_next, 3.1415927f);
    kf->x[VEHICLE_SPEED] = speed_next;
    kf->x[VEHICLE_GYRO_BIAS] = gyro_bias_next;
    kf->U[0] = u_x_y_next;
    kf->U[1] = u_x_heading_next;
    kf->U[2] = u_y_heading_next;
    kf->U[3] = u_x_gyro_bias_next;
    kf->U[4] = u_y_gyro_bias_next;
    kf->U[5] = u_heading_gyro_bias_next;
    kf->U[6] = u_x_speed_next;
    kf->U[7] = u_y_speed_next;
    kf->U[8] = u_heading_speed_next;
    kf->U[9] = u_gyro_bias_speed_next;
    kf->D[0] = d_x_next;
    kf->D[1] = d_y_next;
    kf->D[2] = d_heading_next;
    kf->D[3] = d_gyro_bias_next;
    kf->D[4] = d_speed_next;
    kf->gate_count_gnss = 0;
    kf->nis = nis;
    return flags;
}

vehicle_status_t vehicle_update_speed(vehicle_t *kf, const vehicle_speed_t *z)
{
    if (kf == NULL || z == NULL) { return VEHICLE_NULL_ARGUMENT; }
    vehicle_status_t flags = VEHICLE_OK;

    /* innovation */
    const float speed = kf->x[VEHICLE_SPEED];
    const float y_v = z->v - speed;
    const float u_x_y = kf->U[0];
    const float u_x_y_next = u_x_y;
    const float u_x_heading = kf->U[1];
    const float u_x_heading_next = u_x_heading;
    const float u_x_gyro_bias = kf->U[3];
    const float u_x_gyro_bias_next = u_x_gyro_bias;
    const float u_x_speed = kf->U[6];
    const float u_x_speed_next = u_x_speed;
    const float u_y_heading = kf->U[2];
    const float u_y_heading_next = u_y_heading;
    const float u_y_gyro_bias = kf->U[4];
    const float u_y_gyro_bias_next = u_y_gyro_bias;
    const float u_y_speed = kf->U[7];
    const float u_y_speed_next = u_y_speed;
    const float u_heading_gyro_bias = kf->U[5];
    const float u_heading_gyro_bias_next = u_heading_gyro_bias;
    const float u_heading_speed = kf->U[8];
    const float u_heading_speed_next = u_heading_speed;
    const float u_gyro_bias_speed = kf->U[9];
    const float u_gyro_bias_speed_next = u_gyro_bias_speed;
    const float d_x = kf->D[0];
    const float d_x_next = d_x;
    const float d_y = kf->D[1];
    const float d_y_next = d_y;
    const float d_heading = kf->D[2];
    const float d_heading_next = d_heading;
    const float d_gyro_bias = kf->D[3];
    const float d_gyro_bias_next = d_gyro_bias;

    /* gain and covariance */
    const float d_speed = kf->D[4];
    const float s_v = 0.25f + d_speed;
    const float t0 = 1.0f / s_v;
    const float t1 = d_speed * t0;
    const float d_speed_next = d_speed * (0.25f * t0);
    const float nis = y_v * (y_v * t0);

    /* state and innovation squared */
    const float x_next = kf->x[VEHICLE_X] + t1 * u_x_speed_next * y_v;
    const float y_next = kf->x[VEHICLE_Y] + t1 * u_y_speed_next * y_v;
    const float heading_next = kf->x[VEHICLE_HEADING] + t1 * u_heading_speed_next * y_v;
    const float gyro_bias_next = kf->x[VEHICLE_GYRO_BIAS] + t1 * u_gyro_bias_speed_next * y_v;
    const float speed_next = speed + t1 * y_v;

    /* guards */
    if (!vehicle_finite(y_v + s_v)) { return VEHICLE_NOT_FINITE; }
    if (!(s_v > 0.0f)) { return VEHICLE_NOT_POSITIVE; }

    /* gate */
    const bool t2 = nis > 15.136705f;
    if (t2 && kf->gate_count_speed < 10u) {
        kf->nis = nis;
        kf->gate_count_speed = kf->gate_count_speed + 1u;
        return VEHICLE_GATED;
    }
    if (t2) { flags |= VEHICLE_ANOMALY; }
    if (!vehicle_finite(nis + x_next + y_next + heading_next + speed_next + gyro_bias_next)) {
        return VEHICLE_NOT_FINITE;
    }

    /* store */
    kf->x[VEHICLE_X] = x_next;
    kf->x[VEHICLE_Y] = y_next;
    kf->x[VEHICLE_HEADING] = vehicle_wrap(heading_next, 3.1415927f);
    kf->x[VEHICLE_SPEED] = speed_next;
    kf->x[VEHICLE_GYRO_BIAS] = gyro_bias_next;
    kf->U[0] = u_x_y_next;
    kf->U[1] = u_x_heading_next;
    kf->U[2] = u_y_heading_next;
    kf->U[3] = u_x_gyro_bias_next;
    kf->U[4] = u_y_gyro_bias_next;
    kf->U[5] = u_heading_gyro_bias_next;
    kf->U[6] = u_x_speed_next;
    kf->U[7] = u_y_speed_next;
    kf->U[8] = u_heading_speed_next;
    kf->U[9] = u_gyro_bias_speed_next;
    kf->D[0] = d_x_next;
    kf->D[1] = d_y_next;
    kf->D[2] = d_heading_next;
    kf->D[3] = d_gyro_bias_next;
    kf->D[4] = d_speed_next;
    kf->gate_count_speed = 0;
    kf->nis = nis;
    return flags;
}

vehicle_status_t vehicle_set_state(vehicle_t *kf, const vehicle_real_t x[5])
{
    if (kf == NULL || x == NULL) { return VEHICLE_NULL_ARGUMENT; }
    if (!vehicle_finite(x[VEHICLE_X])) { return VEHICLE_NOT_FINITE; }
    if (!vehicle_finite(x[VEHICLE_Y])) { return VEHICLE_NOT_FINITE; }
    if (!vehicle_finite(x[VEHICLE_HEADING])) { return VEHICLE_NOT_FINITE; }
    if (!vehicle_finite(x[VEHICLE_SPEED])) { return VEHICLE_NOT_FINITE; }
    if (!vehicle_finite(x[VEHICLE_GYRO_BIAS])) { return VEHICLE_NOT_FINITE; }
    kf->x[VEHICLE_X] = x[VEHICLE_X];
    kf->x[VEHICLE_Y] = x[VEHICLE_Y];
    kf->x[VEHICLE_HEADING] = vehicle_wrap(x[VEHICLE_HEADING], 3.1415927f);
    kf->x[VEHICLE_SPEED] = x[VEHICLE_SPEED];
    kf->x[VEHICLE_GYRO_BIAS] = x[VEHICLE_GYRO_BIAS];
    return VEHICLE_OK;
}

vehicle_status_t vehicle_set_covariance(vehicle_t *kf, const vehicle_real_t P[25])
{
    if (kf == NULL || P == NULL) { return VEHICLE_NULL_ARGUMENT; }
    float p[15];
    float w[15];

    /* the upper triangle, column by column */
    for (int j = 0; j < 5; j++) {
        for (int i = 0; i < j + 1; i++) {
            const bool t0 = VEHICLE_order(j) < VEHICLE_order(i);
            const float value = P[5 * (t0 ? VEHICLE_order(j) : VEHICLE_order(i))
                + (t0 ? VEHICLE_order(i) : VEHICLE_order(j))];
            p[j * (j + 1) / 2 + i] = value;
            w[j * (j + 1) / 2 + i] = value;
            if (!vehicle_finite(value)) { return VEHICLE_NOT_FINITE; }
        }
    }

    /* factor it: a pivot is zero up to round-off, or positive */
    for (int j = 5 - 1; j >= 0; j--) {
        const float round_off = 5.9604645e-7f * p[j * (j + 1) / 2 + j];
        const float pivot = w[j * (j + 1) / 2 + j];
        if (!(-round_off <= pivot)) { return VEHICLE_NOT_POSITIVE; }
        const float d = round_off < pivot ? pivot : 0.0f;
        w[j * (j + 1) / 2 + j] = d;
        for (int i = j - 1; i >= 0; i--) {
            const float rest = w[j * (j + 1) / 2 + i];
            if (d <= 0.0f && 2.3841858e-6f * p[j * (j + 1) / 2 + j] * p[i * (i + 1) / 2 + i] < rest
                * rest) {
                return VEHICLE_NOT_POSITIVE;
            }
            const float u = d > 0.0f ? rest / d : 0.0f;
            for (int k = 0; k < i + 1; k++) {
                w[i * (i + 1) / 2 + k] = w[i * (i + 1) / 2 + k] - u * w[j * (j + 1) / 2 + k];
            }
            w[j * (j + 1) / 2 + i] = u;
        }
    }

    /* store */
    for (int j = 0; j < 5; j++) {
        for (int i = 0; i < j; i++) {
            kf->U[j * (j - 1) / 2 + i] = w[j * (j + 1) / 2 + i];
        }
        kf->D[j] = w[j * (j + 1) / 2 + j];
    }
    return VEHICLE_OK;
}

void vehicle_get_covariance(const vehicle_t *kf, vehicle_real_t P[25])
{
    if (kf == NULL || P == NULL) { return; }
    for (int j = 0; j < 5; j++) {
        for (int i = 0; i < j + 1; i++) {
            float sum = kf->D[j];
            if (i < j) {
                sum = sum * kf->U[j * (j - 1) / 2 + i];
            }
            for (int k = j + 1; k < 5; k++) {
                sum = sum + kf->U[k * (k - 1) / 2 + i] * kf->D[k] * kf->U[k * (k - 1) / 2 + j];
            }
            const float value = sum;
            P[5 * VEHICLE_order(i) + VEHICLE_order(j)] = value;
            P[5 * VEHICLE_order(j) + VEHICLE_order(i)] = value;
        }
    }
}
/* kfgen: body f3a06fd3883170a543d54a4c4cfc9595 */
