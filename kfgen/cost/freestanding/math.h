/* What an emitted filter may use of <math.h>, for compilers that come without a C library. */
#ifndef KFGEN_MATH_H
#define KFGEN_MATH_H

float sinf(float), cosf(float), tanf(float), asinf(float), acosf(float), atanf(float), atan2f(float, float);
float sinhf(float), coshf(float), tanhf(float), expf(float), logf(float), sqrtf(float), powf(float, float);
float fabsf(float), floorf(float), ceilf(float), fmodf(float, float), hypotf(float, float), fmaf(float, float, float);
double sin(double), cos(double), tan(double), asin(double), acos(double), atan(double), atan2(double, double);
double sinh(double), cosh(double), tanh(double), exp(double), log(double), sqrt(double), pow(double, double);
double fabs(double), floor(double), ceil(double), fmod(double, double), hypot(double, double);
double fma(double, double, double);

#endif
