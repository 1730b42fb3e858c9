/* kfgen build ahrs.yaml */
#include "ahrs.h"

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "ahrs tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "ahrs tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool ahrs_finite(float a)
{
    const uint32_t exponent = 0x7f800000u;
    union { float value; uint32_t bits; } view;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

ahrs_status_t ahrs_init(ahrs_t *kf)
{
    if (kf == NULL) { return AHRS_NULL_ARGUMENT; }
    kf->x[AHRS_Q0] = 1.0f;
    for (int i = 1; i < 7; i++) {
        kf->x[i] = 0.0f;
    }
    for (int i = 0; i < 21; i++) {
        kf->U[i] = 0.0f;
    }
    kf->D[0] = 0.01f;
    kf->D[1] = 0.09f;
    kf->D[2] = 0.09f;
    kf->D[3] = 0.09f;
    kf->D[4] = 0.0004f;
    kf->D[5] = 0.0004f;
    kf->D[6] = 0.0004f;
    kf->nis = 0.0f;
    kf->gate_count_accel = 0;
    kf->gate_count_mag = 0;
    kf->parameters.gyro_noise = 0.003f;
    kf->parameters.field_north = 15.4f;
    kf->parameters.field_up = -40.8f;
    return AHRS_OK;
}

ahrs_status_t ahrs_predict(ahrs_t *kf, const ahrs_inputs_t *u, ahrs_real_t dt)
{
    if (kf == NULL || u == NULL) { return AHRS_NULL_ARGUMENT; }
    ahrs_status_t flags = AHRS_OK;

    /* arguments */
    if (!ahrs_finite(u->gx)) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(u->gy)) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(u->gz)) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(dt)) { return AHRS_NOT_FINITE; }
    const bool t0 = dt < 0.001f;
    if (t0) { flags |= AHRS_DT_CLAMPED; }
    const bool t1 = dt > 0.1f;
    if (t1) { flags |= AHRS_DT_CLAMPED; }
    const float step = t1 ? 0.1f : (t0 ? 0.001f : dt);
    const float q0 = kf->x[AHRS_Q0];
    const float q1 = kf->x[AHRS_Q1];
    const float q2 = kf->x[AHRS_Q2];
    const float q3 = kf->x[AHRS_Q3];
    const float bx = kf->x[AHRS_BX];
    const float by = kf->x[AHRS_BY];
    const float bz = kf->x[AHRS_BZ];

    /* model */
    const float t2 = step * (kf->parameters.gyro_noise * kf->parameters.gyro_noise) * 0.25f;
    const float t3 = 1.0e-9f * step;
    const float t4 = step * (u->gx - bx);
    const float ax = 0.5f * t4;
    const float t5 = 0.5f * step;
    const float t6 = step * (u->gy - by);
    const float ay = 0.5f * t6;
    const float t7 = step * (u->gz - bz);
    const float az = 0.5f * t7;
    const float aa = ax * ax + ay * ay + az * az;
    const float t8 = t4 * t5;
    const float t9 = t6 * t5;
    const float t10 = t7 * t5;
    const float c = 1.0f - 0.5f * aa;
    const float t11 = 0.5f * t8;
    const float t12 = 0.5f * t9;
    const float t13 = 0.5f * t10;
    const float s = 1.0f - 0.16666667f * aa;
    const float t14 = 0.16666667f * t8;
    const float t15 = 0.16666667f * t9;
    const float t16 = 0.16666667f * t10;
    const float t17 = ax * q1 + ay * q2 + az * q3;
    const float p0 = c * q0 - s * t17;
    const float t18 = q1 * s * t5;
    const float t19 = q2 * s * t5;
    const float t20 = q3 * s * t5;
    const float t21 = ax * s;
    const float t22 = ay * s;
    const float t23 = az * s;
    const float t24 = t18 + q0 * t11 - t17 * t14;
    const float t25 = t19 + q0 * t12 - t17 * t15;
    const float t26 = t20 + q0 * t13 - t17 * t16;
    const float t27 = ax * q0 + az * q2 - ay * q3;
    const float p1 = c * q1 + s * t27;
    const float t28 = q0 * s * t5;
    const float t29 = q1 * t11 - t28 + t27 * t14;
    const float t30 = t20 + q1 * t12 + t27 * t15;
    const float t31 = q1 * t13 - t19 + t27 * t16;
    const float t32 = ax * q3 + ay * q0 - az * q1;
    const float p2 = c * q2 + s * t32;
    const float t33 = q2 * t11 - t20 + t32 * t14;
    const float t34 = q2 * t12 - t28 + t32 * t15;
    const float t35 = t18 + q2 * t13 + t32 * t16;
    const float t36 = ay * q1 + az * q0 - ax * q2;
    const float p3 = c * q3 + s * t36;
    const float t37 = t19 + q3 * t11 + t36 * t14;
    const float t38 = q3 * t12 - t18 + t36 * t15;
    const float t39 = q3 * t13 - t28 + t36 * t16;
    const float n = 1.5f - 0.5f * (p0 * p0) - 0.5f * (p1 * p1) - 0.5f * (p2 * p2)
        - 0.5f * (p3 * p3);
    const float t40 = p0 * t24 + p1 * t29 + p2 * t33 + p3 * t37;
    const float t41 = p0 * t25 + p1 * t30 + p2 * t34 + p3 * t38;
    const float t42 = p0 * t26 + p1 * t31 + p2 * t35 + p3 * t39;
    const float t43 = p0 * c + p1 * t21 + p2 * t22 + p3 * t23;
    const float t44 = p0 * t21 - p1 * c + p2 * t23 - p3 * t22;
    const float t45 = p0 * t22 - p1 * t23 - p2 * c + p3 * t21;
    const float t46 = p0 * t23 + p1 * t22 - p2 * t21 - p3 * c;
    const float q0_next = n * p0;
    const float f_q0_bx = n * t24 - p0 * t40;
    const float f_q0_by = n * t25 - p0 * t41;
    const float f_q0_bz = n * t26 - p0 * t42;
    const float t47 = n * c;
    const float f_q0_q0 = t47 - p0 * t43;
    const float t48 = n * t21;
    const float f_q0_q1 = p0 * t44 - t48;
    const float t49 = n * t22;
    const float f_q0_q2 = p0 * t45 - t49;
    const float t50 = n * t23;
    const float f_q0_q3 = p0 * t46 - t50;
    const float q1_next = n * p1;
    const float f_q1_bx = n * t29 - p1 * t40;
    const float f_q1_by = n * t30 - p1 * t41;
    const float f_q1_bz = n * t31 - p1 * t42;
    const float f_q1_q0 = t48 - p1 * t43;
    const float f_q1_q1 = p1 * t44 + t47;
    const float f_q1_q2 = p1 * t45 + t50;
    const float f_q1_q3 = p1 * t46 - t49;
    const float q2_next = n * p2;
    const float f_q2_bx = n * t33 - p2 * t40;
    const float f_q2_by = n * t34 - p2 * t41;
    const float f_q2_bz = n * t35 - p2 * t42;
    const float f_q2_q0 = t49 - p2 * t43;
    const float f_q2_q1 = p2 * t44 - t50;
    const float f_q2_q2 = p2 * t45 + t47;
    const float f_q2_q3 = p2 * t46 + t48;
    const float q3_next = n * p3;
    const float f_q3_bx = n * t37 - p3 * t40;
    const float f_q3_by = n * t38 - p3 * t41;
    const float f_q3_bz = n * t39 - p3 * t42;
    const float f_q3_q0 = t50 - p3 * t43;
    const float f_q3_q1 = p3 * t44 + t49;
    const float f_q3_q2 = p3 * t45 - t48;
    const float f_q3_q3 = p3 * t46 + t47;

    /* F U D U^T F^T + Q, columns 0 to 4 */
    const float u_q0_q1 = kf->U[0];
    const float t51 = f_q0_q0 * u_q0_q1 + f_q0_q1;
    const float t52 = f_q1_q0 * u_q0_q1 + f_q1_q1;
    const float t53 = f_q2_q0 * u_q0_q1 + f_q2_q1;
    const float t54 = f_q3_q0 * u_q0_q1 + f_q3_q1;
    const float u_q0_q2 = kf->U[1];
    const float u_q1_q2 = kf->U[2];
    const float t55 = f_q0_q0 * u_q0_q2 + f_q0_q1 * u_q1_q2 + f_q0_q2;
    const float t56 = f_q1_q0 * u_q0_q2 + f_q1_q1 * u_q1_q2 + f_q1_q2;
    const float t57 = f_q2_q0 * u_q0_q2 + f_q2_q1 * u_q1_q2 + f_q2_q2;
    const float t58 = f_q3_q0 * u_q0_q2 + f_q3_q1 * u_q1_q2 + f_q3_q2;
    const float u_q0_q3 = kf->U[3];
    const float u_q1_q3 = kf->U[4];
    const float u_q2_q3 = kf->U[5];
    const float t59 = f_q0_q0 * u_q0_q3 + f_q0_q1 * u_q1_q3 + f_q0_q2 * u_q2_q3 + f_q0_q3;
    const float t60 = f_q1_q0 * u_q0_q3 + f_q1_q1 * u_q1_q3 + f_q1_q2 * u_q2_q3 + f_q1_q3;
    const float t61 = f_q2_q0 * u_q0_q3 + f_q2_q1 * u_q1_q3 + f_q2_q2 * u_q2_q3 + f_q2_q3;
    const float t62 = f_q3_q0 * u_q0_q3 + f_q3_q1 * u_q1_q3 + f_q3_q2 * u_q2_q3 + f_q3_q3;
    const float u_q0_bx = kf->U[6];
    const float u_q1_bx = kf->U[7];
    const float u_q2_bx = kf->U[8];
    const float u_q3_bx = kf->U[9];
    const float t63 = f_q0_q0 * u_q0_bx + f_q0_q1 * u_q1_bx + f_q0_q2 * u_q2_bx + f_q0_q3 * u_q3_bx
        + f_q0_bx;
    const float t64 = f_q1_q0 * u_q0_bx + f_q1_q1 * u_q1_bx + f_q1_q2 * u_q2_bx + f_q1_q3 * u_q3_bx
        + f_q1_bx;
    const float t65 = f_q2_q0 * u_q0_bx + f_q2_q1 * u_q1_bx + f_q2_q2 * u_q2_bx + f_q2_q3 * u_q3_bx
        + f_q2_bx;
    const float t66 = f_q3_q0 * u_q0_bx + f_q3_q1 * u_q1_bx + f_q3_q2 * u_q2_bx + f_q3_q3 * u_q3_bx
        + f_q3_bx;
    const float d_bx = kf->D[4];
    const float t67 = t3 + d_bx;
    const float t68 = 1.0f / t67;
    const float t69 = d_bx * t68;
    const float t70 = d_bx * (t3 * t68);
    const float t71 = t69 * t63;
    const float t72 = t69 * t64;
    const float t73 = t69 * t65;
    const float t74 = t69 * t66;
    const float d_q3 = kf->D[3];
    const float t75 = d_q3 * t62;
    const float t76 = t2 + t62 * t75;
    const bool t77 = t76 > 0.0f;
    const float t78 = t77 ? t75 / t76 : 0.0f;
    const float t79 = d_q3 * (t77 ? t2 / t76 : 1.0f);
    const float d_q0 = kf->D[0];
    const float t80 = d_q0 * f_q3_q0;
    const float t81 = t76 + f_q3_q0 * t80;
    const bool t82 = t81 > 0.0f;
    const float t83 = t82 ? t80 / t81 : 0.0f;
    const float t84 = t82 ? t76 / t81 : 1.0f;
    const float t85 = d_q0 * t84;
    const float d_q1 = kf->D[1];
    const float t86 = d_q1 * t54;
    const float t87 = t81 + t54 * t86;
    const bool t88 = t87 > 0.0f;
    const float t89 = t88 ? t86 / t87 : 0.0f;
    const float t90 = t88 ? t81 / t87 : 1.0f;
    const float t91 = d_q1 * t90;
    const float d_q2 = kf->D[2];
    const float t92 = d_q2 * t58;
    const float t93 = t87 + t58 * t92;
    const bool t94 = t93 > 0.0f;
    const float t95 = t94 ? t92 / t93 : 0.0f;
    const float t96 = t94 ? t87 / t93 : 1.0f;
    const float t97 = d_q2 * t96;
    const float t98 = t70 * t66;
    const float t99 = t93 + t66 * t98;
    const bool t100 = t99 > 0.0f;
    const float t101 = t100 ? t98 / t99 : 0.0f;
    const float t102 = t100 ? t93 / t99 : 1.0f;
    const float t103 = t70 * t102;
    const float t104 = t78 * t59;
    const float t105 = t84 * t104 + t83 * f_q0_q0;
    const float t106 = f_q0_q0 - f_q3_q0 * t104;
    const float t107 = t90 * t105 + t89 * t51;
    const float t108 = t51 - t54 * t105;
    const float t109 = t96 * t107 + t95 * t55;
    const float t110 = t55 - t58 * t107;
    const float t111 = t102 * t109 + t101 * t63;
    const float t112 = t63 - t66 * t109;
    const float t113 = t78 * t60;
    const float t114 = t84 * t113 + t83 * f_q1_q0;
    const float t115 = f_q1_q0 - f_q3_q0 * t113;
    const float t116 = t90 * t114 + t89 * t52;
    const float t117 = t52 - t54 * t114;
    const float t118 = t96 * t116 + t95 * t56;
    const float t119 = t56 - t58 * t116;
    const float t120 = t102 * t118 + t101 * t64;
    const float t121 = t64 - t66 * t118;
    const float t122 = t78 * t61;
    const float t123 = t84 * t122 + t83 * f_q2_q0;
    const float t124 = f_q2_q0 - f_q3_q0 * t122;
    const float t125 = t90 * t123 + t89 * t53;
    const float t126 = t53 - t54 * t123;
    const float t127 = t96 * t125 + t95 * t57;
    const float t128 = t57 - t58 * t125;
    const float t129 = t102 * t127 + t101 * t65;
    const float t130 = t65 - t66 * t127;
    const float t131 = t97 * t128;
    const float t132 = t2 + t128 * t131;
    const bool t133 = t132 > 0.0f;
    const float t134 = t133 ? t131 / t132 : 0.0f;
    const float t135 = t97 * (t133 ? t2 / t132 : 1.0f);
    const float t136 = t85 * t124;
    const float t137 = t132 + t124 * t136;
    const bool t138 = t137 > 0.0f;
    const float t139 = t138 ? t136 / t137 : 0.0f;
    const float t140 = t138 ? t132 / t137 : 1.0f;
    const float t141 = t85 * t140;
    const float t142 = t91 * t126;
    const float t143 = t137 + t126 * t142;
    const bool t144 = t143 > 0.0f;
    const float t145 = t144 ? t142 / t143 : 0.0f;
    const float t146 = t144 ? t137 / t143 : 1.0f;
    const float t147 = t91 * t146;
    const float t148 = t79 * t61;
    const float t149 = t143 + t61 * t148;
    const bool t150 = t149 > 0.0f;
    const float t151 = t150 ? t148 / t149 : 0.0f;
    const float t152 = t150 ? t143 / t149 : 1.0f;
    const float t153 = t79 * t152;
    const float t154 = t103 * t130;
    const float t155 = t149 + t130 * t154;
    const bool t156 = t155 > 0.0f;
    const float t157 = t156 ? t154 / t155 : 0.0f;
    const float t158 = t156 ? t149 / t155 : 1.0f;
    const float t159 = t103 * t158;
    const float t160 = t134 * t110;
    const float t161 = t140 * t160 + t139 * t106;
    const float t162 = t106 - t124 * t160;
    const float t163 = t146 * t161 + t145 * t108;
    const float t164 = t108 - t126 * t161;
    const float t165 = t152 * t163 + t151 * t59;
    const float t166 = t59 - t61 * t163;
    const float t167 = t158 * t165 + t157 * t112;
    const float t168 = t112 - t130 * t165;
    const float t169 = t134 * t119;
    const float t170 = t140 * t169 + t139 * t115;
    const float t171 = t115 - t124 * t169;
    const float t172 = t146 * t170 + t145 * t117;
    const float t173 = t117 - t126 * t170;
    const float t174 = t152 * t172 + t151 * t60;
    const float t175 = t60 - t61 * t172;
    const float t176 = t158 * t174 + t157 * t121;
    const float t177 = t121 - t130 * t174;
    const float t178 = t147 * t173;
    const float t179 = t2 + t173 * t178;
    const bool t180 = t179 > 0.0f;
    const float t181 = t141 * t171;
    const float t182 = t179 + t171 * t181;
    const bool t183 = t182 > 0.0f;
    const float t184 = t183 ? t179 / t182 : 1.0f;
    const float t185 = t135 * t119;
    const float t186 = t182 + t119 * t185;
    const bool t187 = t186 > 0.0f;
    const float t188 = t187 ? t182 / t186 : 1.0f;
    const float t189 = t153 * t175;
    const float t190 = t186 + t175 * t189;
    const bool t191 = t190 > 0.0f;
    const float t192 = t191 ? t186 / t190 : 1.0f;
    const float t193 = t159 * t177;
    const float t194 = t190 + t177 * t193;
    const bool t195 = t194 > 0.0f;
    const float t196 = t195 ? t190 / t194 : 1.0f;
    const float t197 = (t180 ? t178 / t179 : 0.0f) * t164;
    const float t198 = t184 * t197 + (t183 ? t181 / t182 : 0.0f) * t162;
    const float t199 = t162 - t171 * t197;
    const float t200 = t188 * t198 + (t187 ? t185 / t186 : 0.0f) * t110;
    const float t201 = t110 - t119 * t198;
    const float t202 = t192 * t200 + (t191 ? t189 / t190 : 0.0f) * t166;
    const float t203 = t166 - t175 * t200;
    const float t204 = t196 * t202 + (t195 ? t193 / t194 : 0.0f) * t168;
    const float t205 = t168 - t177 * t202;

    /* F U D U^T F^T + Q, columns 5 to 6 */
    const float u_q0_by = kf->U[10];
    const float u_q1_by = kf->U[11];
    const float u_q2_by = kf->U[12];
    const float u_q3_by = kf->U[13];
    const float u_bx_by = kf->U[14];
    const float t206 = f_q0_q0 * u_q0_by + f_q0_q1 * u_q1_by + f_q0_q2 * u_q2_by + f_q0_q3 * u_q3_by
        + f_q0_bx * u_bx_by + f_q0_by;
    const float t207 = f_q1_q0 * u_q0_by + f_q1_q1 * u_q1_by + f_q1_q2 * u_q2_by + f_q1_q3 * u_q3_by
        + f_q1_bx * u_bx_by + f_q1_by;
    const float t208 = f_q2_q0 * u_q0_by + f_q2_q1 * u_q1_by + f_q2_q2 * u_q2_by + f_q2_q3 * u_q3_by
        + f_q2_bx * u_bx_by + f_q2_by;
    const float t209 = f_q3_q0 * u_q0_by + f_q3_q1 * u_q1_by + f_q3_q2 * u_q2_by + f_q3_q3 * u_q3_by
        + f_q3_bx * u_bx_by + f_q3_by;
    const float u_q0_bz = kf->U[15];
    const float u_q1_bz = kf->U[16];
    const float u_q2_bz = kf->U[17];
    const float u_q3_bz = kf->U[18];
    const float u_bx_bz = kf->U[19];
    const float u_by_bz = kf->U[20];
    const float t210 = f_q0_q0 * u_q0_bz + f_q0_q1 * u_q1_bz + f_q0_q2 * u_q2_bz + f_q0_q3 * u_q3_bz
        + f_q0_bx * u_bx_bz + f_q0_by * u_by_bz + f_q0_bz;
    const float t211 = f_q1_q0 * u_q0_bz + f_q1_q1 * u_q1_bz + f_q1_q2 * u_q2_bz + f_q1_q3 * u_q3_bz
        + f_q1_bx * u_bx_bz + f_q1_by * u_by_bz + f_q1_bz;
    const float t212 = f_q2_q0 * u_q0_bz + f_q2_q1 * u_q1_bz + f_q2_q2 * u_q2_bz + f_q2_q3 * u_q3_bz
        + f_q2_bx * u_bx_bz + f_q2_by * u_by_bz + f_q2_bz;
    const float t213 = f_q3_q0 * u_q0_bz + f_q3_q1 * u_q1_bz + f_q3_q2 * u_q2_bz + f_q3_q3 * u_q3_bz
        + f_q3_bx * u_bx_bz + f_q3_by * u_by_bz + f_q3_bz;
    const float d_bz = kf->D[6];
    const float d_bz_next = t3 + d_bz;
    const float t214 = 1.0f / d_bz_next;
    const float t215 = d_bz * t214;
    const float t216 = d_bz * (t3 * t214);
    const float u_q0_bz_next = t215 * t210;
    const float u_q1_bz_next = t215 * t211;
    const float u_q2_bz_next = t215 * t212;
    const float u_q3_bz_next = t215 * t213;
    const float u_bx_bz_next = t215 * u_bx_bz;
    const float u_by_bz_next = t215 * u_by_bz;
    const float d_by = kf->D[5];
    const float t217 = t3 + d_by;
    const float t218 = 1.0f / t217;
    const float t219 = d_by * t218;
    const float t220 = d_by * (t3 * t218);
    const float t221 = t216 * u_by_bz;
    const float d_by_next = t217 + u_by_bz * t221;
    const float t222 = 1.0f / d_by_next;
    const float t223 = t221 * t222;
    const float t224 = t216 * (t217 * t222);
    const float t225 = t219 * t206;
    const float t226 = t210 - u_by_bz * t225;
    const float u_q0_by_next = t225 + t223 * t226;
    const float t227 = t219 * t207;
    const float t228 = t211 - u_by_bz * t227;
    const float u_q1_by_next = t227 + t223 * t228;
    const float t229 = t219 * t208;
    const float t230 = t212 - u_by_bz * t229;
    const float u_q2_by_next = t229 + t223 * t230;
    const float t231 = t219 * t209;
    const float t232 = t213 - u_by_bz * t231;
    const float u_q3_by_next = t231 + t223 * t232;
    const float t233 = t219 * u_bx_by;
    const float t234 = u_bx_bz - u_by_bz * t233;
    const float u_bx_by_next = t233 + t223 * t234;
    const float t235 = t220 * u_bx_by;
    const float t236 = t67 + u_bx_by * t235;
    const float t237 = 1.0f / t236;
    const float t238 = t235 * t237;
    const float t239 = t220 * (t67 * t237);
    const float t240 = t224 * t234;
    const float d_bx_next = t236 + t234 * t240;
    const float t241 = 1.0f / d_bx_next;
    const float t242 = t240 * t241;
    const float t243 = t224 * (t236 * t241);
    const float t244 = t206 - u_bx_by * t71;
    const float t245 = t71 + t238 * t244;
    const float t246 = t226 - t234 * t245;
    const float u_q0_bx_next = t245 + t242 * t246;
    const float t247 = t207 - u_bx_by * t72;
    const float t248 = t72 + t238 * t247;
    const float t249 = t228 - t234 * t248;
    const float u_q1_bx_next = t248 + t242 * t249;
    const float t250 = t208 - u_bx_by * t73;
    const float t251 = t73 + t238 * t250;
    const float t252 = t230 - t234 * t251;
    const float u_q2_bx_next = t251 + t242 * t252;
    const float t253 = t209 - u_bx_by * t74;
    const float t254 = t74 + t238 * t253;
    const float t255 = t232 - t234 * t254;
    const float u_q3_bx_next = t254 + t242 * t255;
    const float t256 = t239 * t253;
    const float t257 = t99 + t253 * t256;
    const bool t258 = t257 > 0.0f;
    const float t259 = t258 ? t256 / t257 : 0.0f;
    const float t260 = t258 ? t99 / t257 : 1.0f;
    const float t261 = t239 * t260;
    const float t262 = t243 * t255;
    const float d_q3_next = t257 + t255 * t262;
    const bool t263 = d_q3_next > 0.0f;
    const float t264 = t263 ? t262 / d_q3_next : 0.0f;
    const float t265 = t263 ? t257 / d_q3_next : 1.0f;
    const float t266 = t243 * t265;
    const float t267 = t260 * t111 + t259 * t244;
    const float t268 = t244 - t253 * t111;
    const float u_q0_q3_next = t265 * t267 + t264 * t246;
    const float t269 = t246 - t255 * t267;
    const float t270 = t260 * t120 + t259 * t247;
    const float t271 = t247 - t253 * t120;
    const float u_q1_q3_next = t265 * t270 + t264 * t249;
    const float t272 = t249 - t255 * t270;
    const float t273 = t260 * t129 + t259 * t250;
    const float t274 = t250 - t253 * t129;
    const float u_q2_q3_next = t265 * t273 + t264 * t252;
    const float t275 = t252 - t255 * t273;
    const float t276 = t261 * t274;
    const float t277 = t155 + t274 * t276;
    const bool t278 = t277 > 0.0f;
    const float t279 = t278 ? t276 / t277 : 0.0f;
    const float t280 = t278 ? t155 / t277 : 1.0f;
    const float t281 = t261 * t280;
    const float t282 = t266 * t275;
    const float d_q2_next = t277 + t275 * t282;
    const bool t283 = d_q2_next > 0.0f;
    const float t284 = t283 ? t282 / d_q2_next : 0.0f;
    const float t285 = t283 ? t277 / d_q2_next : 1.0f;
    const float t286 = t266 * t285;
    const float t287 = t280 * t167 + t279 * t268;
    const float t288 = t268 - t274 * t167;
    const float u_q0_q2_next = t285 * t287 + t284 * t269;
    const float t289 = t269 - t275 * t287;
    const float t290 = t280 * t176 + t279 * t271;
    const float t291 = t271 - t274 * t176;
    const float u_q1_q2_next = t285 * t290 + t284 * t272;
    const float t292 = t272 - t275 * t290;
    const float t293 = t281 * t291;
    const float t294 = t194 + t291 * t293;
    const bool t295 = t294 > 0.0f;
    const float t296 = t295 ? t194 / t294 : 1.0f;
    const float t297 = t286 * t292;
    const float d_q1_next = t294 + t292 * t297;
    const bool t298 = d_q1_next > 0.0f;
    const float t299 = t298 ? t294 / d_q1_next : 1.0f;
    const float t300 = t296 * t204 + (t295 ? t293 / t294 : 0.0f) * t288;
    const float t301 = t288 - t291 * t204;
    const float u_q0_q1_next = t299 * t300 + (t298 ? t297 / d_q1_next : 0.0f) * t289;
    const float t302 = t289 - t292 * t300;
    const float d_q0_next = t2 + t199 * (t141 * t184 * t199)
        + t164 * (t147 * (t180 ? t2 / t179 : 1.0f) * t164) + t201 * (t135 * t188 * t201)
        + t203 * (t153 * t192 * t203) + t205 * (t159 * t196 * t205) + t301 * (t281 * t296 * t301)
        + t302 * (t286 * t299 * t302);

    /* guards */
    if (!ahrs_finite(q0_next + q1_next + q2_next + q3_next + d_q0_next + d_q1_next + d_q2_next
        + d_q3_next + d_bx_next + d_by_next + d_bz_next)) {
        return AHRS_NOT_FINITE;
    }

    /* store */
    kf->x[AHRS_Q0] = q0_next;
    kf->x[AHRS_Q1] = q1_next;
    kf->x[AHRS_Q2] = q2_next;
    kf->x[AHRS_Q3] = q3_next;
    kf->U[0] = u_q0_q1_next;
    kf->U[1] = u_q0_q2_next;
    kf->U[2] = u_q1_q2_next;
    kf->U[3] = u_q0_q3_next;
    kf->U[4] = u_q1_q3_next;
    kf->U[5] = u_q2_q3_next;
    kf->U[6] = u_q0_bx_next;
    kf->U[7] = u_q1_bx_next;
    kf->U[8] = u_q2_bx_next;
    kf->U[9] = u_q3_bx_next;
    kf->U[10] = u_q0_by_next;
    kf->U[11] = u_q1_by_next;
    kf->U[12] = u_q2_by_next;
    kf->U[13] = u_q3_by_next;
    kf->U[14] = u_bx_by_next;
    kf->U[15] = u_q0_bz_next;
    kf->U[16] = u_q1_bz_next;
    kf->U[17] = u_q2_bz_next;
    kf->U[18] = u_q3_bz_next;
    kf->U[19] = u_bx_bz_next;
    kf->U[20] = u_by_bz_next;
    kf->D[0] = d_q0_next;
    kf->D[1] = d_q1_next;
    kf->D[2] = d_q2_next;
    kf->D[3] = d_q3_next;
    kf->D[4] = d_bx_next;
    kf->D[5] = d_by_next;
    kf->D[6] = d_bz_next;
    return flags;
}

