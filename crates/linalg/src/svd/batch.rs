//! Decompositions of many matrices, eight side by side.
//!
//! Memory is in blocks `[block][component][lane]` (see [`crate::simd`]); components are the entries by rows. Lanes
//! beyond the last matrix of a batch may hold anything: no lane changes another.

use super::{Eigen, Svd, eig2_sym, eig3_sym, svd2, svd3, svd21, svd31, svd32};
use crate::simd::{F8, Isa, Kernel, LANES, Real, dispatch};
use rayon::prelude::*;
use std::marker::PhantomData;

/// Whether a batch runs on one thread or on rayon's current pool. The results are the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Par {
    /// The calling thread.
    Seq,
    /// The current pool, in chunks of a fixed number of blocks.
    Rayon,
}

/// The slices of a batch do not have the same number of blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BatchSizeError {
    /// Which slice does not fit, for example `"u"`.
    pub slice: &'static str,
    /// Its length.
    pub length: usize,
    /// The length that fits the others; for the input, the next multiple of its block.
    pub expected: usize,
}

impl std::fmt::Display for BatchSizeError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "slice `{}` has {} numbers, but the batch needs {}: give whole blocks of {LANES} lanes",
            self.slice, self.length, self.expected
        )
    }
}

impl std::error::Error for BatchSizeError {}

/// Blocks of a parallel chunk: long enough to hide the cost of handing it over, short enough to balance.
const CHUNK: usize = 128;

/// A decomposition of one block.
trait Decomposition {
    /// Components of the input.
    const IN: usize;
    /// Components of each output; 0 where there is no third one.
    const OUT: [usize; 3];
    /// Decomposes one block.
    fn block<I: Isa>(input: &[f64], out: [&mut [f64]; 3]);
}

/// A = U diag(s) V^T, as outputs u, s, v.
struct Singular<const ROWS: usize, const COLS: usize>;

/// A = Q diag(lambda) Q^T, as outputs q, lambda.
struct Symmetric<const N: usize>;

macro_rules! singular {
    ($rows:literal $cols:literal $svd:ident) => {
        impl Decomposition for Singular<$rows, $cols> {
            const IN: usize = $rows * $cols;
            const OUT: [usize; 3] = [$rows * $rows, $cols, $cols * $cols];
            #[inline(always)]
            fn block<I: Isa>(input: &[f64], out: [&mut [f64]; 3]) {
                let Svd { u, s, v } = $svd(load::<I, $rows, $cols>(input));
                store(u, out[0]);
                store([s], out[1]);
                store(v, out[2]);
            }
        }
    };
}
singular!(3 3 svd3);
singular!(3 2 svd32);
singular!(2 2 svd2);
singular!(3 1 svd31);
singular!(2 1 svd21);

macro_rules! symmetric {
    ($n:literal $components:literal $eigen:ident) => {
        impl Decomposition for Symmetric<$n> {
            const IN: usize = $components;
            const OUT: [usize; 3] = [$n * $n, $n, 0];
            #[inline(always)]
            fn block<I: Isa>(input: &[f64], out: [&mut [f64]; 3]) {
                let [components] = load::<I, 1, $components>(input);
                let Eigen { q, lambda } = $eigen(components);
                store(q, out[0]);
                store([lambda], out[1]);
            }
        }
    };
}
symmetric!(3 6 eig3_sym);
symmetric!(2 3 eig2_sym);

/// A block as a matrix.
#[inline(always)]
fn load<I: Isa, const R: usize, const C: usize>(from: &[f64]) -> [[F8<I>; C]; R] {
    let mut m = [[F8::zero(); C]; R];
    for r in 0..R {
        for c in 0..C {
            m[r][c] = F8::load_at(from, C * r + c);
        }
    }
    m
}

/// A matrix as a block.
#[inline(always)]
fn store<I: Isa, const R: usize, const C: usize>(m: [[F8<I>; C]; R], to: &mut [f64]) {
    for r in 0..R {
        for c in 0..C {
            m[r][c].store_at(to, C * r + c);
        }
    }
}

/// Input and outputs with the same number of blocks.
struct Chunk<'a, D> {
    input: &'a [f64],
    out: [&'a mut [f64]; 3],
    decomposition: PhantomData<D>,
}

