/* kfgen build pendulum.yaml */
#include "pendulum.h"

#include <math.h>

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "pendulum tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "pendulum tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool pendulum_finite(float a)
{
    const uint32_t exponent = 0x7f800000u;
    union { float value; uint32_t bits; } view;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

/* a in (-half, half], by whole turns of 2 half */
static float pendulum_wrap(float a, float half)
{
    if (a > half || a <= -half) {
        a -= (half + half) * ceilf((a - half) / (half + half));
        if (a > half || a <= -half) { a = half; } /* the last bit of a turn */
    }
    return a;
}

pendulum_status_t pendulum_init(pendulum_t *kf)
{
    if (kf == NULL) { return PENDULUM_NULL_ARGUMENT; }
    kf->x[PENDULUM_ANGLE] = 0.5f;
    kf->x[PENDULUM_RATE] = 0.0f;
    kf->S[0] = 0.2f;
    kf->S[1] = 0.0f;
    kf->S[2] = 1.0f;
    kf->nis = 0.0f;
    kf->gate_count_camera = 0;
    return PENDULUM_OK;
}

/* x <- f(x, u, w), in place */
static void pendulum_f(pendulum_real_t x[4])
{
    const float push = x[2];
    const float damping = x[3];
    const float angle = x[PENDULUM_ANGLE];
    const float rate = x[PENDULUM_RATE];
    const float sin_angle = sinf(angle);
    const float t0 = 0.1f + damping;
    const float t1 = push - 19.62f * sin_angle - rate * t0;
    const float t2 = rate + 0.01f * t1;
    const float sin_angle_1 = sinf(angle + 0.01f * rate);
    const float t3 = push - 19.62f * sin_angle_1 - t2 * t0;
    const float t4 = rate + 0.01f * t3;
    const float sin_angle_2 = sinf(angle + 0.01f * t2);
    const float t5 = push - 19.62f * sin_angle_2 - t4 * t0;
    const float t6 = rate + 0.02f * t5;
    const float sin_angle_3 = sinf(angle + 0.02f * t4);
    x[PENDULUM_ANGLE] = angle + 0.0033333334f * (rate + 2.0f * (t2 + t4) + t6);
    x[PENDULUM_RATE] = rate + 0.0033333334f
        * (t1 + 2.0f * (t3 + t5) + push - 19.62f * sin_angle_3 - t6 * t0);
}

/* what camera measures at x */
static void pendulum_h_camera(const pendulum_real_t x[2], pendulum_real_t z[2])
{
    const float angle = x[PENDULUM_ANGLE];
    const float sin_angle = sinf(angle);
    z[0] = 0.5f * sin_angle;
    const float cos_angle = cosf(angle);
    z[1] = -(0.5f * cos_angle);
}

/* what the points predict of camera: mean, covariance, covariances with the state */
static void pendulum_see_camera(const pendulum_real_t x[2],
                                const pendulum_real_t cloud[8],
                                pendulum_real_t seen[9])
{
    const float angle = x[PENDULUM_ANGLE];
    const float rate = x[PENDULUM_RATE];
    float point[2];
    float z[2];
    point[0] = angle;
    point[1] = rate;
    pendulum_h_camera(point, z);
    const float x_centre = z[0];
    const float y_centre = z[1];
    float shift_x = 0.0f;
    float shift_y = 0.0f;
    float s_x_x = 0.0f;
    float s_x_y = 0.0f;
    float s_y_y = 0.0f;
    float c_angle_x = 0.0f;
    float c_angle_y = 0.0f;
    float c_rate_x = 0.0f;
    float c_rate_y = 0.0f;

    /* points through h */
    for (int k = 0; k < 4; k++) {
        point[0] = angle + cloud[2 * k];
        point[1] = rate + cloud[2 * k + 1];
        pendulum_h_camera(point, z);
        const float dz_x = z[0] - x_centre;
        const float dz_y = z[1] - y_centre;
        shift_x = shift_x + dz_x;
        shift_y = shift_y + dz_y;
        s_x_x = s_x_x + dz_x * dz_x;
        s_x_y = s_x_y + dz_x * dz_y;
        s_y_y = s_y_y + dz_y * dz_y;
        c_angle_x = c_angle_x + cloud[2 * k] * dz_x;
        c_angle_y = c_angle_y + cloud[2 * k] * dz_y;
        c_rate_x = c_rate_x + cloud[2 * k + 1] * dz_x;
        c_rate_y = c_rate_y + cloud[2 * k + 1] * dz_y;
    }
    const float mean_x = 0.6666667f * shift_x;
    const float mean_y = 0.6666667f * shift_y;
    seen[0] = x_centre + mean_x;
    seen[1] = y_centre + mean_y;
    seen[2] = 0.6666667f * s_x_x + 1.75f * (mean_x * mean_x);
    seen[3] = 0.6666667f * s_x_y + 1.75f * (mean_x * mean_y);
    seen[4] = 0.6666667f * s_y_y + 1.75f * (mean_y * mean_y);
    seen[5] = 0.6666667f * c_angle_x;
    seen[6] = 0.6666667f * c_angle_y;
    seen[7] = 0.6666667f * c_rate_x;
    seen[8] = 0.6666667f * c_rate_y;
}

pendulum_status_t pendulum_predict(pendulum_t *kf)
{
    if (kf == NULL) { return PENDULUM_NULL_ARGUMENT; }
    const float angle = kf->x[PENDULUM_ANGLE];
    const float rate = kf->x[PENDULUM_RATE];

    /* sigma points */
    float points[32];
    const float s_angle_angle = kf->S[0];
    points[0] = 1.118034f * s_angle_angle;
    const float s_rate_angle = kf->S[1];
    points[1] = 1.118034f * s_rate_angle;
    points[2] = 0.0f;
    points[3] = 0.0f;
    points[8] = 0.0f;
    const float s_rate_rate = kf->S[2];
    points[9] = 1.118034f * s_rate_rate;
    points[10] = 0.0f;
    points[11] = 0.0f;
    points[16] = 0.0f;
    points[17] = 0.0f;
    points[18] = 0.3354102f;
    points[19] = 0.0f;
    points[24] = 0.0f;
    points[25] = 0.0f;
    points[26] = 0.0f;
    points[27] = 0.0559017f;
    for (int j = 0; j < 4; j++) {
        const float part_0 = points[8 * j];
        points[8 * j] = angle + part_0;
        points[8 * j + 4] = angle - part_0;
        const float part_1 = points[8 * j + 1];
        points[8 * j + 1] = rate + part_1;
        points[8 * j + 5] = rate - part_1;
        const float part_2 = points[8 * j + 2];
        points[8 * j + 2] = part_2;
        points[8 * j + 6] = -part_2;
        const float part_3 = points[8 * j + 3];
        points[8 * j + 3] = part_3;
        points[8 * j + 7] = -part_3;
    }
    float centre[4];
    centre[0] = angle;
    centre[1] = rate;
    centre[2] = 0.0f;
    centre[3] = 0.0f;
    pendulum_f(centre);
    const float angle_centre = centre[0];
    const float rate_centre = centre[1];
    float shift_angle = 0.0f;
    float shift_rate = 0.0f;
    float u_rate_angle = 0.0f;
    float d_rate = 0.0f;
    float d_angle = 0.0f;

    /* points through f, and their deviations */
    for (int k = 0; k < 8; k++) {
        pendulum_f(&points[4 * k]);
        const float dev_angle = pendulum_wrap(points[4 * k] - angle_centre, 3.1415927f);
        const float dev_rate = points[4 * k + 1] - rate_centre;
        shift_angle = shift_angle + dev_angle;
        shift_rate = shift_rate + dev_rate;
        const float t2 = 0.4f * dev_angle;
        const float t3 = d_angle + dev_angle * t2;
        const bool t4 = t3 > 0.0f;
        const float t5 = t4 ? d_angle / t3 : 1.0f;
        const float t6 = dev_rate - dev_angle * u_rate_angle;
        const float t1 = d_rate + t6 * (0.4f * t5 * t6);
        u_rate_angle = t5 * u_rate_angle + (t4 ? t2 / t3 : 0.0f) * dev_rate;
        d_rate = t1;
        d_angle = t3;
    }
    const float mean_angle = 0.4f * shift_angle;
    const float mean_rate = 0.4f * shift_rate;
    const float t7 = 0.7f * shift_angle;
    const float t8 = d_angle + mean_angle * t7;
    const bool t9 = t8 > 0.0f;
    const float t10 = t9 ? d_angle / t8 : 1.0f;
    const float t11 = mean_rate - mean_angle * u_rate_angle;
    const float t0 = d_rate + t11 * (1.75f * t10 * t11);
    u_rate_angle = t10 * u_rate_angle + (t9 ? t7 / t8 : 0.0f) * mean_rate;
    d_rate = t0;
    d_angle = t8;

    /* roots */
    const float s_rate_rate_next = sqrtf(d_rate);
    const float s_angle_angle_next = sqrtf(d_angle);
    const float s_rate_angle_next = u_rate_angle * s_angle_angle_next;
    const float angle_next = angle_centre + mean_angle;
    const float rate_next = rate_centre + mean_rate;

    /* guards */
    if (!pendulum_finite(angle_next + rate_next + s_rate_rate_next + s_angle_angle_next)) {
        return PENDULUM_NOT_FINITE;
    }

    /* store */
    kf->x[PENDULUM_ANGLE] = pendulum_wrap(angle_next, 3.1415927f);
    kf->x[PENDULUM_RATE] = rate_next;
    kf->S[0] = s_angle_angle_next;
    kf->S[1] = s_rate_angle_next;
    kf->S[2] = s_rate_rate_next;
    return PENDULUM_OK;
}

pendulum_status_t pendulum_update_camera(pendulum_t *kf, const pendulum_camera_t *z)
{
    if (kf == NULL || z == NULL) { return PENDULUM_NULL_ARGUMENT; }
    pendulum_status_t flags = PENDULUM_OK;

    /* innovation */
    const float angle = kf->x[PENDULUM_ANGLE];
    float seen[9];
    float cloud[8];
    const float s_angle_angle = kf->S[0];
    const float t0 = 0.8660254f * s_angle_angle;
    const float s_rate_angle = kf->S[1];
    const float t1 = 0.8660254f * s_rate_angle;
    cloud[0] = t0;
    cloud[1] = t1;
    cloud[2] = -t0;
    cloud[3] = -t1;
    cloud[4] = 0.0f;
    const float s_rate_rate = kf->S[2];
    const float t2 = 0.8660254f * s_rate_rate;
    cloud[5] = t2;
    cloud[6] = 0.0f;
    cloud[7] = -t2;
    pendulum_see_camera(kf->x, cloud, seen);
    const float h_x = seen[0];
    const float h_y = seen[1];

    /* its covariance S = L D L^T */
    const float s_x = seen[2] + 0.0001f;
    const float t3 = seen[4] + 0.0001f;
    const float y_x = z->x - h_x;
    const float y_y = z->y - h_y;
    const float t4 = 1.0f / s_x;
    const float t5 = seen[3] * t4;
    const float s_y = t3 - t5 * seen[3];
    const float t6 = y_y - t5 * y_x;
    const float t7 = y_x * t4;
    const bool t8 = 1.9073486e-6f * t3 < s_y;
    const float t9 = t8 ? seen[6] - t5 * seen[5] : 0.0f;
    const float t10 = t8 ? seen[8] - t5 * seen[7] : 0.0f;
    const float t11 = t6 * (t8 ? 1.0f / s_y : 0.0f);
    const float nis = y_x * t7 + t6 * t11;

    /* guards */
    if (!pendulum_finite(y_x + y_y + s_x + s_y)) { return PENDULUM_NOT_FINITE; }
    if (!(s_x > 0.0f)) { return PENDULUM_NOT_POSITIVE; }

    /* gate */
    const bool t12 = nis > 13.815511f;
    if (t12 && kf->gate_count_camera < 10u) {
        kf->nis = nis;
        kf->gate_count_camera = kf->gate_count_camera + 1u;
        return PENDULUM_GATED;
    }
    if (t12) { flags |= PENDULUM_ANOMALY; }

    /* gain and covariance */
    const float t13 = 1.0f / sqrtf(s_x);
    const float t14 = seen[7] * t13;
    const float t15 = seen[5] * t13;
    const float t16 = s_angle_angle * s_angle_angle;
    const float t17 = 3.637979e-12f * t16;
    const float t18 = t15 * t15;
    const bool t19 = t17 < t18;
    const float t20 = t16 - t18;
    const bool t21 = t19 && t20 <= 1.9073486e-6f * t16;
    if (t21) { flags |= PENDULUM_REGULARIZED; }
    const bool t22 = !t21;
    const bool t23 = t19 && t22;
    const float t24 = sqrtf(t23 ? t20 : 1.0f);
    const float t25 = t23 ? 1.0f / s_angle_angle : 0.0f;
    const float t26 = t15 * t25;
    const float t27 = t21 ? 0.0f : (t23 ? t24 : s_angle_angle);
    const float t28 = (s_rate_angle - t26 * t14) * (t23 ? s_angle_angle * (1.0f / t24) : 1.0f);
    const float t29 = (t23 ? t24 * t25 : 1.0f) * t14 - t26 * t28;
    const float t30 = s_rate_rate * s_rate_rate;
    const float t31 = 3.637979e-12f * (t30 + s_rate_angle * s_rate_angle);
    const float t32 = t29 * t29;
    const bool t33 = t22 && t31 < t32;
    const float t34 = t30 - t32;
    const bool t35 = t33 && t34 <= 1.9073486e-6f * t30;
    if (t35) { flags |= PENDULUM_REGULARIZED; }
    const bool t36 = t33 && !t35;
    const float t37 = t35 ? 0.0f : (t36 ? sqrtf(t36 ? t34 : 1.0f) : s_rate_rate);
    const float t38 = 1.0f / sqrtf(t8 ? s_y : 1.0f);
    const float t39 = t10 * t38;
    const float t40 = t9 * t38;
    const float t41 = t40 * t40;
    const bool t42 = t17 < t41;
    const float t43 = t27 * t27;
    const float t44 = t43 - t41;
    const bool t45 = t42 && t44 <= 1.9073486e-6f * t43;
    if (t45) { flags |= PENDULUM_REGULARIZED; }
    const bool t46 = !t45;
    const bool t47 = t42 && t46;
    const float t48 = sqrtf(t47 ? t44 : 1.0f);
    const float t49 = t47 ? 1.0f / t27 : 0.0f;
    const float t50 = t40 * t49;
    const float s_angle_angle_next = t45 ? 0.0f : (t47 ? t48 : t27);
    const float t51 = ((t21 ? 0.0f : t28) - t50 * t39) * (t47 ? t27 * (1.0f / t48) : 1.0f);
    const float t52 = (t47 ? t48 * t49 : 1.0f) * t39 - t50 * t51;
    const float s_rate_angle_next = t45 ? 0.0f : t51;
    const float t53 = t52 * t52;
    const bool t54 = t46 && t31 < t53;
    const float t55 = t37 * t37;
    const float t56 = t55 - t53;
    const bool t57 = t54 && t56 <= 1.9073486e-6f * t55;
    if (t57) { flags |= PENDULUM_REGULARIZED; }
    const bool t58 = t54 && !t57;
    const float s_rate_rate_next = t57 ? 0.0f : (t58 ? sqrtf(t58 ? t56 : 1.0f) : t37);

    /* state */
    const float rate_next = kf->x[PENDULUM_RATE] + seen[7] * t7 + t10 * t11;
    const float angle_next = angle + seen[5] * t7 + t9 * t11;

    /* guards */
    if (!pendulum_finite(nis + angle_next + rate_next)) { return PENDULUM_NOT_FINITE; }

    /* store */
    kf->x[PENDULUM_ANGLE] = pendulum_wrap(angle_next, 3.1415927f);
    kf->x[PENDULUM_RATE] = rate_next;
    kf->S[0] = s_angle_angle_next;
    kf->S[1] = s_rate_angle_next;
    kf->S[2] = s_rate_rate_next;
    kf->gate_count_camera = 0;
    kf->nis = nis;
    return flags;
}

pendulum_status_t pendulum_set_state(pendulum_t *kf, const pendulum_real_t x[2])
{
    if (kf == NULL || x == NULL) { return PENDULUM_NULL_ARGUMENT; }
    if (!pendulum_finite(x[PENDULUM_ANGLE])) { return PENDULUM_NOT_FINITE; }
    if (!pendulum_finite(x[PENDULUM_RATE])) { return PENDULUM_NOT_FINITE; }
    kf->x[PENDULUM_ANGLE] = pendulum_wrap(x[PENDULUM_ANGLE], 3.1415927f);
    kf->x[PENDULUM_RATE] = x[PENDULUM_RATE];
    return PENDULUM_OK;
}

pendulum_status_t pendulum_set_covariance(pendulum_t *kf, const pendulum_real_t P[4])
{
    if (kf == NULL || P == NULL) { return PENDULUM_NULL_ARGUMENT; }
    float p[3];
    float w[3];

    /* the upper triangle, column by column */
    for (int j = 0; j < 2; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = P[2 * (1 - j) + (1 - i)];
            p[j * (j + 1) / 2 + i] = value;
            w[j * (j + 1) / 2 + i] = value;
            if (!pendulum_finite(value)) { return PENDULUM_NOT_FINITE; }
        }
    }

    /* factor it: a pivot is zero up to round-off, or positive */
    for (int j = 2 - 1; j >= 0; j--) {
        const float round_off = 2.3841858e-7f * p[j * (j + 1) / 2 + j];
        const float pivot = w[j * (j + 1) / 2 + j];
        if (!(-round_off <= pivot)) { return PENDULUM_NOT_POSITIVE; }
        const float d = round_off < pivot ? pivot : 0.0f;
        w[j * (j + 1) / 2 + j] = d;
        for (int i = j - 1; i >= 0; i--) {
            const float rest = w[j * (j + 1) / 2 + i];
            if (d <= 0.0f && 9.536743e-7f * p[j * (j + 1) / 2 + j] * p[i * (i + 1) / 2 + i] < rest
                * rest) {
                return PENDULUM_NOT_POSITIVE;
            }
            const float u = d > 0.0f ? rest / d : 0.0f;
            for (int k = 0; k < i + 1; k++) {
                w[i * (i + 1) / 2 + k] = w[i * (i + 1) / 2 + k] - u * w[j * (j + 1) / 2 + k];
            }
            w[j * (j + 1) / 2 + i] = u;
        }
    }

    /* store */
    for (int j = 0; j < 2; j++) {
        const float root = sqrtf(w[j * (j + 1) / 2 + j]);
        kf->S[(1 - j) * (1 - j + 1) / 2 + (1 - j)] = root;
        for (int i = 0; i < j; i++) {
            kf->S[(1 - i) * (1 - i + 1) / 2 + (1 - j)] = w[j * (j + 1) / 2 + i] * root;
        }
    }
    return PENDULUM_OK;
}