ahrs_status_t ahrs_update_accel(ahrs_t *kf, const ahrs_accel_t *z)
{
    if (kf == NULL || z == NULL) { return AHRS_NULL_ARGUMENT; }
    ahrs_status_t flags = AHRS_OK;

    /* innovation */
    const float q0 = kf->x[AHRS_Q0];
    const float q1 = kf->x[AHRS_Q1];
    const float q2 = kf->x[AHRS_Q2];
    const float q3 = kf->x[AHRS_Q3];
    const float ux = 2.0f * (q1 * q3) - 2.0f * (q0 * q2);
    const float h_x = 9.75f * ux;
    const float h_y_q3 = 19.5f * q2;
    const float h_x_q1 = 19.5f * q3;
    const float h_y_q1 = 19.5f * q0;
    const float h_x_q3 = 19.5f * q1;
    const float uy = 2.0f * (q0 * q1) + 2.0f * (q2 * q3);
    const float h_y = 9.75f * uy;
    const float uz = q0 * q0 + q3 * q3 - q1 * q1 - q2 * q2;
    const float h_z = 9.75f * uz;
    const float y_x = z->x - h_x;
    const float y_y = z->y - h_y;
    const float y_z = z->z - h_z;

    /* gain and covariance: x, y, z */
    const float d_q0 = kf->D[0];
    const float t0 = d_q0 * h_y_q3;
    const float t1 = 0.09f + h_y_q3 * t0;
    const float t2 = 1.0f / t1;
    const float t3 = t0 * t2;
    const float t4 = d_q0 * (0.09f * t2);
    const float t5 = t4 * h_x_q3;
    const float t6 = 0.09f + h_x_q3 * t5;
    const float t7 = 1.0f / t6;
    const float t8 = t5 * t7;
    const float t9 = t4 * (0.09f * t7);
    const float t10 = t9 * h_y_q1;
    const float t11 = 0.09f + h_y_q1 * t10;
    const float t12 = 1.0f / t11;
    const float t13 = t10 * t12;
    const float d_q0_next = t9 * (0.09f * t12);
    const float u_q0_q1 = kf->U[0];
    const float t14 = h_x_q1 - u_q0_q1 * h_y_q3;
    const float d_q1 = kf->D[1];
    const float t15 = d_q1 * t14;
    const float t16 = t1 + t14 * t15;
    const float t17 = 1.0f / t16;
    const float t18 = t15 * t17;
    const float t19 = d_q1 * (t1 * t17);
    const float t20 = u_q0_q1 + t14 * t3;
    const float t21 = t20 * h_x_q3 + h_y_q1;
    const float t22 = t19 * t21;
    const float t23 = t6 + t21 * t22;
    const float t24 = 1.0f / t23;
    const float t25 = t22 * t24;
    const float t26 = t19 * (t6 * t24);
    const float t27 = t20 - t21 * t8;
    const float t28 = t27 * h_y_q1 - h_x_q3;
    const float t29 = t26 * t28;
    const float t30 = t11 + t28 * t29;
    const float t31 = 1.0f / t30;
    const float t32 = t29 * t31;
    const float d_q1_next = t26 * (t11 * t31);
    const float t33 = t18 * t20 - t3;
    const float t34 = t8 + t25 * t27;
    const float u_q0_q1_next = t27 - t28 * t13;
    const float t35 = t13 + t32 * u_q0_q1_next;
    const float u_q1_q2 = kf->U[2];
    const float u_q0_q2 = kf->U[1];
    const float t36 = u_q1_q2 * h_x_q1 - u_q0_q2 * h_y_q3 - h_y_q1;
    const float d_q2 = kf->D[2];
    const float t37 = d_q2 * t36;
    const float t38 = t16 + t36 * t37;
    const float t39 = 1.0f / t38;
    const float t40 = t37 * t39;
    const float t41 = d_q2 * (t16 * t39);
    const float t42 = u_q0_q2 - t36 * t33;
    const float t43 = u_q1_q2 - t36 * t18;
    const float t44 = t42 * h_x_q3 + t43 * h_y_q1 + h_x_q1;
    const float t45 = t41 * t44;
    const float t46 = t23 + t44 * t45;
    const float t47 = 1.0f / t46;
    const float t48 = t45 * t47;
    const float t49 = t41 * (t23 * t47);
    const float t50 = t42 - t44 * t34;
    const float t51 = t43 - t44 * t25;
    const float t52 = t50 * h_y_q1 - t51 * h_x_q3 - h_y_q3;
    const float t53 = t49 * t52;
    const float t54 = t30 + t52 * t53;
    const float t55 = 1.0f / t54;
    const float t56 = t53 * t55;
    const float d_q2_next = t49 * (t30 * t55);
    const float t57 = t18 + t40 * t43;
    const float t58 = t25 + t48 * t51;
    const float u_q1_q2_next = t51 - t52 * t32;
    const float t59 = t32 + t56 * u_q1_q2_next;
    const float t60 = t33 + t40 * t42;
    const float t61 = t34 + t48 * t50;
    const float u_q0_q2_next = t50 - t52 * t35;
    const float t62 = t35 + t56 * u_q0_q2_next;
    const float u_q1_q3 = kf->U[4];
    const float u_q0_q3 = kf->U[3];
    const float u_q2_q3 = kf->U[5];
    const float t63 = u_q1_q3 * h_x_q1 - u_q0_q3 * h_y_q3 - u_q2_q3 * h_y_q1 + h_x_q3;
    const float d_q3 = kf->D[3];
    const float t64 = d_q3 * t63;
    const float t65 = t38 + t63 * t64;
    const float t66 = 1.0f / t65;
    const float t67 = t64 * t66;
    const float t68 = d_q3 * (t38 * t66);
    const float t69 = u_q0_q3 - t63 * t60;
    const float t70 = u_q1_q3 - t63 * t57;
    const float t71 = u_q2_q3 - t63 * t40;
    const float t72 = t69 * h_x_q3 + t70 * h_y_q1 + t71 * h_x_q1 + h_y_q3;
    const float t73 = t68 * t72;
    const float t74 = t46 + t72 * t73;
    const float t75 = 1.0f / t74;
    const float t76 = t73 * t75;
    const float t77 = t68 * (t46 * t75);
    const float t78 = t69 - t72 * t61;
    const float t79 = t70 - t72 * t58;
    const float t80 = t71 - t72 * t48;
    const float t81 = t78 * h_y_q1 - t79 * h_x_q3 - t80 * h_y_q3 + h_x_q1;
    const float t82 = t77 * t81;
    const float t83 = t54 + t81 * t82;
    const float t84 = 1.0f / t83;
    const float t85 = t82 * t84;
    const float d_q3_next = t77 * (t54 * t84);
    const float t86 = t40 + t67 * t71;
    const float t87 = t48 + t76 * t80;
    const float u_q2_q3_next = t80 - t81 * t56;
    const float t88 = t56 + t85 * u_q2_q3_next;
    const float t89 = t57 + t67 * t70;
    const float t90 = t58 + t76 * t79;
    const float u_q1_q3_next = t79 - t81 * t59;
    const float t91 = t59 + t85 * u_q1_q3_next;
    const float t92 = t60 + t67 * t69;
    const float t93 = t61 + t76 * t78;
    const float u_q0_q3_next = t78 - t81 * t62;
    const float t94 = t62 + t85 * u_q0_q3_next;
    const float u_q1_bx = kf->U[7];
    const float u_q0_bx = kf->U[6];
    const float u_q2_bx = kf->U[8];
    const float u_q3_bx = kf->U[9];
    const float t95 = u_q1_bx * h_x_q1 - u_q0_bx * h_y_q3 - u_q2_bx * h_y_q1 + u_q3_bx * h_x_q3;
    const float d_bx = kf->D[4];
    const float t96 = d_bx * t95;
    const float t97 = t65 + t95 * t96;
    const float t98 = 1.0f / t97;
    const float t99 = t96 * t98;
    const float t100 = d_bx * (t65 * t98);
    const float t101 = u_q0_bx - t95 * t92;
    const float t102 = u_q1_bx - t95 * t89;
    const float t103 = u_q2_bx - t95 * t86;
    const float t104 = u_q3_bx - t95 * t67;
    const float t105 = t101 * h_x_q3 + t102 * h_y_q1 + t103 * h_x_q1 + t104 * h_y_q3;
    const float t106 = t100 * t105;
    const float t107 = t74 + t105 * t106;
    const float t108 = 1.0f / t107;
    const float t109 = t106 * t108;
    const float t110 = t100 * (t74 * t108);
    const float t111 = t101 - t105 * t93;
    const float t112 = t102 - t105 * t90;
    const float t113 = t103 - t105 * t87;
    const float t114 = t104 - t105 * t76;
    const float t115 = t111 * h_y_q1 - t112 * h_x_q3 - t113 * h_y_q3 + t114 * h_x_q1;
    const float t116 = t110 * t115;
    const float t117 = t83 + t115 * t116;
    const float t118 = 1.0f / t117;
    const float t119 = t116 * t118;
    const float d_bx_next = t110 * (t83 * t118);
    const float t120 = t67 + t99 * t104;
    const float t121 = t76 + t109 * t114;
    const float u_q3_bx_next = t114 - t115 * t85;
    const float t122 = t85 + t119 * u_q3_bx_next;
    const float t123 = t86 + t99 * t103;
    const float t124 = t87 + t109 * t113;
    const float u_q2_bx_next = t113 - t115 * t88;
    const float t125 = t88 + t119 * u_q2_bx_next;
    const float t126 = t89 + t99 * t102;
    const float t127 = t90 + t109 * t112;
    const float u_q1_bx_next = t112 - t115 * t91;
    const float t128 = t91 + t119 * u_q1_bx_next;
    const float t129 = t92 + t99 * t101;
    const float t130 = t93 + t109 * t111;
    const float u_q0_bx_next = t111 - t115 * t94;
    const float t131 = t94 + t119 * u_q0_bx_next;
    const float u_q1_by = kf->U[11];
    const float u_q0_by = kf->U[10];
    const float u_q2_by = kf->U[12];
    const float u_q3_by = kf->U[13];
    const float t132 = u_q1_by * h_x_q1 - u_q0_by * h_y_q3 - u_q2_by * h_y_q1 + u_q3_by * h_x_q3;
    const float d_by = kf->D[5];
    const float t133 = d_by * t132;
    const float t134 = t97 + t132 * t133;
    const float t135 = 1.0f / t134;
    const float t136 = t133 * t135;
    const float t137 = d_by * (t97 * t135);
    const float t138 = u_q0_by - t132 * t129;
    const float t139 = u_q1_by - t132 * t126;
    const float t140 = u_q2_by - t132 * t123;
    const float t141 = u_q3_by - t132 * t120;
    const float t142 = t138 * h_x_q3 + t139 * h_y_q1 + t140 * h_x_q1 + t141 * h_y_q3;
    const float t143 = t137 * t142;
    const float t144 = t107 + t142 * t143;
    const float t145 = 1.0f / t144;
    const float t146 = t143 * t145;
    const float t147 = t137 * (t107 * t145);
    const float t148 = t138 - t142 * t130;
    const float t149 = t139 - t142 * t127;
    const float t150 = t140 - t142 * t124;
    const float t151 = t141 - t142 * t121;
    const float t152 = t148 * h_y_q1 - t149 * h_x_q3 - t150 * h_y_q3 + t151 * h_x_q1;
    const float t153 = t147 * t152;
    const float t154 = t117 + t152 * t153;
    const float t155 = 1.0f / t154;
    const float t156 = t153 * t155;
    const float d_by_next = t147 * (t117 * t155);
    const float u_bx_by = kf->U[14];
    const float t157 = u_bx_by - t132 * t99;
    const float t158 = t99 + t136 * t157;
    const float t159 = t157 - t142 * t109;
    const float t160 = t109 + t146 * t159;
    const float u_bx_by_next = t159 - t152 * t119;
    const float t161 = t119 + t156 * u_bx_by_next;
    const float t162 = t120 + t136 * t141;
    const float t163 = t121 + t146 * t151;
    const float u_q3_by_next = t151 - t152 * t122;
    const float t164 = t122 + t156 * u_q3_by_next;
    const float t165 = t123 + t136 * t140;
    const float t166 = t124 + t146 * t150;
    const float u_q2_by_next = t150 - t152 * t125;
    const float t167 = t125 + t156 * u_q2_by_next;
    const float t168 = t126 + t136 * t139;
    const float t169 = t127 + t146 * t149;
    const float u_q1_by_next = t149 - t152 * t128;
    const float t170 = t128 + t156 * u_q1_by_next;
    const float t171 = t129 + t136 * t138;
    const float t172 = t130 + t146 * t148;
    const float u_q0_by_next = t148 - t152 * t131;
    const float t173 = t131 + t156 * u_q0_by_next;
    const float u_q1_bz = kf->U[16];
    const float u_q0_bz = kf->U[15];
    const float u_q2_bz = kf->U[17];
    const float u_q3_bz = kf->U[18];
    const float t174 = u_q1_bz * h_x_q1 - u_q0_bz * h_y_q3 - u_q2_bz * h_y_q1 + u_q3_bz * h_x_q3;
    const float d_bz = kf->D[6];
    const float t175 = d_bz * t174;
    const float s_x = t134 + t174 * t175;
    const float t176 = 1.0f / s_x;
    const float t177 = t175 * t176;
    const float t178 = d_bz * (t134 * t176);
    const float t179 = u_q0_bz - t174 * t171;
    const float t180 = u_q1_bz - t174 * t168;
    const float t181 = u_q2_bz - t174 * t165;
    const float t182 = u_q3_bz - t174 * t162;
    const float t183 = t179 * h_x_q3 + t180 * h_y_q1 + t181 * h_x_q1 + t182 * h_y_q3;
    const float t184 = t178 * t183;
    const float s_y = t144 + t183 * t184;
    const float t185 = 1.0f / s_y;
    const float t186 = t184 * t185;
    const float t187 = t178 * (t144 * t185);
    const float t188 = t179 - t183 * t172;
    const float t189 = t180 - t183 * t169;
    const float t190 = t181 - t183 * t166;
    const float t191 = t182 - t183 * t163;
    const float t192 = t188 * h_y_q1 - t189 * h_x_q3 - t190 * h_y_q3 + t191 * h_x_q1;
    const float t193 = t187 * t192;
    const float s_z = t154 + t192 * t193;
    const float t194 = 1.0f / s_z;
    const float t195 = t193 * t194;
    const float d_bz_next = t187 * (t154 * t194);
    const float u_by_bz = kf->U[20];
    const float t196 = u_by_bz - t174 * t136;
    const float t197 = t196 - t183 * t146;
    const float u_by_bz_next = t197 - t192 * t156;
    const float u_bx_bz = kf->U[19];
    const float t198 = u_bx_bz - t174 * t158;
    const float t199 = t198 - t183 * t160;
    const float u_bx_bz_next = t199 - t192 * t161;
    const float u_q3_bz_next = t191 - t192 * t164;
    const float u_q2_bz_next = t190 - t192 * t167;
    const float u_q1_bz_next = t189 - t192 * t170;
    const float u_q0_bz_next = t188 - t192 * t173;
    const float t200 = (t171 + t177 * t179) * y_x;
    const float t201 = (t168 + t177 * t180) * y_x;
    const float t202 = (t165 + t177 * t181) * y_x;
    const float t203 = (t162 + t177 * t182) * y_x;
    const float nu_y = y_y - h_x_q3 * t200 - h_y_q1 * t201 - h_x_q1 * t202 - h_y_q3 * t203;
    const float t204 = t200 + (t172 + t186 * t188) * nu_y;
    const float t205 = t201 + (t169 + t186 * t189) * nu_y;
    const float t206 = t202 + (t166 + t186 * t190) * nu_y;
    const float t207 = t203 + (t163 + t186 * t191) * nu_y;
    const float nu_z = y_z - h_y_q1 * t204 + h_x_q3 * t205 + h_y_q3 * t206 - h_x_q1 * t207;
    const float nis = y_x * (y_x * t176) + nu_y * (nu_y * t185) + nu_z * (nu_z * t194);

    /* state and innovation squared */
    const float q0_next = q0 + t204 + (t173 + t195 * u_q0_bz_next) * nu_z;
    const float q1_next = q1 + t205 + (t170 + t195 * u_q1_bz_next) * nu_z;
    const float q2_next = q2 + t206 + (t167 + t195 * u_q2_bz_next) * nu_z;
    const float q3_next = q3 + t207 + (t164 + t195 * u_q3_bz_next) * nu_z;
    const float bx_next = kf->x[AHRS_BX] + (t158 + t177 * t198) * y_x + (t160 + t186 * t199) * nu_y
        + (t161 + t195 * u_bx_bz_next) * nu_z;
    const float by_next = kf->x[AHRS_BY] + (t136 + t177 * t196) * y_x + (t146 + t186 * t197) * nu_y
        + (t156 + t195 * u_by_bz_next) * nu_z;
    const float bz_next = kf->x[AHRS_BZ] + t177 * y_x + t186 * nu_y + t195 * nu_z;

    /* guards */
    if (!ahrs_finite(y_x + y_y + y_z + s_x + s_y + s_z)) { return AHRS_NOT_FINITE; }
    if (!(s_x > 0.0f) || !(s_y > 0.0f) || !(s_z > 0.0f)) { return AHRS_NOT_POSITIVE; }

    /* gate */
    const bool t208 = nis > 16.266235f;
    if (t208 && kf->gate_count_accel < 50u) {
        kf->nis = nis;
        kf->gate_count_accel = kf->gate_count_accel + 1u;
        return AHRS_GATED;
    }
    if (t208) { flags |= AHRS_ANOMALY; }
    if (!ahrs_finite(nis + q0_next + q1_next + q2_next + q3_next + bx_next + by_next + bz_next)) {
        return AHRS_NOT_FINITE;
    }

    /* store */
    kf->x[AHRS_Q0] = q0_next;
    kf->x[AHRS_Q1] = q1_next;
    kf->x[AHRS_Q2] = q2_next;
    kf->x[AHRS_Q3] = q3_next;
    kf->x[AHRS_BX] = bx_next;
    kf->x[AHRS_BY] = by_next;
    kf->x[AHRS_BZ] = bz_next;
    kf->U[0] = u_q0_q1_next;
    kf->U[1] = u_q0_q2_next;
    kf->U[2] = u_q1_q2_next;
    kf->U[3] = u_q0_q3_next;
    kf->U[4] = u_q1_q3_next;
    kf->U[5] = u_q2_q3_next;
    kf->U[6] = u_q0_bx_next;
    kf->U[7] = u_q1_bx_next;
    kf->U[8] = u_q2_bx_next;
    kf->U[9] = u_q3_bx_next;
    kf->U[10] = u_q0_by_next;
    kf->U[11] = u_q1_by_next;
    kf->U[12] = u_q2_by_next;
    kf->U[13] = u_q3_by_next;
    kf->U[14] = u_bx_by_next;
    kf->U[15] = u_q0_bz_next;
    kf->U[16] = u_q1_bz_next;
    kf->U[17] = u_q2_bz_next;
    kf->U[18] = u_q3_bz_next;
    kf->U[19] = u_bx_bz_next;
    kf->U[20] = u_by_bz_next;
    kf->D[0] = d_q0_next;
    kf->D[1] = d_q1_next;
    kf->D[2] = d_q2_next;
    kf->D[3] = d_q3_next;
    kf->D[4] = d_bx_next;
    kf->D[5] = d_by_next;
    kf->D[6] = d_bz_next;
    kf->gate_count_accel = 0;
    kf->nis = nis;
    return flags;
}

