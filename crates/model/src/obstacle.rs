//! Walls that nodes, or points that nodes carry, stay in front of.

use crate::points::Points;
use crate::solid::{Placed, deepest};
use proxel_linalg::sparse::SymPattern;
use proxel_split::{Cycle, EnergyReport, LocalReport, Order, PenaltyReport, Residual, Scale, Term};

/// The border of a set that points stay in.
pub trait Wall<const D: usize>: Send + Sync {
    /// Signed distance of a point, negative where it must not be.
    fn distance(&self, x: &[f64; D]) -> f64;

    /// What takes a point to the nearest one where it may be; zero where it may be.
    fn push(&self, x: &[f64; D]) -> [f64; D];
}

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

impl<const D: usize> Wall<D> for HalfSpace<D> {
    fn distance(&self, x: &[f64; D]) -> f64 {
        HalfSpace::distance(self, x)
    }

    fn push(&self, x: &[f64; D]) -> [f64; D] {
        let depth = (-HalfSpace::distance(self, x)).max(0.0);
        self.normal.map(|n| depth * n)
    }
}

/// The outside of solids: of several that a point is in, it goes to the surface of the one it is deepest in.
#[derive(Clone, Debug, Default)]
pub struct Solids(pub Vec<Placed>);

impl Wall<3> for Solids {
    fn distance(&self, x: &[f64; 3]) -> f64 {
        deepest(&self.0, *x).map_or(f64::INFINITY, |nearest| nearest.distance)
    }

    fn push(&self, x: &[f64; 3]) -> [f64; 3] {
        match deepest(&self.0, *x).filter(|nearest| nearest.distance < 0.0) {
            Some(nearest) => [0, 1, 2].map(|d| nearest.point[d] - x[d]),
            None => [0.0; 3],
        }
    }
}

/// The indicator of the front of a wall for each of some points c_k = sum_i w_ki x_i, most often the nodes themselves: z = c_k, the
/// prox is the projection. Contact is without friction; the force on the point is w^2 u, on its nodes w_ki w^2 u.
///
/// What is beyond the wall by less than [`proxel_split::VIOLATION`] times `size` counts as on its side.
pub struct Obstacle<const D: usize, W = HalfSpace<D>> {
    wall: W,
    points: Points,
    full: Vec<f64>,    // w^2 of each point in contact
    weight2: Vec<f64>, // w^2 as it is
    quiet: Vec<u32>,   // iterations since each point was in contact
    raised: Vec<u32>,  // how often the weight of each was raised
    waited: u32,       // iterations since weights were taken
    size: f64,
}

/// w^2 of points that touch nothing, in units of that in contact. Their z is but the point where it was an iteration before,
/// which ties the body to where it is: 5000 iterations instead of 110 for a bar that touches nothing.
const FAR: f64 = 1e-5;
/// Iterations without contact after which a point is far.
const QUIET: u32 = 30;
/// Times that the weight of a point is raised; the last time it stays.
const RAISES: u32 = 4;
/// Iterations between two changes of weights, since each costs a factorisation.
const WAIT: u32 = 10;

impl<const D: usize, W: Wall<D>> Obstacle<D, W> {
    /// Squared weights are best of the order of the stiffness that the nodes have, see
    /// [`proxel_split::Problem::node_stiffness`], over the number of points that share them; `size` is that of the body.
    pub fn new(wall: W, points: Points, weight2: Vec<f64>, size: f64) -> Self {
        let n = points.len();
        let (quiet, raised) = (vec![0; n], vec![0; n]);
        Obstacle { wall, points, full: weight2.clone(), weight2, quiet, raised, waited: 0, size }
    }

    /// With weights that follow contact, for methods that change weights; points that are far from the wall at `x` begin
    /// with a small one.
    pub fn following(mut self, x: &[f64]) -> Self {
        /// Near is a point within this part of the size.
        const NEAR: f64 = 0.02;
        for k in 0..self.points.len() {
            if self.wall.distance(&self.points.at::<D>(k, x)) > NEAR * self.size {
                self.quiet[k] = QUIET;
                self.weight2[k] = FAR * self.full[k];
            }
        }
        self
    }

    /// w^2 that a point should have.
    fn wanted(&self, k: usize) -> f64 {
        if self.quiet[k] < QUIET || self.raised[k] >= RAISES { self.full[k] } else { FAR * self.full[k] }
    }

    fn deepest(&self, x: &[f64]) -> f64 {
        let mut deepest = 0.0_f64;
        for k in 0..self.points.len() {
            let below = -self.wall.distance(&self.points.at::<D>(k, x));
            deepest = if below <= deepest { deepest } else { below };
        }
        if deepest.is_nan() { f64::INFINITY } else { deepest / self.size }
    }
}

impl<const D: usize, W: Wall<D>> Term for Obstacle<D, W> {
    fn n_elems(&self) -> usize {
        self.points.len()
    }

    fn is_hard(&self) -> bool {
        true
    }

    fn local_len(&self) -> usize {
        self.points.len() * D
    }

