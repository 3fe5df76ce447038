//! Pins of a surface as pins of the lattice: parts that are held rigidly are held exactly.

use super::Carrier;
use proxel_model::elements::{Shape, Simplex};
use proxel_split::PointSpring;
use std::collections::BTreeMap;

type V3 = [f64; 3];

/// Pins fit a motion if it brings each to its target within this part of the bounding box's diagonal.
const FITS: f64 = 1e-9;

/// What becomes of the pins of a surface.
#[derive(Default)]
pub(crate) struct Held {
    /// Nodes of the lattice that are fixed, ascending, and where.
    pub nodes: Vec<(u32, V3)>,
    /// Springs for the pins that no common motion fits, by vertex.
    pub springs: Vec<(u32, V3)>,
}

impl Carrier {
    /// The tetrahedra of pinned vertices, as far as they hang together, move rigidly if their pins do: their nodes are
    /// fixed where that motion takes them, and the pins are exact. The motion is that of least squares (Kabsch 1976); of
    /// a single pin it is a shift, so that its tetrahedron keeps its direction. Pins that no such motion fits, because
    /// targets stretch the surface or two groups share a node, are left to springs.
    pub(crate) fn held(&self, rest: &[V3], fixed: &[(u32, V3)]) -> Held {
        let mut out = Held::default();
        for set in self.sets(fixed) {
            let pairs: Vec<(V3, V3)> = set.iter().map(|&i| (rest[fixed[i].0 as usize], fixed[i].1)).collect();
            let motion = Motion::fit(&pairs);
            let gap = |(p, t): &(V3, V3)| super::distance(motion.apply(*p), *t);
            if pairs.iter().any(|pair| gap(pair).is_nan() || gap(pair) > FITS * self.diagonal) {
                out.springs.extend(set.iter().map(|&i| fixed[i]));
                continue;
            }
            let mut nodes: Vec<u32> = set
                .iter()
                .filter_map(|&i| self.embedding.at(fixed[i].0 as usize))
                .flat_map(|(nodes, _)| nodes)
                .collect();
            nodes.sort_unstable();
            nodes.dedup();
            let still = pairs.iter().all(|(p, t)| p == t);
            let place = |n: u32| self.embedding.lattice.points[n as usize];
            out.nodes.extend(nodes.iter().map(|&n| (n, if still { place(n) } else { motion.apply(place(n)) })));
        }
        out.nodes.sort_unstable_by_key(|n| n.0);
        out
    }

    /// The pins (their places in `fixed`) by what hangs together: tetrahedra that share a node.
    fn sets(&self, fixed: &[(u32, V3)]) -> Vec<Vec<usize>> {
        let mut parent: Vec<usize> = (0..fixed.len()).collect();
        fn root(parent: &mut [usize], mut i: usize) -> usize {
            while parent[i] != i {
                parent[i] = parent[parent[i]];
                i = parent[i];
            }
            i
        }
        let mut first_at: BTreeMap<u32, usize> = BTreeMap::new();
        for (i, (v, _)) in fixed.iter().enumerate() {
            let Some((nodes, _)) = self.embedding.at(*v as usize) else { continue };
            for n in nodes {
                let j = *first_at.entry(n).or_insert(i);
                let (a, b) = (root(&mut parent, i), root(&mut parent, j));
                parent[a.max(b)] = a.min(b);
            }
        }
        let mut sets: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (i, (v, _)) in fixed.iter().enumerate() {
            if self.embedding.at(*v as usize).is_some() {
                sets.entry(root(&mut parent, i)).or_default().push(i);
            }
        }
        sets.into_values().collect()
    }

    /// Forces of fixed nodes on the pinned vertices around them, in parts by their weights. The parts of a node add up
    /// to 1, so the sum of forces stays.
    pub(super) fn shared(ties: &[(u32, PointSpring)], nodes: impl Iterator<Item = (u32, V3)>, out: &mut [V3]) {
        /// A vertex that a node has no part in gets this share all the same, for a node with no other.
        const LEAST: f64 = 1e-6;
        let mut around: BTreeMap<u32, Vec<(u32, f64)>> = BTreeMap::new();
        for (v, tie) in ties {
            for (n, w) in tie.nodes.iter().zip(tie.weights) {
                around.entry(*n).or_default().push((*v, w + LEAST));
            }
        }
        for (n, force) in nodes {
            let Some(vertices) = around.get(&n) else { continue };
            let sum: f64 = vertices.iter().map(|x| x.1).sum();
            for (v, w) in vertices {
                (0..3).for_each(|d| out[*v as usize][d] += w / sum * force[d]);
            }
        }
    }
}

/// x -> R (x - a) + b.
struct Motion {
    rotation: [V3; 3],
    from: V3,
    to: V3,
}

impl Motion {
    /// The rigid motion that brings the first of all pairs closest to the second: R = U V^T of the decomposition of
    /// sum (t - b)(p - a)^T, the signed one, which has no reflections.
    fn fit(pairs: &[(V3, V3)]) -> Motion {
        let n = pairs.len().max(1) as f64;
        let mean = |pick: fn(&(V3, V3)) -> V3| {
            let first = pairs.first().map_or([0.0; 3], pick);
            [0, 1, 2].map(|d| first[d] + pairs.iter().map(|p| pick(p)[d] - first[d]).sum::<f64>() / n)
        };
        let (from, to) = (mean(|p| p.0), mean(|p| p.1));
        let mut m = [[0.0; 3]; 3];
        for (p, t) in pairs {
            for r in 0..3 {
                for c in 0..3 {
                    m[r][c] += (t[r] - to[r]) * (p[c] - from[c]);
                }
            }
        }
        let size = m.as_flattened().iter().fold(0.0, |s: f64, x| s.max(x.abs()));
        let mut rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        if size > 0.0 {
            let svd = <Simplex as Shape<3, 3>>::svd(m.map(|row| row.map(|x| x / size)));
            for (r, row) in rotation.iter_mut().enumerate() {
                for (c, x) in row.iter_mut().enumerate() {
                    *x = (0..3).map(|k| svd.u[r][k] * svd.v[c][k]).sum();
                }
            }
        }
        Motion { rotation, from, to }
    }

    fn apply(&self, x: V3) -> V3 {
        let d = [0, 1, 2].map(|i| x[i] - self.from[i]);
        [0, 1, 2].map(|i| self.to[i] + (0..3).map(|k| self.rotation[i][k] * d[k]).sum::<f64>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rigid_motions_are_found_from_any_number_of_points() {
        let (sin, cos) = 2.5f64.sin_cos();
        let moved = |p: V3| [cos * p[0] - sin * p[2] + 1.0, p[1] - 2.0, sin * p[0] + cos * p[2]];
        let points = [[0.1, 0.2, 0.3], [1.0, 0.0, 0.5], [0.0, 2.0, 0.0], [0.4, 0.4, -1.0], [3.0, 1.0, 1.0]];
        for n in 1..=points.len() {
            let pairs: Vec<(V3, V3)> = points[..n].iter().map(|&p| (p, moved(p))).collect();
            let motion = Motion::fit(&pairs);
            for (p, t) in &pairs {
                assert!(super::super::distance(motion.apply(*p), *t) < 1e-14, "{n} points");
            }
            let other = [5.0, -1.0, 2.0];
            assert!(n < 3 || super::super::distance(motion.apply(other), moved(other)) < 1e-13);
        }
    }
}
