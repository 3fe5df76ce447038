//! When a field on a triangle mesh is the gradient of a function, locally: two sets of copies (Tao, Zhang, Deng, Peng 2019,
//! *Parallel and scalable heat methods for geodesic distance computation*).

use crate::copies::JointSet;
use rayon::prelude::*;

/// Numbers handled by one task.
const CHUNK: usize = 4096;

/// Vectors G_f of faces, each in the plane of its face, whose parts along a common edge agree: e . G_f = e . G_f' for the unit
/// vector e of every edge. Slot 3 f + k is the copy of G_f for the k-th edge of face f, two numbers.
///
/// The projection in the norm sum_f A_f |.|^2 takes from each copy along e what it has more than the mean of all copies at
/// that edge, weighted by area; an edge may have any number of faces. The image of a copy is its part along e.
pub struct AlongEdges {
    direction: Vec<[f64; 2]>, // e of each slot, in the frame of its face
    other: Vec<u32>, // the image beside which that of a slot counts: that of the other face, or a mean of several
    share: Vec<f64>, // of the slot's own image in the mean
    crowded: Vec<Crowded>, // edges with more than two faces, whose means follow the images of the slots
}

/// The slots at an edge, and their shares in its mean.
struct Crowded(Vec<(u32, f64)>);

impl AlongEdges {
    /// For each face its area, its edges by number, out of `n_edges`, and their unit vectors from the vertex of lower number,
    /// in the frame of the face. Edges that do not exist count as borders.
    pub fn new(n_edges: usize, edges: &[[u32; 3]], directions: &[[[f64; 2]; 3]], area: &[f64]) -> Self {
        let mut direction: Vec<[f64; 2]> = directions.iter().flatten().copied().collect();
        direction.resize(3 * edges.len(), [0.0; 2]);
        let mut at = vec![Vec::new(); n_edges]; // slots and areas
        for (h, e) in edges.iter().flatten().enumerate() {
            if let Some(at) = at.get_mut(*e as usize) {
                at.push((h as u32, area.get(h / 3).copied().unwrap_or(1.0)));
            }
        }
        let mut other: Vec<u32> = (0..direction.len() as u32).collect();
        let (mut share, mut crowded) = (vec![1.0; other.len()], Vec::new());
        for mut slots in at {
            let total: f64 = slots.iter().map(|(_, area)| area).sum();
            slots.iter_mut().for_each(|(_, part)| *part /= total);
            match slots[..] {
                [] | [_] => (),
                [(a, of_a), (b, of_b)] => {
                    (other[a as usize], share[a as usize]) = (b, of_a);
                    (other[b as usize], share[b as usize]) = (a, of_b);
                }
                _ => {
                    let mean = (direction.len() + crowded.len()) as u32;
                    for (h, _) in &slots {
                        (other[*h as usize], share[*h as usize]) = (mean, 0.0);
                    }
                    crowded.push(Crowded(slots));
                }
            }
        }
        AlongEdges { direction, other, share, crowded }
    }

    /// Whether the slot shares its edge with another.
    pub fn is_shared(&self, slot: usize) -> bool {
        self.other.get(slot).is_some_and(|other| *other as usize != slot)
    }

    /// What the image of a slot has more than the mean of its edge.
    #[inline]
    fn excess(&self, slot: usize, images: &[f64]) -> f64 {
        (1.0 - self.share[slot]) * (images[slot] - images[self.other[slot] as usize])
    }
}

impl JointSet<2> for AlongEdges {
    fn n_images(&self) -> usize {
        self.direction.len() + self.crowded.len()
    }

    #[inline]
    fn image(&self, slot: usize, v: [f64; 2]) -> f64 {
        let e = self.direction[slot];
        e[0] * v[0] + e[1] * v[1]
    }

    fn join(&self, images: &mut [f64]) {
        let (of_slots, means) = images.split_at_mut(self.direction.len());
        for (mean, Crowded(slots)) in means.iter_mut().zip(&self.crowded) {
            *mean = slots.iter().map(|(h, share)| share * of_slots[*h as usize]).sum();
        }
    }

    #[inline]
    fn nearest(&self, slot: usize, v: [f64; 2], images: &[f64]) -> [f64; 2] {
        let (e, excess) = (self.direction[slot], self.excess(slot, images));
        [v[0] - excess * e[0], v[1] - excess * e[1]]
    }

    /// The largest difference along an edge from its mean.
    fn violation(&self, images: &[f64]) -> f64 {
        let excess = |slot: usize| self.excess(slot, images).abs();
        (0..self.direction.len()).into_par_iter().with_min_len(CHUNK).map(excess).reduce(|| 0.0, worst)
    }
}

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

    /// Two triangles with a common edge, number 0, and a third one at it.
    fn three() -> AlongEdges {
        let turned = |a: f64| [a.cos(), a.sin()];
        let directions = [0.3, 1.1, 2.0].map(|a| [turned(a), turned(a + 1.0), turned(a + 2.0)]);
        AlongEdges::new(7, &[[0, 1, 2], [0, 3, 4], [0, 5, 6]], &directions, &[1.0, 2.0, 0.5])
    }

    /// In the norm of areas the projection is the nearest point: what it takes away is normal to the set, and what is in the
    /// set stays.
    #[test]
    fn copies_along_an_edge() {
        let set = three();
        let v: Vec<f64> = (0..18).map(|i| (i as f64 * 0.7).sin()).collect();
        let mut z = v.clone();
        project(&set, &mut z);
        assert!(violation(&set, &v) > 0.1 && violation(&set, &z) < 1e-15);
        let mut again = z.clone();
        project(&set, &mut again);
        assert!(z.iter().zip(&again).all(|(a, b)| (a - b).abs() < 1e-15));
        // Any other point of the set is as far or farther.
        let area = [1.0, 2.0, 0.5];
        let distance = |y: &[f64]| -> f64 { (0..18).map(|i| area[i / 6] * (y[i] - v[i]).powi(2)).sum() };
        for k in 0..50 {
            let mut y: Vec<f64> = (0..18).map(|i| z[i] + 0.1 * ((i + 18 * k) as f64 * 1.3).cos()).collect();
            project(&set, &mut y);
            assert!(distance(&y) >= distance(&z), "{k}");
        }
        // Edges of one face are free.
        assert!((2..6).all(|i| z[i] == v[i]) && set.is_shared(0) && !set.is_shared(1));
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
