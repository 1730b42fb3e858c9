/* kfgen build bicycle.yaml */
#include "bicycle.h"

#include <math.h>

#if defined(__FAST_MATH__) || defined(_M_FP_FAST)
#error "bicycle tests for NaN and infinity, which -ffast-math removes"
#elif defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "bicycle tests for NaN and infinity, which -ffinite-math-only removes"
#endif

/* false for NaN and for infinity, by their bits: no compiler may take these for granted */
static bool bicycle_finite(float a)
{
    const uint32_t exponent = 0x7f800000u;
    union { float value; uint32_t bits; } view;
    view.value = a;
    return (view.bits & exponent) != exponent;
}

static float bicycle_max(float a, float b)
{
    return b > a ? b : a;
}

/* a in (-half, half], by whole turns of 2 half */
static float bicycle_wrap(float a, float half)
{
    if (a > half || a <= -half) {
        a -= (half + half) * ceilf((a - half) / (half + half));
        if (a > half || a <= -half) { a = half; } /* the last bit of a turn */
    }
    return a;
}

bicycle_status_t bicycle_init(bicycle_t *kf)
{
    if (kf == NULL) { return BICYCLE_NULL_ARGUMENT; }
    kf->x[BICYCLE_X] = 0.0f;
    kf->x[BICYCLE_Y] = 0.0f;
    kf->x[BICYCLE_SPEED] = 3.0f;
    kf->x[BICYCLE_HEADING] = 0.0f;
    kf->x[BICYCLE_TURN] = 0.0f;
    for (int i = 0; i < 10; i++) {
        kf->U[i] = 0.0f;
    }
    kf->D[0] = 25.0f;
    kf->D[1] = 25.0f;
    kf->D[2] = 9.0f;
    kf->D[3] = 1.0f;
    kf->D[4] = 0.09f;
    kf->nis = 0.0f;
    kf->initialized = false;
    return BICYCLE_OK;
}

/* x <- f(x, u, w), in place */
static void bicycle_f(bicycle_real_t step, bicycle_real_t x[5])
{
    const float speed = x[BICYCLE_SPEED];
    const float heading = x[BICYCLE_HEADING];
    const float turn = x[BICYCLE_TURN];
    const float t0 = heading + turn * (0.5f * step);
    const float cos_heading = cosf(t0);
    const float sin_heading = sinf(t0);
    x[BICYCLE_X] = x[BICYCLE_X] + speed * cos_heading * step;
    x[BICYCLE_Y] = x[BICYCLE_Y] + speed * sin_heading * step;
    x[BICYCLE_HEADING] = heading + turn * step;
}

/* what radar measures at x */
static void bicycle_h_radar(const bicycle_real_t x[5], bicycle_real_t z[3])
{
    const float x_1 = x[BICYCLE_X];
    const float y = x[BICYCLE_Y];
    const float speed = x[BICYCLE_SPEED];
    const float heading = x[BICYCLE_HEADING];
    const float reach = sqrtf(x_1 * x_1 + y * y);
    z[0] = reach;
    z[1] = atan2f(y, x_1);
    const float cos_heading = cosf(heading);
    const float sin_heading = sinf(heading);
    z[2] = speed * (x_1 * cos_heading + y * sin_heading) / bicycle_max(reach, 0.01f);
}

/* what the points predict of radar: mean, covariance, covariances with the state */
static void bicycle_see_radar(const bicycle_real_t x[5],
                              const bicycle_real_t cloud[50],
                              bicycle_real_t seen[24])
{
    const float x_1 = x[BICYCLE_X];
    const float y = x[BICYCLE_Y];
    const float speed = x[BICYCLE_SPEED];
    const float heading = x[BICYCLE_HEADING];
    const float turn = x[BICYCLE_TURN];
    float point[5];
    float z[3];
    point[0] = x_1;
    point[1] = y;
    point[2] = speed;
    point[3] = heading;
    point[4] = turn;
    bicycle_h_radar(point, z);
    const float range_centre = z[0];
    const float bearing_centre = z[1];
    const float range_rate_centre = z[2];
    float shift_range = 0.0f;
    float shift_bearing = 0.0f;
    float shift_range_rate = 0.0f;
    float s_range_range = 0.0f;
    float s_range_bearing = 0.0f;
    float s_bearing_bearing = 0.0f;
    float s_range_range_rate = 0.0f;
    float s_bearing_range_rate = 0.0f;
    float s_range_rate_range_rate = 0.0f;
    float c_x_range = 0.0f;
    float c_x_bearing = 0.0f;
    float c_x_range_rate = 0.0f;
    float c_y_range = 0.0f;
    float c_y_bearing = 0.0f;
    float c_y_range_rate = 0.0f;
    float c_speed_range = 0.0f;
    float c_speed_bearing = 0.0f;
    float c_speed_range_rate = 0.0f;
    float c_heading_range = 0.0f;
    float c_heading_bearing = 0.0f;
    float c_heading_range_rate = 0.0f;
    float c_turn_range = 0.0f;
    float c_turn_bearing = 0.0f;
    float c_turn_range_rate = 0.0f;

    /* points through h */
    for (int k = 0; k < 10; k++) {
        point[0] = x_1 + cloud[5 * k];
        point[1] = y + cloud[5 * k + 1];
        point[2] = speed + cloud[5 * k + 2];
        point[3] = heading + cloud[5 * k + 3];
        point[4] = turn + cloud[5 * k + 4];
        bicycle_h_radar(point, z);
        const float dz_range = z[0] - range_centre;
        const float dz_bearing = bicycle_wrap(z[1] - bearing_centre, 3.1415927f);
        const float dz_range_rate = z[2] - range_rate_centre;
        shift_range = shift_range + dz_range;
        shift_bearing = shift_bearing + dz_bearing;
        shift_range_rate = shift_range_rate + dz_range_rate;
        s_range_range = s_range_range + dz_range * dz_range;
        s_range_bearing = s_range_bearing + dz_range * dz_bearing;
        s_bearing_bearing = s_bearing_bearing + dz_bearing * dz_bearing;
        s_range_range_rate = s_range_range_rate + dz_range * dz_range_rate;
        s_bearing_range_rate = s_bearing_range_rate + dz_bearing * dz_range_rate;
        s_range_rate_range_rate = s_range_rate_range_rate + dz_range_rate * dz_range_rate;
        c_x_range = c_x_range + cloud[5 * k] * dz_range;
        c_x_bearing = c_x_bearing + cloud[5 * k] * dz_bearing;
        c_x_range_rate = c_x_range_rate + cloud[5 * k] * dz_range_rate;
        c_y_range = c_y_range + cloud[5 * k + 1] * dz_range;
        c_y_bearing = c_y_bearing + cloud[5 * k + 1] * dz_bearing;
        c_y_range_rate = c_y_range_rate + cloud[5 * k + 1] * dz_range_rate;
        c_speed_range = c_speed_range + cloud[5 * k + 2] * dz_range;
        c_speed_bearing = c_speed_bearing + cloud[5 * k + 2] * dz_bearing;
        c_speed_range_rate = c_speed_range_rate + cloud[5 * k + 2] * dz_range_rate;
        c_heading_range = c_heading_range + cloud[5 * k + 3] * dz_range;
        c_heading_bearing = c_heading_bearing + cloud[5 * k + 3] * dz_bearing;
        c_heading_range_rate = c_heading_range_rate + cloud[5 * k + 3] * dz_range_rate;
        c_turn_range = c_turn_range + cloud[5 * k + 4] * dz_range;
        c_turn_bearing = c_turn_bearing + cloud[5 * k + 4] * dz_bearing;
        c_turn_range_rate = c_turn_range_rate + cloud[5 * k + 4] * dz_range_rate;
    }
    const float mean_range = 0.4f * shift_range;
    const float mean_bearing = 0.4f * shift_bearing;
    const float mean_range_rate = 0.4f * shift_range_rate;
    seen[0] = range_centre + mean_range;
    seen[1] = bearing_centre + mean_bearing;
    seen[2] = range_rate_centre + mean_range_rate;
    seen[3] = 0.4f * s_range_range + 1.75f * (mean_range * mean_range);
    seen[4] = 0.4f * s_range_bearing + 1.75f * (mean_range * mean_bearing);
    seen[5] = 0.4f * s_bearing_bearing + 1.75f * (mean_bearing * mean_bearing);
    seen[6] = 0.4f * s_range_range_rate + 1.75f * (mean_range * mean_range_rate);
    seen[7] = 0.4f * s_bearing_range_rate + 1.75f * (mean_bearing * mean_range_rate);
    seen[8] = 0.4f * s_range_rate_range_rate + 1.75f * (mean_range_rate * mean_range_rate);
    seen[9] = 0.4f * c_x_range;
    seen[10] = 0.4f * c_x_bearing;
    seen[11] = 0.4f * c_x_range_rate;
    seen[12] = 0.4f * c_y_range;
    seen[13] = 0.4f * c_y_bearing;
    seen[14] = 0.4f * c_y_range_rate;
    seen[15] = 0.4f * c_speed_range;
    seen[16] = 0.4f * c_speed_bearing;
    seen[17] = 0.4f * c_speed_range_rate;
    seen[18] = 0.4f * c_heading_range;
    seen[19] = 0.4f * c_heading_bearing;
    seen[20] = 0.4f * c_heading_range_rate;
    seen[21] = 0.4f * c_turn_range;
    seen[22] = 0.4f * c_turn_bearing;
    seen[23] = 0.4f * c_turn_range_rate;
}

