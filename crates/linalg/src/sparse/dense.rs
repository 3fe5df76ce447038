//! Dense kernels on a front: Cholesky of its panel, the update matrix, and the inversion that a solve reads.
//!
//! All of them are products of blocks of rows (`lanes` rows, one line a column), so they share one register tile:
//! C[rows x columns] = sum over k of A[rows, k] B[columns, k], where A and B are blocks as they are stored.

use super::layout::Front;
use super::vector::{Kernel, Scalar, Vector};
use std::marker::PhantomData;
use std::ops::Range;

/// Columns of the register tile.
const NC: usize = 8;
const NC_NARROW: usize = 4;
/// Row blocks of the register tile under wide registers.
const MR: usize = 3;

/// A front in memory: panel, update matrix and workspace.
pub(super) struct FrontMemory<T> {
    pub front: Front,
    pub panel: *mut T,
    pub update: *mut T,
    /// `Front::work_lines` lines: the copy of L11 by column blocks, then reciprocal pivots.
    pub work: *mut T,
}

impl<T> Clone for FrontMemory<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for FrontMemory<T> {}
// SAFETY: a front is handed from task to task; tasks that share one write disjoint row blocks.
unsafe impl<T: Send> Send for FrontMemory<T> {}
// SAFETY: as above.
unsafe impl<T: Sync> Sync for FrontMemory<T> {}

impl<T: Scalar> FrontMemory<T> {
    #[inline(always)]
    unsafe fn block(&self, b: usize) -> *mut T {
        // SAFETY: b is a block of the panel, or one past.
        unsafe { self.panel.add(self.front.block_start(b) * T::LANES) }
    }

    /// Reciprocal pivots.
    #[inline(always)]
    fn reciprocals(&self) -> *mut T {
        let lines = self.front.work_lines() - self.front.w.div_ceil(T::LANES);
        // SAFETY: within the workspace.
        unsafe { self.work.add(lines * T::LANES) }
    }

    /// Diagonal of the matrix before the elimination, `w` values.
    #[inline(always)]
    pub fn diagonal(&self) -> *mut T {
        let lines = self.front.work_lines() - 2 * self.front.w.div_ceil(T::LANES);
        // SAFETY: within the workspace.
        unsafe { self.work.add(lines * T::LANES) }
    }

    /// Row j of column block b of the copy of L11, j >= b lanes: the line of its columns in that block.
    #[inline(always)]
    unsafe fn copy_row(&self, b: usize, j: usize) -> *mut T {
        let lanes = T::LANES;
        // Column block b holds rows b lanes .. w.
        let start = b * self.front.w - lanes * (b * b.saturating_sub(1) / 2);
        // SAFETY: within the workspace.
        unsafe { self.work.add((start + j - b * lanes) * lanes) }
    }
}

/// acc[q][j] = sum over t < k of A_q[t] B[t][j]; a_q and b are lines, `stride` values apart.
#[inline(always)]
unsafe fn product<T: Scalar, V: Vector<T>, const R: usize, const C: usize>(
    k: usize,
    a: [*const T; R],
    b: *const T,
) -> [[V; C]; R] {
    // SAFETY: the caller promises k lines in every operand.
    unsafe {
        let mut acc = [[V::zero(); C]; R];
        for t in 0..k {
            let mut rows = [V::zero(); R];
            for q in 0..R {
                rows[q] = V::load(a[q].add(t * T::LANES));
            }
            for j in 0..C {
                let x = V::splat(*b.add(t * T::LANES + j));
                for q in 0..R {
                    acc[q][j] = acc[q][j].fma(rows[q], x);
                }
            }
        }
        acc
    }
}

/// C_q[j] -= sum over t < k of A_q[t] B[t][j] for the columns of one block; C_q are lines in memory.
/// With `negate`, C_q[j] = -(sum).
#[inline(always)]
unsafe fn update_block<T: Scalar, V: Vector<T>, const R: usize>(
    k: usize,
    a: [*const T; R],
    b: *const T,
    c: [*mut T; R],
    columns: usize,
    overwrite: bool,
) {
    // SAFETY: the caller promises the operands; columns <= LANES.
    unsafe {
        if V::WIDE {
            columns_of::<T, V, R, NC>(k, a, b, c, columns, overwrite);
        } else {
            columns_of::<T, V, R, NC_NARROW>(k, a, b, c, columns, overwrite);
        }
    }
}

#[inline(always)]
unsafe fn columns_of<T: Scalar, V: Vector<T>, const R: usize, const C: usize>(
    k: usize,
    a: [*const T; R],
    b: *const T,
    c: [*mut T; R],
    columns: usize,
    overwrite: bool,
) {
    // SAFETY: as `update_block`.
    unsafe {
        let mut j0 = 0;
        while j0 < columns {
            let acc = product::<T, V, R, C>(k, a, b.add(j0));
            for q in 0..R {
                for j in 0..C {
                    if j0 + j < columns {
                        let p = c[q].add((j0 + j) * T::LANES);
                        if overwrite {
                            acc[q][j].neg().store(p);
                        } else {
                            V::load(p).add(acc[q][j].neg()).store(p);
                        }
                    }
                }
            }
            j0 += C;
        }
    }
}

/// Calls `f` for `MR` row blocks at once where the registers allow it, then one by one.
macro_rules! row_blocks {
    ($v:ident, $rows:expr, $f:ident ( $($arg:expr),* )) => {{
        let rows: Range<usize> = $rows;
        let mut i = rows.start;
        if $v::WIDE {
            while i + MR <= rows.end {
                $f::<T, $v, MR>($($arg,)* i);
                i += MR;
            }
        }
        while i < rows.end {
            $f::<T, $v, 1>($($arg,)* i);
            i += 1;
        }
    }};
}

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
    pub _precision: PhantomData<T>,
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
