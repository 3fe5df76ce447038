//! Planes that nodes stay on one side of.

use proxel_linalg::sparse::SymPattern;
use proxel_split::{EnergyReport, Hardening, LocalReport, PenaltyReport, Residual, Scale, Term};

/// n . x >= h.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace<const D: usize> {
    /// The unit normal, pointing to where nodes may be.
    pub normal: [f64; D],
    /// Height of the plane along it.
    pub height: f64,
}

impl<const D: usize> HalfSpace<D> {
    /// Signed distance of a point, negative where it must not be.
    pub fn distance(&self, x: &[f64]) -> f64 {
        (0..D).map(|d| self.normal[d] * x[d]).sum::<f64>() - self.height
    }
}

/// The indicator of a half-space for each of some nodes: z = x of a node, the prox is the projection. Contact is without
/// friction; the force on the node is w^2 u.
///
/// What is beyond the plane by less than [`proxel_split::VIOLATION`] times `size` counts as on its side.
pub struct Obstacle<const D: usize> {
    plane: HalfSpace<D>,
    nodes: Vec<u32>,
    weight2: Vec<f64>, // w^2 of each node
    size: f64,
}

impl<const D: usize> Obstacle<D> {
    /// Squared weights are best of the order of the stiffness that the nodes have, see
    /// [`proxel_split::Problem::node_stiffness`]; `size` is that of the body.
    pub fn new(plane: HalfSpace<D>, nodes: Vec<u32>, weight2: Vec<f64>, size: f64) -> Self {
        Obstacle { plane, nodes, weight2, size }
    }

    /// (x, p, u and w^2 of each node).
    fn visit(&self, x: &[f64], mut f: impl FnMut(usize, &[f64], f64)) {
        for (k, (node, w2)) in self.nodes.iter().zip(&self.weight2).enumerate() {
            f(k, &x[*node as usize * D..][..D], *w2);
        }
    }

    fn deepest(&self, x: &[f64]) -> f64 {
        let mut deepest = 0.0_f64;
        self.visit(x, |_, x, _| {
            let below = -self.plane.distance(x);
            deepest = if below <= deepest { deepest } else { below };
        });
        if deepest.is_nan() { f64::INFINITY } else { deepest / self.size }
    }
}

impl<const D: usize> Term for Obstacle<D> {
    fn n_elems(&self) -> usize {
        self.nodes.len()
    }

    fn is_hard(&self) -> bool {
        true
    }

    fn local_len(&self) -> usize {
        self.nodes.len() * D
    }

    fn couple(&mut self, x: &[f64], out: &mut [f64]) {
        self.visit(x, |k, x, _| out[k * D..(k + 1) * D].copy_from_slice(x));
    }

    fn local_step(&mut self, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        let mut report = LocalReport::default();
        for (k, (node, w2)) in self.nodes.iter().zip(&self.weight2).enumerate() {
            let at = *node as usize * D;
            let mut v = [0.0; D];
            for d in 0..D {
                v[d] = x[at + d] + u[k * D + d];
            }
            let push = (-self.plane.distance(&v)).max(0.0);
            for d in 0..D {
                let i = k * D + d;
                let before = p[i] + u[i];
                let z = v[d] + push * self.plane.normal[d];
                report.penalty_before += 0.5 * w2 * (x[at + d] - p[i]).powi(2);
                report.moved2 += w2 * (z - before).powi(2);
                u[i] = v[d] - z;
                p[i] = z - u[i];
                report.penalty_after += 0.5 * w2 * u[i] * u[i];
                let gap = x[at + d] - p[i];
                report.objective += 0.5 * w2 * gap * gap;
                if let Some(g) = grad.get_mut(at + d) {
                    *g += w2 * gap;
                }
            }
        }
        report
    }

    fn penalty(&mut self, x: &[f64], p: &[f64], grad: &mut [f64]) -> PenaltyReport {
        let mut value = 0.0;
        for (k, (node, w2)) in self.nodes.iter().zip(&self.weight2).enumerate() {
            for d in 0..D {
                let at = *node as usize * D + d;
                let gap = x[at] - p[k * D + d];
                value += 0.5 * w2 * gap * gap;
                if let Some(g) = grad.get_mut(at) {
                    *g += w2 * gap;
                }
            }
        }
        let energy = EnergyReport { violation: self.deepest(x), ..EnergyReport::default() };
        PenaltyReport { value, energy: Some(energy) }
    }

    fn energy(&mut self, x: &[f64], _: Option<&mut [f64]>) -> EnergyReport {
        EnergyReport { violation: self.deepest(x), ..EnergyReport::default() }
    }

    fn residual(&mut self, x: &[f64], p: &[f64], u: &[f64]) -> Residual {
        let mut residual = Residual::default();
        self.visit(x, |k, x, w2| {
            for d in 0..D {
                let z = p[k * D + d] + u[k * D + d];
                residual.gap2 += w2 * (x[d] - z).powi(2);
                residual.size2 += w2 * z * z;
            }
        });
        residual
    }

    fn for_each_element(&self, visit: &mut dyn FnMut(&[u32])) {
        for node in &self.nodes {
            visit(std::slice::from_ref(node));
        }
    }

    fn add_normal(&self, pattern: &SymPattern, values: &mut [f64]) {
        for (node, w2) in self.nodes.iter().zip(&self.weight2) {
            if let Some(slot) = pattern.slot(*node as usize, *node as usize) {
                values[slot] += w2;
            }
        }
    }

    fn add_characteristic_force(&self, _: &mut [f64]) {}

    /// The weights stay: a set has no stiffness.
    fn propose_weights(&mut self, _: (f64, f64)) -> f64 {
        1.0
    }

    fn harden(&mut self, _: &Hardening, _: &[f64], _: &[f64], _: &[f64]) -> bool {
        false
    }

    fn scale(&self) -> Scale {
        Scale { measure: 0.0, weight2: self.weight2.iter().sum(), hessian: 0.0 }
    }

    fn local_weights2(&self, out: &mut [f64]) {
        for (out, w2) in out.chunks_exact_mut(D).zip(&self.weight2) {
            out.fill(*w2);
        }
    }

    fn take_weights(&mut self, _: &mut [f64], _: &mut [f64]) {}
}
