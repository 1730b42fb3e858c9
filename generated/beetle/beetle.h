/* kfgen build beetle.yaml
 *
 * beetle: a dung beetle under a camera, running straight or winding about
 *
 * Interacting multiple model of 2 modes, float
 *
 * state x (4)
 *   px  [cm]
 *   py  [cm]
 *   v   [cm/s]
 *   th  [rad]   angle  course, from x towards y
 * modes
 *   run: Extended Kalman filter, U D U^T covariance, bierman update
 *   turn: Unscented Kalman filter, cubature points, U D U^T covariance, update by the whole
 *   vector
 * step: given at each step, clamped to at least 0.01 s, at most 2 s
 *
 * RAM 160 bytes a filter. Operations:
 *   predict        581 mul, 460 add, 70 div, 4 sqrt, 27 compare, 9 cos, 1 exp, 47 select, 9 sin, 10
 *       wrap
 *   update_camera  142 mul, 125 add, 17 div, 8 compare, 2 exp, 4 log, 2 max, 1 min, 4 select, 5
 *       wrap
 * Recommended with gcc, for these long functions without branches:
 *   -O2 -fno-schedule-insns -flive-range-shrinkage -fno-tree-sink -frename-registers
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * a45d7d6b047b1325c773c12a0713a78bda9da3ed0b0b25a78e2f425de052d0c0
 * This file and beetle.c are yours: use, change and ship them without condition.
 */
#ifndef BEETLE_H_INCLUDED
#define BEETLE_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define BEETLE_NX 4
#define BEETLE_NB 2
#define BEETLE_NZ_CAMERA 2

/* indices into x */
enum {
    BEETLE_PX, /* [cm] */
    BEETLE_PY, /* [cm] */
    BEETLE_V,  /* [cm/s] */
    BEETLE_TH  /* [rad] course, from x towards y */
};

/* indices into mu */
enum {
    BEETLE_MODE_RUN,
    BEETLE_MODE_TURN
};

typedef float beetle_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t beetle_status_t;
#define BEETLE_OK             0x000u
#define BEETLE_REGULARIZED    0x001u /* a variance was limited, or taken to zero by round-off */
#define BEETLE_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define BEETLE_GLITCH_LARGE   0x004u /* an innovation was cut off */
#define BEETLE_ANOMALY        0x008u /* an innovation beyond its variance was taken all the same */
#define BEETLE_GATED          0x010u /* the measurement was refused; nothing but nis has changed */
#define BEETLE_SATURATED      0x020u /* a number was clipped to its range */
#define BEETLE_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define BEETLE_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define BEETLE_ERROR          0x100u /* errors from here up */
#define BEETLE_NULL_ARGUMENT  0x100u /* a pointer is NULL */
#define BEETLE_NOT_FINITE     0x200u /* an argument or a value of the model is NaN or infinite */
#define BEETLE_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    beetle_real_t x; /* [cm] */
    beetle_real_t y; /* [cm] */
} beetle_camera_t;

typedef struct {
    beetle_real_t pace;  /* [cm/s] the speed to which the beetle returns */
    beetle_real_t lasts; /* [s] how long a mode lasts on average */
} beetle_parameters_t;

typedef struct {
    beetle_real_t x[4]; /* state */
    beetle_real_t U[6]; /* unit upper triangular factor: U_ij, i < j, at j (j - 1) / 2 + i */
    beetle_real_t D[4]; /* diagonal factor: P = U D U^T */
    beetle_real_t nis;  /* normalised innovation squared of the last update */
} beetle_mode_run_t;

typedef struct {
    beetle_real_t x[4]; /* state */
    beetle_real_t U[6]; /* unit upper triangular factor: U_ij, i < j, at j (j - 1) / 2 + i */
    beetle_real_t D[4]; /* diagonal factor: P = U D U^T */
    beetle_real_t nis;  /* normalised innovation squared of the last update */
} beetle_mode_turn_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    beetle_real_t x[4];             /* state */
    beetle_real_t mu[2];            /* probabilities of the modes */
    struct {
        beetle_mode_run_t run;
        beetle_mode_turn_t turn;
    } modes; /* the filters of the modes */
    beetle_parameters_t parameters; /* may be changed while the filter runs */
    beetle_real_t nis;              /* normalised innovation squared of the last update */
    bool initialized;               /* the first measurement has set the state */
} beetle_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return BEETLE_OK, or BEETLE_NULL_ARGUMENT
 */
beetle_status_t beetle_init(beetle_t *kf);

/**
 * Advance the estimate by a step of dt.
 *
 * @param kf  filter
 * @param dt  time step [s]
 * @return BEETLE_OK, BEETLE_DT_CLAMPED, or an error that leaves *kf as it was
 *
 * 581 mul, 460 add, 70 div, 4 sqrt, 27 compare, 9 cos, 1 exp, 47 select, 9 sin, 10 wrap.
 */
beetle_status_t beetle_predict(beetle_t *kf, beetle_real_t dt);

/**
 * Take a measurement of camera into account.
 *
 * @param kf  filter
 * @param z   x [cm], y [cm]
 * @return BEETLE_OK, or an error that leaves *kf as it was
 *
 * 142 mul, 125 add, 17 div, 8 compare, 2 exp, 4 log, 2 max, 1 min, 4 select, 5 wrap.
 */
beetle_status_t beetle_update_camera(beetle_t *kf, const beetle_camera_t *z);

/**
 * Replace the state; angles are wrapped, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return BEETLE_OK, or an error that leaves *kf as it was
 */
beetle_status_t beetle_set_state(beetle_t *kf, const beetle_real_t x[4]);

/**
 * Replace the covariance of every mode; their states stay.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return BEETLE_OK, or an error that leaves *kf as it was
 */
beetle_status_t beetle_set_covariance(beetle_t *kf, const beetle_real_t P[16]);

/**
 * The covariance of the combined state: the modes' own, and their spread.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void beetle_get_covariance(const beetle_t *kf, beetle_real_t P[16]);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body 67528fdd37a545a3415a1f103e24faaa */