bicycle_status_t bicycle_predict(bicycle_t *kf, bicycle_real_t dt)
{
    if (kf == NULL) { return BICYCLE_NULL_ARGUMENT; }
    bicycle_status_t flags = BICYCLE_OK;
    if (!bicycle_finite(dt)) { return BICYCLE_NOT_FINITE; }
    const bool t10 = dt < 0.001f;
    if (t10) { flags |= BICYCLE_DT_CLAMPED; }
    const bool t11 = dt > 1.0f;
    if (t11) { flags |= BICYCLE_DT_CLAMPED; }
    const float step = t11 ? 1.0f : (t10 ? 0.001f : dt);
    const float speed = kf->x[BICYCLE_SPEED];
    const float heading = kf->x[BICYCLE_HEADING];
    const float turn = kf->x[BICYCLE_TURN];

    /* sigma points */
    float points[50];
    const float d_y_1 = kf->D[1];
    const float t12 = sqrtf(d_y_1);
    const float d_speed_1 = kf->D[2];
    const float t13 = sqrtf(d_speed_1);
    const float d_heading_1 = kf->D[3];
    const float t14 = sqrtf(d_heading_1);
    const float d_turn_1 = kf->D[4];
    const float t15 = sqrtf(d_turn_1);
    const float d_x_1 = kf->D[0];
    points[0] = 1.118034f * sqrtf(d_x_1);
    points[1] = 0.0f;
    points[2] = 0.0f;
    points[3] = 0.0f;
    points[4] = 0.0f;
    const float u_x_y_1 = kf->U[0];
    points[10] = u_x_y_1 * t12 * 1.118034f;
    points[11] = 1.118034f * t12;
    points[12] = 0.0f;
    points[13] = 0.0f;
    points[14] = 0.0f;
    const float u_x_speed_1 = kf->U[1];
    points[20] = u_x_speed_1 * t13 * 1.118034f;
    const float u_y_speed_1 = kf->U[2];
    points[21] = u_y_speed_1 * t13 * 1.118034f;
    points[22] = 1.118034f * t13;
    points[23] = 0.0f;
    points[24] = 0.0f;
    const float u_x_heading_1 = kf->U[3];
    points[30] = u_x_heading_1 * t14 * 1.118034f;
    const float u_y_heading_1 = kf->U[4];
    points[31] = u_y_heading_1 * t14 * 1.118034f;
    const float u_speed_heading_1 = kf->U[5];
    points[32] = u_speed_heading_1 * t14 * 1.118034f;
    points[33] = 1.118034f * t14;
    points[34] = 0.0f;
    const float u_x_turn_1 = kf->U[6];
    points[40] = u_x_turn_1 * t15 * 1.118034f;
    const float u_y_turn_1 = kf->U[7];
    points[41] = u_y_turn_1 * t15 * 1.118034f;
    const float u_speed_turn_1 = kf->U[8];
    points[42] = u_speed_turn_1 * t15 * 1.118034f;
    const float u_heading_turn_1 = kf->U[9];
    points[43] = u_heading_turn_1 * t15 * 1.118034f;
    points[44] = 1.118034f * t15;
    for (int j = 0; j < 5; j++) {
        const float part_0 = points[10 * j];
        points[10 * j] = kf->x[BICYCLE_X] + part_0;
        points[10 * j + 5] = kf->x[BICYCLE_X] - part_0;
        const float part_1 = points[10 * j + 1];
        points[10 * j + 1] = kf->x[BICYCLE_Y] + part_1;
        points[10 * j + 6] = kf->x[BICYCLE_Y] - part_1;
        const float part_2 = points[10 * j + 2];
        points[10 * j + 2] = speed + part_2;
        points[10 * j + 7] = speed - part_2;
        const float part_3 = points[10 * j + 3];
        points[10 * j + 3] = heading + part_3;
        points[10 * j + 8] = heading - part_3;
        const float part_4 = points[10 * j + 4];
        points[10 * j + 4] = turn + part_4;
        points[10 * j + 9] = turn - part_4;
    }
    float centre[5];
    centre[0] = kf->x[BICYCLE_X];
    centre[1] = kf->x[BICYCLE_Y];
    centre[2] = speed;
    centre[3] = heading;
    centre[4] = turn;
    bicycle_f(step, centre);
    const float x_centre = centre[0];
    const float y_centre = centre[1];
    const float speed_centre = centre[2];
    const float heading_centre = centre[3];
    const float turn_centre = centre[4];
    float shift_x = 0.0f;
    float shift_y = 0.0f;
    float shift_speed = 0.0f;
    float shift_heading = 0.0f;
    float shift_turn = 0.0f;
    float u_x_y = 0.0f;
    float u_x_speed = 0.0f;
    float u_y_speed = 0.0f;
    float u_x_heading = 0.0f;
    float u_y_heading = 0.0f;
    float u_speed_heading = 0.0f;
    float u_x_turn = 0.0f;
    float u_y_turn = 0.0f;
    float u_speed_turn = 0.0f;
    float u_heading_turn = 0.0f;
    float d_x = 0.0f;
    float d_y = 0.0f;
    float d_speed = 0.0144f * step;
    float d_heading = 0.0f;
    float d_turn = 0.0121f * step;

    /* points through f, and their deviations */
    for (int k = 0; k < 10; k++) {
        bicycle_f(step, &points[5 * k]);
        const float dev_x = points[5 * k] - x_centre;
        const float dev_y = points[5 * k + 1] - y_centre;
        const float dev_speed = points[5 * k + 2] - speed_centre;
        const float dev_heading = points[5 * k + 3] - heading_centre;
        const float dev_turn = points[5 * k + 4] - turn_centre;
        shift_x = shift_x + dev_x;
        shift_y = shift_y + dev_y;
        shift_speed = shift_speed + dev_speed;
        shift_heading = shift_heading + dev_heading;
        shift_turn = shift_turn + dev_turn;
        const float t26 = 0.4f * dev_turn;
        const float t27 = d_turn + dev_turn * t26;
        const bool t28 = t27 > 0.0f;
        const float t29 = t28 ? t26 / t27 : 0.0f;
        const float t30 = t28 ? d_turn / t27 : 1.0f;
        const float t31 = 0.4f * t30;
        const float t21 = t30 * u_x_turn + t29 * dev_x;
        const float t32 = dev_x - dev_turn * u_x_turn;
        const float t22 = t30 * u_y_turn + t29 * dev_y;
        const float t33 = dev_y - dev_turn * u_y_turn;
        const float t23 = t30 * u_speed_turn + t29 * dev_speed;
        const float t34 = dev_speed - dev_turn * u_speed_turn;
        const float t24 = t30 * u_heading_turn + t29 * dev_heading;
        const float t35 = dev_heading - dev_turn * u_heading_turn;
        const float t36 = t31 * t35;
        const float t37 = d_heading + t35 * t36;
        const bool t38 = t37 > 0.0f;
        const float t39 = t38 ? t36 / t37 : 0.0f;
        const float t40 = t38 ? d_heading / t37 : 1.0f;
        const float t41 = t31 * t40;
        const float t18 = t40 * u_x_heading + t39 * t32;
        const float t42 = t32 - t35 * u_x_heading;
        const float t19 = t40 * u_y_heading + t39 * t33;
        const float t43 = t33 - t35 * u_y_heading;
        const float t20 = t40 * u_speed_heading + t39 * t34;
        const float t44 = t34 - t35 * u_speed_heading;
        const float t45 = t41 * t44;
        const float t46 = d_speed + t44 * t45;
        const bool t47 = t46 > 0.0f;
        const float t48 = t47 ? t45 / t46 : 0.0f;
        const float t49 = t47 ? d_speed / t46 : 1.0f;
        const float t50 = t41 * t49;
        const float t16 = t49 * u_x_speed + t48 * t42;
        const float t51 = t42 - t44 * u_x_speed;
        const float t17 = t49 * u_y_speed + t48 * t43;
        const float t52 = t43 - t44 * u_y_speed;
        const float t53 = t50 * t52;
        const float t54 = d_y + t52 * t53;
        const bool t55 = t54 > 0.0f;
        const float t56 = t55 ? d_y / t54 : 1.0f;
        const float t57 = t51 - t52 * u_x_y;
        const float t25 = d_x + t57 * (t50 * t56 * t57);
        u_x_y = t56 * u_x_y + (t55 ? t53 / t54 : 0.0f) * t51;
        u_x_speed = t16;
        u_y_speed = t17;
        u_x_heading = t18;
        u_y_heading = t19;
        u_speed_heading = t20;
        u_x_turn = t21;
        u_y_turn = t22;
        u_speed_turn = t23;
        u_heading_turn = t24;
        d_x = t25;
        d_y = t54;
        d_speed = t46;
        d_heading = t37;
        d_turn = t27;
    }
    const float mean_x = 0.4f * shift_x;
    const float mean_y = 0.4f * shift_y;
    const float mean_speed = 0.4f * shift_speed;
    const float mean_heading = 0.4f * shift_heading;
    const float mean_turn = 0.4f * shift_turn;
    const float t58 = 0.7f * shift_turn;
    const float t59 = d_turn + mean_turn * t58;
    const bool t60 = t59 > 0.0f;
    const float t61 = t60 ? t58 / t59 : 0.0f;
    const float t62 = t60 ? d_turn / t59 : 1.0f;
    const float t63 = 1.75f * t62;
    const float t5 = t62 * u_x_turn + t61 * mean_x;
    const float t64 = mean_x - mean_turn * u_x_turn;
    const float t6 = t62 * u_y_turn + t61 * mean_y;
    const float t65 = mean_y - mean_turn * u_y_turn;
    const float t7 = t62 * u_speed_turn + t61 * mean_speed;
    const float t66 = mean_speed - mean_turn * u_speed_turn;
    const float t8 = t62 * u_heading_turn + t61 * mean_heading;
    const float t67 = mean_heading - mean_turn * u_heading_turn;
    const float t68 = t63 * t67;
    const float t69 = d_heading + t67 * t68;
    const bool t70 = t69 > 0.0f;
    const float t71 = t70 ? t68 / t69 : 0.0f;
    const float t72 = t70 ? d_heading / t69 : 1.0f;
    const float t73 = t63 * t72;
    const float t2 = t72 * u_x_heading + t71 * t64;
    const float t74 = t64 - t67 * u_x_heading;
    const float t3 = t72 * u_y_heading + t71 * t65;
    const float t75 = t65 - t67 * u_y_heading;
    const float t4 = t72 * u_speed_heading + t71 * t66;
    const float t76 = t66 - t67 * u_speed_heading;
    const float t77 = t73 * t76;
    const float t78 = d_speed + t76 * t77;
    const bool t79 = t78 > 0.0f;
    const float t80 = t79 ? t77 / t78 : 0.0f;
    const float t81 = t79 ? d_speed / t78 : 1.0f;
    const float t82 = t73 * t81;
    const float t0 = t81 * u_x_speed + t80 * t74;
    const float t83 = t74 - t76 * u_x_speed;
    const float t1 = t81 * u_y_speed + t80 * t75;
    const float t84 = t75 - t76 * u_y_speed;
    const float t85 = t82 * t84;
    const float t86 = d_y + t84 * t85;
    const bool t87 = t86 > 0.0f;
    const float t88 = t87 ? d_y / t86 : 1.0f;
    const float t89 = t83 - t84 * u_x_y;
    const float t9 = d_x + t89 * (t82 * t88 * t89);
    u_x_y = t88 * u_x_y + (t87 ? t85 / t86 : 0.0f) * t83;
    u_x_speed = t0;
    u_y_speed = t1;
    u_x_heading = t2;
    u_y_heading = t3;
    u_speed_heading = t4;
    u_x_turn = t5;
    u_y_turn = t6;
    u_speed_turn = t7;
    u_heading_turn = t8;
    d_x = t9;
    d_y = t86;
    d_speed = t78;
    d_heading = t69;
    d_turn = t59;
    const float u_x_y_next = u_x_y;
    const float u_x_speed_next = u_x_speed;
    const float u_x_heading_next = u_x_heading;
    const float u_x_turn_next = u_x_turn;
    const float u_y_speed_next = u_y_speed;
    const float u_y_heading_next = u_y_heading;
    const float u_y_turn_next = u_y_turn;
    const float u_speed_heading_next = u_speed_heading;
    const float u_speed_turn_next = u_speed_turn;
    const float u_heading_turn_next = u_heading_turn;
    const float d_x_next = d_x;
    const float d_y_next = d_y;
    const float d_speed_next = d_speed;
    const float d_heading_next = d_heading;
    const float d_turn_next = d_turn;
    const float x_next = x_centre + mean_x;
    const float y_next = y_centre + mean_y;
    const float speed_next = speed_centre + mean_speed;
    const float heading_next = heading_centre + mean_heading;
    const float turn_next = turn_centre + mean_turn;

    /* guards */
    if (!bicycle_finite(x_next + y_next + speed_next + heading_next + turn_next + d_x_next
        + d_y_next + d_speed_next + d_heading_next + d_turn_next)) {
        return BICYCLE_NOT_FINITE;
    }

    /* store */
    kf->x[BICYCLE_X] = x_next;
    kf->x[BICYCLE_Y] = y_next;
    kf->x[BICYCLE_SPEED] = speed_next;
    kf->x[BICYCLE_HEADING] = bicycle_wrap(heading_next, 3.1415927f);
    kf->x[BICYCLE_TURN] = turn_next;
    kf->U[0] = u_x_y_next;
    kf->U[1] = u_x_speed_next;
    kf->U[2] = u_y_speed_next;
    kf->U[3] = u_x_heading_next;
    kf->U[4] = u_y_heading_next;
    kf->U[5] = u_speed_heading_next;
    kf->U[6] = u_x_turn_next;
    kf->U[7] = u_y_turn_next;
    kf->U[8] = u_speed_turn_next;
    kf->U[9] = u_heading_turn_next;
    kf->D[0] = d_x_next;
    kf->D[1] = d_y_next;
    kf->D[2] = d_speed_next;
    kf->D[3] = d_heading_next;
    kf->D[4] = d_turn_next;
    return flags;
}

