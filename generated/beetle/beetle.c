/* kfgen build beetle.yaml */
#include "beetle.h"

#include <math.h>

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "beetle tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "beetle tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool beetle_finite(float a)
{
    const uint32_t exponent = 0x7f800000u;
    union { float value; uint32_t bits; } view;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

static float beetle_min(float a, float b)
{
    return b < a ? b : a;
}

static float beetle_max(float a, float b)
{
    return b > a ? b : a;
}

/* a in (-half, half], by whole turns of 2 half */
static float beetle_wrap(float a, float half)
{
    if (a > half || a <= -half) {
        a -= (half + half) * ceilf((a - half) / (half + half));
        if (a > half || a <= -half) { a = half; } /* the last bit of a turn */
    }
    return a;
}

beetle_status_t beetle_init(beetle_t *kf)
{
    if (kf == NULL) { return BEETLE_NULL_ARGUMENT; }
    kf->x[BEETLE_PX] = 0.0f;
    kf->x[BEETLE_PY] = 0.0f;
    kf->x[BEETLE_V] = 5.0f;
    kf->x[BEETLE_TH] = 0.0f;
    kf->mu[BEETLE_MODE_RUN] = 0.5f;
    kf->mu[BEETLE_MODE_TURN] = 0.5f;
    kf->modes.run.x[BEETLE_PX] = 0.0f;
    kf->modes.run.x[BEETLE_PY] = 0.0f;
    kf->modes.run.x[BEETLE_V] = 5.0f;
    kf->modes.run.x[BEETLE_TH] = 0.0f;
    for (int i = 0; i < 6; i++) {
        kf->modes.run.U[i] = 0.0f;
    }
    kf->modes.run.D[0] = 2500.0f;
    kf->modes.run.D[1] = 2500.0f;
    kf->modes.run.D[2] = 1.0f;
    kf->modes.run.D[3] = 0.49f;
    kf->modes.run.nis = 0.0f;
    kf->modes.turn.x[BEETLE_PX] = 0.0f;
    kf->modes.turn.x[BEETLE_PY] = 0.0f;
    kf->modes.turn.x[BEETLE_V] = 5.0f;
    kf->modes.turn.x[BEETLE_TH] = 0.0f;
    for (int i = 0; i < 6; i++) {
        kf->modes.turn.U[i] = 0.0f;
    }
    kf->modes.turn.D[0] = 2500.0f;
    kf->modes.turn.D[1] = 2500.0f;
    kf->modes.turn.D[2] = 1.0f;
    kf->modes.turn.D[3] = 0.49f;
    kf->modes.turn.nis = 0.0f;
    kf->nis = 0.0f;
    kf->initialized = false;
    kf->parameters.pace = 5.0f;
    kf->parameters.lasts = 10.0f;
    return BEETLE_OK;
}

/* x <- f(x, u, w), in place */
static void beetle_f(const beetle_t *kf, beetle_real_t step, beetle_real_t x[4])
{
    const float px = x[BEETLE_PX];
    const float py = x[BEETLE_PY];
    const float v = x[BEETLE_V];
    const float th = x[BEETLE_TH];
    const float cos_th = cosf(th);
    const float t0 = step * v;
    const float sin_th = sinf(th);
    x[BEETLE_PX] = px + t0 * cos_th;
    x[BEETLE_PY] = py + t0 * sin_th;
    x[BEETLE_V] = v + 0.33333334f * (step * (kf->parameters.pace - v));
}

beetle_status_t beetle_predict(beetle_t *kf, beetle_real_t dt)
{
    if (kf == NULL) { return BEETLE_NULL_ARGUMENT; }
    beetle_status_t flags = BEETLE_OK;

    /* arguments */
    if (!beetle_finite(kf->parameters.pace)) { return BEETLE_NOT_FINITE; }
    if (!beetle_finite(kf->parameters.lasts)) { return BEETLE_NOT_FINITE; }
    if (!beetle_finite(dt)) { return BEETLE_NOT_FINITE; }
    const bool t0 = dt < 0.01f;
    if (t0) { flags |= BEETLE_DT_CLAMPED; }
    const bool t1 = dt > 2.0f;
    if (t1) { flags |= BEETLE_DT_CLAMPED; }
    const float step = t1 ? 2.0f : (t0 ? 0.01f : dt);
    const float mu_run = kf->mu[BEETLE_MODE_RUN];
    const float mu_turn = kf->mu[BEETLE_MODE_TURN];

    /* probabilities after a switch, and of the mode before, given the mode now */
    const float t2 = expf(-(step / kf->parameters.lasts));
    const float t3 = 1.0f - t2;
    if (!beetle_finite(t2 + t3)) { return BEETLE_NOT_FINITE; }
    if (t2 < 0.0f || t3 < 0.0f) { return BEETLE_NOT_POSITIVE; }
    const float t4 = t2 * mu_run;
    const float t5 = t3 * mu_turn;
    const float c_run = t4 + t5;
    const bool t6 = c_run > 1.1754944e-38f;
    const float t7 = t6 ? 1.0f / c_run : 0.0f;
    const float w_run_run = t6 ? t4 * t7 : 1.0f;
    const float w_turn_run = t6 ? t5 * t7 : 0.0f;
    const float t8 = t3 * mu_run;
    const float t9 = t2 * mu_turn;
    const float c_turn = t8 + t9;
    const bool t10 = c_turn > 1.1754944e-38f;
    const float t11 = t10 ? 1.0f / c_turn : 0.0f;
    const float w_run_turn = t10 ? t8 * t11 : 0.0f;
    const float w_turn_turn = t10 ? t9 * t11 : 1.0f;
    const float px_run = kf->modes.run.x[BEETLE_PX];
    const float py_run = kf->modes.run.x[BEETLE_PY];
    const float v_run = kf->modes.run.x[BEETLE_V];
    const float th_run = kf->modes.run.x[BEETLE_TH];
    const float px_turn = kf->modes.turn.x[BEETLE_PX];
    const float py_turn = kf->modes.turn.x[BEETLE_PY];
    const float v_turn = kf->modes.turn.x[BEETLE_V];
    const float th_turn = kf->modes.turn.x[BEETLE_TH];

    /* run: where it starts from */
    const float th_base_run = w_run_run < w_turn_run ? th_turn : th_run;
    const float t12 = beetle_wrap(th_run - th_base_run, 3.1415927f);
    const float t13 = px_turn - px_run;
    const float t14 = py_turn - py_run;
    const float t15 = v_turn - v_run;
    const float t16 = beetle_wrap(th_turn - th_base_run, 3.1415927f) - t12;
    const float t17 = w_run_run * w_turn_run;
    const float px_run_1 = px_run + w_turn_run * t13;
    const float py_run_1 = py_run + w_turn_run * t14;
    const float v_run_1 = v_run + w_turn_run * t15;
    const float th_run_1 = beetle_wrap(th_base_run + t12 + w_turn_run * t16, 3.1415927f);
    const float d_py_run = kf->modes.run.D[1];
    const float t18 = w_run_run * d_py_run;
    const float d_v_run = kf->modes.run.D[2];
    const float t19 = w_run_run * d_v_run;
    const float d_th_run = kf->modes.run.D[3];
    const float t20 = w_run_run * d_th_run;
    const float d_py_turn_1 = kf->modes.turn.D[1];
    const float t21 = d_py_turn_1 * w_turn_run;
    const float d_v_turn_1 = kf->modes.turn.D[2];
    const float t22 = d_v_turn_1 * w_turn_run;
    const float d_th_turn_1 = kf->modes.turn.D[3];
    const float t23 = d_th_turn_1 * w_turn_run;
    const float t24 = t20 + t23;
    const bool t25 = t24 > 0.0f;
    const float t26 = t25 ? t23 / t24 : 0.0f;
    const float t27 = t25 ? t20 / t24 : 1.0f;
    const float t28 = t23 * t27;
    const float t29 = t17 * t16;
    const float d_th_next_run = t24 + t16 * t29;
    const bool t30 = d_th_next_run > 0.0f;
    const float t31 = t30 ? t29 / d_th_next_run : 0.0f;
    const float t32 = t30 ? t24 / d_th_next_run : 1.0f;
    const float t33 = t17 * t32;
    const float u_px_th_run = kf->modes.run.U[3];
    const float u_px_th_turn_1 = kf->modes.turn.U[3];
    const float t34 = t27 * u_px_th_run + t26 * u_px_th_turn_1;
    const float t35 = u_px_th_turn_1 - u_px_th_run;
    const float u_px_th_next_run = t32 * t34 + t31 * t13;
    const float t36 = t13 - t16 * t34;
    const float u_py_th_run = kf->modes.run.U[4];
    const float u_py_th_turn_1 = kf->modes.turn.U[4];
    const float t37 = t27 * u_py_th_run + t26 * u_py_th_turn_1;
    const float t38 = u_py_th_turn_1 - u_py_th_run;
    const float u_py_th_next_run = t32 * t37 + t31 * t14;
    const float t39 = t14 - t16 * t37;
    const float u_v_th_run = kf->modes.run.U[5];
    const float u_v_th_turn_1 = kf->modes.turn.U[5];
    const float t40 = t27 * u_v_th_run + t26 * u_v_th_turn_1;
    const float t41 = u_v_th_turn_1 - u_v_th_run;
    const float u_v_th_next_run = t32 * t40 + t31 * t15;
    const float t42 = t15 - t16 * t40;
    const float t43 = t19 + t22;
    const bool t44 = t43 > 0.0f;
    const float t45 = t44 ? t22 / t43 : 0.0f;
    const float t46 = t44 ? t19 / t43 : 1.0f;
    const float t47 = t22 * t46;
    const float t48 = t28 * t41;
    const float t49 = t43 + t41 * t48;
    const bool t50 = t49 > 0.0f;
    const float t51 = t50 ? t48 / t49 : 0.0f;
    const float t52 = t50 ? t43 / t49 : 1.0f;
    const float t53 = t28 * t52;
    const float t54 = t33 * t42;
    const float d_v_next_run = t49 + t42 * t54;
    const bool t55 = d_v_next_run > 0.0f;
    const float t56 = t55 ? t54 / d_v_next_run : 0.0f;
    const float t57 = t55 ? t49 / d_v_next_run : 1.0f;
    const float t58 = t33 * t57;
    const float u_px_v_run = kf->modes.run.U[1];
    const float u_px_v_turn_1 = kf->modes.turn.U[1];
    const float t59 = t46 * u_px_v_run + t45 * u_px_v_turn_1;
    const float t60 = u_px_v_turn_1 - u_px_v_run;
    const float t61 = t52 * t59 + t51 * t35;
    const float t62 = t35 - t41 * t59;
    const float u_px_v_next_run = t57 * t61 + t56 * t36;
    const float t63 = t36 - t42 * t61;
    const float u_py_v_run = kf->modes.run.U[2];
    const float u_py_v_turn_1 = kf->modes.turn.U[2];
    const float t64 = t46 * u_py_v_run + t45 * u_py_v_turn_1;
    const float t65 = u_py_v_turn_1 - u_py_v_run;
    const float t66 = t52 * t64 + t51 * t38;
    const float t67 = t38 - t41 * t64;
    const float u_py_v_next_run = t57 * t66 + t56 * t39;
    const float t68 = t39 - t42 * t66;
    const float t69 = t18 + t21;
    const bool t70 = t69 > 0.0f;
    const float t71 = t70 ? t18 / t69 : 1.0f;
    const float t72 = t47 * t65;
    const float t73 = t69 + t65 * t72;
    const bool t74 = t73 > 0.0f;
    const float t75 = t74 ? t69 / t73 : 1.0f;
    const float t76 = t53 * t67;
    const float t77 = t73 + t67 * t76;
    const bool t78 = t77 > 0.0f;
    const float t79 = t78 ? t73 / t77 : 1.0f;
    const float t80 = t58 * t68;
    const float d_py_next_run = t77 + t68 * t80;
    const bool t81 = d_py_next_run > 0.0f;
    const float t82 = t81 ? t77 / d_py_next_run : 1.0f;
    const float u_px_py_run = kf->modes.run.U[0];
    const float u_px_py_turn_1 = kf->modes.turn.U[0];
    const float t83 = t71 * u_px_py_run + (t70 ? t21 / t69 : 0.0f) * u_px_py_turn_1;
    const float t84 = u_px_py_turn_1 - u_px_py_run;
    const float t85 = t75 * t83 + (t74 ? t72 / t73 : 0.0f) * t60;
    const float t86 = t60 - t65 * t83;
    const float t87 = t79 * t85 + (t78 ? t76 / t77 : 0.0f) * t62;
    const float t88 = t62 - t67 * t85;
    const float u_px_py_next_run = t82 * t87 + (t81 ? t80 / d_py_next_run : 0.0f) * t63;
    const float t89 = t63 - t68 * t87;
    const float d_px_run = kf->modes.run.D[0];
    const float d_px_turn_1 = kf->modes.turn.D[0];
    const float d_px_next_run = w_run_run * d_px_run + d_px_turn_1 * w_turn_run
        + t84 * (t21 * t71 * t84) + t86 * (t47 * t75 * t86) + t88 * (t53 * t79 * t88)
        + t89 * (t58 * t82 * t89);

    /* turn: where it starts from */
    const float th_base_turn = w_run_turn < w_turn_turn ? th_turn : th_run;
    const float t90 = beetle_wrap(th_turn - th_base_turn, 3.1415927f);
    const float t91 = beetle_wrap(th_run - th_base_turn, 3.1415927f) - t90;
    const float t92 = w_turn_turn * w_run_turn;
    const float px_turn_1 = px_turn - w_run_turn * t13;
    const float py_turn_1 = py_turn - w_run_turn * t14;
    const float v_turn_1 = v_turn - w_run_turn * t15;
    const float th_turn_1 = beetle_wrap(th_base_turn + t90 + w_run_turn * t91, 3.1415927f);
    const float t93 = w_turn_turn * d_py_turn_1;
    const float t94 = w_turn_turn * d_v_turn_1;
    const float t95 = w_turn_turn * d_th_turn_1;
    const float t96 = d_py_run * w_run_turn;
    const float t97 = d_v_run * w_run_turn;
    const float t98 = d_th_run * w_run_turn;
    const float t99 = t95 + t98;
    const bool t100 = t99 > 0.0f;
    const float t101 = t100 ? t98 / t99 : 0.0f;
    const float t102 = t100 ? t95 / t99 : 1.0f;
    const float t103 = t98 * t102;
    const float t104 = t92 * t91;
    const float d_th_next_turn = t99 + t91 * t104;
    const bool t105 = d_th_next_turn > 0.0f;
    const float t106 = t105 ? t104 / d_th_next_turn : 0.0f;
    const float t107 = t105 ? t99 / d_th_next_turn : 1.0f;
    const float t108 = t92 * t107;
    const float t109 = t102 * u_px_th_turn_1 + t101 * u_px_th_run;
    const float u_px_th_next_turn = t107 * t109 - t106 * t13;
    const float t110 = t13 + t91 * t109;
    const float t111 = t102 * u_py_th_turn_1 + t101 * u_py_th_run;
    const float u_py_th_next_turn = t107 * t111 - t106 * t14;
    const float t112 = t14 + t91 * t111;
    const float t113 = t102 * u_v_th_turn_1 + t101 * u_v_th_run;
    const float u_v_th_next_turn = t107 * t113 - t106 * t15;
    const float t114 = t15 + t91 * t113;
    const float t115 = t94 + t97;
    const bool t116 = t115 > 0.0f;
    const float t117 = t116 ? t97 / t115 : 0.0f;
    const float t118 = t116 ? t94 / t115 : 1.0f;
    const float t119 = t97 * t118;
    const float t120 = t103 * t41;
    const float t121 = t115 + t41 * t120;
    const bool t122 = t121 > 0.0f;
    const float t123 = t122 ? -(t120 / t121) : 0.0f;
    const float t124 = t122 ? t115 / t121 : 1.0f;
    const float t125 = t103 * t124;
    const float t126 = t108 * t114;
    const float d_v_next_turn = t121 + t114 * t126;
    const bool t127 = d_v_next_turn > 0.0f;
    const float t128 = t127 ? -(t126 / d_v_next_turn) : 0.0f;
    const float t129 = t127 ? t121 / d_v_next_turn : 1.0f;
    const float t130 = t108 * t129;
    const float t131 = t118 * u_px_v_turn_1 + t117 * u_px_v_run;
    const float t132 = t124 * t131 - t123 * t35;
    const float t133 = t41 * t131 - t35;
    const float u_px_v_next_turn = t129 * t132 - t128 * t110;
    const float t134 = t114 * t132 - t110;
    const float t135 = t118 * u_py_v_turn_1 + t117 * u_py_v_run;
    const float t136 = t124 * t135 - t123 * t38;
    const float t137 = t41 * t135 - t38;
    const float u_py_v_next_turn = t129 * t136 - t128 * t112;
    const float t138 = t114 * t136 - t112;
    const float t139 = t93 + t96;
    const bool t140 = t139 > 0.0f;
    const float t141 = t140 ? t93 / t139 : 1.0f;
    const float t142 = t119 * t65;
    const float t143 = t139 + t65 * t142;
    const bool t144 = t143 > 0.0f;
    const float t145 = t144 ? t139 / t143 : 1.0f;
    const float t146 = t125 * t137;
    const float t147 = t143 + t137 * t146;
    const bool t148 = t147 > 0.0f;
    const float t149 = t148 ? t143 / t147 : 1.0f;
    const float t150 = t130 * t138;
    const float d_py_next_turn = t147 + t138 * t150;
    const bool t151 = d_py_next_turn > 0.0f;
    const float t152 = t151 ? t147 / d_py_next_turn : 1.0f;
    const float t153 = t141 * u_px_py_turn_1 + (t140 ? t96 / t139 : 0.0f) * u_px_py_run;
    const float t154 = t145 * t153 - (t144 ? -(t142 / t143) : 0.0f) * t60;
    const float t155 = t65 * t153 - t60;
    const float t156 = t149 * t154 + (t148 ? t146 / t147 : 0.0f) * t133;
    const float t157 = t133 - t137 * t154;
    const float u_px_py_next_turn = t152 * t156 + (t151 ? t150 / d_py_next_turn : 0.0f) * t134;
    const float t158 = t134 - t138 * t156;
    const float d_px_next_turn = w_turn_turn * d_px_turn_1 + d_px_run * w_run_turn
        + t84 * (t96 * t141 * t84) + t155 * (t119 * t145 * t155) + t157 * (t125 * t149 * t157)
        + t158 * (t130 * t152 * t158);

    /* run: model */
    const float t159 = 0.1f * step;
    const float t160 = 0.01f * step;
    const float cos_th_run = cosf(th_run_1);
    const float t161 = step * v_run_1;
    const float f_py_th_run = t161 * cos_th_run;
    const float px_next_run = px_run_1 + f_py_th_run;
    const float sin_th_run = sinf(th_run_1);
    const float t162 = t161 * sin_th_run;
    const float f_px_v_run = step * cos_th_run;
    const float py_next_run = py_run_1 + t162;
    const float f_py_v_run = step * sin_th_run;
    const float v_next_run = v_run_1 + 0.33333334f * (step * (kf->parameters.pace - v_run_1));
    const float f_v_v_run = 1.0f - 0.33333334f * step;

    /* run: F U D U^T F^T + Q */
    const float t163 = u_px_v_next_run + f_px_v_run;
    const float t164 = u_py_v_next_run + f_py_v_run;
    const float t165 = u_px_th_next_run + f_px_v_run * u_v_th_next_run - t162;
    const float t166 = u_py_th_next_run + f_py_v_run * u_v_th_next_run + f_py_th_run;
    const float t167 = f_v_v_run * u_v_th_next_run;
    const float d_th_next_run_1 = t160 + d_th_next_run;
    const float t168 = 1.0f / d_th_next_run_1;
    const float t169 = d_th_next_run * t168;
    const float t170 = d_th_next_run * (t160 * t168);
    const float u_px_th_next_run_1 = t169 * t165;
    const float u_py_th_next_run_1 = t169 * t166;
    const float u_v_th_next_run_1 = t169 * t167;
    const float t171 = d_v_next_run * f_v_v_run;
    const float t172 = step + f_v_v_run * t171;
    const float t173 = 1.0f / t172;
    const float t174 = t171 * t173;
    const float t175 = d_v_next_run * (step * t173);
    const float t176 = t170 * t167;
    const float d_v_next_run_1 = t172 + t167 * t176;
    const float t177 = 1.0f / d_v_next_run_1;
    const float t178 = t176 * t177;
    const float t179 = t170 * (t172 * t177);
    const float t180 = t174 * t163;
    const float t181 = t165 - t167 * t180;
    const float u_px_v_next_run_1 = t180 + t178 * t181;
    const float t182 = t174 * t164;
    const float t183 = t166 - t167 * t182;
    const float u_py_v_next_run_1 = t182 + t178 * t183;
    const float t184 = t159 + d_py_next_run;
    const float t185 = 1.0f / t184;
    const float t186 = t175 * t164;
    const float t187 = t184 + t164 * t186;
    const float t188 = 1.0f / t187;
    const float t189 = t179 * t183;
    const float d_py_next_run_1 = t187 + t183 * t189;
    const float t190 = 1.0f / d_py_next_run_1;
    const float t191 = d_py_next_run * t185 * u_px_py_next_run;
    const float t192 = t163 - t164 * t191;
    const float t193 = t191 + t186 * t188 * t192;
    const float t194 = t181 - t183 * t193;
    const float u_px_py_next_run_1 = t193 + t189 * t190 * t194;
    const float d_px_next_run_1 = t159 + d_px_next_run
        + u_px_py_next_run * (d_py_next_run * (t159 * t185) * u_px_py_next_run)
        + t192 * (t175 * (t184 * t188) * t192) + t194 * (t179 * (t187 * t190) * t194);

    /* run: guards */
    if (!beetle_finite(px_next_run + py_next_run + v_next_run + d_px_next_run_1 + d_py_next_run_1
        + d_v_next_run_1 + d_th_next_run_1)) {
        return BEETLE_NOT_FINITE;
    }

    /* turn: sigma points */
    float points_turn[32];
    const float t195 = sqrtf(d_py_next_turn);
    const float t196 = sqrtf(d_v_next_turn);
    const float t197 = sqrtf(d_th_next_turn);
    points_turn[0] = 2.0f * sqrtf(d_px_next_turn);
    points_turn[1] = 0.0f;
    points_turn[2] = 0.0f;
    points_turn[3] = 0.0f;
    points_turn[8] = u_px_py_next_turn * t195 * 2.0f;
    points_turn[9] = 2.0f * t195;
    points_turn[10] = 0.0f;
    points_turn[11] = 0.0f;
    points_turn[16] = u_px_v_next_turn * t196 * 2.0f;
    points_turn[17] = u_py_v_next_turn * t196 * 2.0f;
    points_turn[18] = 2.0f * t196;
    points_turn[19] = 0.0f;
    points_turn[24] = u_px_th_next_turn * t197 * 2.0f;
    points_turn[25] = u_py_th_next_turn * t197 * 2.0f;
    points_turn[26] = u_v_th_next_turn * t197 * 2.0f;
    points_turn[27] = 2.0f * t197;
    for (int j = 0; j < 4; j++) {
        const float part_0_turn = points_turn[8 * j];
        points_turn[8 * j] = px_turn_1 + part_0_turn;
        points_turn[8 * j + 4] = px_turn_1 - part_0_turn;
        const float part_1_turn = points_turn[8 * j + 1];
        points_turn[8 * j + 1] = py_turn_1 + part_1_turn;
        points_turn[8 * j + 5] = py_turn_1 - part_1_turn;
        const float part_2_turn = points_turn[8 * j + 2];
        points_turn[8 * j + 2] = v_turn_1 + part_2_turn;
        points_turn[8 * j + 6] = v_turn_1 - part_2_turn;
        const float part_3_turn = points_turn[8 * j + 3];
        points_turn[8 * j + 3] = th_turn_1 + part_3_turn;
        points_turn[8 * j + 7] = th_turn_1 - part_3_turn;
    }
    float shift_px_turn = 0.0f;
    float shift_py_turn = 0.0f;
    float shift_v_turn = 0.0f;
    float shift_th_turn = 0.0f;
    float u_px_py_turn = 0.0f;
    float u_px_v_turn = 0.0f;
    float u_py_v_turn = 0.0f;
    float u_px_th_turn = 0.0f;
    float u_py_th_turn = 0.0f;
    float u_v_th_turn = 0.0f;
    float d_px_turn = t159;
    float d_py_turn = t159;
    float d_v_turn = step;
    float d_th_turn = step;

    /* turn: points through f, and their deviations */
    for (int k = 0; k < 8; k++) {
        beetle_f(kf, step, &points_turn[4 * k]);
        const float dev_px_turn = points_turn[4 * k] - px_turn_1;
        const float dev_py_turn = points_turn[4 * k + 1] - py_turn_1;
        const float dev_v_turn = points_turn[4 * k + 2] - v_turn_1;
        const float dev_th_turn = points_turn[4 * k + 3] - th_turn_1;
        points_turn[4 * k] = dev_px_turn;
        points_turn[4 * k + 1] = dev_py_turn;
        points_turn[4 * k + 2] = dev_v_turn;
        points_turn[4 * k + 3] = dev_th_turn;
        shift_px_turn = shift_px_turn + dev_px_turn;
        shift_py_turn = shift_py_turn + dev_py_turn;
        shift_v_turn = shift_v_turn + dev_v_turn;
        shift_th_turn = shift_th_turn + dev_th_turn;
    }
    const float mean_px_turn = 0.125f * shift_px_turn;
    const float mean_py_turn = 0.125f * shift_py_turn;
    const float mean_v_turn = 0.125f * shift_v_turn;
    const float mean_th_turn = 0.125f * shift_th_turn;

    /* turn: deviations from the mean */
    for (int k = 0; k < 8; k++) {
        const float t204 = points_turn[4 * k] - mean_px_turn;
        const float t205 = points_turn[4 * k + 1] - mean_py_turn;
        const float t206 = points_turn[4 * k + 2] - mean_v_turn;
        const float t207 = points_turn[4 * k + 3] - mean_th_turn;
        const float t208 = 0.125f * t207;
        const float t209 = d_th_turn + t207 * t208;
        const float t210 = 1.0f / t209;
        const float t211 = t208 * t210;
        const float t212 = d_th_turn * t210;
        const float t213 = 0.125f * t212;
        const float t200 = t212 * u_px_th_turn + t211 * t204;
        const float t214 = t204 - t207 * u_px_th_turn;
        const float t201 = t212 * u_py_th_turn + t211 * t205;
        const float t215 = t205 - t207 * u_py_th_turn;
        const float t202 = t212 * u_v_th_turn + t211 * t206;
        const float t216 = t206 - t207 * u_v_th_turn;
        const float t217 = t213 * t216;
        const float t218 = d_v_turn + t216 * t217;
        const float t219 = 1.0f / t218;
        const float t220 = t217 * t219;
        const float t221 = d_v_turn * t219;
        const float t222 = t213 * t221;
        const float t198 = t221 * u_px_v_turn + t220 * t214;
        const float t223 = t214 - t216 * u_px_v_turn;
        const float t199 = t221 * u_py_v_turn + t220 * t215;
        const float t224 = t215 - t216 * u_py_v_turn;
        const float t225 = t222 * t224;
        const float t226 = d_py_turn + t224 * t225;
        const float t227 = 1.0f / t226;
        const float t228 = d_py_turn * t227;
        const float t229 = t223 - t224 * u_px_py_turn;
        const float t203 = d_px_turn + t229 * (t222 * t228 * t229);
        u_px_py_turn = t228 * u_px_py_turn + t225 * t227 * t223;
        u_px_v_turn = t198;
        u_py_v_turn = t199;
        u_px_th_turn = t200;
        u_py_th_turn = t201;
        u_v_th_turn = t202;
        d_px_turn = t203;
        d_py_turn = t226;
        d_v_turn = t218;
        d_th_turn = t209;
    }
    const float u_px_py_next_turn_1 = u_px_py_turn;
    const float u_px_v_next_turn_1 = u_px_v_turn;
    const float u_px_th_next_turn_1 = u_px_th_turn;
    const float u_py_v_next_turn_1 = u_py_v_turn;
    const float u_py_th_next_turn_1 = u_py_th_turn;
    const float u_v_th_next_turn_1 = u_v_th_turn;
    const float d_px_next_turn_1 = d_px_turn;
    const float d_py_next_turn_1 = d_py_turn;
    const float d_v_next_turn_1 = d_v_turn;
    const float d_th_next_turn_1 = d_th_turn;
    const float px_next_turn = px_turn_1 + mean_px_turn;
    const float py_next_turn = py_turn_1 + mean_py_turn;
    const float v_next_turn = v_turn_1 + mean_v_turn;
    const float th_next_turn = th_turn_1 + mean_th_turn;
    const float t230 = beetle_wrap(th_next_turn, 3.1415927f);

    /* turn: guards */
    if (!beetle_finite(px_next_turn + py_next_turn + v_next_turn + th_next_turn + d_px_next_turn_1
        + d_py_next_turn_1 + d_v_next_turn_1 + d_th_next_turn_1)) {
        return BEETLE_NOT_FINITE;
    }
    const float t231 = 1.0f / (c_run + c_turn);
    const float mu_run_next = c_run * t231;
    const float mu_turn_next = c_turn * t231;

    /* combined state */
    const float th_base = mu_run_next < mu_turn_next ? t230 : th_run_1;
    const float t232 = beetle_wrap(th_run_1 - th_base, 3.1415927f);
    const float px_all = px_next_run + mu_turn_next * (px_next_turn - px_next_run);
    const float py_all = py_next_run + mu_turn_next * (py_next_turn - py_next_run);
    const float v_all = v_next_run + mu_turn_next * (v_next_turn - v_next_run);
    const float th_all = th_base + t232
        + mu_turn_next * (beetle_wrap(t230 - th_base, 3.1415927f) - t232);
    if (!beetle_finite(px_all + py_all + v_all + th_all + mu_run_next + mu_turn_next)) {
        return BEETLE_NOT_FINITE;
    }

    /* run: store */
    kf->modes.run.x[BEETLE_PX] = px_next_run;
    kf->modes.run.x[BEETLE_PY] = py_next_run;
    kf->modes.run.x[BEETLE_V] = v_next_run;
    kf->modes.run.x[BEETLE_TH] = th_run_1;
    kf->modes.run.U[0] = u_px_py_next_run_1;
    kf->modes.run.U[1] = u_px_v_next_run_1;
    kf->modes.run.U[2] = u_py_v_next_run_1;
    kf->modes.run.U[3] = u_px_th_next_run_1;
    kf->modes.run.U[4] = u_py_th_next_run_1;
    kf->modes.run.U[5] = u_v_th_next_run_1;
    kf->modes.run.D[0] = d_px_next_run_1;
    kf->modes.run.D[1] = d_py_next_run_1;
    kf->modes.run.D[2] = d_v_next_run_1;
    kf->modes.run.D[3] = d_th_next_run_1;

    /* turn: store */
    kf->modes.turn.x[BEETLE_PX] = px_next_turn;
    kf->modes.turn.x[BEETLE_PY] = py_next_turn;
    kf->modes.turn.x[BEETLE_V] = v_next_turn;
    kf->modes.turn.x[BEETLE_TH] = t230;
    kf->modes.turn.U[0] = u_px_py_next_turn_1;
    kf->modes.turn.U[1] = u_px_v_next_turn_1;
    kf->modes.turn.U[2] = u_py_v_next_turn_1;
    kf->modes.turn.U[3] = u_px_th_next_turn_1;
    kf->modes.turn.U[4] = u_py_th_next_turn_1;
    kf->modes.turn.U[5] = u_v_th_next_turn_1;
    kf->modes.turn.D[0] = d_px_next_turn_1;
    kf->modes.turn.D[1] = d_py_next_turn_1;
    kf->modes.turn.D[2] = d_v_next_turn_1;
    kf->modes.turn.D[3] = d_th_next_turn_1;

    /* store: the bank */
    kf->mu[BEETLE_MODE_RUN] = mu_run_next;
    kf->mu[BEETLE_MODE_TURN] = mu_turn_next;
    kf->x[BEETLE_PX] = px_all;
    kf->x[BEETLE_PY] = py_all;
    kf->x[BEETLE_V] = v_all;
    kf->x[BEETLE_TH] = beetle_wrap(th_all, 3.1415927f);
    return flags;
}

beetle_status_t beetle_update_camera(beetle_t *kf, const beetle_camera_t *z)
{
    if (kf == NULL || z == NULL) { return BEETLE_NULL_ARGUMENT; }

    /* the first measurement sets the state */
    if (!beetle_finite(z->x + z->y)) { return BEETLE_NOT_FINITE; }
    if (!kf->initialized) {
        kf->x[BEETLE_PX] = z->x;
        kf->x[BEETLE_PY] = z->y;
        kf->modes.run.x[BEETLE_PX] = z->x;
        kf->modes.run.x[BEETLE_PY] = z->y;
        kf->modes.turn.x[BEETLE_PX] = z->x;
        kf->modes.turn.x[BEETLE_PY] = z->y;
        kf->nis = 0.0f;
        kf->initialized = true;
        return BEETLE_OK;
    }

    /* run: innovation */
    const float px_run = kf->modes.run.x[BEETLE_PX];
    const float py_run = kf->modes.run.x[BEETLE_PY];
    const float y_x_run = z->x - px_run;
    const float y_y_run = z->y - py_run;

    /* run: gain and covariance: x, y */
    const float d_px_run = kf->modes.run.D[0];
    const float t0 = 0.1225f + d_px_run;
    const float t1 = 1.0f / t0;
    const float t2 = d_px_run * t1;
    const float d_px_next_run = d_px_run * (0.1225f * t1);
    const float d_py_run = kf->modes.run.D[1];
    const float u_px_py_run = kf->modes.run.U[0];
    const float t3 = d_py_run * u_px_py_run;
    const float t4 = t0 + u_px_py_run * t3;
    const float t5 = 1.0f / t4;
    const float t6 = t3 * t5;
    const float t7 = d_py_run * (t0 * t5);
    const float t8 = 0.1225f + t7;
    const float t9 = 1.0f / t8;
    const float t10 = t7 * t9;
    const float d_py_next_run = t7 * (0.1225f * t9);
    const float u_px_py_next_run = u_px_py_run - u_px_py_run * t2;
    const float t11 = t2 + t6 * u_px_py_next_run;
    const float t12 = t10 * u_px_py_next_run;
    const float d_v_run = kf->modes.run.D[2];
    const float u_px_v_run = kf->modes.run.U[1];
    const float t13 = d_v_run * u_px_v_run;
    const float t14 = t4 + u_px_v_run * t13;
    const float t15 = 1.0f / t14;
    const float t16 = t13 * t15;
    const float t17 = d_v_run * (t4 * t15);
    const float u_py_v_run = kf->modes.run.U[2];
    const float t18 = u_py_v_run - u_px_v_run * t6;
    const float t19 = t17 * t18;
    const float t20 = t8 + t18 * t19;
    const float t21 = 1.0f / t20;
    const float t22 = t19 * t21;
    const float d_v_next_run = t17 * (t8 * t21);
    const float t23 = t6 + t16 * t18;
    const float u_py_v_next_run = t18 - t18 * t10;
    const float t24 = t10 + t22 * u_py_v_next_run;
    const float t25 = u_px_v_run - u_px_v_run * t11;
    const float t26 = t11 + t16 * t25;
    const float u_px_v_next_run = t25 - t18 * t12;
    const float t27 = t12 + t22 * u_px_v_next_run;
    const float d_th_run = kf->modes.run.D[3];
    const float u_px_th_run = kf->modes.run.U[3];
    const float t28 = d_th_run * u_px_th_run;
    const float s_x_run = t14 + u_px_th_run * t28;
    const float t29 = 1.0f / s_x_run;
    const float t30 = t28 * t29;
    const float t31 = d_th_run * (t14 * t29);
    const float u_py_th_run = kf->modes.run.U[4];
    const float t32 = u_py_th_run - u_px_th_run * t23;
    const float t33 = t31 * t32;
    const float s_y_run = t20 + t32 * t33;
    const float t34 = 1.0f / s_y_run;
    const float t35 = t33 * t34;
    const float d_th_next_run = t31 * (t20 * t34);
    const float u_v_th_run = kf->modes.run.U[5];
    const float t36 = u_v_th_run - u_px_th_run * t16;
    const float u_v_th_next_run = t36 - t32 * t22;
    const float u_py_th_next_run = t32 - t32 * t24;
    const float t37 = u_px_th_run - u_px_th_run * t26;
    const float u_px_th_next_run = t37 - t32 * t27;
    const float t38 = (t23 + t30 * t32) * y_x_run;
    const float t39 = y_x_run * (y_x_run * t29);
    const float nu_y_run = y_y_run - t38;
    const float t40 = nu_y_run * (nu_y_run * t34);
    const float nis_run = t39 + t40;

    /* run: state and innovation squared */
    const float t41 = 0.5f * (t39 + logf(s_x_run) + 1.837877f + t40 + logf(s_y_run) + 1.837877f);
    const float l_run = -t41;
    const float px_next_run = px_run + (t26 + t30 * t37) * y_x_run
        + (t27 + t35 * u_px_th_next_run) * nu_y_run;
    const float py_next_run = py_run + t38 + (t24 + t35 * u_py_th_next_run) * nu_y_run;
    const float v_next_run = kf->modes.run.x[BEETLE_V] + (t16 + t30 * t36) * y_x_run
        + (t22 + t35 * u_v_th_next_run) * nu_y_run;
    const float th_next_run = kf->modes.run.x[BEETLE_TH] + t30 * y_x_run + t35 * nu_y_run;
    const float t42 = beetle_wrap(th_next_run, 3.1415927f);

    /* run: guards */
    if (!beetle_finite(px_next_run + py_next_run + v_next_run + th_next_run + nis_run + s_x_run
        + s_y_run)) {
        return BEETLE_NOT_FINITE;
    }

    /* turn: innovation */
    const float px_turn = kf->modes.turn.x[BEETLE_PX];
    const float py_turn = kf->modes.turn.x[BEETLE_PY];
    const float y_x_turn = z->x - px_turn;
    const float y_y_turn = z->y - py_turn;

    /* turn: gain and covariance: x, y */
    const float d_px_turn = kf->modes.turn.D[0];
    const float t43 = 0.1225f + d_px_turn;
    const float t44 = 1.0f / t43;
    const float t45 = d_px_turn * t44;
    const float d_px_next_turn = d_px_turn * (0.1225f * t44);
    const float d_py_turn = kf->modes.turn.D[1];
    const float u_px_py_turn = kf->modes.turn.U[0];
    const float t46 = d_py_turn * u_px_py_turn;
    const float t47 = t43 + u_px_py_turn * t46;
    const float t48 = 1.0f / t47;
    const float t49 = t46 * t48;
    const float t50 = d_py_turn * (t43 * t48);
    const float t51 = 0.1225f + t50;
    const float t52 = 1.0f / t51;
    const float t53 = t50 * t52;
    const float d_py_next_turn = t50 * (0.1225f * t52);
    const float u_px_py_next_turn = u_px_py_turn - u_px_py_turn * t45;
    const float t54 = t45 + t49 * u_px_py_next_turn;
    const float t55 = t53 * u_px_py_next_turn;
    const float d_v_turn = kf->modes.turn.D[2];
    const float u_px_v_turn = kf->modes.turn.U[1];
    const float t56 = d_v_turn * u_px_v_turn;
    const float t57 = t47 + u_px_v_turn * t56;
    const float t58 = 1.0f / t57;
    const float t59 = t56 * t58;
    const float t60 = d_v_turn * (t47 * t58);
    const float u_py_v_turn = kf->modes.turn.U[2];
    const float t61 = u_py_v_turn - u_px_v_turn * t49;
    const float t62 = t60 * t61;
    const float t63 = t51 + t61 * t62;
    const float t64 = 1.0f / t63;
    const float t65 = t62 * t64;
    const float d_v_next_turn = t60 * (t51 * t64);
    const float t66 = t49 + t59 * t61;
    const float u_py_v_next_turn = t61 - t61 * t53;
    const float t67 = t53 + t65 * u_py_v_next_turn;
    const float t68 = u_px_v_turn - u_px_v_turn * t54;
    const float t69 = t54 + t59 * t68;
    const float u_px_v_next_turn = t68 - t61 * t55;
    const float t70 = t55 + t65 * u_px_v_next_turn;
    const float d_th_turn = kf->modes.turn.D[3];
    const float u_px_th_turn = kf->modes.turn.U[3];
    const float t71 = d_th_turn * u_px_th_turn;
    const float s_x_turn = t57 + u_px_th_turn * t71;
    const float t72 = 1.0f / s_x_turn;
    const float t73 = t71 * t72;
    const float t74 = d_th_turn * (t57 * t72);
    const float u_py_th_turn = kf->modes.turn.U[4];
    const float t75 = u_py_th_turn - u_px_th_turn * t66;
    const float t76 = t74 * t75;
    const float s_y_turn = t63 + t75 * t76;
    const float t77 = 1.0f / s_y_turn;
    const float t78 = t76 * t77;
    const float d_th_next_turn = t74 * (t63 * t77);
    const float u_v_th_turn = kf->modes.turn.U[5];
    const float t79 = u_v_th_turn - u_px_th_turn * t59;
    const float u_v_th_next_turn = t79 - t75 * t65;
    const float u_py_th_next_turn = t75 - t75 * t67;
    const float t80 = u_px_th_turn - u_px_th_turn * t69;
    const float u_px_th_next_turn = t80 - t75 * t70;
    const float t81 = (t66 + t73 * t75) * y_x_turn;
    const float t82 = y_x_turn * (y_x_turn * t72);
    const float nu_y_turn = y_y_turn - t81;
    const float t83 = nu_y_turn * (nu_y_turn * t77);
    const float nis_turn = t82 + t83;

    /* turn: state and innovation squared */
    const float t84 = 0.5f * (t82 + logf(s_x_turn) + 1.837877f + t83 + logf(s_y_turn) + 1.837877f);
    const float l_turn = -t84;
    const float px_next_turn = px_turn + (t69 + t73 * t80) * y_x_turn
        + (t70 + t78 * u_px_th_next_turn) * nu_y_turn;
    const float py_next_turn = py_turn + t81 + (t67 + t78 * u_py_th_next_turn) * nu_y_turn;
    const float v_next_turn = kf->modes.turn.x[BEETLE_V] + (t59 + t73 * t79) * y_x_turn
        + (t65 + t78 * u_v_th_next_turn) * nu_y_turn;
    const float th_next_turn = kf->modes.turn.x[BEETLE_TH] + t73 * y_x_turn + t78 * nu_y_turn;
    const float t85 = beetle_wrap(th_next_turn, 3.1415927f);

    /* turn: guards */
    if (!beetle_finite(px_next_turn + py_next_turn + v_next_turn + th_next_turn + nis_turn
        + s_x_turn + s_y_turn)) {
        return BEETLE_NOT_FINITE;
    }
    if (!(s_x_run > 0.0f) || !(s_y_run > 0.0f)) { return BEETLE_NOT_POSITIVE; }
    if (!(s_x_turn > 0.0f) || !(s_y_turn > 0.0f)) { return BEETLE_NOT_POSITIVE; }
    const float mu_run = kf->mu[BEETLE_MODE_RUN];
    const float mu_turn = kf->mu[BEETLE_MODE_TURN];

    /* probabilities */
    const bool t86 = mu_run > 0.0f;
    const bool t87 = mu_turn > 0.0f;
    const float l_best = t87 && (!t86 || l_run < l_turn) ? l_turn : l_run;
    if (!beetle_finite(l_best)) { return BEETLE_NOT_FINITE; }
    const float t88 = t86 ? mu_run * expf(-(t41 + l_best)) : 0.0f;
    const float t89 = t87 ? mu_turn * expf(-(t84 + l_best)) : 0.0f;
    const float mu_sum = t88 + t89;
    if (!beetle_finite(mu_sum)) { return BEETLE_NOT_FINITE; }
    const float t90 = beetle_max(t88 / mu_sum, 1.0e-9f);
    const float t91 = beetle_max(t89 / mu_sum, 1.0e-9f);
    const float t92 = 1.0f / (t90 + t91);
    const float mu_run_next = t90 * t92;
    const float mu_turn_next = t91 * t92;

    /* combined state */
    const float th_base = mu_run_next < mu_turn_next ? t85 : t42;
    const float t93 = beetle_wrap(t42 - th_base, 3.1415927f);
    const float px_all = px_next_run + mu_turn_next * (px_next_turn - px_next_run);
    const float py_all = py_next_run + mu_turn_next * (py_next_turn - py_next_run);
    const float v_all = v_next_run + mu_turn_next * (v_next_turn - v_next_run);
    const float th_all = th_base + t93
        + mu_turn_next * (beetle_wrap(t85 - th_base, 3.1415927f) - t93);
    if (!beetle_finite(px_all + py_all + v_all + th_all + mu_run_next + mu_turn_next)) {
        return BEETLE_NOT_FINITE;
    }

    /* run: store */
    kf->modes.run.x[BEETLE_PX] = px_next_run;
    kf->modes.run.x[BEETLE_PY] = py_next_run;
    kf->modes.run.x[BEETLE_V] = v_next_run;
    kf->modes.run.x[BEETLE_TH] = t42;
    kf->modes.run.U[0] = u_px_py_next_run;
    kf->modes.run.U[1] = u_px_v_next_run;
    kf->modes.run.U[2] = u_py_v_next_run;
    kf->modes.run.U[3] = u_px_th_next_run;
    kf->modes.run.U[4] = u_py_th_next_run;
    kf->modes.run.U[5] = u_v_th_next_run;
    kf->modes.run.D[0] = d_px_next_run;
    kf->modes.run.D[1] = d_py_next_run;
    kf->modes.run.D[2] = d_v_next_run;
    kf->modes.run.D[3] = d_th_next_run;

    /* turn: store */
    kf->modes.turn.x[BEETLE_PX] = px_next_turn;
    kf->modes.turn.x[BEETLE_PY] = py_next_turn;
    kf->modes.turn.x[BEETLE_V] = v_next_turn;
    kf->modes.turn.x[BEETLE_TH] = t85;
    kf->modes.turn.U[0] = u_px_py_next_turn;
    kf->modes.turn.U[1] = u_px_v_next_turn;
    kf->modes.turn.U[2] = u_py_v_next_turn;
    kf->modes.turn.U[3] = u_px_th_next_turn;
    kf->modes.turn.U[4] = u_py_th_next_turn;
    kf->modes.turn.U[5] = u_v_th_next_turn;
    kf->modes.turn.D[0] = d_px_next_turn;
    kf->modes.turn.D[1] = d_py_next_turn;
    kf->modes.turn.D[2] = d_v_next_turn;
    kf->modes.turn.D[3] = d_th_next_turn;

    /* store: the bank */
    kf->mu[BEETLE_MODE_RUN] = mu_run_next;
    kf->mu[BEETLE_MODE_TURN] = mu_turn_next;
    kf->x[BEETLE_PX] = px_all;
    kf->x[BEETLE_PY] = py_all;
    kf->x[BEETLE_V] = v_all;
    kf->x[BEETLE_TH] = beetle_wrap(th_all, 3.1415927f);
    kf->modes.run.nis = nis_run;
    kf->modes.turn.nis = nis_turn;
    kf->nis = beetle_min(nis_run, nis_turn);
    return BEETLE_OK;
}

beetle_status_t beetle_set_state(beetle_t *kf, const beetle_real_t x[4])
{
    if (kf == NULL || x == NULL) { return BEETLE_NULL_ARGUMENT; }
    if (!beetle_finite(x[BEETLE_PX])) { return BEETLE_NOT_FINITE; }
    if (!beetle_finite(x[BEETLE_PY])) { return BEETLE_NOT_FINITE; }
    if (!beetle_finite(x[BEETLE_V])) { return BEETLE_NOT_FINITE; }
    if (!beetle_finite(x[BEETLE_TH])) { return BEETLE_NOT_FINITE; }
    const float t0 = beetle_wrap(x[BEETLE_TH], 3.1415927f);
    kf->x[BEETLE_PX] = x[BEETLE_PX];
    kf->x[BEETLE_PY] = x[BEETLE_PY];
    kf->x[BEETLE_V] = x[BEETLE_V];
    kf->x[BEETLE_TH] = t0;
    kf->modes.run.x[BEETLE_PX] = x[BEETLE_PX];
    kf->modes.run.x[BEETLE_PY] = x[BEETLE_PY];
    kf->modes.run.x[BEETLE_V] = x[BEETLE_V];
    kf->modes.run.x[BEETLE_TH] = t0;
    kf->modes.turn.x[BEETLE_PX] = x[BEETLE_PX];
    kf->modes.turn.x[BEETLE_PY] = x[BEETLE_PY];
    kf->modes.turn.x[BEETLE_V] = x[BEETLE_V];
    kf->modes.turn.x[BEETLE_TH] = t0;
    return BEETLE_OK;
}

beetle_status_t beetle_set_covariance(beetle_t *kf, const beetle_real_t P[16])
{
    if (kf == NULL || P == NULL) { return BEETLE_NULL_ARGUMENT; }
    float p_run[10];
    float w_run[10];

    /* run: the upper triangle, column by column */
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value_run = P[4 * i + j];
            p_run[j * (j + 1) / 2 + i] = value_run;
            w_run[j * (j + 1) / 2 + i] = value_run;
            if (!beetle_finite(value_run)) { return BEETLE_NOT_FINITE; }
        }
    }

    /* run: factor it: a pivot is zero up to round-off, or positive */
    for (int j = 4 - 1; j >= 0; j--) {
        const float round_off_run = 4.7683716e-7f * p_run[j * (j + 1) / 2 + j];
        const float pivot_run = w_run[j * (j + 1) / 2 + j];
        if (!(-round_off_run <= pivot_run)) { return BEETLE_NOT_POSITIVE; }
        const float d_run = round_off_run < pivot_run ? pivot_run : 0.0f;
        w_run[j * (j + 1) / 2 + j] = d_run;
        for (int i = j - 1; i >= 0; i--) {
            const float rest_run = w_run[j * (j + 1) / 2 + i];
            if (d_run <= 0.0f && 1.9073486e-6f * p_run[j * (j + 1) / 2 + j]
                * p_run[i * (i + 1) / 2 + i] < rest_run * rest_run) {
                return BEETLE_NOT_POSITIVE;
            }
            const float u_run = d_run > 0.0f ? rest_run / d_run : 0.0f;
            for (int k = 0; k < i + 1; k++) {
                w_run[i * (i + 1) / 2 + k] = w_run[i * (i + 1) / 2 + k]
                    - u_run * w_run[j * (j + 1) / 2 + k];
            }
            w_run[j * (j + 1) / 2 + i] = u_run;
        }
    }

    /* store */
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < j; i++) {
            kf->modes.run.U[j * (j - 1) / 2 + i] = w_run[j * (j + 1) / 2 + i];
        }
        kf->modes.run.D[j] = w_run[j * (j + 1) / 2 + j];
    }
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < j; i++) {
            kf->modes.turn.U[j * (j - 1) / 2 + i] = w_run[j * (j + 1) / 2 + i];
        }
        kf->modes.turn.D[j] = w_run[j * (j + 1) / 2 + j];
    }
    return BEETLE_OK;
}

