/* kfgen build battery.yaml */
#include "battery.h"

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "battery tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "battery tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* constants: in flash on AVR too, where what is only const takes RAM */
#if defined(__AVR__)
#include <avr/pgmspace.h>
#define BATTERY_flash PROGMEM
static float battery_read(const float *from)
{
    float value;
    memcpy_P(&value, from, sizeof value);
    return value;
}
#define BATTERY_at(array, i) battery_read(&(array)[i])
#else
#define BATTERY_flash
#define BATTERY_at(array, i) (array)[i]
#endif

static const float battery_table0_x[25] BATTERY_flash = {
    -0.05f, -0.05f, 0.02f, 0.04f, 0.06f, 0.08f, 0.1f, 0.13f, 0.16f, 0.2f, 0.25f, 0.3f, 0.35f,
    0.4f, 0.5f, 0.6f, 0.7f, 0.8f, 0.88f, 0.92f, 0.95f, 0.97f, 0.98f, 0.99f, 1.05f
};

static const float battery_table0_y[25] BATTERY_flash = {
    1.415f, 1.415f, 2.535f, 2.855f, 2.984f, 3.066f, 3.133f, 3.1955f, 3.2019f, 3.223f, 3.2411f,
    3.2546f, 3.2656f, 3.2867f, 3.2965f, 3.3013f, 3.313f, 3.3335f, 3.3407f, 3.3555f, 3.3592f,
    3.3767f, 3.4026f, 3.4328f, 4.279f
};