bicycle_status_t bicycle_update_lidar(bicycle_t *kf, const bicycle_lidar_t *z)
{
    if (kf == NULL || z == NULL) { return BICYCLE_NULL_ARGUMENT; }

    /* the first measurement sets the state */
    if (!bicycle_finite(z->x + z->y)) { return BICYCLE_NOT_FINITE; }
    if (!kf->initialized) {
        kf->x[BICYCLE_X] = z->x;
        kf->x[BICYCLE_Y] = z->y;
        kf->nis = 0.0f;
        kf->initialized = true;
        return BICYCLE_OK;
    }

    /* innovation */
    const float x = kf->x[BICYCLE_X];
    const float y = kf->x[BICYCLE_Y];
    const float y_x = z->x - x;
    const float y_y = z->y - y;

    /* gain and covariance: x, y */
    const float d_x = kf->D[0];
    const float t0 = 0.0225f + d_x;
    const float t1 = 1.0f / t0;
    const float t2 = d_x * t1;
    const float d_x_next = d_x * (0.0225f * t1);
    const float d_y = kf->D[1];
    const float u_x_y = kf->U[0];
    const float t3 = d_y * u_x_y;
    const float t4 = t0 + u_x_y * t3;
    const float t5 = 1.0f / t4;
    const float t6 = t3 * t5;
    const float t7 = d_y * (t0 * t5);
    const float t8 = 0.0225f + t7;
    const float t9 = 1.0f / t8;
    const float t10 = t7 * t9;
    const float d_y_next = t7 * (0.0225f * t9);
    const float u_x_y_next = u_x_y - u_x_y * t2;
    const float t11 = t2 + t6 * u_x_y_next;
    const float t12 = t10 * u_x_y_next;
    const float d_speed = kf->D[2];
    const float u_x_speed = kf->U[1];
    const float t13 = d_speed * u_x_speed;
    const float t14 = t4 + u_x_speed * t13;
    const float t15 = 1.0f / t14;
    const float t16 = t13 * t15;
    const float t17 = d_speed * (t4 * t15);
    const float u_y_speed = kf->U[2];
    const float t18 = u_y_speed - u_x_speed * t6;
    const float t19 = t17 * t18;
    const float t20 = t8 + t18 * t19;
    const float t21 = 1.0f / t20;
    const float t22 = t19 * t21;
    const float d_speed_next = t17 * (t8 * t21);
    const float t23 = t6 + t16 * t18;
    const float u_y_speed_next = t18 - t18 * t10;
    const float t24 = t10 + t22 * u_y_speed_next;
    const float t25 = u_x_speed - u_x_speed * t11;
    const float t26 = t11 + t16 * t25;
    const float u_x_speed_next = t25 - t18 * t12;
    const float t27 = t12 + t22 * u_x_speed_next;
    const float d_heading = kf->D[3];
    const float u_x_heading = kf->U[3];
    const float t28 = d_heading * u_x_heading;
    const float t29 = t14 + u_x_heading * t28;
    const float t30 = 1.0f / t29;
    const float t31 = t28 * t30;
    const float t32 = d_heading * (t14 * t30);
    const float u_y_heading = kf->U[4];
    const float t33 = u_y_heading - u_x_heading * t23;
    const float t34 = t32 * t33;
    const float t35 = t20 + t33 * t34;
    const float t36 = 1.0f / t35;
    const float t37 = t34 * t36;
    const float d_heading_next = t32 * (t20 * t36);
    const float u_speed_heading = kf->U[5];
    const float t38 = u_speed_heading - u_x_heading * t16;
    const float t39 = t16 + t31 * t38;
    const float u_speed_heading_next = t38 - t33 * t22;
    const float t40 = t22 + t37 * u_speed_heading_next;
    const float t41 = t23 + t31 * t33;
    const float u_y_heading_next = t33 - t33 * t24;
    const float t42 = t24 + t37 * u_y_heading_next;
    const float t43 = u_x_heading - u_x_heading * t26;
    const float t44 = t26 + t31 * t43;
    const float u_x_heading_next = t43 - t33 * t27;
    const float t45 = t27 + t37 * u_x_heading_next;
    const float d_turn = kf->D[4];
    const float u_x_turn = kf->U[6];
    const float t46 = d_turn * u_x_turn;
    const float s_x = t29 + u_x_turn * t46;
    const float t47 = 1.0f / s_x;
    const float t48 = t46 * t47;
    const float t49 = d_turn * (t29 * t47);
    const float u_y_turn = kf->U[7];
    const float t50 = u_y_turn - u_x_turn * t41;
    const float t51 = t49 * t50;
    const float s_y = t35 + t50 * t51;
    const float t52 = 1.0f / s_y;
    const float t53 = t51 * t52;
    const float d_turn_next = t49 * (t35 * t52);
    const float u_heading_turn = kf->U[9];
    const float t54 = u_heading_turn - u_x_turn * t31;
    const float u_heading_turn_next = t54 - t50 * t37;
    const float u_speed_turn = kf->U[8];
    const float t55 = u_speed_turn - u_x_turn * t39;
    const float u_speed_turn_next = t55 - t50 * t40;
    const float u_y_turn_next = t50 - t50 * t42;
    const float t56 = u_x_turn - u_x_turn * t44;
    const float u_x_turn_next = t56 - t50 * t45;
    const float t57 = (t41 + t48 * t50) * y_x;
    const float nu_y = y_y - t57;
    const float nis = y_x * (y_x * t47) + nu_y * (nu_y * t52);

    /* state and innovation squared */
    const float x_next = x + (t44 + t48 * t56) * y_x + (t45 + t53 * u_x_turn_next) * nu_y;
    const float y_next = y + t57 + (t42 + t53 * u_y_turn_next) * nu_y;
    const float speed_next = kf->x[BICYCLE_SPEED] + (t39 + t48 * t55) * y_x
        + (t40 + t53 * u_speed_turn_next) * nu_y;
    const float heading_next = kf->x[BICYCLE_HEADING] + (t31 + t48 * t54) * y_x
        + (t37 + t53 * u_heading_turn_next) * nu_y;
    const float turn_next = kf->x[BICYCLE_TURN] + t48 * y_x + t53 * nu_y;

    /* guards */
    if (!bicycle_finite(x_next + y_next + speed_next + heading_next + turn_next + nis + s_x
        + s_y)) {
        return BICYCLE_NOT_FINITE;
    }
    if (!(s_x > 0.0f) || !(s_y > 0.0f)) { return BICYCLE_NOT_POSITIVE; }

    /* store */
    kf->x[BICYCLE_X] = x_next;
    kf->x[BICYCLE_Y] = y_next;
    kf->x[BICYCLE_SPEED] = speed_next;
    kf->x[BICYCLE_HEADING] = bicycle_wrap(heading_next, 3.1415927f);
    kf->x[BICYCLE_TURN] = turn_next;
    kf->U[0] = u_x_y_next;
    kf->U[1] = u_x_speed_next;
    kf->U[2] = u_y_speed_next;
    kf->U[3] = u_x_heading_next;
    kf->U[4] = u_y_heading_next;
    kf->U[5] = u_speed_heading_next;
    kf->U[6] = u_x_turn_next;
    kf->U[7] = u_y_turn_next;
    kf->U[8] = u_speed_turn_next;
    kf->U[9] = u_heading_turn_next;
    kf->D[0] = d_x_next;
    kf->D[1] = d_y_next;
    kf->D[2] = d_speed_next;
    kf->D[3] = d_heading_next;
    kf->D[4] = d_turn_next;
    kf->nis = nis;
    return BICYCLE_OK;
}

