//! What a solve reads instead of L: `L11^-1` and `-L21 L11^-1`, in place of L.

use super::front::FrontMemory;
use super::tile::{row_blocks, update_block};
use super::vector::{Kernel, Scalar, Vector};
use std::ops::Range;

/// Copies L11 by column blocks, and puts the identity in its place.
pub(super) fn copy_triangle<T: Scalar>(memory: &FrontMemory<T>) {
    let (lanes, w) = (T::LANES, memory.front.w);
    for i in 0..w.div_ceil(lanes) {
        for j in 0..=i {
            for k in j * lanes..((j + 1) * lanes).min(w) {
                for row in i * lanes..((i + 1) * lanes).min(w) {
                    // SAFETY: row >= column block start; both in the panel.
                    unsafe {
                        let value = memory.block(i).add(k * lanes + row % lanes);
                        *memory.copy_row(j, row).add(k % lanes) = *value;
                        // The inversion negates what it starts from.
                        *value = if row == k { T::from_f64(-1.0) } else { T::default() };
                    }
                }
            }
        }
    }
}

/// Solves X L11 = [I; -L21] for these row blocks, in place of [-I; L21].
pub(super) struct Invert<T> {
    pub memory: FrontMemory<T>,
    pub rows: Range<usize>,
}

impl<T: Scalar> Kernel<T> for Invert<T> {
    type Output = ();
    #[inline(always)]
    unsafe fn run<V: Vector<T>>(self) {
        let full = (self.memory.front.w / T::LANES).clamp(self.rows.start, self.rows.end);
        // SAFETY: blocks of the panel. Blocks of the triangle have different lengths, so they go one by one.
        unsafe {
            for i in self.rows.start..full {
                invert_rows::<T, V, 1>(&self.memory, i);
            }
            row_blocks!(V, full..self.rows.end, invert_rows(&self.memory));
        }
    }
}

#[inline(always)]
unsafe fn invert_rows<T: Scalar, V: Vector<T>, const R: usize>(memory: &FrontMemory<T>, i: usize) {
    let lanes = T::LANES;
    // SAFETY: all R blocks hold the same columns, `end` of them.
    unsafe {
        let rows: [*mut T; R] = std::array::from_fn(|q| memory.block(i + q));
        let end = memory.front.block_columns(i);
        for j in (0..end.div_ceil(lanes)).rev() {
            let start = j * lanes;
            let columns = (end - start).min(lanes);
            let c: [*mut T; R] = std::array::from_fn(|q| rows[q].add(start * lanes));
            for q in 0..R {
                for k in 0..columns {
                    let p = c[q].add(k * lanes);
                    V::load(p).neg().store(p);
                }
            }
            let done = start + columns;
            if end > done {
                let a: [*const T; R] = std::array::from_fn(|q| rows[q].add(done * lanes) as *const T);
                update_block::<T, V, R>(end - done, a, memory.copy_row(j, done), c, columns, false);
            }
            let reciprocals = memory.reciprocals().add(start);
            for k in (0..columns).rev() {
                let mut x: [V; R] = std::array::from_fn(|q| V::load(c[q].add(k * lanes)));
                for t in k + 1..columns {
                    let factor = V::splat(*memory.copy_row(j, start + t).add(k));
                    for q in 0..R {
                        x[q] = x[q].fnma(V::load(c[q].add(t * lanes)), factor);
                    }
                }
                let scale = V::splat(*reciprocals.add(k));
                for q in 0..R {
                    x[q].mul(scale).store(c[q].add(k * lanes));
                }
            }
        }
    }
}
