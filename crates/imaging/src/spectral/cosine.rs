//! Cosine transforms of real fields in two dimensions: what a border that mirrors makes diagonal.

use super::Layout;
use super::kernel::Psf;
use rayon::prelude::*;
use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlanner};
use std::f64::consts::PI;
use std::sync::Arc;

/// Columns that are transformed together: a cache line of each row.
const BLOCK: usize = 8;

/// Row pairs that one task handles.
const PAIRS: usize = 8;

/// Cosine transforms of the second kind, C_k = sum_j x_j cos(pi (2j + 1) k / 2n), of two real sequences a, b at a time as
/// a + ib, by one complex transform of length n.
///
/// With v the even entries of x forwards and then the odd ones backwards, V its Fourier transform and
/// w_k = exp(-i pi k / 2n): C_k = (w_k V_k + conj(w_k) V_(n-k)) / 2, and V_k = conj(w_k) (C_k - i C_(n-k)), V_n = V_0, C_n = 0
/// (Makhoul 1980). Both are linear in x, hence hold for a + ib.
#[derive(Clone)]
pub(crate) struct Line {
    n: usize,
    forward: Arc<dyn Fft<f64>>,
    inverse: Arc<dyn Fft<f64>>,
    w: Vec<Complex64>,
}

impl Line {
    pub(crate) fn new(n: usize) -> Self {
        let mut planner = FftPlanner::new();
        let w = (0..n).map(|k| Complex64::from_polar(1.0, -0.5 * PI * k as f64 / n as f64)).collect();
        Line { n, forward: planner.plan_fft_forward(n), inverse: planner.plan_fft_inverse(n), w }
    }

    pub(crate) fn scratch_len(&self) -> usize {
        self.forward.get_inplace_scratch_len().max(self.inverse.get_inplace_scratch_len())
    }

    /// Where entry j of x stands in v.
    pub(crate) fn place(&self, j: usize) -> usize {
        if j.is_multiple_of(2) { j / 2 } else { self.n - 1 - j / 2 }
    }

    /// v, already permuted, to C.
    pub(crate) fn transform(&self, v: &mut [Complex64], scratch: &mut [Complex64]) {
        let n = self.n;
        self.forward.process_with_scratch(v, scratch);
        for k in 1..n.div_ceil(2) {
            let (a, b) = (v[k], v[n - k]);
            let (w, other) = (self.w[k], self.w[n - k]);
            v[k] = 0.5 * (w * a + w.conj() * b);
            v[n - k] = 0.5 * (other * b + other.conj() * a);
        }
        if n.is_multiple_of(2) && n > 0 {
            // k = n - k: (w + conj(w)) / 2 = cos(pi / 4)
            v[n / 2] *= self.w[n / 2].re;
        }
    }

    /// C to n v, still permuted.
    pub(crate) fn back(&self, c: &mut [Complex64], scratch: &mut [Complex64]) {
        let n = self.n;
        let turned = |z: Complex64| Complex64::new(z.im, -z.re); // -i z
        for k in 1..n.div_ceil(2) {
            let (a, b) = (c[k], c[n - k]);
            c[k] = self.w[k].conj() * (a + turned(b));
            c[n - k] = self.w[n - k].conj() * (b + turned(a));
        }
        if n.is_multiple_of(2) && n > 0 {
            let a = c[n / 2];
            c[n / 2] = self.w[n / 2].conj() * (a + turned(a));
        }
        self.inverse.process_with_scratch(c, scratch);
    }

    /// 2 - 2 cos(pi k / n), the eigenvalue of D^T D in one direction, without cancellation: 4 sin^2(pi k / 2n).
    pub(crate) fn eigenvalue(&self, k: usize) -> f64 {
        4.0 * (0.5 * PI * k as f64 / self.n as f64).sin().powi(2)
    }
}

/// Plans for one size of fields, whose border mirrors: a pixel beyond it is what stands as far before it.
#[derive(Clone)]
pub struct Cosine {
    width: usize,
    height: usize,
    rows: Line,
    columns: Line,
}

/// Room for the spectra of some fields: 16 bytes a pixel and field.
#[derive(Default)]
pub struct CosineSpectra {
    rows: Vec<Vec<f64>>,   // a field: row by row, rows transformed
    blocks: Vec<Vec<f64>>, // a block of columns: field by field, row by row
}