ahrs_status_t ahrs_update_mag(ahrs_t *kf, const ahrs_mag_t *z)
{
    if (kf == NULL || z == NULL) { return AHRS_NULL_ARGUMENT; }
    ahrs_status_t flags = AHRS_OK;

    /* innovation */
    const float q0 = kf->x[AHRS_Q0];
    const float q1 = kf->x[AHRS_Q1];
    const float q2 = kf->x[AHRS_Q2];
    const float q3 = kf->x[AHRS_Q3];
    const float t0 = q0 * q0;
    const float t1 = q1 * q1;
    const float t2 = q2 * q2;
    const float t3 = q3 * q3;
    const float nx = t0 + t1 - t2 - t3;
    const float t4 = 2.0f * q0;
    const float t5 = 2.0f * q1;
    const float t6 = 2.0f * q2;
    const float t7 = 2.0f * q3;
    const float t8 = q1 * q3 * 2.0f;
    const float t9 = q0 * q2 * 2.0f;
    const float ux = t8 - t9;
    const float h_x = kf->parameters.field_north * nx + kf->parameters.field_up * ux;
    const float h_x_q0 = kf->parameters.field_north * t4 - kf->parameters.field_up * t6;
    const float h_x_q1 = kf->parameters.field_north * t5 + kf->parameters.field_up * t7;
    const float h_y_q1 = kf->parameters.field_north * t6 + kf->parameters.field_up * t4;
    const float h_x_q3 = kf->parameters.field_up * t5 - kf->parameters.field_north * t7;
    const float ny = 2.0f * (q1 * q2) - 2.0f * (q0 * q3);
    const float uy = 2.0f * (q0 * q1) + 2.0f * (q2 * q3);
    const float h_y = kf->parameters.field_north * ny + kf->parameters.field_up * uy;
    const float nz = t9 + t8;
    const float uz = t0 + t3 - t1 - t2;
    const float h_z = kf->parameters.field_north * nz + kf->parameters.field_up * uz;
    const float y_x = z->x - h_x;
    const float y_y = z->y - h_y;
    const float y_z = z->z - h_z;

    /* gain and covariance: x, y, z */
    const float d_q0 = kf->D[0];
    const float t10 = d_q0 * h_x_q0;
    const float t11 = 9.0f + h_x_q0 * t10;
    const float t12 = 1.0f / t11;
    const float t13 = t10 * t12;
    const float t14 = d_q0 * (9.0f * t12);
    const float t15 = t14 * h_x_q3;
    const float t16 = 9.0f + h_x_q3 * t15;
    const float t17 = 1.0f / t16;
    const float t18 = t15 * t17;
    const float t19 = t14 * (9.0f * t17);
    const float t20 = t19 * h_y_q1;
    const float t21 = 9.0f + h_y_q1 * t20;
    const float t22 = 1.0f / t21;
    const float t23 = t20 * t22;
    const float d_q0_next = t19 * (9.0f * t22);
    const float u_q0_q1 = kf->U[0];
    const float t24 = u_q0_q1 * h_x_q0 + h_x_q1;
    const float d_q1 = kf->D[1];
    const float t25 = d_q1 * t24;
    const float t26 = t11 + t24 * t25;
    const float t27 = 1.0f / t26;
    const float t28 = t25 * t27;
    const float t29 = d_q1 * (t11 * t27);
    const float t30 = u_q0_q1 - t24 * t13;
    const float t31 = t30 * h_x_q3 + h_y_q1;
    const float t32 = t29 * t31;
    const float t33 = t16 + t31 * t32;
    const float t34 = 1.0f / t33;
    const float t35 = t32 * t34;
    const float t36 = t29 * (t16 * t34);
    const float t37 = t30 - t31 * t18;
    const float t38 = t37 * h_y_q1 - h_x_q3;
    const float t39 = t36 * t38;
    const float t40 = t21 + t38 * t39;
    const float t41 = 1.0f / t40;
    const float t42 = t39 * t41;
    const float d_q1_next = t36 * (t21 * t41);
    const float t43 = t13 + t28 * t30;
    const float t44 = t18 + t35 * t37;
    const float u_q0_q1_next = t37 - t38 * t23;
    const float t45 = t23 + t42 * u_q0_q1_next;
    const float u_q0_q2 = kf->U[1];
    const float u_q1_q2 = kf->U[2];
    const float t46 = u_q0_q2 * h_x_q0 + u_q1_q2 * h_x_q1 - h_y_q1;
    const float d_q2 = kf->D[2];
    const float t47 = d_q2 * t46;
    const float t48 = t26 + t46 * t47;
    const float t49 = 1.0f / t48;
    const float t50 = t47 * t49;
    const float t51 = d_q2 * (t26 * t49);
    const float t52 = u_q0_q2 - t46 * t43;
    const float t53 = u_q1_q2 - t46 * t28;
    const float t54 = t52 * h_x_q3 + t53 * h_y_q1 + h_x_q1;
    const float t55 = t51 * t54;
    const float t56 = t33 + t54 * t55;
    const float t57 = 1.0f / t56;
    const float t58 = t55 * t57;
    const float t59 = t51 * (t33 * t57);
    const float t60 = t52 - t54 * t44;
    const float t61 = t53 - t54 * t35;
    const float t62 = t60 * h_y_q1 - t61 * h_x_q3 + h_x_q0;
    const float t63 = t59 * t62;
    const float t64 = t40 + t62 * t63;
    const float t65 = 1.0f / t64;
    const float t66 = t63 * t65;
    const float d_q2_next = t59 * (t40 * t65);
    const float t67 = t28 + t50 * t53;
    const float t68 = t35 + t58 * t61;
    const float u_q1_q2_next = t61 - t62 * t42;
    const float t69 = t42 + t66 * u_q1_q2_next;
    const float t70 = t43 + t50 * t52;
    const float t71 = t44 + t58 * t60;
    const float u_q0_q2_next = t60 - t62 * t45;
    const float t72 = t45 + t66 * u_q0_q2_next;
    const float u_q0_q3 = kf->U[3];
    const float u_q1_q3 = kf->U[4];
    const float u_q2_q3 = kf->U[5];
    const float t73 = u_q0_q3 * h_x_q0 + u_q1_q3 * h_x_q1 - u_q2_q3 * h_y_q1 + h_x_q3;
    const float d_q3 = kf->D[3];
    const float t74 = d_q3 * t73;
    const float t75 = t48 + t73 * t74;
    const float t76 = 1.0f / t75;
    const float t77 = t74 * t76;
    const float t78 = d_q3 * (t48 * t76);
    const float t79 = u_q0_q3 - t73 * t70;
    const float t80 = u_q1_q3 - t73 * t67;
    const float t81 = u_q2_q3 - t73 * t50;
    const float t82 = t79 * h_x_q3 + t80 * h_y_q1 + t81 * h_x_q1 - h_x_q0;
    const float t83 = t78 * t82;
    const float t84 = t56 + t82 * t83;
    const float t85 = 1.0f / t84;
    const float t86 = t83 * t85;
    const float t87 = t78 * (t56 * t85);
    const float t88 = t79 - t82 * t71;
    const float t89 = t80 - t82 * t68;
    const float t90 = t81 - t82 * t58;
    const float t91 = t88 * h_y_q1 - t89 * h_x_q3 + t90 * h_x_q0 + h_x_q1;
    const float t92 = t87 * t91;
    const float t93 = t64 + t91 * t92;
    const float t94 = 1.0f / t93;
    const float t95 = t92 * t94;
    const float d_q3_next = t87 * (t64 * t94);
    const float t96 = t50 + t77 * t81;
    const float t97 = t58 + t86 * t90;
    const float u_q2_q3_next = t90 - t91 * t66;
    const float t98 = t66 + t95 * u_q2_q3_next;
    const float t99 = t67 + t77 * t80;
    const float t100 = t68 + t86 * t89;
    const float u_q1_q3_next = t89 - t91 * t69;
    const float t101 = t69 + t95 * u_q1_q3_next;
    const float t102 = t70 + t77 * t79;
    const float t103 = t71 + t86 * t88;
    const float u_q0_q3_next = t88 - t91 * t72;
    const float t104 = t72 + t95 * u_q0_q3_next;
    const float u_q0_bx = kf->U[6];
    const float u_q1_bx = kf->U[7];
    const float u_q2_bx = kf->U[8];
    const float u_q3_bx = kf->U[9];
    const float t105 = u_q0_bx * h_x_q0 + u_q1_bx * h_x_q1 - u_q2_bx * h_y_q1 + u_q3_bx * h_x_q3;
    const float d_bx = kf->D[4];
    const float t106 = d_bx * t105;
    const float t107 = t75 + t105 * t106;
    const float t108 = 1.0f / t107;
    const float t109 = t106 * t108;
    const float t110 = d_bx * (t75 * t108);
    const float t111 = u_q0_bx - t105 * t102;
    const float t112 = u_q1_bx - t105 * t99;
    const float t113 = u_q2_bx - t105 * t96;
    const float t114 = u_q3_bx - t105 * t77;
    const float t115 = t111 * h_x_q3 + t112 * h_y_q1 + t113 * h_x_q1 - t114 * h_x_q0;
    const float t116 = t110 * t115;
    const float t117 = t84 + t115 * t116;
    const float t118 = 1.0f / t117;
    const float t119 = t116 * t118;
    const float t120 = t110 * (t84 * t118);
    const float t121 = t111 - t115 * t103;
    const float t122 = t112 - t115 * t100;
    const float t123 = t113 - t115 * t97;
    const float t124 = t114 - t115 * t86;
    const float t125 = t121 * h_y_q1 - t122 * h_x_q3 + t123 * h_x_q0 + t124 * h_x_q1;
    const float t126 = t120 * t125;
    const float t127 = t93 + t125 * t126;
    const float t128 = 1.0f / t127;
    const float t129 = t126 * t128;
    const float d_bx_next = t120 * (t93 * t128);
    const float t130 = t77 + t109 * t114;
    const float t131 = t86 + t119 * t124;
    const float u_q3_bx_next = t124 - t125 * t95;
    const float t132 = t95 + t129 * u_q3_bx_next;
    const float t133 = t96 + t109 * t113;
    const float t134 = t97 + t119 * t123;
    const float u_q2_bx_next = t123 - t125 * t98;
    const float t135 = t98 + t129 * u_q2_bx_next;
    const float t136 = t99 + t109 * t112;
    const float t137 = t100 + t119 * t122;
    const float u_q1_bx_next = t122 - t125 * t101;
    const float t138 = t101 + t129 * u_q1_bx_next;
    const float t139 = t102 + t109 * t111;
    const float t140 = t103 + t119 * t121;
    const float u_q0_bx_next = t121 - t125 * t104;
    const float t141 = t104 + t129 * u_q0_bx_next;
    const float u_q0_by = kf->U[10];
    const float u_q1_by = kf->U[11];
    const float u_q2_by = kf->U[12];
    const float u_q3_by = kf->U[13];
    const float t142 = u_q0_by * h_x_q0 + u_q1_by * h_x_q1 - u_q2_by * h_y_q1 + u_q3_by * h_x_q3;
    const float d_by = kf->D[5];
    const float t143 = d_by * t142;
    const float t144 = t107 + t142 * t143;
    const float t145 = 1.0f / t144;
    const float t146 = t143 * t145;
    const float t147 = d_by * (t107 * t145);
    const float t148 = u_q0_by - t142 * t139;
    const float t149 = u_q1_by - t142 * t136;
    const float t150 = u_q2_by - t142 * t133;
    const float t151 = u_q3_by - t142 * t130;
    const float t152 = t148 * h_x_q3 + t149 * h_y_q1 + t150 * h_x_q1 - t151 * h_x_q0;
    const float t153 = t147 * t152;
    const float t154 = t117 + t152 * t153;
    const float t155 = 1.0f / t154;
    const float t156 = t153 * t155;
    const float t157 = t147 * (t117 * t155);
    const float t158 = t148 - t152 * t140;
    const float t159 = t149 - t152 * t137;
    const float t160 = t150 - t152 * t134;
    const float t161 = t151 - t152 * t131;
    const float t162 = t158 * h_y_q1 - t159 * h_x_q3 + t160 * h_x_q0 + t161 * h_x_q1;
    const float t163 = t157 * t162;
    const float t164 = t127 + t162 * t163;
    const float t165 = 1.0f / t164;
    const float t166 = t163 * t165;
    const float d_by_next = t157 * (t127 * t165);
    const float u_bx_by = kf->U[14];
    const float t167 = u_bx_by - t142 * t109;
    const float t168 = t109 + t146 * t167;
    const float t169 = t167 - t152 * t119;
    const float t170 = t119 + t156 * t169;
    const float u_bx_by_next = t169 - t162 * t129;
    const float t171 = t129 + t166 * u_bx_by_next;
    const float t172 = t130 + t146 * t151;
    const float t173 = t131 + t156 * t161;
    const float u_q3_by_next = t161 - t162 * t132;
    const float t174 = t132 + t166 * u_q3_by_next;
    const float t175 = t133 + t146 * t150;
    const float t176 = t134 + t156 * t160;
    const float u_q2_by_next = t160 - t162 * t135;
    const float t177 = t135 + t166 * u_q2_by_next;
    const float t178 = t136 + t146 * t149;
    const float t179 = t137 + t156 * t159;
    const float u_q1_by_next = t159 - t162 * t138;
    const float t180 = t138 + t166 * u_q1_by_next;
    const float t181 = t139 + t146 * t148;
    const float t182 = t140 + t156 * t158;
    const float u_q0_by_next = t158 - t162 * t141;
    const float t183 = t141 + t166 * u_q0_by_next;
    const float u_q0_bz = kf->U[15];
    const float u_q1_bz = kf->U[16];
    const float u_q2_bz = kf->U[17];
    const float u_q3_bz = kf->U[18];
    const float t184 = u_q0_bz * h_x_q0 + u_q1_bz * h_x_q1 - u_q2_bz * h_y_q1 + u_q3_bz * h_x_q3;
    const float d_bz = kf->D[6];
    const float t185 = d_bz * t184;
    const float s_x = t144 + t184 * t185;
    const float t186 = 1.0f / s_x;
    const float t187 = t185 * t186;
    const float t188 = d_bz * (t144 * t186);
    const float t189 = u_q0_bz - t184 * t181;
    const float t190 = u_q1_bz - t184 * t178;
    const float t191 = u_q2_bz - t184 * t175;
    const float t192 = u_q3_bz - t184 * t172;
    const float t193 = t189 * h_x_q3 + t190 * h_y_q1 + t191 * h_x_q1 - t192 * h_x_q0;
    const float t194 = t188 * t193;
    const float s_y = t154 + t193 * t194;
    const float t195 = 1.0f / s_y;
    const float t196 = t194 * t195;
    const float t197 = t188 * (t154 * t195);
    const float t198 = t189 - t193 * t182;
    const float t199 = t190 - t193 * t179;
    const float t200 = t191 - t193 * t176;
    const float t201 = t192 - t193 * t173;
    const float t202 = t198 * h_y_q1 - t199 * h_x_q3 + t200 * h_x_q0 + t201 * h_x_q1;
    const float t203 = t197 * t202;
    const float s_z = t164 + t202 * t203;
    const float t204 = 1.0f / s_z;
    const float t205 = t203 * t204;
    const float d_bz_next = t197 * (t164 * t204);
    const float u_by_bz = kf->U[20];
    const float t206 = u_by_bz - t184 * t146;
    const float t207 = t206 - t193 * t156;
    const float u_by_bz_next = t207 - t202 * t166;
    const float u_bx_bz = kf->U[19];
    const float t208 = u_bx_bz - t184 * t168;
    const float t209 = t208 - t193 * t170;
    const float u_bx_bz_next = t209 - t202 * t171;
    const float u_q3_bz_next = t201 - t202 * t174;
    const float u_q2_bz_next = t200 - t202 * t177;
    const float u_q1_bz_next = t199 - t202 * t180;
    const float u_q0_bz_next = t198 - t202 * t183;
    const float t210 = (t181 + t187 * t189) * y_x;
    const float t211 = (t178 + t187 * t190) * y_x;
    const float t212 = (t175 + t187 * t191) * y_x;
    const float t213 = (t172 + t187 * t192) * y_x;
    const float nu_y = y_y - h_x_q3 * t210 - h_y_q1 * t211 - h_x_q1 * t212 + h_x_q0 * t213;
    const float t214 = t210 + (t182 + t196 * t198) * nu_y;
    const float t215 = t211 + (t179 + t196 * t199) * nu_y;
    const float t216 = t212 + (t176 + t196 * t200) * nu_y;
    const float t217 = t213 + (t173 + t196 * t201) * nu_y;
    const float nu_z = y_z - h_y_q1 * t214 + h_x_q3 * t215 - h_x_q0 * t216 - h_x_q1 * t217;
    const float nis = y_x * (y_x * t186) + nu_y * (nu_y * t195) + nu_z * (nu_z * t204);

    /* state and innovation squared */
    const float q0_next = q0 + t214 + (t183 + t205 * u_q0_bz_next) * nu_z;
    const float q1_next = q1 + t215 + (t180 + t205 * u_q1_bz_next) * nu_z;
    const float q2_next = q2 + t216 + (t177 + t205 * u_q2_bz_next) * nu_z;
    const float q3_next = q3 + t217 + (t174 + t205 * u_q3_bz_next) * nu_z;
    const float bx_next = kf->x[AHRS_BX] + (t168 + t187 * t208) * y_x + (t170 + t196 * t209) * nu_y
        + (t171 + t205 * u_bx_bz_next) * nu_z;
    const float by_next = kf->x[AHRS_BY] + (t146 + t187 * t206) * y_x + (t156 + t196 * t207) * nu_y
        + (t166 + t205 * u_by_bz_next) * nu_z;
    const float bz_next = kf->x[AHRS_BZ] + t187 * y_x + t196 * nu_y + t205 * nu_z;

    /* guards */
    if (!ahrs_finite(y_x + y_y + y_z + s_x + s_y + s_z)) { return AHRS_NOT_FINITE; }
    if (!(s_x > 0.0f) || !(s_y > 0.0f) || !(s_z > 0.0f)) { return AHRS_NOT_POSITIVE; }

    /* gate */
    const bool t218 = nis > 16.266235f;
    if (t218 && kf->gate_count_mag < 50u) {
        kf->nis = nis;
        kf->gate_count_mag = kf->gate_count_mag + 1u;
        return AHRS_GATED;
    }
    if (t218) { flags |= AHRS_ANOMALY; }
    if (!ahrs_finite(nis + q0_next + q1_next + q2_next + q3_next + bx_next + by_next + bz_next)) {
        return AHRS_NOT_FINITE;
    }

    /* store */
    kf->x[AHRS_Q0] = q0_next;
    kf->x[AHRS_Q1] = q1_next;
    kf->x[AHRS_Q2] = q2_next;
    kf->x[AHRS_Q3] = q3_next;
    kf->x[AHRS_BX] = bx_next;
    kf->x[AHRS_BY] = by_next;
    kf->x[AHRS_BZ] = bz_next;
    kf->U[0] = u_q0_q1_next;
    kf->U[1] = u_q0_q2_next;
    kf->U[2] = u_q1_q2_next;
    kf->U[3] = u_q0_q3_next;
    kf->U[4] = u_q1_q3_next;
    kf->U[5] = u_q2_q3_next;
    kf->U[6] = u_q0_bx_next;
    kf->U[7] = u_q1_bx_next;
    kf->U[8] = u_q2_bx_next;
    kf->U[9] = u_q3_bx_next;
    kf->U[10] = u_q0_by_next;
    kf->U[11] = u_q1_by_next;
    kf->U[12] = u_q2_by_next;
    kf->U[13] = u_q3_by_next;
    kf->U[14] = u_bx_by_next;
    kf->U[15] = u_q0_bz_next;
    kf->U[16] = u_q1_bz_next;
    kf->U[17] = u_q2_bz_next;
    kf->U[18] = u_q3_bz_next;
    kf->U[19] = u_bx_bz_next;
    kf->U[20] = u_by_bz_next;
    kf->D[0] = d_q0_next;
    kf->D[1] = d_q1_next;
    kf->D[2] = d_q2_next;
    kf->D[3] = d_q3_next;
    kf->D[4] = d_bx_next;
    kf->D[5] = d_by_next;
    kf->D[6] = d_bz_next;
    kf->gate_count_mag = 0;
    kf->nis = nis;
    return flags;
}

