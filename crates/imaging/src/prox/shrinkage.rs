//! Absolute values of many numbers a pixel, each with a weight of its own.

use super::{Pointwise, Window};
use std::ops::Range;
use std::sync::Arc;

/// g(z) = sum over pixels and k of weight_k |z_k|, z_k the number k of a pixel: of each channel, or of all channels together,
///
/// ```text
/// |z_k| = (sum over channels z_ck^2)^(1/2)
/// ```
///
/// so that colours have their edges at one place. The prox shrinks: z_k = v_k max(0, 1 - (weight_k / weight2) / |v_k|). Numbers
/// of weight 0 stay.
#[derive(Clone, Debug)]
pub struct Shrinkage {
    /// weight_k >= 0
    pub weights: Arc<Vec<f64>>,
    /// Whether channels count together.
    pub joint: bool,
    /// Which pixels count; all of them where there is none.
    pub within: Option<Window>,
}

impl Shrinkage {
    /// Visits the planes that count together, as where the first begins and the distance to the next, with their weight.
    fn groups(&self, planes: usize, mut visit: impl FnMut(Group, f64)) {
        let count = self.weights.len().max(1);
        let channels = planes / count;
        for (k, weight) in self.weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
            if self.joint {
                visit(Group { first: k, step: count, channels }, *weight);
            } else {
                (0..channels).for_each(|c| visit(Group { first: c * count + k, step: count, channels: 1 }, *weight));
            }
        }
    }

    /// 0 in what does not count.
    pub(crate) fn clear_others(&self, pixels: &Range<usize>, z: &mut [f64]) {
        let (counted, weights) = (self.counted(pixels), &self.weights);
        for (plane, weight) in z.chunks_mut(pixels.len().max(1)).zip(weights.iter().cycle()) {
            if *weight > 0.0 {
                plane[..counted.start].fill(0.0);
                plane[counted.end..].fill(0.0);
            } else {
                plane.fill(0.0);
            }
        }
    }

    /// Appends the largest |q_k| / weight_k of each of a row's pixels that counts.
    pub(crate) fn gauges(&self, pixels: &Range<usize>, q: &[f64], gauges: &mut Vec<f64>) {
        let (n, counted, first) = (pixels.len().max(1), self.counted(pixels), gauges.len());
        gauges.resize(first + counted.len(), 0.0);
        self.groups(q.len() / n, |group, weight| {
            let of = gauges[first..].iter_mut().zip(counted.clone());
            of.for_each(|(gauge, i)| *gauge = gauge.max(group.size(q, n, i) / weight));
        });
    }

    /// Those of a row's pixels that count.
    fn counted(&self, pixels: &Range<usize>) -> Range<usize> {
        let Some(window) = self.within else { return 0..pixels.len() };
        let row = pixels.start / window.width.max(1);
        let [from, to] = if (window.rows[0]..window.rows[1]).contains(&row) { window.columns } else { [0, 0] };
        from.min(pixels.len())..to.min(pixels.len())
    }
}

/// Planes that count together.
#[derive(Clone, Copy)]
struct Group {
    first: usize,
    step: usize,
    channels: usize,
}

impl Group {
    /// |z_k| of a row's pixel i, of n.
    fn size(&self, z: &[f64], n: usize, i: usize) -> f64 {
        let at = |c: usize| z[(self.first + c * self.step) * n + i];
        if self.channels == 1 { at(0).abs() } else { (0..self.channels).map(|c| at(c) * at(c)).sum::<f64>().sqrt() }
    }

    fn scale(&self, z: &mut [f64], n: usize, i: usize, by: f64) {
        (0..self.channels).for_each(|c| z[(self.first + c * self.step) * n + i] *= by);
    }
}

impl Pointwise for Shrinkage {
    fn prox(&self, pixels: Range<usize>, v: &mut [f64], weight2: f64) -> f64 {
        let (n, counted, mut value) = (pixels.len().max(1), self.counted(&pixels), 0.0);
        self.groups(v.len() / n, |group, weight| {
            let t = weight / weight2;
            let mut sum = 0.0;
            if group.channels == 1 {
                for v in &mut v[group.first * n..][counted.clone()] {
                    let size = (v.abs() - t).max(0.0);
                    *v = size.copysign(*v);
                    sum += size;
                }
            } else {
                for i in counted.clone() {
                    let r = group.size(v, n, i);
                    // r = 0 gives 0: `max` drops the NaN of 0/0.
                    let by = (1.0 - t / r).max(0.0);
                    group.scale(v, n, i, by);
                    sum += by * r;
                }
            }
            value += weight * sum;
        });
        value
    }

    fn value(&self, pixels: Range<usize>, z: &[f64]) -> f64 {
        let (n, counted, mut value) = (pixels.len().max(1), self.counted(&pixels), 0.0);
        self.groups(z.len() / n, |group, weight| {
            value += weight * counted.clone().map(|i| group.size(z, n, i)).sum::<f64>();
        });
        value
    }

