//! One cache line of f64 or f32 under each instruction set, and the choice among them at run time.

use super::sweep::stride;
use crate::simd::Level;

/// The precision of a factor: `f64` or `f32`. Sealed.
pub trait Scalar: sealed::Sealed + Copy + Send + Sync + PartialOrd + std::fmt::Debug + 'static {}

impl Scalar for f64 {}
impl Scalar for f32 {}

pub(super) mod sealed {
    /// What kernels need of a precision.
    pub trait Sealed: Sized + Default {
        /// Values in a line.
        const LANES: usize;
        /// A pivot below this share of its diagonal entry is rounding error: some hundred (f64) or sixteen (f32)
        /// units in the last place.
        const PIVOT_FLOOR: f64;
        /// True if matrices are scaled to a unit diagonal, to stay within the exponent range.
        const SCALED: bool;
        /// Rounded from f64.
        fn from_f64(v: f64) -> Self;
        /// Widened to f64.
        fn to_f64(self) -> f64;
        /// a + b
        fn sum(a: Self, b: Self) -> Self;
        /// Runs a kernel under an instruction set, or the best that this machine has if that is less.
        fn dispatch<K: super::Kernel<Self>>(level: super::Level, kernel: K) -> K::Output;
    }
}

/// Values in one cache line, aligned.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Line([u8; 64]);

impl Line {
    pub const ZERO: Self = Line([0; 64]);
}

/// From which lane of one line each lane of another takes its value.
#[derive(Clone, Copy, Debug, Default)]
pub struct Route {
    /// Lane by lane of the receiving line; any where none is to be taken.
    pub from: [u8; 16],
}

impl Route {
    /// Lane by lane, for what has no instruction for it.
    ///
    /// # Safety
    /// Two lines; `lanes`, and what they take, are lanes of theirs.
    #[inline(always)]
    pub(super) unsafe fn add<T: Scalar>(&self, line: *const T, lanes: u16, to: *mut T) {
        let mut open = lanes;
        while open != 0 {
            let t = open.trailing_zeros() as usize;
            // SAFETY: the caller's promise.
            unsafe { *to.add(t) = T::sum(*to.add(t), *line.add(self.from[t] as usize)) };
            open &= open - 1;
        }
    }
}

/// A computation over lines of T; `run` and all it calls in hot loops must be `#[inline(always)]`.
pub trait Kernel<T> {
    type Output;
    /// # Safety
    /// The machine has V's instruction set.
    unsafe fn run<V: Vector<T>>(self) -> Self::Output;
}

/// One line of T in registers. All methods require the machine to have the instruction set.
pub trait Vector<T>: Copy {
    /// Row blocks and columns of the register tile of the matrix product; both fit in the registers.
    const WIDE: bool;
    unsafe fn zero() -> Self;
    unsafe fn splat(v: T) -> Self;
    /// `p` points to `LANES` values, aligned to a line.
    unsafe fn load(p: *const T) -> Self;
    /// As `load`.
    unsafe fn store(self, p: *mut T);
    /// self + a b
    unsafe fn fma(self, a: Self, b: Self) -> Self;
    /// self - a b
    unsafe fn fnma(self, a: Self, b: Self) -> Self;
    unsafe fn add(self, o: Self) -> Self;
    unsafe fn mul(self, o: Self) -> Self;
    unsafe fn neg(self) -> Self;
    /// Sum over lanes, in a fixed order.
    unsafe fn sum(self) -> T;
    /// A [`Route`] as `add_routed` takes it.
    type Routed: Copy;
    unsafe fn routed(route: &Route) -> Self::Routed;
    /// `to[t] += self[route.from[t]]` for the lanes t of `lanes`; the others stay. `to` is aligned to a line.
    unsafe fn add_routed(self, routed: Self::Routed, lanes: u16, to: *mut T);
    /// `vector[index[l], c] += v[c][l]` for rows of `stride(NR)` values.
    #[inline(always)]
    unsafe fn scatter_add<const NR: usize>(v: [Self; NR], index: *const u32, vector: *mut T)
    where
        T: Scalar,
    {
        let mut lines = [Line::ZERO; 4];
        let stride = stride(NR);
        // SAFETY: the caller promises LANES indices of rows.
        unsafe {
            for c in 0..NR {
                v[c].store((&raw mut lines[c]).cast());
            }
            let lines: *const T = lines.as_ptr().cast();
            for l in 0..T::LANES {
                let row = vector.add(*index.add(l) as usize * stride);
                for c in 0..NR {
                    *row.add(c) = T::sum(*row.add(c), *lines.add(c * T::LANES + l));
                }
            }
        }
    }
    /// `v[c][l] = vector[index[l], c]`.
    #[inline(always)]
    unsafe fn gather<const NR: usize>(vector: *const T, index: *const u32) -> [Self; NR]
    where
        T: Scalar,
    {
        let mut lines = [Line::ZERO; 4];
        let stride = stride(NR);
        // SAFETY: as `scatter_add`.
        unsafe {
            let to: *mut T = lines.as_mut_ptr().cast();
            for l in 0..T::LANES {
                let row = vector.add(*index.add(l) as usize * stride);
                for c in 0..NR {
                    *to.add(c * T::LANES + l) = *row.add(c);
                }
            }
            std::array::from_fn(|c| Self::load((&raw const lines[c]).cast()))
        }
    }
}

