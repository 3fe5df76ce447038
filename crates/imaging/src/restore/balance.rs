//! Forces that balance nearly, where the border is unknown or pixels were not measured.

use super::Field;
use crate::room::Room;
use crate::{Differences, Pointwise, TotalVariation};
use proxel_split::{Problem, vector};
use rayon::prelude::*;

/// Steps of conjugate gradients.
const STEPS: usize = 5;

/// Parts of all pixels that may have larger forces than total variation bears, of which one is taken: their forces are cut.
pub(super) const CUT: [f64; 4] = [0.0, 1e-3, 4e-3, 1.5e-2];

/// A lower bound of the objective over images with values in the range: for forces |q| <= 1 and q_y,
///
/// ```text
/// objective(b) >= <q, D b> + <q_y, K b> - G*(q_y) >= sum over nodes of min(r low, r high) - G*(q_y),  r = D^T q + K^T q_y
/// ```
///
/// Those of the splitting leave an r that vanishes as it converges, but is large about the border for long. It is given back to
/// them in the least way, w to total variation and e to the data, D^T w + K^T e = r where they count:
///
/// ```text
/// min 1/2 |w|^2 + 1/2 |e|^2:    w = T D psi,  e = M K psi,   (D^T T D + K^T M K) psi = r
/// ```
///
/// T and M leave out what does not count. That takes few steps of conjugate gradients with the same sum without T and M, which
/// transforms make diagonal, before it. q - w is then over 1 here and there, mostly by little: all forces are divided by
/// what few pixels surpass, and at those q is cut. What that leaves of r counts against the range.
///
/// `q` and `q_y` are the forces on grad x and on y = K x, `r` is over the nodes of x. None where a term does not know its
/// conjugate.
pub(super) fn lower_bound(
    problem: &Problem,
    forces: (&[f64], &[f64]),
    r: &[f64],
    field: &Field,
    [low, high]: [f64; 2],
    room: &mut Room,
) -> Option<f64> {
    let (grid, variation, data) = (field.grid, field.variation?, problem.terms.get(1)?);
    let differences = Differences { grid, boundary: field.blur.boundary() };
    let row = |row: usize| row * grid.width..(row + 1) * grid.width;
    let (mut q, mut q_y) = (room.take(forces.0.len()), room.take(forces.1.len()));
    vector::copy(&mut q, forces.0);
    vector::copy(&mut q_y, forces.1);
    let psi = potential(field, &variation, differences, r, room);
    let mut w = room.take(q.len());
    differences.apply(&psi, &mut w);
    vector::add_scaled(&mut q, -1.0, &w);
    let mut e = room.take(grid.len());
    field.blur.apply_in(grid, false, &psi, &mut e, room);
    vector::add_scaled(&mut q_y, -1.0, &e);
    clear_unmeasured(field, &mut q_y);
    // K^T q_y, in the place of e.
    field.blur.apply_in(grid, true, &q_y, &mut e, room);
    let gauge = data.gauge(&q_y)?;
    let local = 2 * grid.row_len();
    let mut sizes = Vec::with_capacity(grid.n_pixels());
    q.chunks(local).enumerate().for_each(|(i, q)| variation.sizes(&row(i), q, &mut sizes));
    let mut bounds = Vec::new();
    let (mut cut, mut left, mut scaled) = (w, psi, room.take(q_y.len()));
    for part in CUT {
        let surpassed = (part * sizes.len() as f64) as usize;
        let largest = if sizes.is_empty() { 0.0 } else { *nth_largest(&mut sizes, surpassed) };
        let scale = 1.0 / largest.max(gauge).max(1.0);
        if !scale.is_normal() {
            return None;
        }
        // The nearest forces of size 1 at most: v - prox(v), by Moreau's identity; 0 where total variation does not count.
        cut.par_chunks_mut(local).zip(q.par_chunks(local)).enumerate().for_each(|(i, (cut, q))| {
            cut.iter_mut().zip(q).for_each(|(cut, q)| *cut = scale * q);
            variation.prox(row(i), cut, 1.0);
            cut.iter_mut().zip(q).for_each(|(cut, q)| *cut = scale * q - *cut);
        });
        left.iter_mut().zip(&e).for_each(|(left, e)| *left = scale * e);
        differences.add_adjoint(1.0, &cut, &mut left);
        scaled.iter_mut().zip(&q_y).for_each(|(s, q)| *s = scale * q);
        let worst: f64 = left.iter().map(|r| (r * low).min(r * high)).sum();
        bounds.push(worst - data.conjugate(&scaled)?);
    }
    room.give([q, q_y, e, cut, left, scaled]);
    bounds.into_iter().filter(|b| b.is_finite()).reduce(f64::max)
}

/// The element that so many others are not smaller than.
pub(super) fn nth_largest(sizes: &mut [f64], n: usize) -> &f64 {
    let n = n.min(sizes.len() - 1);
    sizes.select_nth_unstable_by(n, |a, b| b.total_cmp(a)).1
}

fn clear_unmeasured(field: &Field, of_y: &mut [f64]) {
    of_y.iter_mut().zip(field.measured.iter()).filter(|(_, measured)| !**measured).for_each(|(v, _)| *v = 0.0);
}

/// psi after some steps of conjugate gradients from 0.
fn potential(
    field: &Field,
    variation: &TotalVariation,
    differences: Differences,
    r: &[f64],
    room: &mut Room,
) -> Vec<f64> {
    let (grid, n) = (field.grid, r.len());
    let (mut w, mut e) = (room.take(2 * n), room.take(n));
    let mut apply = |of: &[f64], out: &mut [f64], room: &mut Room| {
        field.blur.apply_in(grid, false, of, &mut e, room);
        clear_unmeasured(field, &mut e);
        field.blur.apply_in(grid, true, &e, out, room);
        differences.apply(of, &mut w);
        w.par_chunks_mut(2 * grid.row_len()).enumerate().for_each(|(i, w)| {
            variation.clear_others(&(i * grid.width..(i + 1) * grid.width), w);
        });
        differences.add_adjoint(1.0, &w, out);
    };
    let (mut psi, mut residual) = (room.zeros(n), room.take(n));
    vector::copy(&mut residual, r);
    let [mut z, mut image, mut direction] = [0; 3].map(|_| room.take(n));
    field.blur.precondition(grid, &residual, &mut z, room);
    vector::copy(&mut direction, &z);
    let mut square = vector::dot(&residual, &z);
    for _ in 0..STEPS {
        apply(&direction, &mut image, room);
        let curvature = vector::dot(&direction, &image);
        // Nothing is left, or what is left is rounding.
        if !(curvature > 0.0 && square > 0.0) {
            break;
        }
        let step = square / curvature;
        vector::add_scaled(&mut psi, step, &direction);
        vector::add_scaled(&mut residual, -step, &image);
        field.blur.precondition(grid, &residual, &mut z, room);
        let before = std::mem::replace(&mut square, vector::dot(&residual, &z));
        direction.par_iter_mut().zip(&z).for_each(|(d, z)| *d = z + square / before * *d);
    }
    room.give([w, e, residual, z, image, direction]);
    psi
}
