/* kfgen build maneuver.yaml
 *
 * maneuver: an aircraft in three modes, seen by a radar
 *
 * Interacting multiple model of 3 modes, float
 *
 * state x (6)
 *   px  [m]
 *   py  [m]
 *   v   [m/s]
 *   th  [rad]    angle  course, from x towards y
 *   a   [m/s^2]         acceleration along the course
 *   w   [rad/s]         turn rate
 * modes
 *   cruise: Extended Kalman filter, full covariance, standard update
 *   speed: Extended Kalman filter, full covariance, standard update
 *   turn: Extended Kalman filter, full covariance, standard update
 * step: 1 s, compiled in
 *
 * RAM 380 bytes a filter. Operations:
 *   predict       464 mul, 451 add, 6 div, 11 compare, 3 cos, 20 select, 3 sin, 15 wrap
 *   update_radar  340 mul, 319 add, 17 div, 3 sqrt, 3 atan2, 23 compare, 3 exp, 6 log, 3 max, 2
 *       min, 14 select, 10 wrap
 * Recommended with gcc, for these long functions without branches:
 *   -O2 -fno-schedule-insns -flive-range-shrinkage -fno-tree-sink -frename-registers
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * ff3d9dc94d172a62a220e382eed7543860b6d701bb7f1544d75363126a2e27b9
 * This file and maneuver.c are yours: use, change and ship them without condition.
 */
#ifndef MANEUVER_H_INCLUDED
#define MANEUVER_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define MANEUVER_NX 6
#define MANEUVER_NB 3
#define MANEUVER_NZ_RADAR 2

/* indices into x */
enum {
    MANEUVER_PX, /* [m] */
    MANEUVER_PY, /* [m] */
    MANEUVER_V,  /* [m/s] */
    MANEUVER_TH, /* [rad] course, from x towards y */
    MANEUVER_A,  /* [m/s^2] acceleration along the course */
    MANEUVER_W   /* [rad/s] turn rate */
};

/* indices into mu */
enum {
    MANEUVER_MODE_CRUISE,
    MANEUVER_MODE_SPEED,
    MANEUVER_MODE_TURN
};

typedef float maneuver_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t maneuver_status_t;
#define MANEUVER_OK             0x000u
#define MANEUVER_REGULARIZED    0x001u /* a variance was limited, or taken to zero by round-off */
#define MANEUVER_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define MANEUVER_GLITCH_LARGE   0x004u /* an innovation was cut off */
/* an innovation beyond its variance was taken all the same */
#define MANEUVER_ANOMALY        0x008u
/* the measurement was refused; nothing but nis has changed */
#define MANEUVER_GATED          0x010u
#define MANEUVER_SATURATED      0x020u /* a number was clipped to its range */
#define MANEUVER_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define MANEUVER_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define MANEUVER_ERROR          0x100u /* errors from here up */
#define MANEUVER_NULL_ARGUMENT  0x100u /* a pointer is NULL */
#define MANEUVER_NOT_FINITE     0x200u /* an argument or a value of the model is NaN or infinite */
#define MANEUVER_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    maneuver_real_t range;   /* [m] */
    maneuver_real_t bearing; /* [rad] */
} maneuver_radar_t;

typedef struct {
    maneuver_real_t x[6];  /* state */
    maneuver_real_t P[21]; /* covariance: P_ij, i <= j, at j (j + 1) / 2 + i */
    maneuver_real_t nis;   /* normalised innovation squared of the last update */
} maneuver_mode_cruise_t;

typedef struct {
    maneuver_real_t x[6];  /* state */
    maneuver_real_t P[21]; /* covariance: P_ij, i <= j, at j (j + 1) / 2 + i */
    maneuver_real_t nis;   /* normalised innovation squared of the last update */
} maneuver_mode_speed_t;

typedef struct {
    maneuver_real_t x[6];  /* state */
    maneuver_real_t P[21]; /* covariance: P_ij, i <= j, at j (j + 1) / 2 + i */
    maneuver_real_t nis;   /* normalised innovation squared of the last update */
} maneuver_mode_turn_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    maneuver_real_t x[6];      /* state */
    maneuver_real_t mu[3];     /* probabilities of the modes */
    struct {
        maneuver_mode_cruise_t cruise;
        maneuver_mode_speed_t speed;
        maneuver_mode_turn_t turn;
    } modes; /* the filters of the modes */
    maneuver_real_t nis;       /* normalised innovation squared of the last update */
    uint32_t gate_count_radar; /* measurements of radar refused in a row */
} maneuver_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return MANEUVER_OK, or MANEUVER_NULL_ARGUMENT
 */
maneuver_status_t maneuver_init(maneuver_t *kf);

/**
 * Advance the estimate by one step of 1 s.
 *
 * @param kf  filter
 * @return MANEUVER_OK, MANEUVER_REGULARIZED, or an error that leaves *kf as it was
 *
 * 464 mul, 451 add, 6 div, 11 compare, 3 cos, 20 select, 3 sin, 15 wrap.
 */
maneuver_status_t maneuver_predict(maneuver_t *kf);

/**
 * Take a measurement of radar into account.
 *
 * @param kf  filter
 * @param z   range [m], bearing [rad]
 * @return MANEUVER_OK, MANEUVER_ANOMALY, MANEUVER_REGULARIZED, MANEUVER_GATED, or an error that
 *     leaves *kf as it was
 *
 * 340 mul, 319 add, 17 div, 3 sqrt, 3 atan2, 23 compare, 3 exp, 6 log, 3 max, 2 min, 14 select,
 *
 * 10 wrap.
 */
maneuver_status_t maneuver_update_radar(maneuver_t *kf, const maneuver_radar_t *z);

/**
 * Replace the state; angles are wrapped, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return MANEUVER_OK, or an error that leaves *kf as it was
 */
maneuver_status_t maneuver_set_state(maneuver_t *kf, const maneuver_real_t x[6]);

/**
 * Replace the covariance of every mode; their states stay.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return MANEUVER_OK, or an error that leaves *kf as it was
 */
maneuver_status_t maneuver_set_covariance(maneuver_t *kf, const maneuver_real_t P[36]);

/**
 * The covariance of the combined state: the modes' own, and their spread.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void maneuver_get_covariance(const maneuver_t *kf, maneuver_real_t P[36]);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body 14536ecaeccddeeb69ae5b7b44cc762b */
