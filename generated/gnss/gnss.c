/* kfgen build gnss.yaml */
#include "gnss.h"

#include <math.h>

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "gnss tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "gnss tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* constants: in flash on AVR too, where what is only const takes RAM */
#if defined(__AVR__)
#include <avr/pgmspace.h>
#define GNSS_flash PROGMEM
#define GNSS_order(i) ((int)pgm_read_byte(&gnss_order[i]))
#else
#define GNSS_flash
#define GNSS_order(i) ((int)gnss_order[i])
#endif

/* inner position -> index into x */
static const uint8_t gnss_order[8] GNSS_flash = {
    6, 0, 1, 2, 3, 4, 5, 7
};

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool gnss_finite(double a)
{
    /* of small processors: a float's */
    const uint64_t exponent = sizeof a > 4u ? 0x7ff0000000000000u : 0x7f800000u;
    union { double value; uint64_t bits; } view;
    view.bits = 0u;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

gnss_status_t gnss_init(gnss_t *kf)
{
    if (kf == NULL) { return GNSS_NULL_ARGUMENT; }
    kf->x[GNSS_P_X] = -2167000.0;
    kf->x[GNSS_P_Y] = 4388000.0;
    kf->x[GNSS_P_Z] = 4075000.0;
    for (int i = 3; i < 8; i++) {
        kf->x[i] = 0.0;
    }
    for (int i = 0; i < 28; i++) {
        kf->U[i] = 0.0;
    }
    kf->D[0] = 1.0e14;
    kf->D[1] = 9000000.0;
    kf->D[2] = 9000000.0;
    kf->D[3] = 9000000.0;
    kf->D[4] = 100.0;
    kf->D[5] = 100.0;
    kf->D[6] = 100.0;
    kf->D[7] = 10000.0;
    kf->nis = 0.0;
    return GNSS_OK;
}

gnss_status_t gnss_predict(gnss_t *kf)
{
    if (kf == NULL) { return GNSS_NULL_ARGUMENT; }
    const double v_x = kf->x[GNSS_V_X];
    const double v_y = kf->x[GNSS_V_Y];
    const double v_z = kf->x[GNSS_V_Z];
    const double drift = kf->x[GNSS_DRIFT];

    /* model */
    const double p_x_next = kf->x[GNSS_P_X] + v_x;
    const double p_y_next = kf->x[GNSS_P_Y] + v_y;
    const double p_z_next = kf->x[GNSS_P_Z] + v_z;
    const double clock_next = kf->x[GNSS_CLOCK] + drift;

    /* F U, unit upper triangular as F is */
    const double u_p_x_v_x = kf->U[7];
    const double t0 = u_p_x_v_x + 1.0;
    const double u_p_x_v_y = kf->U[11];
    const double u_v_x_v_y = kf->U[14];
    const double t1 = u_p_x_v_y + u_v_x_v_y;
    const double u_p_y_v_y = kf->U[12];
    const double t2 = u_p_y_v_y + 1.0;
    const double u_p_x_v_z = kf->U[16];
    const double u_v_x_v_z = kf->U[19];
    const double t3 = u_p_x_v_z + u_v_x_v_z;
    const double u_p_y_v_z = kf->U[17];
    const double u_v_y_v_z = kf->U[20];
    const double t4 = u_p_y_v_z + u_v_y_v_z;
    const double u_p_z_v_z = kf->U[18];
    const double t5 = u_p_z_v_z + 1.0;
    const double u_clock_drift = kf->U[21];
    const double t6 = u_clock_drift + 1.0;
    const double u_p_x_drift = kf->U[22];
    const double u_v_x_drift = kf->U[25];
    const double t7 = u_p_x_drift + u_v_x_drift;
    const double u_p_y_drift = kf->U[23];
    const double u_v_y_drift = kf->U[26];
    const double t8 = u_p_y_drift + u_v_y_drift;
    const double u_p_z_drift = kf->U[24];
    const double u_v_z_drift = kf->U[27];
    const double t9 = u_p_z_drift + u_v_z_drift;

    /* process noise, columns 0 to 4 */
    const double d_v_x = kf->D[4];
    const double t10 = d_v_x + 0.25;
    const double t11 = 1.0 / t10;
    const double t12 = d_v_x * t11;
    const double t13 = 0.25 * t12;
    const double u_clock_v_x = kf->U[6];
    const double t14 = t12 * u_clock_v_x;
    const double t15 = t12 * t0 + 0.125 * t11;
    const double u_p_y_v_x = kf->U[8];
    const double t16 = t12 * u_p_y_v_x;
    const double u_p_z_v_x = kf->U[9];
    const double t17 = t12 * u_p_z_v_x;
    const double d_p_z = kf->D[3];
    const double t18 = d_p_z + 0.020833333333333332;
    const double t19 = d_p_z * (1.0 / t18);
    const double t20 = 0.020833333333333332 * t19;
    const double t21 = t13 * u_p_z_v_x;
    const double t22 = t18 + u_p_z_v_x * t21;
    const double t23 = 1.0 / t22;
    const double t24 = t21 * t23;
    const double t25 = t13 * (t18 * t23);
    const double u_clock_p_z = kf->U[3];
    const double t26 = t19 * u_clock_p_z;
    const double t27 = u_p_z_v_x * t26 - u_clock_v_x;
    const double t28 = t26 - t24 * t27;
    const double u_p_x_p_z = kf->U[4];
    const double t29 = t19 * u_p_x_p_z;
    const double t30 = 0.5 - t0 + u_p_z_v_x * t29;
    const double t31 = t29 - t24 * t30;
    const double u_p_y_p_z = kf->U[5];
    const double t32 = t19 * u_p_y_p_z;
    const double t33 = u_p_z_v_x * t32 - u_p_y_v_x;
    const double t34 = t32 - t24 * t33;
    const double d_p_y = kf->D[2];
    const double t35 = d_p_y + 0.020833333333333332;
    const double t36 = d_p_y * (1.0 / t35);
    const double t37 = 0.020833333333333332 * t36;
    const double t38 = t20 * u_p_y_p_z;
    const double t39 = t35 + u_p_y_p_z * t38;
    const double t40 = 1.0 / t39;
    const double t41 = t38 * t40;
    const double t42 = t20 * (t35 * t40);
    const double t43 = t25 * t33;
    const double t44 = t39 + t33 * t43;
    const double t45 = 1.0 / t44;
    const double t46 = t43 * t45;
    const double t47 = t25 * (t39 * t45);
    const double u_clock_p_y = kf->U[1];
    const double t48 = t36 * u_clock_p_y;
    const double t49 = u_p_y_p_z * t48 - u_clock_p_z;
    const double t50 = t48 - t41 * t49;
    const double t51 = t27 - t33 * t50;
    const double t52 = t50 + t46 * t51;
    const double u_p_x_p_y = kf->U[2];
    const double t53 = t36 * u_p_x_p_y;
    const double t54 = u_p_y_p_z * t53 - u_p_x_p_z;
    const double t55 = t53 - t41 * t54;
    const double t56 = t30 - t33 * t55;
    const double t57 = t55 + t46 * t56;
    const double d_p_x = kf->D[1];
    const double t58 = d_p_x + 0.020833333333333332;
    const double t59 = d_p_x * (1.0 / t58);
    const double t60 = t37 * u_p_x_p_y;
    const double t61 = t58 + u_p_x_p_y * t60;
    const double t62 = 1.0 / t61;
    const double t63 = t42 * t54;
    const double t64 = t61 + t54 * t63;
    const double t65 = 1.0 / t64;
    const double t66 = t47 * t56;
    const double t67 = t64 + t56 * t66;
    const double t68 = 1.0 / t67;
    const double u_clock_p_x = kf->U[0];
    const double t69 = t59 * u_clock_p_x;
    const double t70 = u_p_x_p_y * t69 - u_clock_p_y;
    const double t71 = t69 - t60 * t62 * t70;
    const double t72 = t49 - t54 * t71;
    const double t73 = t71 + t63 * t65 * t72;
    const double t74 = t51 - t56 * t73;
    const double t75 = t73 + t66 * t68 * t74;

    /* process noise, columns 5 to 7 */
    const double d_drift = kf->D[7];
    const double d_drift_next = d_drift + 0.0004;
    const double t76 = 1.0 / d_drift_next;
    const double t77 = d_drift * t76;
    const double t78 = 0.0004 * t77;
    const double u_clock_drift_next = t77 * t6 + 0.0002 * t76;
    const double u_p_x_drift_next = t77 * t7;
    const double u_p_y_drift_next = t77 * t8;
    const double u_p_z_drift_next = t77 * t9;
    const double u_v_x_drift_next = t77 * u_v_x_drift;
    const double u_v_y_drift_next = t77 * u_v_y_drift;
    const double u_v_z_drift_next = t77 * u_v_z_drift;
    const double d_v_z = kf->D[6];
    const double t79 = d_v_z + 0.25;
    const double t80 = 1.0 / t79;
    const double t81 = d_v_z * t80;
    const double t82 = 0.25 * t81;
    const double t83 = t78 * u_v_z_drift;
    const double d_v_z_next = t79 + u_v_z_drift * t83;
    const double t84 = 1.0 / d_v_z_next;
    const double t85 = t83 * t84;
    const double t86 = t78 * (t79 * t84);
    const double u_clock_v_z = kf->U[15];
    const double t87 = t81 * u_clock_v_z;
    const double t88 = 0.5 - t6 + u_v_z_drift * t87;
    const double u_clock_v_z_next = t87 - t85 * t88;
    const double t89 = t81 * t3;
    const double t90 = u_v_z_drift * t89 - t7;
    const double u_p_x_v_z_next = t89 - t85 * t90;
    const double t91 = t81 * t4;
    const double t92 = u_v_z_drift * t91 - t8;
    const double u_p_y_v_z_next = t91 - t85 * t92;
    const double t93 = t81 * t5 + 0.125 * t80;
    const double t94 = u_v_z_drift * t93 - t9;
    const double u_p_z_v_z_next = t93 - t85 * t94;
    const double t95 = t81 * u_v_x_v_z;
    const double t96 = u_v_z_drift * t95 - u_v_x_drift;
    const double u_v_x_v_z_next = t95 - t85 * t96;
    const double t97 = t81 * u_v_y_v_z;
    const double t98 = u_v_z_drift * t97 - u_v_y_drift;
    const double u_v_y_v_z_next = t97 - t85 * t98;
    const double d_v_y = kf->D[5];
    const double t99 = d_v_y + 0.25;
    const double t100 = 1.0 / t99;
    const double t101 = d_v_y * t100;
    const double t102 = 0.25 * t101;
    const double t103 = t82 * u_v_y_v_z;
    const double t104 = t99 + u_v_y_v_z * t103;
    const double t105 = 1.0 / t104;
    const double t106 = t103 * t105;
    const double t107 = t82 * (t99 * t105);
    const double t108 = t86 * t98;
    const double d_v_y_next = t104 + t98 * t108;
    const double t109 = 1.0 / d_v_y_next;
    const double t110 = t108 * t109;
    const double t111 = t86 * (t104 * t109);
    const double u_clock_v_y = kf->U[10];
    const double t112 = t101 * u_clock_v_y;
    const double t113 = u_v_y_v_z * t112 - u_clock_v_z;
    const double t114 = t112 - t106 * t113;
    const double t115 = t88 - t98 * t114;
    const double u_clock_v_y_next = t114 + t110 * t115;
    const double t116 = t101 * t1;
    const double t117 = u_v_y_v_z * t116 - t3;
    const double t118 = t116 - t106 * t117;
    const double t119 = t90 - t98 * t118;
    const double u_p_x_v_y_next = t118 + t110 * t119;
    const double t120 = t101 * t2 + 0.125 * t100;
    const double t121 = u_v_y_v_z * t120 - t4;
    const double t122 = t120 - t106 * t121;
    const double t123 = t92 - t98 * t122;
    const double u_p_y_v_y_next = t122 + t110 * t123;
    const double u_p_z_v_y = kf->U[13];
    const double t124 = t101 * u_p_z_v_y;
    const double t125 = 0.5 - t5 + u_v_y_v_z * t124;
    const double t126 = t124 - t106 * t125;
    const double t127 = t94 - t98 * t126;
    const double u_p_z_v_y_next = t126 + t110 * t127;
    const double t128 = t101 * u_v_x_v_y;
    const double t129 = u_v_y_v_z * t128 - u_v_x_v_z;
    const double t130 = t128 - t106 * t129;
    const double t131 = t96 - t98 * t130;
    const double u_v_x_v_y_next = t130 + t110 * t131;
    const double t132 = t102 * u_v_x_v_y;
    const double t133 = t10 + u_v_x_v_y * t132;
    const double t134 = 1.0 / t133;
    const double t135 = t132 * t134;
    const double t136 = t102 * (t10 * t134);
    const double t137 = t107 * t129;
    const double t138 = t133 + t129 * t137;
    const double t139 = 1.0 / t138;
    const double t140 = t137 * t139;
    const double t141 = t107 * (t133 * t139);
    const double t142 = t111 * t131;
    const double d_v_x_next = t138 + t131 * t142;
    const double t143 = 1.0 / d_v_x_next;
    const double t144 = t142 * t143;
    const double t145 = t111 * (t138 * t143);
    const double t146 = u_v_x_v_y * t14 - u_clock_v_y;
    const double t147 = t14 - t135 * t146;
    const double t148 = t113 - t129 * t147;
    const double t149 = t147 + t140 * t148;
    const double t150 = t115 - t131 * t149;
    const double u_clock_v_x_next = t149 + t144 * t150;
    const double t151 = u_v_x_v_y * t15 - t1;
    const double t152 = t15 - t135 * t151;
    const double t153 = t117 - t129 * t152;
    const double t154 = t152 + t140 * t153;
    const double t155 = t119 - t131 * t154;
    const double u_p_x_v_x_next = t154 + t144 * t155;
    const double t156 = 0.5 - t2 + u_v_x_v_y * t16;
    const double t157 = t16 - t135 * t156;
    const double t158 = t121 - t129 * t157;
    const double t159 = t157 + t140 * t158;
    const double t160 = t123 - t131 * t159;
    const double u_p_y_v_x_next = t159 + t144 * t160;
    const double t161 = u_v_x_v_y * t17 - u_p_z_v_y;
    const double t162 = t17 - t135 * t161;
    const double t163 = t125 - t129 * t162;
    const double t164 = t162 + t140 * t163;
    const double t165 = t127 - t131 * t164;
    const double u_p_z_v_x_next = t164 + t144 * t165;
    const double t166 = t136 * t161;
    const double t167 = t22 + t161 * t166;
    const double t168 = 1.0 / t167;
    const double t169 = t166 * t168;
    const double t170 = t136 * (t22 * t168);
    const double t171 = t141 * t163;
    const double t172 = t167 + t163 * t171;
    const double t173 = 1.0 / t172;
    const double t174 = t171 * t173;
    const double t175 = t141 * (t167 * t173);
    const double t176 = t145 * t165;
    const double d_p_z_next = t172 + t165 * t176;
    const double t177 = 1.0 / d_p_z_next;
    const double t178 = t176 * t177;
    const double t179 = t145 * (t172 * t177);
    const double t180 = t146 - t161 * t28;
    const double t181 = t28 + t169 * t180;
    const double t182 = t148 - t163 * t181;
    const double t183 = t181 + t174 * t182;
    const double t184 = t150 - t165 * t183;
    const double u_clock_p_z_next = t183 + t178 * t184;
    const double t185 = t151 - t161 * t31;
    const double t186 = t31 + t169 * t185;
    const double t187 = t153 - t163 * t186;
    const double t188 = t186 + t174 * t187;
    const double t189 = t155 - t165 * t188;
    const double u_p_x_p_z_next = t188 + t178 * t189;
    const double t190 = t156 - t161 * t34;
    const double t191 = t34 + t169 * t190;
    const double t192 = t158 - t163 * t191;
    const double t193 = t191 + t174 * t192;
    const double t194 = t160 - t165 * t193;
    const double u_p_y_p_z_next = t193 + t178 * t194;
    const double t195 = t170 * t190;
    const double t196 = t44 + t190 * t195;
    const double t197 = 1.0 / t196;
    const double t198 = t195 * t197;
    const double t199 = t170 * (t44 * t197);
    const double t200 = t175 * t192;
    const double t201 = t196 + t192 * t200;
    const double t202 = 1.0 / t201;
    const double t203 = t200 * t202;
    const double t204 = t175 * (t196 * t202);
    const double t205 = t179 * t194;
    const double d_p_y_next = t201 + t194 * t205;
    const double t206 = 1.0 / d_p_y_next;
    const double t207 = t205 * t206;
    const double t208 = t179 * (t201 * t206);
    const double t209 = t180 - t190 * t52;
    const double t210 = t52 + t198 * t209;
    const double t211 = t182 - t192 * t210;
    const double t212 = t210 + t203 * t211;
    const double t213 = t184 - t194 * t212;
    const double u_clock_p_y_next = t212 + t207 * t213;
    const double t214 = t185 - t190 * t57;
    const double t215 = t57 + t198 * t214;
    const double t216 = t187 - t192 * t215;
    const double t217 = t215 + t203 * t216;
    const double t218 = t189 - t194 * t217;
    const double u_p_x_p_y_next = t217 + t207 * t218;
    const double t219 = t199 * t214;
    const double t220 = t67 + t214 * t219;
    const double t221 = 1.0 / t220;
    const double t222 = t204 * t216;
    const double t223 = t220 + t216 * t222;
    const double t224 = 1.0 / t223;
    const double t225 = t208 * t218;
    const double d_p_x_next = t223 + t218 * t225;
    const double t226 = 1.0 / d_p_x_next;
    const double t227 = t209 - t214 * t75;
    const double t228 = t75 + t219 * t221 * t227;
    const double t229 = t211 - t216 * t228;
    const double t230 = t228 + t222 * t224 * t229;
    const double t231 = t213 - t218 * t230;
    const double u_clock_p_x_next = t230 + t225 * t226 * t231;
    const double d_clock = kf->D[0];
    const double d_clock_next = d_clock + 0.04003333333333333
        + u_clock_p_x * (0.020833333333333332 * t59 * u_clock_p_x) + t70 * (t37 * (t58 * t62) * t70)
        + t72 * (t42 * (t61 * t65) * t72) + t74 * (t47 * (t64 * t68) * t74)
        + t227 * (t199 * (t67 * t221) * t227) + t229 * (t204 * (t220 * t224) * t229)
        + t231 * (t208 * (t223 * t226) * t231);

    /* guards */
    if (!gnss_finite(p_x_next + p_y_next + p_z_next + clock_next + d_clock_next + d_p_x_next
        + d_p_y_next + d_p_z_next + d_v_x_next + d_v_y_next + d_v_z_next + d_drift_next)) {
        return GNSS_NOT_FINITE;
    }

    /* store */
    kf->x[GNSS_P_X] = p_x_next;
    kf->x[GNSS_P_Y] = p_y_next;
    kf->x[GNSS_P_Z] = p_z_next;
    kf->x[GNSS_CLOCK] = clock_next;
    kf->U[0] = u_clock_p_x_next;
    kf->U[1] = u_clock_p_y_next;
    kf->U[2] = u_p_x_p_y_next;
    kf->U[3] = u_clock_p_z_next;
    kf->U[4] = u_p_x_p_z_next;
    kf->U[5] = u_p_y_p_z_next;
    kf->U[6] = u_clock_v_x_next;
    kf->U[7] = u_p_x_v_x_next;
    kf->U[8] = u_p_y_v_x_next;
    kf->U[9] = u_p_z_v_x_next;
    kf->U[10] = u_clock_v_y_next;
    kf->U[11] = u_p_x_v_y_next;
    kf->U[12] = u_p_y_v_y_next;
    kf->U[13] = u_p_z_v_y_next;
    kf->U[14] = u_v_x_v_y_next;
    kf->U[15] = u_clock_v_z_next;
    kf->U[16] = u_p_x_v_z_next;
    kf->U[17] = u_p_y_v_z_next;
    kf->U[18] = u_p_z_v_z_next;
    kf->U[19] = u_v_x_v_z_next;
    kf->U[20] = u_v_y_v_z_next;
    kf->U[21] = u_clock_drift_next;
    kf->U[22] = u_p_x_drift_next;
    kf->U[23] = u_p_y_drift_next;
    kf->U[24] = u_p_z_drift_next;
    kf->U[25] = u_v_x_drift_next;
    kf->U[26] = u_v_y_drift_next;
    kf->U[27] = u_v_z_drift_next;
    kf->D[0] = d_clock_next;
    kf->D[1] = d_p_x_next;
    kf->D[2] = d_p_y_next;
    kf->D[3] = d_p_z_next;
    kf->D[4] = d_v_x_next;
    kf->D[5] = d_v_y_next;
    kf->D[6] = d_v_z_next;
    kf->D[7] = d_drift_next;
    return GNSS_OK;
}

gnss_status_t gnss_update_sat(gnss_t *kf, const gnss_sat_t *z)
{
    if (kf == NULL || z == NULL) { return GNSS_NULL_ARGUMENT; }

    /* arguments */
    if (!gnss_finite(z->pos_x)) { return GNSS_NOT_FINITE; }
    if (!gnss_finite(z->pos_y)) { return GNSS_NOT_FINITE; }
    if (!gnss_finite(z->pos_z)) { return GNSS_NOT_FINITE; }
    if (!gnss_finite(z->vel_x)) { return GNSS_NOT_FINITE; }
    if (!gnss_finite(z->vel_y)) { return GNSS_NOT_FINITE; }
    if (!gnss_finite(z->vel_z)) { return GNSS_NOT_FINITE; }
    if (!gnss_finite(z->sigma)) { return GNSS_NOT_FINITE; }

    /* innovation */
    const double p_x = kf->x[GNSS_P_X];
    const double p_y = kf->x[GNSS_P_Y];
    const double p_z = kf->x[GNSS_P_Z];
    const double v_x = kf->x[GNSS_V_X];
    const double v_y = kf->x[GNSS_V_Y];
    const double v_z = kf->x[GNSS_V_Z];
    const double clock = kf->x[GNSS_CLOCK];
    const double drift = kf->x[GNSS_DRIFT];
    const double t0 = z->pos_x - p_x;
    const double t1 = t0 * t0;
    const double t2 = z->pos_y - p_y;
    const double t3 = t2 * t2;
    const double t4 = z->pos_z - p_z;
    const double t5 = t4 * t4;
    const double t6 = sqrt(t1 + t3 + t5);
    const double h_rho = clock + t6;
    const bool t7 = t6 > 0.0;
    const double t8 = 1.0 / t6;
    const double t9 = t7 ? t8 : 0.0;
    const double t10 = t0 * t9;
    const double t11 = t2 * t9;
    const double t12 = t4 * t9;
    const double t13 = z->vel_x - v_x;
    const double t14 = t7 ? t0 / t6 : 0.0;
    const double t15 = z->vel_y - v_y;
    const double t16 = t7 ? t2 / t6 : 0.0;
    const double t17 = z->vel_z - v_z;
    const double t18 = t7 ? t4 / t6 : 0.0;
    const double h_rate = drift + t13 * t14 + t15 * t16 + t17 * t18;
    const double t19 = t6 * t6;
    const double t20 = t7 ? t0 * t2 * t9 / t19 : 0.0;
    const double t21 = t7 ? t0 * t4 * t9 / t19 : 0.0;
    const double h_rate_p_x = t13 * (t7 ? t1 * t9 / t19 - t8 : 0.0) + t15 * t20 + t17 * t21;
    const double t22 = t7 ? t2 * t4 * t9 / t19 : 0.0;
    const double h_rate_p_y = t13 * t20 + t15 * (t7 ? t3 * t9 / t19 - t8 : 0.0) + t17 * t22;
    const double h_rate_p_z = t13 * t21 + t15 * t22 + t17 * (t7 ? t5 * t9 / t19 - t8 : 0.0);
    const double y_rho = z->rho - h_rho;
    const double y_rate = z->rate - h_rate;
    const double t23 = z->sigma * z->sigma;

    /* gain and covariance: rho, rate */
    const double d_clock = kf->D[0];
    const double t24 = t23 + d_clock;
    const double t25 = 1.0 / t24;
    const double t26 = d_clock * t25;
    const double d_clock_next = d_clock * (t23 * t25);
    const double u_clock_p_x = kf->U[0];
    const double t27 = u_clock_p_x - t10;
    const double d_p_x = kf->D[1];
    const double t28 = d_p_x * t27;
    const double t29 = t24 + t27 * t28;
    const double t30 = 1.0 / t29;
    const double t31 = t28 * t30;
    const double t32 = d_p_x * (t24 * t30);
    const double t33 = t32 * h_rate_p_x;
    const double t34 = 0.01 + h_rate_p_x * t33;
    const double t35 = 1.0 / t34;
    const double t36 = t33 * t35;
    const double d_p_x_next = t32 * (0.01 * t35);
    const double u_clock_p_x_next = u_clock_p_x - t27 * t26;
    const double t37 = t26 + t31 * u_clock_p_x_next;
    const double t38 = t36 * u_clock_p_x_next;
    const double u_clock_p_y = kf->U[1];
    const double u_p_x_p_y = kf->U[2];
    const double t39 = u_clock_p_y - u_p_x_p_y * t10 - t11;
    const double d_p_y = kf->D[2];
    const double t40 = d_p_y * t39;
    const double t41 = t29 + t39 * t40;
    const double t42 = 1.0 / t41;
    const double t43 = t40 * t42;
    const double t44 = d_p_y * (t29 * t42);
    const double t45 = u_p_x_p_y - t39 * t31;
    const double t46 = t45 * h_rate_p_x + h_rate_p_y;
    const double t47 = t44 * t46;
    const double t48 = t34 + t46 * t47;
    const double t49 = 1.0 / t48;
    const double t50 = t47 * t49;
    const double d_p_y_next = t44 * (t34 * t49);
    const double t51 = t31 + t43 * t45;
    const double u_p_x_p_y_next = t45 - t46 * t36;
    const double t52 = t36 + t50 * u_p_x_p_y_next;
    const double t53 = u_clock_p_y - t39 * t37;
    const double t54 = t37 + t43 * t53;
    const double u_clock_p_y_next = t53 - t46 * t38;
    const double t55 = t38 + t50 * u_clock_p_y_next;
    const double u_clock_p_z = kf->U[3];
    const double u_p_x_p_z = kf->U[4];
    const double u_p_y_p_z = kf->U[5];
    const double t56 = u_clock_p_z - u_p_x_p_z * t10 - u_p_y_p_z * t11 - t12;
    const double d_p_z = kf->D[3];
    const double t57 = d_p_z * t56;
    const double t58 = t41 + t56 * t57;
    const double t59 = 1.0 / t58;
    const double t60 = t57 * t59;
    const double t61 = d_p_z * (t41 * t59);
    const double t62 = u_p_x_p_z - t56 * t51;
    const double t63 = u_p_y_p_z - t56 * t43;
    const double t64 = t62 * h_rate_p_x + t63 * h_rate_p_y + h_rate_p_z;
    const double t65 = t61 * t64;
    const double t66 = t48 + t64 * t65;
    const double t67 = 1.0 / t66;
    const double t68 = t65 * t67;
    const double d_p_z_next = t61 * (t48 * t67);
    const double t69 = t43 + t60 * t63;
    const double u_p_y_p_z_next = t63 - t64 * t50;
    const double t70 = t50 + t68 * u_p_y_p_z_next;
    const double t71 = t51 + t60 * t62;
    const double u_p_x_p_z_next = t62 - t64 * t52;
    const double t72 = t52 + t68 * u_p_x_p_z_next;
    const double t73 = u_clock_p_z - t56 * t54;
    const double t74 = t54 + t60 * t73;
    const double u_clock_p_z_next = t73 - t64 * t55;
    const double t75 = t55 + t68 * u_clock_p_z_next;
    const double u_clock_v_x = kf->U[6];
    const double u_p_x_v_x = kf->U[7];
    const double u_p_y_v_x = kf->U[8];
    const double u_p_z_v_x = kf->U[9];
    const double t76 = u_clock_v_x - u_p_x_v_x * t10 - u_p_y_v_x * t11 - u_p_z_v_x * t12;
    const double d_v_x = kf->D[4];
    const double t77 = d_v_x * t76;
    const double t78 = t58 + t76 * t77;
    const double t79 = 1.0 / t78;
    const double t80 = t77 * t79;
    const double t81 = d_v_x * (t58 * t79);
    const double t82 = u_p_x_v_x - t76 * t71;
    const double t83 = u_p_y_v_x - t76 * t69;
    const double t84 = u_p_z_v_x - t76 * t60;
    const double t85 = t82 * h_rate_p_x + t83 * h_rate_p_y + t84 * h_rate_p_z - t14;
    const double t86 = t81 * t85;
    const double t87 = t66 + t85 * t86;
    const double t88 = 1.0 / t87;
    const double t89 = t86 * t88;
    const double d_v_x_next = t81 * (t66 * t88);
    const double t90 = t60 + t80 * t84;
    const double u_p_z_v_x_next = t84 - t85 * t68;
    const double t91 = t68 + t89 * u_p_z_v_x_next;
    const double t92 = t69 + t80 * t83;
    const double u_p_y_v_x_next = t83 - t85 * t70;
    const double t93 = t70 + t89 * u_p_y_v_x_next;
    const double t94 = t71 + t80 * t82;
    const double u_p_x_v_x_next = t82 - t85 * t72;
    const double t95 = t72 + t89 * u_p_x_v_x_next;
    const double t96 = u_clock_v_x - t76 * t74;
    const double t97 = t74 + t80 * t96;
    const double u_clock_v_x_next = t96 - t85 * t75;
    const double t98 = t75 + t89 * u_clock_v_x_next;
    const double u_clock_v_y = kf->U[10];
    const double u_p_x_v_y = kf->U[11];
    const double u_p_y_v_y = kf->U[12];
    const double u_p_z_v_y = kf->U[13];
    const double t99 = u_clock_v_y - u_p_x_v_y * t10 - u_p_y_v_y * t11 - u_p_z_v_y * t12;
    const double d_v_y = kf->D[5];
    const double t100 = d_v_y * t99;
    const double t101 = t78 + t99 * t100;
    const double t102 = 1.0 / t101;
    const double t103 = t100 * t102;
    const double t104 = d_v_y * (t78 * t102);
    const double t105 = u_p_x_v_y - t99 * t94;
    const double t106 = u_p_y_v_y - t99 * t92;
    const double t107 = u_p_z_v_y - t99 * t90;
    const double u_v_x_v_y = kf->U[14];
    const double t108 = u_v_x_v_y - t99 * t80;
    const double t109 = t105 * h_rate_p_x + t106 * h_rate_p_y + t107 * h_rate_p_z - t108 * t14
        - t16;
    const double t110 = t104 * t109;
    const double t111 = t87 + t109 * t110;
    const double t112 = 1.0 / t111;
    const double t113 = t110 * t112;
    const double d_v_y_next = t104 * (t87 * t112);
    const double t114 = t80 + t103 * t108;
    const double u_v_x_v_y_next = t108 - t109 * t89;
    const double t115 = t89 + t113 * u_v_x_v_y_next;
    const double t116 = t90 + t103 * t107;
    const double u_p_z_v_y_next = t107 - t109 * t91;
    const double t117 = t91 + t113 * u_p_z_v_y_next;
    const double t118 = t92 + t103 * t106;
    const double u_p_y_v_y_next = t106 - t109 * t93;
    const double t119 = t93 + t113 * u_p_y_v_y_next;
    const double t120 = t94 + t103 * t105;
    const double u_p_x_v_y_next = t105 - t109 * t95;
    const double t121 = t95 + t113 * u_p_x_v_y_next;
    const double t122 = u_clock_v_y - t99 * t97;
    const double t123 = t97 + t103 * t122;
    const double u_clock_v_y_next = t122 - t109 * t98;
    const double t124 = t98 + t113 * u_clock_v_y_next;
    const double u_clock_v_z = kf->U[15];
    const double u_p_x_v_z = kf->U[16];
    const double u_p_y_v_z = kf->U[17];
    const double u_p_z_v_z = kf->U[18];
    const double t125 = u_clock_v_z - u_p_x_v_z * t10 - u_p_y_v_z * t11 - u_p_z_v_z * t12;
    const double d_v_z = kf->D[6];
    const double t126 = d_v_z * t125;
    const double t127 = t101 + t125 * t126;
    const double t128 = 1.0 / t127;
    const double t129 = t126 * t128;
    const double t130 = d_v_z * (t101 * t128);
    const double t131 = u_p_x_v_z - t125 * t120;
    const double t132 = u_p_y_v_z - t125 * t118;
    const double t133 = u_p_z_v_z - t125 * t116;
    const double u_v_x_v_z = kf->U[19];
    const double t134 = u_v_x_v_z - t125 * t114;
    const double u_v_y_v_z = kf->U[20];
    const double t135 = u_v_y_v_z - t125 * t103;
    const double t136 = t131 * h_rate_p_x + t132 * h_rate_p_y + t133 * h_rate_p_z - t134 * t14
        - t135 * t16 - t18;
    const double t137 = t130 * t136;
    const double t138 = t111 + t136 * t137;
    const double t139 = 1.0 / t138;
    const double t140 = t137 * t139;
    const double d_v_z_next = t130 * (t111 * t139);
    const double t141 = t103 + t129 * t135;
    const double u_v_y_v_z_next = t135 - t136 * t113;
    const double t142 = t113 + t140 * u_v_y_v_z_next;
    const double t143 = t114 + t129 * t134;
    const double u_v_x_v_z_next = t134 - t136 * t115;
    const double t144 = t115 + t140 * u_v_x_v_z_next;
    const double t145 = t116 + t129 * t133;
    const double u_p_z_v_z_next = t133 - t136 * t117;
    const double t146 = t117 + t140 * u_p_z_v_z_next;
    const double t147 = t118 + t129 * t132;
    const double u_p_y_v_z_next = t132 - t136 * t119;
    const double t148 = t119 + t140 * u_p_y_v_z_next;
    const double t149 = t120 + t129 * t131;
    const double u_p_x_v_z_next = t131 - t136 * t121;
    const double t150 = t121 + t140 * u_p_x_v_z_next;
    const double t151 = u_clock_v_z - t125 * t123;
    const double t152 = t123 + t129 * t151;
    const double u_clock_v_z_next = t151 - t136 * t124;
    const double t153 = t124 + t140 * u_clock_v_z_next;
    const double u_clock_drift = kf->U[21];
    const double u_p_x_drift = kf->U[22];
    const double u_p_y_drift = kf->U[23];
    const double u_p_z_drift = kf->U[24];
    const double t154 = u_clock_drift - u_p_x_drift * t10 - u_p_y_drift * t11 - u_p_z_drift * t12;
    const double d_drift = kf->D[7];
    const double t155 = d_drift * t154;
    const double s_rho = t127 + t154 * t155;
    const double t156 = 1.0 / s_rho;
    const double t157 = t155 * t156;
    const double t158 = d_drift * (t127 * t156);
    const double t159 = u_p_x_drift - t154 * t149;
    const double t160 = u_p_y_drift - t154 * t147;
    const double t161 = u_p_z_drift - t154 * t145;
    const double u_v_x_drift = kf->U[25];
    const double t162 = u_v_x_drift - t154 * t143;
    const double u_v_y_drift = kf->U[26];
    const double t163 = u_v_y_drift - t154 * t141;
    const double u_v_z_drift = kf->U[27];
    const double t164 = u_v_z_drift - t154 * t129;
    const double t165 = t159 * h_rate_p_x + t160 * h_rate_p_y + t161 * h_rate_p_z - t162 * t14
        - t163 * t16 - t164 * t18 + 1.0;
    const double t166 = t158 * t165;
    const double s_rate = t138 + t165 * t166;
    const double t167 = 1.0 / s_rate;
    const double t168 = t166 * t167;
    const double d_drift_next = t158 * (t138 * t167);
    const double u_v_z_drift_next = t164 - t165 * t140;
    const double u_v_y_drift_next = t163 - t165 * t142;
    const double u_v_x_drift_next = t162 - t165 * t144;
    const double u_p_z_drift_next = t161 - t165 * t146;
    const double u_p_y_drift_next = t160 - t165 * t148;
    const double u_p_x_drift_next = t159 - t165 * t150;
    const double t169 = u_clock_drift - t154 * t152;
    const double u_clock_drift_next = t169 - t165 * t153;
    const double t170 = (t149 + t157 * t159) * y_rho;
    const double t171 = (t147 + t157 * t160) * y_rho;
    const double t172 = (t145 + t157 * t161) * y_rho;
    const double t173 = (t143 + t157 * t162) * y_rho;
    const double t174 = (t141 + t157 * t163) * y_rho;
    const double t175 = (t129 + t157 * t164) * y_rho;
    const double t176 = t157 * y_rho;
    const double nu_rate = y_rate - h_rate_p_x * t170 - h_rate_p_y * t171 - h_rate_p_z * t172
        + t14 * t173 + t16 * t174 + t18 * t175 - t176;
    const double nis = y_rho * (y_rho * t156) + nu_rate * (nu_rate * t167);

    /* state and innovation squared */
    const double clock_next = clock + (t152 + t157 * t169) * y_rho
        + (t153 + t168 * u_clock_drift_next) * nu_rate;
    const double p_x_next = p_x + t170 + (t150 + t168 * u_p_x_drift_next) * nu_rate;
    const double p_y_next = p_y + t171 + (t148 + t168 * u_p_y_drift_next) * nu_rate;
    const double p_z_next = p_z + t172 + (t146 + t168 * u_p_z_drift_next) * nu_rate;
    const double v_x_next = v_x + t173 + (t144 + t168 * u_v_x_drift_next) * nu_rate;
    const double v_y_next = v_y + t174 + (t142 + t168 * u_v_y_drift_next) * nu_rate;
    const double v_z_next = v_z + t175 + (t140 + t168 * u_v_z_drift_next) * nu_rate;
    const double drift_next = drift + t176 + t168 * nu_rate;

    /* guards */
    if (!gnss_finite(y_rho + y_rate + s_rho + s_rate)) { return GNSS_NOT_FINITE; }
    if (!(s_rho > 0.0) || !(s_rate > 0.0)) { return GNSS_NOT_POSITIVE; }

    /* gate */
    if (nis > 18.420680743952367) {
        kf->nis = nis;
        return GNSS_GATED;
    }
    if (!gnss_finite(nis + p_x_next + p_y_next + p_z_next + v_x_next + v_y_next + v_z_next
        + clock_next + drift_next)) {
        return GNSS_NOT_FINITE;
    }

    /* store */
    kf->x[GNSS_P_X] = p_x_next;
    kf->x[GNSS_P_Y] = p_y_next;
    kf->x[GNSS_P_Z] = p_z_next;
    kf->x[GNSS_V_X] = v_x_next;
    kf->x[GNSS_V_Y] = v_y_next;
    kf->x[GNSS_V_Z] = v_z_next;
    kf->x[GNSS_CLOCK] = clock_next;
    kf->x[GNSS_DRIFT] = drift_next;
    kf->U[0] = u_clock_p_x_next;
    kf->U[1] = u_clock_p_y_next;
    kf->U[2] = u_p_x_p_y_next;
    kf->U[3] = u_clock_p_z_next;
    kf->U[4] = u_p_x_p_z_next;
    kf->U[5] = u_p_y_p_z_next;
    kf->U[6] = u_clock_v_x_next;
    kf->U[7] = u_p_x_v_x_next;
    kf->U[8] = u_p_y_v_x_next;
    kf->U[9] = u_p_z_v_x_next;
    kf->U[10] = u_clock_v_y_next;
    kf->U[11] = u_p_x_v_y_next;
    kf->U[12] = u_p_y_v_y_next;
    kf->U[13] = u_p_z_v_y_next;
    kf->U[14] = u_v_x_v_y_next;
    kf->U[15] = u_clock_v_z_next;
    kf->U[16] = u_p_x_v_z_next;
    kf->U[17] = u_p_y_v_z_next;
    kf->U[18] = u_p_z_v_z_next;
    kf->U[19] = u_v_x_v_z_next;
    kf->U[20] = u_v_y_v_z_next;
    kf->U[21] = u_clock_drift_next;
    kf->U[22] = u_p_x_drift_next;
    kf->U[23] = u_p_y_drift_next;
    kf->U[24] = u_p_z_drift_next;
    kf->U[25] = u_v_x_drift_next;
    kf->U[26] = u_v_y_drift_next;
    kf->U[27] = u_v_z_drift_next;
    kf->D[0] = d_clock_next;
    kf->D[1] = d_p_x_next;
    kf->D[2] = d_p_y_next;
    kf->D[3] = d_p_z_next;
    kf->D[4] = d_v_x_next;
    kf->D[5] = d_v_y_next;
    kf->D[6] = d_v_z_next;
    kf->D[7] = d_drift_next;
    kf->nis = nis;
    return GNSS_OK;
}

gnss_status_t gnss_update_sat_masked(gnss_t *kf, const gnss_sat_t *z, uint32_t mask)
{
    if (kf == NULL || z == NULL) { return GNSS_NULL_ARGUMENT; }
    const bool t0 = (mask & 0x1u) != 0u;
    const bool t1 = (mask & 0x2u) != 0u;
    if (!(t0 || t1)) { return GNSS_OK; }

    /* arguments */
    if (!gnss_finite(z->pos_x)) { return GNSS_NOT_FINITE; }
    if (!gnss_finite(z->pos_y)) { return GNSS_NOT_FINITE; }
    if (!gnss_finite(z->pos_z)) { return GNSS_NOT_FINITE; }
    if (t1 && !gnss_finite(z->vel_x)) { return GNSS_NOT_FINITE; }
    if (t1 && !gnss_finite(z->vel_y)) { return GNSS_NOT_FINITE; }
    if (t1 && !gnss_finite(z->vel_z)) { return GNSS_NOT_FINITE; }
    if (t0 && !gnss_finite(z->sigma)) { return GNSS_NOT_FINITE; }

    /* innovation */
    const double p_x = kf->x[GNSS_P_X];
    const double p_y = kf->x[GNSS_P_Y];
    const double p_z = kf->x[GNSS_P_Z];
    const double v_x = kf->x[GNSS_V_X];
    const double v_y = kf->x[GNSS_V_Y];
    const double v_z = kf->x[GNSS_V_Z];
    const double clock = kf->x[GNSS_CLOCK];
    const double drift = kf->x[GNSS_DRIFT];
    const double t2 = z->pos_x - p_x;
    const double t3 = t2 * t2;
    const double t4 = z->pos_y - p_y;
    const double t5 = t4 * t4;
    const double t6 = z->pos_z - p_z;
    const double t7 = t6 * t6;
    const double t8 = sqrt(t3 + t5 + t7);
    const double h_rho = clock + t8;
    const bool t9 = t8 > 0.0;
    const double t10 = 1.0 / t8;
    const double t11 = t9 ? t10 : 0.0;
    const double h_rho_p_x = -(t2 * t11);
    const double h_rho_p_y = -(t4 * t11);
    const double h_rho_p_z = -(t6 * t11);
    const double t12 = z->vel_x - v_x;
    const double t13 = t9 ? t2 / t8 : 0.0;
    const double t14 = z->vel_y - v_y;
    const double t15 = t9 ? t4 / t8 : 0.0;
    const double t16 = z->vel_z - v_z;
    const double t17 = t9 ? t6 / t8 : 0.0;
    const double h_rate = drift + t12 * t13 + t14 * t15 + t16 * t17;
    const double t18 = t8 * t8;
    const double t19 = t9 ? t2 * t4 * t11 / t18 : 0.0;
    const double t20 = t9 ? t2 * t6 * t11 / t18 : 0.0;
    const double h_rate_p_x = t12 * (t9 ? t3 * t11 / t18 - t10 : 0.0) + t14 * t19 + t16 * t20;
    const double t21 = t9 ? t4 * t6 * t11 / t18 : 0.0;
    const double h_rate_p_y = t12 * t19 + t14 * (t9 ? t5 * t11 / t18 - t10 : 0.0) + t16 * t21;
    const double h_rate_p_z = t12 * t20 + t14 * t21 + t16 * (t9 ? t7 * t11 / t18 - t10 : 0.0);
    const double h_rate_v_x = -t13;
    const double h_rate_v_y = -t15;
    const double h_rate_v_z = -t17;
    const double y_rho = z->rho - h_rho;
    const double y_rate = z->rate - h_rate;
    const double y = t0 ? y_rho : 0.0;
    const double y_1 = t1 ? y_rate : 0.0;
    const double t22 = t0 ? 1.0 : 0.0;
    const double t23 = t0 ? h_rho_p_x : 0.0;
    const double t24 = t0 ? h_rho_p_y : 0.0;
    const double t25 = t0 ? h_rho_p_z : 0.0;
    const double t26 = t1 ? h_rate_p_x : 0.0;
    const double t27 = t1 ? h_rate_p_y : 0.0;
    const double t28 = t1 ? h_rate_p_z : 0.0;
    const double t29 = t1 ? h_rate_v_x : 0.0;
    const double t30 = t1 ? h_rate_v_y : 0.0;
    const double t31 = t1 ? h_rate_v_z : 0.0;
    const double t32 = t1 ? 1.0 : 0.0;
    const double t33 = t0 ? z->sigma * z->sigma : 1.0;
    const double t34 = t1 ? 0.01 : 1.0;

    /* gain and covariance: rho, rate */
    const double d_clock = kf->D[0];
    const double t35 = d_clock * t22;
    const double t36 = t33 + t22 * t35;
    const double t37 = 1.0 / t36;
    const double t38 = t35 * t37;
    const double d_clock_next = d_clock * (t33 * t37);
    const double u_clock_p_x = kf->U[0];
    const double t39 = u_clock_p_x * t22 + t23;
    const double d_p_x = kf->D[1];
    const double t40 = d_p_x * t39;
    const double t41 = t36 + t39 * t40;
    const double t42 = 1.0 / t41;
    const double t43 = t40 * t42;
    const double t44 = d_p_x * (t36 * t42);
    const double t45 = t44 * t26;
    const double t46 = t34 + t26 * t45;
    const double t47 = 1.0 / t46;
    const double t48 = t45 * t47;
    const double d_p_x_next = t44 * (t34 * t47);
    const double u_clock_p_x_next = u_clock_p_x - t39 * t38;
    const double t49 = t38 + t43 * u_clock_p_x_next;
    const double t50 = t48 * u_clock_p_x_next;
    const double u_clock_p_y = kf->U[1];
    const double u_p_x_p_y = kf->U[2];
    const double t51 = u_clock_p_y * t22 + u_p_x_p_y * t23 + t24;
    const double d_p_y = kf->D[2];
    const double t52 = d_p_y * t51;
    const double t53 = t41 + t51 * t52;
    const double t54 = 1.0 / t53;
    const double t55 = t52 * t54;
    const double t56 = d_p_y * (t41 * t54);
    const double t57 = u_p_x_p_y - t51 * t43;
    const double t58 = t57 * t26 + t27;
    const double t59 = t56 * t58;
    const double t60 = t46 + t58 * t59;
    const double t61 = 1.0 / t60;
    const double t62 = t59 * t61;
    const double d_p_y_next = t56 * (t46 * t61);
    const double t63 = t43 + t55 * t57;
    const double u_p_x_p_y_next = t57 - t58 * t48;
    const double t64 = t48 + t62 * u_p_x_p_y_next;
    const double t65 = u_clock_p_y - t51 * t49;
    const double t66 = t49 + t55 * t65;
    const double u_clock_p_y_next = t65 - t58 * t50;
    const double t67 = t50 + t62 * u_clock_p_y_next;
    const double u_clock_p_z = kf->U[3];
    const double u_p_x_p_z = kf->U[4];
    const double u_p_y_p_z = kf->U[5];
    const double t68 = u_clock_p_z * t22 + u_p_x_p_z * t23 + u_p_y_p_z * t24 + t25;
    const double d_p_z = kf->D[3];
    const double t69 = d_p_z * t68;
    const double t70 = t53 + t68 * t69;
    const double t71 = 1.0 / t70;
    const double t72 = t69 * t71;
    const double t73 = d_p_z * (t53 * t71);
    const double t74 = u_p_x_p_z - t68 * t63;
    const double t75 = u_p_y_p_z - t68 * t55;
    const double t76 = t74 * t26 + t75 * t27 + t28;
    const double t77 = t73 * t76;
    const double t78 = t60 + t76 * t77;
    const double t79 = 1.0 / t78;
    const double t80 = t77 * t79;
    const double d_p_z_next = t73 * (t60 * t79);
    const double t81 = t55 + t72 * t75;
    const double u_p_y_p_z_next = t75 - t76 * t62;
    const double t82 = t62 + t80 * u_p_y_p_z_next;
    const double t83 = t63 + t72 * t74;
    const double u_p_x_p_z_next = t74 - t76 * t64;
    const double t84 = t64 + t80 * u_p_x_p_z_next;
    const double t85 = u_clock_p_z - t68 * t66;
    const double t86 = t66 + t72 * t85;
    const double u_clock_p_z_next = t85 - t76 * t67;
    const double t87 = t67 + t80 * u_clock_p_z_next;
    const double u_clock_v_x = kf->U[6];
    const double u_p_x_v_x = kf->U[7];
    const double u_p_y_v_x = kf->U[8];
    const double u_p_z_v_x = kf->U[9];
    const double t88 = u_clock_v_x * t22 + u_p_x_v_x * t23 + u_p_y_v_x * t24 + u_p_z_v_x * t25;
    const double d_v_x = kf->D[4];
    const double t89 = d_v_x * t88;
    const double t90 = t70 + t88 * t89;
    const double t91 = 1.0 / t90;
    const double t92 = t89 * t91;
    const double t93 = d_v_x * (t70 * t91);
    const double t94 = u_p_x_v_x - t88 * t83;
    const double t95 = u_p_y_v_x - t88 * t81;
    const double t96 = u_p_z_v_x - t88 * t72;
    const double t97 = t94 * t26 + t95 * t27 + t96 * t28 + t29;
    const double t98 = t93 * t97;
    const double t99 = t78 + t97 * t98;
    const double t100 = 1.0 / t99;
    const double t101 = t98 * t100;
    const double d_v_x_next = t93 * (t78 * t100);
    const double t102 = t72 + t92 * t96;
    const double u_p_z_v_x_next = t96 - t97 * t80;
    const double t103 = t80 + t101 * u_p_z_v_x_next;
    const double t104 = t81 + t92 * t95;
    const double u_p_y_v_x_next = t95 - t97 * t82;
    const double t105 = t82 + t101 * u_p_y_v_x_next;
    const double t106 = t83 + t92 * t94;
    const double u_p_x_v_x_next = t94 - t97 * t84;
    const double t107 = t84 + t101 * u_p_x_v_x_next;
    const double t108 = u_clock_v_x - t88 * t86;
    const double t109 = t86 + t92 * t108;
    const double u_clock_v_x_next = t108 - t97 * t87;
    const double t110 = t87 + t101 * u_clock_v_x_next;
    const double u_clock_v_y = kf->U[10];
    const double u_p_x_v_y = kf->U[11];
    const double u_p_y_v_y = kf->U[12];
    const double u_p_z_v_y = kf->U[13];
    const double t111 = u_clock_v_y * t22 + u_p_x_v_y * t23 + u_p_y_v_y * t24 + u_p_z_v_y * t25;
    const double d_v_y = kf->D[5];
    const double t112 = d_v_y * t111;
    const double t113 = t90 + t111 * t112;
    const double t114 = 1.0 / t113;
    const double t115 = t112 * t114;
    const double t116 = d_v_y * (t90 * t114);
    const double t117 = u_p_x_v_y - t111 * t106;
    const double t118 = u_p_y_v_y - t111 * t104;
    const double t119 = u_p_z_v_y - t111 * t102;
    const double u_v_x_v_y = kf->U[14];
    const double t120 = u_v_x_v_y - t111 * t92;
    const double t121 = t117 * t26 + t118 * t27 + t119 * t28 + t120 * t29 + t30;
    const double t122 = t116 * t121;
    const double t123 = t99 + t121 * t122;
    const double t124 = 1.0 / t123;
    const double t125 = t122 * t124;
    const double d_v_y_next = t116 * (t99 * t124);
    const double t126 = t92 + t115 * t120;
    const double u_v_x_v_y_next = t120 - t121 * t101;
    const double t127 = t101 + t125 * u_v_x_v_y_next;
    const double t128 = t102 + t115 * t119;
    const double u_p_z_v_y_next = t119 - t121 * t103;
    const double t129 = t103 + t125 * u_p_z_v_y_next;
    const double t130 = t104 + t115 * t118;
    const double u_p_y_v_y_next = t118 - t121 * t105;
    const double t131 = t105 + t125 * u_p_y_v_y_next;
    const double t132 = t106 + t115 * t117;
    const double u_p_x_v_y_next = t117 - t121 * t107;
    const double t133 = t107 + t125 * u_p_x_v_y_next;
    const double t134 = u_clock_v_y - t111 * t109;
    const double t135 = t109 + t115 * t134;
    const double u_clock_v_y_next = t134 - t121 * t110;
    const double t136 = t110 + t125 * u_clock_v_y_next;
    const double u_clock_v_z = kf->U[15];
    const double u_p_x_v_z = kf->U[16];
    const double u_p_y_v_z = kf->U[17];
    const double u_p_z_v_z = kf->U[18];
    const double t137 = u_clock_v_z * t22 + u_p_x_v_z * t23 + u_p_y_v_z * t24 + u_p_z_v_z * t25;
    const double d_v_z = kf->D[6];
    const double t138 = d_v_z * t137;
    const double t139 = t113 + t137 * t138;
    const double t140 = 1.0 / t139;
    const double t141 = t138 * t140;
    const double t142 = d_v_z * (t113 * t140);
    const double t143 = u_p_x_v_z - t137 * t132;
    const double t144 = u_p_y_v_z - t137 * t130;
    const double t145 = u_p_z_v_z - t137 * t128;
    const double u_v_x_v_z = kf->U[19];
    const double t146 = u_v_x_v_z - t137 * t126;
    const double u_v_y_v_z = kf->U[20];
    const double t147 = u_v_y_v_z - t137 * t115;
    const double t148 = t143 * t26 + t144 * t27 + t145 * t28 + t146 * t29 + t147 * t30 + t31;
    const double t149 = t142 * t148;
    const double t150 = t123 + t148 * t149;
    const double t151 = 1.0 / t150;
    const double t152 = t149 * t151;
    const double d_v_z_next = t142 * (t123 * t151);
    const double t153 = t115 + t141 * t147;
    const double u_v_y_v_z_next = t147 - t148 * t125;
    const double t154 = t125 + t152 * u_v_y_v_z_next;
    const double t155 = t126 + t141 * t146;
    const double u_v_x_v_z_next = t146 - t148 * t127;
    const double t156 = t127 + t152 * u_v_x_v_z_next;
    const double t157 = t128 + t141 * t145;
    const double u_p_z_v_z_next = t145 - t148 * t129;
    const double t158 = t129 + t152 * u_p_z_v_z_next;
    const double t159 = t130 + t141 * t144;
    const double u_p_y_v_z_next = t144 - t148 * t131;
    const double t160 = t131 + t152 * u_p_y_v_z_next;
    const double t161 = t132 + t141 * t143;
    const double u_p_x_v_z_next = t143 - t148 * t133;
    const double t162 = t133 + t152 * u_p_x_v_z_next;
    const double t163 = u_clock_v_z - t137 * t135;
    const double t164 = t135 + t141 * t163;
    const double u_clock_v_z_next = t163 - t148 * t136;
    const double t165 = t136 + t152 * u_clock_v_z_next;
    const double u_clock_drift = kf->U[21];
    const double u_p_x_drift = kf->U[22];
    const double u_p_y_drift = kf->U[23];
    const double u_p_z_drift = kf->U[24];
    const double t166 = u_clock_drift * t22 + u_p_x_drift * t23 + u_p_y_drift * t24
        + u_p_z_drift * t25;
    const double d_drift = kf->D[7];
    const double t167 = d_drift * t166;
    const double s_rho = t139 + t166 * t167;
    const double t168 = 1.0 / s_rho;
    const double t169 = t167 * t168;
    const double t170 = d_drift * (t139 * t168);
    const double t171 = u_p_x_drift - t166 * t161;
    const double t172 = u_p_y_drift - t166 * t159;
    const double t173 = u_p_z_drift - t166 * t157;
    const double u_v_x_drift = kf->U[25];
    const double t174 = u_v_x_drift - t166 * t155;
    const double u_v_y_drift = kf->U[26];
    const double t175 = u_v_y_drift - t166 * t153;
    const double u_v_z_drift = kf->U[27];
    const double t176 = u_v_z_drift - t166 * t141;
    const double t177 = t171 * t26 + t172 * t27 + t173 * t28 + t174 * t29 + t175 * t30 + t176 * t31
        + t32;
    const double t178 = t170 * t177;
    const double s_rate = t150 + t177 * t178;
    const double t179 = 1.0 / s_rate;
    const double t180 = t178 * t179;
    const double d_drift_next = t170 * (t150 * t179);
    const double u_v_z_drift_next = t176 - t177 * t152;
    const double u_v_y_drift_next = t175 - t177 * t154;
    const double u_v_x_drift_next = t174 - t177 * t156;
    const double u_p_z_drift_next = t173 - t177 * t158;
    const double u_p_y_drift_next = t172 - t177 * t160;
    const double u_p_x_drift_next = t171 - t177 * t162;
    const double t181 = u_clock_drift - t166 * t164;
    const double u_clock_drift_next = t181 - t177 * t165;
    const double t182 = (t161 + t169 * t171) * y;
    const double t183 = (t159 + t169 * t172) * y;
    const double t184 = (t157 + t169 * t173) * y;
    const double t185 = (t155 + t169 * t174) * y;
    const double t186 = (t153 + t169 * t175) * y;
    const double t187 = (t141 + t169 * t176) * y;
    const double t188 = t169 * y;
    const double nu_rate = y_1 - t26 * t182 - t27 * t183 - t28 * t184 - t29 * t185 - t30 * t186
        - t31 * t187 - t32 * t188;
    const double nis = y * (y * t168) + nu_rate * (nu_rate * t179);

    /* state and innovation squared */
    const double clock_next = clock + (t164 + t169 * t181) * y
        + (t165 + t180 * u_clock_drift_next) * nu_rate;
    const double p_x_next = p_x + t182 + (t162 + t180 * u_p_x_drift_next) * nu_rate;
    const double p_y_next = p_y + t183 + (t160 + t180 * u_p_y_drift_next) * nu_rate;
    const double p_z_next = p_z + t184 + (t158 + t180 * u_p_z_drift_next) * nu_rate;
    const double v_x_next = v_x + t185 + (t156 + t180 * u_v_x_drift_next) * nu_rate;
    const double v_y_next = v_y + t186 + (t154 + t180 * u_v_y_drift_next) * nu_rate;
    const double v_z_next = v_z + t187 + (t152 + t180 * u_v_z_drift_next) * nu_rate;
    const double drift_next = drift + t188 + t180 * nu_rate;

    /* guards */
    if (!gnss_finite(y + y_1 + s_rho + s_rate)) { return GNSS_NOT_FINITE; }
    if (!(s_rho > 0.0) || !(s_rate > 0.0)) { return GNSS_NOT_POSITIVE; }

    /* gate */
    const double threshold = (t0 ? 1 : 0) + (t1 ? 1 : 0) <= 1 ? 15.136705226623397
        : 18.420680743952367;
    if (threshold < nis) {
        kf->nis = nis;
        return GNSS_GATED;
    }
    if (!gnss_finite(nis + p_x_next + p_y_next + p_z_next + v_x_next + v_y_next + v_z_next
        + clock_next + drift_next)) {
        return GNSS_NOT_FINITE;
    }

    /* store */
    kf->x[GNSS_P_X] = p_x_next;
    kf->x[GNSS_P_Y] = p_y_next;
    kf->x[GNSS_P_Z] = p_z_next;
    kf->x[GNSS_V_X] = v_x_next;
    kf->x[GNSS_V_Y] = v_y_next;
    kf->x[GNSS_V_Z] = v_z_next;
    kf->x[GNSS_CLOCK] = clock_next;
    kf->x[GNSS_DRIFT] = drift_next;
    kf->U[0] = u_clock_p_x_next;
    kf->U[1] = u_clock_p_y_next;
    kf->U[2] = u_p_x_p_y_next;
    kf->U[3] = u_clock_p_z_next;
    kf->U[4] = u_p_x_p_z_next;
    kf->U[5] = u_p_y_p_z_next;
    kf->U[6] = u_clock_v_x_next;
    kf->U[7] = u_p_x_v_x_next;
    kf->U[8] = u_p_y_v_x_next;
    kf->U[9] = u_p_z_v_x_next;
    kf->U[10] = u_clock_v_y_next;
    kf->U[11] = u_p_x_v_y_next;
    kf->U[12] = u_p_y_v_y_next;
    kf->U[13] = u_p_z_v_y_next;
    kf->U[14] = u_v_x_v_y_next;
    kf->U[15] = u_clock_v_z_next;
    kf->U[16] = u_p_x_v_z_next;
    kf->U[17] = u_p_y_v_z_next;
    kf->U[18] = u_p_z_v_z_next;
    kf->U[19] = u_v_x_v_z_next;
    kf->U[20] = u_v_y_v_z_next;
    kf->U[21] = u_clock_drift_next;
    kf->U[22] = u_p_x_drift_next;
    kf->U[23] = u_p_y_drift_next;
    kf->U[24] = u_p_z_drift_next;
    kf->U[25] = u_v_x_drift_next;
    kf->U[26] = u_v_y_drift_next;
    kf->U[27] = u_v_z_drift_next;
    kf->D[0] = d_clock_next;
    kf->D[1] = d_p_x_next;
    kf->D[2] = d_p_y_next;
    kf->D[3] = d_p_z_next;
    kf->D[4] = d_v_x_next;
    kf->D[5] = d_v_y_next;
    kf->D[6] = d_v_z_next;
    kf->D[7] = d_drift_next;
    kf->nis = nis;
    return GNSS_OK;
}

gnss_status_t gnss_set_state(gnss_t *kf, const gnss_real_t x[8])
{
    if (kf == NULL || x == NULL) { return GNSS_NULL_ARGUMENT; }
    if (!gnss_finite(x[GNSS_P_X])) { return GNSS_NOT_FINITE; }
    if (!gnss_finite(x[GNSS_P_Y])) { return GNSS_NOT_FINITE; }
    if (!gnss_finite(x[GNSS_P_Z])) { return GNSS_NOT_FINITE; }
    if (!gnss_finite(x[GNSS_V_X])) { return GNSS_NOT_FINITE; }
    if (!gnss_finite(x[GNSS_V_Y])) { return GNSS_NOT_FINITE; }
    if (!gnss_finite(x[GNSS_V_Z])) { return GNSS_NOT_FINITE; }
    if (!gnss_finite(x[GNSS_CLOCK])) { return GNSS_NOT_FINITE; }
    if (!gnss_finite(x[GNSS_DRIFT])) { return GNSS_NOT_FINITE; }
    kf->x[GNSS_P_X] = x[GNSS_P_X];
    kf->x[GNSS_P_Y] = x[GNSS_P_Y];
    kf->x[GNSS_P_Z] = x[GNSS_P_Z];
    kf->x[GNSS_V_X] = x[GNSS_V_X];
    kf->x[GNSS_V_Y] = x[GNSS_V_Y];
    kf->x[GNSS_V_Z] = x[GNSS_V_Z];
    kf->x[GNSS_CLOCK] = x[GNSS_CLOCK];
    kf->x[GNSS_DRIFT] = x[GNSS_DRIFT];
    return GNSS_OK;
}

gnss_status_t gnss_set_covariance(gnss_t *kf, const gnss_real_t P[64])
{
    if (kf == NULL || P == NULL) { return GNSS_NULL_ARGUMENT; }
    double p[36];
    double w[36];

    /* the upper triangle, column by column */
    for (int j = 0; j < 8; j++) {
        for (int i = 0; i < j + 1; i++) {
            const bool t0 = GNSS_order(j) < GNSS_order(i);
            const double value = P[8 * (t0 ? GNSS_order(j) : GNSS_order(i))
                + (t0 ? GNSS_order(i) : GNSS_order(j))];
            p[j * (j + 1) / 2 + i] = value;
            w[j * (j + 1) / 2 + i] = value;
            if (!gnss_finite(value)) { return GNSS_NOT_FINITE; }
        }
    }

    /* factor it: a pivot is zero up to round-off, or positive */
    for (int j = 8 - 1; j >= 0; j--) {
        const double round_off = 1.7763568394002505e-15 * p[j * (j + 1) / 2 + j];
        const double pivot = w[j * (j + 1) / 2 + j];
        if (!(-round_off <= pivot)) { return GNSS_NOT_POSITIVE; }
        const double d = round_off < pivot ? pivot : 0.0;
        w[j * (j + 1) / 2 + j] = d;
        for (int i = j - 1; i >= 0; i--) {
            const double rest = w[j * (j + 1) / 2 + i];
            if (d <= 0.0 && 7.105427357601002e-15 * p[j * (j + 1) / 2 + j]
                * p[i * (i + 1) / 2 + i] < rest * rest) {
                return GNSS_NOT_POSITIVE;
            }
            const double u = d > 0.0 ? rest / d : 0.0;
            for (int k = 0; k < i + 1; k++) {
                w[i * (i + 1) / 2 + k] = w[i * (i + 1) / 2 + k] - u * w[j * (j + 1) / 2 + k];
            }
            w[j * (j + 1) / 2 + i] = u;
        }
    }

    /* store */
    for (int j = 0; j < 8; j++) {
        for (int i = 0; i < j; i++) {
            kf->U[j * (j - 1) / 2 + i] = w[j * (j + 1) / 2 + i];
        }
        kf->D[j] = w[j * (j + 1) / 2 + j];
    }
    return GNSS_OK;
}

void gnss_get_covariance(const gnss_t *kf, gnss_real_t P[64])
{
    if (kf == NULL || P == NULL) { return; }
    for (int j = 0; j < 8; j++) {
        for (int i = 0; i < j + 1; i++) {
            double sum = kf->D[j];
            if (i < j) {
                sum = sum * kf->U[j * (j - 1) / 2 + i];
            }
            for (int k = j + 1; k < 8; k++) {
                sum = sum + kf->U[k * (k - 1) / 2 + i] * kf->D[k] * kf->U[k * (k - 1) / 2 + j];
            }
            const double value = sum;
            P[8 * GNSS_order(i) + GNSS_order(j)] = value;
            P[8 * GNSS_order(j) + GNSS_order(i)] = value;
        }
    }
}

gnss_status_t gnss_get_outputs(const gnss_t *kf, gnss_outputs_t *value, gnss_outputs_t *std)
{
    if (kf == NULL || value == NULL) { return GNSS_NULL_ARGUMENT; }
    const double p_x = kf->x[GNSS_P_X];
    const double p_y = kf->x[GNSS_P_Y];
    const double p_z = kf->x[GNSS_P_Z];
    const double v_x = kf->x[GNSS_V_X];
    const double v_y = kf->x[GNSS_V_Y];
    const double v_z = kf->x[GNSS_V_Z];

    /* outputs */
    const double speed = sqrt(v_x * v_x + v_y * v_y + v_z * v_z);
    const double t0 = sqrt(p_x * p_x + p_y * p_y + p_z * p_z);
    const double height = t0 - 6371000.0;
    if (!gnss_finite(speed + height)) { return GNSS_NOT_FINITE; }
    if (std != NULL) {
        /* their standard deviations: sqrt(J P J^T) */
        const double t1 = speed > 0.0 ? 1.0 / speed : 0.0;
        const double t2 = v_x * t1;
        const double t3 = v_y * t1;
        const double t4 = v_z * t1;
        const double t5 = t0 > 0.0 ? 1.0 / t0 : 0.0;
        const double t6 = p_x * t5;
        const double t7 = p_y * t5;
        const double t8 = p_z * t5;
        const double t9 = kf->U[14] * t2 + t3;
        const double t10 = kf->U[19] * t2 + kf->U[20] * t3 + t4;
        const double t11 = kf->U[25] * t2 + kf->U[26] * t3 + kf->U[27] * t4;
        const double var_speed = t2 * (kf->D[4] * t2) + t9 * (kf->D[5] * t9)
            + t10 * (kf->D[6] * t10) + t11 * (kf->D[7] * t11);
        const double t12 = kf->U[2] * t6 + t7;
        const double t13 = kf->U[4] * t6 + kf->U[5] * t7 + t8;
        const double t14 = kf->U[7] * t6 + kf->U[8] * t7 + kf->U[9] * t8;
        const double t15 = kf->U[11] * t6 + kf->U[12] * t7 + kf->U[13] * t8;
        const double t16 = kf->U[16] * t6 + kf->U[17] * t7 + kf->U[18] * t8;
        const double t17 = kf->U[22] * t6 + kf->U[23] * t7 + kf->U[24] * t8;
        const double var_height = t6 * (kf->D[1] * t6) + t12 * (kf->D[2] * t12)
            + t13 * (kf->D[3] * t13) + t14 * (kf->D[4] * t14) + t15 * (kf->D[5] * t15)
            + t16 * (kf->D[6] * t16) + t17 * (kf->D[7] * t17);
        if (!gnss_finite(var_speed + var_height)) { return GNSS_NOT_FINITE; }
        std->speed = sqrt(var_speed > 0.0 ? var_speed : 0.0);
        std->height = sqrt(var_height > 0.0 ? var_height : 0.0);
    }
    value->speed = speed;
    value->height = height;
    return GNSS_OK;
}
/* kfgen: body 38f435e9d328f3d846e8ca8e129c2fc3 */
