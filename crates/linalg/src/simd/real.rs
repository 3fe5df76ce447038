//! The arithmetic that kernels and energies are written in.

use std::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, Neg, Not, Sub, SubAssign};

/// A truth value, or one for each lane.
pub trait Mask: Copy + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> {
    /// Whether it holds in any lane.
    fn any(self) -> bool;
    /// Whether it holds in all lanes.
    fn all(self) -> bool;
    /// In how many lanes it holds.
    fn count(self) -> u32;
}

/// `f64`, or several of them side by side. Branches become [`Real::select`].
pub trait Real:
    Copy
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
    + AddAssign
    + SubAssign
{
    /// The result of a comparison.
    type Mask: Mask;

    /// The constant `v`.
    fn splat(v: f64) -> Self;
    /// `self * a + b`, fused where the instruction set can.
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// 1 / self within two units in the last place, for 1e-300 <= |self| <= 1e300. Cheaper than [`Real::recip`] where
    /// the instruction set has a first approximation. Outside that range the value is unspecified (NaN gives NaN).
    fn fast_recip(self) -> Self;
    /// 1 / sqrt(self) within two units in the last place, for 1e-300 <= self <= 1e300; outside as [`Real::fast_recip`].
    fn rsqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// The smaller one.
    fn min(self, o: Self) -> Self;
    /// The larger one.
    fn max(self, o: Self) -> Self;
    /// Magnitude of `self` with the sign bit of `sign`.
    fn copysign(self, sign: Self) -> Self;
    /// Natural logarithm, below one unit in the last place off; -inf at 0, NaN below 0.
    fn ln(self) -> Self;
    /// (e, m) with self = m 2^e and 1 <= m < 2, for positive normal numbers.
    fn exponent_and_mantissa(self) -> (Self, Self);
    /// 2^self for a whole number from -1022 to 1023.
    fn exp2_int(self) -> Self;
    /// self < o
    fn lt(self, o: Self) -> Self::Mask;
    /// self <= o
    fn le(self, o: Self) -> Self::Mask;
    /// `yes` where the mask holds, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// 0
    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }
    /// 1
    #[inline(always)]
    fn one() -> Self {
        Self::splat(1.0)
    }
    /// 1 / self
    #[inline(always)]
    fn recip(self) -> Self {
        Self::splat(1.0) / self
    }
    /// self > o
    #[inline(always)]
    fn gt(self, o: Self) -> Self::Mask {
        o.lt(self)
    }
    /// self >= o
    #[inline(always)]
    fn ge(self, o: Self) -> Self::Mask {
        o.le(self)
    }
    /// Neither infinite nor NaN.
    #[inline(always)]
    fn is_finite(self) -> Self::Mask {
        self.abs().le(Self::splat(f64::MAX))
    }
}

impl Mask for bool {
    #[inline(always)]
    fn any(self) -> bool {
        self
    }
    #[inline(always)]
    fn all(self) -> bool {
        self
    }
    #[inline(always)]
    fn count(self) -> u32 {
        u32::from(self)
    }
}

impl Real for f64 {
    type Mask = bool;
    #[inline(always)]
    fn splat(v: f64) -> f64 {
        v
    }
    #[inline(always)]
    fn mul_add(self, a: f64, b: f64) -> f64 {
        // Without a fused instruction f64::mul_add is a slow library call.
        if cfg!(any(target_feature = "fma", target_arch = "aarch64")) { f64::mul_add(self, a, b) } else { self * a + b }
    }
    #[inline(always)]
    fn sqrt(self) -> f64 {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn fast_recip(self) -> f64 {
        1.0 / self
    }
    #[inline(always)]
    fn rsqrt(self) -> f64 {
        1.0 / f64::sqrt(self)
    }
    #[inline(always)]
    fn abs(self) -> f64 {
        f64::abs(self)
    }
    #[inline(always)]
    fn min(self, o: f64) -> f64 {
        if self < o { self } else { o }
    }
    #[inline(always)]
    fn max(self, o: f64) -> f64 {
        if self > o { self } else { o }
    }
    #[inline(always)]
    fn copysign(self, sign: f64) -> f64 {
        f64::copysign(self, sign)
    }
    #[inline(always)]
    fn ln(self) -> f64 {
        f64::ln(self)
    }
    #[inline(always)]
    fn exponent_and_mantissa(self) -> (f64, f64) {
        let bits = self.to_bits();
        let e = ((bits >> 52) & 0x7ff) as i64 - 1023;
        (e as f64, f64::from_bits(bits & 0x000f_ffff_ffff_ffff | 0x3ff0_0000_0000_0000))
    }
    #[inline(always)]
    fn exp2_int(self) -> f64 {
        f64::from_bits(((self as i64 + 1023) as u64) << 52)
    }
    #[inline(always)]
    fn lt(self, o: f64) -> bool {
        self < o
    }
    #[inline(always)]
    fn le(self, o: f64) -> bool {
        self <= o
    }
    #[inline(always)]
    fn select(mask: bool, yes: f64, no: f64) -> f64 {
        if mask { yes } else { no }
    }
}
