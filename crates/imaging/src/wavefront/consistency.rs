//! The two functions of A(32) on the grid.

use crate::Pointwise;
use proxel_split::{DualMap, Potential};
use rayon::prelude::*;
use std::ops::Range;

/// g(z) = sum over pixels of (gx z_x + gy z_y + g_t)^2: how well a shift z explains the change g_t of the light at a pixel,
/// where g is the gradient of the image. Pixels without an image have g = 0 and g_t = 0, which is the mask M of A(32).
///
/// The prox is z = v - g (g . v + g_t)/(|g|^2 + w^2/2). u = (2/w^2) g (g . z + g_t) is an affine function of z (A, appendix
/// E.1).
#[derive(Clone, Debug, PartialEq)]
pub struct Consistency {
    /// Along the row.
    pub gx: Vec<f64>,
    /// Along the column.
    pub gy: Vec<f64>,
    /// I2 - I1.
    pub gt: Vec<f64>,
}

impl Consistency {
    /// f of every pixel of a range, with its g, g_t and z.
    fn each(&self, pixels: Range<usize>, z: &mut [f64], mut f: impl FnMut([f64; 2], f64, &mut f64, &mut f64)) {
        let (zx, zy) = z.split_at_mut(pixels.len());
        let data = self.gx[pixels.clone()].iter().zip(&self.gy[pixels.clone()]).zip(&self.gt[pixels]);
        for (((gx, gy), gt), (zx, zy)) in data.zip(zx.iter_mut().zip(zy)) {
            f([*gx, *gy], *gt, zx, zy);
        }
    }

    /// Mean of |g|^2 over all pixels.
    pub fn mean_square(&self) -> f64 {
        let sum: f64 = self.gx.iter().zip(&self.gy).map(|(x, y)| x * x + y * y).sum();
        sum / self.gx.len().max(1) as f64
    }
}

impl Pointwise for Consistency {
    fn prox(&self, pixels: Range<usize>, v: &mut [f64], weight2: f64) -> f64 {
        let mut sum = 0.0;
        self.each(pixels, v, |[gx, gy], gt, vx, vy| {
            let residual = gx * *vx + gy * *vy + gt;
            let step = residual / (gx * gx + gy * gy + 0.5 * weight2);
            *vx -= gx * step;
            *vy -= gy * step;
            // g . z + g_t there, without cancellation.
            sum += (0.5 * weight2 * step).powi(2);
        });
        sum
    }

    fn value(&self, pixels: Range<usize>, z: &[f64]) -> f64 {
        let (zx, zy) = z.split_at(pixels.len());
        let data = self.gx[pixels.clone()].iter().zip(&self.gy[pixels.clone()]).zip(&self.gt[pixels]);
        data.zip(zx.iter().zip(zy)).map(|(((gx, gy), gt), (zx, zy))| (gx * zx + gy * zy + gt).powi(2)).sum()
    }

    fn gradient(&self, pixels: Range<usize>, z: &mut [f64]) {
        self.each(pixels, z, |[gx, gy], gt, zx, zy| {
            let twice = 2.0 * (gx * *zx + gy * *zy + gt);
            *zx = gx * twice;
            *zy = gy * twice;
        });
    }

    fn dual_map(&self) -> DualMap {
        DualMap::Affine
    }

    fn force(&self) -> f64 {
        let at_zero = |((gx, gy), gt): ((&f64, &f64), &f64)| 4.0 * (gx * gx + gy * gy) * gt * gt;
        let sum: f64 = self.gx.iter().zip(&self.gy).zip(&self.gt).map(at_zero).sum();
        (sum / self.gx.len().max(1) as f64).sqrt()
    }
}

/// beta |D x|^2 with the forward differences D of a grid, 0 across the border: what keeps the wavefront smooth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothness {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// beta
    pub beta: f64,
}

