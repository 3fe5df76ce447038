//! AVX-512 and AVX2 + FMA.
#![allow(unsafe_code)]

use super::super::{Kernel, LANES};
use super::{Isa, Level, sealed::Sealed};
use std::arch::x86_64::*;

#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
pub(super) fn run_avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx512>()
}

#[target_feature(enable = "avx2,fma")]
pub(super) fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<Avx2>()
}

/// Calls an intrinsic. Both types are private to `simd`: a kernel meets them only as the parameter of `Kernel::run`,
/// called by `run_avx512` or `run_avx2`, whose features enable the intrinsic.
macro_rules! enabled {
    ($e:expr) => {
        // SAFETY: reached only from `run_avx512` / `run_avx2`, after the features were detected; pointers come from
        // references to arrays of the full width.
        unsafe { $e }
    };
}

#[derive(Clone, Copy)]
pub(in super::super) struct Avx512;

impl Sealed for Avx512 {}

impl Isa for Avx512 {
    type F = __m512d;
    type M = __mmask8;
    const LEVEL: Level = Level::Avx512;
    #[inline(always)]
    fn splat(v: f64) -> __m512d {
        enabled!(_mm512_set1_pd(v))
    }
    #[inline(always)]
    fn load(a: &[f64; LANES]) -> __m512d {
        enabled!(_mm512_loadu_pd(a.as_ptr()))
    }
    #[inline(always)]
    fn of([a, b, c, d, e, f, g, h]: [f64; LANES]) -> __m512d {
        enabled!(_mm512_set_pd(h, g, f, e, d, c, b, a))
    }
    #[inline(always)]
    fn part(a: __m512d, b: __m512d) -> [__m512d; 2] {
        enabled!([
            _mm512_permutex2var_pd(a, _mm512_set_epi64(14, 12, 10, 8, 6, 4, 2, 0), b),
            _mm512_permutex2var_pd(a, _mm512_set_epi64(15, 13, 11, 9, 7, 5, 3, 1), b)
        ])
    }
    #[inline(always)]
    fn join(even: __m512d, odd: __m512d) -> [__m512d; 2] {
        enabled!([
            _mm512_permutex2var_pd(even, _mm512_set_epi64(11, 3, 10, 2, 9, 1, 8, 0), odd),
            _mm512_permutex2var_pd(even, _mm512_set_epi64(15, 7, 14, 6, 13, 5, 12, 4), odd)
        ])
    }
    #[inline(always)]
    fn store(v: __m512d, a: &mut [f64; LANES]) {
        enabled!(_mm512_storeu_pd(a.as_mut_ptr(), v))
    }
    #[inline(always)]
    fn add(a: __m512d, b: __m512d) -> __m512d {
        enabled!(_mm512_add_pd(a, b))
    }
    #[inline(always)]
    fn sub(a: __m512d, b: __m512d) -> __m512d {
        enabled!(_mm512_sub_pd(a, b))
    }
    #[inline(always)]
    fn mul(a: __m512d, b: __m512d) -> __m512d {
        enabled!(_mm512_mul_pd(a, b))
    }
    #[inline(always)]
    fn div(a: __m512d, b: __m512d) -> __m512d {
        enabled!(_mm512_div_pd(a, b))
    }
    #[inline(always)]
    fn mul_add(a: __m512d, b: __m512d, c: __m512d) -> __m512d {
        enabled!(_mm512_fmadd_pd(a, b, c))
    }
    #[inline(always)]
    fn neg(a: __m512d) -> __m512d {
        enabled!(_mm512_xor_pd(a, _mm512_set1_pd(-0.0)))
    }
    #[inline(always)]
    fn sqrt(a: __m512d) -> __m512d {
        enabled!(_mm512_sqrt_pd(a))
    }
    #[inline(always)]
    fn fast_recip(a: __m512d) -> __m512d {
        // y (1 + e + e^2 + e^3) with e = 1 - a y, |e| <= 2^-14: what is left out is e^4 <= 2^-56.
        enabled!({
            let one = _mm512_set1_pd(1.0);
            let y = _mm512_rcp14_pd(a);
            let e = _mm512_fnmadd_pd(a, y, one);
            let series = _mm512_fmadd_pd(_mm512_fmadd_pd(e, e, e), e, e);
            _mm512_fmadd_pd(y, series, y)
        })
    }
    #[inline(always)]
    fn rsqrt(a: __m512d) -> __m512d {
        // y (1 - e)^(-1/2) to e^3 with e = 1 - a y^2, |e| <= 2^-13: what is left out is 35/128 e^4 <= 2^-53.
        enabled!({
            let y = _mm512_rsqrt14_pd(a);
            let e = _mm512_fnmadd_pd(_mm512_mul_pd(a, y), y, _mm512_set1_pd(1.0));
            let series = _mm512_fmadd_pd(e, _mm512_set1_pd(0.3125), _mm512_set1_pd(0.375));
            let series = _mm512_fmadd_pd(series, e, _mm512_set1_pd(0.5));
            _mm512_fmadd_pd(_mm512_mul_pd(y, e), series, y)
        })
    }
    #[inline(always)]
    fn abs(a: __m512d) -> __m512d {
        enabled!(_mm512_andnot_pd(_mm512_set1_pd(-0.0), a))
    }
    #[inline(always)]
    fn min(a: __m512d, b: __m512d) -> __m512d {
        enabled!(_mm512_min_pd(a, b))
    }
    #[inline(always)]
    fn max(a: __m512d, b: __m512d) -> __m512d {
        enabled!(_mm512_max_pd(a, b))
    }
    #[inline(always)]
    fn copysign(a: __m512d, b: __m512d) -> __m512d {
        enabled!({
            let sign = _mm512_set1_pd(-0.0);
            _mm512_or_pd(_mm512_andnot_pd(sign, a), _mm512_and_pd(sign, b))
        })
    }
    #[inline(always)]
    fn exponent_and_mantissa(a: __m512d) -> (__m512d, __m512d) {
        enabled!((_mm512_getexp_pd(a), _mm512_getmant_pd::<_MM_MANT_NORM_1_2, _MM_MANT_SIGN_SRC>(a)))
    }
    #[inline(always)]
    fn exp2_int(a: __m512d) -> __m512d {
        enabled!(_mm512_scalef_pd(_mm512_set1_pd(1.0), a))
    }
    #[inline(always)]
    fn lt(a: __m512d, b: __m512d) -> __mmask8 {
        enabled!(_mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b))
    }
    #[inline(always)]
    fn le(a: __m512d, b: __m512d) -> __mmask8 {
        enabled!(_mm512_cmp_pd_mask::<_CMP_LE_OQ>(a, b))
    }
    #[inline(always)]
    fn select(m: __mmask8, a: __m512d, b: __m512d) -> __m512d {
        enabled!(_mm512_mask_blend_pd(m, b, a))
    }
    #[inline(always)]
    fn and(a: __mmask8, b: __mmask8) -> __mmask8 {
        a & b
    }
    #[inline(always)]
    fn or(a: __mmask8, b: __mmask8) -> __mmask8 {
        a | b
    }
    #[inline(always)]
    fn not(a: __mmask8) -> __mmask8 {
        !a
    }
    #[inline(always)]
    fn bits(a: __mmask8) -> u8 {
        a
    }
}

