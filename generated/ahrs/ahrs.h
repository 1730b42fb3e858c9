/* kfgen build ahrs.yaml
 *
 * ahrs: attitude and gyro bias from gyro, accelerometer and magnetometer
 *
 * Extended Kalman filter, full covariance, standard update, float
 *
 * state x (7)
 *   q_w           quaternion  attitude, sensor to earth
 *   q_x           quaternion  attitude, sensor to earth
 *   q_y           quaternion  attitude, sensor to earth
 *   q_z           quaternion  attitude, sensor to earth
 *   b_x  [rad/s]              gyro bias
 *   b_y  [rad/s]              gyro bias
 *   b_z  [rad/s]              gyro bias
 * step: given at each step, clamped to at least 0.001 s, at most 0.1 s
 *
 * RAM 144 bytes a filter. Operations:
 *   predict       loops
 *   update_accel  loops
 *   update_mag    loops
 *   update_start  loops
 * Recommended with gcc, for these long functions without branches:
 *   -O2 -fno-schedule-insns -flive-range-shrinkage -fno-tree-sink -frename-registers
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * 5ae18044bf3f42e59597fe048c5fe351d499a9b5050739f7d29228b5a11f12ff
 * This file and ahrs.c are yours: use, change and ship them without condition.
 */
#ifndef AHRS_H_INCLUDED
#define AHRS_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define AHRS_NX 7
#define AHRS_NE 6
#define AHRS_NU 3
#define AHRS_NZ_ACCEL 3
#define AHRS_NZ_MAG 3
#define AHRS_NZ_START 6

/* indices into x */
enum {
    AHRS_Q_W, /* attitude, sensor to earth */
    AHRS_Q_X, /* attitude, sensor to earth */
    AHRS_Q_Y, /* attitude, sensor to earth */
    AHRS_Q_Z, /* attitude, sensor to earth */
    AHRS_B_X, /* [rad/s] gyro bias */
    AHRS_B_Y, /* [rad/s] gyro bias */
    AHRS_B_Z  /* [rad/s] gyro bias */
};

/* indices into rows and columns of the covariance */
enum {
    AHRS_ERROR_Q_RX, /* [rad] of q, in the body's frame */
    AHRS_ERROR_Q_RY, /* [rad] of q, in the body's frame */
    AHRS_ERROR_Q_RZ, /* [rad] of q, in the body's frame */
    AHRS_ERROR_B_X,  /* [rad/s] gyro bias */
    AHRS_ERROR_B_Y,  /* [rad/s] gyro bias */
    AHRS_ERROR_B_Z   /* [rad/s] gyro bias */
};

typedef float ahrs_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t ahrs_status_t;
#define AHRS_OK             0x000u
#define AHRS_REGULARIZED    0x001u /* a variance was limited, or taken to zero by round-off */
#define AHRS_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define AHRS_GLITCH_LARGE   0x004u /* an innovation was cut off */
#define AHRS_ANOMALY        0x008u /* an innovation beyond its variance was taken all the same */
#define AHRS_GATED          0x010u /* the measurement was refused; nothing but nis has changed */
#define AHRS_SATURATED      0x020u /* a number was clipped to its range */
#define AHRS_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define AHRS_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define AHRS_ERROR          0x100u /* errors from here up */
#define AHRS_NULL_ARGUMENT  0x100u /* a pointer is NULL */
#define AHRS_NOT_FINITE     0x200u /* an argument or a value of the model is NaN or infinite */
#define AHRS_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    ahrs_real_t gx; /* [rad/s] */
    ahrs_real_t gy; /* [rad/s] */
    ahrs_real_t gz; /* [rad/s] */
} ahrs_inputs_t;

typedef struct {
    ahrs_real_t x; /* [m/s^2] */
    ahrs_real_t y; /* [m/s^2] */
    ahrs_real_t z; /* [m/s^2] */
} ahrs_accel_t;

