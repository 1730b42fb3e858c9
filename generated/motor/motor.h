/* kfgen build motor.yaml
 *
 * motor: sensorless control of a synchronous motor at 20 kHz
 *
 * Extended Kalman filter, full covariance, standard update, float
 *
 * state x (4)
 *   ia  [A]             current along alpha
 *   ib  [A]             current along beta
 *   w   [rad/s]         electrical speed
 *   th  [rad]    angle  electrical angle
 * step: 50e-6 s, compiled in
 *
 * RAM 64 bytes a filter. Operations:
 *   predict          48 mul, 40 add, 1 cos, 1 sin, 1 wrap
 *   update_currents  40 mul, 32 add, 2 div, 2 compare, 1 wrap
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * 3108156ecdd281e050bf5d6574e37e2edeca207f6f18260f270223b1d11f4eab
 * This file and motor.c are yours: use, change and ship them without condition.
 */
#ifndef MOTOR_H_INCLUDED
#define MOTOR_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define MOTOR_NX 4
#define MOTOR_NU 2
#define MOTOR_NZ_CURRENTS 2

/* indices into x */
enum {
    MOTOR_IA, /* [A] current along alpha */
    MOTOR_IB, /* [A] current along beta */
    MOTOR_W,  /* [rad/s] electrical speed */
    MOTOR_TH  /* [rad] electrical angle */
};

typedef float motor_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t motor_status_t;
#define MOTOR_OK             0x000u
#define MOTOR_REGULARIZED    0x001u /* a variance was limited, or taken to zero by round-off */
#define MOTOR_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define MOTOR_GLITCH_LARGE   0x004u /* an innovation was cut off */
#define MOTOR_ANOMALY        0x008u /* an innovation beyond its variance was taken all the same */
#define MOTOR_GATED          0x010u /* the measurement was refused; nothing but nis has changed */
#define MOTOR_SATURATED      0x020u /* a number was clipped to its range */
#define MOTOR_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define MOTOR_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define MOTOR_ERROR          0x100u /* errors from here up */
#define MOTOR_NULL_ARGUMENT  0x100u /* a pointer is NULL */
#define MOTOR_NOT_FINITE     0x200u /* an argument or a value of the model is NaN or infinite */
#define MOTOR_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    motor_real_t ua; /* [V] voltage along alpha */
    motor_real_t ub; /* [V] voltage along beta */
} motor_inputs_t;

typedef struct {
    motor_real_t a; /* [A] */
    motor_real_t b; /* [A] */
} motor_currents_t;

typedef struct {
    motor_real_t accel; /* [rad/s^2] how fast the speed may change */
} motor_parameters_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    motor_real_t x[4];             /* state */
    motor_real_t P[10];            /* covariance: P_ij, i <= j, at j (j + 1) / 2 + i */
    motor_parameters_t parameters; /* may be changed while the filter runs */
    motor_real_t nis;              /* normalised innovation squared of the last update */
} motor_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return MOTOR_OK, or MOTOR_NULL_ARGUMENT
 */
motor_status_t motor_init(motor_t *kf);

/**
 * Advance the estimate by one step of 5e-05 s.
 *
 * @param kf  filter
 * @param u   ua [V], ub [V]
 * @return MOTOR_OK, MOTOR_REGULARIZED, or an error that leaves *kf as it was
 *
 * 48 mul, 40 add, 1 cos, 1 sin, 1 wrap.
 */
motor_status_t motor_predict(motor_t *kf, const motor_inputs_t *u);

/**
 * Take a measurement of currents into account.
 *
 * @param kf  filter
 * @param z   a [A], b [A]
 * @return MOTOR_OK, MOTOR_REGULARIZED, or an error that leaves *kf as it was
 *
 * 40 mul, 32 add, 2 div, 2 compare, 1 wrap.
 */
motor_status_t motor_update_currents(motor_t *kf, const motor_currents_t *z);

/**
 * Replace the state; angles are wrapped, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return MOTOR_OK, or an error that leaves *kf as it was
 */
motor_status_t motor_set_state(motor_t *kf, const motor_real_t x[4]);

/**
 * Replace the covariance; the state stays.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return MOTOR_OK, or an error that leaves *kf as it was
 */
motor_status_t motor_set_covariance(motor_t *kf, const motor_real_t P[16]);

/**
 * The covariance of the state, in the order of the states.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void motor_get_covariance(const motor_t *kf, motor_real_t P[16]);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body 394ad544dc8773096fe2ff1d9dca7baf */