bicycle_status_t bicycle_update_radar(bicycle_t *kf, const bicycle_radar_t *z)
{
    if (kf == NULL || z == NULL) { return BICYCLE_NULL_ARGUMENT; }
    bicycle_status_t flags = BICYCLE_OK;

    /* innovation */
    const float x = kf->x[BICYCLE_X];
    const float y = kf->x[BICYCLE_Y];
    const float speed = kf->x[BICYCLE_SPEED];
    const float heading = kf->x[BICYCLE_HEADING];
    float seen[24];
    float cloud[50];
    const float d_y = kf->D[1];
    const float t0 = sqrtf(d_y);
    const float d_speed = kf->D[2];
    const float t1 = sqrtf(d_speed);
    const float d_heading = kf->D[3];
    const float t2 = sqrtf(d_heading);
    const float d_turn = kf->D[4];
    const float t3 = sqrtf(d_turn);
    const float d_x = kf->D[0];
    const float t4 = 1.118034f * sqrtf(d_x);
    cloud[0] = t4;
    cloud[1] = 0.0f;
    cloud[2] = 0.0f;
    cloud[3] = 0.0f;
    cloud[4] = 0.0f;
    cloud[5] = -t4;
    cloud[6] = 0.0f;
    cloud[7] = 0.0f;
    cloud[8] = 0.0f;
    cloud[9] = 0.0f;
    const float u_x_y = kf->U[0];
    const float t5 = u_x_y * t0 * 1.118034f;
    const float t6 = 1.118034f * t0;
    cloud[10] = t5;
    cloud[11] = t6;
    cloud[12] = 0.0f;
    cloud[13] = 0.0f;
    cloud[14] = 0.0f;
    cloud[15] = -t5;
    cloud[16] = -t6;
    cloud[17] = 0.0f;
    cloud[18] = 0.0f;
    cloud[19] = 0.0f;
    const float u_x_speed = kf->U[1];
    const float t7 = u_x_speed * t1 * 1.118034f;
    const float u_y_speed = kf->U[2];
    const float t8 = u_y_speed * t1 * 1.118034f;
    const float t9 = 1.118034f * t1;
    cloud[20] = t7;
    cloud[21] = t8;
    cloud[22] = t9;
    cloud[23] = 0.0f;
    cloud[24] = 0.0f;
    cloud[25] = -t7;
    cloud[26] = -t8;
    cloud[27] = -t9;
    cloud[28] = 0.0f;
    cloud[29] = 0.0f;
    const float u_x_heading = kf->U[3];
    const float t10 = u_x_heading * t2 * 1.118034f;
    const float u_y_heading = kf->U[4];
    const float t11 = u_y_heading * t2 * 1.118034f;
    const float u_speed_heading = kf->U[5];
    const float t12 = u_speed_heading * t2 * 1.118034f;
    const float t13 = 1.118034f * t2;
    cloud[30] = t10;
    cloud[31] = t11;
    cloud[32] = t12;
    cloud[33] = t13;
    cloud[34] = 0.0f;
    cloud[35] = -t10;
    cloud[36] = -t11;
    cloud[37] = -t12;
    cloud[38] = -t13;
    cloud[39] = 0.0f;
    const float u_x_turn = kf->U[6];
    const float t14 = u_x_turn * t3 * 1.118034f;
    const float u_y_turn = kf->U[7];
    const float t15 = u_y_turn * t3 * 1.118034f;
    const float u_speed_turn = kf->U[8];
    const float t16 = u_speed_turn * t3 * 1.118034f;
    const float u_heading_turn = kf->U[9];
    const float t17 = u_heading_turn * t3 * 1.118034f;
    const float t18 = 1.118034f * t3;
    cloud[40] = t14;
    cloud[41] = t15;
    cloud[42] = t16;
    cloud[43] = t17;
    cloud[44] = t18;
    cloud[45] = -t14;
    cloud[46] = -t15;
    cloud[47] = -t16;
    cloud[48] = -t17;
    cloud[49] = -t18;
    bicycle_see_radar(kf->x, cloud, seen);
    const float h_range = seen[0];
    const float h_bearing = seen[1];
    const float h_range_rate = seen[2];

    /* its covariance S = L D L^T */
    const float s_range = seen[3] + 0.09f;
    const float t19 = seen[5] + 0.0009f;
    const float t20 = seen[8] + 0.09f;
    const float y_range = z->range - h_range;
    const float t21 = z->bearing - h_bearing;
    const float y_bearing = bicycle_wrap(t21, 3.1415927f);
    const float y_range_rate = z->range_rate - h_range_rate;
    const float t22 = 1.0f / s_range;
    const float t23 = seen[4] * t22;
    const float s_bearing = t19 - t23 * seen[4];
    const float t24 = seen[7] - t23 * seen[6];
    const float t25 = y_bearing - t23 * y_range;
    const float t26 = seen[6] * t22;
    const float t27 = y_range * t22;
    const bool t28 = 2.861023e-6f * t19 < s_bearing;
    const float t29 = t28 ? 1.0f / s_bearing : 0.0f;
    const float t30 = t28 ? seen[10] - t23 * seen[9] : 0.0f;
    const float t31 = t28 ? seen[13] - t23 * seen[12] : 0.0f;
    const float t32 = t28 ? seen[16] - t23 * seen[15] : 0.0f;
    const float t33 = t28 ? seen[19] - t23 * seen[18] : 0.0f;
    const float t34 = t28 ? seen[22] - t23 * seen[21] : 0.0f;
    const float t35 = t24 * t29;
    const float s_range_rate = t20 - t26 * seen[6] - t35 * t24;
    const float t36 = y_range_rate - t26 * y_range - t35 * t25;
    const float t37 = t25 * t29;
    const bool t38 = 2.861023e-6f * t20 < s_range_rate;
    const float t39 = t38 ? seen[11] - t26 * seen[9] - t35 * t30 : 0.0f;
    const float t40 = t38 ? seen[14] - t26 * seen[12] - t35 * t31 : 0.0f;
    const float t41 = t38 ? seen[17] - t26 * seen[15] - t35 * t32 : 0.0f;
    const float t42 = t38 ? seen[20] - t26 * seen[18] - t35 * t33 : 0.0f;
    const float t43 = t38 ? seen[23] - t26 * seen[21] - t35 * t34 : 0.0f;
    const float t44 = t36 * (t38 ? 1.0f / s_range_rate : 0.0f);
    const float nis = y_range * t27 + t25 * t37 + t36 * t44;

    /* guards */
    if (!bicycle_finite(y_range + t21 + y_range_rate + s_range + s_bearing + s_range_rate + nis)) {
        return BICYCLE_NOT_FINITE;
    }
    if (!(s_range > 0.0f)) { return BICYCLE_NOT_POSITIVE; }

    /* gain and covariance */
    const float t45 = seen[18] - u_heading_turn * seen[21];
    const float t46 = seen[15] - u_speed_turn * seen[21] - u_speed_heading * t45;
    const float t47 = seen[12] - u_y_turn * seen[21] - u_y_heading * t45 - u_y_speed * t46;
    const float t48 = seen[9] - u_x_turn * seen[21] - u_x_heading * t45 - u_x_speed * t46
        - u_x_y * t47;
    const float t49 = t48 * (d_x > 1.1754944e-38f ? 1.0f / d_x : 0.0f) * t48;
    const float t50 = t47 * (d_y > 1.1754944e-38f ? 1.0f / d_y : 0.0f);
    const float t51 = t50 * t47;
    const float t52 = t46 * (d_speed > 1.1754944e-38f ? 1.0f / d_speed : 0.0f);
    const float t53 = t52 * t46;
    const float t54 = t45 * (d_heading > 1.1754944e-38f ? 1.0f / d_heading : 0.0f);
    const float t55 = t54 * t45;
    const float t56 = seen[21] * (d_turn > 1.1754944e-38f ? 1.0f / d_turn : 0.0f);
    const float t57 = t56 * seen[21];
    const float t58 = s_range - t49 - t51 - t53 - t55 - t57;
    const bool t59 = t58 < 0.0f;
    const float t60 = t59 ? 0.0f : t58;
    const float t61 = t60 + t49;
    const bool t62 = t61 > 1.1754944e-38f;
    const float t63 = t62 ? 1.0f / t61 : 0.0f;
    const float t64 = t48 * t63;
    const float t65 = d_x * (t62 ? t60 * t63 : 1.0f);
    const float t66 = t61 + t51;
    const bool t67 = t66 > 1.1754944e-38f;
    const float t68 = t67 ? 1.0f / t66 : 0.0f;
    const float t69 = t47 * t68;
    const float t70 = u_x_y - t50 * t64;
    const float t71 = t64 + t69 * t70;
    const float t72 = d_y * (t67 ? t61 * t68 : 1.0f);
    const float t73 = t66 + t53;
    const bool t74 = t73 > 1.1754944e-38f;
    const float t75 = t74 ? 1.0f / t73 : 0.0f;
    const float t76 = t46 * t75;
    const float t77 = u_x_speed - t52 * t71;
    const float t78 = t71 + t76 * t77;
    const float t79 = u_y_speed - t52 * t69;
    const float t80 = t69 + t76 * t79;
    const float t81 = d_speed * (t74 ? t66 * t75 : 1.0f);
    const float t82 = t73 + t55;
    const bool t83 = t82 > 1.1754944e-38f;
    const float t84 = t83 ? 1.0f / t82 : 0.0f;
    const float t85 = t45 * t84;
    const float t86 = u_x_heading - t54 * t78;
    const float t87 = u_y_heading - t54 * t80;
    const float t88 = u_speed_heading - t54 * t76;
    const float t89 = d_heading * (t83 ? t73 * t84 : 1.0f);
    const float t90 = t82 + t57;
    const bool t91 = t90 > 1.1754944e-38f;
    const float t92 = u_x_turn - t56 * (t78 + t85 * t86);
    const float t93 = u_y_turn - t56 * (t80 + t85 * t87);
    const float t94 = u_speed_turn - t56 * (t76 + t85 * t88);
    const float t95 = u_heading_turn - t56 * t85;
    const float t96 = d_turn * (t91 ? t82 * (t91 ? 1.0f / t90 : 0.0f) : 1.0f);
    if (t59) { flags |= BICYCLE_REGULARIZED; }
    const float t97 = t33 - t95 * t34;
    const float t98 = t32 - t94 * t34 - t88 * t97;
    const float t99 = t31 - t93 * t34 - t87 * t97 - t79 * t98;
    const float t100 = t30 - t92 * t34 - t86 * t97 - t77 * t98 - t70 * t99;
    const float t101 = t100 * (t65 > 1.1754944e-38f ? 1.0f / t65 : 0.0f) * t100;
    const float t102 = t99 * (t72 > 1.1754944e-38f ? 1.0f / t72 : 0.0f);
    const float t103 = t102 * t99;
    const float t104 = t98 * (t81 > 1.1754944e-38f ? 1.0f / t81 : 0.0f);
    const float t105 = t104 * t98;
    const float t106 = t97 * (t89 > 1.1754944e-38f ? 1.0f / t89 : 0.0f);
    const float t107 = t106 * t97;
    const float t108 = t34 * (t96 > 1.1754944e-38f ? 1.0f / t96 : 0.0f);
    const float t109 = t108 * t34;
    const float t110 = (t28 ? s_bearing : 1.0f) - t101 - t103 - t105 - t107 - t109;
    const bool t111 = t110 < 0.0f;
    const float t112 = t111 ? 0.0f : t110;
    const float t113 = t112 + t101;
    const bool t114 = t113 > 1.1754944e-38f;
    const float t115 = t114 ? 1.0f / t113 : 0.0f;
    const float t116 = t100 * t115;
    const float t117 = t65 * (t114 ? t112 * t115 : 1.0f);
    const float t118 = t113 + t103;
    const bool t119 = t118 > 1.1754944e-38f;
    const float t120 = t119 ? 1.0f / t118 : 0.0f;
    const float t121 = t99 * t120;
    const float t122 = t70 - t102 * t116;
    const float t123 = t116 + t121 * t122;
    const float t124 = t72 * (t119 ? t113 * t120 : 1.0f);
    const float t125 = t118 + t105;
    const bool t126 = t125 > 1.1754944e-38f;
    const float t127 = t126 ? 1.0f / t125 : 0.0f;
    const float t128 = t98 * t127;
    const float t129 = t77 - t104 * t123;
    const float t130 = t123 + t128 * t129;
    const float t131 = t79 - t104 * t121;
    const float t132 = t121 + t128 * t131;
    const float t133 = t81 * (t126 ? t118 * t127 : 1.0f);
    const float t134 = t125 + t107;
    const bool t135 = t134 > 1.1754944e-38f;
    const float t136 = t135 ? 1.0f / t134 : 0.0f;
    const float t137 = t97 * t136;
    const float t138 = t86 - t106 * t130;
    const float t139 = t87 - t106 * t132;
    const float t140 = t88 - t106 * t128;
    const float t141 = t89 * (t135 ? t125 * t136 : 1.0f);
    const float t142 = t134 + t109;
    const bool t143 = t142 > 1.1754944e-38f;
    const float t144 = t92 - t108 * (t130 + t137 * t138);
    const float t145 = t93 - t108 * (t132 + t137 * t139);
    const float t146 = t94 - t108 * (t128 + t137 * t140);
    const float t147 = t95 - t108 * t137;
    const float t148 = t96 * (t143 ? t134 * (t143 ? 1.0f / t142 : 0.0f) : 1.0f);
    if (t111) { flags |= BICYCLE_REGULARIZED; }
    const float t149 = t42 - t147 * t43;
    const float t150 = t41 - t146 * t43 - t140 * t149;
    const float t151 = t40 - t145 * t43 - t139 * t149 - t131 * t150;
    const float t152 = t39 - t144 * t43 - t138 * t149 - t129 * t150 - t122 * t151;
    const float t153 = t152 * (t117 > 1.1754944e-38f ? 1.0f / t117 : 0.0f) * t152;
    const float t154 = t151 * (t124 > 1.1754944e-38f ? 1.0f / t124 : 0.0f);
    const float t155 = t154 * t151;
    const float t156 = t150 * (t133 > 1.1754944e-38f ? 1.0f / t133 : 0.0f);
    const float t157 = t156 * t150;
    const float t158 = t149 * (t141 > 1.1754944e-38f ? 1.0f / t141 : 0.0f);
    const float t159 = t158 * t149;
    const float t160 = t43 * (t148 > 1.1754944e-38f ? 1.0f / t148 : 0.0f);
    const float t161 = t160 * t43;
    const float t162 = (t38 ? s_range_rate : 1.0f) - t153 - t155 - t157 - t159 - t161;
    const bool t163 = t162 < 0.0f;
    const float t164 = t163 ? 0.0f : t162;
    const float t165 = t164 + t153;
    const bool t166 = t165 > 1.1754944e-38f;
    const float t167 = t166 ? 1.0f / t165 : 0.0f;
    const float t168 = t152 * t167;
    const float d_x_next = t117 * (t166 ? t164 * t167 : 1.0f);
    const float t169 = t165 + t155;
    const bool t170 = t169 > 1.1754944e-38f;
    const float t171 = t170 ? 1.0f / t169 : 0.0f;
    const float t172 = t151 * t171;
    const float u_x_y_next = t122 - t154 * t168;
    const float t173 = t168 + t172 * u_x_y_next;
    const float d_y_next = t124 * (t170 ? t165 * t171 : 1.0f);
    const float t174 = t169 + t157;
    const bool t175 = t174 > 1.1754944e-38f;
    const float t176 = t175 ? 1.0f / t174 : 0.0f;
    const float t177 = t150 * t176;
    const float u_x_speed_next = t129 - t156 * t173;
    const float t178 = t173 + t177 * u_x_speed_next;
    const float u_y_speed_next = t131 - t156 * t172;
    const float t179 = t172 + t177 * u_y_speed_next;
    const float d_speed_next = t133 * (t175 ? t169 * t176 : 1.0f);
    const float t180 = t174 + t159;
    const bool t181 = t180 > 1.1754944e-38f;
    const float t182 = t181 ? 1.0f / t180 : 0.0f;
    const float t183 = t149 * t182;
    const float u_x_heading_next = t138 - t158 * t178;
    const float u_y_heading_next = t139 - t158 * t179;
    const float u_speed_heading_next = t140 - t158 * t177;
    const float d_heading_next = t141 * (t181 ? t174 * t182 : 1.0f);
    const float t184 = t180 + t161;
    const bool t185 = t184 > 1.1754944e-38f;
    const float u_x_turn_next = t144 - t160 * (t178 + t183 * u_x_heading_next);
    const float u_y_turn_next = t145 - t160 * (t179 + t183 * u_y_heading_next);
    const float u_speed_turn_next = t146 - t160 * (t177 + t183 * u_speed_heading_next);
    const float u_heading_turn_next = t147 - t160 * t183;
    const float d_turn_next = t148 * (t185 ? t180 * (t185 ? 1.0f / t184 : 0.0f) : 1.0f);
    if (t163) { flags |= BICYCLE_REGULARIZED; }

    /* state */
    const float x_next = x + seen[9] * t27 + t30 * t37 + t39 * t44;
    const float y_next = y + seen[12] * t27 + t31 * t37 + t40 * t44;
    const float speed_next = speed + seen[15] * t27 + t32 * t37 + t41 * t44;
    const float heading_next = heading + seen[18] * t27 + t33 * t37 + t42 * t44;
    const float turn_next = kf->x[BICYCLE_TURN] + seen[21] * t27 + t34 * t37 + t43 * t44;

    /* guards */
    if (!bicycle_finite(nis + x_next + y_next + speed_next + heading_next + turn_next)) {
        return BICYCLE_NOT_FINITE;
    }

    /* store */
    kf->x[BICYCLE_X] = x_next;
    kf->x[BICYCLE_Y] = y_next;
    kf->x[BICYCLE_SPEED] = speed_next;
    kf->x[BICYCLE_HEADING] = bicycle_wrap(heading_next, 3.1415927f);
    kf->x[BICYCLE_TURN] = turn_next;
    kf->U[0] = u_x_y_next;
    kf->U[1] = u_x_speed_next;
    kf->U[2] = u_y_speed_next;
    kf->U[3] = u_x_heading_next;
    kf->U[4] = u_y_heading_next;
    kf->U[5] = u_speed_heading_next;
    kf->U[6] = u_x_turn_next;
    kf->U[7] = u_y_turn_next;
    kf->U[8] = u_speed_turn_next;
    kf->U[9] = u_heading_turn_next;
    kf->D[0] = d_x_next;
    kf->D[1] = d_y_next;
    kf->D[2] = d_speed_next;
    kf->D[3] = d_heading_next;
    kf->D[4] = d_turn_next;
    kf->nis = nis;
    return flags;
}

