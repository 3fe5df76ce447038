//! Soft springs to points that nodes carry.

use crate::vector;

/// k/2 |sum_i w_i x_i - t|^2: a spring from a point that up to four nodes carry, such as one with barycentric coordinates
/// in a tetrahedron, to a target. Unused places have weight 0 and any node.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointSpring {
    /// The nodes.
    pub nodes: [u32; 4],
    /// Their parts w_i in the point.
    pub weights: [f64; 4],
    /// The target t, in the first `dim` entries.
    pub target: [f64; 3],
    /// k.
    pub stiffness: f64,
}

impl PointSpring {
    /// sum_i w_i x_i - t, for flat positions of `dim` numbers a node.
    pub fn gap(&self, x: &[f64], dim: usize) -> [f64; 3] {
        let mut gap = [0.0; 3];
        for c in 0..dim {
            let at = |i: usize| x[self.nodes[i] as usize * dim + c];
            gap[c] = (0..4).map(|i| self.weights[i] * at(i)).sum::<f64>() - self.target[c];
        }
        gap
    }

    /// The energy; k w_i (sum_j w_j x_j - t) is added to `grad` for the free nodes i.
    pub(crate) fn value_and_gradient(&self, x: &[f64], dim: usize, grad: Option<&mut [f64]>) -> f64 {
        let gap = self.gap(x, dim);
        if let Some(grad) = grad {
            for (node, w) in self.nodes.iter().zip(&self.weights) {
                let at = *node as usize * dim;
                if at < grad.len() {
                    for c in 0..dim {
                        grad[at + c] += self.stiffness * w * gap[c];
                    }
                }
            }
        }
        0.5 * self.stiffness * vector::dot(&gap, &gap)
    }

    /// Calls `add` with (i, j, k w_i w_j) for the lower triangle over the first `n_free` nodes, the diagonal included.
    pub fn for_each_entry(&self, n_free: usize, add: &mut dyn FnMut(usize, usize, f64)) {
        for i in 0..4 {
            for j in 0..=i {
                let (a, b) = (self.nodes[i] as usize, self.nodes[j] as usize);
                let entry = self.stiffness * self.weights[i] * self.weights[j];
                if a < n_free && b < n_free && entry != 0.0 {
                    // A node that stands at two places has its product twice, once from each side of the diagonal.
                    add(a.max(b), a.min(b), if a == b && i != j { 2.0 * entry } else { entry });
                }
            }
        }
    }

    /// Whether all numbers are usable and all nodes are below `n`.
    pub(crate) fn check(&self, n: usize, dim: usize) -> Result<(), String> {
        if let Some(node) = self.nodes.iter().find(|node| **node as usize >= n) {
            return Err(format!("a spring at a point names node {node} of {n}"));
        }
        let finite = vector::is_finite(&self.weights) && vector::is_finite(&self.target[..dim]);
        if self.stiffness >= 0.0 && self.stiffness.is_finite() && finite {
            return Ok(());
        }
        Err(format!("the spring at a point of nodes {:?} has a number that is no use: {self:?}", self.nodes))
    }
}
