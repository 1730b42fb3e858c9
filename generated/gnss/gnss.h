/* kfgen build gnss.yaml
 *
 * gnss: moving receiver from pseudoranges and Doppler, satellite by satellite
 *
 * Extended Kalman filter, U D U^T covariance, bierman update, double
 *
 * state x (8)
 *   p_x    [m]    position, ECEF
 *   p_y    [m]    position, ECEF
 *   p_z    [m]    position, ECEF
 *   v_x    [m/s]  velocity, ECEF
 *   v_y    [m/s]  velocity, ECEF
 *   v_z    [m/s]  velocity, ECEF
 *   clock  [m]    clock error as a length
 *   drift  [m/s]  how the clock error grows
 * order of the states inside U and D
 *   clock, p_x, p_y, p_z, v_x, v_y, v_z, drift
 * step: 1 s, compiled in
 *
 * RAM 360 bytes a filter. Operations:
 *   predict            277 mul, 181 add, 28 div
 *   update_sat         275 mul, 222 add, 25 div, 1 sqrt, 4 compare, 10 select
 *   update_sat_masked  285 mul, 222 add, 25 div, 1 sqrt, 5 compare, 26 select
 * Recommended with gcc, for these long functions without branches:
 *   -O2 -fno-schedule-insns -flive-range-shrinkage -fno-tree-sink -frename-registers
 *
 * Emitted by kfgen 0.1.0 with SymPy 1.14.0 from the spec with SHA-256
 * fe3cc9775994abd22a6dea98455d6363b2ac25362919a3f14d6fd0f225ab6ff2
 * This file and gnss.c are yours: use, change and ship them without condition.
 */
#ifndef GNSS_H_INCLUDED
#define GNSS_H_INCLUDED

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GNSS_NX 8
#define GNSS_NZ_SAT 2

/* indices into x */
enum {
    GNSS_P_X,   /* [m] position, ECEF */
    GNSS_P_Y,   /* [m] position, ECEF */
    GNSS_P_Z,   /* [m] position, ECEF */
    GNSS_V_X,   /* [m/s] velocity, ECEF */
    GNSS_V_Y,   /* [m/s] velocity, ECEF */
    GNSS_V_Z,   /* [m/s] velocity, ECEF */
    GNSS_CLOCK, /* [m] clock error as a length */
    GNSS_DRIFT  /* [m/s] how the clock error grows */
};

typedef double gnss_real_t;

/* 0, or a sum of flags; from ..._ERROR up the call has failed and has changed nothing */
typedef uint32_t gnss_status_t;
#define GNSS_OK             0x000u
#define GNSS_REGULARIZED    0x001u /* a variance was limited, or taken to zero by round-off */
#define GNSS_GLITCH_SMALL   0x002u /* an innovation was weighted down */
#define GNSS_GLITCH_LARGE   0x004u /* an innovation was cut off */
#define GNSS_ANOMALY        0x008u /* an innovation beyond its variance was taken all the same */
#define GNSS_GATED          0x010u /* the measurement was refused; nothing but nis has changed */
#define GNSS_SATURATED      0x020u /* a number was clipped to its range */
#define GNSS_DT_CLAMPED     0x040u /* dt was outside of its limits and was clamped */
#define GNSS_POINT_REJECTED 0x080u /* a sigma point was replaced */
#define GNSS_ERROR          0x100u /* errors from here up */
#define GNSS_NULL_ARGUMENT  0x100u /* a pointer is NULL */
#define GNSS_NOT_FINITE     0x200u /* an argument or a value of the model is NaN or infinite */
#define GNSS_NOT_POSITIVE   0x400u /* a variance or dt is not positive */