    fn couple(&mut self, x: &[f64], out: &mut [f64]) {
        for (k, out) in out.chunks_exact_mut(D).enumerate() {
            out.copy_from_slice(&self.points.at::<D>(k, x));
        }
    }

    fn local_step(&mut self, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        self.cycle_step(&Cycle::PLAIN, x, p, u, grad)
    }

    fn cycle_step(&mut self, cycle: &Cycle, x: &[f64], p: &mut [f64], u: &mut [f64], grad: &mut [f64]) -> LocalReport {
        let mut report = LocalReport::default();
        for (k, w2) in self.weight2.iter().enumerate() {
            let c: [f64; D] = self.points.at(k, x);
            let (mut v, mut force) = (c, [0.0; D]);
            for d in 0..D {
                let i = k * D + d;
                v[d] += u[i] + (cycle.relaxation - 1.0) * (c[d] - (p[i] + u[i]));
            }
            let push = self.wall.push(&v);
            self.quiet[k] = if push != [0.0; D] { 0 } else { self.quiet[k].saturating_add(1) };
            for d in 0..D {
                let i = k * D + d;
                let before = p[i] + u[i];
                let z = v[d] + push[d];
                report.penalty_before += 0.5 * w2 * (c[d] - p[i]).powi(2);
                report.moved2 += w2 * (z - before).powi(2);
                report.gap2_before += w2 * (c[d] - before).powi(2);
                report.gap2 += w2 * (c[d] - z).powi(2);
                report.penalty_after += 0.5 * w2 * (v[d] - z).powi(2);
                if cycle.order == Order::Xzu {
                    u[i] = v[d] - z;
                }
                p[i] = z - u[i];
                let gap = c[d] - p[i];
                report.objective += 0.5 * w2 * gap * gap;
                force[d] = w2 * gap;
            }
            self.points.spread(k, force, grad);
        }
        report
    }

    fn penalty(&mut self, x: &[f64], p: &[f64], grad: &mut [f64]) -> PenaltyReport {
        let mut value = 0.0;
        for (k, w2) in self.weight2.iter().enumerate() {
            let mut force: [f64; D] = self.points.at(k, x);
            for d in 0..D {
                let gap = force[d] - p[k * D + d];
                value += 0.5 * w2 * gap * gap;
                force[d] = w2 * gap;
            }
            self.points.spread(k, force, grad);
        }
        let energy = EnergyReport { violation: self.deepest(x), ..EnergyReport::default() };
        PenaltyReport { value, energy: Some(energy) }
    }

    fn energy(&mut self, x: &[f64], _: Option<&mut [f64]>) -> EnergyReport {
        EnergyReport { violation: self.deepest(x), ..EnergyReport::default() }
    }

    fn residual(&mut self, x: &[f64], p: &[f64], u: &[f64]) -> Residual {
        let mut residual = Residual::default();
        for (k, w2) in self.weight2.iter().enumerate() {
            let c: [f64; D] = self.points.at(k, x);
            for d in 0..D {
                let z = p[k * D + d] + u[k * D + d];
                residual.gap2 += w2 * (c[d] - z).powi(2);
                residual.size2 += w2 * z * z;
            }
        }
        residual
    }

    fn for_each_element(&self, visit: &mut dyn FnMut(&[u32])) {
        (0..self.points.len()).for_each(|k| visit(self.points.parts(k).0));
    }

    fn add_normal(&self, pattern: &SymPattern, values: &mut [f64]) {
        for (k, w2) in self.weight2.iter().enumerate() {
            let (nodes, weights) = self.points.parts(k);
            for (i, a) in nodes.iter().zip(weights).filter(|(i, _)| (**i as usize) < pattern.n()) {
                for (j, b) in nodes.iter().zip(weights).filter(|(j, _)| **j <= *i) {
                    if let Some(slot) = pattern.slot(*i as usize, *j as usize) {
                        values[slot] += w2 * a * b;
                    }
                }
            }
        }
    }

    /// A set has no stiffness; its weights follow contact.
    fn propose_weights(&mut self, _: (f64, f64)) -> f64 {
        self.waited += 1;
        let ratio = |k: usize| self.wanted(k) / self.weight2[k];
        if self.waited < WAIT {
            return 1.0;
        }
        (0..self.points.len()).map(|k| ratio(k).max(1.0 / ratio(k))).fold(1.0, f64::max)
    }

    fn scale(&self) -> Scale {
        Scale { weight2: self.weight2.iter().sum(), ..Scale::default() }
    }

    fn local_weights2(&self, out: &mut [f64]) {
        for (out, w2) in out.chunks_exact_mut(D).zip(&self.weight2) {
            out.fill(*w2);
        }
    }

    fn take_weights(&mut self, p: &mut [f64], u: &mut [f64]) {
        self.waited = 0;
        for k in 0..self.points.len() {
            let wanted = self.wanted(k);
            let scale = self.weight2[k] / wanted;
            self.raised[k] += u32::from(scale < 1.0);
            self.weight2[k] = wanted;
            for i in k * D..(k + 1) * D {
                let z = p[i] + u[i];
                u[i] *= scale;
                p[i] = z - u[i];
            }
        }
    }
}
