//! How far an image is from the best, proven.

use super::Field;
use super::dual_point;
use crate::room::Room;
use proxel_split::{Method, Splitting, vector};
use rayon::prelude::*;

/// A bound on how much lower the objective can be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// The objective at x.
    pub objective: f64,
    /// objective - (a lower bound of it over all fields, or over those with values in the range).
    pub gap: f64,
    /// The range; none where the bound holds over all fields.
    pub range: Option<[f64; 2]>,
}

impl Gap {
    /// Over the objective.
    pub fn relative(&self) -> f64 {
        self.gap / self.objective.max(f64::MIN_POSITIVE)
    }
}

/// Takes duality gaps, in room that it keeps.
#[derive(Default)]
pub struct Certifier {
    room: Room,
}

/// The duality gap after a step, see [`Certifier::gap`].
pub fn duality_gap(method: &mut dyn Method, field: &Field) -> Option<Gap> {
    Certifier::default().gap(method, field)
}

impl Certifier {
    /// The duality gap after a step, for terms without hard sets, in the x-z-u order.
    ///
    /// The forces q_t = w^2 u_t of a local step are subgradients at z_t, so that g_t(D_t b) >= g_t(z_t) + <q_t, D_t b - z_t>
    /// for every b; the quadratic f lies above its tangent at x, of slope s. With r = s + sum D_t^T q_t, for every b with
    /// values in the range,
    ///
    /// ```text
    /// objective(b) >= f(x) - <s, x> + sum (g_t(z_t) - <q_t, z_t>) + sum over nodes of min(r low, r high)
    /// ```
    ///
    /// Since x minimises f + 1/2 sum w^2 |D_t x - p_t|^2, r = -sum D_t^T w^2 (D_t x - z_t), which vanishes as the splitting
    /// converges and takes no gradient of f. The range is that of x and of what was seen, made wider by its width on each side;
    /// a solution lies inside, or the bound is none for fields outside: without a range no finite bound is to be had where a
    /// blur destroys frequencies.
    ///
    /// Where there are slopes they are bounded in the same way, by a range of their own.
    ///
    /// That bound counts every residual against the whole range. Where data and gradient are all that there is, others move the
    /// forces to where they balance: exactly, which needs no range, or nearly where the border is unknown or pixels were not
    /// measured. The smallest gap is the result.
    ///
    /// None where the method splits nothing, or a term is a hard set.
    pub fn gap(&mut self, method: &mut dyn Method, field: &Field) -> Option<Gap> {
        let room = &mut self.room;
        let objective = method.energy().value;
        let n = field.grid.len();
        let Splitting { problem, x, p, u } = method.splitting()?;
        if problem.has_hard_sets() {
            return None;
        }
        let mut residual = room.zeros(x.len()); // -D_t^T w^2 (D_t x - z_t), node by node
        let mut gap = 0.0;
        for (term, (p, u)) in problem.terms.iter_mut().zip(p.iter().zip(u)) {
            let [mut z, mut forces, mut off] = [0; 3].map(|_| room.take(p.len()));
            z.par_iter_mut().zip(p.par_iter().zip(u)).for_each(|(z, (p, u))| *z = p + u);
            term.local_weights2(&mut forces);
            forces.par_iter_mut().zip(u).for_each(|(w, u)| *w *= u);
            term.couple(x, &mut off);
            vector::add_scaled(&mut off, -1.0, &z); // D x - z
            gap += term.energy(x, None).value - term.local_value(&z)? - vector::dot(&forces, &off);
            term.penalty(x, &z, &mut residual);
            room.give([z, forces, off]);
        }
        if field.carries {
            let (of_x, others) = residual.split_at_mut(n);
            let mut back = room.take(n);
            field.blur.apply_in(field.grid, true, &others[..n], &mut back, room);
            vector::add_scaled(of_x, 1.0, &back);
            room.give([back]);
        }
        let range = widened(&x[..n], field.values);
        gap += worst(&x[..n], &residual[..n], range);
        if let Some(first) = field.first_slope() {
            gap += worst(&x[first..], &residual[first..], widened(&x[first..], [f64::INFINITY, f64::NEG_INFINITY]));
        }
        let within = Gap { objective, gap, range: Some(range) };
        residual[..n].par_iter_mut().for_each(|r| *r = -*r);
        let bounds = dual_point::lower_bounds(problem, x, u, &residual[..n], field, range, room);
        room.give([residual]);
        let others = bounds.into_iter().map(|(bound, range)| Gap { objective, gap: objective - bound, range });
        // The least; where two are equal the one that says more.
        Some(others.fold(within, |least, gap| if gap.gap <= least.gap { gap } else { least }))
    }
}

/// The range of some numbers and of another range, made wider by its width on each side.
fn widened(x: &[f64], [low, high]: [f64; 2]) -> [f64; 2] {
    let (low, high) = x.iter().fold((low, high), |(l, h), v| (l.min(*v), h.max(*v)));
    [low - (high - low), high + (high - low)]
}

/// The sum of r (x - b) at the worst b within the range, for residuals -r.
fn worst(x: &[f64], residual: &[f64], [low, high]: [f64; 2]) -> f64 {
    x.iter().zip(residual).map(|(x, g)| if *g < 0.0 { -g * (x - low) } else { g * (high - x) }).sum()
}