typedef struct {
    ahrs_real_t x; /* [uT] */
    ahrs_real_t y; /* [uT] */
    ahrs_real_t z; /* [uT] */
} ahrs_mag_t;

typedef struct {
    ahrs_real_t a_x; /* [m/s^2] */
    ahrs_real_t a_y; /* [m/s^2] */
    ahrs_real_t a_z; /* [m/s^2] */
    ahrs_real_t b_x; /* [uT] */
    ahrs_real_t b_y; /* [uT] */
    ahrs_real_t b_z; /* [uT] */
} ahrs_start_t;

typedef struct {
    ahrs_real_t gyro_noise; /* [rad/s/sqrt(Hz)] more than at rest: scale, alignment */
    ahrs_real_t field_x;    /* [uT] where the device is */
    ahrs_real_t field_y;    /* [uT] where the device is */
    ahrs_real_t field_z;    /* [uT] where the device is */
} ahrs_parameters_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    ahrs_real_t x[7];             /* state */
    ahrs_real_t P[21];            /* covariance: P_ij, i <= j, at j (j + 1) / 2 + i */
    ahrs_parameters_t parameters; /* may be changed while the filter runs */
    ahrs_real_t nis;              /* normalised innovation squared of the last update */
    uint32_t gate_count_accel;    /* measurements of accel refused in a row */
    uint32_t gate_count_mag;      /* measurements of mag refused in a row */
    bool initialized;             /* the first measurement has set the state */
} ahrs_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return AHRS_OK, or AHRS_NULL_ARGUMENT
 */
ahrs_status_t ahrs_init(ahrs_t *kf);

/**
 * Advance the estimate by a step of dt.
 *
 * @param kf  filter
 * @param u   gx [rad/s], gy [rad/s], gz [rad/s]
 * @param dt  time step [s]
 * @return AHRS_OK, AHRS_DT_CLAMPED, AHRS_REGULARIZED, or an error that leaves *kf as it was
 */
ahrs_status_t ahrs_predict(ahrs_t *kf, const ahrs_inputs_t *u, ahrs_real_t dt);

/**
 * Take a measurement of accel into account.
 *
 * @param kf  filter
 * @param z   x [m/s^2], y [m/s^2], z [m/s^2]
 * @return AHRS_OK, AHRS_ANOMALY, AHRS_REGULARIZED, AHRS_GATED, or an error that leaves *kf as it
 *     was
 */
ahrs_status_t ahrs_update_accel(ahrs_t *kf, const ahrs_accel_t *z);

/**
 * Take a measurement of mag into account.
 *
 * @param kf  filter
 * @param z   x [uT], y [uT], z [uT]
 * @return AHRS_OK, AHRS_ANOMALY, AHRS_REGULARIZED, AHRS_GATED, or an error that leaves *kf as it
 *     was
 */
ahrs_status_t ahrs_update_mag(ahrs_t *kf, const ahrs_mag_t *z);

/**
 * Take a measurement of start into account.
 *
 * @param kf  filter
 * @param z   a_x [m/s^2], a_y [m/s^2], a_z [m/s^2], b_x [uT], b_y [uT], b_z [uT]
 * @return AHRS_OK, AHRS_REGULARIZED, or an error that leaves *kf as it was
 */
ahrs_status_t ahrs_update_start(ahrs_t *kf, const ahrs_start_t *z);

/**
 * Replace the state; angles are wrapped, quaternions normalised, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return AHRS_OK, or an error that leaves *kf as it was
 */
ahrs_status_t ahrs_set_state(ahrs_t *kf, const ahrs_real_t x[7]);

/**
 * Replace the covariance; the state stays.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return AHRS_OK, or an error that leaves *kf as it was
 */
ahrs_status_t ahrs_set_covariance(ahrs_t *kf, const ahrs_real_t P[36]);

/**
 * The covariance of the state, in the order of the states.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void ahrs_get_covariance(const ahrs_t *kf, ahrs_real_t P[36]);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body 62390ee1cf6352245f7cb9d907d9e020 */