    fn gradient(&self, pixels: Range<usize>, z: &mut [f64]) {
        let (n, counted) = (pixels.len().max(1), self.counted(&pixels));
        let before = z.to_vec();
        z.fill(0.0);
        self.groups(z.len() / n, |group, weight| {
            for i in counted.clone() {
                let r = group.size(&before, n, i);
                for c in (0..group.channels).filter(|_| r > 0.0) {
                    let at = (group.first + c * group.step) * n + i;
                    z[at] = weight * before[at] / r;
                }
            }
        });
    }

    fn shrinks_numbers(&self, pixels: Range<usize>, planes: usize) -> Option<(Range<usize>, &[f64])> {
        let alone = !self.joint || planes <= self.weights.len();
        (alone && !self.weights.is_empty()).then(|| (self.counted(&pixels), self.weights.as_slice()))
    }

    /// The largest weight.
    fn force(&self) -> f64 {
        self.weights.iter().copied().fold(0.0, f64::max)
    }

    /// The largest |q_k| over weight_k; infinite where there are forces on what does not count.
    fn gauge(&self, pixels: Range<usize>, q: &[f64]) -> Option<f64> {
        let (n, counted) = (pixels.len().max(1), self.counted(&pixels));
        let mut rest = q.to_vec();
        let mut most: f64 = 0.0;
        self.groups(q.len() / n, |group, weight| {
            for i in counted.clone() {
                most = most.max(group.size(q, n, i) / weight);
                group.scale(&mut rest, n, i, 0.0);
            }
        });
        Some(if rest.iter().all(|q| *q == 0.0) { most } else { f64::INFINITY })
    }

    /// 0: g is a seminorm.
    fn conjugate(&self, _: Range<usize>, _: &[f64]) -> Option<f64> {
        Some(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(joint: bool) -> Shrinkage {
        let within = Some(Window { width: 5, rows: [0, 9], columns: [0, 4] });
        Shrinkage { weights: Arc::new(vec![0.0, 2.0, 0.7]), joint, within }
    }

    fn numbers(seed: f64) -> Vec<f64> {
        (0..2 * 3 * 5).map(|k| ((k * k) as f64 * 0.37 + seed).sin()).collect()
    }

    /// g of a row of five pixels, two channels, three numbers each, by its definition: the last pixel does not count.
    fn by_hand(joint: bool, z: &[f64]) -> f64 {
        let at = |c: usize, k: usize, i: usize| z[(c * 3 + k) * 5 + i];
        let term = |k: usize, i: usize| {
            if joint { at(0, k, i).hypot(at(1, k, i)) } else { at(0, k, i).abs() + at(1, k, i).abs() }
        };
        (0..4).map(|i| 2.0 * term(1, i) + 0.7 * term(2, i)).sum()
    }

    #[test]
    fn the_prox_is_the_least_point_and_values_are_those_of_the_definition() {
        for joint in [false, true] {
            let (g, v, weight2) = (of(joint), numbers(0.2), 3.5);
            let mut z = v.clone();
            let value = g.prox(10..15, &mut z, weight2);
            assert!((value - by_hand(joint, &z)).abs() < 1e-12 && (g.value(10..15, &z) - value).abs() < 1e-12);
            assert!(z.contains(&0.0) && by_hand(joint, &z) > 1.0);
            let objective = |z: &[f64]| {
                by_hand(joint, z) + 0.5 * weight2 * z.iter().zip(&v).map(|(z, v)| (z - v).powi(2)).sum::<f64>()
            };
            let least = objective(&z);
            for trial in 0..400 {
                let size = 0.3 * 10f64.powi(-(trial % 4));
                let moved: Vec<f64> = z.iter().zip(numbers(trial as f64)).map(|(z, d)| z + size * d).collect();
                assert!(objective(&moved) >= least - 1e-13, "{joint}, {trial}");
            }
        }
    }

    #[test]
    fn forces_of_gauge_one_bound_it_from_below() {
        for joint in [false, true] {
            let (g, z) = (of(joint), numbers(0.9));
            let mut q = z.clone();
            g.gradient(0..5, &mut q);
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            // g(z) = <grad g(z), z>, of gauge 1, and is at least <q, z> of any such force.
            assert!((dot(&q, &z) - g.value(0..5, &z)).abs() < 1e-12);
            assert!((g.gauge(0..5, &q).unwrap() - 1.0).abs() < 1e-12);
            assert!(dot(&q, &numbers(0.1)) <= g.value(0..5, &numbers(0.1)));
            q[0] = 1.0;
            assert_eq!(g.gauge(0..5, &q), Some(f64::INFINITY));
        }
    }
}