static const float battery_table0_slope[25] BATTERY_flash = {
    0.0f, 16.0f, 16.0f, 6.45f, 4.1f, 3.35f, 2.0833333f, 0.21333334f, 0.5275f, 0.362f, 0.27f,
    0.22f, 0.422f, 0.098f, 0.048f, 0.117f, 0.205f, 0.09f, 0.37f, 0.123333335f, 0.875f, 2.59f,
    3.02f, 14.103333f, 0.0f
};

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool battery_finite(float a)
{
    const uint32_t exponent = 0x7f800000u;
    union { float value; uint32_t bits; } view;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

/* the segment of a table in which a lies: 0 before the first of n points, n beyond the last one */
static int battery_segment(float a, const float x[], int n)
{
    int i = 0;
    while (i < n && BATTERY_at(x, i + 1) <= a) { i++; }
    if (i == n && !(BATTERY_at(x, n) < a)) { i--; }
    return i;
}

battery_status_t battery_init(battery_t *kf)
{
    if (kf == NULL) { return BATTERY_NULL_ARGUMENT; }
    kf->x[BATTERY_SOC] = 0.7f;
    kf->x[BATTERY_V_FAST] = 0.0f;
    kf->x[BATTERY_V_SLOW] = 0.0f;
    kf->U[0] = 0.0f;
    kf->U[1] = 0.0f;
    kf->U[2] = 0.0f;
    kf->D[0] = 0.09f;
    kf->D[1] = 0.000025f;
    kf->D[2] = 0.0001f;
    kf->nis = 0.0f;
    return BATTERY_OK;
}

battery_status_t battery_predict(battery_t *kf, const battery_inputs_t *u)
{
    if (kf == NULL || u == NULL) { return BATTERY_NULL_ARGUMENT; }

    /* arguments */
    if (!battery_finite(u->current)) { return BATTERY_NOT_FINITE; }
    const float soc = kf->x[BATTERY_SOC];
    const float v_fast = kf->x[BATTERY_V_FAST];
    const float v_slow = kf->x[BATTERY_V_SLOW];

    /* model */
    const float soc_next = soc - 0.00013550135f * u->current;
    const float v_fast_next = 0.95122945f * v_fast + 0.0005169681f * u->current;
    const float v_slow_next = 0.9966722f * v_slow + 0.00007121458f * u->current;

    /* F U D U^T F^T + Q */
    const float u_v_fast_v_slow = kf->U[2];
    const float t0 = 0.95122945f * u_v_fast_v_slow;
    const float d_v_slow = kf->D[2];
    const float d_v_slow_next = 4.001268e-8f + 0.9933555f * d_v_slow;
    const float t1 = 1.0f / d_v_slow_next;
    const float t2 = 0.9966722f * d_v_slow * t1;
    const float t3 = d_v_slow * (4.001268e-8f * t1);
    const float u_soc_v_slow = kf->U[1];
    const float u_soc_v_slow_next = t2 * u_soc_v_slow - 2.4124178e-11f * t1;
    const float u_v_fast_v_slow_next = 9.203916e-11f * t1 + t2 * t0;
    const float t4 = t0 - 0.002292595f;
    const float d_v_fast = kf->D[1];
    const float t5 = 2.5066794e-7f + 0.9048374f * d_v_fast;
    const float t6 = 1.0f / t5;
    const float t7 = t3 * t4;
    const float d_v_fast_next = t5 + t4 * t7;
    const float t8 = 1.0f / d_v_fast_next;
    const float u_soc_v_fast = kf->U[0];
    const float t9 = 0.95122945f * d_v_fast * t6 * u_soc_v_fast - 1.7506921e-10f * t6;
    const float t10 = u_soc_v_fast + 0.00066434895f;
    const float t11 = u_soc_v_slow + 0.000600907f - t4 * t9;
    const float u_soc_v_fast_next = t9 + t7 * t8 * t11;
    const float d_soc = kf->D[0];
    const float d_soc_next = 1.4576473e-10f + d_soc + t10 * (d_v_fast * (2.5066794e-7f * t6) * t10)
        + t11 * (t3 * (t5 * t8) * t11);
    const float t12 = soc_next < 0.0f ? 0.0f : (soc_next > 1.0f ? 1.0f : soc_next);

    /* guards */
    if (!battery_finite(t12 + v_fast_next + v_slow_next + soc_next + d_soc_next + d_v_fast_next
        + d_v_slow_next)) {
        return BATTERY_NOT_FINITE;
    }

    /* store */
    kf->x[BATTERY_SOC] = t12;
    kf->x[BATTERY_V_FAST] = v_fast_next;
    kf->x[BATTERY_V_SLOW] = v_slow_next;
    kf->U[0] = u_soc_v_fast_next;
    kf->U[1] = u_soc_v_slow_next;
    kf->U[2] = u_v_fast_v_slow_next;
    kf->D[0] = d_soc_next;
    kf->D[1] = d_v_fast_next;
    kf->D[2] = d_v_slow_next;
    return BATTERY_OK;
}

battery_status_t battery_update_terminal(battery_t *kf,
                                         const battery_terminal_t *z,
                                         const battery_inputs_t *u)
{
    if (kf == NULL || z == NULL || u == NULL) { return BATTERY_NULL_ARGUMENT; }

    /* arguments */
    if (!battery_finite(u->current)) { return BATTERY_NOT_FINITE; }

    /* innovation */
    const float soc = kf->x[BATTERY_SOC];
    const float v_fast = kf->x[BATTERY_V_FAST];
    const float v_slow = kf->x[BATTERY_V_SLOW];
    const int t0 = battery_segment(soc, battery_table0_x, 24);
    const float h_voltage = (BATTERY_at(battery_table0_y, t0)
        + BATTERY_at(battery_table0_slope, t0) * (soc - BATTERY_at(battery_table0_x, t0))) - v_fast
        - v_slow - 0.0098f * u->current;
    const float h_voltage_soc = BATTERY_at(battery_table0_slope, t0);
    const float y_voltage = z->voltage - h_voltage;
    const float t1 = 0.0004f + 0.01f * h_voltage_soc * h_voltage_soc;

    /* gain and covariance */
    const float u_soc_v_fast = kf->U[0];
    const float t2 = u_soc_v_fast * h_voltage_soc - 1.0f;
    const float u_soc_v_slow = kf->U[1];
    const float u_v_fast_v_slow = kf->U[2];
    const float t3 = u_soc_v_slow * h_voltage_soc - u_v_fast_v_slow - 1.0f;
    const float d_soc = kf->D[0];
    const float d_v_fast = kf->D[1];
    const float d_v_slow = kf->D[2];
    const float t4 = h_voltage_soc * (d_soc * h_voltage_soc) + t2 * (d_v_fast * t2)
        + t3 * (d_v_slow * t3);
    const float t5 = h_voltage_soc * h_voltage_soc
        * (d_soc + u_soc_v_fast * d_v_fast * u_soc_v_fast + u_soc_v_slow * d_v_slow * u_soc_v_slow)
        + d_v_fast + u_v_fast_v_slow * d_v_slow * u_v_fast_v_slow + d_v_slow;
    const bool t6 = !(2.861023e-6f * t5 < t4) && t1 <= 0.0f && !(t4 < 0.0f);
    const float least_voltage = 8.185452e-12f * t5 + 1.1754944e-38f;
    const float t7 = t6 ? 0.0f : h_voltage_soc;
    const float t8 = t6 ? 0.0f : -1.0f;
    const float t9 = d_soc * t7;
    const float t10 = t1 + t7 * t9;
    const bool t11 = least_voltage < t10;
    const float t12 = t11 ? 1.0f / t10 : 0.0f;
    const float t13 = t9 * t12;
    const float d_soc_next = d_soc * (t11 ? t1 * t12 : 1.0f);
    const float t14 = u_soc_v_fast * t7 + t8;
    const float t15 = d_v_fast * t14;
    const float t16 = t10 + t14 * t15;
    const bool t17 = least_voltage < t16;
    const float t18 = t17 ? 1.0f / t16 : 0.0f;
    const float t19 = t15 * t18;
    const float d_v_fast_next = d_v_fast * (t17 ? t10 * t18 : 1.0f);
    const float u_soc_v_fast_next = u_soc_v_fast - t14 * t13;
    const float t20 = t13 + t19 * u_soc_v_fast_next;
    const float t21 = u_soc_v_slow * t7 + u_v_fast_v_slow * t8 + t8;
    const float t22 = d_v_slow * t21;
    const float s_voltage = t16 + t21 * t22;
    const bool t23 = least_voltage < s_voltage;
    const float t24 = 1.0f / s_voltage;
    const float t25 = t23 ? t24 : 0.0f;
    const float t26 = t22 * t25;
    const float d_v_slow_next = d_v_slow * (t23 ? t16 * t25 : 1.0f);
    const float u_v_fast_v_slow_next = u_v_fast_v_slow - t21 * t19;
    const float u_soc_v_slow_next = u_soc_v_slow - t21 * t20;
    const float nis = s_voltage > 1.1754944e-38f ? y_voltage * (y_voltage * t24) : 0.0f;

    /* state and innovation squared */
    const float soc_next = soc + (t20 + t26 * u_soc_v_slow_next) * y_voltage;
    const float v_fast_next = v_fast + (t19 + t26 * u_v_fast_v_slow_next) * y_voltage;
    const float v_slow_next = v_slow + t26 * y_voltage;
    const float t27 = soc_next < 0.0f ? 0.0f : (soc_next > 1.0f ? 1.0f : soc_next);

    /* guards */
    if (!battery_finite(y_voltage + t1 + h_voltage_soc)) { return BATTERY_NOT_FINITE; }
    if (t1 < 0.0f) { /* a measurement variance is negative */
        return BATTERY_NOT_POSITIVE;
    }
    if (!battery_finite(y_voltage + t27 + v_fast_next + v_slow_next + nis + soc_next + s_voltage)) {
        return BATTERY_NOT_FINITE;
    }
    if (s_voltage < 0.0f) { return BATTERY_NOT_POSITIVE; }

    /* store */
    kf->x[BATTERY_SOC] = t27;
    kf->x[BATTERY_V_FAST] = v_fast_next;
    kf->x[BATTERY_V_SLOW] = v_slow_next;
    kf->U[0] = u_soc_v_fast_next;
    kf->U[1] = u_soc_v_slow_next;
    kf->U[2] = u_v_fast_v_slow_next;
    kf->D[0] = d_soc_next;
    kf->D[1] = d_v_fast_next;
    kf->D[2] = d_v_slow_next;
    kf->nis = nis;
    return BATTERY_OK;
}

battery_status_t battery_set_state(battery_t *kf, const battery_real_t x[3])
{
    if (kf == NULL || x == NULL) { return BATTERY_NULL_ARGUMENT; }
    if (!battery_finite(x[BATTERY_SOC])) { return BATTERY_NOT_FINITE; }
    if (!battery_finite(x[BATTERY_V_FAST])) { return BATTERY_NOT_FINITE; }
    if (!battery_finite(x[BATTERY_V_SLOW])) { return BATTERY_NOT_FINITE; }
    kf->x[BATTERY_SOC] = x[BATTERY_SOC];
    kf->x[BATTERY_V_FAST] = x[BATTERY_V_FAST];
    kf->x[BATTERY_V_SLOW] = x[BATTERY_V_SLOW];
    return BATTERY_OK;
}

battery_status_t battery_set_covariance(battery_t *kf, const battery_real_t P[9])
{
    if (kf == NULL || P == NULL) { return BATTERY_NULL_ARGUMENT; }
    float p[6];
    float w[6];

    /* the upper triangle, column by column */
    for (int j = 0; j < 3; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = P[3 * i + j];
            p[j * (j + 1) / 2 + i] = value;
            w[j * (j + 1) / 2 + i] = value;
            if (!battery_finite(value)) { return BATTERY_NOT_FINITE; }
        }
    }

    /* factor it: a pivot is zero up to round-off, or positive */
    for (int j = 3 - 1; j >= 0; j--) {
        const float round_off = 3.5762787e-7f * p[j * (j + 1) / 2 + j];
        const float pivot = w[j * (j + 1) / 2 + j];
        if (!(-round_off <= pivot)) { return BATTERY_NOT_POSITIVE; }
        const float d = round_off < pivot ? pivot : 0.0f;
        w[j * (j + 1) / 2 + j] = d;
        for (int i = j - 1; i >= 0; i--) {
            const float rest = w[j * (j + 1) / 2 + i];
            if (d <= 0.0f && 1.4305115e-6f * p[j * (j + 1) / 2 + j] * p[i * (i + 1) / 2 + i] < rest
                * rest) {
                return BATTERY_NOT_POSITIVE;
            }
            const float u = d > 0.0f ? rest / d : 0.0f;
            for (int k = 0; k < i + 1; k++) {
                w[i * (i + 1) / 2 + k] = w[i * (i + 1) / 2 + k] - u * w[j * (j + 1) / 2 + k];
            }
            w[j * (j + 1) / 2 + i] = u;
        }
    }

    /* store */
    for (int j = 0; j < 3; j++) {
        for (int i = 0; i < j; i++) {
            kf->U[j * (j - 1) / 2 + i] = w[j * (j + 1) / 2 + i];
        }
        kf->D[j] = w[j * (j + 1) / 2 + j];
    }
    return BATTERY_OK;
}

void battery_get_covariance(const battery_t *kf, battery_real_t P[9])
{
    if (kf == NULL || P == NULL) { return; }
    for (int j = 0; j < 3; j++) {
        for (int i = 0; i < j + 1; i++) {
            float sum = kf->D[j];
            if (i < j) {
                sum = sum * kf->U[j * (j - 1) / 2 + i];
            }
            for (int k = j + 1; k < 3; k++) {
                sum = sum + kf->U[k * (k - 1) / 2 + i] * kf->D[k] * kf->U[k * (k - 1) / 2 + j];
            }
            const float value = sum;
            P[3 * i + j] = value;
            P[3 * j + i] = value;
        }
    }
}
/* kfgen: body f55a5c1aeb5ad21800754299ae2fef9e */