#[derive(Clone, Copy)]
pub(in super::super) struct Avx2;

impl Sealed for Avx2 {}

/// Two halves of four lanes.
type Halves = [__m256d; 2];

#[inline(always)]
fn each(a: Halves, f: impl Fn(__m256d) -> __m256d) -> Halves {
    [f(a[0]), f(a[1])]
}

#[inline(always)]
fn both(a: Halves, b: Halves, f: impl Fn(__m256d, __m256d) -> __m256d) -> Halves {
    [f(a[0], b[0]), f(a[1], b[1])]
}

impl Isa for Avx2 {
    type F = Halves;
    type M = Halves;
    const LEVEL: Level = Level::Avx2;
    #[inline(always)]
    fn splat(v: f64) -> Halves {
        enabled!([_mm256_set1_pd(v); 2])
    }
    #[inline(always)]
    fn load(a: &[f64; LANES]) -> Halves {
        enabled!([_mm256_loadu_pd(a.as_ptr()), _mm256_loadu_pd(a.as_ptr().add(4))])
    }
    #[inline(always)]
    fn of([a, b, c, d, e, f, g, h]: [f64; LANES]) -> Halves {
        enabled!([_mm256_set_pd(d, c, b, a), _mm256_set_pd(h, g, f, e)])
    }
    #[inline(always)]
    fn part(a: Halves, b: Halves) -> [Halves; 2] {
        // (a0, a2, a1, a3) of each half, then halves of halves.
        enabled!({
            let mut sorted = [a[0], a[1], b[0], b[1]];
            for k in 0..4 {
                sorted[k] = _mm256_permute4x64_pd::<0b11_01_10_00>(sorted[k]);
            }
            [
                [
                    _mm256_permute2f128_pd::<0x20>(sorted[0], sorted[1]),
                    _mm256_permute2f128_pd::<0x20>(sorted[2], sorted[3]),
                ],
                [
                    _mm256_permute2f128_pd::<0x31>(sorted[0], sorted[1]),
                    _mm256_permute2f128_pd::<0x31>(sorted[2], sorted[3]),
                ],
            ]
        })
    }
    #[inline(always)]
    fn join(even: Halves, odd: Halves) -> [Halves; 2] {
        // (e0, o0, e2, o2) and (e1, o1, e3, o3) of each half.
        enabled!({
            let mut joined = [even; 2];
            for k in 0..2 {
                let (low, high) = (_mm256_unpacklo_pd(even[k], odd[k]), _mm256_unpackhi_pd(even[k], odd[k]));
                joined[k] = [_mm256_permute2f128_pd::<0x20>(low, high), _mm256_permute2f128_pd::<0x31>(low, high)];
            }
            joined
        })
    }
    #[inline(always)]
    fn store(v: Halves, a: &mut [f64; LANES]) {
        enabled!({
            _mm256_storeu_pd(a.as_mut_ptr(), v[0]);
            _mm256_storeu_pd(a.as_mut_ptr().add(4), v[1]);
        })
    }
    #[inline(always)]
    fn add(a: Halves, b: Halves) -> Halves {
        both(a, b, |a, b| enabled!(_mm256_add_pd(a, b)))
    }
    #[inline(always)]
    fn sub(a: Halves, b: Halves) -> Halves {
        both(a, b, |a, b| enabled!(_mm256_sub_pd(a, b)))
    }
    #[inline(always)]
    fn mul(a: Halves, b: Halves) -> Halves {
        both(a, b, |a, b| enabled!(_mm256_mul_pd(a, b)))
    }
    #[inline(always)]
    fn div(a: Halves, b: Halves) -> Halves {
        both(a, b, |a, b| enabled!(_mm256_div_pd(a, b)))
    }
    #[inline(always)]
    fn mul_add(a: Halves, b: Halves, c: Halves) -> Halves {
        enabled!([_mm256_fmadd_pd(a[0], b[0], c[0]), _mm256_fmadd_pd(a[1], b[1], c[1])])
    }
    #[inline(always)]
    fn neg(a: Halves) -> Halves {
        each(a, |a| enabled!(_mm256_xor_pd(a, _mm256_set1_pd(-0.0))))
    }
    #[inline(always)]
    fn sqrt(a: Halves) -> Halves {
        each(a, |a| enabled!(_mm256_sqrt_pd(a)))
    }
    #[inline(always)]
    fn fast_recip(a: Halves) -> Halves {
        each(a, |a| enabled!(_mm256_div_pd(_mm256_set1_pd(1.0), a)))
    }
    #[inline(always)]
    fn rsqrt(a: Halves) -> Halves {
        each(a, |a| enabled!(_mm256_div_pd(_mm256_set1_pd(1.0), _mm256_sqrt_pd(a))))
    }
    #[inline(always)]
    fn abs(a: Halves) -> Halves {
        each(a, |a| enabled!(_mm256_andnot_pd(_mm256_set1_pd(-0.0), a)))
    }
    #[inline(always)]
    fn min(a: Halves, b: Halves) -> Halves {
        both(a, b, |a, b| enabled!(_mm256_min_pd(a, b)))
    }
    #[inline(always)]
    fn max(a: Halves, b: Halves) -> Halves {
        both(a, b, |a, b| enabled!(_mm256_max_pd(a, b)))
    }
    #[inline(always)]
    fn copysign(a: Halves, b: Halves) -> Halves {
        both(a, b, |a, b| {
            enabled!({
                let sign = _mm256_set1_pd(-0.0);
                _mm256_or_pd(_mm256_andnot_pd(sign, a), _mm256_and_pd(sign, b))
            })
        })
    }
    #[inline(always)]
    fn exponent_and_mantissa(a: Halves) -> (Halves, Halves) {
        // The biased exponent in the low bits of 2^52 is the double 2^52 + exponent.
        let exponent = each(a, |a| {
            enabled!({
                let shifted = _mm256_srli_epi64::<52>(_mm256_castpd_si256(a));
                let biased = _mm256_or_si256(shifted, _mm256_castpd_si256(_mm256_set1_pd(4_503_599_627_370_496.0)));
                _mm256_sub_pd(_mm256_castsi256_pd(biased), _mm256_set1_pd(4_503_599_627_370_496.0 + 1023.0))
            })
        });
        let mantissa = each(a, |a| {
            enabled!({
                let fraction = _mm256_and_si256(_mm256_castpd_si256(a), _mm256_set1_epi64x(0x000f_ffff_ffff_ffff));
                _mm256_castsi256_pd(_mm256_or_si256(fraction, _mm256_set1_epi64x(0x3ff0_0000_0000_0000)))
            })
        });
        (exponent, mantissa)
    }
    #[inline(always)]
    fn exp2_int(a: Halves) -> Halves {
        // 2^52 + (a + 1023) has the biased exponent of 2^a in its low bits.
        each(a, |a| {
            enabled!({
                let biased = _mm256_add_pd(a, _mm256_set1_pd(4_503_599_627_370_496.0 + 1023.0));
                _mm256_castsi256_pd(_mm256_slli_epi64::<52>(_mm256_castpd_si256(biased)))
            })
        })
    }
    #[inline(always)]
    fn lt(a: Halves, b: Halves) -> Halves {
        both(a, b, |a, b| enabled!(_mm256_cmp_pd::<_CMP_LT_OQ>(a, b)))
    }
    #[inline(always)]
    fn le(a: Halves, b: Halves) -> Halves {
        both(a, b, |a, b| enabled!(_mm256_cmp_pd::<_CMP_LE_OQ>(a, b)))
    }
    #[inline(always)]
    fn select(m: Halves, a: Halves, b: Halves) -> Halves {
        enabled!([_mm256_blendv_pd(b[0], a[0], m[0]), _mm256_blendv_pd(b[1], a[1], m[1])])
    }
    #[inline(always)]
    fn and(a: Halves, b: Halves) -> Halves {
        both(a, b, |a, b| enabled!(_mm256_and_pd(a, b)))
    }
    #[inline(always)]
    fn or(a: Halves, b: Halves) -> Halves {
        both(a, b, |a, b| enabled!(_mm256_or_pd(a, b)))
    }
    #[inline(always)]
    fn not(a: Halves) -> Halves {
        each(a, |a| enabled!(_mm256_xor_pd(a, _mm256_castsi256_pd(_mm256_set1_epi64x(-1)))))
    }
    #[inline(always)]
    fn bits(a: Halves) -> u8 {
        enabled!((_mm256_movemask_pd(a[0]) | (_mm256_movemask_pd(a[1]) << 4)) as u8)
    }
}
