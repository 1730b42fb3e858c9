/* kfgen build pendulum.yaml
 *
 * pendulum: swinging pendulum, seen by a camera
 *
 * Unscented Kalman filter, merwe points, lower triangular square root covariance, update by the
 *     whole vector, float
 *
 * state x (2)
 *   angle  [rad]    angle  0 hangs down
 *   rate   [rad/s]
 * step: 0.02 s, compiled in
 *
 * RAM 28 bytes a filter. Operations:
 *   predict        240 mul, 296 add, 18 div, 2 sqrt, 9 compare, 18 select, 36 sin, 9 wrap
 *   update_camera  103 mul, 84 add, 8 div, 6 sqrt, 12 compare, 5 cos, 24 select, 5 sin, 1 wrap
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * 5beda3b110ffd765cf11df607a6275016c21b0230f7c18e5ac7b7f713e7a4ea0
 * This file and pendulum.c are yours: use, change and ship them without condition.
 */
#ifndef PENDULUM_H_INCLUDED
#define PENDULUM_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define PENDULUM_NX 2
#define PENDULUM_NZ_CAMERA 2

/* indices into x */
enum {
    PENDULUM_ANGLE, /* [rad] 0 hangs down */
    PENDULUM_RATE   /* [rad/s] */
};

typedef float pendulum_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t pendulum_status_t;
#define PENDULUM_OK             0x000u
#define PENDULUM_REGULARIZED    0x001u /* a variance was limited, or taken to zero by round-off */
#define PENDULUM_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define PENDULUM_GLITCH_LARGE   0x004u /* an innovation was cut off */
/* an innovation beyond its variance was taken all the same */
#define PENDULUM_ANOMALY        0x008u
/* the measurement was refused; nothing but nis has changed */
#define PENDULUM_GATED          0x010u
#define PENDULUM_SATURATED      0x020u /* a number was clipped to its range */
#define PENDULUM_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define PENDULUM_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define PENDULUM_ERROR          0x100u /* errors from here up */
#define PENDULUM_NULL_ARGUMENT  0x100u /* a pointer is NULL */
#define PENDULUM_NOT_FINITE     0x200u /* an argument or a value of the model is NaN or infinite */
#define PENDULUM_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    pendulum_real_t x; /* [m] */
    pendulum_real_t y; /* [m] */
} pendulum_camera_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    pendulum_real_t x[2];       /* state */
    /* lower triangular root, P = S S^T: S_ij, i >= j, at i (i + 1) / 2 + j */
    pendulum_real_t S[3];
    pendulum_real_t nis;        /* normalised innovation squared of the last update */
    uint32_t gate_count_camera; /* measurements of camera refused in a row */
} pendulum_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return PENDULUM_OK, or PENDULUM_NULL_ARGUMENT
 */
pendulum_status_t pendulum_init(pendulum_t *kf);

/**
 * Advance the estimate by one step of 0.02 s.
 *
 * @param kf  filter
 * @return PENDULUM_OK, or an error that leaves *kf as it was
 *
 * 240 mul, 296 add, 18 div, 2 sqrt, 9 compare, 18 select, 36 sin, 9 wrap.
 */
pendulum_status_t pendulum_predict(pendulum_t *kf);

/**
 * Take a measurement of camera into account.
 *
 * @param kf  filter
 * @param z   x [m], y [m]
 * @return PENDULUM_OK, PENDULUM_ANOMALY, PENDULUM_REGULARIZED, PENDULUM_GATED, or an error that
 *     leaves *kf as it was
 *
 * 103 mul, 84 add, 8 div, 6 sqrt, 12 compare, 5 cos, 24 select, 5 sin, 1 wrap.
 */
pendulum_status_t pendulum_update_camera(pendulum_t *kf, const pendulum_camera_t *z);

/**
 * Replace the state; angles are wrapped, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return PENDULUM_OK, or an error that leaves *kf as it was
 */
pendulum_status_t pendulum_set_state(pendulum_t *kf, const pendulum_real_t x[2]);

/**
 * Replace the covariance; the state stays.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return PENDULUM_OK, or an error that leaves *kf as it was
 */
pendulum_status_t pendulum_set_covariance(pendulum_t *kf, const pendulum_real_t P[4]);

/**
 * The covariance of the state, in the order of the states.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void pendulum_get_covariance(const pendulum_t *kf, pendulum_real_t P[4]);

/**
 * Replace the covariance by S S^T; the state stays.
 *
 * @param kf  filter
 * @param S   lower triangular root, row-major; the lower triangle is read
 * @return PENDULUM_OK, or an error that leaves *kf as it was
 */
pendulum_status_t pendulum_set_sqrt_covariance(pendulum_t *kf, const pendulum_real_t S[4]);

/**
 * The lower Cholesky factor of the covariance, in the order of the states.
 *
 * @param kf  filter
 * @param S   lower triangular root, row-major
 */
void pendulum_get_sqrt_covariance(const pendulum_t *kf, pendulum_real_t S[4]);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body 0621a56035369541abaaecc096cda948 */
