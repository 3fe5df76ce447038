//! When a field on a triangle mesh is the gradient of a function, locally: two sets of copies (Tao, Zhang, Deng, Peng 2019,
//! *Parallel and scalable heat methods for geodesic distance computation*).

use crate::copies::JointSet;
use rayon::prelude::*;

/// No edge.
const NONE: u32 = u32::MAX;

/// Numbers handled by one task.
const CHUNK: usize = 4096;

/// Vectors G_f of faces, each in the plane of its face, whose parts along a common edge agree: e . G_f = e . G_f' for the unit
/// vector e of every edge. Slot 3 f + k is the copy of G_f for the k-th edge of face f, two numbers.
///
/// The projection in the norm sum_f A_f |.|^2 takes from each copy along e what it has more than the mean of all copies at
/// that edge, weighted by area; an edge may have any number of faces.
pub struct AlongEdges {
    direction: Vec<[f64; 2]>, // unit vector of the edge of each slot, in the frame of its face
    edge: Vec<u32>,           // of each slot
    offsets: Vec<u32>,        // slots of an edge
    slots: Vec<u32>,
    area: Vec<f64>, // of each face
    mean: Vec<f64>, // of each edge
}

impl AlongEdges {
    /// For each face its area, its edges by number, out of `n_edges`, and their unit vectors from the vertex of lower number,
    /// in the frame of the face.
    pub fn new(n_edges: usize, edges: &[[u32; 3]], directions: &[[[f64; 2]; 3]], area: Vec<f64>) -> Self {
        let edge: Vec<u32> = edges.iter().flatten().map(|e| if (*e as usize) < n_edges { *e } else { NONE }).collect();
        let mut direction: Vec<[f64; 2]> = directions.iter().flatten().copied().collect();
        direction.resize(edge.len(), [0.0; 2]);
        let mut offsets = vec![0u32; n_edges + 1];
        for e in edge.iter().filter(|e| **e != NONE) {
            offsets[*e as usize + 1] += 1;
        }
        for e in 0..n_edges {
            offsets[e + 1] += offsets[e];
        }
        let mut next = offsets.clone();
        let mut slots = vec![0u32; offsets[n_edges] as usize];
        for (h, e) in edge.iter().enumerate().filter(|(_, e)| **e != NONE) {
            slots[next[*e as usize] as usize] = h as u32;
            next[*e as usize] += 1;
        }
        let mut area = area;
        area.resize(edge.len() / 3, 1.0);
        AlongEdges { direction, edge, offsets, slots, area, mean: vec![0.0; n_edges] }
    }

    /// Whether the slot shares its edge with another.
    pub fn is_shared(&self, slot: usize) -> bool {
        self.edge.get(slot).filter(|e| **e != NONE).is_some_and(|e| {
            let e = *e as usize;
            self.offsets[e + 1] - self.offsets[e] > 1
        })
    }

    fn along(&self, v: &[f64], slot: usize) -> f64 {
        let e = self.direction[slot];
        e[0] * v[2 * slot] + e[1] * v[2 * slot + 1]
    }

    fn take_means(&mut self, v: &[f64]) {
        let mut mean = std::mem::take(&mut self.mean);
        mean.par_iter_mut().with_min_len(CHUNK).enumerate().for_each(|(e, mean)| {
            let (mut sum, mut area) = (0.0, 0.0);
            for h in &self.slots[self.offsets[e] as usize..self.offsets[e + 1] as usize] {
                let a = self.area[*h as usize / 3];
                sum += a * self.along(v, *h as usize);
                area += a;
            }
            *mean = if area > 0.0 { sum / area } else { 0.0 };
        });
        self.mean = mean;
    }
}

impl JointSet for AlongEdges {
    fn project(&mut self, v: &mut [f64]) {
        self.take_means(v);
        let (edge, mean, direction) = (&self.edge, &self.mean, &self.direction);
        v.par_chunks_exact_mut(2).zip(edge).zip(direction).with_min_len(CHUNK).for_each(|((v, edge), e)| {
            let Some(mean) = mean.get(*edge as usize) else { return };
            let excess = e[0] * v[0] + e[1] * v[1] - mean;
            v[0] -= excess * e[0];
            v[1] -= excess * e[1];
        });
    }

    /// The largest difference along an edge.
    fn violation(&mut self, v: &[f64]) -> f64 {
        self.take_means(v);
        let excess = |(h, edge): (usize, &u32)| {
            self.mean.get(*edge as usize).map_or(0.0, |mean| (self.along(v, h) - mean).abs())
        };
        let worst = |a: f64, b: f64| if b <= a { a } else { b };
        self.edge.par_iter().enumerate().with_min_len(CHUNK).map(excess).reduce(|| 0.0, worst)
    }
}

