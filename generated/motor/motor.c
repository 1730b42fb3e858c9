/* kfgen build motor.yaml */
#include "motor.h"

#include <math.h>

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "motor tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "motor tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool motor_finite(float a)
{
    const uint32_t exponent = 0x7f800000u;
    union { float value; uint32_t bits; } view;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

/* not 0 for what is below zero: a test without a branch */
static uint32_t motor_sign_bit(float a)
{
    union { float value; uint32_t bits; } view;
    view.value = a;
    return view.bits & 0x80000000u;
}

/* a in (-half, half], by whole turns of 2 half */
static float motor_wrap(float a, float half)
{
    if (a > half || a <= -half) {
        a -= (half + half) * ceilf((a - half) / (half + half));
        if (a > half || a <= -half) { a = half; } /* the last bit of a turn */
    }
    return a;
}

motor_status_t motor_init(motor_t *kf)
{
    if (kf == NULL) { return MOTOR_NULL_ARGUMENT; }
    kf->x[MOTOR_IA] = 0.0f;
    kf->x[MOTOR_IB] = 0.0f;
    kf->x[MOTOR_W] = 200.0f;
    kf->x[MOTOR_TH] = 0.0f;
    kf->P[0] = 0.01f;
    kf->P[1] = 0.0f;
    kf->P[2] = 0.01f;
    kf->P[3] = 0.0f;
    kf->P[4] = 0.0f;
    kf->P[5] = 900.0f;
    kf->P[6] = 0.0f;
    kf->P[7] = 0.0f;
    kf->P[8] = 0.0f;
    kf->P[9] = 0.25f;
    kf->nis = 0.0f;
    kf->parameters.accel = 5000.0f;
    return MOTOR_OK;
}

/* Variances below zero: as large as rounding has left them, without correlations. all: none has
   any */
static motor_status_t motor_settle(motor_real_t P[10], int all)
{
    motor_status_t flags = MOTOR_OK;
    for (int j = 0; j < 4; j++) {
        const float own = P[j * (j + 1) / 2 + j];
        if (own < 0.0f || all > 0) {
            for (int i = 0; i < 4; i++) {
                P[i < j ? j * (j + 1) / 2 + i : i * (i + 1) / 2 + j] = 0.0f;
            }
            P[j * (j + 1) / 2 + j] = fabsf(own);
            flags |= MOTOR_REGULARIZED;
        }
    }
    return flags;
}

motor_status_t motor_predict(motor_t *kf, const motor_inputs_t *u)
{
    if (kf == NULL || u == NULL) { return MOTOR_NULL_ARGUMENT; }
    motor_status_t flags = MOTOR_OK;

    /* arguments */
    if (!motor_finite(u->ua)) { return MOTOR_NOT_FINITE; }
    if (!motor_finite(u->ub)) { return MOTOR_NOT_FINITE; }
    const float ia = kf->x[MOTOR_IA];
    const float ib = kf->x[MOTOR_IB];
    const float w_1 = kf->x[MOTOR_W];
    const float th = kf->x[MOTOR_TH];

    /* model */
    const float sin_th = sinf(th);
    const float f_ib_th = w_1 * sin_th * 0.0005f;
    const float ia_next = 0.05f * u->ua + 0.98f * ia + f_ib_th;
    const float cos_th = cosf(th);
    const float f_ia_th = w_1 * cos_th * 0.0005f;
    const float f_ia_w = 0.0005f * sin_th;
    const float ib_next = 0.05f * u->ub + 0.98f * ib - f_ia_th;
    const float t0 = 0.0005f * cos_th;
    const float th_next = th + 0.00005f * w_1;

    /* P = F P F^T + Q: the diagonal first, for the guards */
    const float p_ia_w = kf->P[3];
    const float p_w_w = kf->P[5];
    const float p_w_th = kf->P[8];
    const float p_ia_w_next = 0.98f * p_ia_w + p_w_w * f_ia_w + p_w_th * f_ia_th;
    const float p_ia_th = kf->P[6];
    const float p_th_th = kf->P[9];
    const float t1 = 0.98f * p_ia_th + p_w_th * f_ia_w + p_th_th * f_ia_th;
    const float p_ia_ia = kf->P[0];
    const float p_ia_ia_next = 0.98f * (0.98f * p_ia_ia + p_ia_w * f_ia_w + p_ia_th * f_ia_th)
        + p_ia_w_next * f_ia_w + t1 * f_ia_th + 0.0004f;
    const float p_ib_w = kf->P[4];
    const float p_ib_w_next = 0.98f * p_ib_w - p_w_w * t0 + p_w_th * f_ib_th;
    const float p_ib_th = kf->P[7];
    const float t2 = 0.98f * p_ib_th - p_w_th * t0 + p_th_th * f_ib_th;
    const float p_ib_ib = kf->P[2];
    const float p_ib_ib_next = 0.98f * (0.98f * p_ib_ib - p_ib_w * t0 + p_ib_th * f_ib_th)
        - p_ib_w_next * t0 + t2 * f_ib_th + 0.0004f;
    const float p_w_w_next = p_w_w + 2.5e-9f * (kf->parameters.accel * kf->parameters.accel);
    const float p_w_th_next = 0.00005f * p_w_w + p_w_th;
    const float p_th_th_next = 0.00005f * p_w_th_next + 0.00005f * p_w_th + p_th_th + 1.0e-8f;

    /* guards */
    if (!motor_finite(ia_next + ib_next + th_next + p_ia_ia_next + p_ib_ib_next + p_w_w_next
        + p_th_th_next)) {
        return MOTOR_NOT_FINITE;
    }

    /* store */
    kf->x[MOTOR_IA] = ia_next;
    kf->x[MOTOR_IB] = ib_next;
    kf->x[MOTOR_TH] = motor_wrap(th_next, 3.1415927f);
    const uint32_t signs = motor_sign_bit(p_ia_ia_next);
    kf->P[0] = p_ia_ia_next;
    const float p_ia_ib = kf->P[1];
    const float p_ia_ib_next = 0.98f * (0.98f * p_ia_ib - p_ia_w * t0 + p_ia_th * f_ib_th)
        + p_ib_w_next * f_ia_w + t2 * f_ia_th;
    kf->P[1] = p_ia_ib_next;
    const uint32_t signs_1 = signs | motor_sign_bit(p_ib_ib_next);
    kf->P[2] = p_ib_ib_next;
    const float p_ia_th_next = 0.00005f * p_ia_w_next + t1;
    kf->P[6] = p_ia_th_next;
    const float p_ib_th_next = 0.00005f * p_ib_w_next + t2;
    kf->P[7] = p_ib_th_next;
    const uint32_t signs_2 = signs_1 | motor_sign_bit(p_th_th_next);
    kf->P[9] = p_th_th_next;
    kf->P[3] = p_ia_w_next;
    kf->P[4] = p_ib_w_next;
    kf->P[8] = p_w_th_next;
    kf->P[5] = p_w_w_next;
    if (signs_2 != 0u) {
        flags |= motor_settle(kf->P, 0);
    }
    return flags;
}

motor_status_t motor_update_currents(motor_t *kf, const motor_currents_t *z)
{
    if (kf == NULL || z == NULL) { return MOTOR_NULL_ARGUMENT; }
    motor_status_t flags = MOTOR_OK;

    /* innovation */
    const float ia = kf->x[MOTOR_IA];
    const float ib = kf->x[MOTOR_IB];
    const float y_a = z->a - ia;
    const float y_b = z->b - ib;

    /* gain and covariance: a */
    const float p_ia_ia = kf->P[0];
    const float s_a = p_ia_ia + 0.0025f;
    const float t2 = 0.9999995f / s_a;
    const float t3 = p_ia_ia * t2;
    const float p_ia_ib = kf->P[1];
    const float t4 = p_ia_ib * t2;
    const float p_ia_w = kf->P[3];
    const float t5 = p_ia_w * t2;
    const float p_ia_th = kf->P[6];
    const float t6 = p_ia_th * t2;
    const float t7 = t4 * y_a;

    /* gain and covariance: b */
    const float t8 = 0.0025f * t4;
    const float p_ib_ib = kf->P[2];
    const float t9 = p_ib_ib - t4 * p_ia_ib;
    const float p_ib_w = kf->P[4];
    const float t10 = p_ib_w - t4 * p_ia_w;
    const float p_ib_th = kf->P[7];
    const float t11 = p_ib_th - t4 * p_ia_th;
    const float s_b = t9 + 0.0025f;
    const float t12 = 0.9999995f / s_b;
    const float t13 = t8 * t12;
    const float t14 = t9 * t12;
    const float t15 = t10 * t12;
    const float t16 = t11 * t12;
    const float nu_b = y_b - t7;
    const float nis = y_a * (y_a * t2) + nu_b * (nu_b * t12);

    /* state and innovation squared */
    const float ia_next = ia + t3 * y_a + t13 * nu_b;
    const float ib_next = ib + t7 + t14 * nu_b;
    const float w_next = kf->x[MOTOR_W] + t5 * y_a + t15 * nu_b;
    const float th_next = kf->x[MOTOR_TH] + t6 * y_a + t16 * nu_b;

    /* guards */
    if (!motor_finite(ia_next + ib_next + w_next + th_next + nis + s_a + s_b)) {
        return MOTOR_NOT_FINITE;
    }
    if (!(s_a > 0.0f)) { return MOTOR_NOT_POSITIVE; }
    if (t9 < 0.0f) {
        flags |= motor_settle(kf->P, 1);
        return flags;
    }

    /* store */
    kf->x[MOTOR_IA] = ia_next;
    kf->x[MOTOR_IB] = ib_next;
    kf->x[MOTOR_W] = w_next;
    kf->x[MOTOR_TH] = motor_wrap(th_next, 3.1415927f);
    const float p_ia_ia_next = 0.0025f * t3 - t13 * t8;
    const uint32_t signs = motor_sign_bit(p_ia_ia_next);
    kf->P[0] = p_ia_ia_next;
    const float p_ia_ib_next = 0.0025f * t13;
    kf->P[1] = p_ia_ib_next;
    const float p_ib_ib_next = 0.0025f * t14;
    kf->P[2] = p_ib_ib_next;
    const float p_ia_w_next = 0.0025f * t5 - t13 * t10;
    kf->P[3] = p_ia_w_next;
    const float p_ib_w_next = 0.0025f * t15;
    kf->P[4] = p_ib_w_next;
    const float p_w_w_next = kf->P[5] - t5 * p_ia_w - t15 * t10;
    const uint32_t signs_1 = signs | motor_sign_bit(p_w_w_next);
    kf->P[5] = p_w_w_next;
    const float p_ia_th_next = 0.0025f * t6 - t13 * t11;
    kf->P[6] = p_ia_th_next;
    const float p_ib_th_next = 0.0025f * t16;
    kf->P[7] = p_ib_th_next;
    const float p_w_th_next = kf->P[8] - t5 * p_ia_th - t15 * t11;
    kf->P[8] = p_w_th_next;
    const float p_th_th_next = kf->P[9] - t6 * p_ia_th - t16 * t11;
    const uint32_t signs_2 = signs_1 | motor_sign_bit(p_th_th_next);
    kf->P[9] = p_th_th_next;
    kf->nis = nis;
    if (signs_2 != 0u) {
        flags |= motor_settle(kf->P, 0);
    }
    return flags;
}

motor_status_t motor_set_state(motor_t *kf, const motor_real_t x[4])
{
    if (kf == NULL || x == NULL) { return MOTOR_NULL_ARGUMENT; }
    if (!motor_finite(x[MOTOR_IA])) { return MOTOR_NOT_FINITE; }
    if (!motor_finite(x[MOTOR_IB])) { return MOTOR_NOT_FINITE; }
    if (!motor_finite(x[MOTOR_W])) { return MOTOR_NOT_FINITE; }
    if (!motor_finite(x[MOTOR_TH])) { return MOTOR_NOT_FINITE; }
    kf->x[MOTOR_IA] = x[MOTOR_IA];
    kf->x[MOTOR_IB] = x[MOTOR_IB];
    kf->x[MOTOR_W] = x[MOTOR_W];
    kf->x[MOTOR_TH] = motor_wrap(x[MOTOR_TH], 3.1415927f);
    return MOTOR_OK;
}

motor_status_t motor_set_covariance(motor_t *kf, const motor_real_t P[16])
{
    if (kf == NULL || P == NULL) { return MOTOR_NULL_ARGUMENT; }
    float p[10];
    float w[10];

    /* the upper triangle, column by column */
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = P[4 * i + j];
            p[j * (j + 1) / 2 + i] = value;
            w[j * (j + 1) / 2 + i] = value;
            if (!motor_finite(value)) { return MOTOR_NOT_FINITE; }
        }
    }

    /* factor it: a pivot is zero up to round-off, or positive */
    for (int j = 4 - 1; j >= 0; j--) {
        const float round_off = 4.7683716e-7f * p[j * (j + 1) / 2 + j];
        const float pivot = w[j * (j + 1) / 2 + j];
        if (!(-round_off <= pivot)) { return MOTOR_NOT_POSITIVE; }
        const float d = round_off < pivot ? pivot : 0.0f;
        w[j * (j + 1) / 2 + j] = d;
        for (int i = j - 1; i >= 0; i--) {
            const float rest = w[j * (j + 1) / 2 + i];
            if (d <= 0.0f && 1.9073486e-6f * p[j * (j + 1) / 2 + j] * p[i * (i + 1) / 2 + i] < rest
                * rest) {
                return MOTOR_NOT_POSITIVE;
            }
            const float u = d > 0.0f ? rest / d : 0.0f;
            for (int k = 0; k < i + 1; k++) {
                w[i * (i + 1) / 2 + k] = w[i * (i + 1) / 2 + k] - u * w[j * (j + 1) / 2 + k];
            }
            w[j * (j + 1) / 2 + i] = u;
        }
    }

    /* store */
    for (int k = 0; k < 10; k++) {
        kf->P[k] = p[k];
    }
    return MOTOR_OK;
}

void motor_get_covariance(const motor_t *kf, motor_real_t P[16])
{
    if (kf == NULL || P == NULL) { return; }
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = kf->P[j * (j + 1) / 2 + i];
            P[4 * i + j] = value;
            P[4 * j + i] = value;
        }
    }
}
/* kfgen: body 83280894bc476d9750e19f9a5c22ac5b */
