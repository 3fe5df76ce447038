//! Total variation.

use super::Pointwise;
use std::ops::Range;

/// g(z) = lambda sum over pixels of |z|_2 (isotropic; over all channels: vectorial) or |z|_1 (anisotropic), z the differences
/// of the pixel: total variation as in A(31).
///
/// The prox shrinks: z = v max(0, 1 - (lambda/weight2)/|v|), pixel by pixel or number by number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TotalVariation {
    /// lambda
    pub lambda: f64,
    /// Whether numbers count by themselves.
    pub anisotropic: bool,
}

impl TotalVariation {
    /// Isotropic.
    pub fn isotropic(lambda: f64) -> Self {
        TotalVariation { lambda, anisotropic: false }
    }

    /// Anisotropic.
    pub fn anisotropic(lambda: f64) -> Self {
        TotalVariation { lambda, anisotropic: true }
    }
}

/// 1 - t/r where r > t, else 0; r = 0 gives 0. `max` drops the NaN of 0/0.
fn shrinkage(r: f64, t: f64) -> f64 {
    (1.0 - t / r).max(0.0)
}

impl Pointwise for TotalVariation {
    fn prox(&self, pixels: Range<usize>, v: &mut [f64], weight2: f64) -> f64 {
        let t = self.lambda / weight2;
        let n = pixels.len();
        let mut sums = [0.0; 4];
        if self.anisotropic {
            for z in v.iter_mut() {
                *z *= shrinkage(z.abs(), t);
                sums[0] += z.abs();
            }
        } else if v.len() == 2 * n {
            let (a, b) = v.split_at_mut(n);
            let (a4, a1) = a.as_chunks_mut::<4>();
            let (b4, b1) = b.as_chunks_mut::<4>();
            // Four sums, so that a sum does not wait for the one before.
            for (a, b) in a4.iter_mut().zip(b4) {
                for k in 0..4 {
                    let r = (a[k] * a[k] + b[k] * b[k]).sqrt();
                    let s = shrinkage(r, t);
                    a[k] *= s;
                    b[k] *= s;
                    sums[k] += s * r;
                }
            }
            for (a, b) in a1.iter_mut().zip(b1) {
                let r = (*a * *a + *b * *b).sqrt();
                let s = shrinkage(r, t);
                *a *= s;
                *b *= s;
                sums[0] += s * r;
            }
        } else {
            for i in 0..n {
                let r = norm(v, n, i);
                let s = shrinkage(r, t);
                v.iter_mut().skip(i).step_by(n).for_each(|z| *z *= s);
                sums[i % 4] += s * r;
            }
        }
        self.lambda * ((sums[0] + sums[1]) + (sums[2] + sums[3]))
    }

    fn value(&self, pixels: Range<usize>, z: &[f64]) -> f64 {
        let n = pixels.len();
        if self.anisotropic {
            return self.lambda * z.iter().map(|z| z.abs()).sum::<f64>();
        }
        let mut sums = [0.0; 4];
        if z.len() == 2 * n {
            let (a, b) = z.split_at(n);
            for (i, (a, b)) in a.iter().zip(b).enumerate() {
                sums[i % 4] += (a * a + b * b).sqrt();
            }
        } else {
            (0..n).for_each(|i| sums[i % 4] += norm(z, n, i));
        }
        self.lambda * ((sums[0] + sums[1]) + (sums[2] + sums[3]))
    }

    fn gradient(&self, pixels: Range<usize>, z: &mut [f64]) {
        let n = pixels.len();
        if self.anisotropic {
            z.iter_mut().for_each(|z| *z = if *z == 0.0 { 0.0 } else { self.lambda * z.signum() });
            return;
        }
        for i in 0..n {
            let r = norm(z, n, i);
            let s = if r > 0.0 { self.lambda / r } else { 0.0 };
            z.iter_mut().skip(i).step_by(n).for_each(|z| *z *= s);
        }
    }

    fn force(&self) -> f64 {
        self.lambda
    }
}

/// |z| of a pixel.
fn norm(z: &[f64], n: usize, i: usize) -> f64 {
    z.iter().skip(i).step_by(n.max(1)).map(|z| z * z).sum::<f64>().sqrt()
}
