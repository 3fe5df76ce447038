//! Total variation.

use super::Pointwise;
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Real, dispatch};
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

/// A part of a field, from a first row and column to before a last one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Columns of the whole field.
    pub width: usize,
    /// First row, and the one behind the last.
    pub rows: [usize; 2],
    /// First column, and the one behind the last; at most `width`.
    pub columns: [usize; 2],
}

impl Window {
    /// Whether this pixel, counted row by row, lies in it.
    pub fn contains(&self, pixel: usize) -> bool {
        let (row, column) = (pixel / self.width.max(1), pixel % self.width.max(1));
        (self.rows[0]..self.rows[1]).contains(&row) && (self.columns[0]..self.columns[1]).contains(&column)
    }

    /// Columns of it in the row that begins with this pixel.
    fn of_row(&self, pixel: usize) -> Range<usize> {
        let row = pixel / self.width.max(1);
        if (self.rows[0]..self.rows[1]).contains(&row) { self.columns[0]..self.columns[1] } else { 0..0 }
    }
}

/// g(z) = lambda sum over pixels of a norm of the pixel's differences z: total variation as in A(31).
///
/// The prox shrinks what counts together: z = v max(0, 1 - (lambda/weight2)/|v|), and leaves what does not count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TotalVariation {
    /// lambda
    pub lambda: f64,
    /// Which differences count together.
    pub norm: Norm,
    /// Which pixels count; all of them where there is none.
    pub within: Option<Window>,
}

impl TotalVariation {
    /// All differences of a pixel together.
    pub fn isotropic(lambda: f64) -> Self {
        TotalVariation { lambda, norm: Norm::Vectorial, within: None }
    }

    /// Each difference by itself.
    pub fn anisotropic(lambda: f64) -> Self {
        TotalVariation { lambda, norm: Norm::Differences, within: None }
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

    /// |z| of each group of a row's pixels that counts.
    pub(crate) fn sizes(&self, pixels: &Range<usize>, z: &[f64], sizes: &mut Vec<f64>) {
        let (n, counted) = (pixels.len().max(1), self.counted(pixels));
        for z in z.chunks((self.group(z.len() / n) * n).max(1)) {
            sizes.extend(counted.clone().map(|i| norm(z, n, i)));
        }
    }

    /// 0 in a row's pixels that do not count.
    pub(crate) fn clear_others(&self, pixels: &Range<usize>, z: &mut [f64]) {
        let (n, counted) = (pixels.len().max(1), self.counted(pixels));
        for plane in z.chunks_mut(n) {
            plane[..counted.start].fill(0.0);
            plane[counted.end..].fill(0.0);
        }
    }

    /// Those of a row's pixels that count.
    fn counted(&self, pixels: &Range<usize>) -> Range<usize> {
        self.within.map_or(0..pixels.len(), |window| {
            let columns = window.of_row(pixels.start);
            columns.start.min(pixels.len())..columns.end.min(pixels.len())
        })
    }
}

/// 1 - t/r where r > t, else 0; r = 0 gives 0. `max` drops the NaN of 0/0.
fn shrinkage(r: f64, t: f64) -> f64 {
    (1.0 - t / r).max(0.0)
}

/// Shrinks one group of planes at these pixels; returns the sum of norms after.
fn shrink(v: &mut [f64], n: usize, counted: Range<usize>, t: f64) -> f64 {
    if v.len() == 2 * n {
        let (a, b) = v.split_at_mut(n);
        return dispatch(ShrinkPairs { a: &mut a[counted.clone()], b: &mut b[counted], t });
    }
    // Four sums, so that a sum does not wait for the one before.
    let mut sums = [0.0; 4];
    for i in counted {
        let r = norm(v, n, i);
        let s = shrinkage(r, t);
        v.iter_mut().skip(i).step_by(n).for_each(|z| *z *= s);
        sums[i % 4] += s * r;
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

/// What the reciprocal root is specified for: added to squares, and the most of them. Beyond are those of gradients that are 0,
/// or that nothing shrinks.
const SQUARES: [f64; 2] = [1e-290, 1e290];

/// -max(0, 1 - t/|v|) for eight pairs, and |v|; z = prox(v) is -v times the first.
#[inline(always)]
pub(crate) fn minus_shrinkage<I: Isa>(v: [F8<I>; 2], t: F8<I>) -> [F8<I>; 2] {
    let square = v[0].mul_add(v[0], v[1].mul_add(v[1], F8::splat(SQUARES[0]))).min(F8::splat(SQUARES[1]));
    // 1/r in the place of a root and a division, which would take as long as all else.
    let inverse = square.rsqrt();
    [t.mul_add(inverse, F8::splat(-1.0)).min(F8::zero()), square * inverse]
}

/// z = v max(0, 1 - t/|v|) for eight pairs, and |z|.
#[inline(always)]
pub(crate) fn shrink_pairs<I: Isa>(v: [F8<I>; 2], t: F8<I>) -> ([F8<I>; 2], F8<I>) {
    let [minus, size] = minus_shrinkage(v, t);
    let s = -minus;
    ([v[0] * s, v[1] * s], size * s)
}

/// Two planes, eight pixels at a time.
struct ShrinkPairs<'a> {
    a: &'a mut [f64],
    b: &'a mut [f64],
    t: f64,
}

impl Kernel for ShrinkPairs<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<I: Isa>(self) -> f64 {
        let (a, a_rest) = self.a.as_chunks_mut::<LANES>();
        let (b, b_rest) = self.b.as_chunks_mut::<LANES>();
        let threshold = F8::<I>::splat(self.t);
        let mut sum = F8::<I>::zero();
        for i in 0..a.len().min(b.len()) {
            let ([x, y], size) = shrink_pairs([F8::load(&a[i]), F8::load(&b[i])], threshold);
            x.store(&mut a[i]);
            y.store(&mut b[i]);
            sum += size;
        }
        let mut sum = sum.sum();
        for i in 0..a_rest.len() {
            let r = (a_rest[i] * a_rest[i] + b_rest[i] * b_rest[i]).sqrt();
            let s = shrinkage(r, self.t);
            a_rest[i] *= s;
            b_rest[i] *= s;
            sum += s * r;
        }
        sum
    }
}

/// The sum of sqrt(a^2 + b^2).
struct SumPairs<'a> {
    a: &'a [f64],
    b: &'a [f64],
}