/// Differences x_e along edges, whose sum around every face is zero: s_1 x_1 + s_2 x_2 + s_3 x_3 = 0 with the signs with which
/// the face runs through them. Slot 3 f + k is the copy of x_e for the k-th edge of face f, one number.
///
/// The projection in the norm sum_e (.)^2 / l_e^2 spreads what is wrong over the edges by the squares of their lengths.
pub struct AroundFaces {
    shares: Vec<[f64; 3]>, // s_k l_k^2 / sum l^2
    signs: Vec<[f64; 3]>,
    scale: f64,
}

impl AroundFaces {
    /// For each face the signs and the lengths of its edges.
    pub fn new(signs: Vec<[f64; 3]>, lengths: &[[f64; 3]]) -> Self {
        let shares = signs.iter().zip(lengths).map(|(s, l)| {
            let total: f64 = l.iter().map(|l| l * l).sum();
            [0, 1, 2].map(|k| s[k] * l[k] * l[k] / total)
        });
        let scale = lengths.iter().flatten().sum::<f64>() / (3 * lengths.len()).max(1) as f64;
        AroundFaces { shares: shares.collect(), signs, scale }
    }
}

impl JointSet for AroundFaces {
    fn project(&mut self, v: &mut [f64]) {
        let faces = v.par_chunks_exact_mut(3).zip(&self.signs).zip(&self.shares);
        faces.with_min_len(CHUNK).for_each(|((v, s), share)| {
            let sum: f64 = (0..3).map(|k| s[k] * v[k]).sum();
            (0..3).for_each(|k| v[k] -= share[k] * sum);
        });
    }

    /// The largest sum around a face, in mean lengths of edges.
    fn violation(&mut self, v: &[f64]) -> f64 {
        let worst = |a: f64, b: f64| if b <= a { a } else { b };
        let faces = v.par_chunks_exact(3).zip(&self.signs).with_min_len(CHUNK);
        let sums = faces.map(|(v, s)| (0..3).map(|k| s[k] * v[k]).sum::<f64>().abs() / self.scale);
        sums.reduce(|| 0.0, worst)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles with a common edge, number 0, and a third one at it.
    fn three() -> AlongEdges {
        let turned = |a: f64| [a.cos(), a.sin()];
        let directions = [0.3, 1.1, 2.0].map(|a| [turned(a), turned(a + 1.0), turned(a + 2.0)]);
        AlongEdges::new(7, &[[0, 1, 2], [0, 3, 4], [0, 5, 6]], &directions, vec![1.0, 2.0, 0.5])
    }

    /// In the norm of areas the projection is the nearest point: what it takes away is normal to the set, and what is in the
    /// set stays.
    #[test]
    fn copies_along_an_edge() {
        let mut set = three();
        let v: Vec<f64> = (0..18).map(|i| (i as f64 * 0.7).sin()).collect();
        let mut z = v.clone();
        set.project(&mut z);
        assert!(set.violation(&v) > 0.1 && set.violation(&z) < 1e-15);
        let mut again = z.clone();
        set.project(&mut again);
        assert!(z.iter().zip(&again).all(|(a, b)| (a - b).abs() < 1e-15));
        // Any other point of the set is as far or farther.
        let area = [1.0, 2.0, 0.5];
        let distance = |y: &[f64]| -> f64 { (0..18).map(|i| area[i / 6] * (y[i] - v[i]).powi(2)).sum() };
        for k in 0..50 {
            let mut y: Vec<f64> = (0..18).map(|i| z[i] + 0.1 * ((i + 18 * k) as f64 * 1.3).cos()).collect();
            set.project(&mut y);
            assert!(distance(&y) >= distance(&z), "{k}");
        }
        // Edges of one face are free.
        assert!((2..6).all(|i| z[i] == v[i]) && set.is_shared(0) && !set.is_shared(1));
    }

    #[test]
    fn sums_around_a_face() {
        let mut set = AroundFaces::new(vec![[1.0, -1.0, 1.0]], &[[1.0, 2.0, 1.5]]);
        let v = [0.4, 0.1, -0.9];
        let mut z = v;
        set.project(&mut z);
        assert!((z[0] - z[1] + z[2]).abs() < 1e-15);
        // z - v is s l^2 times one number.
        let ratio = [(z[0] - v[0]) / 1.0, -(z[1] - v[1]) / 4.0, (z[2] - v[2]) / 2.25];
        assert!((ratio[0] - ratio[1]).abs() < 1e-15 && (ratio[0] - ratio[2]).abs() < 1e-15);
        assert!((set.violation(&v) - 0.6 / 1.5).abs() < 1e-15);
    }
}