macro_rules! arrays {
    ($name:ident, $t:ty, $lanes:literal) => {
        /// Lines as plain arrays, for what the target always has.
        #[derive(Clone, Copy)]
        pub struct $name([$t; $lanes]);
        impl $name {
            #[inline(always)]
            fn zip(self, o: Self, f: impl Fn($t, $t) -> $t) -> Self {
                let mut v = self;
                for l in 0..$lanes {
                    v.0[l] = f(self.0[l], o.0[l]);
                }
                v
            }
        }
        // SAFETY (all methods): plain arithmetic; pointers are the caller's promise.
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
                $name([0.0; $lanes])
            }
            #[inline(always)]
            unsafe fn splat(v: $t) -> Self {
                $name([v; $lanes])
            }
            #[inline(always)]
            unsafe fn load(p: *const $t) -> Self {
                // SAFETY: the caller promises LANES values.
                $name(unsafe { *p.cast() })
            }
            #[inline(always)]
            unsafe fn store(self, p: *mut $t) {
                // SAFETY: the caller promises LANES values.
                unsafe { *p.cast() = self.0 };
            }
            #[inline(always)]
            unsafe fn fma(self, a: Self, b: Self) -> Self {
                // AArch64 always has a fused multiply-add; the x86-64 baseline does not, and would call a library.
                if cfg!(target_arch = "aarch64") {
                    let mut v = self;
                    for l in 0..$lanes {
                        v.0[l] = a.0[l].mul_add(b.0[l], v.0[l]);
                    }
                    v
                } else {
                    self.zip(a.zip(b, |a, b| a * b), |s, p| s + p)
                }
            }
            #[inline(always)]
            unsafe fn fnma(self, a: Self, b: Self) -> Self {
                // SAFETY: as `fma`.
                unsafe { self.fma(a.neg(), b) }
            }
            #[inline(always)]
            unsafe fn add(self, o: Self) -> Self {
                self.zip(o, |a, b| a + b)
            }
            #[inline(always)]
            unsafe fn mul(self, o: Self) -> Self {
                self.zip(o, |a, b| a * b)
            }
            #[inline(always)]
            unsafe fn neg(self) -> Self {
                self.zip(self, |a, _| -a)
            }
            #[inline(always)]
            unsafe fn sum(self) -> $t {
                let mut v = self.0;
                let mut half = $lanes / 2;
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
arrays!(F64Array, f64, 8);
arrays!(F32Array, f32, 16);

macro_rules! scalar {
    ($t:ident, $lanes:literal, $floor:literal, $scaled:literal, $array:ident, $avx2:ident, $avx512:ident) => {
        impl sealed::Sealed for $t {
            const LANES: usize = $lanes;
            const PIVOT_FLOOR: f64 = $floor * $t::EPSILON as f64;
            const SCALED: bool = $scaled;
            #[inline(always)]
            fn from_f64(v: f64) -> Self {
                v as $t
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                self as f64
            }
            #[inline(always)]
            fn sum(a: Self, b: Self) -> Self {
                a + b
            }
            #[inline]
            fn dispatch<K: Kernel<Self>>(level: Level, kernel: K) -> K::Output {
                #[cfg(target_arch = "x86_64")]
                {
                    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
                    unsafe fn avx512<K: Kernel<$t>>(kernel: K) -> K::Output {
                        // SAFETY: this function runs only where these sets were detected.
                        unsafe { kernel.run::<super::x86::$avx512>() }
                    }
                    #[target_feature(enable = "avx2,fma")]
                    unsafe fn avx2<K: Kernel<$t>>(kernel: K) -> K::Output {
                        // SAFETY: as above.
                        unsafe { kernel.run::<super::x86::$avx2>() }
                    }
                    match level.min(Level::best()) {
                        // SAFETY: `best` has detected the sets.
                        Level::Avx512 => return unsafe { avx512(kernel) },
                        // SAFETY: as above.
                        Level::Avx2 => return unsafe { avx2(kernel) },
                        Level::Baseline => {}
                    }
                }
                let _ = level;
                // SAFETY: arrays need no instruction set.
                unsafe { kernel.run::<$array>() }
            }
        }
    };
}
scalar!(f64, 8, 256.0, false, F64Array, F64Avx2, F64Avx512);
scalar!(f32, 16, 16.0, true, F32Array, F32Avx2, F32Avx512);
