//! Dense kernels on a front: Cholesky of its panel, and the update matrix.

use super::front::FrontMemory;
use super::tile::{row_blocks, update_block};
use super::vector::{Kernel, Scalar, Vector};
use std::ops::Range;

/// What is left of a pivot: its column in the front and its value.
#[derive(Clone, Copy, Debug)]
pub(super) struct BadPivot<T> {
    pub column: usize,
    pub pivot: T,
}

/// Factors the diagonal band of column blocks `bands`: L of its rows, with reciprocal pivots.
pub(super) struct FactorBand<T> {
    pub memory: FrontMemory<T>,
    pub bands: Range<usize>,
}

impl<T: Scalar> Kernel<T> for FactorBand<T> {
    type Output = Result<(), BadPivot<T>>;
    #[inline(always)]
    unsafe fn run<V: Vector<T>>(self) -> Self::Output {
        // SAFETY: blocks lie in the panel.
        unsafe {
            let rows_end = self.bands.end.min(self.memory.front.blocks());
            for j in self.bands.clone() {
                factor_diagonal::<T, V>(&self.memory, j)?;
                let rows = j + 1..rows_end;
                row_blocks!(V, rows, solve_rows(&self.memory, j));
            }
            Ok(())
        }
    }
}

/// Rows of L below the band, given the band.
pub(super) struct FactorRows<T> {
    pub memory: FrontMemory<T>,
    pub bands: Range<usize>,
    pub rows: Range<usize>,
}

impl<T: Scalar> Kernel<T> for FactorRows<T> {
    type Output = ();
    #[inline(always)]
    unsafe fn run<V: Vector<T>>(self) {
        // SAFETY: blocks lie in the panel; the rows are below the band.
        unsafe {
            row_blocks!(V, self.rows, factor_rows(&self.memory, &self.bands));
        }
    }
}

#[inline(always)]
unsafe fn factor_rows<T: Scalar, V: Vector<T>, const R: usize>(
    memory: &FrontMemory<T>,
    bands: &Range<usize>,
    i: usize,
) {
    for j in bands.clone() {
        // SAFETY: as the caller.
        unsafe { solve_rows::<T, V, R>(memory, j, i) };
    }
}

#[inline(always)]
unsafe fn factor_diagonal<T: Scalar, V: Vector<T>>(memory: &FrontMemory<T>, j: usize) -> Result<(), BadPivot<T>> {
    let lanes = T::LANES;
    let columns = (memory.front.w - j * lanes).min(lanes);
    // SAFETY: block j holds columns up to j lanes + columns.
    unsafe {
        let block = memory.block(j);
        let c = block.add(j * lanes * lanes);
        update_block::<T, V, 1>(j * lanes, [block], block, [c], columns, false);
        for k in 0..columns {
            let column = j * lanes + k;
            let pivot = *c.add(k * lanes + k);
            let before = (*memory.diagonal().add(column)).to_f64();
            let value = pivot.to_f64();
            // Written so that NaN is refused.
            let sound = value > T::PIVOT_FLOOR * before && value.is_finite();
            if !sound {
                return Err(BadPivot { column, pivot });
            }
            let reciprocal = T::from_f64(1.0 / value.sqrt());
            *memory.reciprocals().add(column) = reciprocal;
            let x = V::load(c.add(k * lanes)).mul(V::splat(reciprocal));
            x.store(c.add(k * lanes));
            for t in k + 1..columns {
                let p = c.add(t * lanes);
                V::load(p).fnma(x, V::splat(*c.add(k * lanes + t))).store(p);
            }
            for l in 0..k {
                *c.add(k * lanes + l) = T::default();
            }
        }
    }
    Ok(())
}

/// Column block j of the rows i.. : subtract what is left of it, then solve with its diagonal block.
#[inline(always)]
unsafe fn solve_rows<T: Scalar, V: Vector<T>, const R: usize>(memory: &FrontMemory<T>, j: usize, i: usize) {
    let lanes = T::LANES;
    let columns = (memory.front.w - j * lanes).min(lanes);
    // SAFETY: blocks i.. are below j and hold all its columns.
    unsafe {
        let diagonal = memory.block(j);
        let rows: [*mut T; R] = std::array::from_fn(|q| memory.block(i + q));
        let c: [*mut T; R] = std::array::from_fn(|q| rows[q].add(j * lanes * lanes));
        if j > 0 {
            update_block::<T, V, R>(j * lanes, rows.map(|r| r as *const T), diagonal, c, columns, false);
        }
        let l = diagonal.add(j * lanes * lanes);
        let reciprocals = memory.reciprocals().add(j * lanes);
        for k in 0..columns {
            let scale = V::splat(*reciprocals.add(k));
            let mut x: [V; R] = std::array::from_fn(|q| V::load(c[q].add(k * lanes)));
            for t in 0..k {
                let factor = V::splat(*l.add(t * lanes + k));
                for q in 0..R {
                    x[q] = x[q].fnma(V::load(c[q].add(t * lanes)), factor);
                }
            }
            for q in 0..R {
                x[q].mul(scale).store(c[q].add(k * lanes));
            }
        }
    }
}

/// Update matrix blocks of these rows: U = -L21 L21^T.
pub(super) struct Update<T> {
    pub memory: FrontMemory<T>,
    pub rows: Range<usize>,
}

impl<T: Scalar> Kernel<T> for Update<T> {
    type Output = ();
    #[inline(always)]
    unsafe fn run<V: Vector<T>>(self) {
        // SAFETY: rows are blocks of the update matrix.
        unsafe {
            row_blocks!(V, self.rows, update_rows(&self.memory));
        }
    }
}

#[inline(always)]
unsafe fn update_rows<T: Scalar, V: Vector<T>, const R: usize>(memory: &FrontMemory<T>, i: usize) {
    let lanes = T::LANES;
    let front = &memory.front;
    let first = front.update_block();
    // SAFETY: block i of the update matrix is block first + i of the panel; it has i + 1 column blocks.
    unsafe {
        let rows: [*const T; R] = std::array::from_fn(|q| memory.block(first + i + q) as *const T);
        let out: [*mut T; R] = std::array::from_fn(|q| memory.update.add(front.update_start(i + q) * lanes));
        for j in 0..=i {
            let b = memory.block(first + j);
            let c = out.map(|p| p.add(j * lanes * lanes));
            update_block::<T, V, R>(front.w, rows, b, c, lanes, true);
        }
        for q in 1..R {
            for j in i + 1..=i + q {
                let c = out[q].add(j * lanes * lanes);
                update_block::<T, V, 1>(front.w, [rows[q]], memory.block(first + j), [c], lanes, true);
            }
        }
    }
}
