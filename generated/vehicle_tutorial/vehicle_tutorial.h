/* kfgen build vehicle_tutorial.yaml
 *
 * vehicle_tutorial: position, speed and heading from positions alone
 *
 * Extended Kalman filter, U D U^T covariance, bierman update, float
 *
 * state x (4)
 *   px  [m]
 *   py  [m]
 *   v   [m/s]
 *   th  [rad]
 * order of the states inside U and D
 *   px, v, py, th
 * step: 1/3 s, compiled in
 *
 * RAM 60 bytes a filter. Operations:
 *   predict          62 mul, 35 add, 9 div, 3 compare, 1 cos, 6 select, 1 sin
 *   update_position  58 mul, 42 add, 6 div, 2 compare
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * a474ff33431a763b81a09b8342d3676dd548ea0e0ec4da0bd7d9d103439ecde6
 * This file and vehicle_tutorial.c are yours: use, change and ship them without condition.
 */
#ifndef VEHICLE_TUTORIAL_H_INCLUDED
#define VEHICLE_TUTORIAL_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define VEHICLE_TUTORIAL_NX 4
#define VEHICLE_TUTORIAL_NZ_POSITION 2

/* indices into x */
enum {
    VEHICLE_TUTORIAL_PX, /* [m] */
    VEHICLE_TUTORIAL_PY, /* [m] */
    VEHICLE_TUTORIAL_V,  /* [m/s] */
    VEHICLE_TUTORIAL_TH  /* [rad] */
};

typedef float vehicle_tutorial_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t vehicle_tutorial_status_t;
#define VEHICLE_TUTORIAL_OK             0x000u
/* a variance was limited, or taken to zero by round-off */
#define VEHICLE_TUTORIAL_REGULARIZED    0x001u
#define VEHICLE_TUTORIAL_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define VEHICLE_TUTORIAL_GLITCH_LARGE   0x004u /* an innovation was cut off */
/* an innovation beyond its variance was taken all the same */
#define VEHICLE_TUTORIAL_ANOMALY        0x008u
/* the measurement was refused; nothing but nis has changed */
#define VEHICLE_TUTORIAL_GATED          0x010u
#define VEHICLE_TUTORIAL_SATURATED      0x020u /* a number was clipped to its range */
#define VEHICLE_TUTORIAL_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define VEHICLE_TUTORIAL_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define VEHICLE_TUTORIAL_ERROR          0x100u /* errors from here up */
#define VEHICLE_TUTORIAL_NULL_ARGUMENT  0x100u /* a pointer is NULL */
/* an argument or a value of the model is NaN or infinite */
#define VEHICLE_TUTORIAL_NOT_FINITE     0x200u
#define VEHICLE_TUTORIAL_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    vehicle_tutorial_real_t x; /* [m] */
    vehicle_tutorial_real_t y; /* [m] */
} vehicle_tutorial_position_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    vehicle_tutorial_real_t x[4]; /* state */
    /* unit upper triangular factor: U_ij, i < j, at j (j - 1) / 2 + i */
    vehicle_tutorial_real_t U[6];
    vehicle_tutorial_real_t D[4]; /* diagonal factor: P = U D U^T */
    vehicle_tutorial_real_t nis;  /* normalised innovation squared of the last update */
} vehicle_tutorial_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return VEHICLE_TUTORIAL_OK, or VEHICLE_TUTORIAL_NULL_ARGUMENT
 */
vehicle_tutorial_status_t vehicle_tutorial_init(vehicle_tutorial_t *kf);

/**
 * Advance the estimate by one step of 0.333333 s.
 *
 * @param kf  filter
 * @return VEHICLE_TUTORIAL_OK, or an error that leaves *kf as it was
 *
 * 62 mul, 35 add, 9 div, 3 compare, 1 cos, 6 select, 1 sin.
 */
vehicle_tutorial_status_t vehicle_tutorial_predict(vehicle_tutorial_t *kf);

/**
 * Take a measurement of position into account.
 *
 * @param kf  filter
 * @param z   x [m], y [m]
 * @return VEHICLE_TUTORIAL_OK, or an error that leaves *kf as it was
 *
 * 58 mul, 42 add, 6 div, 2 compare.
 */
vehicle_tutorial_status_t vehicle_tutorial_update_position(vehicle_tutorial_t *kf,
                                                           const vehicle_tutorial_position_t *z);

/**
 * Replace the state; angles are wrapped, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return VEHICLE_TUTORIAL_OK, or an error that leaves *kf as it was
 */
vehicle_tutorial_status_t vehicle_tutorial_set_state(vehicle_tutorial_t *kf,
                                                     const vehicle_tutorial_real_t x[4]);

/**
 * Replace the covariance; the state stays.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return VEHICLE_TUTORIAL_OK, or an error that leaves *kf as it was
 */
vehicle_tutorial_status_t vehicle_tutorial_set_covariance(vehicle_tutorial_t *kf,
                                                          const vehicle_tutorial_real_t P[16]);

/**
 * The covariance of the state, in the order of the states.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void vehicle_tutorial_get_covariance(const vehicle_tutorial_t *kf, vehicle_tutorial_real_t P[16]);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body f9bb3b14ff9711f20b44e9e79f2cdf72 */