impl Kernel for SumPairs<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<I: Isa>(self) -> f64 {
        let (a, a_rest) = self.a.as_chunks::<LANES>();
        let (b, b_rest) = self.b.as_chunks::<LANES>();
        let mut sum = F8::<I>::zero();
        for i in 0..a.len().min(b.len()) {
            let (x, y) = (F8::<I>::load(&a[i]), F8::<I>::load(&b[i]));
            sum += x.mul_add(x, y * y).sqrt();
        }
        a_rest.iter().zip(b_rest).fold(sum.sum(), |sum, (a, b)| sum + (a * a + b * b).sqrt())
    }
}

impl Pointwise for TotalVariation {
    fn prox(&self, pixels: Range<usize>, v: &mut [f64], weight2: f64) -> f64 {
        let (t, n) = (self.lambda / weight2, pixels.len().max(1));
        let (group, counted) = (self.group(v.len() / n), self.counted(&pixels));
        self.lambda * v.chunks_mut((group * n).max(1)).map(|v| shrink(v, n, counted.clone(), t)).sum::<f64>()
    }

    fn value(&self, pixels: Range<usize>, z: &[f64]) -> f64 {
        let n = pixels.len().max(1);
        let (group, counted) = (self.group(z.len() / n), self.counted(&pixels));
        let mut sums = [0.0; 4];
        for z in z.chunks((group * n).max(1)) {
            if z.len() == 2 * n {
                let (a, b) = z.split_at(n);
                sums[0] += dispatch(SumPairs { a: &a[counted.clone()], b: &b[counted.clone()] });
            } else {
                counted.clone().for_each(|i| sums[i % 4] += norm(z, n, i));
            }
        }
        self.lambda * ((sums[0] + sums[1]) + (sums[2] + sums[3]))
    }

    fn shrinks_pairs(&self, pixels: Range<usize>, planes: usize) -> Option<Range<usize>> {
        (self.group(planes) == 2).then(|| self.counted(&pixels))
    }

    fn gradient(&self, pixels: Range<usize>, z: &mut [f64]) {
        let n = pixels.len().max(1);
        let (group, counted) = (self.group(z.len() / n), self.counted(&pixels));
        for z in z.chunks_mut((group * n).max(1)) {
            for i in 0..n {
                let r = norm(z, n, i);
                let s = if r > 0.0 && counted.contains(&i) { self.lambda / r } else { 0.0 };
                z.iter_mut().skip(i).step_by(n).for_each(|z| *z *= s);
            }
        }
    }

    fn force(&self) -> f64 {
        self.lambda
    }

    /// The largest |q| of a group over lambda; infinite where there are forces on what does not count.
    fn gauge(&self, pixels: Range<usize>, q: &[f64]) -> Option<f64> {
        let n = pixels.len().max(1);
        let (group, counted) = (self.group(q.len() / n), self.counted(&pixels));
        let forced = |i: usize| q.iter().skip(i).step_by(n).any(|q| *q != 0.0);
        if (0..counted.start).chain(counted.end..n).any(forced) {
            return Some(f64::INFINITY);
        }
        let largest = |q: &[f64]| -> f64 {
            if q.len() == 2 * n {
                let (a, b) = q.split_at(n);
                return a.iter().zip(b).fold(0.0, |most: f64, (a, b)| most.max(a * a + b * b)).sqrt();
            }
            (0..n).map(|i| norm(q, n, i)).fold(0.0, f64::max)
        };
        Some(q.chunks((group * n).max(1)).map(largest).fold(0.0, f64::max) / self.lambda)
    }

    /// 0: g is a norm.
    fn conjugate(&self, _: Range<usize>, _: &[f64]) -> Option<f64> {
        Some(0.0)
    }
}

/// |z| of a pixel.
fn norm(z: &[f64], n: usize, i: usize) -> f64 {
    z.iter().skip(i).step_by(n).map(|z| z * z).sum::<f64>().sqrt()
}
