/* kfgen build battery.yaml
 *
 * battery: state of charge of a LiFePO4 cell
 *
 * Extended Kalman filter, U D U^T covariance, bierman update, float
 *
 * state x (3)
 *   soc          state of charge, 1 is full
 *   v_fast  [V]  voltage of the 20 s pair
 *   v_slow  [V]  voltage of the 300 s pair
 * step: 1 s, compiled in
 *
 * RAM 40 bytes a filter. Operations:
 *   predict          33 mul, 23 add, 3 div, 2 compare, 2 select
 *   update_terminal  50 mul, 39 add, 3 div, 11 compare, 11 select, 1 slope, 1 table
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * 6b2a56f7d06d944fc4838eb90bda663064251cf3893ba9c8b011eb1467f19d7a
 * This file and battery.c are yours: use, change and ship them without condition.
 */
#ifndef BATTERY_H_INCLUDED
#define BATTERY_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define BATTERY_NX 3
#define BATTERY_NU 1
#define BATTERY_NZ_TERMINAL 1

/* indices into x */
enum {
    BATTERY_SOC,    /* state of charge, 1 is full */
    BATTERY_V_FAST, /* [V] voltage of the 20 s pair */
    BATTERY_V_SLOW  /* [V] voltage of the 300 s pair */
};

typedef float battery_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t battery_status_t;
#define BATTERY_OK             0x000u
#define BATTERY_REGULARIZED    0x001u /* a variance was limited, or taken to zero by round-off */
#define BATTERY_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define BATTERY_GLITCH_LARGE   0x004u /* an innovation was cut off */
#define BATTERY_ANOMALY        0x008u /* an innovation beyond its variance was taken all the same */
#define BATTERY_GATED          0x010u /* the measurement was refused; nothing but nis has changed */
#define BATTERY_SATURATED      0x020u /* a number was clipped to its range */
#define BATTERY_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define BATTERY_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define BATTERY_ERROR          0x100u /* errors from here up */
#define BATTERY_NULL_ARGUMENT  0x100u /* a pointer is NULL */
#define BATTERY_NOT_FINITE     0x200u /* an argument or a value of the model is NaN or infinite */
#define BATTERY_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    battery_real_t current; /* [A] positive discharges the cell */
} battery_inputs_t;

typedef struct {
    battery_real_t voltage; /* [V] */
} battery_terminal_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    battery_real_t x[3]; /* state */
    battery_real_t U[3]; /* unit upper triangular factor: U_ij, i < j, at j (j - 1) / 2 + i */
    battery_real_t D[3]; /* diagonal factor: P = U D U^T */
    battery_real_t nis;  /* normalised innovation squared of the last update */
} battery_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return BATTERY_OK, or BATTERY_NULL_ARGUMENT
 */
battery_status_t battery_init(battery_t *kf);

/**
 * Advance the estimate by one step of 1 s.
 *
 * @param kf  filter
 * @param u   current [A]
 * @return BATTERY_OK, or an error that leaves *kf as it was
 *
 * 33 mul, 23 add, 3 div, 2 compare, 2 select.
 */
battery_status_t battery_predict(battery_t *kf, const battery_inputs_t *u);

/**
 * Take a measurement of terminal into account.
 *
 * @param kf  filter
 * @param z   voltage [V]
 * @param u   current [A]
 * @return BATTERY_OK, or an error that leaves *kf as it was
 *
 * 50 mul, 39 add, 3 div, 11 compare, 11 select, 1 slope, 1 table.
 */
battery_status_t battery_update_terminal(battery_t *kf,
                                         const battery_terminal_t *z,
                                         const battery_inputs_t *u);

/**
 * Replace the state; angles are wrapped, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return BATTERY_OK, or an error that leaves *kf as it was
 */
battery_status_t battery_set_state(battery_t *kf, const battery_real_t x[3]);

/**
 * Replace the covariance; the state stays.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return BATTERY_OK, or an error that leaves *kf as it was
 */
battery_status_t battery_set_covariance(battery_t *kf, const battery_real_t P[9]);

/**
 * The covariance of the state, in the order of the states.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void battery_get_covariance(const battery_t *kf, battery_real_t P[9]);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body e9af3aad7d7c9e739afac66566c16406 */
