//! The Laplacian with Neumann border, inverted by cosine transforms.

use crate::spectral::Line;
use rayon::prelude::*;
use rustfft::num_complex::Complex64;

/// Columns that are transformed together: a cache line of each row.
const BLOCK: usize = 8;

/// Row pairs that one task handles.
const PAIRS: usize = 8;

/// Solves w D^T D x = b on a grid of `height` rows, D the forward differences that are 0 across the border, w > 0; b sums to
/// 0, or its mean is left out, and so does x.
///
/// The eigenvectors are cosines, the eigenvalues (2 - 2 cos(pi i / H)) + (2 - 2 cos(pi j / W)). Memory: two arrays of the
/// size of x; a solve reads and writes three arrays once each, 48 bytes a pixel beside x.
pub struct CosineLaplacian {
    width: usize,
    height: usize,
    rows: Line,
    columns: Line,
    lambda_rows: Vec<f64>, // of frequencies along a column
    lambda_columns: Vec<f64>,
    spectrum: Vec<f64>, // after the transform of rows
    blocks: Vec<f64>,   // blocks of columns, each row by row
    sums: Vec<f64>,     // of each block
}

impl CosineLaplacian {
    /// Of a grid, at least one pixel.
    pub fn new(width: usize, height: usize) -> Self {
        let (rows, columns) = (Line::new(width), Line::new(height));
        let n = width * height;
        CosineLaplacian {
            lambda_rows: (0..height).map(|k| columns.eigenvalue(k)).collect(),
            lambda_columns: (0..width).map(|k| rows.eigenvalue(k)).collect(),
            spectrum: vec![0.0; n],
            blocks: vec![0.0; n],
            sums: vec![0.0; width.div_ceil(BLOCK)],
            width,
            height,
            rows,
            columns,
        }
    }

    /// x with scale D^T D x = b, mean 0; returns |D x|^2.
    pub fn solve(&mut self, scale: f64, b: &[f64], x: &mut [f64]) -> f64 {
        let (w, h) = (self.width, self.height);
        let mut spectrum = std::mem::take(&mut self.spectrum);
        spectrum.par_chunks_mut(2 * PAIRS * w).zip(b.par_chunks(2 * PAIRS * w)).for_each(|(out, b)| {
            let mut line = vec![Complex64::default(); w];
            let mut scratch = vec![Complex64::default(); self.rows.scratch_len()];
            for (out, b) in out.chunks_mut(2 * w).zip(b.chunks(2 * w)) {
                let (first, second) = b.split_at(w);
                for j in 0..w {
                    line[self.rows.place(j)] = Complex64::new(first[j], second.get(j).copied().unwrap_or(0.0));
                }
                self.rows.transform(&mut line, &mut scratch);
                let (first, second) = out.split_at_mut(w);
                first.iter_mut().zip(&line).for_each(|(out, c)| *out = c.re);
                second.iter_mut().zip(&line).for_each(|(out, c)| *out = c.im);
            }
        });
        let (mut blocks, mut sums) = (std::mem::take(&mut self.blocks), std::mem::take(&mut self.sums));
        let this = &*self;
        blocks.par_chunks_mut(BLOCK * h).zip(&mut sums).enumerate().for_each(|(block, (out, sum))| {
            *sum = this.columns_of_block(scale, block, &spectrum, out);
        });
        (self.spectrum, self.blocks, self.sums) = (spectrum, blocks, sums);
        let this = &*self;
        x.par_chunks_mut(2 * PAIRS * w).enumerate().for_each(|(task, out)| {
            let mut line = vec![Complex64::default(); w];
            let mut scratch = vec![Complex64::default(); this.rows.scratch_len()];
            for (pair, out) in out.chunks_mut(2 * w).enumerate() {
                let row = 2 * (task * PAIRS + pair);
                this.gather(row, out.len() > w, &mut line);
                this.rows.back(&mut line, &mut scratch);
                let (first, second) = out.split_at_mut(w);
                for j in 0..w {
                    let v = line[this.rows.place(j)];
                    first[j] = v.re;
                    if let Some(second) = second.get_mut(j) {
                        *second = v.im;
                    }
                }
            }
        });
        self.sums.iter().sum()
    }

