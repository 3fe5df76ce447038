//! Instruction sets: the primitive operations of eight lanes under each of them.

use super::{Kernel, LANES};

/// The instruction sets that kernels are compiled for, from the least to the best.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// What every processor of the target has: SSE2 on x86-64, NEON on AArch64.
    Baseline,
    /// AVX2 with fused multiply-add.
    Avx2,
    /// AVX-512 F, DQ and VL.
    Avx512,
}

impl Level {
    /// The best that this machine has.
    #[inline]
    pub fn best() -> Level {
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl")
            {
                return Level::Avx512;
            }
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                return Level::Avx2;
            }
        }
        Level::Baseline
    }

    /// All that this machine has, from the least to the best.
    pub fn available() -> Vec<Level> {
        [Level::Baseline, Level::Avx2, Level::Avx512].into_iter().filter(|l| *l <= Level::best()).collect()
    }
}

mod sealed {
    pub trait Sealed {}
}

/// An instruction set. Sealed: values of its lane types exist only inside [`super::dispatch`], which has checked
/// that the machine has it.
pub trait Isa: sealed::Sealed + Copy + Send + Sync + 'static {
    /// Eight `f64`.
    type F: Copy + Send + Sync;
    /// Eight truth values.
    type M: Copy + Send + Sync;
    /// Which one it is.
    const LEVEL: Level;
    /// All lanes v.
    fn splat(v: f64) -> Self::F;
    /// From memory.
    fn load(a: &[f64; LANES]) -> Self::F;
    /// Of numbers in registers: those that were written to memory one by one are not to be read at once, which waits until
    /// the last of them has got there.
    fn of(lanes: [f64; LANES]) -> Self::F;
    /// (a0, a2, .., b0, b2, ..) and (a1, a3, .., b1, b3, ..).
    fn part(a: Self::F, b: Self::F) -> [Self::F; 2];
    /// What [`Self::part`] has parted.
    fn join(even: Self::F, odd: Self::F) -> [Self::F; 2];
    /// To memory.
    fn store(v: Self::F, a: &mut [f64; LANES]);
    /// a + b
    fn add(a: Self::F, b: Self::F) -> Self::F;
    /// a - b
    fn sub(a: Self::F, b: Self::F) -> Self::F;
    /// a b
    fn mul(a: Self::F, b: Self::F) -> Self::F;
    /// a / b
    fn div(a: Self::F, b: Self::F) -> Self::F;
    /// a b + c
    fn mul_add(a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// -a
    fn neg(a: Self::F) -> Self::F;
    /// Square root.
    fn sqrt(a: Self::F) -> Self::F;
    /// 1 / a within two units in the last place, for 1e-300 <= |a| <= 1e300.
    fn fast_recip(a: Self::F) -> Self::F;
    /// 1 / sqrt(a) within two units in the last place, for 1e-300 <= a <= 1e300.
    fn rsqrt(a: Self::F) -> Self::F;
    /// |a|
    fn abs(a: Self::F) -> Self::F;
    /// a < b ? a : b
    fn min(a: Self::F, b: Self::F) -> Self::F;
    /// a > b ? a : b
    fn max(a: Self::F, b: Self::F) -> Self::F;
    /// |a| with the sign bit of b.
    fn copysign(a: Self::F, b: Self::F) -> Self::F;
    /// (e, m), a = m 2^e, 1 <= m < 2, for positive normal a.
    fn exponent_and_mantissa(a: Self::F) -> (Self::F, Self::F);
    /// 2^a for whole a from -1022 to 1023.
    fn exp2_int(a: Self::F) -> Self::F;
    /// a < b
    fn lt(a: Self::F, b: Self::F) -> Self::M;
    /// a <= b
    fn le(a: Self::F, b: Self::F) -> Self::M;
    /// m ? a : b
    fn select(m: Self::M, a: Self::F, b: Self::F) -> Self::F;
    /// Lane-wise and.
    fn and(a: Self::M, b: Self::M) -> Self::M;
    /// Lane-wise or.
    fn or(a: Self::M, b: Self::M) -> Self::M;
    /// Lane-wise not.
    fn not(a: Self::M) -> Self::M;
    /// One bit a lane.
    fn bits(a: Self::M) -> u8;
}

/// Plain arrays, which the compiler turns into what the target always has.
#[derive(Clone, Copy)]
pub(super) struct Baseline;

impl sealed::Sealed for Baseline {}

#[inline(always)]
fn each<A: Copy, B>(a: [A; LANES], f: impl Fn(A) -> B) -> [B; LANES] {
    std::array::from_fn(|l| f(a[l]))
}

#[inline(always)]
fn both<A: Copy, B>(a: [A; LANES], b: [A; LANES], f: impl Fn(A, A) -> B) -> [B; LANES] {
    std::array::from_fn(|l| f(a[l], b[l]))
}

