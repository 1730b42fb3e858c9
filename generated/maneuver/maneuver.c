/* kfgen build maneuver.yaml */
#include "maneuver.h"

#include <math.h>

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "maneuver tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "maneuver tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool maneuver_finite(float a)
{
    const uint32_t exponent = 0x7f800000u;
    union { float value; uint32_t bits; } view;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

/* not 0 for what is below zero: a test without a branch */
static uint32_t maneuver_sign_bit(float a)
{
    union { float value; uint32_t bits; } view;
    view.value = a;
    return view.bits & 0x80000000u;
}

static float maneuver_min(float a, float b)
{
    return b < a ? b : a;
}

static float maneuver_max(float a, float b)
{
    return b > a ? b : a;
}

/* a in (-half, half], by whole turns of 2 half */
static float maneuver_wrap(float a, float half)
{
    if (a > half || a <= -half) {
        a -= (half + half) * ceilf((a - half) / (half + half));
        if (a > half || a <= -half) { a = half; } /* the last bit of a turn */
    }
    return a;
}

maneuver_status_t maneuver_init(maneuver_t *kf)
{
    if (kf == NULL) { return MANEUVER_NULL_ARGUMENT; }
    kf->x[MANEUVER_PX] = 8000.0f;
    kf->x[MANEUVER_PY] = 6000.0f;
    kf->x[MANEUVER_V] = 120.0f;
    kf->x[MANEUVER_TH] = 0.0f;
    kf->x[MANEUVER_A] = 0.0f;
    kf->x[MANEUVER_W] = 0.0f;
    kf->mu[MANEUVER_MODE_CRUISE] = 0.8f;
    kf->mu[MANEUVER_MODE_SPEED] = 0.1f;
    kf->mu[MANEUVER_MODE_TURN] = 0.1f;
    kf->modes.cruise.x[MANEUVER_PX] = 8000.0f;
    kf->modes.cruise.x[MANEUVER_PY] = 6000.0f;
    kf->modes.cruise.x[MANEUVER_V] = 120.0f;
    kf->modes.cruise.x[MANEUVER_TH] = 0.0f;
    kf->modes.cruise.x[MANEUVER_A] = 0.0f;
    kf->modes.cruise.x[MANEUVER_W] = 0.0f;
    kf->modes.cruise.P[0] = 40000.0f;
    kf->modes.cruise.P[1] = 0.0f;
    kf->modes.cruise.P[2] = 40000.0f;
    kf->modes.cruise.P[3] = 0.0f;
    kf->modes.cruise.P[4] = 0.0f;
    kf->modes.cruise.P[5] = 900.0f;
    kf->modes.cruise.P[6] = 0.0f;
    kf->modes.cruise.P[7] = 0.0f;
    kf->modes.cruise.P[8] = 0.0f;
    kf->modes.cruise.P[9] = 1.0f;
    for (int i = 10; i < 14; i++) {
        kf->modes.cruise.P[i] = 0.0f;
    }
    kf->modes.cruise.P[14] = 1.0f;
    for (int i = 15; i < 20; i++) {
        kf->modes.cruise.P[i] = 0.0f;
    }
    kf->modes.cruise.P[20] = 0.0025f;
    kf->modes.cruise.nis = 0.0f;
    kf->modes.speed.x[MANEUVER_PX] = 8000.0f;
    kf->modes.speed.x[MANEUVER_PY] = 6000.0f;
    kf->modes.speed.x[MANEUVER_V] = 120.0f;
    kf->modes.speed.x[MANEUVER_TH] = 0.0f;
    kf->modes.speed.x[MANEUVER_A] = 0.0f;
    kf->modes.speed.x[MANEUVER_W] = 0.0f;
    kf->modes.speed.P[0] = 40000.0f;
    kf->modes.speed.P[1] = 0.0f;
    kf->modes.speed.P[2] = 40000.0f;
    kf->modes.speed.P[3] = 0.0f;
    kf->modes.speed.P[4] = 0.0f;
    kf->modes.speed.P[5] = 900.0f;
    kf->modes.speed.P[6] = 0.0f;
    kf->modes.speed.P[7] = 0.0f;
    kf->modes.speed.P[8] = 0.0f;
    kf->modes.speed.P[9] = 1.0f;
    for (int i = 10; i < 14; i++) {
        kf->modes.speed.P[i] = 0.0f;
    }
    kf->modes.speed.P[14] = 1.0f;
    for (int i = 15; i < 20; i++) {
        kf->modes.speed.P[i] = 0.0f;
    }
    kf->modes.speed.P[20] = 0.0025f;
    kf->modes.speed.nis = 0.0f;
    kf->modes.turn.x[MANEUVER_PX] = 8000.0f;
    kf->modes.turn.x[MANEUVER_PY] = 6000.0f;
    kf->modes.turn.x[MANEUVER_V] = 120.0f;
    kf->modes.turn.x[MANEUVER_TH] = 0.0f;
    kf->modes.turn.x[MANEUVER_A] = 0.0f;
    kf->modes.turn.x[MANEUVER_W] = 0.0f;
    kf->modes.turn.P[0] = 40000.0f;
    kf->modes.turn.P[1] = 0.0f;
    kf->modes.turn.P[2] = 40000.0f;
    kf->modes.turn.P[3] = 0.0f;
    kf->modes.turn.P[4] = 0.0f;
    kf->modes.turn.P[5] = 900.0f;
    kf->modes.turn.P[6] = 0.0f;
    kf->modes.turn.P[7] = 0.0f;
    kf->modes.turn.P[8] = 0.0f;
    kf->modes.turn.P[9] = 1.0f;
    for (int i = 10; i < 14; i++) {
        kf->modes.turn.P[i] = 0.0f;
    }
    kf->modes.turn.P[14] = 1.0f;
    for (int i = 15; i < 20; i++) {
        kf->modes.turn.P[i] = 0.0f;
    }
    kf->modes.turn.P[20] = 0.0025f;
    kf->modes.turn.nis = 0.0f;
    kf->nis = 0.0f;
    kf->gate_count_radar = 0;
    return MANEUVER_OK;
}

/* Variances below zero: as large as rounding has left them, without correlations. all: none has
   any */
static maneuver_status_t maneuver_settle(maneuver_real_t P[21], int all)
{
    maneuver_status_t flags = MANEUVER_OK;
    for (int j = 0; j < 6; j++) {
        const float own = P[j * (j + 1) / 2 + j];
        if (own < 0.0f || all > 0) {
            for (int i = 0; i < 6; i++) {
                P[i < j ? j * (j + 1) / 2 + i : i * (i + 1) / 2 + j] = 0.0f;
            }
            P[j * (j + 1) / 2 + j] = fabsf(own);
            flags |= MANEUVER_REGULARIZED;
        }
    }
    return flags;
}

maneuver_status_t maneuver_predict(maneuver_t *kf)
{
    if (kf == NULL) { return MANEUVER_NULL_ARGUMENT; }
    maneuver_status_t flags = MANEUVER_OK;
    const float mu_cruise = kf->mu[MANEUVER_MODE_CRUISE];
    const float mu_speed = kf->mu[MANEUVER_MODE_SPEED];
    const float mu_turn = kf->mu[MANEUVER_MODE_TURN];

    /* probabilities after a switch, and of the mode before, given the mode now */
    const float t0 = 0.94f * mu_cruise;
    const float t1 = 0.05f * mu_speed;
    const float t2 = 0.05f * mu_turn;
    const float c_cruise = t0 + t1 + t2;
    const bool t3 = c_cruise > 1.1754944e-38f;
    const float t4 = t3 ? 1.0f / c_cruise : 0.0f;
    const float w_cruise_cruise = t3 ? t0 * t4 : 1.0f;
    const float w_speed_cruise = t3 ? t1 * t4 : 0.0f;
    const float w_turn_cruise = t3 ? t2 * t4 : 0.0f;
    const float t5 = 0.03f * mu_cruise;
    const float t6 = 0.95f * mu_speed;
    const float c_speed = t5 + t6;
    const bool t7 = c_speed > 1.1754944e-38f;
    const float t8 = t7 ? 1.0f / c_speed : 0.0f;
    const float w_cruise_speed = t7 ? t5 * t8 : 0.0f;
    const float w_speed_speed = t7 ? t6 * t8 : 1.0f;
    const float t9 = 0.95f * mu_turn;
    const float c_turn = t5 + t9;
    const bool t10 = c_turn > 1.1754944e-38f;
    const float t11 = t10 ? 1.0f / c_turn : 0.0f;
    const float w_cruise_turn = t10 ? t5 * t11 : 0.0f;
    const float w_turn_turn = t10 ? t9 * t11 : 1.0f;
    const float px_cruise = kf->modes.cruise.x[MANEUVER_PX];
    const float py_cruise = kf->modes.cruise.x[MANEUVER_PY];
    const float v_cruise = kf->modes.cruise.x[MANEUVER_V];
    const float th_cruise = kf->modes.cruise.x[MANEUVER_TH];
    const float a_cruise = kf->modes.cruise.x[MANEUVER_A];
    const float w_cruise = kf->modes.cruise.x[MANEUVER_W];
    const float px_speed = kf->modes.speed.x[MANEUVER_PX];
    const float py_speed = kf->modes.speed.x[MANEUVER_PY];
    const float v_speed = kf->modes.speed.x[MANEUVER_V];
    const float th_speed = kf->modes.speed.x[MANEUVER_TH];
    const float a_speed = kf->modes.speed.x[MANEUVER_A];
    const float w_speed = kf->modes.speed.x[MANEUVER_W];
    const float px_turn = kf->modes.turn.x[MANEUVER_PX];
    const float py_turn = kf->modes.turn.x[MANEUVER_PY];
    const float v_turn = kf->modes.turn.x[MANEUVER_V];
    const float th_turn = kf->modes.turn.x[MANEUVER_TH];
    const float a_turn = kf->modes.turn.x[MANEUVER_A];
    const float w_turn = kf->modes.turn.x[MANEUVER_W];

    /* cruise: where it starts from */
    const bool t12 = w_cruise_cruise < w_speed_cruise;
    const float th_base_cruise = (t12 ? w_speed_cruise : w_cruise_cruise) < w_turn_cruise ? th_turn
        : (t12 ? th_speed : th_cruise);
    const float t13 = maneuver_wrap(th_cruise - th_base_cruise, 3.1415927f);
    const float t14 = px_speed - px_cruise;
    const float t15 = py_speed - py_cruise;
    const float t16 = v_speed - v_cruise;
    const float t17 = a_speed - a_cruise;
    const float t18 = w_speed - w_cruise;
    const float t19 = px_turn - px_cruise;
    const float t20 = py_turn - py_cruise;
    const float t21 = v_turn - v_cruise;
    const float t22 = a_turn - a_cruise;
    const float t23 = w_turn - w_cruise;
    const float t24 = w_cruise_cruise + w_speed_cruise;
    const float t25 = w_speed_cruise * (t24 > 1.1754944e-38f ? 1.0f / t24 : 0.0f);
    const float t26 = maneuver_wrap(th_speed - th_base_cruise, 3.1415927f) - t13;
    const float t27 = w_cruise_cruise * t25;
    const float t28 = t25 * t14;
    const float t29 = t25 * t15;
    const float t30 = t25 * t16;
    const float t31 = t13 + t25 * t26;
    const float t32 = t25 * t17;
    const float t33 = t25 * t18;
    const float t34 = t19 - t28;
    const float t35 = t20 - t29;
    const float t36 = t21 - t30;
    const float t37 = maneuver_wrap(th_turn - th_base_cruise, 3.1415927f) - t31;
    const float t38 = t22 - t32;
    const float t39 = t23 - t33;
    const float t40 = t24 * w_turn_cruise;
    const float px_cruise_1 = px_cruise + t28 + w_turn_cruise * t34;
    const float py_cruise_1 = py_cruise + t29 + w_turn_cruise * t35;
    const float v_cruise_1 = v_cruise + t30 + w_turn_cruise * t36;
    const float a_cruise_1 = a_cruise + t32 + w_turn_cruise * t38;
    const float w_cruise_1 = w_cruise + t33 + w_turn_cruise * t39;
    const float th_cruise_1 = maneuver_wrap(th_base_cruise + t31 + w_turn_cruise * t37, 3.1415927f);
    const float t41 = t14 * t27;
    const float t42 = t34 * t40;
    const float p_px_px_cruise = kf->modes.cruise.P[0];
    const float p_px_px_speed = kf->modes.speed.P[0];
    const float p_px_px_turn = kf->modes.turn.P[0];
    const float p_px_px_next_cruise = w_cruise_cruise * p_px_px_cruise
        + w_speed_cruise * p_px_px_speed + w_turn_cruise * p_px_px_turn + t41 * t14 + t42 * t34;
    const float p_px_py_cruise = kf->modes.cruise.P[1];
    const float p_px_py_speed = kf->modes.speed.P[1];
    const float p_px_py_turn = kf->modes.turn.P[1];
    const float p_px_py_next_cruise = w_cruise_cruise * p_px_py_cruise
        + w_speed_cruise * p_px_py_speed + w_turn_cruise * p_px_py_turn + t41 * t15 + t42 * t35;
    const float t43 = t15 * t27;
    const float t44 = t35 * t40;
    const float p_py_py_cruise = kf->modes.cruise.P[2];
    const float p_py_py_speed = kf->modes.speed.P[2];
    const float p_py_py_turn = kf->modes.turn.P[2];
    const float p_py_py_next_cruise = w_cruise_cruise * p_py_py_cruise
        + w_speed_cruise * p_py_py_speed + w_turn_cruise * p_py_py_turn + t43 * t15 + t44 * t35;
    const float p_px_v_cruise = kf->modes.cruise.P[3];
    const float p_px_v_speed = kf->modes.speed.P[3];
    const float p_px_v_turn = kf->modes.turn.P[3];
    const float p_px_v_next_cruise = w_cruise_cruise * p_px_v_cruise + w_speed_cruise * p_px_v_speed
        + w_turn_cruise * p_px_v_turn + t41 * t16 + t42 * t36;
    const float p_py_v_cruise = kf->modes.cruise.P[4];
    const float p_py_v_speed = kf->modes.speed.P[4];
    const float p_py_v_turn = kf->modes.turn.P[4];
    const float p_py_v_next_cruise = w_cruise_cruise * p_py_v_cruise + w_speed_cruise * p_py_v_speed
        + w_turn_cruise * p_py_v_turn + t43 * t16 + t44 * t36;
    const float t45 = t16 * t27;
    const float t46 = t36 * t40;
    const float p_v_v_cruise = kf->modes.cruise.P[5];
    const float p_v_v_speed = kf->modes.speed.P[5];
    const float p_v_v_turn = kf->modes.turn.P[5];
    const float p_v_v_next_cruise = w_cruise_cruise * p_v_v_cruise + w_speed_cruise * p_v_v_speed
        + w_turn_cruise * p_v_v_turn + t45 * t16 + t46 * t36;
    const float p_px_th_cruise = kf->modes.cruise.P[6];
    const float p_px_th_speed = kf->modes.speed.P[6];
    const float p_px_th_turn = kf->modes.turn.P[6];
    const float p_px_th_next_cruise = w_cruise_cruise * p_px_th_cruise
        + w_speed_cruise * p_px_th_speed + w_turn_cruise * p_px_th_turn + t41 * t26 + t42 * t37;
    const float p_py_th_cruise = kf->modes.cruise.P[7];
    const float p_py_th_speed = kf->modes.speed.P[7];
    const float p_py_th_turn = kf->modes.turn.P[7];
    const float p_py_th_next_cruise = w_cruise_cruise * p_py_th_cruise
        + w_speed_cruise * p_py_th_speed + w_turn_cruise * p_py_th_turn + t43 * t26 + t44 * t37;
    const float p_v_th_cruise = kf->modes.cruise.P[8];
    const float p_v_th_speed = kf->modes.speed.P[8];
    const float p_v_th_turn = kf->modes.turn.P[8];
    const float p_v_th_next_cruise = w_cruise_cruise * p_v_th_cruise + w_speed_cruise * p_v_th_speed
        + w_turn_cruise * p_v_th_turn + t45 * t26 + t46 * t37;
    const float t47 = t26 * t27;
    const float t48 = t37 * t40;
    const float p_th_th_cruise = kf->modes.cruise.P[9];
    const float p_th_th_speed = kf->modes.speed.P[9];
    const float p_th_th_turn = kf->modes.turn.P[9];
    const float p_th_th_next_cruise = w_cruise_cruise * p_th_th_cruise
        + w_speed_cruise * p_th_th_speed + w_turn_cruise * p_th_th_turn + t47 * t26 + t48 * t37;
    const float p_px_a_cruise = kf->modes.cruise.P[10];
    const float p_px_a_speed = kf->modes.speed.P[10];
    const float p_px_a_turn = kf->modes.turn.P[10];
    const float p_px_a_next_cruise = w_cruise_cruise * p_px_a_cruise + w_speed_cruise * p_px_a_speed
        + w_turn_cruise * p_px_a_turn + t41 * t17 + t42 * t38;
    const float p_py_a_cruise = kf->modes.cruise.P[11];
    const float p_py_a_speed = kf->modes.speed.P[11];
    const float p_py_a_turn = kf->modes.turn.P[11];
    const float p_py_a_next_cruise = w_cruise_cruise * p_py_a_cruise + w_speed_cruise * p_py_a_speed
        + w_turn_cruise * p_py_a_turn + t43 * t17 + t44 * t38;
    const float p_v_a_cruise = kf->modes.cruise.P[12];
    const float p_v_a_speed = kf->modes.speed.P[12];
    const float p_v_a_turn = kf->modes.turn.P[12];
    const float p_v_a_next_cruise = w_cruise_cruise * p_v_a_cruise + w_speed_cruise * p_v_a_speed
        + w_turn_cruise * p_v_a_turn + t45 * t17 + t46 * t38;
    const float p_th_a_cruise = kf->modes.cruise.P[13];
    const float p_th_a_speed = kf->modes.speed.P[13];
    const float p_th_a_turn = kf->modes.turn.P[13];
    const float p_th_a_next_cruise = w_cruise_cruise * p_th_a_cruise + w_speed_cruise * p_th_a_speed
        + w_turn_cruise * p_th_a_turn + t47 * t17 + t48 * t38;
    const float t49 = t17 * t27;
    const float t50 = t38 * t40;
    const float p_a_a_cruise = kf->modes.cruise.P[14];
    const float p_a_a_speed = kf->modes.speed.P[14];
    const float p_a_a_turn = kf->modes.turn.P[14];
    const float p_a_a_next_cruise = w_cruise_cruise * p_a_a_cruise + w_speed_cruise * p_a_a_speed
        + w_turn_cruise * p_a_a_turn + t49 * t17 + t50 * t38;
    const float p_px_w_cruise = kf->modes.cruise.P[15];
    const float p_px_w_speed = kf->modes.speed.P[15];
    const float p_px_w_turn = kf->modes.turn.P[15];
    const float p_px_w_next_cruise = w_cruise_cruise * p_px_w_cruise + w_speed_cruise * p_px_w_speed
        + w_turn_cruise * p_px_w_turn + t41 * t18 + t42 * t39;
    const float p_py_w_cruise = kf->modes.cruise.P[16];
    const float p_py_w_speed = kf->modes.speed.P[16];
    const float p_py_w_turn = kf->modes.turn.P[16];
    const float p_py_w_next_cruise = w_cruise_cruise * p_py_w_cruise + w_speed_cruise * p_py_w_speed
        + w_turn_cruise * p_py_w_turn + t43 * t18 + t44 * t39;
    const float p_v_w_cruise = kf->modes.cruise.P[17];
    const float p_v_w_speed = kf->modes.speed.P[17];
    const float p_v_w_turn = kf->modes.turn.P[17];
    const float p_v_w_next_cruise = w_cruise_cruise * p_v_w_cruise + w_speed_cruise * p_v_w_speed
        + w_turn_cruise * p_v_w_turn + t45 * t18 + t46 * t39;
    const float p_th_w_cruise = kf->modes.cruise.P[18];
    const float p_th_w_speed = kf->modes.speed.P[18];
    const float p_th_w_turn = kf->modes.turn.P[18];
    const float p_th_w_next_cruise = w_cruise_cruise * p_th_w_cruise + w_speed_cruise * p_th_w_speed
        + w_turn_cruise * p_th_w_turn + t47 * t18 + t48 * t39;
    const float p_a_w_cruise = kf->modes.cruise.P[19];
    const float p_a_w_speed = kf->modes.speed.P[19];
    const float p_a_w_turn = kf->modes.turn.P[19];
    const float p_a_w_next_cruise = w_cruise_cruise * p_a_w_cruise + w_speed_cruise * p_a_w_speed
        + w_turn_cruise * p_a_w_turn + t49 * t18 + t50 * t39;
    const float p_w_w_cruise = kf->modes.cruise.P[20];
    const float p_w_w_speed = kf->modes.speed.P[20];
    const float p_w_w_turn = kf->modes.turn.P[20];
    const float p_w_w_next_cruise = w_cruise_cruise * p_w_w_cruise + w_speed_cruise * p_w_w_speed
        + w_turn_cruise * p_w_w_turn + t18 * t27 * t18 + t39 * t40 * t39;

    /* speed: where it starts from */
    const float th_base_speed = w_cruise_speed < w_speed_speed ? th_speed : th_cruise;
    const float t51 = maneuver_wrap(th_speed - th_base_speed, 3.1415927f);
    const float t52 = maneuver_wrap(th_cruise - th_base_speed, 3.1415927f) - t51;
    const float t53 = w_speed_speed * w_cruise_speed;
    const float px_speed_1 = px_speed - w_cruise_speed * t14;
    const float py_speed_1 = py_speed - w_cruise_speed * t15;
    const float v_speed_1 = v_speed - w_cruise_speed * t16;
    const float a_speed_1 = a_speed - w_cruise_speed * t17;
    const float w_speed_1 = w_speed - w_cruise_speed * t18;
    const float th_speed_1 = maneuver_wrap(th_base_speed + t51 + w_cruise_speed * t52, 3.1415927f);
    const float t54 = t14 * t53;
    const float p_px_px_next_speed = w_cruise_speed * p_px_px_cruise + w_speed_speed * p_px_px_speed
        + t54 * t14;
    const float p_px_py_next_speed = w_cruise_speed * p_px_py_cruise + w_speed_speed * p_px_py_speed
        + t54 * t15;
    const float t55 = t15 * t53;
    const float p_py_py_next_speed = w_cruise_speed * p_py_py_cruise + w_speed_speed * p_py_py_speed
        + t55 * t15;
    const float p_px_v_next_speed = w_cruise_speed * p_px_v_cruise + w_speed_speed * p_px_v_speed
        + t54 * t16;
    const float p_py_v_next_speed = w_cruise_speed * p_py_v_cruise + w_speed_speed * p_py_v_speed
        + t55 * t16;
    const float t56 = t16 * t53;
    const float p_v_v_next_speed = w_cruise_speed * p_v_v_cruise + w_speed_speed * p_v_v_speed
        + t56 * t16;
    const float p_px_th_next_speed = w_cruise_speed * p_px_th_cruise + w_speed_speed * p_px_th_speed
        - t54 * t52;
    const float p_py_th_next_speed = w_cruise_speed * p_py_th_cruise + w_speed_speed * p_py_th_speed
        - t55 * t52;
    const float p_v_th_next_speed = w_cruise_speed * p_v_th_cruise + w_speed_speed * p_v_th_speed
        - t56 * t52;
    const float t57 = t52 * t53;
    const float p_th_th_next_speed = w_cruise_speed * p_th_th_cruise + w_speed_speed * p_th_th_speed
        + t57 * t52;
    const float p_px_a_next_speed = w_cruise_speed * p_px_a_cruise + w_speed_speed * p_px_a_speed
        + t54 * t17;
    const float p_py_a_next_speed = w_cruise_speed * p_py_a_cruise + w_speed_speed * p_py_a_speed
        + t55 * t17;
    const float p_v_a_next_speed = w_cruise_speed * p_v_a_cruise + w_speed_speed * p_v_a_speed
        + t56 * t17;
    const float p_th_a_next_speed = w_cruise_speed * p_th_a_cruise + w_speed_speed * p_th_a_speed
        - t57 * t17;
    const float t58 = t17 * t53;
    const float p_a_a_next_speed = w_cruise_speed * p_a_a_cruise + w_speed_speed * p_a_a_speed
        + t58 * t17;
    const float p_px_w_next_speed = w_cruise_speed * p_px_w_cruise + w_speed_speed * p_px_w_speed
        + t54 * t18;
    const float p_py_w_next_speed = w_cruise_speed * p_py_w_cruise + w_speed_speed * p_py_w_speed
        + t55 * t18;
    const float p_v_w_next_speed = w_cruise_speed * p_v_w_cruise + w_speed_speed * p_v_w_speed
        + t56 * t18;
    const float p_th_w_next_speed = w_cruise_speed * p_th_w_cruise + w_speed_speed * p_th_w_speed
        - t57 * t18;
    const float p_a_w_next_speed = w_cruise_speed * p_a_w_cruise + w_speed_speed * p_a_w_speed
        + t58 * t18;
    const float p_w_w_next_speed = w_cruise_speed * p_w_w_cruise + w_speed_speed * p_w_w_speed
        + t18 * t53 * t18;

    /* turn: where it starts from */
    const float th_base_turn = w_cruise_turn < w_turn_turn ? th_turn : th_cruise;
    const float t59 = maneuver_wrap(th_turn - th_base_turn, 3.1415927f);
    const float t60 = maneuver_wrap(th_cruise - th_base_turn, 3.1415927f) - t59;
    const float t61 = w_turn_turn * w_cruise_turn;
    const float px_turn_1 = px_turn - w_cruise_turn * t19;
    const float py_turn_1 = py_turn - w_cruise_turn * t20;
    const float v_turn_1 = v_turn - w_cruise_turn * t21;
    const float a_turn_1 = a_turn - w_cruise_turn * t22;
    const float w_turn_1 = w_turn - w_cruise_turn * t23;
    const float th_turn_1 = maneuver_wrap(th_base_turn + t59 + w_cruise_turn * t60, 3.1415927f);
    const float t62 = t19 * t61;
    const float p_px_px_next_turn = w_cruise_turn * p_px_px_cruise + w_turn_turn * p_px_px_turn
        + t62 * t19;
    const float p_px_py_next_turn = w_cruise_turn * p_px_py_cruise + w_turn_turn * p_px_py_turn
        + t62 * t20;
    const float t63 = t20 * t61;
    const float p_py_py_next_turn = w_cruise_turn * p_py_py_cruise + w_turn_turn * p_py_py_turn
        + t63 * t20;
    const float p_px_v_next_turn = w_cruise_turn * p_px_v_cruise + w_turn_turn * p_px_v_turn
        + t62 * t21;
    const float p_py_v_next_turn = w_cruise_turn * p_py_v_cruise + w_turn_turn * p_py_v_turn
        + t63 * t21;
    const float t64 = t21 * t61;
    const float p_v_v_next_turn = w_cruise_turn * p_v_v_cruise + w_turn_turn * p_v_v_turn
        + t64 * t21;
    const float p_px_th_next_turn = w_cruise_turn * p_px_th_cruise + w_turn_turn * p_px_th_turn
        - t62 * t60;
    const float p_py_th_next_turn = w_cruise_turn * p_py_th_cruise + w_turn_turn * p_py_th_turn
        - t63 * t60;
    const float p_v_th_next_turn = w_cruise_turn * p_v_th_cruise + w_turn_turn * p_v_th_turn
        - t64 * t60;
    const float t65 = t60 * t61;
    const float p_th_th_next_turn = w_cruise_turn * p_th_th_cruise + w_turn_turn * p_th_th_turn
        + t65 * t60;
    const float p_px_a_next_turn = w_cruise_turn * p_px_a_cruise + w_turn_turn * p_px_a_turn
        + t62 * t22;
    const float p_py_a_next_turn = w_cruise_turn * p_py_a_cruise + w_turn_turn * p_py_a_turn
        + t63 * t22;
    const float p_v_a_next_turn = w_cruise_turn * p_v_a_cruise + w_turn_turn * p_v_a_turn
        + t64 * t22;
    const float p_th_a_next_turn = w_cruise_turn * p_th_a_cruise + w_turn_turn * p_th_a_turn
        - t65 * t22;
    const float t66 = t22 * t61;
    const float p_a_a_next_turn = w_cruise_turn * p_a_a_cruise + w_turn_turn * p_a_a_turn
        + t66 * t22;
    const float p_px_w_next_turn = w_cruise_turn * p_px_w_cruise + w_turn_turn * p_px_w_turn
        + t62 * t23;
    const float p_py_w_next_turn = w_cruise_turn * p_py_w_cruise + w_turn_turn * p_py_w_turn
        + t63 * t23;
    const float p_v_w_next_turn = w_cruise_turn * p_v_w_cruise + w_turn_turn * p_v_w_turn
        + t64 * t23;
    const float p_th_w_next_turn = w_cruise_turn * p_th_w_cruise + w_turn_turn * p_th_w_turn
        - t65 * t23;
    const float p_a_w_next_turn = w_cruise_turn * p_a_w_cruise + w_turn_turn * p_a_w_turn
        + t66 * t23;
    const float p_w_w_next_turn = w_cruise_turn * p_w_w_cruise + w_turn_turn * p_w_w_turn
        + t23 * t61 * t23;

    /* cruise: model */
    const float cos_th_cruise = cosf(th_cruise_1);
    const float f_py_th_cruise = v_cruise_1 * cos_th_cruise;
    const float px_next_cruise = px_cruise_1 + f_py_th_cruise;
    const float sin_th_cruise = sinf(th_cruise_1);
    const float t67 = v_cruise_1 * sin_th_cruise;
    const float py_next_cruise = py_cruise_1 + t67;
    const float a_next_cruise = 0.5f * a_cruise_1;
    const float w_next_cruise = 0.5f * w_cruise_1;

    /* cruise: P = F P F^T + Q: the diagonal first, for the guards */
    const float p_px_v_next_cruise_1 = p_px_v_next_cruise + p_v_v_next_cruise * cos_th_cruise
        - p_v_th_next_cruise * t67;
    const float p_px_th_next_cruise_1 = p_px_th_next_cruise + p_v_th_next_cruise * cos_th_cruise
        - p_th_th_next_cruise * t67;
    const float p_px_px_next_cruise_1 = p_px_px_next_cruise + p_px_v_next_cruise * cos_th_cruise
        - p_px_th_next_cruise * t67 + p_px_v_next_cruise_1 * cos_th_cruise
        - p_px_th_next_cruise_1 * t67 + 1.0f;
    const float p_py_v_next_cruise_1 = p_py_v_next_cruise + p_v_v_next_cruise * sin_th_cruise
        + p_v_th_next_cruise * f_py_th_cruise;
    const float p_py_th_next_cruise_1 = p_py_th_next_cruise + p_v_th_next_cruise * sin_th_cruise
        + p_th_th_next_cruise * f_py_th_cruise;
    const float p_py_py_next_cruise_1 = p_py_py_next_cruise + p_py_v_next_cruise * sin_th_cruise
        + p_py_th_next_cruise * f_py_th_cruise + p_py_v_next_cruise_1 * sin_th_cruise
        + p_py_th_next_cruise_1 * f_py_th_cruise + 1.0f;
    const float p_v_v_next_cruise_1 = p_v_v_next_cruise + 0.1f;
    const float p_th_th_next_cruise_1 = p_th_th_next_cruise + 0.00001f;
    const float p_a_a_next_cruise_1 = 0.25f * p_a_a_next_cruise + 0.1f;
    const float p_w_w_next_cruise_1 = 0.25f * p_w_w_next_cruise + 0.0001f;

    /* cruise: guards */
    if (!maneuver_finite(px_next_cruise + py_next_cruise + a_next_cruise + w_next_cruise
        + p_px_px_next_cruise_1 + p_py_py_next_cruise_1 + p_v_v_next_cruise_1
        + p_th_th_next_cruise_1 + p_a_a_next_cruise_1 + p_w_w_next_cruise_1)) {
        return MANEUVER_NOT_FINITE;
    }

    /* speed: model */
    const float t68 = v_speed_1 + 0.5f * a_speed_1;
    const float cos_th_speed = cosf(th_speed_1);
    const float f_py_th_speed = t68 * cos_th_speed;
    const float px_next_speed = px_speed_1 + f_py_th_speed;
    const float f_px_a_speed = 0.5f * cos_th_speed;
    const float sin_th_speed = sinf(th_speed_1);
    const float t69 = t68 * sin_th_speed;
    const float py_next_speed = py_speed_1 + t69;
    const float f_py_a_speed = 0.5f * sin_th_speed;
    const float v_next_speed = a_speed_1 + v_speed_1;
    const float w_next_speed = 0.5f * w_speed_1;

    /* speed: P = F P F^T + Q: the diagonal first, for the guards */
    const float t70 = p_px_v_next_speed + p_v_v_next_speed * cos_th_speed - p_v_th_next_speed * t69
        + p_v_a_next_speed * f_px_a_speed;
    const float p_px_th_next_speed_1 = p_px_th_next_speed + p_v_th_next_speed * cos_th_speed
        - p_th_th_next_speed * t69 + p_th_a_next_speed * f_px_a_speed;
    const float p_px_a_next_speed_1 = p_px_a_next_speed + p_v_a_next_speed * cos_th_speed
        - p_th_a_next_speed * t69 + p_a_a_next_speed * f_px_a_speed;
    const float p_px_px_next_speed_1 = p_px_px_next_speed + p_px_v_next_speed * cos_th_speed
        - p_px_th_next_speed * t69 + p_px_a_next_speed * f_px_a_speed + t70 * cos_th_speed
        - p_px_th_next_speed_1 * t69 + p_px_a_next_speed_1 * f_px_a_speed + 1.0f;
    const float t71 = p_py_v_next_speed + p_v_v_next_speed * sin_th_speed
        + p_v_th_next_speed * f_py_th_speed + p_v_a_next_speed * f_py_a_speed;
    const float p_py_th_next_speed_1 = p_py_th_next_speed + p_v_th_next_speed * sin_th_speed
        + p_th_th_next_speed * f_py_th_speed + p_th_a_next_speed * f_py_a_speed;
    const float p_py_a_next_speed_1 = p_py_a_next_speed + p_v_a_next_speed * sin_th_speed
        + p_th_a_next_speed * f_py_th_speed + p_a_a_next_speed * f_py_a_speed;
    const float p_py_py_next_speed_1 = p_py_py_next_speed + p_py_v_next_speed * sin_th_speed
        + p_py_th_next_speed * f_py_th_speed + p_py_a_next_speed * f_py_a_speed + t71 * sin_th_speed
        + p_py_th_next_speed_1 * f_py_th_speed + p_py_a_next_speed_1 * f_py_a_speed + 1.0f;
    const float p_v_a_next_speed_1 = p_v_a_next_speed + p_a_a_next_speed;
    const float p_v_v_next_speed_1 = p_v_v_next_speed + p_v_a_next_speed + p_v_a_next_speed_1
        + 0.1f;
    const float p_th_th_next_speed_1 = p_th_th_next_speed + 0.00001f;
    const float p_a_a_next_speed_1 = p_a_a_next_speed + 0.5f;
    const float p_w_w_next_speed_1 = 0.25f * p_w_w_next_speed + 0.0001f;

    /* speed: guards */
    if (!maneuver_finite(px_next_speed + py_next_speed + v_next_speed + w_next_speed
        + p_px_px_next_speed_1 + p_py_py_next_speed_1 + p_v_v_next_speed_1 + p_th_th_next_speed_1
        + p_a_a_next_speed_1 + p_w_w_next_speed_1)) {
        return MANEUVER_NOT_FINITE;
    }

    /* turn: model */
    const float t72 = th_turn_1 + 0.5f * w_turn_1;
    const float f_px_v_turn = cosf(t72);
    const float f_py_th_turn = v_turn_1 * f_px_v_turn;
    const float px_next_turn = px_turn_1 + f_py_th_turn;
    const float f_py_v_turn = sinf(t72);
    const float t73 = v_turn_1 * f_py_v_turn;
    const float t74 = 0.5f * t73;
    const float py_next_turn = py_turn_1 + t73;
    const float f_py_w_turn = 0.5f * f_py_th_turn;
    const float th_next_turn = th_turn_1 + w_turn_1;
    const float a_next_turn = 0.5f * a_turn_1;

    /* turn: P = F P F^T + Q: the diagonal first, for the guards */
    const float p_px_v_next_turn_1 = p_px_v_next_turn + p_v_v_next_turn * f_px_v_turn
        - p_v_th_next_turn * t73 - p_v_w_next_turn * t74;
    const float t75 = p_px_th_next_turn + p_v_th_next_turn * f_px_v_turn - p_th_th_next_turn * t73
        - p_th_w_next_turn * t74;
    const float p_px_w_next_turn_1 = p_px_w_next_turn + p_v_w_next_turn * f_px_v_turn
        - p_th_w_next_turn * t73 - p_w_w_next_turn * t74;
    const float p_px_px_next_turn_1 = p_px_px_next_turn + p_px_v_next_turn * f_px_v_turn
        - p_px_th_next_turn * t73 - p_px_w_next_turn * t74 + p_px_v_next_turn_1 * f_px_v_turn
        - t75 * t73 - p_px_w_next_turn_1 * t74 + 1.0f;
    const float p_py_v_next_turn_1 = p_py_v_next_turn + p_v_v_next_turn * f_py_v_turn
        + p_v_th_next_turn * f_py_th_turn + p_v_w_next_turn * f_py_w_turn;
    const float t76 = p_py_th_next_turn + p_v_th_next_turn * f_py_v_turn
        + p_th_th_next_turn * f_py_th_turn + p_th_w_next_turn * f_py_w_turn;
    const float p_py_w_next_turn_1 = p_py_w_next_turn + p_v_w_next_turn * f_py_v_turn
        + p_th_w_next_turn * f_py_th_turn + p_w_w_next_turn * f_py_w_turn;
    const float p_py_py_next_turn_1 = p_py_py_next_turn + p_py_v_next_turn * f_py_v_turn
        + p_py_th_next_turn * f_py_th_turn + p_py_w_next_turn * f_py_w_turn
        + p_py_v_next_turn_1 * f_py_v_turn + t76 * f_py_th_turn + p_py_w_next_turn_1 * f_py_w_turn
        + 1.0f;
    const float p_v_v_next_turn_1 = p_v_v_next_turn + 0.1f;
    const float p_th_w_next_turn_1 = p_th_w_next_turn + p_w_w_next_turn;
    const float p_th_th_next_turn_1 = p_th_th_next_turn + p_th_w_next_turn + p_th_w_next_turn_1
        + 0.00001f;
    const float p_a_a_next_turn_1 = 0.25f * p_a_a_next_turn + 0.1f;
    const float p_w_w_next_turn_1 = p_w_w_next_turn + 0.001f;
    const float t77 = maneuver_wrap(th_next_turn, 3.1415927f);

    /* turn: guards */
    if (!maneuver_finite(px_next_turn + py_next_turn + th_next_turn + a_next_turn
        + p_px_px_next_turn_1 + p_py_py_next_turn_1 + p_v_v_next_turn_1 + p_th_th_next_turn_1
        + p_a_a_next_turn_1 + p_w_w_next_turn_1)) {
        return MANEUVER_NOT_FINITE;
    }
    const float t78 = 1.0f / (c_cruise + c_speed + c_turn);
    const float mu_cruise_next = c_cruise * t78;
    const float mu_speed_next = c_speed * t78;
    const float mu_turn_next = c_turn * t78;

    /* combined state */
    const bool t79 = mu_cruise_next < mu_speed_next;
    const float th_base = (t79 ? mu_speed_next : mu_cruise_next) < mu_turn_next ? t77
        : (t79 ? th_speed_1 : th_cruise_1);
    const float t80 = maneuver_wrap(th_cruise_1 - th_base, 3.1415927f);
    const float t81 = mu_cruise_next + mu_speed_next;
    const float t82 = mu_speed_next * (t81 > 1.1754944e-38f ? 1.0f / t81 : 0.0f);
    const float t83 = t82 * (px_next_speed - px_next_cruise);
    const float t84 = t82 * (py_next_speed - py_next_cruise);
    const float t85 = t82 * (v_next_speed - v_cruise_1);
    const float t86 = t80 + t82 * (maneuver_wrap(th_speed_1 - th_base, 3.1415927f) - t80);
    const float t87 = t82 * (a_speed_1 - a_next_cruise);
    const float t88 = t82 * (w_next_speed - w_next_cruise);
    const float px_all = px_next_cruise + t83
        + mu_turn_next * (px_next_turn - px_next_cruise - t83);
    const float py_all = py_next_cruise + t84
        + mu_turn_next * (py_next_turn - py_next_cruise - t84);
    const float v_all = v_cruise_1 + t85 + mu_turn_next * (v_turn_1 - v_cruise_1 - t85);
    const float th_all = th_base + t86
        + mu_turn_next * (maneuver_wrap(t77 - th_base, 3.1415927f) - t86);
    const float a_all = a_next_cruise + t87 + mu_turn_next * (a_next_turn - a_next_cruise - t87);
    const float w_all = w_next_cruise + t88 + mu_turn_next * (w_turn_1 - w_next_cruise - t88);
    if (!maneuver_finite(px_all + py_all + v_all + th_all + a_all + w_all + mu_cruise_next
        + mu_speed_next + mu_turn_next)) {
        return MANEUVER_NOT_FINITE;
    }

    /* cruise: store */
    kf->modes.cruise.x[MANEUVER_PX] = px_next_cruise;
    kf->modes.cruise.x[MANEUVER_PY] = py_next_cruise;
    kf->modes.cruise.x[MANEUVER_V] = v_cruise_1;
    kf->modes.cruise.x[MANEUVER_TH] = th_cruise_1;
    kf->modes.cruise.x[MANEUVER_A] = a_next_cruise;
    kf->modes.cruise.x[MANEUVER_W] = w_next_cruise;
    const uint32_t signs_cruise = maneuver_sign_bit(p_px_px_next_cruise_1);
    kf->modes.cruise.P[0] = p_px_px_next_cruise_1;
    const float p_px_py_next_cruise_1 = p_px_py_next_cruise + p_px_v_next_cruise * sin_th_cruise
        + p_px_th_next_cruise * f_py_th_cruise + p_py_v_next_cruise_1 * cos_th_cruise
        - p_py_th_next_cruise_1 * t67;
    kf->modes.cruise.P[1] = p_px_py_next_cruise_1;
    const uint32_t signs_cruise_1 = signs_cruise | maneuver_sign_bit(p_py_py_next_cruise_1);
    kf->modes.cruise.P[2] = p_py_py_next_cruise_1;
    kf->modes.cruise.P[3] = p_px_v_next_cruise_1;
    kf->modes.cruise.P[4] = p_py_v_next_cruise_1;
    kf->modes.cruise.P[5] = p_v_v_next_cruise_1;
    kf->modes.cruise.P[6] = p_px_th_next_cruise_1;
    kf->modes.cruise.P[7] = p_py_th_next_cruise_1;
    kf->modes.cruise.P[8] = p_v_th_next_cruise;
    kf->modes.cruise.P[9] = p_th_th_next_cruise_1;
    const float p_px_a_next_cruise_1 =
        0.5f * (p_px_a_next_cruise + p_v_a_next_cruise * cos_th_cruise - p_th_a_next_cruise * t67);
    kf->modes.cruise.P[10] = p_px_a_next_cruise_1;
    const float p_py_a_next_cruise_1 =
        0.5f * (p_py_a_next_cruise + p_v_a_next_cruise * sin_th_cruise
        + p_th_a_next_cruise * f_py_th_cruise);
    kf->modes.cruise.P[11] = p_py_a_next_cruise_1;
    const float p_v_a_next_cruise_1 = 0.5f * p_v_a_next_cruise;
    kf->modes.cruise.P[12] = p_v_a_next_cruise_1;
    const float p_th_a_next_cruise_1 = 0.5f * p_th_a_next_cruise;
    kf->modes.cruise.P[13] = p_th_a_next_cruise_1;
    kf->modes.cruise.P[14] = p_a_a_next_cruise_1;
    const float p_px_w_next_cruise_1 =
        0.5f * (p_px_w_next_cruise + p_v_w_next_cruise * cos_th_cruise - p_th_w_next_cruise * t67);
    kf->modes.cruise.P[15] = p_px_w_next_cruise_1;
    const float p_py_w_next_cruise_1 =
        0.5f * (p_py_w_next_cruise + p_v_w_next_cruise * sin_th_cruise
        + p_th_w_next_cruise * f_py_th_cruise);
    kf->modes.cruise.P[16] = p_py_w_next_cruise_1;
    const float p_v_w_next_cruise_1 = 0.5f * p_v_w_next_cruise;
    kf->modes.cruise.P[17] = p_v_w_next_cruise_1;
    const float p_th_w_next_cruise_1 = 0.5f * p_th_w_next_cruise;
    kf->modes.cruise.P[18] = p_th_w_next_cruise_1;
    const float p_a_w_next_cruise_1 = 0.25f * p_a_w_next_cruise;
    kf->modes.cruise.P[19] = p_a_w_next_cruise_1;
    kf->modes.cruise.P[20] = p_w_w_next_cruise_1;

    /* speed: store */
    kf->modes.speed.x[MANEUVER_PX] = px_next_speed;
    kf->modes.speed.x[MANEUVER_PY] = py_next_speed;
    kf->modes.speed.x[MANEUVER_V] = v_next_speed;
    kf->modes.speed.x[MANEUVER_TH] = th_speed_1;
    kf->modes.speed.x[MANEUVER_A] = a_speed_1;
    kf->modes.speed.x[MANEUVER_W] = w_next_speed;
    const uint32_t signs_speed = maneuver_sign_bit(p_px_px_next_speed_1);
    kf->modes.speed.P[0] = p_px_px_next_speed_1;
    const float p_px_py_next_speed_1 = p_px_py_next_speed + p_px_v_next_speed * sin_th_speed
        + p_px_th_next_speed * f_py_th_speed + p_px_a_next_speed * f_py_a_speed + t71 * cos_th_speed
        - p_py_th_next_speed_1 * t69 + p_py_a_next_speed_1 * f_px_a_speed;
    kf->modes.speed.P[1] = p_px_py_next_speed_1;
    const uint32_t signs_speed_1 = signs_speed | maneuver_sign_bit(p_py_py_next_speed_1);
    kf->modes.speed.P[2] = p_py_py_next_speed_1;
    const float p_px_v_next_speed_1 = t70 + p_px_a_next_speed_1;
    kf->modes.speed.P[3] = p_px_v_next_speed_1;
    const float p_py_v_next_speed_1 = t71 + p_py_a_next_speed_1;
    kf->modes.speed.P[4] = p_py_v_next_speed_1;
    const uint32_t signs_speed_2 = signs_speed_1 | maneuver_sign_bit(p_v_v_next_speed_1);
    kf->modes.speed.P[5] = p_v_v_next_speed_1;
    kf->modes.speed.P[6] = p_px_th_next_speed_1;
    kf->modes.speed.P[7] = p_py_th_next_speed_1;
    const float p_v_th_next_speed_1 = p_v_th_next_speed + p_th_a_next_speed;
    kf->modes.speed.P[8] = p_v_th_next_speed_1;
    kf->modes.speed.P[9] = p_th_th_next_speed_1;
    kf->modes.speed.P[10] = p_px_a_next_speed_1;
    kf->modes.speed.P[11] = p_py_a_next_speed_1;
    kf->modes.speed.P[12] = p_v_a_next_speed_1;
    kf->modes.speed.P[13] = p_th_a_next_speed;
    kf->modes.speed.P[14] = p_a_a_next_speed_1;
    const float p_px_w_next_speed_1 =
        0.5f * (p_px_w_next_speed + p_v_w_next_speed * cos_th_speed - p_th_w_next_speed * t69
        + p_a_w_next_speed * f_px_a_speed);
    kf->modes.speed.P[15] = p_px_w_next_speed_1;
    const float p_py_w_next_speed_1 =
        0.5f * (p_py_w_next_speed + p_v_w_next_speed * sin_th_speed
        + p_th_w_next_speed * f_py_th_speed + p_a_w_next_speed * f_py_a_speed);
    kf->modes.speed.P[16] = p_py_w_next_speed_1;
    const float p_v_w_next_speed_1 = 0.5f * (p_v_w_next_speed + p_a_w_next_speed);
    kf->modes.speed.P[17] = p_v_w_next_speed_1;
    const float p_th_w_next_speed_1 = 0.5f * p_th_w_next_speed;
    kf->modes.speed.P[18] = p_th_w_next_speed_1;
    const float p_a_w_next_speed_1 = 0.5f * p_a_w_next_speed;
    kf->modes.speed.P[19] = p_a_w_next_speed_1;
    kf->modes.speed.P[20] = p_w_w_next_speed_1;

    /* turn: store */
    kf->modes.turn.x[MANEUVER_PX] = px_next_turn;
    kf->modes.turn.x[MANEUVER_PY] = py_next_turn;
    kf->modes.turn.x[MANEUVER_V] = v_turn_1;
    kf->modes.turn.x[MANEUVER_TH] = t77;
    kf->modes.turn.x[MANEUVER_A] = a_next_turn;
    kf->modes.turn.x[MANEUVER_W] = w_turn_1;
    const uint32_t signs_turn = maneuver_sign_bit(p_px_px_next_turn_1);
    kf->modes.turn.P[0] = p_px_px_next_turn_1;
    const float p_px_py_next_turn_1 = p_px_py_next_turn + p_px_v_next_turn * f_py_v_turn
        + p_px_th_next_turn * f_py_th_turn + p_px_w_next_turn * f_py_w_turn
        + p_py_v_next_turn_1 * f_px_v_turn - t76 * t73 - p_py_w_next_turn_1 * t74;
    kf->modes.turn.P[1] = p_px_py_next_turn_1;
    const uint32_t signs_turn_1 = signs_turn | maneuver_sign_bit(p_py_py_next_turn_1);
    kf->modes.turn.P[2] = p_py_py_next_turn_1;
    kf->modes.turn.P[3] = p_px_v_next_turn_1;
    kf->modes.turn.P[4] = p_py_v_next_turn_1;
    kf->modes.turn.P[5] = p_v_v_next_turn_1;
    const float p_px_th_next_turn_1 = t75 + p_px_w_next_turn_1;
    kf->modes.turn.P[6] = p_px_th_next_turn_1;
    const float p_py_th_next_turn_1 = t76 + p_py_w_next_turn_1;
    kf->modes.turn.P[7] = p_py_th_next_turn_1;
    const float p_v_th_next_turn_1 = p_v_th_next_turn + p_v_w_next_turn;
    kf->modes.turn.P[8] = p_v_th_next_turn_1;
    const uint32_t signs_turn_2 = signs_turn_1 | maneuver_sign_bit(p_th_th_next_turn_1);
    kf->modes.turn.P[9] = p_th_th_next_turn_1;
    const float p_px_a_next_turn_1 = 0.5f
        * (p_px_a_next_turn + p_v_a_next_turn * f_px_v_turn - p_th_a_next_turn * t73
        - p_a_w_next_turn * t74);
    kf->modes.turn.P[10] = p_px_a_next_turn_1;
    const float p_py_a_next_turn_1 = 0.5f
        * (p_py_a_next_turn + p_v_a_next_turn * f_py_v_turn + p_th_a_next_turn * f_py_th_turn
        + p_a_w_next_turn * f_py_w_turn);
    kf->modes.turn.P[11] = p_py_a_next_turn_1;
    const float p_v_a_next_turn_1 = 0.5f * p_v_a_next_turn;
    kf->modes.turn.P[12] = p_v_a_next_turn_1;
    const float p_th_a_next_turn_1 = 0.5f * (p_th_a_next_turn + p_a_w_next_turn);
    kf->modes.turn.P[13] = p_th_a_next_turn_1;
    kf->modes.turn.P[14] = p_a_a_next_turn_1;
    kf->modes.turn.P[15] = p_px_w_next_turn_1;
    kf->modes.turn.P[16] = p_py_w_next_turn_1;
    kf->modes.turn.P[17] = p_v_w_next_turn;
    kf->modes.turn.P[18] = p_th_w_next_turn_1;
    const float p_a_w_next_turn_1 = 0.5f * p_a_w_next_turn;
    kf->modes.turn.P[19] = p_a_w_next_turn_1;
    kf->modes.turn.P[20] = p_w_w_next_turn_1;

    /* store: the bank */
    kf->mu[MANEUVER_MODE_CRUISE] = mu_cruise_next;
    kf->mu[MANEUVER_MODE_SPEED] = mu_speed_next;
    kf->mu[MANEUVER_MODE_TURN] = mu_turn_next;
    kf->x[MANEUVER_PX] = px_all;
    kf->x[MANEUVER_PY] = py_all;
    kf->x[MANEUVER_V] = v_all;
    kf->x[MANEUVER_TH] = maneuver_wrap(th_all, 3.1415927f);
    kf->x[MANEUVER_A] = a_all;
    kf->x[MANEUVER_W] = w_all;
    if (signs_cruise_1 != 0u) {
        flags |= maneuver_settle(kf->modes.cruise.P, 0);
    }
    if (signs_speed_2 != 0u) {
        flags |= maneuver_settle(kf->modes.speed.P, 0);
    }
    if (signs_turn_2 != 0u) {
        flags |= maneuver_settle(kf->modes.turn.P, 0);
    }
    return flags;
}

maneuver_status_t maneuver_update_radar(maneuver_t *kf, const maneuver_radar_t *z)
{
    if (kf == NULL || z == NULL) { return MANEUVER_NULL_ARGUMENT; }
    maneuver_status_t flags = MANEUVER_OK;

    /* cruise: innovation */
    const float px_cruise = kf->modes.cruise.x[MANEUVER_PX];
    const float py_cruise = kf->modes.cruise.x[MANEUVER_PY];
    const float t0 = px_cruise * px_cruise + py_cruise * py_cruise;
    const float h_range_cruise = sqrtf(t0);
    const float t1 = h_range_cruise > 0.0f ? 1.0f / h_range_cruise : 0.0f;
    const float h_range_px_cruise = px_cruise * t1;
    const float h_range_py_cruise = py_cruise * t1;
    const float h_bearing_cruise = atan2f(py_cruise, px_cruise);
    const float t2 = t0 > 0.0f ? 1.0f / t0 : 0.0f;
    const float t3 = py_cruise * t2;
    const float h_bearing_py_cruise = px_cruise * t2;
    const float y_range_cruise = z->range - h_range_cruise;
    const float t4 = z->bearing - h_bearing_cruise;
    const float y_bearing_cruise = maneuver_wrap(t4, 3.1415927f);

    /* cruise: gain and covariance: range */
    const float p_px_px_cruise = kf->modes.cruise.P[0];
    const float p_px_py_cruise = kf->modes.cruise.P[1];
    const float t5 = p_px_px_cruise * h_range_px_cruise + p_px_py_cruise * h_range_py_cruise;
    const float p_py_py_cruise = kf->modes.cruise.P[2];
    const float t6 = p_px_py_cruise * h_range_px_cruise + p_py_py_cruise * h_range_py_cruise;
    const float p_px_v_cruise = kf->modes.cruise.P[3];
    const float p_py_v_cruise = kf->modes.cruise.P[4];
    const float t7 = p_px_v_cruise * h_range_px_cruise + p_py_v_cruise * h_range_py_cruise;
    const float p_px_th_cruise = kf->modes.cruise.P[6];
    const float p_py_th_cruise = kf->modes.cruise.P[7];
    const float t8 = p_px_th_cruise * h_range_px_cruise + p_py_th_cruise * h_range_py_cruise;
    const float p_px_a_cruise = kf->modes.cruise.P[10];
    const float p_py_a_cruise = kf->modes.cruise.P[11];
    const float t9 = p_px_a_cruise * h_range_px_cruise + p_py_a_cruise * h_range_py_cruise;
    const float p_px_w_cruise = kf->modes.cruise.P[15];
    const float p_py_w_cruise = kf->modes.cruise.P[16];
    const float t10 = p_px_w_cruise * h_range_px_cruise + p_py_w_cruise * h_range_py_cruise;
    const float s_range_cruise = h_range_px_cruise * t5 + h_range_py_cruise * t6 + 400.0f;
    const float t11 = 0.9999995f / s_range_cruise;
    const float t12 = t5 * t11;
    const float t13 = t6 * t11;
    const float t14 = t7 * t11;
    const float t15 = t8 * t11;
    const float t16 = t9 * t11;
    const float t17 = t10 * t11;
    const float t18 = t12 * y_range_cruise;
    const float t19 = t13 * y_range_cruise;
    const float t20 = y_range_cruise * (y_range_cruise * t11);

    /* cruise: gain and covariance: bearing */
    const float t21 = p_px_px_cruise - t12 * t5;
    const float t22 = p_px_py_cruise - t12 * t6;
    const float t23 = t22 * h_bearing_py_cruise - t21 * t3;
    const float t24 = p_py_py_cruise - t13 * t6;
    const float t25 = t24 * h_bearing_py_cruise - t22 * t3;
    const float t26 = p_px_v_cruise - t12 * t7;
    const float t27 = p_py_v_cruise - t13 * t7;
    const float t28 = t27 * h_bearing_py_cruise - t26 * t3;
    const float t29 = p_px_th_cruise - t12 * t8;
    const float t30 = p_py_th_cruise - t13 * t8;
    const float t31 = t30 * h_bearing_py_cruise - t29 * t3;
    const float t32 = p_px_a_cruise - t12 * t9;
    const float t33 = p_py_a_cruise - t13 * t9;
    const float t34 = t33 * h_bearing_py_cruise - t32 * t3;
    const float t35 = p_px_w_cruise - t12 * t10;
    const float t36 = p_py_w_cruise - t13 * t10;
    const float t37 = t36 * h_bearing_py_cruise - t35 * t3;
    const float s_bearing_cruise = h_bearing_py_cruise * t25 - t3 * t23 + 1.0e-6f;
    const float t38 = 0.9999995f / s_bearing_cruise;
    const float t39 = t23 * t38;
    const float t40 = t25 * t38;
    const float t41 = t28 * t38;
    const float t42 = t31 * t38;
    const float t43 = t34 * t38;
    const float t44 = t37 * t38;
    const float nu_bearing_cruise = y_bearing_cruise - h_bearing_py_cruise * t19 + t3 * t18;
    const float t45 = nu_bearing_cruise * (nu_bearing_cruise * t38);
    const float nis_cruise = t20 + t45;

    /* cruise: state and innovation squared */
    const float t46 = 0.5f * (t20 + logf(s_range_cruise) + 1.837877f + t45 + logf(s_bearing_cruise)
        + 1.837877f);
    const float l_cruise = -t46;
    const float px_next_cruise = px_cruise + t18 + t39 * nu_bearing_cruise;
    const float py_next_cruise = py_cruise + t19 + t40 * nu_bearing_cruise;
    const float v_next_cruise = kf->modes.cruise.x[MANEUVER_V] + t14 * y_range_cruise
        + t41 * nu_bearing_cruise;
    const float th_next_cruise = kf->modes.cruise.x[MANEUVER_TH] + t15 * y_range_cruise
        + t42 * nu_bearing_cruise;
    const float a_next_cruise = kf->modes.cruise.x[MANEUVER_A] + t16 * y_range_cruise
        + t43 * nu_bearing_cruise;
    const float w_next_cruise = kf->modes.cruise.x[MANEUVER_W] + t17 * y_range_cruise
        + t44 * nu_bearing_cruise;
    const float t47 = maneuver_wrap(th_next_cruise, 3.1415927f);

    /* cruise: guards */
    if (!maneuver_finite(y_range_cruise + t4 + s_range_cruise + s_bearing_cruise)) {
        return MANEUVER_NOT_FINITE;
    }
    if (s_range_cruise < 200.0f || s_bearing_cruise < 5.0e-7f) {
        flags |= maneuver_settle(kf->modes.cruise.P, 1);
        return flags;
    }

    /* speed: innovation */
    const float px_speed = kf->modes.speed.x[MANEUVER_PX];
    const float py_speed = kf->modes.speed.x[MANEUVER_PY];
    const float t48 = px_speed * px_speed + py_speed * py_speed;
    const float h_range_speed = sqrtf(t48);
    const float t49 = h_range_speed > 0.0f ? 1.0f / h_range_speed : 0.0f;
    const float h_range_px_speed = px_speed * t49;
    const float h_range_py_speed = py_speed * t49;
    const float h_bearing_speed = atan2f(py_speed, px_speed);
    const float t50 = t48 > 0.0f ? 1.0f / t48 : 0.0f;
    const float t51 = py_speed * t50;
    const float h_bearing_py_speed = px_speed * t50;
    const float y_range_speed = z->range - h_range_speed;
    const float t52 = z->bearing - h_bearing_speed;
    const float y_bearing_speed = maneuver_wrap(t52, 3.1415927f);

    /* speed: gain and covariance: range */
    const float p_px_px_speed = kf->modes.speed.P[0];
    const float p_px_py_speed = kf->modes.speed.P[1];
    const float t53 = p_px_px_speed * h_range_px_speed + p_px_py_speed * h_range_py_speed;
    const float p_py_py_speed = kf->modes.speed.P[2];
    const float t54 = p_px_py_speed * h_range_px_speed + p_py_py_speed * h_range_py_speed;
    const float p_px_v_speed = kf->modes.speed.P[3];
    const float p_py_v_speed = kf->modes.speed.P[4];
    const float t55 = p_px_v_speed * h_range_px_speed + p_py_v_speed * h_range_py_speed;
    const float p_px_th_speed = kf->modes.speed.P[6];
    const float p_py_th_speed = kf->modes.speed.P[7];
    const float t56 = p_px_th_speed * h_range_px_speed + p_py_th_speed * h_range_py_speed;
    const float p_px_a_speed = kf->modes.speed.P[10];
    const float p_py_a_speed = kf->modes.speed.P[11];
    const float t57 = p_px_a_speed * h_range_px_speed + p_py_a_speed * h_range_py_speed;
    const float p_px_w_speed = kf->modes.speed.P[15];
    const float p_py_w_speed = kf->modes.speed.P[16];
    const float t58 = p_px_w_speed * h_range_px_speed + p_py_w_speed * h_range_py_speed;
    const float s_range_speed = h_range_px_speed * t53 + h_range_py_speed * t54 + 400.0f;
    const float t59 = 0.9999995f / s_range_speed;
    const float t60 = t53 * t59;
    const float t61 = t54 * t59;
    const float t62 = t55 * t59;
    const float t63 = t56 * t59;
    const float t64 = t57 * t59;
    const float t65 = t58 * t59;
    const float t66 = t60 * y_range_speed;
    const float t67 = t61 * y_range_speed;
    const float t68 = y_range_speed * (y_range_speed * t59);

    /* speed: gain and covariance: bearing */
    const float t69 = p_px_px_speed - t60 * t53;
    const float t70 = p_px_py_speed - t60 * t54;
    const float t71 = t70 * h_bearing_py_speed - t69 * t51;
    const float t72 = p_py_py_speed - t61 * t54;
    const float t73 = t72 * h_bearing_py_speed - t70 * t51;
    const float t74 = p_px_v_speed - t60 * t55;
    const float t75 = p_py_v_speed - t61 * t55;
    const float t76 = t75 * h_bearing_py_speed - t74 * t51;
    const float t77 = p_px_th_speed - t60 * t56;
    const float t78 = p_py_th_speed - t61 * t56;
    const float t79 = t78 * h_bearing_py_speed - t77 * t51;
    const float t80 = p_px_a_speed - t60 * t57;
    const float t81 = p_py_a_speed - t61 * t57;
    const float t82 = t81 * h_bearing_py_speed - t80 * t51;
    const float t83 = p_px_w_speed - t60 * t58;
    const float t84 = p_py_w_speed - t61 * t58;
    const float t85 = t84 * h_bearing_py_speed - t83 * t51;
    const float s_bearing_speed = h_bearing_py_speed * t73 - t51 * t71 + 1.0e-6f;
    const float t86 = 0.9999995f / s_bearing_speed;
    const float t87 = t71 * t86;
    const float t88 = t73 * t86;
    const float t89 = t76 * t86;
    const float t90 = t79 * t86;
    const float t91 = t82 * t86;
    const float t92 = t85 * t86;
    const float nu_bearing_speed = y_bearing_speed - h_bearing_py_speed * t67 + t51 * t66;
    const float t93 = nu_bearing_speed * (nu_bearing_speed * t86);
    const float nis_speed = t68 + t93;

    /* speed: state and innovation squared */
    const float t94 = 0.5f * (t68 + logf(s_range_speed) + 1.837877f + t93 + logf(s_bearing_speed)
        + 1.837877f);
    const float l_speed = -t94;
    const float px_next_speed = px_speed + t66 + t87 * nu_bearing_speed;
    const float py_next_speed = py_speed + t67 + t88 * nu_bearing_speed;
    const float v_next_speed = kf->modes.speed.x[MANEUVER_V] + t62 * y_range_speed
        + t89 * nu_bearing_speed;
    const float th_next_speed = kf->modes.speed.x[MANEUVER_TH] + t63 * y_range_speed
        + t90 * nu_bearing_speed;
    const float a_next_speed = kf->modes.speed.x[MANEUVER_A] + t64 * y_range_speed
        + t91 * nu_bearing_speed;
    const float w_next_speed = kf->modes.speed.x[MANEUVER_W] + t65 * y_range_speed
        + t92 * nu_bearing_speed;
    const float t95 = maneuver_wrap(th_next_speed, 3.1415927f);

    /* speed: guards */
    if (!maneuver_finite(y_range_speed + t52 + s_range_speed + s_bearing_speed)) {
        return MANEUVER_NOT_FINITE;
    }
    if (s_range_speed < 200.0f || s_bearing_speed < 5.0e-7f) {
        flags |= maneuver_settle(kf->modes.speed.P, 1);
        return flags;
    }

    /* turn: innovation */
    const float px_turn = kf->modes.turn.x[MANEUVER_PX];
    const float py_turn = kf->modes.turn.x[MANEUVER_PY];
    const float t96 = px_turn * px_turn + py_turn * py_turn;
    const float h_range_turn = sqrtf(t96);
    const float t97 = h_range_turn > 0.0f ? 1.0f / h_range_turn : 0.0f;
    const float h_range_px_turn = px_turn * t97;
    const float h_range_py_turn = py_turn * t97;
    const float h_bearing_turn = atan2f(py_turn, px_turn);
    const float t98 = t96 > 0.0f ? 1.0f / t96 : 0.0f;
    const float t99 = py_turn * t98;
    const float h_bearing_py_turn = px_turn * t98;
    const float y_range_turn = z->range - h_range_turn;
    const float t100 = z->bearing - h_bearing_turn;
    const float y_bearing_turn = maneuver_wrap(t100, 3.1415927f);

    /* turn: gain and covariance: range */
    const float p_px_px_turn = kf->modes.turn.P[0];
    const float p_px_py_turn = kf->modes.turn.P[1];
    const float t101 = p_px_px_turn * h_range_px_turn + p_px_py_turn * h_range_py_turn;
    const float p_py_py_turn = kf->modes.turn.P[2];
    const float t102 = p_px_py_turn * h_range_px_turn + p_py_py_turn * h_range_py_turn;
    const float p_px_v_turn = kf->modes.turn.P[3];
    const float p_py_v_turn = kf->modes.turn.P[4];
    const float t103 = p_px_v_turn * h_range_px_turn + p_py_v_turn * h_range_py_turn;
    const float p_px_th_turn = kf->modes.turn.P[6];
    const float p_py_th_turn = kf->modes.turn.P[7];
    const float t104 = p_px_th_turn * h_range_px_turn + p_py_th_turn * h_range_py_turn;
    const float p_px_a_turn = kf->modes.turn.P[10];
    const float p_py_a_turn = kf->modes.turn.P[11];
    const float t105 = p_px_a_turn * h_range_px_turn + p_py_a_turn * h_range_py_turn;
    const float p_px_w_turn = kf->modes.turn.P[15];
    const float p_py_w_turn = kf->modes.turn.P[16];
    const float t106 = p_px_w_turn * h_range_px_turn + p_py_w_turn * h_range_py_turn;
    const float s_range_turn = h_range_px_turn * t101 + h_range_py_turn * t102 + 400.0f;
    const float t107 = 0.9999995f / s_range_turn;
    const float t108 = t101 * t107;
    const float t109 = t102 * t107;
    const float t110 = t103 * t107;
    const float t111 = t104 * t107;
    const float t112 = t105 * t107;
    const float t113 = t106 * t107;
    const float t114 = t108 * y_range_turn;
    const float t115 = t109 * y_range_turn;
    const float t116 = y_range_turn * (y_range_turn * t107);

    /* turn: gain and covariance: bearing */
    const float t117 = p_px_px_turn - t108 * t101;
    const float t118 = p_px_py_turn - t108 * t102;
    const float t119 = t118 * h_bearing_py_turn - t117 * t99;
    const float t120 = p_py_py_turn - t109 * t102;
    const float t121 = t120 * h_bearing_py_turn - t118 * t99;
    const float t122 = p_px_v_turn - t108 * t103;
    const float t123 = p_py_v_turn - t109 * t103;
    const float t124 = t123 * h_bearing_py_turn - t122 * t99;
    const float t125 = p_px_th_turn - t108 * t104;
    const float t126 = p_py_th_turn - t109 * t104;
    const float t127 = t126 * h_bearing_py_turn - t125 * t99;
    const float t128 = p_px_a_turn - t108 * t105;
    const float t129 = p_py_a_turn - t109 * t105;
    const float t130 = t129 * h_bearing_py_turn - t128 * t99;
    const float t131 = p_px_w_turn - t108 * t106;
    const float t132 = p_py_w_turn - t109 * t106;
    const float t133 = t132 * h_bearing_py_turn - t131 * t99;
    const float s_bearing_turn = h_bearing_py_turn * t121 - t99 * t119 + 1.0e-6f;
    const float t134 = 0.9999995f / s_bearing_turn;
    const float t135 = t119 * t134;
    const float t136 = t121 * t134;
    const float t137 = t124 * t134;
    const float t138 = t127 * t134;
    const float t139 = t130 * t134;
    const float t140 = t133 * t134;
    const float nu_bearing_turn = y_bearing_turn - h_bearing_py_turn * t115 + t99 * t114;
    const float t141 = nu_bearing_turn * (nu_bearing_turn * t134);
    const float nis_turn = t116 + t141;

    /* turn: state and innovation squared */
    const float t142 = 0.5f * (t116 + logf(s_range_turn) + 1.837877f + t141 + logf(s_bearing_turn)
        + 1.837877f);
    const float l_turn = -t142;
    const float px_next_turn = px_turn + t114 + t135 * nu_bearing_turn;
    const float py_next_turn = py_turn + t115 + t136 * nu_bearing_turn;
    const float v_next_turn = kf->modes.turn.x[MANEUVER_V] + t110 * y_range_turn
        + t137 * nu_bearing_turn;
    const float th_next_turn = kf->modes.turn.x[MANEUVER_TH] + t111 * y_range_turn
        + t138 * nu_bearing_turn;
    const float a_next_turn = kf->modes.turn.x[MANEUVER_A] + t112 * y_range_turn
        + t139 * nu_bearing_turn;
    const float w_next_turn = kf->modes.turn.x[MANEUVER_W] + t113 * y_range_turn
        + t140 * nu_bearing_turn;
    const float t143 = maneuver_wrap(th_next_turn, 3.1415927f);

    /* turn: guards */
    if (!maneuver_finite(y_range_turn + t100 + s_range_turn + s_bearing_turn)) {
        return MANEUVER_NOT_FINITE;
    }
    if (s_range_turn < 200.0f || s_bearing_turn < 5.0e-7f) {
        flags |= maneuver_settle(kf->modes.turn.P, 1);
        return flags;
    }

    /* gate */
    const bool t144 = nis_cruise > 18.420681f && nis_speed > 18.420681f && nis_turn > 18.420681f;
    const float t145 = maneuver_min(maneuver_min(nis_cruise, nis_speed), nis_turn);
    if (t144 && kf->gate_count_radar < 3u) {
        kf->nis = t145;
        kf->gate_count_radar = kf->gate_count_radar + 1u;
        return MANEUVER_GATED;
    }
    if (t144) { flags |= MANEUVER_ANOMALY; }
    if (!maneuver_finite(nis_cruise + px_next_cruise + py_next_cruise + v_next_cruise
        + th_next_cruise + a_next_cruise + w_next_cruise)) {
        return MANEUVER_NOT_FINITE;
    }
    if (!maneuver_finite(nis_speed + px_next_speed + py_next_speed + v_next_speed + th_next_speed
        + a_next_speed + w_next_speed)) {
        return MANEUVER_NOT_FINITE;
    }
    if (!maneuver_finite(nis_turn + px_next_turn + py_next_turn + v_next_turn + th_next_turn
        + a_next_turn + w_next_turn)) {
        return MANEUVER_NOT_FINITE;
    }
    const float mu_cruise = kf->mu[MANEUVER_MODE_CRUISE];
    const float mu_speed = kf->mu[MANEUVER_MODE_SPEED];
    const float mu_turn = kf->mu[MANEUVER_MODE_TURN];

    /* probabilities */
    const bool t146 = mu_cruise > 0.0f;
    const bool t147 = mu_speed > 0.0f;
    const float t148 = t147 && (!t146 || l_cruise < l_speed) ? l_speed : l_cruise;
    const bool t149 = mu_turn > 0.0f;
    const float l_best = t149 && (!(t146 || t147) || t148 < l_turn) ? l_turn : t148;
    if (!maneuver_finite(l_best)) { return MANEUVER_NOT_FINITE; }
    const float t150 = t146 ? mu_cruise * expf(-(t46 + l_best)) : 0.0f;
    const float t151 = t147 ? mu_speed * expf(-(t94 + l_best)) : 0.0f;
    const float t152 = t149 ? mu_turn * expf(-(t142 + l_best)) : 0.0f;
    const float mu_sum = t150 + t151 + t152;
    if (!maneuver_finite(mu_sum)) { return MANEUVER_NOT_FINITE; }
    const float t153 = maneuver_max(t150 / mu_sum, 1.0e-9f);
    const float t154 = maneuver_max(t151 / mu_sum, 1.0e-9f);
    const float t155 = maneuver_max(t152 / mu_sum, 1.0e-9f);
    const float t156 = 1.0f / (t153 + t154 + t155);
    const float mu_cruise_next = t153 * t156;
    const float mu_speed_next = t154 * t156;
    const float mu_turn_next = t155 * t156;

    /* combined state */
    const bool t157 = mu_cruise_next < mu_speed_next;
    const float th_base = (t157 ? mu_speed_next : mu_cruise_next) < mu_turn_next ? t143
        : (t157 ? t95 : t47);
    const float t158 = maneuver_wrap(t47 - th_base, 3.1415927f);
    const float t159 = mu_speed_next * (1.0f / (mu_cruise_next + mu_speed_next));
    const float t160 = t159 * (px_next_speed - px_next_cruise);
    const float t161 = t159 * (py_next_speed - py_next_cruise);
    const float t162 = t159 * (v_next_speed - v_next_cruise);
    const float t163 = t158 + t159 * (maneuver_wrap(t95 - th_base, 3.1415927f) - t158);
    const float t164 = t159 * (a_next_speed - a_next_cruise);
    const float t165 = t159 * (w_next_speed - w_next_cruise);
    const float px_all = px_next_cruise + t160
        + mu_turn_next * (px_next_turn - px_next_cruise - t160);
    const float py_all = py_next_cruise + t161
        + mu_turn_next * (py_next_turn - py_next_cruise - t161);
    const float v_all = v_next_cruise + t162 + mu_turn_next * (v_next_turn - v_next_cruise - t162);
    const float th_all = th_base + t163
        + mu_turn_next * (maneuver_wrap(t143 - th_base, 3.1415927f) - t163);
    const float a_all = a_next_cruise + t164 + mu_turn_next * (a_next_turn - a_next_cruise - t164);
    const float w_all = w_next_cruise + t165 + mu_turn_next * (w_next_turn - w_next_cruise - t165);
    if (!maneuver_finite(px_all + py_all + v_all + th_all + a_all + w_all + mu_cruise_next
        + mu_speed_next + mu_turn_next)) {
        return MANEUVER_NOT_FINITE;
    }

    /* cruise: store */
    kf->modes.cruise.x[MANEUVER_PX] = px_next_cruise;
    kf->modes.cruise.x[MANEUVER_PY] = py_next_cruise;
    kf->modes.cruise.x[MANEUVER_V] = v_next_cruise;
    kf->modes.cruise.x[MANEUVER_TH] = t47;
    kf->modes.cruise.x[MANEUVER_A] = a_next_cruise;
    kf->modes.cruise.x[MANEUVER_W] = w_next_cruise;
    const float p_px_px_next_cruise = t21 - t39 * t23;
    const uint32_t signs_cruise = maneuver_sign_bit(p_px_px_next_cruise);
    kf->modes.cruise.P[0] = p_px_px_next_cruise;
    const float p_px_py_next_cruise = t22 - t39 * t25;
    kf->modes.cruise.P[1] = p_px_py_next_cruise;
    const float p_py_py_next_cruise = t24 - t40 * t25;
    const uint32_t signs_cruise_1 = signs_cruise | maneuver_sign_bit(p_py_py_next_cruise);
    kf->modes.cruise.P[2] = p_py_py_next_cruise;
    const float p_px_v_next_cruise = t26 - t39 * t28;
    kf->modes.cruise.P[3] = p_px_v_next_cruise;
    const float p_py_v_next_cruise = t27 - t40 * t28;
    kf->modes.cruise.P[4] = p_py_v_next_cruise;
    const float p_v_v_next_cruise = kf->modes.cruise.P[5] - t14 * t7 - t41 * t28;
    const uint32_t signs_cruise_2 = signs_cruise_1 | maneuver_sign_bit(p_v_v_next_cruise);
    kf->modes.cruise.P[5] = p_v_v_next_cruise;
    const float p_px_th_next_cruise = t29 - t39 * t31;
    kf->modes.cruise.P[6] = p_px_th_next_cruise;
    const float p_py_th_next_cruise = t30 - t40 * t31;
    kf->modes.cruise.P[7] = p_py_th_next_cruise;
    const float p_v_th_next_cruise = kf->modes.cruise.P[8] - t14 * t8 - t41 * t31;
    kf->modes.cruise.P[8] = p_v_th_next_cruise;
    const float p_th_th_next_cruise = kf->modes.cruise.P[9] - t15 * t8 - t42 * t31;
    const uint32_t signs_cruise_3 = signs_cruise_2 | maneuver_sign_bit(p_th_th_next_cruise);
    kf->modes.cruise.P[9] = p_th_th_next_cruise;
    const float p_px_a_next_cruise = t32 - t39 * t34;
    kf->modes.cruise.P[10] = p_px_a_next_cruise;
    const float p_py_a_next_cruise = t33 - t40 * t34;
    kf->modes.cruise.P[11] = p_py_a_next_cruise;
    const float p_v_a_next_cruise = kf->modes.cruise.P[12] - t14 * t9 - t41 * t34;
    kf->modes.cruise.P[12] = p_v_a_next_cruise;
    const float p_th_a_next_cruise = kf->modes.cruise.P[13] - t15 * t9 - t42 * t34;
    kf->modes.cruise.P[13] = p_th_a_next_cruise;
    const float p_a_a_next_cruise = kf->modes.cruise.P[14] - t16 * t9 - t43 * t34;
    const uint32_t signs_cruise_4 = signs_cruise_3 | maneuver_sign_bit(p_a_a_next_cruise);
    kf->modes.cruise.P[14] = p_a_a_next_cruise;
    const float p_px_w_next_cruise = t35 - t39 * t37;
    kf->modes.cruise.P[15] = p_px_w_next_cruise;
    const float p_py_w_next_cruise = t36 - t40 * t37;
    kf->modes.cruise.P[16] = p_py_w_next_cruise;
    const float p_v_w_next_cruise = kf->modes.cruise.P[17] - t14 * t10 - t41 * t37;
    kf->modes.cruise.P[17] = p_v_w_next_cruise;
    const float p_th_w_next_cruise = kf->modes.cruise.P[18] - t15 * t10 - t42 * t37;
    kf->modes.cruise.P[18] = p_th_w_next_cruise;
    const float p_a_w_next_cruise = kf->modes.cruise.P[19] - t16 * t10 - t43 * t37;
    kf->modes.cruise.P[19] = p_a_w_next_cruise;
    const float p_w_w_next_cruise = kf->modes.cruise.P[20] - t17 * t10 - t44 * t37;
    const uint32_t signs_cruise_5 = signs_cruise_4 | maneuver_sign_bit(p_w_w_next_cruise);
    kf->modes.cruise.P[20] = p_w_w_next_cruise;

    /* speed: store */
    kf->modes.speed.x[MANEUVER_PX] = px_next_speed;
    kf->modes.speed.x[MANEUVER_PY] = py_next_speed;
    kf->modes.speed.x[MANEUVER_V] = v_next_speed;
    kf->modes.speed.x[MANEUVER_TH] = t95;
    kf->modes.speed.x[MANEUVER_A] = a_next_speed;
    kf->modes.speed.x[MANEUVER_W] = w_next_speed;
    const float p_px_px_next_speed = t69 - t87 * t71;
    const uint32_t signs_speed = maneuver_sign_bit(p_px_px_next_speed);
    kf->modes.speed.P[0] = p_px_px_next_speed;
    const float p_px_py_next_speed = t70 - t87 * t73;
    kf->modes.speed.P[1] = p_px_py_next_speed;
    const float p_py_py_next_speed = t72 - t88 * t73;
    const uint32_t signs_speed_1 = signs_speed | maneuver_sign_bit(p_py_py_next_speed);
    kf->modes.speed.P[2] = p_py_py_next_speed;
    const float p_px_v_next_speed = t74 - t87 * t76;
    kf->modes.speed.P[3] = p_px_v_next_speed;
    const float p_py_v_next_speed = t75 - t88 * t76;
    kf->modes.speed.P[4] = p_py_v_next_speed;
    const float p_v_v_next_speed = kf->modes.speed.P[5] - t62 * t55 - t89 * t76;
    const uint32_t signs_speed_2 = signs_speed_1 | maneuver_sign_bit(p_v_v_next_speed);
    kf->modes.speed.P[5] = p_v_v_next_speed;
    const float p_px_th_next_speed = t77 - t87 * t79;
    kf->modes.speed.P[6] = p_px_th_next_speed;
    const float p_py_th_next_speed = t78 - t88 * t79;
    kf->modes.speed.P[7] = p_py_th_next_speed;
    const float p_v_th_next_speed = kf->modes.speed.P[8] - t62 * t56 - t89 * t79;
    kf->modes.speed.P[8] = p_v_th_next_speed;
    const float p_th_th_next_speed = kf->modes.speed.P[9] - t63 * t56 - t90 * t79;
    const uint32_t signs_speed_3 = signs_speed_2 | maneuver_sign_bit(p_th_th_next_speed);
    kf->modes.speed.P[9] = p_th_th_next_speed;
    const float p_px_a_next_speed = t80 - t87 * t82;
    kf->modes.speed.P[10] = p_px_a_next_speed;
    const float p_py_a_next_speed = t81 - t88 * t82;
    kf->modes.speed.P[11] = p_py_a_next_speed;
    const float p_v_a_next_speed = kf->modes.speed.P[12] - t62 * t57 - t89 * t82;
    kf->modes.speed.P[12] = p_v_a_next_speed;
    const float p_th_a_next_speed = kf->modes.speed.P[13] - t63 * t57 - t90 * t82;
    kf->modes.speed.P[13] = p_th_a_next_speed;
    const float p_a_a_next_speed = kf->modes.speed.P[14] - t64 * t57 - t91 * t82;
    const uint32_t signs_speed_4 = signs_speed_3 | maneuver_sign_bit(p_a_a_next_speed);
    kf->modes.speed.P[14] = p_a_a_next_speed;
    const float p_px_w_next_speed = t83 - t87 * t85;
    kf->modes.speed.P[15] = p_px_w_next_speed;
    const float p_py_w_next_speed = t84 - t88 * t85;
    kf->modes.speed.P[16] = p_py_w_next_speed;
    const float p_v_w_next_speed = kf->modes.speed.P[17] - t62 * t58 - t89 * t85;
    kf->modes.speed.P[17] = p_v_w_next_speed;
    const float p_th_w_next_speed = kf->modes.speed.P[18] - t63 * t58 - t90 * t85;
    kf->modes.speed.P[18] = p_th_w_next_speed;
    const float p_a_w_next_speed = kf->modes.speed.P[19] - t64 * t58 - t91 * t85;
    kf->modes.speed.P[19] = p_a_w_next_speed;
    const float p_w_w_next_speed = kf->modes.speed.P[20] - t65 * t58 - t92 * t85;
    const uint32_t signs_speed_5 = signs_speed_4 | maneuver_sign_bit(p_w_w_next_speed);
    kf->modes.speed.P[20] = p_w_w_next_speed;

    /* turn: store */
    kf->modes.turn.x[MANEUVER_PX] = px_next_turn;
    kf->modes.turn.x[MANEUVER_PY] = py_next_turn;
    kf->modes.turn.x[MANEUVER_V] = v_next_turn;
    kf->modes.turn.x[MANEUVER_TH] = t143;
    kf->modes.turn.x[MANEUVER_A] = a_next_turn;
    kf->modes.turn.x[MANEUVER_W] = w_next_turn;
    const float p_px_px_next_turn = t117 - t135 * t119;
    const uint32_t signs_turn = maneuver_sign_bit(p_px_px_next_turn);
    kf->modes.turn.P[0] = p_px_px_next_turn;
    const float p_px_py_next_turn = t118 - t135 * t121;
    kf->modes.turn.P[1] = p_px_py_next_turn;
    const float p_py_py_next_turn = t120 - t136 * t121;
    const uint32_t signs_turn_1 = signs_turn | maneuver_sign_bit(p_py_py_next_turn);
    kf->modes.turn.P[2] = p_py_py_next_turn;
    const float p_px_v_next_turn = t122 - t135 * t124;
    kf->modes.turn.P[3] = p_px_v_next_turn;
    const float p_py_v_next_turn = t123 - t136 * t124;
    kf->modes.turn.P[4] = p_py_v_next_turn;
    const float p_v_v_next_turn = kf->modes.turn.P[5] - t110 * t103 - t137 * t124;
    const uint32_t signs_turn_2 = signs_turn_1 | maneuver_sign_bit(p_v_v_next_turn);
    kf->modes.turn.P[5] = p_v_v_next_turn;
    const float p_px_th_next_turn = t125 - t135 * t127;
    kf->modes.turn.P[6] = p_px_th_next_turn;
    const float p_py_th_next_turn = t126 - t136 * t127;
    kf->modes.turn.P[7] = p_py_th_next_turn;
    const float p_v_th_next_turn = kf->modes.turn.P[8] - t110 * t104 - t137 * t127;
    kf->modes.turn.P[8] = p_v_th_next_turn;
    const float p_th_th_next_turn = kf->modes.turn.P[9] - t111 * t104 - t138 * t127;
    const uint32_t signs_turn_3 = signs_turn_2 | maneuver_sign_bit(p_th_th_next_turn);
    kf->modes.turn.P[9] = p_th_th_next_turn;
    const float p_px_a_next_turn = t128 - t135 * t130;
    kf->modes.turn.P[10] = p_px_a_next_turn;
    const float p_py_a_next_turn = t129 - t136 * t130;
    kf->modes.turn.P[11] = p_py_a_next_turn;
    const float p_v_a_next_turn = kf->modes.turn.P[12] - t110 * t105 - t137 * t130;
    kf->modes.turn.P[12] = p_v_a_next_turn;
    const float p_th_a_next_turn = kf->modes.turn.P[13] - t111 * t105 - t138 * t130;
    kf->modes.turn.P[13] = p_th_a_next_turn;
    const float p_a_a_next_turn = kf->modes.turn.P[14] - t112 * t105 - t139 * t130;
    const uint32_t signs_turn_4 = signs_turn_3 | maneuver_sign_bit(p_a_a_next_turn);
    kf->modes.turn.P[14] = p_a_a_next_turn;
    const float p_px_w_next_turn = t131 - t135 * t133;
    kf->modes.turn.P[15] = p_px_w_next_turn;
    const float p_py_w_next_turn = t132 - t136 * t133;
    kf->modes.turn.P[16] = p_py_w_next_turn;
    const float p_v_w_next_turn = kf->modes.turn.P[17] - t110 * t106 - t137 * t133;
    kf->modes.turn.P[17] = p_v_w_next_turn;
    const float p_th_w_next_turn = kf->modes.turn.P[18] - t111 * t106 - t138 * t133;
    kf->modes.turn.P[18] = p_th_w_next_turn;
    const float p_a_w_next_turn = kf->modes.turn.P[19] - t112 * t106 - t139 * t133;
    kf->modes.turn.P[19] = p_a_w_next_turn;
    const float p_w_w_next_turn = kf->modes.turn.P[20] - t113 * t106 - t140 * t133;
    const uint32_t signs_turn_5 = signs_turn_4 | maneuver_sign_bit(p_w_w_next_turn);
    kf->modes.turn.P[20] = p_w_w_next_turn;

    /* store: the bank */
    kf->mu[MANEUVER_MODE_CRUISE] = mu_cruise_next;
    kf->mu[MANEUVER_MODE_SPEED] = mu_speed_next;
    kf->mu[MANEUVER_MODE_TURN] = mu_turn_next;
    kf->x[MANEUVER_PX] = px_all;
    kf->x[MANEUVER_PY] = py_all;
    kf->x[MANEUVER_V] = v_all;
    kf->x[MANEUVER_TH] = maneuver_wrap(th_all, 3.1415927f);
    kf->x[MANEUVER_A] = a_all;
    kf->x[MANEUVER_W] = w_all;
    kf->gate_count_radar = 0;
    kf->modes.cruise.nis = nis_cruise;
    kf->modes.speed.nis = nis_speed;
    kf->modes.turn.nis = nis_turn;
    kf->nis = t145;
    if (signs_cruise_5 != 0u) {
        flags |= maneuver_settle(kf->modes.cruise.P, 0);
    }
    if (signs_speed_5 != 0u) {
        flags |= maneuver_settle(kf->modes.speed.P, 0);
    }
    if (signs_turn_5 != 0u) {
        flags |= maneuver_settle(kf->modes.turn.P, 0);
    }
    return flags;
}

maneuver_status_t maneuver_set_state(maneuver_t *kf, const maneuver_real_t x[6])
{
    if (kf == NULL || x == NULL) { return MANEUVER_NULL_ARGUMENT; }
    if (!maneuver_finite(x[MANEUVER_PX])) { return MANEUVER_NOT_FINITE; }
    if (!maneuver_finite(x[MANEUVER_PY])) { return MANEUVER_NOT_FINITE; }
    if (!maneuver_finite(x[MANEUVER_V])) { return MANEUVER_NOT_FINITE; }
    if (!maneuver_finite(x[MANEUVER_TH])) { return MANEUVER_NOT_FINITE; }
    if (!maneuver_finite(x[MANEUVER_A])) { return MANEUVER_NOT_FINITE; }
    if (!maneuver_finite(x[MANEUVER_W])) { return MANEUVER_NOT_FINITE; }
    const float t0 = maneuver_wrap(x[MANEUVER_TH], 3.1415927f);
    kf->x[MANEUVER_PX] = x[MANEUVER_PX];
    kf->x[MANEUVER_PY] = x[MANEUVER_PY];
    kf->x[MANEUVER_V] = x[MANEUVER_V];
    kf->x[MANEUVER_TH] = t0;
    kf->x[MANEUVER_A] = x[MANEUVER_A];
    kf->x[MANEUVER_W] = x[MANEUVER_W];
    kf->modes.cruise.x[MANEUVER_PX] = x[MANEUVER_PX];
    kf->modes.cruise.x[MANEUVER_PY] = x[MANEUVER_PY];
    kf->modes.cruise.x[MANEUVER_V] = x[MANEUVER_V];
    kf->modes.cruise.x[MANEUVER_TH] = t0;
    kf->modes.cruise.x[MANEUVER_A] = x[MANEUVER_A];
    kf->modes.cruise.x[MANEUVER_W] = x[MANEUVER_W];
    kf->modes.speed.x[MANEUVER_PX] = x[MANEUVER_PX];
    kf->modes.speed.x[MANEUVER_PY] = x[MANEUVER_PY];
    kf->modes.speed.x[MANEUVER_V] = x[MANEUVER_V];
    kf->modes.speed.x[MANEUVER_TH] = t0;
    kf->modes.speed.x[MANEUVER_A] = x[MANEUVER_A];
    kf->modes.speed.x[MANEUVER_W] = x[MANEUVER_W];
    kf->modes.turn.x[MANEUVER_PX] = x[MANEUVER_PX];
    kf->modes.turn.x[MANEUVER_PY] = x[MANEUVER_PY];
    kf->modes.turn.x[MANEUVER_V] = x[MANEUVER_V];
    kf->modes.turn.x[MANEUVER_TH] = t0;
    kf->modes.turn.x[MANEUVER_A] = x[MANEUVER_A];
    kf->modes.turn.x[MANEUVER_W] = x[MANEUVER_W];
    return MANEUVER_OK;
}

maneuver_status_t maneuver_set_covariance(maneuver_t *kf, const maneuver_real_t P[36])
{
    if (kf == NULL || P == NULL) { return MANEUVER_NULL_ARGUMENT; }
    float p_cruise[21];
    float w_cruise[21];

    /* cruise: the upper triangle, column by column */
    for (int j = 0; j < 6; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value_cruise = P[6 * i + j];
            p_cruise[j * (j + 1) / 2 + i] = value_cruise;
            w_cruise[j * (j + 1) / 2 + i] = value_cruise;
            if (!maneuver_finite(value_cruise)) { return MANEUVER_NOT_FINITE; }
        }
    }

    /* cruise: factor it: a pivot is zero up to round-off, or positive */
    for (int j = 6 - 1; j >= 0; j--) {
        const float round_off_cruise = 7.1525574e-7f * p_cruise[j * (j + 1) / 2 + j];
        const float pivot_cruise = w_cruise[j * (j + 1) / 2 + j];
        if (!(-round_off_cruise <= pivot_cruise)) { return MANEUVER_NOT_POSITIVE; }
        const float d_cruise = round_off_cruise < pivot_cruise ? pivot_cruise : 0.0f;
        w_cruise[j * (j + 1) / 2 + j] = d_cruise;
        for (int i = j - 1; i >= 0; i--) {
            const float rest_cruise = w_cruise[j * (j + 1) / 2 + i];
            if (d_cruise <= 0.0f && 2.861023e-6f * p_cruise[j * (j + 1) / 2 + j]
                * p_cruise[i * (i + 1) / 2 + i] < rest_cruise * rest_cruise) {
                return MANEUVER_NOT_POSITIVE;
            }
            const float u_cruise = d_cruise > 0.0f ? rest_cruise / d_cruise : 0.0f;
            for (int k = 0; k < i + 1; k++) {
                w_cruise[i * (i + 1) / 2 + k] = w_cruise[i * (i + 1) / 2 + k]
                    - u_cruise * w_cruise[j * (j + 1) / 2 + k];
            }
            w_cruise[j * (j + 1) / 2 + i] = u_cruise;
        }
    }

    /* store */
    for (int k = 0; k < 21; k++) {
        kf->modes.cruise.P[k] = p_cruise[k];
    }
    for (int k = 0; k < 21; k++) {
        kf->modes.speed.P[k] = p_cruise[k];
    }
    for (int k = 0; k < 21; k++) {
        kf->modes.turn.P[k] = p_cruise[k];
    }
    return MANEUVER_OK;
}

