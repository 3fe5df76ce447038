//! Total variation.

use super::Pointwise;
use std::ops::Range;

/// Which differences of a pixel count together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Norm {
    /// All of them, over all channels: |z|_2. Vectorial; isotropic where there is one channel.
    #[default]
    Vectorial,
    /// The two of each channel, channel by channel: isotropic.
    Channels,
    /// The three of each channel, of symmetrised slopes.
    Triples,
    /// Each by itself: |z|_1, anisotropic.
    Differences,
}

/// g(z) = lambda sum over pixels of a norm of the pixel's differences z: total variation as in A(31).
///
/// The prox shrinks what counts together: z = v max(0, 1 - (lambda/weight2)/|v|).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TotalVariation {
    /// lambda
    pub lambda: f64,
    /// Which differences count together.
    pub norm: Norm,
}

impl TotalVariation {
    /// All differences of a pixel together.
    pub fn isotropic(lambda: f64) -> Self {
        TotalVariation { lambda, norm: Norm::Vectorial }
    }

    /// Each difference by itself.
    pub fn anisotropic(lambda: f64) -> Self {
        TotalVariation { lambda, norm: Norm::Differences }
    }

    /// Planes of numbers that count together, of so many.
    fn group(&self, planes: usize) -> usize {
        match self.norm {
            Norm::Vectorial => planes,
            Norm::Channels => 2.min(planes),
            Norm::Triples => 3.min(planes),
            Norm::Differences => 1,
        }
    }
}

/// 1 - t/r where r > t, else 0; r = 0 gives 0. `max` drops the NaN of 0/0.
fn shrinkage(r: f64, t: f64) -> f64 {
    (1.0 - t / r).max(0.0)
}

/// Shrinks one group of planes; returns the sum of norms after.
fn shrink(v: &mut [f64], n: usize, t: f64) -> f64 {
    // Four sums, so that a sum does not wait for the one before.
    let mut sums = [0.0; 4];
    if v.len() == 2 * n {
        let (a, b) = v.split_at_mut(n);
        let (a4, a1) = a.as_chunks_mut::<4>();
        let (b4, b1) = b.as_chunks_mut::<4>();
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
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

impl Pointwise for TotalVariation {
    fn prox(&self, pixels: Range<usize>, v: &mut [f64], weight2: f64) -> f64 {
        let (t, n) = (self.lambda / weight2, pixels.len().max(1));
        let group = self.group(v.len() / n);
        self.lambda * v.chunks_mut((group * n).max(1)).map(|v| shrink(v, n, t)).sum::<f64>()
    }

    fn value(&self, pixels: Range<usize>, z: &[f64]) -> f64 {
        let n = pixels.len().max(1);
        let group = self.group(z.len() / n);
        let mut sums = [0.0; 4];
        for z in z.chunks((group * n).max(1)) {
            if z.len() == 2 * n {
                let (a, b) = z.split_at(n);
                a.iter().zip(b).enumerate().for_each(|(i, (a, b))| sums[i % 4] += (a * a + b * b).sqrt());
            } else {
                (0..n).for_each(|i| sums[i % 4] += norm(z, n, i));
            }
        }
        self.lambda * ((sums[0] + sums[1]) + (sums[2] + sums[3]))
    }

    fn gradient(&self, pixels: Range<usize>, z: &mut [f64]) {
        let n = pixels.len().max(1);
        let group = self.group(z.len() / n);
        for z in z.chunks_mut((group * n).max(1)) {
            for i in 0..n {
                let r = norm(z, n, i);
                let s = if r > 0.0 { self.lambda / r } else { 0.0 };
                z.iter_mut().skip(i).step_by(n).for_each(|z| *z *= s);
            }
        }
    }

    fn force(&self) -> f64 {
        self.lambda
    }
}

/// |z| of a pixel.
fn norm(z: &[f64], n: usize, i: usize) -> f64 {
    z.iter().skip(i).step_by(n).map(|z| z * z).sum::<f64>().sqrt()
}