impl<D: Decomposition> Kernel for Chunk<'_, D> {
    type Output = ();
    #[inline(always)]
    fn run<I: Isa>(self) {
        let [one, two, three] = self.out;
        for (block, input) in self.input.chunks_exact(D::IN * LANES).enumerate() {
            let out = [part(one, block, D::OUT[0]), part(two, block, D::OUT[1]), part(three, block, D::OUT[2])];
            D::block::<I>(input, out);
        }
    }
}

/// A block of this many components.
#[inline(always)]
fn part(out: &mut [f64], block: usize, components: usize) -> &mut [f64] {
    &mut out[block * components * LANES..(block + 1) * components * LANES]
}

fn run<D: Decomposition>(
    par: Par,
    names: [&'static str; 4],
    input: &[f64],
    out: [&mut [f64]; 3],
) -> Result<(), BatchSizeError> {
    let blocks = input.len().div_ceil(D::IN * LANES);
    let check = |slice, length, expected| {
        if length == expected { Ok(()) } else { Err(BatchSizeError { slice, length, expected }) }
    };
    check(names[0], input.len(), blocks * D::IN * LANES)?;
    for k in 0..3 {
        check(names[k + 1], out[k].len(), blocks * D::OUT[k] * LANES)?;
    }
    if par == Par::Seq {
        dispatch(Chunk::<D> { input, out, decomposition: PhantomData });
        return Ok(());
    }
    let [one, two, three] = out;
    let size = |components: usize| components * LANES * CHUNK;
    let chunks =
        input.par_chunks(size(D::IN)).zip(one.par_chunks_mut(size(D::OUT[0]))).zip(two.par_chunks_mut(size(D::OUT[1])));
    let kernel = |((input, one), two), three| {
        dispatch(Chunk::<D> { input, out: [one, two, three], decomposition: PhantomData });
    };
    // An output that is not there cannot be cut into chunks.
    if D::OUT[2] == 0 {
        chunks.for_each(|c| kernel(c, &mut []));
    } else {
        chunks.zip(three.par_chunks_mut(size(D::OUT[2]))).for_each(|(c, three)| kernel(c, three));
    }
    Ok(())
}

macro_rules! singular_batch {
    ($name:ident $svd:ident $rows:literal $cols:literal, $u:literal $s:literal $v:literal) => {
        #[doc = concat!("[`", stringify!($svd), "`] of every matrix in blocks of ", stringify!($rows), " x ",
            stringify!($cols), " components: u gets ", stringify!($u), ", s ", stringify!($s), " and v ", stringify!($v),
            " components a block.")]
        ///
        /// # Errors
        /// If the slices do not hold the same whole number of blocks; nothing is written then.
        pub fn $name(
            par: Par,
            a: &[f64],
            u: &mut [f64],
            s: &mut [f64],
            v: &mut [f64],
        ) -> Result<(), BatchSizeError> {
            run::<Singular<$rows, $cols>>(par, ["a", "u", "s", "v"], a, [u, s, v])
        }
    };
}
singular_batch!(svd3_batch svd3 3 3, 9 3 9);
singular_batch!(svd32_batch svd32 3 2, 9 2 4);
singular_batch!(svd2_batch svd2 2 2, 4 2 4);
singular_batch!(svd31_batch svd31 3 1, 9 1 1);
singular_batch!(svd21_batch svd21 2 1, 4 1 1);

/// [`eig3_sym`] of every matrix in blocks of 6 components: q gets 9, lambda 3 components a block.
///
/// # Errors
/// If the slices do not hold the same whole number of blocks; nothing is written then.
pub fn eig3_sym_batch(par: Par, a: &[f64], q: &mut [f64], lambda: &mut [f64]) -> Result<(), BatchSizeError> {
    run::<Symmetric<3>>(par, ["a", "q", "lambda", ""], a, [q, lambda, &mut []])
}

/// [`eig2_sym`] of every matrix in blocks of 3 components: q gets 4, lambda 2 components a block.
///
/// # Errors
/// If the slices do not hold the same whole number of blocks; nothing is written then.
pub fn eig2_sym_batch(par: Par, a: &[f64], q: &mut [f64], lambda: &mut [f64]) -> Result<(), BatchSizeError> {
    run::<Symmetric<2>>(par, ["a", "q", "lambda", ""], a, [q, lambda, &mut []])
}
