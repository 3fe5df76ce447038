//! An f32 factor corrected in f64.

use super::pattern::check_length;
use super::{Cholesky, SolveScratch, SparseError, SymPattern, Symbolic};
use rayon::prelude::*;
use std::sync::Arc;

/// Rows of a partial sum: fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 2048;
/// Conjugate gradient steps after which a solve gives up.
const MOST_STEPS: usize = 100;

/// A factor in `f32`, half the memory and bytes of an `f64` one, whose solves are corrected with the `f64` matrix.
///
/// A solve is the conjugate gradient method on A x = b preconditioned by the f32 factor: each step gains the
/// digits that the factor has, three to five. Where A is too ill-conditioned for an f32 factor, `refactor` says so.
pub struct MixedCholesky {
    factor: Cholesky<f32>,
    /// Both triangles by rows: where rows start, columns, slots and values.
    row_ptr: Vec<usize>,
    columns: Vec<u32>,
    slots: Vec<usize>,
    values: Vec<f64>,
}

/// Memory that corrected solves work in; grows at first use and then stays.
#[derive(Default)]
pub struct MixedScratch {
    solve: SolveScratch,
    x: Vec<f64>,
    r: Vec<f64>, // b - A x
    z: Vec<f64>, // M^-1 r
    p: Vec<f64>, // search direction
    q: Vec<f64>, // A p
    partial: Vec<f64>,
    columns: Vec<Column>,
}

impl MixedScratch {
    /// An empty scratch.
    pub fn new() -> Self {
        Self::default()
    }
}

/// How a corrected solve ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corrected {
    /// |b - A x| / |b| in the Euclidean norm, worst right-hand side.
    pub residual: f64,
    /// Solves with the f32 factor.
    pub steps: usize,
}

/// Scalars of one right-hand side.
#[derive(Clone, Copy, Default)]
struct Column {
    b2: f64,
    rz: f64,
    step: f64,
}

impl MixedCholesky {
    /// A factor without numbers yet.
    ///
    /// # Errors
    /// `symbolic` was made from a pattern of another size.
    pub fn new(pattern: &SymPattern, symbolic: Arc<Symbolic>) -> Result<Self, SparseError> {
        check_length("the analysed pattern", symbolic.n(), pattern.n())?;
        check_length("the analysed pattern's entries", symbolic.nnz(), pattern.nnz())?;
        let n = pattern.n();
        let mut row_ptr = vec![0usize; n + 1];
        for j in 0..n {
            for &i in pattern.column(j) {
                row_ptr[i as usize + 1] += 1;
                row_ptr[j + 1] += usize::from(i as usize != j);
            }
        }
        for i in 0..n {
            row_ptr[i + 1] += row_ptr[i];
        }
        let mut next = row_ptr.clone();
        let (mut columns, mut slots) = (vec![0u32; row_ptr[n]], vec![0usize; row_ptr[n]]);
        let mut put = |row: usize, column: usize, slot: usize| {
            columns[next[row]] = column as u32;
            slots[next[row]] = slot;
            next[row] += 1;
        };
        for j in 0..n {
            for slot in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
                let i = pattern.row_idx()[slot] as usize;
                put(i, j, slot);
                if i != j {
                    put(j, i, slot);
                }
            }
        }
        let values = vec![0.0; columns.len()];
        Ok(Self { factor: Cholesky::new(symbolic), row_ptr, columns, slots, values })
    }

    /// The f32 factor, whose own solves are uncorrected.
    pub fn factor(&self) -> &Cholesky<f32> {
        &self.factor
    }

    /// Computes the numbers of the factor, and keeps those of the matrix.
    ///
    /// # Errors
    /// See [`Cholesky::refactor`]; a pivot lost in f32 rounding is reported as not positive: use an `f64` factor.
    pub fn refactor(&mut self, values: &[f64]) -> Result<(), SparseError> {
        self.factor.refactor(values)?;
        self.values.par_iter_mut().zip(&self.slots).for_each(|(v, &slot)| *v = values[slot]);
        Ok(())
    }

    /// y = A x by rows.
    fn multiply(&self, x: &[f64], nrhs: usize, y: &mut [f64]) {
        y.par_chunks_mut(CHUNK * nrhs).enumerate().for_each(|(chunk, y)| {
            for (k, y) in y.chunks_exact_mut(nrhs).enumerate() {
                let row = chunk * CHUNK + k;
                y.fill(0.0);
                for at in self.row_ptr[row]..self.row_ptr[row + 1] {
                    let (a, j) = (self.values[at], self.columns[at] as usize);
                    for (y, x) in y.iter_mut().zip(&x[j * nrhs..]) {
                        *y += a * x;
                    }
                }
            }
        });
    }

    /// Solves A X = B in place to |b - A x| <= tolerance |b| for each right-hand side; `rhs` is n x nrhs, row by row.
    ///
    /// # Errors
    /// Wrong lengths, no numbers, or [`SparseError::NotConverged`], with the best solution found left in `rhs`:
    /// no f64 solution has residuals much below 1e-16 |A| |x| / |b|.
    pub fn solve_in_place(
        &self,
        rhs: &mut [f64],
        nrhs: usize,
        tolerance: f64,
        scratch: &mut MixedScratch,
    ) -> Result<Corrected, SparseError> {
        check_length("rhs", rhs.len(), self.factor.symbolic().n() * nrhs)?;
        if !self.factor.factored {
            return Err(SparseError::NotFactored);
        }
        if rhs.is_empty() {
            return Ok(Corrected { residual: 0.0, steps: 0 });
        }
        let MixedScratch { solve, x, r, z, p, q, partial, columns } = scratch;
        for v in [&mut *x, r, z, p, q] {
            v.resize(rhs.len(), 0.0);
        }
        partial.resize(rhs.len().div_ceil(CHUNK * nrhs) * nrhs, 0.0);
        columns.clear();
        columns.resize(nrhs, Column::default());
        x.fill(0.0);
        r.copy_from_slice(rhs);
        dot(r, r, nrhs, partial, |c, v| columns[c].b2 = v);
        let (mut steps, mut restart) = (0, true);
        // Residual at the last restart: the true one, which recurrences drift away from.
        let mut before = f64::INFINITY;
        let mut residual = 1.0;
        while steps < MOST_STEPS {
            z.copy_from_slice(r);
            self.factor.solve_in_place(z, nrhs, solve)?;
            steps += 1;
            // beta = z^T r_new / z_old^T r_old, and directions start anew from a true residual.
            dot(r, z, nrhs, partial, |c, v| {
                let column = &mut columns[c];
                column.step = if restart || column.rz == 0.0 { 0.0 } else { v / column.rz };
                column.rz = v;
            });
            combine(p, z, nrhs, columns, |p, z, beta| z + beta * p);
            self.multiply(p, nrhs, q);
            dot(p, q, nrhs, partial, |c, v| {
                let column = &mut columns[c];
                column.step = if v > 0.0 { column.rz / v } else { 0.0 };
            });
            combine(x, p, nrhs, columns, |x, p, alpha| x + alpha * p);
            combine(r, q, nrhs, columns, |r, q, alpha| r - alpha * q);
            restart = false;
            residual = relative(r, nrhs, partial, columns);
            if residual <= tolerance {
                self.multiply(x, nrhs, q);
                r.par_iter_mut().zip(&*rhs).zip(&*q).for_each(|((r, b), ax)| *r = b - ax);
                residual = relative(r, nrhs, partial, columns);
                if residual <= tolerance || residual > 0.5 * before {
                    break;
                }
                (before, restart) = (residual, true);
            }
        }
        rhs.copy_from_slice(x);
        if residual <= tolerance {
            Ok(Corrected { residual, steps })
        } else {
            Err(SparseError::NotConverged { residual, iterations: steps })
        }
    }
}

