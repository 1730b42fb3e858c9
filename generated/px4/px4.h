/* kfgen build px4.yaml
 *
 * px4: attitude, velocity, position, biases, magnetic fields and wind of an aircraft
 *
 * Extended Kalman filter, full covariance, standard update, float
 *
 * state x (24)
 *   wind_n   [m/s]                wind, over ground
 *   wind_e   [m/s]                wind, over ground
 *   earth_x  [G]                  the earth's field
 *   earth_y  [G]                  the earth's field
 *   earth_z  [G]                  the earth's field
 *   body_x   [G]                  the field of the aircraft itself
 *   body_y   [G]                  the field of the aircraft itself
 *   body_z   [G]                  the field of the aircraft itself
 *   p_n      [m]                  position
 *   p_e      [m]                  position
 *   p_d      [m]                  position
 *   v_n      [m/s]                velocity
 *   v_e      [m/s]                velocity
 *   v_d      [m/s]                velocity
 *   q_w               quaternion  attitude, body to earth
 *   q_x               quaternion  attitude, body to earth
 *   q_y               quaternion  attitude, body to earth
 *   q_z               quaternion  attitude, body to earth
 *   bg_x     [rad/s]              gyro bias
 *   bg_y     [rad/s]              gyro bias
 *   bg_z     [rad/s]              gyro bias
 *   ba_x     [m/s^2]              accelerometer bias
 *   ba_y     [m/s^2]              accelerometer bias
 *   ba_z     [m/s^2]              accelerometer bias
 * step: 0.01 s, compiled in
 *
 * RAM 1204 bytes a filter. Operations:
 *   predict          loops
 *   update_gnss      loops
 *   update_baro      loops
 *   update_mag       loops
 *   update_airspeed  loops
 *   update_sideslip  loops
 *   update_flow      loops
 * Recommended with gcc, for these loops in small functions:
 *   -O2 -fno-inline -fno-tree-pre -fno-reorder-blocks
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * fbabca3e0c965cfb80165538f2525c8065273c7cf78cfc3d8310497c3d795a77
 * This file and px4.c are yours: use, change and ship them without condition.
 */
#ifndef PX4_H_INCLUDED
#define PX4_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define PX4_NX 24
#define PX4_NE 23
#define PX4_NU 6
#define PX4_NZ_GNSS 6
#define PX4_NZ_BARO 1
#define PX4_NZ_MAG 3
#define PX4_NZ_AIRSPEED 1
#define PX4_NZ_SIDESLIP 1
#define PX4_NZ_FLOW 2

/* indices into x */
enum {
    PX4_WIND_N,  /* [m/s] wind, over ground */
    PX4_WIND_E,  /* [m/s] wind, over ground */
    PX4_EARTH_X, /* [G] the earth's field */
    PX4_EARTH_Y, /* [G] the earth's field */
    PX4_EARTH_Z, /* [G] the earth's field */
    PX4_BODY_X,  /* [G] the field of the aircraft itself */
    PX4_BODY_Y,  /* [G] the field of the aircraft itself */
    PX4_BODY_Z,  /* [G] the field of the aircraft itself */
    PX4_P_N,     /* [m] position */
    PX4_P_E,     /* [m] position */
    PX4_P_D,     /* [m] position */
    PX4_V_N,     /* [m/s] velocity */
    PX4_V_E,     /* [m/s] velocity */
    PX4_V_D,     /* [m/s] velocity */
    PX4_Q_W,     /* attitude, body to earth */
    PX4_Q_X,     /* attitude, body to earth */
    PX4_Q_Y,     /* attitude, body to earth */
    PX4_Q_Z,     /* attitude, body to earth */
    PX4_BG_X,    /* [rad/s] gyro bias */
    PX4_BG_Y,    /* [rad/s] gyro bias */
    PX4_BG_Z,    /* [rad/s] gyro bias */
    PX4_BA_X,    /* [m/s^2] accelerometer bias */
    PX4_BA_Y,    /* [m/s^2] accelerometer bias */
    PX4_BA_Z     /* [m/s^2] accelerometer bias */
};

