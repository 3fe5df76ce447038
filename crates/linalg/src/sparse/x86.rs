//! Lines under AVX2 + FMA (two registers) and AVX-512 (one).

use super::vector::{Line, Route, Vector};
use std::arch::x86_64::*;

macro_rules! avx512 {
    ($name:ident, $t:ty, $r:ty, $zero:ident, $splat:ident, $load:ident, $store:ident, $fma:ident, $fnma:ident,
     $add:ident, $mul:ident, $sub:ident, $sum:ident, $routed:ty, $routing:ident, $pick:ident, $add_some:ident, $mask:ty) => {
        /// A line in one 512-bit register.
        #[derive(Clone, Copy)]
        pub struct $name($r);
        // SAFETY (all methods): the caller promises the instruction set and aligned pointers to a line.
        #[allow(clippy::missing_safety_doc)]
        impl Vector<$t> for $name {
            const WIDE: bool = true;
            type Routed = $routed;
            #[inline(always)]
            unsafe fn routed(route: &Route) -> $routed {
                unsafe { $routing(_mm_loadu_si128(route.from.as_ptr().cast())) }
            }
            #[inline(always)]
            unsafe fn add_routed(self, routed: $routed, lanes: u16, to: *mut $t) {
                unsafe {
                    let before = $load(to);
                    $store(to, $add_some(before, lanes as $mask, before, $pick(routed, self.0)));
                }
            }
            #[inline(always)]
            unsafe fn zero() -> Self {
                unsafe { Self($zero()) }
            }
            #[inline(always)]
            unsafe fn splat(v: $t) -> Self {
                unsafe { Self($splat(v)) }
            }
            #[inline(always)]
            unsafe fn load(p: *const $t) -> Self {
                unsafe { Self($load(p)) }
            }
            #[inline(always)]
            unsafe fn store(self, p: *mut $t) {
                unsafe { $store(p, self.0) }
            }
            #[inline(always)]
            unsafe fn fma(self, a: Self, b: Self) -> Self {
                unsafe { Self($fma(a.0, b.0, self.0)) }
            }
            #[inline(always)]
            unsafe fn fnma(self, a: Self, b: Self) -> Self {
                unsafe { Self($fnma(a.0, b.0, self.0)) }
            }
            #[inline(always)]
            unsafe fn add(self, o: Self) -> Self {
                unsafe { Self($add(self.0, o.0)) }
            }
            #[inline(always)]
            unsafe fn mul(self, o: Self) -> Self {
                unsafe { Self($mul(self.0, o.0)) }
            }
            #[inline(always)]
            unsafe fn neg(self) -> Self {
                unsafe { Self($sub($zero(), self.0)) }
            }
            #[inline(always)]
            unsafe fn sum(self) -> $t {
                unsafe { $sum(self.0) }
            }
        }
    };
}
avx512!(
    F64Avx512,
    f64,
    __m512d,
    _mm512_setzero_pd,
    _mm512_set1_pd,
    _mm512_load_pd,
    _mm512_store_pd,
    _mm512_fmadd_pd,
    _mm512_fnmadd_pd,
    _mm512_add_pd,
    _mm512_mul_pd,
    _mm512_sub_pd,
    _mm512_reduce_add_pd,
    __m512i,
    _mm512_cvtepu8_epi64,
    _mm512_permutexvar_pd,
    _mm512_mask_add_pd,
    u8
);
avx512!(
    F32Avx512,
    f32,
    __m512,
    _mm512_setzero_ps,
    _mm512_set1_ps,
    _mm512_load_ps,
    _mm512_store_ps,
    _mm512_fmadd_ps,
    _mm512_fnmadd_ps,
    _mm512_add_ps,
    _mm512_mul_ps,
    _mm512_sub_ps,
    _mm512_reduce_add_ps,
    __m512i,
    _mm512_cvtepu8_epi32,
    _mm512_permutexvar_ps,
    _mm512_mask_add_ps,
    u16
);

