//! The filter of a search direction that would invert elements to first order.

use super::{CHUNK, cross, edges, norm};
use crate::{Problem, vector};
use rayon::prelude::*;

/// Damping of the projected Jacobi iteration, its most steps, and the relative progress below which it ends: those of
/// the authors' code.
const DAMPING: f64 = 0.5;
const MOST_STEPS: usize = 20;
const LEAST_PROGRESS: f64 = 1e-3;

/// The linear complementarity problem of Zhu, Bridson and Kaufman 2018, section 4: with v(x) the signed volumes of
/// elements and C their gradient, the direction p is changed to p + C^T lambda,
///
/// ```text
/// 0 <= lambda   perpendicular to   v + C (p + C^T lambda) >= 0
/// ```
///
/// the least change such that to first order no volume vanishes within a step of length 1; solved by damped projected
/// Jacobi. Their stop by the Fischer-Burmeister function mixes units; here it is the size of the Jacobi step.
pub(super) struct Filter {
    starts: Vec<u32>,              // of each free node, in `of_node`
    of_node: Vec<(u32, u32)>,      // element and corner
    gradients: Vec<[[f64; 3]; 4]>, // [element][corner]: C; 0 at fixed nodes
    squares: Vec<f64>,             // diagonal of C C^T
    volumes: Vec<f64>,             // v + C p
    lambda: Vec<f64>,
    gaps: Vec<f64>,   // v + C (p + C^T lambda)
    steps: Vec<f64>,  // scaled Jacobi steps
    change: Vec<f64>, // C^T lambda
}

impl Filter {
    pub fn new(problem: &Problem, corners: &[[u32; 4]]) -> Self {
        let (free, dim) = (problem.n_free, problem.dim);
        let mut starts = vec![0; free + 1];
        let used = |c: &[u32; 4]| -> Vec<usize> { c[..=dim].iter().map(|v| *v as usize).collect() };
        for c in corners {
            used(c).into_iter().filter(|v| *v < free).for_each(|v| starts[v + 1] += 1);
        }
        for v in 0..free {
            starts[v + 1] += starts[v];
        }
        let mut next: Vec<u32> = starts[..free].to_vec();
        let mut of_node = vec![(0, 0); starts[free] as usize];
        for (e, c) in corners.iter().enumerate() {
            for (k, v) in used(c).into_iter().enumerate().filter(|(_, v)| *v < free) {
                of_node[next[v] as usize] = (e as u32, k as u32);
                next[v] += 1;
            }
        }
        let zeros = || vec![0.0; corners.len()];
        Filter {
            starts,
            of_node,
            gradients: vec![[[0.0; 3]; 4]; corners.len()],
            squares: zeros(),
            volumes: zeros(),
            lambda: zeros(),
            gaps: zeros(),
            steps: zeros(),
            change: vec![0.0; free * dim],
        }
    }

    /// Changes q, p being -q; false where no volume vanishes.
    pub fn apply(&mut self, corners: &[[u32; 4]], signs: &[f64], dim: usize, x: &[f64], q: &mut [f64]) -> bool {
        let free = self.starts.len() - 1;
        // C, its squares, and v + C p.
        self.gradients
            .par_iter_mut()
            .zip(&mut self.squares)
            .zip(&mut self.volumes)
            .zip(corners.par_iter().zip(signs))
            .with_min_len(CHUNK)
            .for_each(|(((gradient, square), volume), (corners, sign))| {
                let e = edges(x, corners, dim);
                let normals = [cross(&e[1], &e[2]), cross(&e[2], &e[0]), cross(&e[0], &e[1])];
                *gradient = [[0.0; 3]; 4];
                *volume = sign * (e[0][0] * normals[0][0] + e[0][1] * normals[0][1] + e[0][2] * normals[0][2]);
                *square = 0.0;
                for k in 0..dim {
                    for d in 0..dim {
                        gradient[k + 1][d] = sign * normals[k][d];
                        gradient[0][d] -= sign * normals[k][d];
                    }
                }
                for k in 0..=dim {
                    let node = corners[k] as usize;
                    if node >= free {
                        gradient[k] = [0.0; 3];
                    }
                    for d in 0..dim {
                        *square += gradient[k][d] * gradient[k][d];
                        *volume -= gradient[k][d] * q.get(node * dim + d).copied().unwrap_or(0.0);
                    }
                }
            });
        if self.volumes.iter().all(|v| *v >= 0.0) {
            return false;
        }
        self.lambda.fill(0.0);
        self.gaps.copy_from_slice(&self.volumes);
        let mut before = f64::INFINITY;
        for _ in 0..MOST_STEPS {
            self.lambda
                .par_iter_mut()
                .zip(&mut self.steps)
                .zip(self.gaps.par_iter().zip(&self.squares))
                .with_min_len(CHUNK)
                .for_each(|((lambda, step), (gap, square))| {
                    if *square > 0.0 {
                        let next = (*lambda - DAMPING * gap / square).max(0.0);
                        *step = (next - *lambda) * square.sqrt(); // in units of a length
                        *lambda = next;
                    }
                });
            let size = norm(&self.steps);
            if size.is_nan() || size <= 0.0 || before - size < LEAST_PROGRESS * before {
                break;
            }
            before = size;
            self.spread(dim);
            self.measure(corners, dim);
        }
        self.spread(dim);
        vector::add_scaled(q, -1.0, &self.change);
        true
    }

    /// change <- C^T lambda, each node gathering from its elements.
    fn spread(&mut self, dim: usize) {
        let (starts, of_node, gradients, lambda) = (&self.starts, &self.of_node, &self.gradients, &self.lambda);
        self.change.par_chunks_mut(dim).enumerate().with_min_len(CHUNK).for_each(|(node, change)| {
            change.fill(0.0);
            for (e, k) in &of_node[starts[node] as usize..starts[node + 1] as usize] {
                let gradient = &gradients[*e as usize][*k as usize];
                for d in 0..dim {
                    change[d] += lambda[*e as usize] * gradient[d];
                }
            }
        });
    }

    /// gaps <- v + C (p + change).
    fn measure(&mut self, corners: &[[u32; 4]], dim: usize) {
        let change = &self.change;
        self.gaps
            .par_iter_mut()
            .zip(&self.volumes)
            .zip(corners.par_iter().zip(&self.gradients))
            .with_min_len(CHUNK)
            .for_each(|((gap, volume), (corners, gradient))| {
                *gap = *volume;
                for k in 0..=dim {
                    let at = corners[k] as usize * dim;
                    if at < change.len() {
                        for d in 0..dim {
                            *gap += gradient[k][d] * change[at + d];
                        }
                    }
                }
            });
    }
}
