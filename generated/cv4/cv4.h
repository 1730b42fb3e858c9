/* kfgen build cv4.yaml
 *
 * cv4: constant velocity in the plane, fixed step
 *
 * Kalman filter, U D U^T covariance, bierman update, float
 *
 * state x (4)
 *   px  [m]
 *   py  [m]
 *   vx  [m/s]
 *   vy  [m/s]
 * order of the states inside U and D
 *   px, vx, py, vy
 * step: 0.1 s, compiled in
 *
 * RAM 60 bytes a filter. Operations:
 *   predict          45 mul, 29 add, 6 div
 *   update_position  58 mul, 42 add, 6 div, 2 compare
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * 2c05ad735774c90d9fe1eeb701640aff030758bed3483e7adcc0817be532fe2f
 * This file and cv4.c are yours: use, change and ship them without condition.
 */
#ifndef CV4_H_INCLUDED
#define CV4_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define CV4_NX 4
#define CV4_NZ_POSITION 2

/* indices into x */
enum {
    CV4_PX, /* [m] */
    CV4_PY, /* [m] */
    CV4_VX, /* [m/s] */
    CV4_VY  /* [m/s] */
};

typedef float cv4_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t cv4_status_t;
#define CV4_OK             0x000u
#define CV4_REGULARIZED    0x001u /* a variance was limited, or taken to zero by round-off */
#define CV4_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define CV4_GLITCH_LARGE   0x004u /* an innovation was cut off */
#define CV4_ANOMALY        0x008u /* an innovation beyond its variance was taken all the same */
#define CV4_GATED          0x010u /* the measurement was refused; nothing but nis has changed */
#define CV4_SATURATED      0x020u /* a number was clipped to its range */
#define CV4_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define CV4_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define CV4_ERROR          0x100u /* errors from here up */
#define CV4_NULL_ARGUMENT  0x100u /* a pointer is NULL */
#define CV4_NOT_FINITE     0x200u /* an argument or a value of the model is NaN or infinite */
#define CV4_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    cv4_real_t x; /* [m] */
    cv4_real_t y; /* [m] */
} cv4_position_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    cv4_real_t x[4]; /* state */
    cv4_real_t U[6]; /* unit upper triangular factor: U_ij, i < j, at j (j - 1) / 2 + i */
    cv4_real_t D[4]; /* diagonal factor: P = U D U^T */
    cv4_real_t nis;  /* normalised innovation squared of the last update */
} cv4_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return CV4_OK, or CV4_NULL_ARGUMENT
 */
cv4_status_t cv4_init(cv4_t *kf);

/**
 * Advance the estimate by one step of 0.1 s.
 *
 * @param kf  filter
 * @return CV4_OK, or an error that leaves *kf as it was
 *
 * 45 mul, 29 add, 6 div.
 */
cv4_status_t cv4_predict(cv4_t *kf);

/**
 * Take a measurement of position into account.
 *
 * @param kf  filter
 * @param z   x [m], y [m]
 * @return CV4_OK, or an error that leaves *kf as it was
 *
 * 58 mul, 42 add, 6 div, 2 compare.
 */
cv4_status_t cv4_update_position(cv4_t *kf, const cv4_position_t *z);

/**
 * Replace the state; angles are wrapped, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return CV4_OK, or an error that leaves *kf as it was
 */
cv4_status_t cv4_set_state(cv4_t *kf, const cv4_real_t x[4]);

/**
 * Replace the covariance; the state stays.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return CV4_OK, or an error that leaves *kf as it was
 */
cv4_status_t cv4_set_covariance(cv4_t *kf, const cv4_real_t P[16]);

/**
 * The covariance of the state, in the order of the states.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void cv4_get_covariance(const cv4_t *kf, cv4_real_t P[16]);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body 3c74f378c5fac47fcc608e23c67b649c */
