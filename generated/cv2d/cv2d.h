/* kfgen build cv2d.yaml
 *
 * cv2d: constant velocity in the plane
 *
 * Kalman filter, U D U^T covariance, bierman update, float
 *
 * state x (4)
 *   px  [m]
 *   py  [m]
 *   vx  [m/s]
 *   vy  [m/s]
 * order of the states inside U and D
 *   px, vx, py, vy
 * step: given at each step, clamped to at least 0.001 s, at most 10 s
 *
 * RAM 64 bytes a filter. Operations:
 *   predict        63 mul, 43 add, 16 div, 10 compare, 18 select
 *   update_camera  58 mul, 43 add, 6 div, 3 compare
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * 2f94e7294804a58f4fcc6544d79d262fe2aebaa09fc194beeae5c22c05564553
 * This file and cv2d.c are yours: use, change and ship them without condition.
 */
#ifndef CV2D_H_INCLUDED
#define CV2D_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define CV2D_NX 4
#define CV2D_NZ_CAMERA 2

/* indices into x */
enum {
    CV2D_PX, /* [m] */
    CV2D_PY, /* [m] */
    CV2D_VX, /* [m/s] */
    CV2D_VY  /* [m/s] */
};

typedef float cv2d_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t cv2d_status_t;
#define CV2D_OK             0x000u
#define CV2D_REGULARIZED    0x001u /* a variance was limited, or taken to zero by round-off */
#define CV2D_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define CV2D_GLITCH_LARGE   0x004u /* an innovation was cut off */
#define CV2D_ANOMALY        0x008u /* an innovation beyond its variance was taken all the same */
#define CV2D_GATED          0x010u /* the measurement was refused; nothing but nis has changed */
#define CV2D_SATURATED      0x020u /* a number was clipped to its range */
#define CV2D_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define CV2D_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define CV2D_ERROR          0x100u /* errors from here up */
#define CV2D_NULL_ARGUMENT  0x100u /* a pointer is NULL */
#define CV2D_NOT_FINITE     0x200u /* an argument or a value of the model is NaN or infinite */
#define CV2D_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    cv2d_real_t x; /* [m] */
    cv2d_real_t y; /* [m] */
} cv2d_camera_t;

typedef struct {
    cv2d_real_t agility; /* [m/s^2/sqrt(Hz)] root density of the acceleration */
} cv2d_parameters_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    cv2d_real_t x[4];             /* state */
    /* unit upper triangular factor: U_ij, i < j, at j (j - 1) / 2 + i */
    cv2d_real_t U[6];
    cv2d_real_t D[4];             /* diagonal factor: P = U D U^T */
    cv2d_parameters_t parameters; /* may be changed while the filter runs */
    cv2d_real_t nis;              /* normalised innovation squared of the last update */
} cv2d_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return CV2D_OK, or CV2D_NULL_ARGUMENT
 */
cv2d_status_t cv2d_init(cv2d_t *kf);

/**
 * Advance the estimate by a step of dt.
 *
 * @param kf  filter
 * @param dt  time step [s]
 * @return CV2D_OK, CV2D_DT_CLAMPED, or an error that leaves *kf as it was
 *
 * 63 mul, 43 add, 16 div, 10 compare, 18 select.
 */
cv2d_status_t cv2d_predict(cv2d_t *kf, cv2d_real_t dt);

/**
 * Take a measurement of camera into account.
 *
 * @param kf  filter
 * @param z   x [m], y [m]
 * @return CV2D_OK, CV2D_GATED, or an error that leaves *kf as it was
 *
 * 58 mul, 43 add, 6 div, 3 compare.
 */
cv2d_status_t cv2d_update_camera(cv2d_t *kf, const cv2d_camera_t *z);

/**
 * Replace the state; angles are wrapped, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return CV2D_OK, or an error that leaves *kf as it was
 */
cv2d_status_t cv2d_set_state(cv2d_t *kf, const cv2d_real_t x[4]);

/**
 * Replace the covariance; the state stays.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return CV2D_OK, or an error that leaves *kf as it was
 */
cv2d_status_t cv2d_set_covariance(cv2d_t *kf, const cv2d_real_t P[16]);

/**
 * The covariance of the state, in the order of the states.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void cv2d_get_covariance(const cv2d_t *kf, cv2d_real_t P[16]);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body 94ca7c42878626263c9898359a16da14 */
