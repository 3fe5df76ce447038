//! Eight `f64` lanes with the instruction set chosen at run time.
//!
//! Numerical kernels are written once, generic over [`Real`]: the same text is compiled for scalars
//! (`f64`, in tests and in rare paths) and for eight lanes ([`F8`]) with AVX-512, AVX2 + FMA, or
//! whatever the target's baseline offers (SSE2; NEON on AArch64). A [`Kernel`] is a loop over
//! blocks of eight elements; [`dispatch`] runs it under the best set that the machine has.
//!
//! Data in memory is kept in blocks: `[component][lane]`, eight lanes to a component, so that
//! a component is one 64-byte cache line.

mod isa;
mod ln;
mod real;

pub use isa::{Isa, Level};
pub use real::{Mask, Real};

use std::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, Neg, Not, Sub, SubAssign};

/// Number of lanes of [`F8`].
pub const LANES: usize = 8;

/// Eight `f64` under the instruction set `I`.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct F8<I: Isa>(I::F);

/// Eight truth values under the instruction set `I`.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct M8<I: Isa>(I::M);

/// A computation over lanes; `run` must be `#[inline(always)]`, and so must all that it calls in its
/// hot loop, so that it is compiled for the instruction set of `I`.
///
/// Closures are not: those given to `array::map` or `array::from_fn` are compiled for the baseline, and every operation on
/// lanes in them stays a call. Loops over small arrays do not have this trap.
pub trait Kernel {
    /// What the computation returns.
    type Output;
    /// The computation.
    fn run<I: Isa>(self) -> Self::Output;
}

/// Runs `kernel` under the best instruction set of this machine.
#[inline]
pub fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    isa::dispatch_at(Level::best(), kernel)
}

/// Runs `kernel` under a given instruction set, or under the best lower one that the machine has.
#[inline]
pub fn dispatch_at<K: Kernel>(level: Level, kernel: K) -> K::Output {
    isa::dispatch_at(level.min(Level::best()), kernel)
}

impl<I: Isa> F8<I> {
    /// Loads one block component.
    #[inline(always)]
    pub fn load(from: &[f64; LANES]) -> Self {
        F8(I::load(from))
    }

    /// Loads component `c` of a block slice: lanes `8 c .. 8 c + 8`.
    #[inline(always)]
    pub fn load_at(from: &[f64], c: usize) -> Self {
        let lanes: &[f64; LANES] = from[c * LANES..c * LANES + LANES].try_into().expect("eight lanes were sliced");
        F8(I::load(lanes))
    }

    /// Stores to one block component.
    #[inline(always)]
    pub fn store(self, to: &mut [f64; LANES]) {
        I::store(self.0, to);
    }

    /// Stores to component `c` of a block slice.
    #[inline(always)]
    pub fn store_at(self, to: &mut [f64], c: usize) {
        let lanes: &mut [f64; LANES] =
            (&mut to[c * LANES..c * LANES + LANES]).try_into().expect("eight lanes were sliced");
        I::store(self.0, lanes);
    }

    /// Lane l = `from[offset + stride * index[l]]`.
    #[inline(always)]
    pub fn gather(from: &[f64], index: &[u32; LANES], stride: usize, offset: usize) -> Self {
        let mut lanes = [0.0; LANES];
        for l in 0..LANES {
            lanes[l] = from[index[l] as usize * stride + offset];
        }
        Self::of(lanes)
    }

    /// Lanes that have just been put together, one by one.
    #[inline(always)]
    pub fn of(lanes: [f64; LANES]) -> Self {
        F8(I::of(lanes))
    }

    /// Two numbers of each of eight things, which lie thing by thing.
    #[inline(always)]
    pub fn pairs(from: &[f64; 2 * LANES]) -> [Self; 2] {
        let (halves, _) = from.as_chunks::<LANES>();
        let [first, second] = I::part(I::load(&halves[0]), I::load(&halves[1]));
        [F8(first), F8(second)]
    }

    /// Puts two numbers of each of eight things where [`Self::pairs`] takes them from.
    #[inline(always)]
    pub fn put_pairs(v: [Self; 2], to: &mut [f64; 2 * LANES]) {
        let (halves, _) = to.as_chunks_mut::<LANES>();
        let [first, second] = I::join(v[0].0, v[1].0);
        I::store(first, &mut halves[0]);
        I::store(second, &mut halves[1]);
    }