    /// Transforms columns, divides by the eigenvalues, transforms back; returns the part of |D x|^2.
    fn columns_of_block(&self, scale: f64, block: usize, spectrum: &[f64], out: &mut [f64]) -> f64 {
        let (w, h) = (self.width, self.height);
        let first = block * BLOCK;
        let count = out.len() / h;
        let mut lines = vec![Complex64::default(); h * count.div_ceil(2)];
        let mut scratch = vec![Complex64::default(); self.columns.scratch_len()];
        for i in 0..h {
            let (row, place) = (&spectrum[i * w + first..][..count], self.columns.place(i));
            for (k, pair) in row.chunks(2).enumerate() {
                lines[k * h + place] = Complex64::new(pair[0], pair.get(1).copied().unwrap_or(0.0));
            }
        }
        // dct then its inverse multiply by n in each direction here.
        let unit = 1.0 / (scale * (w * h) as f64);
        let (mut sum, pixels) = (0.0, (w * h) as f64);
        for (k, line) in lines.chunks_exact_mut(h).enumerate() {
            self.columns.transform(line, &mut scratch);
            let column = first + 2 * k;
            let lambda = [self.lambda_columns[column], self.lambda_columns.get(column + 1).copied().unwrap_or(0.0)];
            for (i, c) in line.iter_mut().enumerate() {
                let (a, b) = (self.lambda_rows[i] + lambda[0], self.lambda_rows[i] + lambda[1]);
                let [fa, fb] = [if a > 0.0 { unit / a } else { 0.0 }, if b > 0.0 { unit / b } else { 0.0 }];
                *c = Complex64::new(c.re * fa, c.im * fb);
                // Parseval: frequency 0 counts once, the others twice in each direction.
                let twice = if i == 0 { 1.0 } else { 2.0 };
                let (ea, eb) = (if column == 0 { twice } else { 2.0 * twice }, 2.0 * twice);
                sum += pixels * (ea * a * c.re * c.re + eb * b * c.im * c.im);
            }
            self.columns.back(line, &mut scratch);
        }
        for i in 0..h {
            let (row, place) = (&mut out[i * count..(i + 1) * count], self.columns.place(i));
            for (k, pair) in row.chunks_mut(2).enumerate() {
                let c = lines[k * h + place];
                pair[0] = c.re;
                if let Some(second) = pair.get_mut(1) {
                    *second = c.im;
                }
            }
        }
        sum
    }

    /// Two rows out of the blocks.
    fn gather(&self, row: usize, both: bool, line: &mut [Complex64]) {
        let h = self.height;
        for block in 0..self.width.div_ceil(BLOCK) {
            let first = block * BLOCK;
            let count = BLOCK.min(self.width - first);
            let at = first * h + row * count;
            for k in 0..count {
                let second = if both { self.blocks[at + count + k] } else { 0.0 };
                line[first + k] = Complex64::new(self.blocks[at + k], second);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// D^T D x by its definition.
    pub fn laplacian(w: usize, h: usize, x: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; w * h];
        let mut edge = |a: usize, b: usize| {
            let d = x[b] - x[a];
            out[a] -= d;
            out[b] += d;
        };
        for i in 0..h {
            for j in 0..w {
                if j + 1 < w {
                    edge(i * w + j, i * w + j + 1);
                }
                if i + 1 < h {
                    edge(i * w + j, (i + 1) * w + j);
                }
            }
        }
        out
    }

    fn noise(n: usize) -> Vec<f64> {
        (0..n).map(|k| ((k * k + 3 * k) as f64 * 0.7).sin()).collect()
    }

    /// Against elimination on the dense matrix, whose null space is taken out by a row of ones.
    #[test]
    fn the_step_is_that_of_a_dense_solve() {
        for (w, h) in [(1, 1), (5, 1), (1, 4), (6, 5), (9, 4), (3, 7)] {
            let n = w * h;
            let mut b = noise(n);
            let mean = b.iter().sum::<f64>() / n as f64;
            b.iter_mut().for_each(|b| *b -= mean);
            let mut a = vec![vec![0.0; n + 1]; n];
            for k in 0..n {
                let mut unit = vec![0.0; n];
                unit[k] = 1.0;
                let column = laplacian(w, h, &unit);
                (0..n).for_each(|i| a[i][k] = 2.5 * column[i] + 1.0); // + 1 1^T: b and x sum to 0
                a[k][n] = b[k];
            }
            for k in 0..n {
                let pivot = (k..n).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).unwrap();
                a.swap(k, pivot);
                for i in 0..n {
                    if i != k {
                        let f = a[i][k] / a[k][k];
                        (k..=n).for_each(|j| a[i][j] -= f * a[k][j]);
                    }
                }
            }
            let mut x = vec![0.0; n];
            let square = CosineLaplacian::new(w, h).solve(2.5, &b, &mut x);
            for k in 0..n {
                assert!((x[k] - a[k][n] / a[k][k]).abs() < 1e-12, "{w} x {h}");
            }
            let want: f64 = laplacian(w, h, &x).iter().zip(&x).map(|(l, x)| l * x).sum();
            assert!((square - want).abs() < 1e-12 * want.max(1.0), "{w} x {h}: {square} and {want}");
        }
    }

    #[test]
    fn the_same_bits_on_any_number_of_threads() {
        let (w, h) = (211, 97);
        let b = noise(w * h);
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut x = vec![0.0; w * h];
            let square = pool.install(|| CosineLaplacian::new(w, h).solve(1.0, &b, &mut x));
            (square.to_bits(), x.iter().map(|v| v.to_bits()).collect::<Vec<_>>())
        };
        let one = on(1);
        assert!(one == on(2) && one == on(3));
    }
}