/* indices into rows and columns of the covariance */
enum {
    PX4_ERROR_WIND_N,  /* [m/s] wind, over ground */
    PX4_ERROR_WIND_E,  /* [m/s] wind, over ground */
    PX4_ERROR_EARTH_X, /* [G] the earth's field */
    PX4_ERROR_EARTH_Y, /* [G] the earth's field */
    PX4_ERROR_EARTH_Z, /* [G] the earth's field */
    PX4_ERROR_BODY_X,  /* [G] the field of the aircraft itself */
    PX4_ERROR_BODY_Y,  /* [G] the field of the aircraft itself */
    PX4_ERROR_BODY_Z,  /* [G] the field of the aircraft itself */
    PX4_ERROR_P_N,     /* [m] position */
    PX4_ERROR_P_E,     /* [m] position */
    PX4_ERROR_P_D,     /* [m] position */
    PX4_ERROR_V_N,     /* [m/s] velocity */
    PX4_ERROR_V_E,     /* [m/s] velocity */
    PX4_ERROR_V_D,     /* [m/s] velocity */
    PX4_ERROR_Q_RX,    /* [rad] of q, in the body's frame */
    PX4_ERROR_Q_RY,    /* [rad] of q, in the body's frame */
    PX4_ERROR_Q_RZ,    /* [rad] of q, in the body's frame */
    PX4_ERROR_BG_X,    /* [rad/s] gyro bias */
    PX4_ERROR_BG_Y,    /* [rad/s] gyro bias */
    PX4_ERROR_BG_Z,    /* [rad/s] gyro bias */
    PX4_ERROR_BA_X,    /* [m/s^2] accelerometer bias */
    PX4_ERROR_BA_Y,    /* [m/s^2] accelerometer bias */
    PX4_ERROR_BA_Z     /* [m/s^2] accelerometer bias */
};

typedef float px4_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t px4_status_t;
#define PX4_OK             0x000u
#define PX4_REGULARIZED    0x001u /* a variance was limited, or taken to zero by round-off */
#define PX4_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define PX4_GLITCH_LARGE   0x004u /* an innovation was cut off */
#define PX4_ANOMALY        0x008u /* an innovation beyond its variance was taken all the same */
#define PX4_GATED          0x010u /* the measurement was refused; nothing but nis has changed */
#define PX4_SATURATED      0x020u /* a number was clipped to its range */
#define PX4_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define PX4_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define PX4_ERROR          0x100u /* errors from here up */
#define PX4_NULL_ARGUMENT  0x100u /* a pointer is NULL */
#define PX4_NOT_FINITE     0x200u /* an argument or a value of the model is NaN or infinite */
#define PX4_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    px4_real_t gyro_x;  /* [rad/s] */
    px4_real_t gyro_y;  /* [rad/s] */
    px4_real_t gyro_z;  /* [rad/s] */
    px4_real_t accel_x; /* [m/s^2] specific force */
    px4_real_t accel_y; /* [m/s^2] specific force */
    px4_real_t accel_z; /* [m/s^2] specific force */
} px4_inputs_t;

typedef struct {
    px4_real_t p_n; /* [m] */
    px4_real_t p_e; /* [m] */
    px4_real_t p_d; /* [m] */
    px4_real_t v_n; /* [m/s] */
    px4_real_t v_e; /* [m/s] */
    px4_real_t v_d; /* [m/s] */
} px4_gnss_t;

typedef struct {
    px4_real_t height; /* [m] */
} px4_baro_t;

typedef struct {
    px4_real_t b_x; /* [G] */
    px4_real_t b_y; /* [G] */
    px4_real_t b_z; /* [G] */
} px4_mag_t;

typedef struct {
    px4_real_t speed; /* [m/s] */
} px4_airspeed_t;

typedef struct {
    px4_real_t beta; /* [rad] */
} px4_sideslip_t;

