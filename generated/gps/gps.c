/* kfgen build gps.yaml */
#include "gps.h"

#include <math.h>

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "gps tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "gps tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* constants: in flash on AVR too, where what is only const takes RAM */
#if defined(__AVR__)
#include <avr/pgmspace.h>
#define GPS_flash PROGMEM
#define GPS_order(i) ((int)pgm_read_byte(&gps_order[i]))
#else
#define GPS_flash
#define GPS_order(i) ((int)gps_order[i])
#endif

/* inner position -> index into x */
static const uint8_t gps_order[5] GPS_flash = {
    4, 3, 0, 1, 2
};

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool gps_finite(double a)
{
    /* of small processors: a float's */
    const uint64_t exponent = sizeof a > 4u ? 0x7ff0000000000000u : 0x7f800000u;
    union { double value; uint64_t bits; } view;
    view.bits = 0u;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

gps_status_t gps_init(gps_t *kf)
{
    if (kf == NULL) { return GPS_NULL_ARGUMENT; }
    kf->x[GPS_X] = -2167000.0;
    kf->x[GPS_Y] = 4388000.0;
    kf->x[GPS_Z] = 4075000.0;
    kf->x[GPS_CLOCK] = 0.0;
    kf->x[GPS_DRIFT] = 0.0;
    for (int i = 0; i < 10; i++) {
        kf->U[i] = 0.0;
    }
    kf->D[0] = 10000.0;
    kf->D[1] = 1.0e14;
    kf->D[2] = 9000000.0;
    kf->D[3] = 9000000.0;
    kf->D[4] = 9000000.0;
    kf->nis = 0.0;
    return GPS_OK;
}

gps_status_t gps_predict(gps_t *kf, const gps_inputs_t *u)
{
    if (kf == NULL || u == NULL) { return GPS_NULL_ARGUMENT; }
    const double drift = kf->x[GPS_DRIFT];

    /* model */
    const double clock_next = kf->x[GPS_CLOCK] + drift;
    const double u_drift_x = kf->U[1];
    const double u_drift_x_next = u_drift_x;
    const double u_drift_y = kf->U[3];
    const double u_drift_y_next = u_drift_y;
    const double u_drift_z = kf->U[6];
    const double u_drift_z_next = u_drift_z;
    const double u_x_y = kf->U[5];
    const double u_x_y_next = u_x_y;
    const double u_x_z = kf->U[8];
    const double u_x_z_next = u_x_z;
    const double u_y_z = kf->U[9];
    const double u_y_z_next = u_y_z;
    const double d_x = kf->D[2];
    const double d_x_next = d_x;
    const double d_y = kf->D[3];
    const double d_y_next = d_y;
    const double d_z = kf->D[4];
    const double d_z_next = d_z;

    /* F U D U^T F^T + Q */
    const double u_drift_clock = kf->U[0];
    const double t0 = u_drift_clock + 1.0;
    const double u_clock_x = kf->U[2];
    const double u_clock_x_next = u_drift_x_next + u_clock_x;
    const double u_clock_y = kf->U[4];
    const double u_clock_y_next = u_drift_y_next + u_clock_y;
    const double u_clock_z = kf->U[7];
    const double u_clock_z_next = u_drift_z_next + u_clock_z;
    const double d_drift = kf->D[0];
    const double t1 = 0.04013333333333333 + d_drift;
    const double t2 = 1.0 / t1;
    const double d_clock = kf->D[1];
    const double t3 = d_clock * t0;
    const double d_clock_next = t1 + t0 * t3;
    const double t4 = 1.0 / d_clock_next;
    const double t5 = t1 * t4;
    const double t6 = 0.0049833887043189366 + 0.9950166112956811 * (d_drift * t2);
    const double u_drift_clock_next = t5 * t6 + t3 * t4 * u_drift_clock;
    const double t7 = u_drift_clock - t0 * t6;
    const double d_drift_next = 0.0003990033222591362
        + 0.9900580567543404 * (d_drift * (0.04013333333333333 * t2)) + t7 * (d_clock * t5 * t7);

    /* guards */
    if (!gps_finite(clock_next + d_drift_next + d_clock_next + d_x_next + d_y_next + d_z_next)) {
        return GPS_NOT_FINITE;
    }

    /* store */
    kf->x[GPS_CLOCK] = clock_next;
    kf->U[0] = u_drift_clock_next;
    kf->U[1] = u_drift_x_next;
    kf->U[2] = u_clock_x_next;
    kf->U[3] = u_drift_y_next;
    kf->U[4] = u_clock_y_next;
    kf->U[5] = u_x_y_next;
    kf->U[6] = u_drift_z_next;
    kf->U[7] = u_clock_z_next;
    kf->U[8] = u_x_z_next;
    kf->U[9] = u_y_z_next;
    kf->D[0] = d_drift_next;
    kf->D[1] = d_clock_next;
    kf->D[2] = d_x_next;
    kf->D[3] = d_y_next;
    kf->D[4] = d_z_next;
    return GPS_OK;
}

gps_status_t gps_update_range(gps_t *kf, const gps_range_t *z, const gps_inputs_t *u)
{
    if (kf == NULL || z == NULL || u == NULL) { return GPS_NULL_ARGUMENT; }

    /* arguments */
    if (!gps_finite(u->s1x)) { return GPS_NOT_FINITE; }
    if (!gps_finite(u->s1y)) { return GPS_NOT_FINITE; }
    if (!gps_finite(u->s1z)) { return GPS_NOT_FINITE; }
    if (!gps_finite(u->s2x)) { return GPS_NOT_FINITE; }
    if (!gps_finite(u->s2y)) { return GPS_NOT_FINITE; }
    if (!gps_finite(u->s2z)) { return GPS_NOT_FINITE; }
    if (!gps_finite(u->s3x)) { return GPS_NOT_FINITE; }
    if (!gps_finite(u->s3y)) { return GPS_NOT_FINITE; }
    if (!gps_finite(u->s3z)) { return GPS_NOT_FINITE; }
    if (!gps_finite(u->s4x)) { return GPS_NOT_FINITE; }
    if (!gps_finite(u->s4y)) { return GPS_NOT_FINITE; }
    if (!gps_finite(u->s4z)) { return GPS_NOT_FINITE; }

    /* innovation */
    const double x = kf->x[GPS_X];
    const double y = kf->x[GPS_Y];
    const double z_1 = kf->x[GPS_Z];
    const double clock = kf->x[GPS_CLOCK];
    const double t0 = u->s1x - x;
    const double t1 = u->s1y - y;
    const double t2 = u->s1z - z_1;
    const double t3 = sqrt(t0 * t0 + t1 * t1 + t2 * t2);
    const double h_r1 = clock + t3;
    const double t4 = t3 > 0.0 ? 1.0 / t3 : 0.0;
    const double t5 = t0 * t4;
    const double t6 = t1 * t4;
    const double t7 = u->s2x - x;
    const double t8 = u->s2y - y;
    const double t9 = u->s2z - z_1;
    const double t10 = sqrt(t7 * t7 + t8 * t8 + t9 * t9);
    const double h_r2 = clock + t10;
    const double t11 = t10 > 0.0 ? 1.0 / t10 : 0.0;
    const double t12 = t7 * t11;
    const double t13 = t8 * t11;
    const double t14 = t9 * t11;
    const double t15 = u->s3x - x;
    const double t16 = u->s3y - y;
    const double t17 = u->s3z - z_1;
    const double t18 = sqrt(t15 * t15 + t16 * t16 + t17 * t17);
    const double h_r3 = clock + t18;
    const double t19 = t18 > 0.0 ? 1.0 / t18 : 0.0;
    const double t20 = t15 * t19;
    const double t21 = t16 * t19;
    const double t22 = t17 * t19;
    const double t23 = u->s4x - x;
    const double t24 = u->s4y - y;
    const double t25 = u->s4z - z_1;
    const double t26 = sqrt(t23 * t23 + t24 * t24 + t25 * t25);
    const double h_r4 = clock + t26;
    const double t27 = t26 > 0.0 ? 1.0 / t26 : 0.0;
    const double t28 = t23 * t27;
    const double t29 = t24 * t27;
    const double t30 = t25 * t27;
    const double y_r1 = z->r1 - h_r1;
    const double y_r2 = z->r2 - h_r2;
    const double y_r3 = z->r3 - h_r3;
    const double y_r4 = z->r4 - h_r4;
    const double u_drift_clock = kf->U[0];
    const double u_drift_clock_next = u_drift_clock;
    const double d_drift = kf->D[0];
    const double d_drift_next = d_drift;

    /* gain and covariance: r1, r2, r3, r4 */
    const double d_clock = kf->D[1];
    const double t31 = 1.0 + d_clock;
    const double t32 = d_clock * (1.0 / t31);
    const double t33 = 1.0 + t32;
    const double t34 = t32 * (1.0 / t33);
    const double t35 = 1.0 + t34;
    const double t36 = t34 * (1.0 / t35);
    const double t37 = 1.0 + t36;
    const double d_clock_next = t36 * (1.0 / t37);
    const double t38 = t32 * u_drift_clock_next;
    const double t39 = t34 * u_drift_clock_next;
    const double t40 = t36 * u_drift_clock_next;
    const double t41 = d_clock_next * u_drift_clock_next;
    const double u_clock_x = kf->U[2];
    const double t42 = u_clock_x - t5;
    const double d_x = kf->D[2];
    const double t43 = d_x * t42;
    const double t44 = t31 + t42 * t43;
    const double t45 = 1.0 / t44;
    const double t46 = t43 * t45;
    const double t47 = d_x * (t31 * t45);
    const double t48 = u_clock_x - t42 * t32;
    const double t49 = t48 - t12;
    const double t50 = t47 * t49;
    const double t51 = t33 + t49 * t50;
    const double t52 = 1.0 / t51;
    const double t53 = t50 * t52;
    const double t54 = t47 * (t33 * t52);
    const double t55 = t48 - t49 * t34;
    const double t56 = t55 - t20;
    const double t57 = t54 * t56;
    const double t58 = t35 + t56 * t57;
    const double t59 = 1.0 / t58;
    const double t60 = t57 * t59;
    const double t61 = t54 * (t35 * t59);
    const double t62 = t55 - t56 * t36;
    const double t63 = t62 - t28;
    const double t64 = t61 * t63;
    const double t65 = t37 + t63 * t64;
    const double t66 = 1.0 / t65;
    const double t67 = t64 * t66;
    const double d_x_next = t61 * (t37 * t66);
    const double t68 = t32 + t46 * t48;
    const double t69 = t34 + t53 * t55;
    const double t70 = t36 + t60 * t62;
    const double u_clock_x_next = t62 - t63 * d_clock_next;
    const double t71 = d_clock_next + t67 * u_clock_x_next;
    const double u_drift_x = kf->U[1];
    const double t72 = u_drift_x - t42 * t38;
    const double t73 = t38 + t46 * t72;
    const double t74 = t72 - t49 * t39;
    const double t75 = t39 + t53 * t74;
    const double t76 = t74 - t56 * t40;
    const double t77 = t40 + t60 * t76;
    const double u_drift_x_next = t76 - t63 * t41;
    const double t78 = t41 + t67 * u_drift_x_next;
    const double u_clock_y = kf->U[4];
    const double u_x_y = kf->U[5];
    const double t79 = u_clock_y - u_x_y * t5 - t6;
    const double d_y = kf->D[3];
    const double t80 = d_y * t79;
    const double t81 = t44 + t79 * t80;
    const double t82 = 1.0 / t81;
    const double t83 = t80 * t82;
    const double t84 = d_y * (t44 * t82);
    const double t85 = u_clock_y - t79 * t68;
    const double t86 = u_x_y - t79 * t46;
    const double t87 = t85 - t86 * t12 - t13;
    const double t88 = t84 * t87;
    const double t89 = t51 + t87 * t88;
    const double t90 = 1.0 / t89;
    const double t91 = t88 * t90;
    const double t92 = t84 * (t51 * t90);
    const double t93 = t85 - t87 * t69;
    const double t94 = t86 - t87 * t53;
    const double t95 = t93 - t94 * t20 - t21;
    const double t96 = t92 * t95;
    const double t97 = t58 + t95 * t96;
    const double t98 = 1.0 / t97;
    const double t99 = t96 * t98;
    const double t100 = t92 * (t58 * t98);
    const double t101 = t93 - t95 * t70;
    const double t102 = t94 - t95 * t60;
    const double t103 = t101 - t102 * t28 - t29;
    const double t104 = t100 * t103;
    const double t105 = t65 + t103 * t104;
    const double t106 = 1.0 / t105;
    const double t107 = t104 * t106;
    const double d_y_next = t100 * (t65 * t106);
    const double t108 = t46 + t83 * t86;
    const double t109 = t53 + t91 * t94;
    const double t110 = t60 + t99 * t102;
    const double u_x_y_next = t102 - t103 * t67;
    const double t111 = t67 + t107 * u_x_y_next;
    const double t112 = t68 + t83 * t85;
    const double t113 = t69 + t91 * t93;
    const double t114 = t70 + t99 * t101;
    const double u_clock_y_next = t101 - t103 * t71;
    const double t115 = t71 + t107 * u_clock_y_next;
    const double u_drift_y = kf->U[3];
    const double t116 = u_drift_y - t79 * t73;
    const double t117 = t73 + t83 * t116;
    const double t118 = t116 - t87 * t75;
    const double t119 = t75 + t91 * t118;
    const double t120 = t118 - t95 * t77;
    const double t121 = t77 + t99 * t120;
    const double u_drift_y_next = t120 - t103 * t78;
    const double t122 = t78 + t107 * u_drift_y_next;
    const double u_clock_z = kf->U[7];
    const double u_x_z = kf->U[8];
    const double u_y_z = kf->U[9];
    const double t123 = u_clock_z - u_x_z * t5 - u_y_z * t6 - t2 * t4;
    const double d_z = kf->D[4];
    const double t124 = d_z * t123;
    const double s_r1 = t81 + t123 * t124;
    const double t125 = 1.0 / s_r1;
    const double t126 = t124 * t125;
    const double t127 = d_z * (t81 * t125);
    const double t128 = u_clock_z - t123 * t112;
    const double t129 = u_x_z - t123 * t108;
    const double t130 = u_y_z - t123 * t83;
    const double t131 = t128 - t129 * t12 - t130 * t13 - t14;
    const double t132 = t127 * t131;
    const double s_r2 = t89 + t131 * t132;
    const double t133 = 1.0 / s_r2;
    const double t134 = t132 * t133;
    const double t135 = t127 * (t89 * t133);
    const double t136 = t128 - t131 * t113;
    const double t137 = t129 - t131 * t109;
    const double t138 = t130 - t131 * t91;
    const double t139 = t136 - t137 * t20 - t138 * t21 - t22;
    const double t140 = t135 * t139;
    const double s_r3 = t97 + t139 * t140;
    const double t141 = 1.0 / s_r3;
    const double t142 = t140 * t141;
    const double t143 = t135 * (t97 * t141);
    const double t144 = t136 - t139 * t114;
    const double t145 = t137 - t139 * t110;
    const double t146 = t138 - t139 * t99;
    const double t147 = t144 - t145 * t28 - t146 * t29 - t30;
    const double t148 = t143 * t147;
    const double s_r4 = t105 + t147 * t148;
    const double t149 = 1.0 / s_r4;
    const double t150 = t148 * t149;
    const double d_z_next = t143 * (t105 * t149);
    const double u_y_z_next = t146 - t147 * t107;
    const double u_x_z_next = t145 - t147 * t111;
    const double u_clock_z_next = t144 - t147 * t115;
    const double u_drift_z = kf->U[6];
    const double t151 = u_drift_z - t123 * t117;
    const double t152 = t151 - t131 * t119;
    const double t153 = t152 - t139 * t121;
    const double u_drift_z_next = t153 - t147 * t122;
    const double t154 = (t112 + t126 * t128) * y_r1;
    const double t155 = (t108 + t126 * t129) * y_r1;
    const double t156 = (t83 + t126 * t130) * y_r1;
    const double t157 = t126 * y_r1;
    const double nu_r2 = y_r2 - t154 + t12 * t155 + t13 * t156 + t14 * t157;
    const double t158 = t154 + (t113 + t134 * t136) * nu_r2;
    const double t159 = t155 + (t109 + t134 * t137) * nu_r2;
    const double t160 = t156 + (t91 + t134 * t138) * nu_r2;
    const double t161 = t157 + t134 * nu_r2;
    const double nu_r3 = y_r3 - t158 + t20 * t159 + t21 * t160 + t22 * t161;
    const double t162 = t158 + (t114 + t142 * t144) * nu_r3;
    const double t163 = t159 + (t110 + t142 * t145) * nu_r3;
    const double t164 = t160 + (t99 + t142 * t146) * nu_r3;
    const double t165 = t161 + t142 * nu_r3;
    const double nu_r4 = y_r4 - t162 + t28 * t163 + t29 * t164 + t30 * t165;
    const double nis = y_r1 * (y_r1 * t125) + nu_r2 * (nu_r2 * t133) + nu_r3 * (nu_r3 * t141)
        + nu_r4 * (nu_r4 * t149);

    /* state and innovation squared */
    const double drift_next = kf->x[GPS_DRIFT] + (t117 + t126 * t151) * y_r1
        + (t119 + t134 * t152) * nu_r2 + (t121 + t142 * t153) * nu_r3
        + (t122 + t150 * u_drift_z_next) * nu_r4;
    const double clock_next = clock + t162 + (t115 + t150 * u_clock_z_next) * nu_r4;
    const double x_next = x + t163 + (t111 + t150 * u_x_z_next) * nu_r4;
    const double y_next = y + t164 + (t107 + t150 * u_y_z_next) * nu_r4;
    const double z_next = z_1 + t165 + t150 * nu_r4;

    /* guards */
    if (!gps_finite(x_next + y_next + z_next + clock_next + drift_next + nis + s_r1 + s_r2 + s_r3
        + s_r4)) {
        return GPS_NOT_FINITE;
    }
    if (!(s_r1 > 0.0) || !(s_r2 > 0.0) || !(s_r3 > 0.0) || !(s_r4 > 0.0)) {
        return GPS_NOT_POSITIVE;
    }

    /* store */
    kf->x[GPS_X] = x_next;
    kf->x[GPS_Y] = y_next;
    kf->x[GPS_Z] = z_next;
    kf->x[GPS_CLOCK] = clock_next;
    kf->x[GPS_DRIFT] = drift_next;
    kf->U[0] = u_drift_clock_next;
    kf->U[1] = u_drift_x_next;
    kf->U[2] = u_clock_x_next;
    kf->U[3] = u_drift_y_next;
    kf->U[4] = u_clock_y_next;
    kf->U[5] = u_x_y_next;
    kf->U[6] = u_drift_z_next;
    kf->U[7] = u_clock_z_next;
    kf->U[8] = u_x_z_next;
    kf->U[9] = u_y_z_next;
    kf->D[0] = d_drift_next;
    kf->D[1] = d_clock_next;
    kf->D[2] = d_x_next;
    kf->D[3] = d_y_next;
    kf->D[4] = d_z_next;
    kf->nis = nis;
    return GPS_OK;
}

gps_status_t gps_set_state(gps_t *kf, const gps_real_t x[5])
{
    if (kf == NULL || x == NULL) { return GPS_NULL_ARGUMENT; }
    if (!gps_finite(x[GPS_X])) { return GPS_NOT_FINITE; }
    if (!gps_finite(x[GPS_Y])) { return GPS_NOT_FINITE; }
    if (!gps_finite(x[GPS_Z])) { return GPS_NOT_FINITE; }
    if (!gps_finite(x[GPS_CLOCK])) { return GPS_NOT_FINITE; }
    if (!gps_finite(x[GPS_DRIFT])) { return GPS_NOT_FINITE; }
    kf->x[GPS_X] = x[GPS_X];
    kf->x[GPS_Y] = x[GPS_Y];
    kf->x[GPS_Z] = x[GPS_Z];
    kf->x[GPS_CLOCK] = x[GPS_CLOCK];
    kf->x[GPS_DRIFT] = x[GPS_DRIFT];
    return GPS_OK;
}

gps_status_t gps_set_covariance(gps_t *kf, const gps_real_t P[25])
{
    if (kf == NULL || P == NULL) { return GPS_NULL_ARGUMENT; }
    double p[15];
    double w[15];

    /* the upper triangle, column by column */
    for (int j = 0; j < 5; j++) {
        for (int i = 0; i < j + 1; i++) {
            const bool t0 = GPS_order(j) < GPS_order(i);
            const double value = P[5 * (t0 ? GPS_order(j) : GPS_order(i))
                + (t0 ? GPS_order(i) : GPS_order(j))];
            p[j * (j + 1) / 2 + i] = value;
            w[j * (j + 1) / 2 + i] = value;
            if (!gps_finite(value)) { return GPS_NOT_FINITE; }
        }
    }

    /* factor it: a pivot is zero up to round-off, or positive */
    for (int j = 5 - 1; j >= 0; j--) {
        const double round_off = 1.1102230246251565e-15 * p[j * (j + 1) / 2 + j];
        const double pivot = w[j * (j + 1) / 2 + j];
        if (!(-round_off <= pivot)) { return GPS_NOT_POSITIVE; }
        const double d = round_off < pivot ? pivot : 0.0;
        w[j * (j + 1) / 2 + j] = d;
        for (int i = j - 1; i >= 0; i--) {
            const double rest = w[j * (j + 1) / 2 + i];
            if (d <= 0.0 && 4.440892098500626e-15 * p[j * (j + 1) / 2 + j]
                * p[i * (i + 1) / 2 + i] < rest * rest) {
                return GPS_NOT_POSITIVE;
            }
            const double u = d > 0.0 ? rest / d : 0.0;
            for (int k = 0; k < i + 1; k++) {
                w[i * (i + 1) / 2 + k] = w[i * (i + 1) / 2 + k] - u * w[j * (j + 1) / 2 + k];
            }
            w[j * (j + 1) / 2 + i] = u;
        }
    }

    /* store */
    for (int j = 0; j < 5; j++) {
        for (int i = 0; i < j; i++) {
            kf->U[j * (j - 1) / 2 + i] = w[j * (j + 1) / 2 + i];
        }
        kf->D[j] = w[j * (j + 1) / 2 + j];
    }
    return GPS_OK;
}

void gps_get_covariance(const gps_t *kf, gps_real_t P[25])
{
    if (kf == NULL || P == NULL) { return; }
    for (int j = 0; j < 5; j++) {
        for (int i = 0; i < j + 1; i++) {
            double sum = kf->D[j];
            if (i < j) {
                sum = sum * kf->U[j * (j - 1) / 2 + i];
            }
            for (int k = j + 1; k < 5; k++) {
                sum = sum + kf->U[k * (k - 1) / 2 + i] * kf->D[k] * kf->U[k * (k - 1) / 2 + j];
            }
            const double value = sum;
            P[5 * GPS_order(i) + GPS_order(j)] = value;
            P[5 * GPS_order(j) + GPS_order(i)] = value;
        }
    }
}
/* kfgen: body 35ec02a49b459ad4d50d7f537897d7e6 */