impl Cosine {
    /// For fields of this size, of at least one pixel.
    pub fn new(width: usize, height: usize) -> Self {
        Cosine { width, height, rows: Line::new(width), columns: Line::new(height) }
    }

    /// Columns of a field.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The eigenvalue of D^T D, D the forward differences that are 0 across the border, at frequency (i, j).
    pub fn laplacian(&self, i: usize, j: usize) -> f64 {
        self.columns.eigenvalue(i) + self.rows.eigenvalue(j)
    }

    /// The eigenvalues of the convolution with a kernel that is symmetric in both directions, row by row:
    /// H_ij = sum k_ab cos(pi i a / height) cos(pi j b / width), a and b counted from the centre.
    pub fn gains(&self, psf: &Psf) -> Vec<f64> {
        let cosines = |center: usize, taps: usize, n: usize| -> Vec<Vec<f64>> {
            let of = |tap: usize| move |k: usize| (PI * k as f64 * (tap as f64 - center as f64) / n as f64).cos();
            (0..taps).map(|tap| (0..n).map(of(tap)).collect()).collect()
        };
        let along = cosines(psf.center.1, psf.width, self.width);
        let down = cosines(psf.center.0, psf.height, self.height);
        let mut gains = vec![0.0; self.width * self.height];
        for (weights, down) in psf.weights.chunks(psf.width.max(1)).zip(&down) {
            let mut row = vec![0.0; self.width];
            for (k, cos) in weights.iter().zip(&along) {
                row.iter_mut().zip(cos).for_each(|(sum, c)| *sum += k * c);
            }
            for (gains, c) in gains.chunks_mut(self.width).zip(down) {
                gains.iter_mut().zip(&row).for_each(|(gain, r)| *gain += c * r);
            }
        }
        gains
    }

    /// Fields to spectra, `of` at every frequency (row, column, a number a field), and back.
    pub fn filter<const K: usize>(
        &self,
        from: &[f64],
        to: &mut [f64],
        layouts: &[Layout; K],
        work: &mut CosineSpectra,
        of: impl Fn(usize, usize, [f64; K]) -> [f64; K] + Sync,
    ) {
        let (w, h) = (self.width, self.height);
        work.rows.resize_with(K, Vec::new);
        for (layout, rows) in layouts.iter().zip(&mut work.rows) {
            rows.resize(w * h, 0.0);
            self.rows_forward(&from[layout.first..], layout.stride, rows);
        }
        work.blocks.resize_with(w.div_ceil(BLOCK), Vec::new);
        let rows = &work.rows;
        work.blocks.par_iter_mut().enumerate().for_each(|(block, out)| {
            let first = block * BLOCK;
            let count = BLOCK.min(w - first);
            out.resize(K * h * count, 0.0);
            self.columns_of_block(first, count, rows, out, &of);
        });
        let blocks = &work.blocks;
        for (field, layout) in layouts.iter().enumerate() {
            self.rows_back(field, blocks, layout.stride, &mut to[layout.first..]);
        }
    }

    fn rows_forward(&self, from: &[f64], stride: usize, rows: &mut [f64]) {
        let w = self.width;
        rows.par_chunks_mut(2 * PAIRS * w).enumerate().for_each(|(task, out)| {
            let mut line = vec![Complex64::default(); w];
            let mut scratch = vec![Complex64::default(); self.rows.scratch_len()];
            for (pair, out) in out.chunks_mut(2 * w).enumerate() {
                let row = 2 * (task * PAIRS + pair);
                let first = &from[row * stride..row * stride + w];
                let second = if out.len() > w { &from[(row + 1) * stride..(row + 1) * stride + w] } else { &[] };
                for j in 0..w {
                    line[self.rows.place(j)] = Complex64::new(first[j], second.get(j).copied().unwrap_or(0.0));
                }
                self.rows.transform(&mut line, &mut scratch);
                let (first, second) = out.split_at_mut(w);
                first.iter_mut().zip(&line).for_each(|(out, c)| *out = c.re);
                second.iter_mut().zip(&line).for_each(|(out, c)| *out = c.im);
            }
        });
    }

