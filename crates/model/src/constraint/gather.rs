//! What elements put on their nodes: sums of forces, and D^T W D.

use super::{Reduction, V3};
use proxel_linalg::sparse::SymPattern;
use rayon::prelude::*;

/// Which corners are at each node, so that nodes gather and elements need not scatter.
#[derive(Clone, Debug)]
pub(super) struct Gather {
    starts: Vec<usize>,
    corners: Vec<u32>, // positions in the list of all corners, ascending for each node
}

/// Nodes handled by one task.
const CHUNK: usize = 1024;

impl Gather {
    /// Of the corners of all elements, one after another.
    pub fn new(nodes: &[u32]) -> Self {
        let n = nodes.iter().max().map_or(0, |n| *n as usize + 1);
        let mut starts = vec![0usize; n + 1];
        for node in nodes {
            starts[*node as usize + 1] += 1;
        }
        for i in 0..n {
            starts[i + 1] += starts[i];
        }
        let (mut next, mut corners) = (starts.clone(), vec![0u32; nodes.len()]);
        for (at, node) in nodes.iter().enumerate() {
            let slot = &mut next[*node as usize];
            corners[*slot] = at as u32;
            *slot += 1;
        }
        Gather { starts, corners }
    }

    /// Adds to the nodes that `out` covers what their corners have, in the order of elements.
    pub fn add(&self, of_corners: &[V3], out: &mut [V3]) {
        let n = out.len().min(self.starts.len() - 1);
        out[..n].par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
            for (k, out) in out.iter_mut().enumerate() {
                let node = chunk * CHUNK + k;
                for at in &self.corners[self.starts[node]..self.starts[node + 1]] {
                    let f = of_corners[*at as usize];
                    *out = [out[0] + f[0], out[1] + f[1], out[2] + f[2]];
                }
            }
        });
    }
}

/// Adds w^2 D^T D of elements with `corners` nodes each to a matrix over the free nodes.
pub(super) fn add_normal<R: Reduction>(
    nodes: &[u32],
    corners: usize,
    weight2: f64,
    pattern: &SymPattern,
    values: &mut [f64],
) {
    for nodes in nodes.chunks_exact(corners) {
        for (a, i) in nodes.iter().enumerate().filter(|(_, i)| (**i as usize) < pattern.n()) {
            for (b, j) in nodes.iter().enumerate().filter(|(_, j)| **j <= *i) {
                if let Some(slot) = pattern.slot(*i as usize, *j as usize) {
                    values[slot] += weight2 * R::normal(a, b, corners);
                }
            }
        }
    }
}