    /// The lanes as an array.
    #[inline(always)]
    pub fn to_array(self) -> [f64; LANES] {
        let mut a = [0.0; LANES];
        I::store(self.0, &mut a);
        a
    }

    /// Sum over the lanes in lane order.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        let a = self.to_array();
        ((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7]))
    }

    /// Largest lane (NaN lanes are passed over).
    #[inline(always)]
    pub fn max_lane(self) -> f64 {
        self.to_array().into_iter().fold(f64::NEG_INFINITY, f64::max)
    }

    /// Smallest lane (NaN lanes are passed over).
    #[inline(always)]
    pub fn min_lane(self) -> f64 {
        self.to_array().into_iter().fold(f64::INFINITY, f64::min)
    }
}

macro_rules! binary {
    ($($trait:ident $method:ident $op:ident),*) => {$(
        impl<I: Isa> $trait for F8<I> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self { F8(I::$op(self.0, o.0)) }
        }
        impl<I: Isa> $trait<f64> for F8<I> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: f64) -> Self { F8(I::$op(self.0, I::splat(o))) }
        }
    )*};
}
binary!(Add add add, Sub sub sub, Mul mul mul, Div div div);

impl<I: Isa> AddAssign for F8<I> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl<I: Isa> SubAssign for F8<I> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

impl<I: Isa> Neg for F8<I> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        F8(I::neg(self.0))
    }
}

impl<I: Isa> Real for F8<I> {
    type Mask = M8<I>;
    #[inline(always)]
    fn splat(v: f64) -> Self {
        F8(I::splat(v))
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        F8(I::mul_add(self.0, a.0, b.0))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        F8(I::sqrt(self.0))
    }
    #[inline(always)]
    fn fast_recip(self) -> Self {
        F8(I::fast_recip(self.0))
    }
    #[inline(always)]
    fn rsqrt(self) -> Self {
        F8(I::rsqrt(self.0))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        F8(I::abs(self.0))
    }
    #[inline(always)]
    fn min(self, o: Self) -> Self {
        F8(I::min(self.0, o.0))
    }
    #[inline(always)]
    fn max(self, o: Self) -> Self {
        F8(I::max(self.0, o.0))
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        F8(I::copysign(self.0, sign.0))
    }
    #[inline(always)]
    fn ln(self) -> Self {
        ln::ln(self)
    }
    #[inline(always)]
    fn exponent_and_mantissa(self) -> (Self, Self) {
        let (e, m) = I::exponent_and_mantissa(self.0);
        (F8(e), F8(m))
    }
    #[inline(always)]
    fn exp2_int(self) -> Self {
        F8(I::exp2_int(self.0))
    }
    #[inline(always)]
    fn lt(self, o: Self) -> M8<I> {
        M8(I::lt(self.0, o.0))
    }
    #[inline(always)]
    fn le(self, o: Self) -> M8<I> {
        M8(I::le(self.0, o.0))
    }
    #[inline(always)]
    fn select(mask: M8<I>, yes: Self, no: Self) -> Self {
        F8(I::select(mask.0, yes.0, no.0))
    }
}

impl<I: Isa> Mask for M8<I> {
    #[inline(always)]
    fn any(self) -> bool {
        I::bits(self.0) != 0
    }
    #[inline(always)]
    fn all(self) -> bool {
        I::bits(self.0) == 0xff
    }
    #[inline(always)]
    fn count(self) -> u32 {
        I::bits(self.0).count_ones()
    }
}

impl<I: Isa> M8<I> {
    /// One bit a lane, lane 0 lowest.
    #[inline(always)]
    pub fn bits(self) -> u8 {
        I::bits(self.0)
    }
}

impl<I: Isa> BitAnd for M8<I> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, o: Self) -> Self {
        M8(I::and(self.0, o.0))
    }
}

impl<I: Isa> BitOr for M8<I> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, o: Self) -> Self {
        M8(I::or(self.0, o.0))
    }
}

impl<I: Isa> Not for M8<I> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        M8(I::not(self.0))
    }
}

#[cfg(test)]
mod tests;