ahrs_status_t ahrs_set_state(ahrs_t *kf, const ahrs_real_t x[7])
{
    if (kf == NULL || x == NULL) { return AHRS_NULL_ARGUMENT; }
    if (!ahrs_finite(x[AHRS_Q0])) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(x[AHRS_Q1])) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(x[AHRS_Q2])) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(x[AHRS_Q3])) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(x[AHRS_BX])) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(x[AHRS_BY])) { return AHRS_NOT_FINITE; }
    if (!ahrs_finite(x[AHRS_BZ])) { return AHRS_NOT_FINITE; }
    kf->x[AHRS_Q0] = x[AHRS_Q0];
    kf->x[AHRS_Q1] = x[AHRS_Q1];
    kf->x[AHRS_Q2] = x[AHRS_Q2];
    kf->x[AHRS_Q3] = x[AHRS_Q3];
    kf->x[AHRS_BX] = x[AHRS_BX];
    kf->x[AHRS_BY] = x[AHRS_BY];
    kf->x[AHRS_BZ] = x[AHRS_BZ];
    return AHRS_OK;
}

ahrs_status_t ahrs_set_covariance(ahrs_t *kf, const ahrs_real_t P[49])
{
    if (kf == NULL || P == NULL) { return AHRS_NULL_ARGUMENT; }
    float p[28];
    float w[28];

    /* the upper triangle, column by column */
    for (int j = 0; j < 7; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = P[7 * i + j];
            p[j * (j + 1) / 2 + i] = value;
            w[j * (j + 1) / 2 + i] = value;
            if (!ahrs_finite(value)) { return AHRS_NOT_FINITE; }
        }
    }

    /* factor it: a pivot is zero up to round-off, or positive */
    for (int j = 7 - 1; j >= 0; j--) {
        const float round_off = 8.34465e-7f * p[j * (j + 1) / 2 + j];
        const float pivot = w[j * (j + 1) / 2 + j];
        if (!(-round_off <= pivot)) { return AHRS_NOT_POSITIVE; }
        const float d = round_off < pivot ? pivot : 0.0f;
        w[j * (j + 1) / 2 + j] = d;
        for (int i = j - 1; i >= 0; i--) {
            const float rest = w[j * (j + 1) / 2 + i];
            if (d <= 0.0f && 3.33786e-6f * p[j * (j + 1) / 2 + j] * p[i * (i + 1) / 2 + i] < rest
                * rest) {
                return AHRS_NOT_POSITIVE;
            }
            const float u = d > 0.0f ? rest / d : 0.0f;
            for (int k = 0; k < i + 1; k++) {
                w[i * (i + 1) / 2 + k] = w[i * (i + 1) / 2 + k] - u * w[j * (j + 1) / 2 + k];
            }
            w[j * (j + 1) / 2 + i] = u;
        }
    }

    /* store */
    for (int j = 0; j < 7; j++) {
        for (int i = 0; i < j; i++) {
            kf->U[j * (j - 1) / 2 + i] = w[j * (j + 1) / 2 + i];
        }
        kf->D[j] = w[j * (j + 1) / 2 + j];
    }
    return AHRS_OK;
}

void ahrs_get_covariance(const ahrs_t *kf, ahrs_real_t P[49])
{
    if (kf == NULL || P == NULL) { return; }
    for (int j = 0; j < 7; j++) {
        for (int i = 0; i < j + 1; i++) {
            float sum = kf->D[j];
            if (i < j) {
                sum = sum * kf->U[j * (j - 1) / 2 + i];
            }
            for (int k = j + 1; k < 7; k++) {
                sum = sum + kf->U[k * (k - 1) / 2 + i] * kf->D[k] * kf->U[k * (k - 1) / 2 + j];
            }
            const float value = sum;
            P[7 * i + j] = value;
            P[7 * j + i] = value;
        }
    }
}
/* kfgen: body e4f5390a723deafb5686f9a8997b41fd */