macro_rules! avx2 {
    ($name:ident, $t:ty, $r:ty, $half:literal, $zero:ident, $splat:ident, $load:ident, $store:ident, $storeu:ident,
     $fma:ident, $fnma:ident, $add:ident, $mul:ident, $sub:ident) => {
        /// A line in two 256-bit registers.
        #[derive(Clone, Copy)]
        pub struct $name($r, $r);
        // SAFETY (all methods): the caller promises the instruction set and aligned pointers to a line.
        #[allow(clippy::missing_safety_doc)]
        impl Vector<$t> for $name {
            const WIDE: bool = false;
            type Routed = Route;
            #[inline(always)]
            unsafe fn routed(route: &Route) -> Route {
                *route
            }
            #[inline(always)]
            unsafe fn add_routed(self, routed: Route, lanes: u16, to: *mut $t) {
                let mut line = Line::ZERO;
                // SAFETY: a line; the rest is the caller's promise.
                unsafe {
                    self.store((&raw mut line).cast());
                    routed.add::<$t>((&raw const line).cast(), lanes, to);
                }
            }
            #[inline(always)]
            unsafe fn zero() -> Self {
                unsafe { Self($zero(), $zero()) }
            }
            #[inline(always)]
            unsafe fn splat(v: $t) -> Self {
                unsafe { Self($splat(v), $splat(v)) }
            }
            #[inline(always)]
            unsafe fn load(p: *const $t) -> Self {
                unsafe { Self($load(p), $load(p.add($half))) }
            }
            #[inline(always)]
            unsafe fn store(self, p: *mut $t) {
                unsafe {
                    $store(p, self.0);
                    $store(p.add($half), self.1);
                }
            }
            #[inline(always)]
            unsafe fn fma(self, a: Self, b: Self) -> Self {
                unsafe { Self($fma(a.0, b.0, self.0), $fma(a.1, b.1, self.1)) }
            }
            #[inline(always)]
            unsafe fn fnma(self, a: Self, b: Self) -> Self {
                unsafe { Self($fnma(a.0, b.0, self.0), $fnma(a.1, b.1, self.1)) }
            }
            #[inline(always)]
            unsafe fn add(self, o: Self) -> Self {
                unsafe { Self($add(self.0, o.0), $add(self.1, o.1)) }
            }
            #[inline(always)]
            unsafe fn mul(self, o: Self) -> Self {
                unsafe { Self($mul(self.0, o.0), $mul(self.1, o.1)) }
            }
            #[inline(always)]
            unsafe fn neg(self) -> Self {
                unsafe { Self($sub($zero(), self.0), $sub($zero(), self.1)) }
            }
            #[inline(always)]
            unsafe fn sum(self) -> $t {
                let mut v = [0.0; $half];
                unsafe { $storeu(v.as_mut_ptr(), $add(self.0, self.1)) };
                let mut half = $half / 2;
                while half > 0 {
                    for l in 0..half {
                        v[l] += v[l + half];
                    }
                    half /= 2;
                }
                v[0]
            }
        }
    };
}
avx2!(
    F64Avx2,
    f64,
    __m256d,
    4,
    _mm256_setzero_pd,
    _mm256_set1_pd,
    _mm256_load_pd,
    _mm256_store_pd,
    _mm256_storeu_pd,
    _mm256_fmadd_pd,
    _mm256_fnmadd_pd,
    _mm256_add_pd,
    _mm256_mul_pd,
    _mm256_sub_pd
);
avx2!(
    F32Avx2,
    f32,
    __m256,
    8,
    _mm256_setzero_ps,
    _mm256_set1_ps,
    _mm256_load_ps,
    _mm256_store_ps,
    _mm256_storeu_ps,
    _mm256_fmadd_ps,
    _mm256_fnmadd_ps,
    _mm256_add_ps,
    _mm256_mul_ps,
    _mm256_sub_ps
);
