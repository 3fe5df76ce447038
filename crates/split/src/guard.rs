//! Keeps elements from inverting along a step: a filter for the direction and a limit for its length.

use crate::{Problem, vector};
use rayon::prelude::*;

mod cubic;
mod filter;

/// Elements handled by one task.
const CHUNK: usize = 2048;

/// Watches the signed volumes of elements that fill their space: those with one corner more than nodes have coordinates.
///
/// It is armed by a point at which nothing is inverted; what has a positive volume there, in the orientation it has there,
/// is to keep it. Before that, while elements are inverted, it lets everything pass: then the energy has to turn them.
pub struct InversionGuard {
    dim: usize,
    corners: Vec<[u32; 4]>, // unused corners repeat the first
    signs: Vec<f64>,        // orientation, where armed
    filter: filter::Filter,
}

impl InversionGuard {
    /// The elements of a problem; not armed.
    pub fn new(problem: &Problem) -> Self {
        let dim = problem.dim;
        let mut corners = Vec::new();
        for term in &problem.terms {
            term.for_each_element(&mut |nodes| {
                if nodes.len() == dim + 1 {
                    let mut at = [nodes[0]; 4];
                    at[..=dim].copy_from_slice(nodes);
                    corners.push(at);
                }
            });
        }
        let filter = filter::Filter::new(problem, &corners);
        InversionGuard { dim, corners, signs: Vec::new(), filter }
    }

    /// Takes x as a point without inverted elements; later points change nothing.
    pub fn arm(&mut self, x: &[f64]) {
        if self.signs.is_empty() {
            let dim = self.dim;
            self.signs = self.corners.iter().map(|c| determinant(&edges(x, c, dim)).signum()).collect();
        }
    }

    /// Whether elements are being kept from inverting.
    pub fn is_armed(&self) -> bool {
        !self.signs.is_empty()
    }

    /// The least t in (0, reach] at which an element of x - t q has no volume, slightly less than it; or infinity.
    pub fn limit(&self, x: &[f64], q: &[f64], reach: f64) -> f64 {
        let dim = self.dim;
        let of_element = |(corners, sign): (&[u32; 4], &f64)| {
            let (e, d) = (edges(x, corners, dim), directions(q, corners, dim));
            cubic::first_root(volumes(&e, &d, *sign), reach)
        };
        // A minimum is the same in any order.
        self.corners.par_iter().zip(&self.signs).with_min_len(CHUNK).map(of_element).reduce(|| f64::INFINITY, f64::min)
    }

    /// Changes q as little as the elements ask for that the direction -q would invert to first order; false where it
    /// changes nothing. See `Filter` in filter.rs.
    pub fn filter(&mut self, x: &[f64], q: &mut [f64]) -> bool {
        self.filter.apply(&self.corners, &self.signs, self.dim, x, q)
    }
}

/// Edges from corner 0, as rows; where a space has fewer than three dimensions, unit vectors across it fill up.
fn edges(x: &[f64], corners: &[u32; 4], dim: usize) -> [[f64; 3]; 3] {
    let mut e = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for k in 0..dim {
        for d in 0..dim {
            e[k][d] = x[corners[k + 1] as usize * dim + d] - x[corners[0] as usize * dim + d];
        }
    }
    e
}

/// The change of the edges along -q, which is zero at fixed nodes.
fn directions(q: &[f64], corners: &[u32; 4], dim: usize) -> [[f64; 3]; 3] {
    let at = |node: u32, d: usize| q.get(node as usize * dim + d).copied().unwrap_or(0.0);
    let mut e = [[0.0; 3]; 3];
    for k in 0..dim {
        for d in 0..dim {
            e[k][d] = at(corners[0], d) - at(corners[k + 1], d);
        }
    }
    e
}

fn cross(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot3(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn determinant(e: &[[f64; 3]; 3]) -> f64 {
    dot3(&e[0], &cross(&e[1], &e[2]))
}

/// The coefficients of det(E + t D), the constant one first, with the sign of the orientation.
fn volumes(e: &[[f64; 3]; 3], d: &[[f64; 3]; 3], sign: f64) -> [f64; 4] {
    let n = [cross(&e[1], &e[2]), cross(&e[2], &e[0]), cross(&e[0], &e[1])];
    let m = [cross(&d[1], &d[2]), cross(&d[2], &d[0]), cross(&d[0], &d[1])];
    let first = dot3(&d[0], &n[0]) + dot3(&d[1], &n[1]) + dot3(&d[2], &n[2]);
    let second = dot3(&e[0], &m[0]) + dot3(&e[1], &m[1]) + dot3(&e[2], &m[2]);
    [dot3(&e[0], &n[0]) * sign, first * sign, second * sign, dot3(&d[0], &m[0]) * sign]
}

/// Sum of squares in the fixed order of [`vector::dot`].
fn norm(a: &[f64]) -> f64 {
    vector::norm(a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_volume_along_a_ray_is_a_cubic() {
        let e = [[1.0, 0.2, -0.1], [0.3, 0.9, 0.4], [-0.2, 0.1, 1.2]];
        let d = [[-0.5, 0.3, 0.1], [0.2, -0.7, 0.6], [0.9, 0.1, -0.4]];
        let c = volumes(&e, &d, -1.0);
        for t in [0.0_f64, 0.3, 1.0, -2.0] {
            let moved: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| e[i][j] + t * d[i][j]));
            let value = c[0] + t * (c[1] + t * (c[2] + t * c[3]));
            assert!((value + determinant(&moved)).abs() < 1e-14, "{value} at {t}");
        }
    }
}
