//! Cosine transforms of the surroundings of every pixel, over fields that wrap around.

use super::stencil::{Stencil, Visit};
use crate::Grid;
use proxel_linalg::simd::{Isa, Kernel, dispatch};
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
            let lines = std::array::from_fn(|a| &x[((row + a) % grid.height * grid.channels + c) * w..][..w]);
            for (k, out) in out.chunks_mut(M * w).enumerate() {
                combine(self.c[k], lines, &mut along[..w], false);
                for j in w..w + M - 1 {
                    along[j] = along[j - w];
                }
                for (l, out) in out.chunks_mut(w).enumerate() {
                    combine(self.c[l], std::array::from_fn(|b| &along[b..b + w]), out, false);
                }
            }
        }
    }

    /// Gathered: what each pixel is in the surroundings of.
    fn add_adjoint(&self, grid: Grid, scale: f64, p: &[f64], out: &mut [f64]) {
        let (h, local) = (grid.height, self.local_row(grid));
        let rows = out[..grid.len()].par_chunks_mut(grid.row_len()).enumerate().with_min_len(grid.task_rows());
        rows.for_each_init(Vec::new, |room, (row, out)| {
            // Rows above, as often around as it takes.
            let above: [&[f64]; M] = std::array::from_fn(|a| &p[(row + M * h - a) % h * local..][..local]);
            self.gather(grid, scale, &above, out, room);
        });
    }

    fn reach(&self) -> Option<usize> {
        Some(M)
    }

    fn gather(&self, grid: Grid, scale: f64, above: &[&[f64]], out: &mut [f64], room: &mut Vec<f64>) {
        let (w, stride) = (grid.width, grid.width + M - 1);
        let Some(above) = above.first_chunk::<M>() else { return };
        room.resize(M * stride, 0.0);
        for (c, out) in out.chunks_mut(w).enumerate() {
            // With what is around the start: number j - b stands at j - b + M - 1, those below 0 at the end of the row.
            for (l, down) in room.chunks_mut(stride).enumerate() {
                let factors: [f64; M * M] = std::array::from_fn(|ak| scale * self.c[ak % M][ak / M]);
                let planes = std::array::from_fn(|ak| {
                    let plane = c * Self::PLANES + ak % M * M + l;
                    &above[ak / M][plane * w..(plane + 1) * w]
                });
                combine(factors, planes, &mut down[M - 1..], false);
                for b in 1..M {
                    down[M - 1 - b] = down[M - 1 + (w * M - b) % w];
                }
            }
            let factors: [f64; M * M] = std::array::from_fn(|lb| self.c[lb / M][lb % M]);
            let shifted = std::array::from_fn(|lb| &room[lb / M * stride + M - 1 - lb % M..][..w]);
            combine(factors, shifted, out, true);
        }
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

/// out <- sum of f_k from_k, or out += that sum.
fn combine<const N: usize>(factors: [f64; N], from: [&[f64]; N], out: &mut [f64], adds: bool) {
    dispatch(Combine { factors, from, out, adds });
}

struct Combine<'a, const N: usize> {
    factors: [f64; N],
    from: [&'a [f64]; N],
    out: &'a mut [f64],
    adds: bool,
}

impl<const N: usize> Kernel for Combine<'_, N> {
    type Output = ();

    // Loops by index, which are compiled for the instruction set.
    #[inline(always)]
    fn run<I: Isa>(self) {
        let n = self.out.len();
        let (mut from, factors, out) = (self.from, self.factors, &mut self.out[..n]);
        for from in &mut from {
            *from = &from[..n];
        }
        for i in 0..n {
            let mut sum = if self.adds { out[i] } else { 0.0 };
            for k in 0..N {
                sum += factors[k] * from[k][i];
            }
            out[i] = sum;
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