impl Isa for Baseline {
    type F = [f64; LANES];
    type M = [bool; LANES];
    const LEVEL: Level = Level::Baseline;
    #[inline(always)]
    fn splat(v: f64) -> Self::F {
        [v; LANES]
    }
    #[inline(always)]
    fn load(a: &[f64; LANES]) -> Self::F {
        *a
    }
    #[inline(always)]
    fn of(lanes: [f64; LANES]) -> Self::F {
        lanes
    }
    #[inline(always)]
    fn part(a: Self::F, b: Self::F) -> [Self::F; 2] {
        [[a[0], a[2], a[4], a[6], b[0], b[2], b[4], b[6]], [a[1], a[3], a[5], a[7], b[1], b[3], b[5], b[7]]]
    }
    #[inline(always)]
    fn join(e: Self::F, o: Self::F) -> [Self::F; 2] {
        [[e[0], o[0], e[1], o[1], e[2], o[2], e[3], o[3]], [e[4], o[4], e[5], o[5], e[6], o[6], e[7], o[7]]]
    }
    #[inline(always)]
    fn store(v: Self::F, a: &mut [f64; LANES]) {
        *a = v;
    }
    #[inline(always)]
    fn add(a: Self::F, b: Self::F) -> Self::F {
        both(a, b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(a: Self::F, b: Self::F) -> Self::F {
        both(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(a: Self::F, b: Self::F) -> Self::F {
        both(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn div(a: Self::F, b: Self::F) -> Self::F {
        both(a, b, |a, b| a / b)
    }
    #[inline(always)]
    fn mul_add(a: Self::F, b: Self::F, c: Self::F) -> Self::F {
        std::array::from_fn(|l| super::Real::mul_add(a[l], b[l], c[l]))
    }
    #[inline(always)]
    fn neg(a: Self::F) -> Self::F {
        each(a, |a| -a)
    }
    #[inline(always)]
    fn sqrt(a: Self::F) -> Self::F {
        each(a, f64::sqrt)
    }
    #[inline(always)]
    fn fast_recip(a: Self::F) -> Self::F {
        each(a, |a| 1.0 / a)
    }
    #[inline(always)]
    fn rsqrt(a: Self::F) -> Self::F {
        each(a, |a| 1.0 / a.sqrt())
    }
    #[inline(always)]
    fn abs(a: Self::F) -> Self::F {
        each(a, f64::abs)
    }
    #[inline(always)]
    fn min(a: Self::F, b: Self::F) -> Self::F {
        both(a, b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(a: Self::F, b: Self::F) -> Self::F {
        both(a, b, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn copysign(a: Self::F, b: Self::F) -> Self::F {
        both(a, b, f64::copysign)
    }
    #[inline(always)]
    fn exponent_and_mantissa(a: Self::F) -> (Self::F, Self::F) {
        let parts = each(a, super::Real::exponent_and_mantissa);
        (each(parts, |p| p.0), each(parts, |p| p.1))
    }
    #[inline(always)]
    fn exp2_int(a: Self::F) -> Self::F {
        each(a, super::Real::exp2_int)
    }
    #[inline(always)]
    fn lt(a: Self::F, b: Self::F) -> Self::M {
        both(a, b, |a, b| a < b)
    }
    #[inline(always)]
    fn le(a: Self::F, b: Self::F) -> Self::M {
        both(a, b, |a, b| a <= b)
    }
    #[inline(always)]
    fn select(m: Self::M, a: Self::F, b: Self::F) -> Self::F {
        std::array::from_fn(|l| if m[l] { a[l] } else { b[l] })
    }
    #[inline(always)]
    fn and(a: Self::M, b: Self::M) -> Self::M {
        both(a, b, |a, b| a & b)
    }
    #[inline(always)]
    fn or(a: Self::M, b: Self::M) -> Self::M {
        both(a, b, |a, b| a | b)
    }
    #[inline(always)]
    fn not(a: Self::M) -> Self::M {
        each(a, |a| !a)
    }
    #[inline(always)]
    fn bits(a: Self::M) -> u8 {
        (0..LANES).fold(0, |bits, l| bits | (u8::from(a[l]) << l))
    }
}

#[cfg(target_arch = "x86_64")]
mod x86;

/// Runs a kernel at `level`, which the caller has limited to what the machine has.
#[inline]
#[allow(unsafe_code)]
pub(super) fn dispatch_at<K: Kernel>(level: Level, kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    match level {
        // SAFETY: `level` is at most `Level::best()`, which has detected these features on this machine.
        Level::Avx512 => return unsafe { x86::run_avx512(kernel) },
        // SAFETY: as above.
        Level::Avx2 => return unsafe { x86::run_avx2(kernel) },
        Level::Baseline => {}
    }
    let _ = level;
    kernel.run::<Baseline>()
}
