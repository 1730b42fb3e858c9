/* kfgen build ins.yaml
 *
 * ins: position, velocity and attitude from an inertial unit, GNSS and a magnetometer
 *
 * Extended Kalman filter, U D U^T covariance, bierman update, float
 *
 * state x (16)
 *   p_x   [m]                  position
 *   p_y   [m]                  position
 *   p_z   [m]                  position
 *   v_x   [m/s]                velocity
 *   v_y   [m/s]                velocity
 *   v_z   [m/s]                velocity
 *   q_w            quaternion  attitude, body to earth
 *   q_x            quaternion  attitude, body to earth
 *   q_y            quaternion  attitude, body to earth
 *   q_z            quaternion  attitude, body to earth
 *   bg_x  [rad/s]              gyro bias
 *   bg_y  [rad/s]              gyro bias
 *   bg_z  [rad/s]              gyro bias
 *   ba_x  [m/s^2]              accelerometer bias
 *   ba_y  [m/s^2]              accelerometer bias
 *   ba_z  [m/s^2]              accelerometer bias
 * order of the states inside U and D
 *   p_x, p_y, p_z, v_x, v_y, v_z, q_rx, q_ry, q_rz, ba_x, ba_y, ba_z, bg_x, bg_y, bg_z
 * step: 0.01 s, compiled in
 *
 * RAM 564 bytes a filter. Operations:
 *   predict      1936 mul, 1391 add, 129 div, 24 compare, 48 select
 *   update_gnss  loops
 *   update_mag   loops
 * Recommended with gcc, for these long functions without branches:
 *   -O2 -fno-schedule-insns -flive-range-shrinkage -fno-tree-sink -frename-registers
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * 315bd841227c004394bbfbc8908cdc4225f74a6ed6761deedac1166266f2a101
 * This file and ins.c are yours: use, change and ship them without condition.
 */
#ifndef INS_H_INCLUDED
#define INS_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define INS_NX 16
#define INS_NE 15
#define INS_NU 6
#define INS_NZ_GNSS 6
#define INS_NZ_MAG 3

/* indices into x */
enum {
    INS_P_X,  /* [m] position */
    INS_P_Y,  /* [m] position */
    INS_P_Z,  /* [m] position */
    INS_V_X,  /* [m/s] velocity */
    INS_V_Y,  /* [m/s] velocity */
    INS_V_Z,  /* [m/s] velocity */
    INS_Q_W,  /* attitude, body to earth */
    INS_Q_X,  /* attitude, body to earth */
    INS_Q_Y,  /* attitude, body to earth */
    INS_Q_Z,  /* attitude, body to earth */
    INS_BG_X, /* [rad/s] gyro bias */
    INS_BG_Y, /* [rad/s] gyro bias */
    INS_BG_Z, /* [rad/s] gyro bias */
    INS_BA_X, /* [m/s^2] accelerometer bias */
    INS_BA_Y, /* [m/s^2] accelerometer bias */
    INS_BA_Z  /* [m/s^2] accelerometer bias */
};

/* indices into rows and columns of the covariance */
enum {
    INS_ERROR_P_X,  /* [m] position */
    INS_ERROR_P_Y,  /* [m] position */
    INS_ERROR_P_Z,  /* [m] position */
    INS_ERROR_V_X,  /* [m/s] velocity */
    INS_ERROR_V_Y,  /* [m/s] velocity */
    INS_ERROR_V_Z,  /* [m/s] velocity */
    INS_ERROR_Q_RX, /* [rad] of q, in the body's frame */
    INS_ERROR_Q_RY, /* [rad] of q, in the body's frame */
    INS_ERROR_Q_RZ, /* [rad] of q, in the body's frame */
    INS_ERROR_BG_X, /* [rad/s] gyro bias */
    INS_ERROR_BG_Y, /* [rad/s] gyro bias */
    INS_ERROR_BG_Z, /* [rad/s] gyro bias */
    INS_ERROR_BA_X, /* [m/s^2] accelerometer bias */
    INS_ERROR_BA_Y, /* [m/s^2] accelerometer bias */
    INS_ERROR_BA_Z  /* [m/s^2] accelerometer bias */
};

