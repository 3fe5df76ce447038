//! A point at which the dual of a restoration is finite, near the forces of the splitting.

use super::Field;
use super::balance::{Frame, Variation, lower_bound};
use crate::room::Room;
use proxel_split::{Problem, vector};
use rayon::prelude::*;

/// Squared gains of the blur below which a frequency counts as one that it takes away.
const FLOOR: f64 = 1e-6;

/// Lower bounds of the objective, each over all images or over those with values within a range; those that there are.
///
/// `x` are the nodes, `u` the duals of the terms, `r` is D^T q + K^T q_y over the nodes of x, for the forces q on grad x and
/// q_y on y = K x. None where a term does not know its conjugate, or slopes are unknowns too.
pub(super) fn lower_bounds(
    problem: &mut Problem,
    x: &[f64],
    u: &[Vec<f64>],
    r: &[f64],
    field: &Field,
    range: [f64; 2],
    room: &mut Room,
) -> Vec<(f64, Option<[f64; 2]>)> {
    let mut bounds = Vec::new();
    let Some((mut q, mut q_y)) = forces(problem, x, u, field, room) else { return bounds };
    let whole = field.held.is_some() || field.measured.iter().all(|measured| *measured);
    let near = match (&field.frame, field.variation) {
        (Some(frame), _) => lower_bound(problem, [&mut q, &mut q_y], r, field, &Frame::new(frame, field), range, room),
        (None, Some(variation)) if !whole => {
            let regular = Variation::new(variation, field);
            let (mut of, mut of_y) = (room.take(q.len()), room.take(q_y.len()));
            vector::copy(&mut of, &q);
            vector::copy(&mut of_y, &q_y);
            let bound = lower_bound(problem, [&mut of, &mut of_y], r, field, &regular, range, room);
            room.give([of, of_y]);
            bound
        }
        _ => None,
    };
    bounds.extend(near.map(|bound| (bound, Some(range))));
    // Where the border is unknown, not all differences count, and no transform makes those that do diagonal.
    if field.reach.is_none()
        && field.variation.is_some()
        && let Some(bound) = exactly_balanced(problem, &mut q, &mut q_y, r, field, room)
    {
        bounds.push((bound, None));
    }
    room.give([q, q_y]);
    bounds
}

/// The forces on grad x and on K x.
fn forces(
    problem: &Problem,
    x: &[f64],
    u: &[Vec<f64>],
    field: &Field,
    room: &mut Room,
) -> Option<(Vec<f64>, Vec<f64>)> {
    let (grid, n) = (field.grid, field.grid.len());
    if field.variation.is_none() && field.frame.is_none() {
        return None;
    }
    let of = |t: usize, room: &mut Room| -> Option<Vec<f64>> {
        let (term, u) = (problem.terms.get(t)?, u.get(t)?);
        let mut forces = room.take(u.len());
        term.local_weights2(&mut forces);
        forces.par_iter_mut().zip(u).for_each(|(q, u)| *q *= u);
        Some(forces)
    };
    let q_y = match &field.held {
        Some(data) => {
            let mut y = room.take(n);
            field.blur.apply_in(grid, false, &x[..n], &mut y, room);
            y.par_iter_mut().zip(data.observed()).for_each(|(y, f)| *y = 2.0 * data.lambda() * (*y - f));
            y
        }
        None => of(1, room)?,
    };
    Some((of(0, room)?, q_y))
}

/// A lower bound over all images: the dual objective
///
/// ```text
/// -G*(q_y) over forces |q| <= 1, q_y with D^T q + K^T q_y = 0
/// ```
///
/// G the data term. Those of the splitting leave r, which vanishes as it converges. First q_y takes over what of r the blur lets
/// through, at pixels that were measured, and the mean:
/// r - K^T e. What is left is D^T w with the least w = D psi, (D^T D) psi = r - K^T e. Then q - w, q_y - e balance exactly, and
/// are divided by the largest |q - w| where that is over 1, which keeps the balance. That costs transforms of three fields there
/// and back, of one more where the data are held. The bound is off the optimum by squares of what q_y has taken over, and by the
/// largest of w.
fn exactly_balanced(
    problem: &mut Problem,
    q: &mut [f64],
    q_y: &mut [f64],
    r: &[f64],
    field: &Field,
    room: &mut Room,
) -> Option<f64> {
    let grid = field.grid;
    let measured = |k: usize| field.measured.get(k).copied().unwrap_or(true);
    let (mut e, mut psi) = (room.take(grid.len()), room.take(grid.len()));
    field.blur.explain(grid, r, FLOOR, &mut e, room);
    e.iter_mut().enumerate().filter(|(k, _)| !measured(*k)).for_each(|(_, e)| *e = 0.0);
    for channel in 0..grid.channels {
        // K keeps sums, so that the means of r and e are to be equal.
        let rows = || (0..grid.height).map(|i| (i * grid.channels + channel) * grid.width);
        let nodes = || rows().flat_map(|first| first..first + grid.width);
        let off: f64 = rows()
            .map(|first| {
                let row = first..first + grid.width;
                r[row.clone()].iter().sum::<f64>() - e[row].iter().sum::<f64>()
            })
            .sum();
        let count = nodes().filter(|k| measured(*k)).count();
        let shift = off / count.max(1) as f64;
        nodes().filter(|k| measured(*k)).for_each(|k| e[k] += shift);
    }
    field.blur.potential(grid, r, &e, &mut psi, room);
    let gradient = problem.terms.first_mut()?;
    let mut w = room.take(q.len());
    gradient.couple(&psi, &mut w);
    vector::add_scaled(q, -1.0, &w);
    vector::add_scaled(q_y, -1.0, &e);
    room.give([e, psi, w]);
    // Rounding of a prox that leaves what was not measured where it is.
    q_y.iter_mut().enumerate().filter(|(k, _)| !measured(*k)).for_each(|(_, q)| *q = 0.0);
    let mut gauge = gradient.gauge(q)?;
    if field.held.is_none() {
        gauge = gauge.max(problem.terms.get(1)?.gauge(q_y)?);
    }
    if !gauge.is_finite() {
        return None;
    }
    let scale = if gauge > 1.0 { 1.0 / gauge } else { 1.0 };
    q_y.iter_mut().for_each(|q| *q *= scale);
    match &field.held {
        // lambda |y - f|^2
        Some(data) => Some(-data.conjugate(q_y)),
        None => {
            q.iter_mut().for_each(|q| *q *= scale);
            let of_gradient = problem.terms.first()?.conjugate(q)?;
            Some(-of_gradient - problem.terms.get(1)?.conjugate(q_y)?)
        }
    }
}
