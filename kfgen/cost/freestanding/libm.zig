// The functions of <math.h> that Zig's compiler library lacks, from its standard library.
const m = @import("std").math;

export fn asinf(x: f32) f32 { return m.asin(x); }
export fn acosf(x: f32) f32 { return m.acos(x); }
export fn atanf(x: f32) f32 { return m.atan(x); }
export fn atan2f(y: f32, x: f32) f32 { return m.atan2(y, x); }
export fn sinhf(x: f32) f32 { return m.sinh(x); }
export fn coshf(x: f32) f32 { return m.cosh(x); }
export fn tanhf(x: f32) f32 { return m.tanh(x); }
export fn powf(x: f32, y: f32) f32 { return m.pow(f32, x, y); }
export fn hypotf(x: f32, y: f32) f32 { return m.hypot(x, y); }
export fn asin(x: f64) f64 { return m.asin(x); }
export fn acos(x: f64) f64 { return m.acos(x); }
export fn atan(x: f64) f64 { return m.atan(x); }
export fn atan2(y: f64, x: f64) f64 { return m.atan2(y, x); }
export fn sinh(x: f64) f64 { return m.sinh(x); }
export fn cosh(x: f64) f64 { return m.cosh(x); }
export fn tanh(x: f64) f64 { return m.tanh(x); }
export fn pow(x: f64, y: f64) f64 { return m.pow(f64, x, y); }
export fn hypot(x: f64, y: f64) f64 { return m.hypot(x, y); }
