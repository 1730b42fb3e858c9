/* kfgen build tracker.yaml
 *
 * tracker: constant velocity with outliers
 *
 * Kalman filter, U D U^T covariance, bierman update, robust, adaptive, float
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
 * RAM 68 bytes a filter. Operations:
 *   predict            35 mul, 27 add, 5 div, 1 compare, 2 select
 *   update_fix         108 mul, 71 add, 11 div, 2 abs, 14 compare, 2 log, 14 select
 *   update_fix_masked  129 mul, 71 add, 11 div, 2 sqrt, 2 abs, 14 compare, 2 log, 24 select
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * 7da978e2848cbea621c4f25bd4938420fb8ff6566814751d6a28b406cdc275ca
 * This file and tracker.c are yours: use, change and ship them without condition.
 */
#ifndef TRACKER_H_INCLUDED
#define TRACKER_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define TRACKER_NX 4
#define TRACKER_NZ_FIX 2

/* indices into x */
enum {
    TRACKER_PX, /* [m] */
    TRACKER_PY, /* [m] */
    TRACKER_VX, /* [m/s] */
    TRACKER_VY  /* [m/s] */
};

typedef float tracker_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t tracker_status_t;
#define TRACKER_OK             0x000u
#define TRACKER_REGULARIZED    0x001u /* a variance was limited, or taken to zero by round-off */
#define TRACKER_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define TRACKER_GLITCH_LARGE   0x004u /* an innovation was cut off */
#define TRACKER_ANOMALY        0x008u /* an innovation beyond its variance was taken all the same */
#define TRACKER_GATED          0x010u /* the measurement was refused; nothing but nis has changed */
#define TRACKER_SATURATED      0x020u /* a number was clipped to its range */
#define TRACKER_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define TRACKER_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define TRACKER_ERROR          0x100u /* errors from here up */
#define TRACKER_NULL_ARGUMENT  0x100u /* a pointer is NULL */
#define TRACKER_NOT_FINITE     0x200u /* an argument or a value of the model is NaN or infinite */
#define TRACKER_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    tracker_real_t x; /* [m] */
    tracker_real_t y; /* [m] */
} tracker_fix_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    tracker_real_t x[4];           /* state */
    /* unit upper triangular factor: U_ij, i < j, at j (j - 1) / 2 + i */
    tracker_real_t U[6];
    tracker_real_t D[4];           /* diagonal factor: P = U D U^T */
    tracker_real_t nis;            /* normalised innovation squared of the last update */
    tracker_real_t log_likelihood; /* of the last update */
    bool initialized;              /* the first measurement has set the state */
} tracker_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return TRACKER_OK, or TRACKER_NULL_ARGUMENT
 */
tracker_status_t tracker_init(tracker_t *kf);

/**
 * Advance the estimate by one step of 0.1 s.
 *
 * @param kf  filter
 * @return TRACKER_OK, or an error that leaves *kf as it was
 *
 * 35 mul, 27 add, 5 div, 1 compare, 2 select.
 */
tracker_status_t tracker_predict(tracker_t *kf);

/**
 * Take a measurement of fix into account.
 *
 * @param kf  filter
 * @param z   x [m], y [m]
 * @return TRACKER_OK, TRACKER_ANOMALY, TRACKER_GLITCH_LARGE, TRACKER_GLITCH_SMALL, or an error that
 *     leaves *kf as it was
 *
 * 108 mul, 71 add, 11 div, 2 abs, 14 compare, 2 log, 14 select.
 */
tracker_status_t tracker_update_fix(tracker_t *kf, const tracker_fix_t *z);

/**
 * Take the chosen components of a measurement of fix into account.
 *
 * @param kf    filter
 * @param z     measurement
 * @param mask  bit i: use component i
 * @return TRACKER_OK, TRACKER_ANOMALY, TRACKER_GLITCH_LARGE, TRACKER_GLITCH_SMALL, or an error that
 *     leaves *kf as it was
 *
 * 129 mul, 71 add, 11 div, 2 sqrt, 2 abs, 14 compare, 2 log, 24 select.
 */
tracker_status_t tracker_update_fix_masked(tracker_t *kf, const tracker_fix_t *z, uint32_t mask);

/**
 * Replace the state; angles are wrapped, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return TRACKER_OK, or an error that leaves *kf as it was
 */
tracker_status_t tracker_set_state(tracker_t *kf, const tracker_real_t x[4]);

/**
 * Replace the covariance; the state stays.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return TRACKER_OK, or an error that leaves *kf as it was
 */
tracker_status_t tracker_set_covariance(tracker_t *kf, const tracker_real_t P[16]);

/**
 * The covariance of the state, in the order of the states.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void tracker_get_covariance(const tracker_t *kf, tracker_real_t P[16]);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body 8e0a0f6ac7903124d01303247a10d54d */