void pendulum_get_covariance(const pendulum_t *kf, pendulum_real_t P[4])
{
    if (kf == NULL || P == NULL) { return; }
    for (int j = 0; j < 2; j++) {
        for (int i = 0; i < j + 1; i++) {
            float sum = 0.0f;
            for (int k = j; k < 2; k++) {
                sum = sum + kf->S[(1 - i) * (1 - i + 1) / 2 + (1 - k)]
                    * kf->S[(1 - j) * (1 - j + 1) / 2 + (1 - k)];
            }
            const float value = sum;
            P[2 * (1 - i) + (1 - j)] = value;
            P[2 * (1 - j) + (1 - i)] = value;
        }
    }
}

pendulum_status_t pendulum_set_sqrt_covariance(pendulum_t *kf, const pendulum_real_t S[4])
{
    if (kf == NULL || S == NULL) { return PENDULUM_NULL_ARGUMENT; }
    for (int i = 0; i < 2; i++) {
        float variance = 0.0f;
        for (int j = 0; j < i + 1; j++) {
            variance = variance + S[2 * i + j] * S[2 * i + j];
        }
        if (!pendulum_finite(variance)) { return PENDULUM_NOT_FINITE; }
    }

    /* columns may change their sign: the diagonal is kept positive */
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < i + 1; j++) {
            const float value = S[2 * i + j];
            kf->S[i * (i + 1) / 2 + j] = S[2 * j + j] < 0.0f ? -value : value;
        }
    }
    return PENDULUM_OK;
}

void pendulum_get_sqrt_covariance(const pendulum_t *kf, pendulum_real_t S[4])
{
    if (kf == NULL || S == NULL) { return; }
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < i + 1; j++) {
            S[2 * i + j] = kf->S[i * (i + 1) / 2 + j];
        }
        for (int j = i + 1; j < 2; j++) {
            S[2 * i + j] = 0.0f;
        }
    }
}
/* kfgen: body a950f2fb77644005e84aa629f880242e */