impl Potential for Smoothness {
    fn value_and_gradient(&self, x: &[f64], grad: Option<&mut [f64]>) -> f64 {
        let (w, h, beta) = (self.width, self.height, self.beta);
        // Each row has the squares of its differences to the right and down, and the gradient of all four neighbours.
        let of_row = |i: usize, mut out: Option<&mut [f64]>| {
            let row = &x[i * w..(i + 1) * w];
            let above = i.checked_sub(1).map(|a| &x[a * w..(a + 1) * w]);
            let below = (i + 1 < h).then(|| &x[(i + 1) * w..(i + 2) * w]);
            let mut sum = 0.0;
            for j in 0..w {
                let right = if j + 1 < w { row[j + 1] - row[j] } else { 0.0 };
                let left = if j > 0 { row[j] - row[j - 1] } else { 0.0 };
                let down = below.map_or(0.0, |b| b[j] - row[j]);
                let up = above.map_or(0.0, |a| row[j] - a[j]);
                sum += right * right + down * down;
                if let Some(out) = out.as_deref_mut().and_then(|out| out.get_mut(j)) {
                    *out += 2.0 * beta * ((left - right) + (up - down));
                }
            }
            sum
        };
        let sums: Vec<f64> = match grad {
            Some(grad) => grad.par_chunks_mut(w).enumerate().map(|(i, out)| of_row(i, Some(out))).collect(),
            None => (0..h).into_par_iter().map(|i| of_row(i, None)).collect(),
        };
        beta * sums.iter().sum::<f64>()
    }

    fn n(&self) -> usize {
        self.width * self.height
    }

    fn is_convex(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Consistency {
        let of = |f: fn(f64) -> f64| (0..7).map(|k| f(f64::from(k))).collect();
        Consistency { gx: of(|k| 3.0 * k.sin()), gy: of(|k| k - 3.0), gt: of(|k| (5.0 * k).cos()) }
    }

    /// No point around the prox is better, at many places and weights.
    #[test]
    fn the_prox_against_brute_force() {
        let of = sample();
        for weight2 in [0.1, 2.0, 50.0] {
            for k in 0..7 {
                let v = [0.7 - k as f64, 0.2 * k as f64];
                let objective = |z: [f64; 2]| {
                    of.value(k..k + 1, &z) + 0.5 * weight2 * ((z[0] - v[0]).powi(2) + (z[1] - v[1]).powi(2))
                };
                // Coarse to fine over a grid around the best so far.
                let (mut best, mut radius) = (v, 8.0);
                for _ in 0..60 {
                    let centre = best;
                    for a in -4..=4 {
                        for b in -4..=4 {
                            let z = [centre[0] + radius * f64::from(a) / 4.0, centre[1] + radius * f64::from(b) / 4.0];
                            if objective(z) < objective(best) {
                                best = z;
                            }
                        }
                    }
                    radius *= 0.7;
                }
                let mut z = v;
                let value = of.prox(k..k + 1, &mut z, weight2);
                assert!((z[0] - best[0]).abs() < 1e-6 && (z[1] - best[1]).abs() < 1e-6, "{z:?} and {best:?}");
                assert!((value - of.value(k..k + 1, &z)).abs() < 1e-12 * (1.0 + value));
                // E.1: the dual after the step, v - z, is the gradient at z over the weight.
                let mut dual = z;
                of.gradient(k..k + 1, &mut dual);
                assert!((0..2).all(|d| (dual[d] / weight2 - (v[d] - z[d])).abs() < 1e-12));
            }
        }
    }

    #[test]
    fn the_smoothness_and_its_gradient() {
        let of = Smoothness { width: 5, height: 4, beta: 1.7 };
        let x: Vec<f64> = (0..20).map(|k| f64::from(k * k % 11)).collect();
        let mut by_hand = 0.0;
        for i in 0..4 {
            for j in 0..5 {
                let at = |i: usize, j: usize| x[i.min(3) * 5 + j.min(4)];
                by_hand += 1.7 * ((at(i, j + 1) - at(i, j)).powi(2) + (at(i + 1, j) - at(i, j)).powi(2));
            }
        }
        let mut grad = vec![0.0; 20];
        assert!((of.value_and_gradient(&x, Some(&mut grad)) - by_hand).abs() < 1e-12 * by_hand);
        assert_eq!(of.value_and_gradient(&x, None), of.value_and_gradient(&x, Some(&mut [0.0; 20])));
        for k in 0..20 {
            let at = |h: f64| {
                let mut y = x.clone();
                y[k] += h;
                of.value_and_gradient(&y, None)
            };
            assert!(((at(0.5) - at(-0.5)) - grad[k]).abs() < 1e-10, "a quadratic has exact differences");
        }
    }
}
