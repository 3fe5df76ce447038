//! When a field on a triangle mesh is the gradient of a function, locally: two sets of copies (Tao, Zhang, Deng, Peng 2019,
//! *Parallel and scalable heat methods for geodesic distance computation*).

mod faces;

pub use faces::FaceField;

use crate::copies::JointSet;
use rayon::prelude::*;

/// Numbers handled by one task.
const CHUNK: usize = 4096;

/// The larger one, or what is no number.
fn worst(a: f64, b: f64) -> f64 {
    if b <= a { a } else { b }
}

/// Differences x_e along edges, whose sum around every face is zero: s_1 x_1 + s_2 x_2 + s_3 x_3 = 0 with the signs with which
/// the face runs through them. Each slot is the copy of an x_e for a face, one number, which is its image too.
///
/// The projection in the norm sum_e (.)^2 / l_e^2 spreads what is wrong over the edges by the squares of their lengths.
pub struct AroundFaces {
    faces: Vec<[(u32, f64); 3]>, // slots and signs
    at: Vec<(u32, f64)>,         // of each slot its face, and s_k l_k^2 / sum l^2
    scale: f64,
}

impl AroundFaces {
    /// For each face its slots, which are 0 .. 3 n each once, the signs and the lengths of its edges.
    pub fn new(slots: &[[u32; 3]], signs: &[[f64; 3]], lengths: &[[f64; 3]]) -> Self {
        let mut at = vec![(0, 0.0); 3 * slots.len()];
        for (f, ((slots, s), l)) in slots.iter().zip(signs).zip(lengths).enumerate() {
            let total: f64 = l.iter().map(|l| l * l).sum();
            for k in 0..3 {
                if let Some(at) = at.get_mut(slots[k] as usize) {
                    *at = (f as u32, s[k] * l[k] * l[k] / total);
                }
            }
        }
        let faces = slots.iter().zip(signs).map(|(slots, s)| [0, 1, 2].map(|k| (slots[k], s[k]))).collect();
        let scale = lengths.iter().flatten().sum::<f64>() / (3 * lengths.len()).max(1) as f64;
        AroundFaces { faces, at, scale }
    }

    #[inline]
    fn sum(&self, face: usize, images: &[f64]) -> f64 {
        let [a, b, c] = self.faces[face].map(|(slot, sign)| sign * images[slot as usize]);
        a + b + c
    }
}

impl JointSet<1> for AroundFaces {
    fn n_images(&self) -> usize {
        self.at.len()
    }

    #[inline]
    fn image(&self, _: usize, v: [f64; 1]) -> f64 {
        v[0]
    }

    fn join(&self, _: &mut [f64]) {}

    #[inline]
    fn nearest(&self, slot: usize, v: [f64; 1], images: &[f64]) -> [f64; 1] {
        let (face, share) = self.at[slot];
        [v[0] - share * self.sum(face as usize, images)]
    }

    /// The largest sum around a face, in mean lengths of edges.
    fn violation(&self, images: &[f64]) -> f64 {
        let sum = |face: usize| self.sum(face, images).abs() / self.scale;
        (0..self.faces.len()).into_par_iter().with_min_len(CHUNK).map(sum).reduce(|| 0.0, worst)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The images of copies, one after another.
    fn images<const D: usize>(set: &impl JointSet<D>, v: &[f64]) -> Vec<f64> {
        let (copies, _) = v.as_chunks::<D>();
        let mut images = vec![0.0; set.n_images()];
        copies.iter().enumerate().for_each(|(h, v)| images[h] = set.image(h, *v));
        set.join(&mut images);
        images
    }

    fn project<const D: usize>(set: &impl JointSet<D>, v: &mut [f64]) {
        let images = images(set, v);
        let (copies, _) = v.as_chunks_mut::<D>();
        copies.iter_mut().enumerate().for_each(|(h, v)| *v = set.nearest(h, *v, &images));
    }

    fn violation<const D: usize>(set: &impl JointSet<D>, v: &[f64]) -> f64 {
        set.violation(&images(set, v))
    }

    #[test]
    fn sums_around_a_face() {
        let set = AroundFaces::new(&[[0, 1, 2]], &[[1.0, -1.0, 1.0]], &[[1.0, 2.0, 1.5]]);
        let v = [0.4, 0.1, -0.9];
        let mut z = v;
        project(&set, &mut z);
        assert!((z[0] - z[1] + z[2]).abs() < 1e-15);
        // z - v is s l^2 times one number.
        let ratio = [(z[0] - v[0]) / 1.0, -(z[1] - v[1]) / 4.0, (z[2] - v[2]) / 2.25];
        assert!((ratio[0] - ratio[1]).abs() < 1e-15 && (ratio[0] - ratio[2]).abs() < 1e-15);
        assert!((violation(&set, &v) - 0.6 / 1.5).abs() < 1e-15);
    }
}
