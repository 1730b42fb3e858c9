/* kfgen build vehicle.yaml
 *
 * vehicle: planar vehicle with yaw rate, acceleration, GNSS position and wheel speed
 *
 * Extended Kalman filter, U D U^T covariance, bierman update, float
 *
 * state x (5)
 *   x          [m]             east of the first fix
 *   y          [m]             north of the first fix
 *   heading    [rad]    angle  anticlockwise from east
 *   speed      [m/s]
 *   gyro_bias  [rad/s]
 * order of the states inside U and D
 *   x, y, heading, gyro_bias, speed
 * step: given at each step, clamped to at least 0.001 s, at most 0.5 s
 *
 * RAM 112 bytes a filter. Operations:
 *   predict       94 mul, 62 add, 15 div, 10 compare, 1 cos, 16 select, 1 sin, 1 wrap
 *   update_gnss   95 mul, 70 add, 9 div, 13 compare, 20 select, 1 wrap
 *   update_speed  14 mul, 13 add, 1 div, 3 compare, 1 wrap
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * a5822e6d9ac5ed4a4d2538f84efbcac13cc319382c754cc2bcacaf2b884dacda
 * This file and vehicle.c are yours: use, change and ship them without condition.
 */
#ifndef VEHICLE_H_INCLUDED
#define VEHICLE_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define VEHICLE_NX 5
#define VEHICLE_NU 2
#define VEHICLE_NZ_GNSS 2
#define VEHICLE_NZ_SPEED 1

/* indices into x */
enum {
    VEHICLE_X,         /* [m] east of the first fix */
    VEHICLE_Y,         /* [m] north of the first fix */
    VEHICLE_HEADING,   /* [rad] anticlockwise from east */
    VEHICLE_SPEED,     /* [m/s] */
    VEHICLE_GYRO_BIAS  /* [rad/s] */
};

typedef float vehicle_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t vehicle_status_t;
#define VEHICLE_OK             0x000u
#define VEHICLE_REGULARIZED    0x001u /* a variance was limited, or taken to zero by round-off */
#define VEHICLE_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define VEHICLE_GLITCH_LARGE   0x004u /* an innovation was cut off */
#define VEHICLE_ANOMALY        0x008u /* an innovation beyond its variance was taken all the same */
#define VEHICLE_GATED          0x010u /* the measurement was refused; nothing but nis has changed */
#define VEHICLE_SATURATED      0x020u /* a number was clipped to its range */
#define VEHICLE_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define VEHICLE_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define VEHICLE_ERROR          0x100u /* errors from here up */
#define VEHICLE_NULL_ARGUMENT  0x100u /* a pointer is NULL */
#define VEHICLE_NOT_FINITE     0x200u /* an argument or a value of the model is NaN or infinite */
#define VEHICLE_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    vehicle_real_t yaw_rate; /* [rad/s] positive anticlockwise */
    vehicle_real_t accel;    /* [m/s^2] positive backwards */
} vehicle_inputs_t;

typedef struct {
    vehicle_real_t x; /* [m] east of the first fix */
    vehicle_real_t y; /* [m] north of the first fix */
} vehicle_gnss_t;

typedef struct {
    vehicle_real_t v; /* [m/s] */
} vehicle_speed_t;

typedef struct {
    vehicle_real_t gyro_noise;   /* [rad/s/sqrt(Hz)] more: the heading follows the fixes */
    vehicle_real_t accel_noise;  /* [m/s^2/sqrt(Hz)] acceleration noise with slopes and vibration */
    vehicle_real_t accel_offset; /* [m/s^2] what accel reads at constant speed */
    vehicle_real_t gnss_std;     /* [m] deviation of a fix per axis */
} vehicle_parameters_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    vehicle_real_t x[5];             /* state */
    /* unit upper triangular factor: U_ij, i < j, at j (j - 1) / 2 + i */
    vehicle_real_t U[10];
    vehicle_real_t D[5];             /* diagonal factor: P = U D U^T */
    vehicle_parameters_t parameters; /* may be changed while the filter runs */
    vehicle_real_t nis;              /* normalised innovation squared of the last update */
    uint32_t gate_count_gnss;        /* measurements of gnss refused in a row */
    uint32_t gate_count_speed;       /* measurements of speed refused in a row */
    bool initialized;                /* the first measurement has set the state */
} vehicle_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return VEHICLE_OK, or VEHICLE_NULL_ARGUMENT
 */
vehicle_status_t vehicle_init(vehicle_t *kf);

/**
 * Advance the estimate by a step of dt.
 *
 * @param kf  filter
 * @param u   yaw_rate [rad/s], accel [m/s^2]
 * @param dt  time step [s]
 * @return VEHICLE_OK, VEHICLE_DT_CLAMPED, or an error that leaves *kf as it was
 *
 * 94 mul, 62 add, 15 div, 10 compare, 1 cos, 16 select, 1 sin, 1 wrap.
 */
vehicle_status_t vehicle_predict(vehicle_t *kf, const vehicle_inputs_t *u, vehicle_real_t dt);

/**
 * Take a measurement of gnss into account.
 *
 * @param kf  filter
 * @param z   x [m], y [m]
 * @return VEHICLE_OK, VEHICLE_ANOMALY, VEHICLE_GATED, or an error that leaves *kf as it was
 *
 * 95 mul, 70 add, 9 div, 13 compare, 20 select, 1 wrap.
 */
vehicle_status_t vehicle_update_gnss(vehicle_t *kf, const vehicle_gnss_t *z);

/**
 * Take a measurement of speed into account.
 *
 * @param kf  filter
 * @param z   v [m/s]
 * @return VEHICLE_OK, VEHICLE_ANOMALY, VEHICLE_GATED, or an error that leaves *kf as it was
 *
 * 14 mul, 13 add, 1 div, 3 compare, 1 wrap.
 */
vehicle_status_t vehicle_update_speed(vehicle_t *kf, const vehicle_speed_t *z);

/**
 * Replace the state; angles are wrapped, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return VEHICLE_OK, or an error that leaves *kf as it was
 */
vehicle_status_t vehicle_set_state(vehicle_t *kf, const vehicle_real_t x[5]);

/**
 * Replace the covariance; the state stays.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return VEHICLE_OK, or an error that leaves *kf as it was
 */
vehicle_status_t vehicle_set_covariance(vehicle_t *kf, const vehicle_real_t P[25]);

/**
 * The covariance of the state, in the order of the states.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void vehicle_get_covariance(const vehicle_t *kf, vehicle_real_t P[25]);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body 5b40777851b8cadf25d70cb511e5d9a1 */