/// Worst |r| / |b| over columns; 0 / 0 is 0.
fn relative(r: &[f64], nrhs: usize, partial: &mut [f64], columns: &[Column]) -> f64 {
    let mut worst = 0.0f64;
    dot(r, r, nrhs, partial, |c, r2| {
        let ratio = if r2 == 0.0 { 0.0 } else { (r2 / columns[c].b2).sqrt() };
        worst = if ratio.is_nan() { f64::NAN } else { worst.max(ratio) };
    });
    worst
}

/// Column sums of a b, handed to `take(column, sum)`.
fn dot(a: &[f64], b: &[f64], nrhs: usize, partial: &mut [f64], mut take: impl FnMut(usize, f64)) {
    let size = CHUNK * nrhs;
    partial.par_chunks_mut(nrhs).zip(a.par_chunks(size).zip(b.par_chunks(size))).for_each(|(sum, (a, b))| {
        sum.fill(0.0);
        for (a, b) in a.chunks_exact(nrhs).zip(b.chunks_exact(nrhs)) {
            for (s, (a, b)) in sum.iter_mut().zip(a.iter().zip(b)) {
                *s += a * b;
            }
        }
    });
    for c in 0..nrhs {
        take(c, partial.iter().skip(c).step_by(nrhs).sum());
    }
}

/// y = f(y, x, step of the column).
fn combine(y: &mut [f64], x: &[f64], nrhs: usize, columns: &[Column], f: impl Fn(f64, f64, f64) -> f64 + Sync) {
    let size = CHUNK * nrhs;
    y.par_chunks_mut(size).zip(x.par_chunks(size)).for_each(|(y, x)| {
        for (y, x) in y.chunks_exact_mut(nrhs).zip(x.chunks_exact(nrhs)) {
            for ((y, x), column) in y.iter_mut().zip(x).zip(columns) {
                *y = f(*y, *x, column.step);
            }
        }
    });
}
