//! Natural logarithm in lanes.

use super::Real;

/// log x by x = 2^e m with m in (sqrt 1/2, sqrt 2], s = (m - 1)/(m + 1),
/// log m = 2 s + 2/3 s^3 + ... as a minimax polynomial of degree 14 in s
/// (coefficients: Sun Microsystems' fdlibm, e_log.c). Error below one unit in the last place.
#[inline(always)]
pub(super) fn ln<T: Real>(x: T) -> T {
    const LN2_HI: f64 = 6.931_471_803_691_238e-1;
    const LN2_LO: f64 = 1.908_214_929_270_588e-10;
    const L: [f64; 7] = [
        6.666_666_666_666_735e-1,
        3.999_999_999_940_942e-1,
        2.857_142_874_366_239e-1,
        2.222_219_843_214_978_4e-1,
        1.818_357_216_161_805e-1,
        1.531_383_769_920_937_3e-1,
        1.479_819_860_511_658_6e-1,
    ];
    let tiny = x.lt(T::splat(f64::MIN_POSITIVE)); // subnormal numbers first times 2^54
    let scaled = T::select(tiny, x * 18_014_398_509_481_984.0, x);
    let (e, m) = scaled.exponent_and_mantissa();
    let high = m.gt(T::splat(std::f64::consts::SQRT_2));
    let m = T::select(high, m * 0.5, m);
    let e = T::select(high, e + 1.0, e);
    let e = T::select(tiny, e - 54.0, e);
    let f = m - 1.0;
    let s = f / (f + 2.0);
    let z = s * s;
    let w = z * z;
    let even = w.mul_add(w.mul_add(T::splat(L[5]), T::splat(L[3])), T::splat(L[1])) * w;
    let odd = w.mul_add(w.mul_add(w.mul_add(T::splat(L[6]), T::splat(L[4])), T::splat(L[2])), T::splat(L[0])) * z;
    let half_square = f * f * 0.5;
    let tail = s.mul_add(half_square + even + odd, e * LN2_LO);
    let log = e * LN2_HI - ((half_square - tail) - f);
    let log = T::select(x.gt(T::splat(f64::MAX)), x, log);
    let below = T::select(x.lt(T::zero()), T::splat(f64::NAN), T::splat(f64::NEG_INFINITY));
    // Written so that NaN falls through to NaN: `x <= 0` is false there and the polynomial gives NaN or garbage.
    let log = T::select(x.le(T::zero()), below, log);
    T::select(x.le(T::splat(f64::INFINITY)), log, T::splat(f64::NAN))
}