typedef struct {
    px4_real_t x;      /* [rad/s] */
    px4_real_t y;      /* [rad/s] */
    px4_real_t height; /* [m] above ground, along the camera's axis */
} px4_flow_t;

typedef struct {
    px4_real_t heading; /* [rad] */
} px4_outputs_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    px4_real_t x[24];  /* state */
    px4_real_t P[276]; /* covariance: P_ij, i <= j, at j (j + 1) / 2 + i */
    px4_real_t nis;    /* normalised innovation squared of the last update */
} px4_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return PX4_OK, or PX4_NULL_ARGUMENT
 */
px4_status_t px4_init(px4_t *kf);

/**
 * Advance the estimate by one step of 0.01 s.
 *
 * @param kf  filter
 * @param u   gyro_x [rad/s], gyro_y [rad/s], gyro_z [rad/s], accel_x [m/s^2], accel_y [m/s^2],
 *            accel_z [m/s^2]
 * @return PX4_OK, PX4_REGULARIZED, or an error that leaves *kf as it was
 */
px4_status_t px4_predict(px4_t *kf, const px4_inputs_t *u);

/**
 * Take a measurement of gnss into account.
 *
 * @param kf  filter
 * @param z   p_n [m], p_e [m], p_d [m], v_n [m/s], v_e [m/s], v_d [m/s]
 * @return PX4_OK, PX4_REGULARIZED, or an error that leaves *kf as it was
 */
px4_status_t px4_update_gnss(px4_t *kf, const px4_gnss_t *z);

/**
 * Take a measurement of baro into account.
 *
 * @param kf  filter
 * @param z   height [m]
 * @return PX4_OK, PX4_REGULARIZED, or an error that leaves *kf as it was
 */
px4_status_t px4_update_baro(px4_t *kf, const px4_baro_t *z);

/**
 * Take a measurement of mag into account.
 *
 * @param kf  filter
 * @param z   b_x [G], b_y [G], b_z [G]
 * @return PX4_OK, PX4_REGULARIZED, or an error that leaves *kf as it was
 */
px4_status_t px4_update_mag(px4_t *kf, const px4_mag_t *z);

/**
 * Take a measurement of airspeed into account.
 *
 * @param kf  filter
 * @param z   speed [m/s]
 * @return PX4_OK, PX4_REGULARIZED, or an error that leaves *kf as it was
 */
px4_status_t px4_update_airspeed(px4_t *kf, const px4_airspeed_t *z);

/**
 * Take a measurement of sideslip into account.
 *
 * @param kf  filter
 * @param z   beta [rad]
 * @return PX4_OK, PX4_REGULARIZED, or an error that leaves *kf as it was
 */
px4_status_t px4_update_sideslip(px4_t *kf, const px4_sideslip_t *z);

/**
 * Take a measurement of flow into account.
 *
 * @param kf  filter
 * @param z   x [rad/s], y [rad/s], height [m]
 * @return PX4_OK, PX4_REGULARIZED, or an error that leaves *kf as it was
 */
px4_status_t px4_update_flow(px4_t *kf, const px4_flow_t *z);

/**
 * Replace the state; angles are wrapped, quaternions normalised, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return PX4_OK, or an error that leaves *kf as it was
 */
px4_status_t px4_set_state(px4_t *kf, const px4_real_t x[24]);

/**
 * Replace the covariance; the state stays.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return PX4_OK, or an error that leaves *kf as it was
 */
px4_status_t px4_set_covariance(px4_t *kf, const px4_real_t P[529]);

/**
 * The covariance of the state, in the order of the states.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void px4_get_covariance(const px4_t *kf, px4_real_t P[529]);

/**
 * The outputs at the present estimate, and how well they are known.
 *
 * @param kf     filter
 * @param value  heading [rad]
 * @param std    their standard deviations, or NULL
 * @return PX4_OK, or an error that leaves *kf as it was
 */
px4_status_t px4_get_outputs(const px4_t *kf, px4_outputs_t *value, px4_outputs_t *std);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body e3ae0ba65ba2cd2fefedd24d8c0da245 */
