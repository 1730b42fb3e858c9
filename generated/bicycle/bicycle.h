/* kfgen build bicycle.yaml
 *
 * bicycle: a bicycle seen by lidar and radar, constant turn rate and speed
 *
 * Unscented Kalman filter, merwe points, U D U^T covariance, update by the whole vector, float
 *
 * state x (5)
 *   x        [m]
 *   y        [m]
 *   speed    [m/s]
 *   heading  [rad]    angle  anticlockwise from x
 *   turn     [rad/s]
 * step: given at each step, clamped to at least 0.001 s, at most 1 s
 *
 * RAM 88 bytes a filter. Operations:
 *   predict       593 mul, 483 add, 88 div, 5 sqrt, 46 compare, 11 cos, 90 select, 11 sin, 1 wrap
 *   update_lidar  94 mul, 69 add, 9 div, 2 compare, 1 wrap
 *   update_radar  524 mul, 515 add, 44 div, 16 sqrt, 11 atan2, 36 compare, 11 cos, 11 max, 62
 *       select, 11 sin, 12 wrap
 * Recommended with gcc, for these long functions without branches:
 *   -O2 -fno-schedule-insns -flive-range-shrinkage -fno-tree-sink -frename-registers
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * 6f0b96ac477f233bdd5a0b5e7392a8ccbdad232a962cd88853b8bed943f64340
 * This file and bicycle.c are yours: use, change and ship them without condition.
 */
#ifndef BICYCLE_H_INCLUDED
#define BICYCLE_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define BICYCLE_NX 5
#define BICYCLE_NZ_LIDAR 2
#define BICYCLE_NZ_RADAR 3

/* indices into x */
enum {
    BICYCLE_X,       /* [m] */
    BICYCLE_Y,       /* [m] */
    BICYCLE_SPEED,   /* [m/s] */
    BICYCLE_HEADING, /* [rad] anticlockwise from x */
    BICYCLE_TURN     /* [rad/s] */
};

typedef float bicycle_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t bicycle_status_t;
#define BICYCLE_OK             0x000u
#define BICYCLE_REGULARIZED    0x001u /* a variance was limited, or taken to zero by round-off */
#define BICYCLE_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define BICYCLE_GLITCH_LARGE   0x004u /* an innovation was cut off */
#define BICYCLE_ANOMALY        0x008u /* an innovation beyond its variance was taken all the same */
#define BICYCLE_GATED          0x010u /* the measurement was refused; nothing but nis has changed */
#define BICYCLE_SATURATED      0x020u /* a number was clipped to its range */
#define BICYCLE_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define BICYCLE_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define BICYCLE_ERROR          0x100u /* errors from here up */
#define BICYCLE_NULL_ARGUMENT  0x100u /* a pointer is NULL */
#define BICYCLE_NOT_FINITE     0x200u /* an argument or a value of the model is NaN or infinite */
#define BICYCLE_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    bicycle_real_t x; /* [m] */
    bicycle_real_t y; /* [m] */
} bicycle_lidar_t;

typedef struct {
    bicycle_real_t range;      /* [m] */
    bicycle_real_t bearing;    /* [rad] */
    bicycle_real_t range_rate; /* [m/s] */
} bicycle_radar_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    bicycle_real_t x[5];  /* state */
    bicycle_real_t U[10]; /* unit upper triangular factor: U_ij, i < j, at j (j - 1) / 2 + i */
    bicycle_real_t D[5];  /* diagonal factor: P = U D U^T */
    bicycle_real_t nis;   /* normalised innovation squared of the last update */
    bool initialized;     /* the first measurement has set the state */
} bicycle_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return BICYCLE_OK, or BICYCLE_NULL_ARGUMENT
 */
bicycle_status_t bicycle_init(bicycle_t *kf);

/**
 * Advance the estimate by a step of dt.
 *
 * @param kf  filter
 * @param dt  time step [s]
 * @return BICYCLE_OK, BICYCLE_DT_CLAMPED, or an error that leaves *kf as it was
 *
 * 593 mul, 483 add, 88 div, 5 sqrt, 46 compare, 11 cos, 90 select, 11 sin, 1 wrap.
 */
bicycle_status_t bicycle_predict(bicycle_t *kf, bicycle_real_t dt);

/**
 * Take a measurement of lidar into account.
 *
 * @param kf  filter
 * @param z   x [m], y [m]
 * @return BICYCLE_OK, or an error that leaves *kf as it was
 *
 * 94 mul, 69 add, 9 div, 2 compare, 1 wrap.
 */
bicycle_status_t bicycle_update_lidar(bicycle_t *kf, const bicycle_lidar_t *z);

/**
 * Take a measurement of radar into account.
 *
 * @param kf  filter
 * @param z   range [m], bearing [rad], range_rate [m/s]
 * @return BICYCLE_OK, BICYCLE_REGULARIZED, or an error that leaves *kf as it was
 *
 * 524 mul, 515 add, 44 div, 16 sqrt, 11 atan2, 36 compare, 11 cos, 11 max, 62 select, 11 sin, 12
 *
 * wrap.
 */
bicycle_status_t bicycle_update_radar(bicycle_t *kf, const bicycle_radar_t *z);

/**
 * Replace the state; angles are wrapped, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return BICYCLE_OK, or an error that leaves *kf as it was
 */
bicycle_status_t bicycle_set_state(bicycle_t *kf, const bicycle_real_t x[5]);

/**
 * Replace the covariance; the state stays.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return BICYCLE_OK, or an error that leaves *kf as it was
 */
bicycle_status_t bicycle_set_covariance(bicycle_t *kf, const bicycle_real_t P[25]);

/**
 * The covariance of the state, in the order of the states.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void bicycle_get_covariance(const bicycle_t *kf, bicycle_real_t P[25]);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body f9194718a0ab94ffb6e52d3edd53c9ff */