void maneuver_get_covariance(const maneuver_t *kf, maneuver_real_t P[36])
{
    if (kf == NULL || P == NULL) { return; }
    const float mu_cruise = kf->mu[MANEUVER_MODE_CRUISE];
    const float mu_speed = kf->mu[MANEUVER_MODE_SPEED];
    const float mu_turn = kf->mu[MANEUVER_MODE_TURN];
    float d_cruise[6];
    float d_speed[6];
    float d_turn[6];
    const float t0 = kf->modes.speed.x[MANEUVER_PX] - kf->modes.cruise.x[MANEUVER_PX];
    const float t1 = kf->modes.turn.x[MANEUVER_PX] - kf->modes.cruise.x[MANEUVER_PX];
    const float shift_px = mu_speed * t0 + mu_turn * t1;
    d_cruise[0] = -shift_px;
    d_speed[0] = t0 - shift_px;
    d_turn[0] = t1 - shift_px;
    const float t2 = kf->modes.speed.x[MANEUVER_PY] - kf->modes.cruise.x[MANEUVER_PY];
    const float t3 = kf->modes.turn.x[MANEUVER_PY] - kf->modes.cruise.x[MANEUVER_PY];
    const float shift_py = mu_speed * t2 + mu_turn * t3;
    d_cruise[1] = -shift_py;
    d_speed[1] = t2 - shift_py;
    d_turn[1] = t3 - shift_py;
    const float t4 = kf->modes.speed.x[MANEUVER_V] - kf->modes.cruise.x[MANEUVER_V];
    const float t5 = kf->modes.turn.x[MANEUVER_V] - kf->modes.cruise.x[MANEUVER_V];
    const float shift_v = mu_speed * t4 + mu_turn * t5;
    d_cruise[2] = -shift_v;
    d_speed[2] = t4 - shift_v;
    d_turn[2] = t5 - shift_v;
    const bool t6 = mu_cruise < mu_speed;
    const float th_base = (t6 ? mu_speed : mu_cruise) < mu_turn ? kf->modes.turn.x[MANEUVER_TH]
        : (t6 ? kf->modes.speed.x[MANEUVER_TH] : kf->modes.cruise.x[MANEUVER_TH]);
    const float t7 = maneuver_wrap(kf->modes.cruise.x[MANEUVER_TH] - th_base, 3.1415927f);
    const float t8 = maneuver_wrap(kf->modes.speed.x[MANEUVER_TH] - th_base, 3.1415927f);
    const float t9 = maneuver_wrap(kf->modes.turn.x[MANEUVER_TH] - th_base, 3.1415927f);
    const float shift_th = mu_cruise * t7 + mu_speed * t8 + mu_turn * t9;
    d_cruise[3] = t7 - shift_th;
    d_speed[3] = t8 - shift_th;
    d_turn[3] = t9 - shift_th;
    const float t10 = kf->modes.speed.x[MANEUVER_A] - kf->modes.cruise.x[MANEUVER_A];
    const float t11 = kf->modes.turn.x[MANEUVER_A] - kf->modes.cruise.x[MANEUVER_A];
    const float shift_a = mu_speed * t10 + mu_turn * t11;
    d_cruise[4] = -shift_a;
    d_speed[4] = t10 - shift_a;
    d_turn[4] = t11 - shift_a;
    const float t12 = kf->modes.speed.x[MANEUVER_W] - kf->modes.cruise.x[MANEUVER_W];
    const float t13 = kf->modes.turn.x[MANEUVER_W] - kf->modes.cruise.x[MANEUVER_W];
    const float shift_w = mu_speed * t12 + mu_turn * t13;
    d_cruise[5] = -shift_w;
    d_speed[5] = t12 - shift_w;
    d_turn[5] = t13 - shift_w;

    /* the spread between the modes */
    for (int j = 0; j < 6; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = mu_cruise * (d_cruise[i] * d_cruise[j])
                + mu_speed * (d_speed[i] * d_speed[j]) + mu_turn * (d_turn[i] * d_turn[j]);
            P[6 * i + j] = value;
            P[6 * j + i] = value;
        }
    }

    /* cruise: its own */
    for (int j = 0; j < 6; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value_cruise = kf->modes.cruise.P[j * (j + 1) / 2 + i];
            const float sum_cruise = P[6 * i + j] + mu_cruise * value_cruise;
            P[6 * i + j] = sum_cruise;
            P[6 * j + i] = sum_cruise;
        }
    }

    /* speed: its own */
    for (int j = 0; j < 6; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value_speed = kf->modes.speed.P[j * (j + 1) / 2 + i];
            const float sum_speed = P[6 * i + j] + mu_speed * value_speed;
            P[6 * i + j] = sum_speed;
            P[6 * j + i] = sum_speed;
        }
    }

    /* turn: its own */
    for (int j = 0; j < 6; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value_turn = kf->modes.turn.P[j * (j + 1) / 2 + i];
            const float sum_turn = P[6 * i + j] + mu_turn * value_turn;
            P[6 * i + j] = sum_turn;
            P[6 * j + i] = sum_turn;
        }
    }
}
/* kfgen: body eaf320eb92b958b4e842abbefea51037 */
