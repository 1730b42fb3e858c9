/* kfgen build scalar.yaml
 *
 * scalar: level of a tank from a noisy gauge
 *
 * Kalman filter, U D U^T covariance, bierman update, float
 *
 * state x (1)
 *   level  [m]
 * step: 1 s, compiled in
 *
 * RAM 12 bytes a filter. Operations:
 *   predict       1 add
 *   update_gauge  6 mul, 5 add, 1 div, 1 compare
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * 874cff36329667e7da8641f717958ac851b7240fcc7c2b52349f193c6346f64c
 * This file and scalar.c are yours: use, change and ship them without condition.
 */
#ifndef SCALAR_H_INCLUDED
#define SCALAR_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SCALAR_NX 1
#define SCALAR_NZ_GAUGE 1

/* indices into x */
enum {
    SCALAR_LEVEL  /* [m] */
};

typedef float scalar_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t scalar_status_t;
#define SCALAR_OK             0x000u
#define SCALAR_REGULARIZED    0x001u /* a variance was limited, or taken to zero by round-off */
#define SCALAR_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define SCALAR_GLITCH_LARGE   0x004u /* an innovation was cut off */
#define SCALAR_ANOMALY        0x008u /* an innovation beyond its variance was taken all the same */
#define SCALAR_GATED          0x010u /* the measurement was refused; nothing but nis has changed */
#define SCALAR_SATURATED      0x020u /* a number was clipped to its range */
#define SCALAR_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define SCALAR_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define SCALAR_ERROR          0x100u /* errors from here up */
#define SCALAR_NULL_ARGUMENT  0x100u /* a pointer is NULL */
#define SCALAR_NOT_FINITE     0x200u /* an argument or a value of the model is NaN or infinite */
#define SCALAR_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    scalar_real_t height; /* [m] */
} scalar_gauge_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    scalar_real_t x[1]; /* state */
    scalar_real_t D[1]; /* diagonal factor: P = U D U^T */
    scalar_real_t nis;  /* normalised innovation squared of the last update */
} scalar_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return SCALAR_OK, or SCALAR_NULL_ARGUMENT
 */
scalar_status_t scalar_init(scalar_t *kf);

/**
 * Advance the estimate by one step of 1 s.
 *
 * @param kf  filter
 * @return SCALAR_OK, or an error that leaves *kf as it was
 *
 * 1 add.
 */
scalar_status_t scalar_predict(scalar_t *kf);

/**
 * Take a measurement of gauge into account.
 *
 * @param kf  filter
 * @param z   height [m]
 * @return SCALAR_OK, or an error that leaves *kf as it was
 *
 * 6 mul, 5 add, 1 div, 1 compare.
 */
scalar_status_t scalar_update_gauge(scalar_t *kf, const scalar_gauge_t *z);

/**
 * Replace the state; angles are wrapped, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return SCALAR_OK, or an error that leaves *kf as it was
 */
scalar_status_t scalar_set_state(scalar_t *kf, const scalar_real_t x[1]);

/**
 * Replace the covariance; the state stays.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return SCALAR_OK, or an error that leaves *kf as it was
 */
scalar_status_t scalar_set_covariance(scalar_t *kf, const scalar_real_t P[1]);

/**
 * The covariance of the state, in the order of the states.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void scalar_get_covariance(const scalar_t *kf, scalar_real_t P[1]);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body 165f8656fd3fff22a49bc7e028757166 */