typedef float ins_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t ins_status_t;
#define INS_OK             0x000u
#define INS_REGULARIZED    0x001u /* a variance was limited, or taken to zero by round-off */
#define INS_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define INS_GLITCH_LARGE   0x004u /* an innovation was cut off */
#define INS_ANOMALY        0x008u /* an innovation beyond its variance was taken all the same */
#define INS_GATED          0x010u /* the measurement was refused; nothing but nis has changed */
#define INS_SATURATED      0x020u /* a number was clipped to its range */
#define INS_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define INS_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define INS_ERROR          0x100u /* errors from here up */
#define INS_NULL_ARGUMENT  0x100u /* a pointer is NULL */
#define INS_NOT_FINITE     0x200u /* an argument or a value of the model is NaN or infinite */
#define INS_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    ins_real_t gyro_x;  /* [rad/s] */
    ins_real_t gyro_y;  /* [rad/s] */
    ins_real_t gyro_z;  /* [rad/s] */
    ins_real_t accel_x; /* [m/s^2] specific force, +g upwards at rest */
    ins_real_t accel_y; /* [m/s^2] specific force, +g upwards at rest */
    ins_real_t accel_z; /* [m/s^2] specific force, +g upwards at rest */
} ins_inputs_t;

typedef struct {
    ins_real_t p_x; /* [m] */
    ins_real_t p_y; /* [m] */
    ins_real_t p_z; /* [m] */
    ins_real_t v_x; /* [m/s] */
    ins_real_t v_y; /* [m/s] */
    ins_real_t v_z; /* [m/s] */
} ins_gnss_t;

typedef struct {
    ins_real_t b_x; /* [uT] */
    ins_real_t b_y; /* [uT] */
    ins_real_t b_z; /* [uT] */
} ins_mag_t;

typedef struct {
    ins_real_t field_x; /* [uT] the earth's field */
    ins_real_t field_y; /* [uT] the earth's field */
    ins_real_t field_z; /* [uT] the earth's field */
} ins_parameters_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    ins_real_t x[16];            /* state */
    /* unit upper triangular factor: U_ij, i < j, at j (j - 1) / 2 + i */
    ins_real_t U[105];
    ins_real_t D[15];            /* diagonal factor: P = U D U^T */
    ins_parameters_t parameters; /* may be changed while the filter runs */
    ins_real_t nis;              /* normalised innovation squared of the last update */
    bool initialized;            /* the first measurement has set the state */
} ins_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return INS_OK, or INS_NULL_ARGUMENT
 */
ins_status_t ins_init(ins_t *kf);

/**
 * Advance the estimate by one step of 0.01 s.
 *
 * @param kf  filter
 * @param u   gyro_x [rad/s], gyro_y [rad/s], gyro_z [rad/s], accel_x [m/s^2], accel_y [m/s^2],
 *            accel_z [m/s^2]
 * @return INS_OK, or an error that leaves *kf as it was
 *
 * 1936 mul, 1391 add, 129 div, 24 compare, 48 select.
 */
ins_status_t ins_predict(ins_t *kf, const ins_inputs_t *u);

/**
 * Take a measurement of gnss into account.
 *
 * @param kf  filter
 * @param z   p_x [m], p_y [m], p_z [m], v_x [m/s], v_y [m/s], v_z [m/s]
 * @param u   gyro_x [rad/s], gyro_y [rad/s], gyro_z [rad/s], accel_x [m/s^2], accel_y [m/s^2],
 *            accel_z [m/s^2]
 * @return INS_OK, or an error that leaves *kf as it was
 */
ins_status_t ins_update_gnss(ins_t *kf, const ins_gnss_t *z, const ins_inputs_t *u);

/**
 * Take a measurement of mag into account.
 *
 * @param kf  filter
 * @param z   b_x [uT], b_y [uT], b_z [uT]
 * @param u   gyro_x [rad/s], gyro_y [rad/s], gyro_z [rad/s], accel_x [m/s^2], accel_y [m/s^2],
 *            accel_z [m/s^2]
 * @return INS_OK, or an error that leaves *kf as it was
 */
ins_status_t ins_update_mag(ins_t *kf, const ins_mag_t *z, const ins_inputs_t *u);

/**
 * Replace the state; angles are wrapped, quaternions normalised, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return INS_OK, or an error that leaves *kf as it was
 */
ins_status_t ins_set_state(ins_t *kf, const ins_real_t x[16]);

/**
 * Replace the covariance; the state stays.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return INS_OK, or an error that leaves *kf as it was
 */
ins_status_t ins_set_covariance(ins_t *kf, const ins_real_t P[225]);

/**
 * The covariance of the state, in the order of the states.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void ins_get_covariance(const ins_t *kf, ins_real_t P[225]);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body cf8052364f9b05983135a7ff3121e78c */
