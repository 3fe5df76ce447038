//! An f32 factor corrected in f64.

use super::factor::power_of_two_below;
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
/// digits that the factor has, three to five. It is for memory, not for speed: on a mesh of 100,000 tetrahedra a
/// solve to 1e-12 takes three steps, four times as long as with an f64 factor. Where A is too ill-conditioned for an f32 factor, `refactor` says so.
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
    b: Vec<f64>,
    x: Vec<f64>,
    r: Vec<f64>, // b - A x
    z: Vec<f64>, // M^-1 r
    p: Vec<f64>, // search direction
    q: Vec<f64>, // A p
    partial: Vec<f64>,
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
    fn multiply<const NR: usize>(&self, x: &[[f64; NR]], y: &mut [[f64; NR]]) {
        y.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, y)| {
            for (k, y) in y.iter_mut().enumerate() {
                let row = chunk * CHUNK + k;
                let mut sum = [0.0; NR];
                let range = self.row_ptr[row]..self.row_ptr[row + 1];
                for (a, &j) in self.values[range.clone()].iter().zip(&self.columns[range]) {
                    let x = &x[j as usize];
                    for c in 0..NR {
                        sum[c] += a * x[c];
                    }
                }
                *y = sum;
            }
        });
    }

    /// Solves A X = B in place to |b - A x| <= tolerance |b| for each right-hand side; `rhs` is n x nrhs, row by row.
    ///
    /// Up to four right-hand sides share one pass over factor and matrix.
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
        check_length("rhs", rhs.len(), self.factor.symbolic().n().saturating_mul(nrhs))?;
        if !self.factor.factored {
            return Err(SparseError::NotFactored);
        }
        let mut end = Corrected { residual: 0.0, steps: 0 };
        let mut first = 0;
        while first < nrhs && !rhs.is_empty() {
            let count = (nrhs - first).min(4);
            let some = match count {
                1 => self.solve_some::<1>(rhs, nrhs, first, tolerance, scratch)?,
                2 => self.solve_some::<2>(rhs, nrhs, first, tolerance, scratch)?,
                3 => self.solve_some::<3>(rhs, nrhs, first, tolerance, scratch)?,
                _ => self.solve_some::<4>(rhs, nrhs, first, tolerance, scratch)?,
            };
            end.residual = worse(end.residual, some.residual);
            end.steps = end.steps.max(some.steps);
            first += count;
        }
        if end.residual <= tolerance {
            Ok(end)
        } else {
            Err(SparseError::NotConverged { residual: end.residual, iterations: end.steps })
        }
    }

    fn solve_some<const NR: usize>(
        &self,
        rhs: &mut [f64],
        nrhs: usize,
        first: usize,
        tolerance: f64,
        scratch: &mut MixedScratch,
    ) -> Result<Corrected, SparseError> {
        let n = self.factor.symbolic().n();
        let MixedScratch { solve, b, x, r, z, p, q, partial } = scratch;
        for v in [&mut *b, x, r, z, p, q] {
            v.resize((n * NR).max(v.len()), 0.0);
        }
        partial.resize((n.div_ceil(CHUNK) * NR).max(partial.len()), 0.0);
        let [b, x, r, z, p, q] = [b, x, r, z, p, q].map(|v| v[..n * NR].as_chunks_mut::<NR>().0);
        let partial = partial[..n.div_ceil(CHUNK) * NR].as_chunks_mut::<NR>().0;
        // In units of the largest entry, so that no square overflows or vanishes.
        let mut unit = [0.0f64; NR];
        for rhs in rhs.chunks_exact(nrhs) {
            for c in 0..NR {
                unit[c] = unit[c].max(rhs[first + c].abs());
            }
        }
        let unit = unit.map(|v| if v.is_normal() { power_of_two_below(v) } else { 1.0 });
        for (b, rhs) in b.iter_mut().zip(rhs.chunks_exact(nrhs)) {
            *b = std::array::from_fn(|c| rhs[first + c] / unit[c]);
        }
        x.fill([0.0; NR]);
        r.copy_from_slice(b);
        let b2 = dot(b, b, partial);
        let (mut steps, mut restart, mut rz) = (0, true, [0.0; NR]);
        // Residual at the last restart: the true one, which recurrences drift away from.
        let mut before = f64::INFINITY;
        let mut residual = relative(r, &b2, partial);
        while steps < MOST_STEPS && residual > tolerance {
            z.copy_from_slice(r);
            self.factor.solve_in_place(z.as_flattened_mut(), NR, solve)?;
            steps += 1;
            // beta = z^T r_new / z_old^T r_old; directions start anew from a true residual.
            let new = dot(r, z, partial);
            let ratio = |c: usize| if restart || rz[c] == 0.0 { 0.0 } else { new[c] / rz[c] };
            let beta: [f64; NR] = std::array::from_fn(ratio);
            rz = new;
            combine(p, z, |c, p, z| z + beta[c] * p);
            self.multiply(p, q);
            let curvature = dot(p, q, partial);
            let alpha: [f64; NR] = std::array::from_fn(|c| if curvature[c] > 0.0 { rz[c] / curvature[c] } else { 0.0 });
            combine(x, p, |c, x, p| x + alpha[c] * p);
            combine(r, q, |c, r, q| r - alpha[c] * q);
            restart = false;
            residual = relative(r, &b2, partial);
            if residual <= tolerance {
                self.multiply(x, q);
                r.copy_from_slice(b);
                combine(r, q, |_, b, ax| b - ax);
                residual = relative(r, &b2, partial);
                if residual > 0.5 * before {
                    break;
                }
                (before, restart) = (residual, true);
            }
        }
        for (x, rhs) in x.iter().zip(rhs.chunks_exact_mut(nrhs)) {
            for c in 0..NR {
                rhs[first + c] = x[c] * unit[c];
            }
        }
        Ok(Corrected { residual, steps })
    }
}

/// Worst |r| / |b| over columns; 0 / 0 is 0.
fn relative<const NR: usize>(r: &[[f64; NR]], b2: &[f64; NR], partial: &mut [[f64; NR]]) -> f64 {
    let r2 = dot(r, r, partial);
    (0..NR).fold(0.0, |worst: f64, c| {
        let ratio = if r2[c] == 0.0 { 0.0 } else { (r2[c] / b2[c]).sqrt() };
        worse(worst, ratio)
    })
}

/// The larger; NaN if either is.
fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || b <= a { a } else { b }
}

/// a^T b by columns.
fn dot<const NR: usize>(a: &[[f64; NR]], b: &[[f64; NR]], partial: &mut [[f64; NR]]) -> [f64; NR] {
    partial.par_iter_mut().zip(a.par_chunks(CHUNK).zip(b.par_chunks(CHUNK))).for_each(|(sum, (a, b))| {
        let mut s = [0.0; NR];
        for (a, b) in a.iter().zip(b) {
            for c in 0..NR {
                s[c] += a[c] * b[c];
            }
        }
        *sum = s;
    });
    partial.iter().fold([0.0; NR], |mut total, s| {
        for c in 0..NR {
            total[c] += s[c];
        }
        total
    })
}

/// y = f(column, y, x).
fn combine<const NR: usize>(y: &mut [[f64; NR]], x: &[[f64; NR]], f: impl Fn(usize, f64, f64) -> f64 + Sync) {
    y.par_chunks_mut(CHUNK).zip(x.par_chunks(CHUNK)).for_each(|(y, x)| {
        for (y, x) in y.iter_mut().zip(x) {
            for c in 0..NR {
                y[c] = f(c, y[c], x[c]);
            }
        }
    });
}
