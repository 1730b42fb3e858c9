/* kfgen build scalar.yaml */
#include "scalar.h"

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "scalar tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "scalar tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool scalar_finite(float a)
{
    const uint32_t exponent = 0x7f800000u;
    union { float value; uint32_t bits; } view;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

scalar_status_t scalar_init(scalar_t *kf)
{
    if (kf == NULL) { return SCALAR_NULL_ARGUMENT; }
    kf->x[SCALAR_LEVEL] = 1.0f;
    kf->D[0] = 1.0f;
    kf->nis = 0.0f;
    return SCALAR_OK;
}

scalar_status_t scalar_predict(scalar_t *kf)
{
    if (kf == NULL) { return SCALAR_NULL_ARGUMENT; }

    /* process noise */
    const float d_level = kf->D[0];
    const float d_level_next = d_level + 0.0001f;

    /* guards */
    if (!scalar_finite(d_level_next)) { return SCALAR_NOT_FINITE; }

    /* store */
    kf->D[0] = d_level_next;
    return SCALAR_OK;
}

scalar_status_t scalar_update_gauge(scalar_t *kf, const scalar_gauge_t *z)
{
    if (kf == NULL || z == NULL) { return SCALAR_NULL_ARGUMENT; }

    /* innovation */
    const float level = kf->x[SCALAR_LEVEL];
    const float y_height = z->height - level;

    /* gain and covariance */
    const float d_level = kf->D[0];
    const float s_height = 0.01f + d_level;
    const float t0 = 1.0f / s_height;
    const float d_level_next = d_level * (0.01f * t0);
    const float nis = y_height * (y_height * t0);

    /* state and innovation squared */
    const float level_next = level + d_level * t0 * y_height;

    /* guards */
    if (!scalar_finite(level_next + nis + s_height)) { return SCALAR_NOT_FINITE; }
    if (!(s_height > 0.0f)) { return SCALAR_NOT_POSITIVE; }

    /* store */
    kf->x[SCALAR_LEVEL] = level_next;
    kf->D[0] = d_level_next;
    kf->nis = nis;
    return SCALAR_OK;
}

scalar_status_t scalar_set_state(scalar_t *kf, const scalar_real_t x[1])
{
    if (kf == NULL || x == NULL) { return SCALAR_NULL_ARGUMENT; }
    if (!scalar_finite(x[SCALAR_LEVEL])) { return SCALAR_NOT_FINITE; }
    kf->x[SCALAR_LEVEL] = x[SCALAR_LEVEL];
    return SCALAR_OK;
}

scalar_status_t scalar_set_covariance(scalar_t *kf, const scalar_real_t P[1])
{
    if (kf == NULL || P == NULL) { return SCALAR_NULL_ARGUMENT; }
    float p[1];
    float w[1];

    /* the upper triangle, column by column */
    for (int j = 0; j < 1; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = P[i + j];
            p[j * (j + 1) / 2 + i] = value;
            w[j * (j + 1) / 2 + i] = value;
            if (!scalar_finite(value)) { return SCALAR_NOT_FINITE; }
        }
    }

    /* factor it: a pivot is zero up to round-off, or positive */
    for (int j = 1 - 1; j >= 0; j--) {
        const float round_off = 1.1920929e-7f * p[j * (j + 1) / 2 + j];
        const float pivot = w[j * (j + 1) / 2 + j];
        if (!(-round_off <= pivot)) { return SCALAR_NOT_POSITIVE; }
        const float d = round_off < pivot ? pivot : 0.0f;
        w[j * (j + 1) / 2 + j] = d;
        for (int i = j - 1; i >= 0; i--) {
            const float rest = w[j * (j + 1) / 2 + i];
            if (d <= 0.0f && 4.7683716e-7f * p[j * (j + 1) / 2 + j] * p[i * (i + 1) / 2 + i] < rest
                * rest) {
                return SCALAR_NOT_POSITIVE;
            }
            const float u = d > 0.0f ? rest / d : 0.0f;
            for (int k = 0; k < i + 1; k++) {
                w[i * (i + 1) / 2 + k] = w[i * (i + 1) / 2 + k] - u * w[j * (j + 1) / 2 + k];
            }
            w[j * (j + 1) / 2 + i] = u;
        }
    }

    /* store */
    for (int j = 0; j < 1; j++) {
        kf->D[j] = w[j * (j + 1) / 2 + j];
    }
    return SCALAR_OK;
}

void scalar_get_covariance(const scalar_t *kf, scalar_real_t P[1])
{
    if (kf == NULL || P == NULL) { return; }
    for (int j = 0; j < 1; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = kf->D[j];
            P[i + j] = value;
            P[i + j] = value;
        }
    }
}
/* kfgen: body 36c1bfde25f35759e05cb77905ad3d9d */