void beetle_get_covariance(const beetle_t *kf, beetle_real_t P[16])
{
    if (kf == NULL || P == NULL) { return; }
    const float mu_run = kf->mu[BEETLE_MODE_RUN];
    const float mu_turn = kf->mu[BEETLE_MODE_TURN];
    float d_run[4];
    float d_turn[4];
    const float t0 = kf->modes.turn.x[BEETLE_PX] - kf->modes.run.x[BEETLE_PX];
    const float shift_px = mu_turn * t0;
    d_run[0] = -shift_px;
    d_turn[0] = t0 - shift_px;
    const float t1 = kf->modes.turn.x[BEETLE_PY] - kf->modes.run.x[BEETLE_PY];
    const float shift_py = mu_turn * t1;
    d_run[1] = -shift_py;
    d_turn[1] = t1 - shift_py;
    const float t2 = kf->modes.turn.x[BEETLE_V] - kf->modes.run.x[BEETLE_V];
    const float shift_v = mu_turn * t2;
    d_run[2] = -shift_v;
    d_turn[2] = t2 - shift_v;
    const float th_base = mu_run < mu_turn ? kf->modes.turn.x[BEETLE_TH]
        : kf->modes.run.x[BEETLE_TH];
    const float t3 = beetle_wrap(kf->modes.run.x[BEETLE_TH] - th_base, 3.1415927f);
    const float t4 = beetle_wrap(kf->modes.turn.x[BEETLE_TH] - th_base, 3.1415927f);
    const float shift_th = mu_run * t3 + mu_turn * t4;
    d_run[3] = t3 - shift_th;
    d_turn[3] = t4 - shift_th;

    /* the spread between the modes */
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = mu_run * (d_run[i] * d_run[j]) + mu_turn * (d_turn[i] * d_turn[j]);
            P[4 * i + j] = value;
            P[4 * j + i] = value;
        }
    }

    /* run: its own */
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < j + 1; i++) {
            float sum_run = kf->modes.run.D[j];
            if (i < j) {
                sum_run = sum_run * kf->modes.run.U[j * (j - 1) / 2 + i];
            }
            for (int k = j + 1; k < 4; k++) {
                sum_run = sum_run + kf->modes.run.U[k * (k - 1) / 2 + i] * kf->modes.run.D[k]
                    * kf->modes.run.U[k * (k - 1) / 2 + j];
            }
            const float value_run = sum_run;
            const float sum_run_1 = P[4 * i + j] + mu_run * value_run;
            P[4 * i + j] = sum_run_1;
            P[4 * j + i] = sum_run_1;
        }
    }

    /* turn: its own */
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < j + 1; i++) {
            float sum_turn = kf->modes.turn.D[j];
            if (i < j) {
                sum_turn = sum_turn * kf->modes.turn.U[j * (j - 1) / 2 + i];
            }
            for (int k = j + 1; k < 4; k++) {
                sum_turn = sum_turn + kf->modes.turn.U[k * (k - 1) / 2 + i] * kf->modes.turn.D[k]
                    * kf->modes.turn.U[k * (k - 1) / 2 + j];
            }
            const float value_turn = sum_turn;
            const float sum_turn_1 = P[4 * i + j] + mu_turn * value_turn;
            P[4 * i + j] = sum_turn_1;
            P[4 * j + i] = sum_turn_1;
        }
    }
}
/* kfgen: body 1f031436d17e7eb4d38b9c34a0ac4fae */