    /// Transforms some columns of all fields, two columns at a time, filters them and transforms them back.
    fn columns_of_block<const K: usize>(
        &self,
        first: usize,
        count: usize,
        rows: &[Vec<f64>],
        out: &mut [f64],
        of: &impl Fn(usize, usize, [f64; K]) -> [f64; K],
    ) {
        let (w, h) = (self.width, self.height);
        let mut lines: [Vec<Complex64>; K] = std::array::from_fn(|_| vec![Complex64::default(); h]);
        let mut scratch = vec![Complex64::default(); self.columns.scratch_len()];
        // A transform and its inverse multiply by n in each direction here.
        let unit = 1.0 / (w * h) as f64;
        for k in (0..count).step_by(2) {
            let column = first + k;
            let both = k + 1 < count;
            for (line, rows) in lines.iter_mut().zip(rows) {
                for i in 0..h {
                    let second = if both { rows[i * w + column + 1] } else { 0.0 };
                    line[self.columns.place(i)] = Complex64::new(rows[i * w + column], second);
                }
                self.columns.transform(line, &mut scratch);
            }
            for i in 0..h {
                let a = of(i, column, std::array::from_fn(|f| lines[f][i].re));
                let b = if both { of(i, column + 1, std::array::from_fn(|f| lines[f][i].im)) } else { [0.0; K] };
                for (f, line) in lines.iter_mut().enumerate() {
                    line[i] = Complex64::new(a[f] * unit, b[f] * unit);
                }
            }
            for (line, out) in lines.iter_mut().zip(out.chunks_mut(h * count)) {
                self.columns.back(line, &mut scratch);
                for (i, out) in out.chunks_mut(count).enumerate() {
                    let c = line[self.columns.place(i)];
                    out[k] = c.re;
                    if both {
                        out[k + 1] = c.im;
                    }
                }
            }
        }
    }

    fn rows_back(&self, field: usize, blocks: &[Vec<f64>], stride: usize, to: &mut [f64]) {
        let (w, h) = (self.width, self.height);
        // The rows of other channels stand between.
        let to = &mut to[..(h - 1) * stride + w];
        to.par_chunks_mut(2 * PAIRS * stride).enumerate().for_each(|(task, to)| {
            let mut line = vec![Complex64::default(); w];
            let mut scratch = vec![Complex64::default(); self.rows.scratch_len()];
            for (pair, to) in to.chunks_mut(2 * stride).enumerate() {
                let row = 2 * (task * PAIRS + pair);
                let both = row + 1 < h;
                for (block, of) in blocks.iter().enumerate() {
                    let count = BLOCK.min(w - block * BLOCK);
                    let at = (field * h + row) * count;
                    for k in 0..count {
                        let second = if both { of[at + count + k] } else { 0.0 };
                        line[block * BLOCK + k] = Complex64::new(of[at + k], second);
                    }
                }
                self.rows.back(&mut line, &mut scratch);
                for j in 0..w {
                    let v = line[self.rows.place(j)];
                    to[j] = v.re;
                    if both {
                        to[stride + j] = v.im;
                    }
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transforms_are_sums_of_cosines() {
        for n in [1, 2, 3, 4, 5, 8, 9, 12] {
            let line = Line::new(n);
            let x: Vec<Complex64> = (0..n).map(|j| Complex64::new((j as f64).sin(), 1.0 / (j as f64 + 0.3))).collect();
            let mut v = vec![Complex64::default(); n];
            (0..n).for_each(|j| v[line.place(j)] = x[j]);
            let mut scratch = vec![Complex64::default(); line.scratch_len()];
            line.transform(&mut v, &mut scratch);
            for k in 0..n {
                let angle = |j: usize| PI * ((2 * j + 1) * k) as f64 / (2 * n) as f64;
                let want: Complex64 = (0..n).map(|j| x[j] * angle(j).cos()).sum();
                assert!((v[k] - want).norm() < 1e-13, "{n}, {k}");
            }
            line.back(&mut v, &mut scratch);
            assert!((0..n).all(|j| (v[line.place(j)] / n as f64 - x[j]).norm() < 1e-14), "{n}");
        }
    }
}
