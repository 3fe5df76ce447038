//! Points that nodes carry, such as those of a surface in a lattice.

use proxel_split::Potential;

/// Points c_k = sum_i w_ki x_i over some nodes each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    ends: Vec<usize>, // where the parts of each point end
    nodes: Vec<u32>,
    weights: Vec<f64>, // w_ki, none of them 0
}

impl Points {
    /// The nodes themselves.
    pub fn of_nodes(nodes: Vec<u32>) -> Self {
        Points { ends: (1..=nodes.len()).collect(), weights: vec![1.0; nodes.len()], nodes }
    }

    /// Adds a point; nodes with a weight of 0 are left out.
    pub fn push(&mut self, nodes: &[u32], weights: &[f64]) {
        for (node, w) in nodes.iter().zip(weights).filter(|(_, w)| **w != 0.0) {
            self.nodes.push(*node);
            self.weights.push(*w);
        }
        self.ends.push(self.nodes.len());
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The nodes that carry point `k`, and their weights.
    pub fn parts(&self, k: usize) -> (&[u32], &[f64]) {
        let range = if k == 0 { 0 } else { self.ends[k - 1] }..self.ends[k];
        (&self.nodes[range.clone()], &self.weights[range])
    }

    /// Where point `k` is, for flat positions of `D` numbers a node.
    pub fn at<const D: usize>(&self, k: usize, x: &[f64]) -> [f64; D] {
        let (nodes, weights) = self.parts(k);
        let mut c = [0.0; D];
        for (node, w) in nodes.iter().zip(weights) {
            for d in 0..D {
                c[d] += w * x[*node as usize * D + d];
            }
        }
        c
    }

    /// The transpose of [`at`](Self::at): adds w_ki f to the nodes i of point `k` that `out` covers, the first ones.
    pub fn spread<const D: usize>(&self, k: usize, f: [f64; D], out: &mut [f64]) {
        let (nodes, weights) = self.parts(k);
        for (node, w) in nodes.iter().zip(weights) {
            if let Some(out) = out.get_mut(*node as usize * D..(*node as usize + 1) * D) {
                for d in 0..D {
                    out[d] += w * f[d];
                }
            }
        }
    }

    /// Nodes that carry something are below this.
    pub fn n(&self) -> usize {
        self.nodes.iter().max().map_or(0, |v| *v as usize + 1)
    }
}

/// A potential of points in space instead of nodes: x -> potential(C x), whose gradient is C^T times that of the potential.
#[derive(Clone, Debug)]
pub struct OfPoints<P> {
    /// Over the points, by their numbers.
    pub potential: P,
    /// The points, C.
    pub points: Points,
}

impl<P: Potential> Potential for OfPoints<P> {
    fn value_and_gradient(&self, x: &[f64], grad: Option<&mut [f64]>) -> f64 {
        let n = self.points.len();
        let c: Vec<f64> = (0..n).flat_map(|k| self.points.at::<3>(k, x)).collect();
        let Some(grad) = grad else { return self.potential.value_and_gradient(&c, None) };
        let mut of_points = vec![0.0; c.len()];
        let value = self.potential.value_and_gradient(&c, Some(&mut of_points));
        for (k, f) in of_points.as_chunks::<3>().0.iter().enumerate() {
            self.points.spread(k, *f, grad);
        }
        value
    }

    fn n(&self) -> usize {
        self.points.n()
    }
}
