//! Cosine transforms of the surroundings of every pixel, over fields that wrap around.

use super::stencil::{Stencil, Visit};
use crate::Grid;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Rows and columns of the surroundings.
const M: usize = 4;

/// Cosine transforms of the M x M pixels from each pixel on, M = 4:
///
/// ```text
/// (W_kl x)_ij = 1/M sum over a, b < M of C_ka C_lb x_(i+a)(j+b),    C_ka = sqrt(s_k / M) cos(pi k (a + 1/2) / M)
/// ```
///
/// s_0 = 1, s_k = 2 elsewhere. A tight frame: sum W_kl^T W_kl is the identity. The local numbers of a row are M^2 planes a
/// channel, W_00 (the mean of the surroundings) first and l running fastest.
#[derive(Clone, Debug)]
pub struct LocalCosines {
    c: [[f64; M]; M], // C / sqrt(M)
}

impl Default for LocalCosines {
    fn default() -> Self {
        let mut c = [[0.0; M]; M];
        for (k, row) in c.iter_mut().enumerate() {
            let s = if k == 0 { 1.0 } else { 2.0 };
            for (a, c) in row.iter_mut().enumerate() {
                *c = (s / (M * M) as f64).sqrt() * (PI * k as f64 * (a as f64 + 0.5) / M as f64).cos();
            }
        }
        LocalCosines { c }
    }
}

impl LocalCosines {
    /// Rows and columns of the surroundings.
    pub const SIDE: usize = M;
    /// Numbers of a pixel and channel.
    pub const PLANES: usize = M * M;
}

impl Stencil for LocalCosines {
    fn local_row(&self, grid: Grid) -> usize {
        Self::PLANES * grid.row_len()
    }

    /// Along columns first, then along rows: 2 M^3 products a pixel in the place of M^4.
    fn row(&self, grid: Grid, x: &[f64], row: usize, out: &mut [f64]) {
        let w = grid.width;
        let mut along = vec![0.0; w + M - 1]; // with what is around the end
        for (c, out) in out.chunks_mut(Self::PLANES * w).enumerate() {
            let line = |a: usize| &x[((row + a) % grid.height * grid.channels + c) * w..][..w];
            for (k, out) in out.chunks_mut(M * w).enumerate() {
                along[..w].fill(0.0);
                for a in 0..M {
                    let f = self.c[k][a];
                    along[..w].iter_mut().zip(line(a)).for_each(|(t, x)| *t += f * x);
                }
                for j in w..w + M - 1 {
                    along[j] = along[j - w];
                }
                for (l, out) in out.chunks_mut(w).enumerate() {
                    out.fill(0.0);
                    for b in 0..M {
                        let f = self.c[l][b];
                        out.iter_mut().zip(&along[b..]).for_each(|(o, t)| *o += f * t);
                    }
                }
            }
        }
    }

    /// Gathered: what each pixel is in the surroundings of.
    fn add_adjoint(&self, grid: Grid, scale: f64, p: &[f64], out: &mut [f64]) {
        let (w, h, planes) = (grid.width, grid.height, Self::PLANES * grid.channels);
        let rows = out[..grid.len()].par_chunks_mut(grid.row_len()).enumerate().with_min_len(grid.task_rows());
        let scratch = || vec![0.0; w + M - 1]; // with what is around the start
        rows.for_each_init(scratch, |down, (row, out)| {
            // Rows above, as often around as it takes.
            let above = |a: usize| (row + M * h - a) % h;
            for (c, out) in out.chunks_mut(w).enumerate() {
                for l in 0..M {
                    down.fill(0.0);
                    for a in 0..M {
                        for k in 0..M {
                            let f = scale * self.c[k][a];
                            let plane = &p[(above(a) * planes + c * Self::PLANES + k * M + l) * w..][..w];
                            down[M - 1..].iter_mut().zip(plane).for_each(|(d, p)| *d += f * p);
                        }
                    }
                    // Number j - b stands at j - b + M - 1, those below 0 at the end of the row.
                    for b in 1..M {
                        down[M - 1 - b] = down[M - 1 + (w * M - b) % w];
                    }
                    for b in 0..M {
                        let f = self.c[l][b];
                        out.iter_mut().zip(&down[M - 1 - b..]).for_each(|(o, d)| *o += f * d);
                    }
                }
            }
        });
    }

    fn for_each(&self, grid: Grid, visit: &mut Visit<'_>) {
        let (w, h, channels) = (grid.width, grid.height, grid.channels);
        let mut number = Vec::with_capacity(M * M);
        for i in 0..h {
            for c in 0..channels {
                for kl in 0..M * M {
                    for j in 0..w {
                        number.clear();
                        for ab in 0..M * M {
                            let (a, b) = (ab / M, ab % M);
                            let node = ((i + a) % h * channels + c) * w + (j + b) % w;
                            number.push((node as u32, self.c[kl / M][a] * self.c[kl % M][b]));
                        }
                        visit(&number);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::stencil::tests::{assert_is_its_numbers, numbers};
    use super::*;

    /// Rows and transposes against the numbers one by one, and W^T W = 1.
    #[test]
    fn maps_are_those_of_their_numbers_and_the_frame_is_tight() {
        for (width, height, channels) in [(9, 7, 1), (7, 5, 2), (1, 4, 1), (4, 1, 1), (1, 1, 1), (2, 3, 3)] {
            let (grid, map) = (Grid { width, height, channels }, LocalCosines::default());
            assert_is_its_numbers(&map, grid, grid.len());
            let (x, local) = (numbers(grid.len(), 0.1), map.local_row(grid));
            let mut got = vec![0.0; local * height];
            got.chunks_mut(local).enumerate().for_each(|(row, out)| map.row(grid, &x, row, out));
            let mut again = vec![0.0; grid.len()];
            map.add_adjoint(grid, 1.0, &got, &mut again);
            assert!(again.iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-13), "{grid:?}");
        }
    }

    /// A ramp along rows has its own mean and the odd frequencies along rows alone.
    #[test]
    fn numbers_are_those_of_the_definition() {
        let grid = Grid::new(12, 8);
        let x: Vec<f64> = (0..96).map(|k| (k % 12) as f64).collect();
        let mut out = vec![0.0; 16 * 12];
        LocalCosines::default().row(grid, &x, 3, &mut out);
        // Mean of 5, 6, 7, 8 is 6.5; sum of cos(pi (b + 1/2) / 4) (5 + b) over b, times sqrt(2/4) and sqrt(1/4) 4 / 4.
        let first = |b: usize| (PI * (b as f64 + 0.5) / 4.0).cos() * (5 + b) as f64;
        let expected = 0.5f64.sqrt() * 0.5 * (0..4).map(first).sum::<f64>();
        assert!((out[5] - 6.5).abs() < 1e-13 && (out[12 + 5] - expected).abs() < 1e-13, "{} {expected}", out[12 + 5]);
        assert!((4..16).all(|plane| out[plane * 12 + 5].abs() < 1e-13) && out[2 * 12 + 5].abs() < 1e-13);
    }
}
