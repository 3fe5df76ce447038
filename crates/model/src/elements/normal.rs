//! What follows from the rows of D alone: the normal matrix W(5a) and the characteristic forces.

use super::coupling::Coupling;
use super::shape::{Shape, Simplex, block};
use super::{Elements, rest};
use proxel_linalg::simd::LANES;
use proxel_linalg::sparse::SymPattern;

impl<const D: usize, const K: usize, C: Coupling<D, K>> Elements<D, K, C>
where
    Simplex: Shape<D, K>,
{
    /// values += (W D)^T W D over the free nodes.
    pub(super) fn assemble_normal(&self, pattern: &SymPattern, values: &mut [f64]) {
        let free = pattern.n();
        let mut nodes = [0; 4];
        for place in 0..self.chunks.n_elems() {
            for (to, node) in nodes.iter_mut().zip(self.chunks.element(place)) {
                *to = node as usize;
            }
            let g = self.corner_gradients(place);
            let w2 = self.weight2[place];
            for a in 0..=K {
                for b in 0..=a {
                    let (i, j) = (nodes[a].max(nodes[b]), nodes[a].min(nodes[b]));
                    if i < free {
                        let product: f64 = g[a].iter().zip(&g[b]).map(|(a, b)| a * b).sum();
                        if let Some(slot) = pattern.slot(i, j) {
                            values[slot] += w2 * product;
                        }
                    }
                }
            }
        }
    }

    /// size += stiffness at rest times V |D_e^T e_node| for each node of each element.
    pub(super) fn assemble_characteristic_force(&self, size: &mut [f64]) {
        let stiffness = self.energy.rest_stiffness();
        for place in 0..self.chunks.n_elems() {
            let g = self.corner_gradients(place);
            for (node, g) in self.chunks.element(place).zip(&g) {
                if let Some(size) = size.get_mut(node as usize) {
                    *size += stiffness * self.measure[place] * g.iter().map(|v| v * v).sum::<f64>().sqrt();
                }
            }
        }
    }

    /// The gradients of the K + 1 barycentric coordinates of the element at `place`: rows of D_e.
    fn corner_gradients(&self, place: usize) -> [[f64; K]; 4] {
        let mut g = [[0.0; K]; 4];
        let inverse: [[f64; K]; K] = if self.inverse.is_empty() {
            let mut edges = [[0.0; D]; K];
            let slots: [usize; 4] = self.chunks.slots(place);
            for k in 0..K {
                for d in 0..D {
                    edges[k][d] = self.rest[slots[k + 1] * D + d] - self.rest[slots[0] * D + d];
                }
            }
            rest::invert(&rest::reduce(&edges)).0
        } else {
            let kept = block(&self.inverse, place / LANES, K * K);
            std::array::from_fn(|k| std::array::from_fn(|c| kept[(k * K + c) * LANES + place % LANES]))
        };
        for k in 0..K {
            for c in 0..K {
                g[k + 1][c] = inverse[k][c];
                g[0][c] -= g[k + 1][c];
            }
        }
        g
    }
}
