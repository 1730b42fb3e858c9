/* kfgen build vehicle_small.yaml: what an emitted header looks like, written by hand.
 * `typedef struct { int trap; } in_a_comment_t;` must not be read.
 */
#ifndef VEHICLE_SMALL_H
#define VEHICLE_SMALL_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define VEHICLE_SMALL_NX 3 /* states */
#define VEHICLE_SMALL_NU 1
#define VEHICLE_SMALL_NZ_GNSS 2
#define VEHICLE_SMALL_NZ_COMPASS 1

/* indices into x */
enum { VEHICLE_SMALL_PX, VEHICLE_SMALL_PY, VEHICLE_SMALL_TH };

typedef float vehicle_small_real_t;

typedef uint32_t vehicle_small_status_t;
enum {
    VEHICLE_SMALL_OK = 0,
    VEHICLE_SMALL_GATED = 0x10,
    VEHICLE_SMALL_ERROR = 0x100,
    VEHICLE_SMALL_NULL_ARGUMENT = 0x100,
    VEHICLE_SMALL_NOT_FINITE = 0x200,
    VEHICLE_SMALL_NOT_POSITIVE = 0x400
};

typedef struct {
    vehicle_small_real_t gyro; /**< [rad/s] */
} vehicle_small_inputs_t;

typedef struct {
    vehicle_small_real_t x; /* m */
    vehicle_small_real_t y;
} vehicle_small_gnss_t;

typedef struct {
    vehicle_small_real_t heading;
} vehicle_small_compass_t;

typedef struct {
    vehicle_small_real_t sigma_v; // m/s
} vehicle_small_parameters_t;

typedef struct {
    vehicle_small_real_t x[VEHICLE_SMALL_NX];
    vehicle_small_real_t P[6]; /* upper triangle, column by column */
    vehicle_small_parameters_t parameters;
    vehicle_small_real_t nis;
    uint32_t gate_count_gnss;
} vehicle_small_t;

vehicle_small_status_t vehicle_small_init(vehicle_small_t *kf);
vehicle_small_status_t vehicle_small_predict(vehicle_small_t *kf, const vehicle_small_inputs_t *u,
                                             vehicle_small_real_t dt);
vehicle_small_status_t vehicle_small_update_gnss(vehicle_small_t *kf, const vehicle_small_gnss_t *z);
vehicle_small_status_t vehicle_small_update_gnss_masked(vehicle_small_t *kf, const vehicle_small_gnss_t *z,
                                                        uint32_t mask);
vehicle_small_status_t vehicle_small_update_compass(vehicle_small_t *kf,
                                                    const vehicle_small_compass_t *z);
vehicle_small_status_t vehicle_small_set_state(vehicle_small_t *kf, const vehicle_small_real_t x[3]);
vehicle_small_status_t vehicle_small_set_covariance(vehicle_small_t *kf,
                                                    const vehicle_small_real_t P[9]);
void vehicle_small_get_covariance(const vehicle_small_t *kf, vehicle_small_real_t P[9]);

#ifdef __cplusplus
}
#endif

#endif