typedef struct {
    gnss_real_t rho;   /* [m] */
    gnss_real_t rate;  /* [m/s] */
    gnss_real_t pos_x; /* [m] where the satellite is, ECEF */
    gnss_real_t pos_y; /* [m] where the satellite is, ECEF */
    gnss_real_t pos_z; /* [m] where the satellite is, ECEF */
    gnss_real_t vel_x; /* [m/s] its velocity, ECEF */
    gnss_real_t vel_y; /* [m/s] its velocity, ECEF */
    gnss_real_t vel_z; /* [m/s] its velocity, ECEF */
    gnss_real_t sigma; /* [m] the receiver's own accuracy of this range */
} gnss_sat_t;

typedef struct {
    gnss_real_t speed;  /* [m/s] */
    gnss_real_t height; /* [m] above a sphere */
} gnss_outputs_t;

/* The filter. Plain data: copy it, keep as many as you like. */
typedef struct {
    gnss_real_t x[8];  /* state */
    gnss_real_t U[28]; /* unit upper triangular factor: U_ij, i < j, at j (j - 1) / 2 + i */
    gnss_real_t D[8];  /* diagonal factor: P = U D U^T */
    gnss_real_t nis;   /* normalised innovation squared of the last update */
} gnss_t;

/**
 * Set the state, its covariance and the parameters to their initial values.
 *
 * @param kf  filter
 * @return GNSS_OK, or GNSS_NULL_ARGUMENT
 */
gnss_status_t gnss_init(gnss_t *kf);

/**
 * Advance the estimate by one step of 1 s.
 *
 * @param kf  filter
 * @return GNSS_OK, or an error that leaves *kf as it was
 *
 * 277 mul, 181 add, 28 div.
 */
gnss_status_t gnss_predict(gnss_t *kf);

/**
 * Take a measurement of sat into account.
 *
 * @param kf  filter
 * @param z   rho [m], rate [m/s], pos_x [m], pos_y [m], pos_z [m], vel_x [m/s], vel_y [m/s],
 *            vel_z [m/s], sigma [m]
 * @return GNSS_OK, GNSS_GATED, or an error that leaves *kf as it was
 *
 * 275 mul, 222 add, 25 div, 1 sqrt, 4 compare, 10 select.
 */
gnss_status_t gnss_update_sat(gnss_t *kf, const gnss_sat_t *z);

/**
 * Take the chosen components of a measurement of sat into account.
 *
 * @param kf    filter
 * @param z     measurement
 * @param mask  bit i: use component i
 * @return GNSS_OK, GNSS_GATED, or an error that leaves *kf as it was
 *
 * 285 mul, 222 add, 25 div, 1 sqrt, 5 compare, 26 select.
 */
gnss_status_t gnss_update_sat_masked(gnss_t *kf, const gnss_sat_t *z, uint32_t mask);

/**
 * Replace the state; angles are wrapped, the covariance stays.
 *
 * @param kf  filter
 * @param x   new state
 * @return GNSS_OK, or an error that leaves *kf as it was
 */
gnss_status_t gnss_set_state(gnss_t *kf, const gnss_real_t x[8]);

/**
 * Replace the covariance; the state stays.
 *
 * @param kf  filter
 * @param P   covariance, row-major; the upper triangle is read
 * @return GNSS_OK, or an error that leaves *kf as it was
 */
gnss_status_t gnss_set_covariance(gnss_t *kf, const gnss_real_t P[64]);

/**
 * The covariance of the state, in the order of the states.
 *
 * @param kf  filter
 * @param P   covariance, row-major
 */
void gnss_get_covariance(const gnss_t *kf, gnss_real_t P[64]);

/**
 * The outputs at the present estimate, and how well they are known.
 *
 * @param kf     filter
 * @param value  speed [m/s], height [m]
 * @param std    their standard deviations, or NULL
 * @return GNSS_OK, or an error that leaves *kf as it was
 */
gnss_status_t gnss_get_outputs(const gnss_t *kf, gnss_outputs_t *value, gnss_outputs_t *std);

#ifdef __cplusplus
}
#endif

#endif
/* kfgen: body fd499a1047a7af108f52aef36a772e09 */
