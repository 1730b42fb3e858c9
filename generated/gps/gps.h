/* kfgen build gps.yaml
 *
 * gps: position and clock of a receiver at rest from four pseudoranges
 *
 * Extended Kalman filter, U D U^T covariance, bierman update, double
 *
 * state x (5)
 *   x      [m]    ECEF
 *   y      [m]    ECEF
 *   z      [m]    ECEF
 *   clock  [m]    clock error as a length
 *   drift  [m/s]  how the clock error grows
 * order of the states inside U and D
 *   drift, clock, x, y, z
 * step: 1 s, compiled in
 *
 * RAM 168 bytes a filter. Operations:
 *   predict       15 mul, 17 add, 2 div
 *   update_range  213 mul, 184 add, 20 div, 4 sqrt, 8 compare, 4 select
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * aa4d86c27f174e7e6eae0542e4b35a57de7f7372cb2d3087c7af2e47ca1ef513
 * This file and gps.c are yours: use, change and ship them without condition.
 */
#ifndef GPS_H_INCLUDED
#define GPS_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GPS_NX 5
#define GPS_NU 12
#define GPS_NZ_RANGE 4

/* indices into x */
enum {
    GPS_X,     /* [m] ECEF */
    GPS_Y,     /* [m] ECEF */
    GPS_Z,     /* [m] ECEF */
    GPS_CLOCK, /* [m] clock error as a length */
    GPS_DRIFT  /* [m/s] how the clock error grows */
};

typedef double gps_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t gps_status_t;
#define GPS_OK             0x000u
#define GPS_REGULARIZED    0x001u /* a variance was limited, or taken to zero by round-off */
#define GPS_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define GPS_GLITCH_LARGE   0x004u /* an innovation was cut off */
#define GPS_ANOMALY        0x008u /* an innovation beyond its variance was taken all the same */
#define GPS_GATED          0x010u /* the measurement was refused; nothing but nis has changed */
#define GPS_SATURATED      0x020u /* a number was clipped to its range */
#define GPS_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define GPS_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define GPS_ERROR          0x100u /* errors from here up */
#define GPS_NULL_ARGUMENT  0x100u /* a pointer is NULL */
#define GPS_NOT_FINITE     0x200u /* an argument or a value of the model is NaN or infinite */
#define GPS_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    gps_real_t s1x; /* [m] */
    gps_real_t s1y; /* [m] */
    gps_real_t s1z; /* [m] */
    gps_real_t s2x; /* [m] */
    gps_real_t s2y; /* [m] */
    gps_real_t s2z; /* [m] */
    gps_real_t s3x; /* [m] */
    gps_real_t s3y; /* [m] */
    gps_real_t s3z; /* [m] */
    gps_real_t s4x; /* [m] */
    gps_real_t s4y; /* [m] */
    gps_real_t s4z; /* [m] */
} gps_inputs_t;

typedef struct {
    gps_real_t r1; /* [m] */
    gps_real_t r2; /* [m] */
    gps_real_t r3; /* [m] */
    gps_real_t r4; /* [m] */
} gps_range_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    gps_real_t x[5];  /* state */
    gps_real_t U[10]; /* unit upper triangular factor: U_ij, i < j, at j (j - 1) / 2 + i */
    gps_real_t D[5];  /* diagonal factor: P = U D U^T */
    gps_real_t nis;   /* normalised innovation squared of the last update */
} gps_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return GPS_OK, or GPS_NULL_ARGUMENT
 */
gps_status_t gps_init(gps_t *kf);

/**
 * Advance the estimate by one step of 1 s.
 *
 * @param kf  filter
 * @param u   s1x [m], s1y [m], s1z [m], s2x [m], s2y [m], s2z [m], s3x [m], s3y [m], s3z [m], s4x
 *            [m], s4y [m], s4z [m]
 * @return GPS_OK, or an error that leaves *kf as it was
 *
 * 15 mul, 17 add, 2 div.
 */
gps_status_t gps_predict(gps_t *kf, const gps_inputs_t *u);

/**
 * Take a measurement of range into account.
 *
 * @param kf  filter
 * @param z   r1 [m], r2 [m], r3 [m], r4 [m]
 * @param u   s1x [m], s1y [m], s1z [m], s2x [m], s2y [m], s2z [m], s3x [m], s3y [m], s3z [m], s4x
 *            [m], s4y [m], s4z [m]
 * @return GPS_OK, or an error that leaves *kf as it was
 *
 * 213 mul, 184 add, 20 div, 4 sqrt, 8 compare, 4 select.
 */
gps_status_t gps_update_range(gps_t *kf, const gps_range_t *z, const gps_inputs_t *u);

/**
 * Replace the state; angles are wrapped, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return GPS_OK, or an error that leaves *kf as it was
 */
gps_status_t gps_set_state(gps_t *kf, const gps_real_t x[5]);

/**
 * Replace the covariance; the state stays.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return GPS_OK, or an error that leaves *kf as it was
 */
gps_status_t gps_set_covariance(gps_t *kf, const gps_real_t P[25]);

/**
 * The covariance of the state, in the order of the states.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void gps_get_covariance(const gps_t *kf, gps_real_t P[25]);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body 2b7336ac1d3f27a37ee5052b90508e12 */
