/* A planar vehicle of constant speed with a gyro: a plain dense EKF, written by hand for tests. */
#include "vehicle_small.h"

#include <math.h>

#define SPEED 5.0f
#define PI 3.14159274f

static size_t at(size_t i, size_t j)
{
    return i < j ? j * (j + 1) / 2 + i : i * (i + 1) / 2 + j;
}

static float wrap(float angle)
{
    return angle - 2.0f * PI * ceilf((angle - PI) / (2.0f * PI));
}

vehicle_small_status_t vehicle_small_init(vehicle_small_t *kf)
{
    static const vehicle_small_t initial = {
        { 0.0f, 0.0f, 0.25f }, { 1.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.25f }, { 0.5f }, 0.0f, 0u
    };
    if (kf == NULL) { return VEHICLE_SMALL_NULL_ARGUMENT; }
    *kf = initial;
    return VEHICLE_SMALL_OK;
}

vehicle_small_status_t vehicle_small_predict(vehicle_small_t *kf, const vehicle_small_inputs_t *u,
                                             vehicle_small_real_t dt)
{
    float F[3][3] = { { 1.0f, 0.0f, 0.0f }, { 0.0f, 1.0f, 0.0f }, { 0.0f, 0.0f, 1.0f } };
    float P[9], FP[3][3];
    if (kf == NULL || u == NULL) { return VEHICLE_SMALL_NULL_ARGUMENT; }
    if (!isfinite(u->gyro) || !isfinite(dt)) { return VEHICLE_SMALL_NOT_FINITE; }
    if (dt <= 0.0f) { return VEHICLE_SMALL_NOT_POSITIVE; }
    vehicle_small_get_covariance(kf, P);
    F[0][2] = -dt * SPEED * sinf(kf->x[2]);
    F[1][2] = dt * SPEED * cosf(kf->x[2]);
    for (size_t i = 0; i < 3; ++i) {
        for (size_t j = 0; j < 3; ++j) {
            FP[i][j] = F[i][0] * P[j] + F[i][1] * P[3 + j] + F[i][2] * P[6 + j];
        }
    }
    for (size_t i = 0; i < 3; ++i) {
        for (size_t j = i; j < 3; ++j) {
            kf->P[at(i, j)] = FP[i][0] * F[j][0] + FP[i][1] * F[j][1] + FP[i][2] * F[j][2];
        }
    }
    kf->P[0] += dt * kf->parameters.sigma_v * kf->parameters.sigma_v;
    kf->P[2] += dt * kf->parameters.sigma_v * kf->parameters.sigma_v;
    kf->P[5] += dt * 0.01f;
    kf->x[0] += dt * SPEED * cosf(kf->x[2]);
    kf->x[1] += dt * SPEED * sinf(kf->x[2]);
    kf->x[2] = wrap(kf->x[2] + dt * u->gyro);
    return VEHICLE_SMALL_OK;
}

/* one state measured directly, with innovation nu and variance r */
static float scalar_update(vehicle_small_t *kf, size_t state, float nu, float r)
{
    float P[9];
    vehicle_small_get_covariance(kf, P);
    const float s = P[state * 3 + state] + r;
    for (size_t i = 0; i < 3; ++i) {
        const float k = P[i * 3 + state] / s;
        kf->x[i] += k * nu;
        for (size_t j = i; j < 3; ++j) {
            kf->P[at(i, j)] -= k * P[state * 3 + j];
        }
    }
    kf->x[2] = wrap(kf->x[2]);
    return nu * nu / s;
}

vehicle_small_status_t vehicle_small_update_gnss_masked(vehicle_small_t *kf, const vehicle_small_gnss_t *z,
                                                        uint32_t mask)
{
    if (kf == NULL || z == NULL) { return VEHICLE_SMALL_NULL_ARGUMENT; }
    vehicle_small_t next = *kf;
    const float v[2] = { z->x, z->y };
    next.nis = 0.0f;
    for (size_t i = 0; i < 2; ++i) {
        if ((mask >> i & 1u) != 0u) {
            if (!isfinite(v[i])) { return VEHICLE_SMALL_NOT_FINITE; }
            next.nis += scalar_update(&next, i, v[i] - next.x[i], 0.64f);
        }
    }
    if (next.nis > 100.0f) {
        kf->nis = next.nis;
        kf->gate_count_gnss += 1u;
        return VEHICLE_SMALL_GATED;
    }
    if (mask != 0u) {
        next.gate_count_gnss = 0u;
        *kf = next;
    }
    return VEHICLE_SMALL_OK;
}

vehicle_small_status_t vehicle_small_update_gnss(vehicle_small_t *kf, const vehicle_small_gnss_t *z)
{
    return vehicle_small_update_gnss_masked(kf, z, 3u);
}

vehicle_small_status_t vehicle_small_update_compass(vehicle_small_t *kf, const vehicle_small_compass_t *z)
{
    if (kf == NULL || z == NULL) { return VEHICLE_SMALL_NULL_ARGUMENT; }
    if (!isfinite(z->heading)) { return VEHICLE_SMALL_NOT_FINITE; }
    kf->nis = scalar_update(kf, 2, wrap(z->heading - kf->x[2]), 0.01f);
    return VEHICLE_SMALL_OK;
}

vehicle_small_status_t vehicle_small_set_state(vehicle_small_t *kf, const vehicle_small_real_t x[3])
{
    if (kf == NULL || x == NULL) { return VEHICLE_SMALL_NULL_ARGUMENT; }
    if (!isfinite(x[0] + x[1] + x[2])) { return VEHICLE_SMALL_NOT_FINITE; }
    kf->x[0] = x[0];
    kf->x[1] = x[1];
    kf->x[2] = wrap(x[2]);
    return VEHICLE_SMALL_OK;
}

vehicle_small_status_t vehicle_small_set_covariance(vehicle_small_t *kf, const vehicle_small_real_t P[9])
{
    if (kf == NULL || P == NULL) { return VEHICLE_SMALL_NULL_ARGUMENT; }
    for (size_t i = 0; i < 3; ++i) {
        if (P[4 * i] < 0.0f) { return VEHICLE_SMALL_NOT_POSITIVE; }
    }
    for (size_t i = 0; i < 3; ++i) {
        for (size_t j = i; j < 3; ++j) {
            kf->P[at(i, j)] = P[3 * i + j];
        }
    }
    return VEHICLE_SMALL_OK;
}

void vehicle_small_get_covariance(const vehicle_small_t *kf, vehicle_small_real_t P[9])
{
    for (size_t i = 0; i < 3; ++i) {
        for (size_t j = 0; j < 3; ++j) {
            P[3 * i + j] = kf->P[at(i, j)];
        }
    }
}