bicycle_status_t bicycle_set_state(bicycle_t *kf, const bicycle_real_t x[5])
{
    if (kf == NULL || x == NULL) { return BICYCLE_NULL_ARGUMENT; }
    if (!bicycle_finite(x[BICYCLE_X])) { return BICYCLE_NOT_FINITE; }
    if (!bicycle_finite(x[BICYCLE_Y])) { return BICYCLE_NOT_FINITE; }
    if (!bicycle_finite(x[BICYCLE_SPEED])) { return BICYCLE_NOT_FINITE; }
    if (!bicycle_finite(x[BICYCLE_HEADING])) { return BICYCLE_NOT_FINITE; }
    if (!bicycle_finite(x[BICYCLE_TURN])) { return BICYCLE_NOT_FINITE; }
    kf->x[BICYCLE_X] = x[BICYCLE_X];
    kf->x[BICYCLE_Y] = x[BICYCLE_Y];
    kf->x[BICYCLE_SPEED] = x[BICYCLE_SPEED];
    kf->x[BICYCLE_HEADING] = bicycle_wrap(x[BICYCLE_HEADING], 3.1415927f);
    kf->x[BICYCLE_TURN] = x[BICYCLE_TURN];
    return BICYCLE_OK;
}

bicycle_status_t bicycle_set_covariance(bicycle_t *kf, const bicycle_real_t P[25])
{
    if (kf == NULL || P == NULL) { return BICYCLE_NULL_ARGUMENT; }
    float p[15];
    float w[15];

    /* the upper triangle, column by column */
    for (int j = 0; j < 5; j++) {
        for (int i = 0; i < j + 1; i++) {
            const float value = P[5 * i + j];
            p[j * (j + 1) / 2 + i] = value;
            w[j * (j + 1) / 2 + i] = value;
            if (!bicycle_finite(value)) { return BICYCLE_NOT_FINITE; }
        }
    }

    /* factor it: a pivot is zero up to round-off, or positive */
    for (int j = 5 - 1; j >= 0; j--) {
        const float round_off = 5.9604645e-7f * p[j * (j + 1) / 2 + j];
        const float pivot = w[j * (j + 1) / 2 + j];
        if (!(-round_off <= pivot)) { return BICYCLE_NOT_POSITIVE; }
        const float d = round_off < pivot ? pivot : 0.0f;
        w[j * (j + 1) / 2 + j] = d;
        for (int i = j - 1; i >= 0; i--) {
            const float rest = w[j * (j + 1) / 2 + i];
            if (d <= 0.0f && 2.3841858e-6f * p[j * (j + 1) / 2 + j] * p[i * (i + 1) / 2 + i] < rest
                * rest) {
                return BICYCLE_NOT_POSITIVE;
            }
            const float u = d > 0.0f ? rest / d : 0.0f;
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
    return BICYCLE_OK;
}

void bicycle_get_covariance(const bicycle_t *kf, bicycle_real_t P[25])
{
    if (kf == NULL || P == NULL) { return; }
    for (int j = 0; j < 5; j++) {
        for (int i = 0; i < j + 1; i++) {
            float sum = kf->D[j];
            if (i < j) {
                sum = sum * kf->U[j * (j - 1) / 2 + i];
            }
            for (int k = j + 1; k < 5; k++) {
                sum = sum + kf->U[k * (k - 1) / 2 + i] * kf->D[k] * kf->U[k * (k - 1) / 2 + j];
            }
            const float value = sum;
            P[5 * i + j] = value;
            P[5 * j + i] = value;
        }
    }
}
/* kfgen: body 801d36bf27703d57f75e3699054d9b6e */
