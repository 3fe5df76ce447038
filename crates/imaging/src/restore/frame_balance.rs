//! Forces of local cosines that balance nearly.

use super::Field;
use super::balance::{CUT, nth_largest};
use crate::{LocalCosines, Pointwise, Shrinkage, Stencil};
use proxel_split::{Problem, vector};
use rayon::prelude::*;

/// Steps of conjugate gradients.
const STEPS: usize = 6;

/// A lower bound of the objective over images with values in the range, as in [`super::balance::lower_bound`], with local
/// cosines W and their weights in the place of differences:
///
/// ```text
/// (W^T T W + K^T M K) psi = r,    q - T W psi,   q_y - M K psi
/// ```
///
/// T leaves out the mean and what does not count. W^T W is the identity, and where the mean is missing the blur lets through what is
/// missing with it, so that the sum is near the identity but for what was not seen: no preconditioner is needed.
///
/// `q` and `q_y` are the forces on W x and on y = K x, `r` is W^T q + K^T q_y. None where a term does not know its conjugate.
pub(super) fn lower_bound(
    problem: &Problem,
    (mut q, mut q_y): (Vec<f64>, Vec<f64>),
    r: &[f64],
    field: &Field,
    shrinkage: &Shrinkage,
    [low, high]: [f64; 2],
) -> Option<f64> {
    let (grid, frame) = (field.grid, LocalCosines::default());
    let local = frame.local_row(grid);
    let row = |row: usize| row * grid.width..(row + 1) * grid.width;
    let psi = potential(field, shrinkage, &frame, r);
    q.par_chunks_mut(local).enumerate().for_each_init(
        || vec![0.0; local],
        |w, (i, q)| {
            frame.row(grid, &psi, i, w);
            shrinkage.clear_others(&row(i), w);
            q.iter_mut().zip(&*w).for_each(|(q, w)| *q -= w);
        },
    );
    let mut e = vec![0.0; grid.len()];
    field.blur.apply(grid, false, &psi, &mut e);
    vector::add_scaled(&mut q_y, -1.0, &e);
    clear_unmeasured(field, &mut q_y);
    // K^T q_y, in the place of e.
    field.blur.apply(grid, true, &q_y, &mut e);
    let gauge = if field.held.is_some() { 0.0 } else { problem.terms.get(1)?.gauge(&q_y)? };
    let mut sizes = vec![0.0; grid.n_pixels()];
    let rows = sizes.par_chunks_mut(grid.width).zip(q.par_chunks(local)).enumerate();
    rows.for_each(|(i, (sizes, q))| shrinkage.largest(&row(i), q, sizes));
    let mut best: Option<f64> = None;
    let (mut cut, mut left, mut scaled) = (vec![0.0; q.len()], vec![0.0; grid.len()], vec![0.0; q_y.len()]);
    for part in CUT {
        let surpassed = (part * sizes.len() as f64) as usize;
        let largest = if sizes.is_empty() { 0.0 } else { *nth_largest(&mut sizes, surpassed) };
        let scale = 1.0 / largest.max(gauge).max(1.0);
        if !scale.is_normal() {
            return best;
        }
        // The nearest forces that its conjugate allows: v - prox(v), by Moreau's identity.
        cut.par_chunks_mut(local).zip(q.par_chunks(local)).enumerate().for_each(|(i, (cut, q))| {
            cut.iter_mut().zip(q).for_each(|(cut, q)| *cut = scale * q);
            shrinkage.prox(row(i), cut, 1.0);
            cut.iter_mut().zip(q).for_each(|(cut, q)| *cut = scale * q - *cut);
        });
        left.iter_mut().zip(&e).for_each(|(left, e)| *left = scale * e);
        frame.add_adjoint(grid, 1.0, &cut, &mut left);
        scaled.iter_mut().zip(&q_y).for_each(|(s, q)| *s = scale * q);
        let conjugate = match &field.held {
            // lambda |y - f|^2
            Some(data) => vector::dot(&scaled, data.observed()) + vector::dot(&scaled, &scaled) / (4.0 * data.lambda()),
            None => problem.terms.get(1)?.conjugate(&scaled)?,
        };
        let bound = left.iter().map(|r| (r * low).min(r * high)).sum::<f64>() - conjugate;
        if bound.is_finite() {
            best = Some(best.map_or(bound, |best| best.max(bound)));
        }
    }
    best
}

/// 0 where nothing was measured; where the global step holds the data all was.
fn clear_unmeasured(field: &Field, of_y: &mut [f64]) {
    of_y.iter_mut().zip(field.measured.iter()).filter(|(_, measured)| !**measured).for_each(|(v, _)| *v = 0.0);
}

/// psi after some steps of conjugate gradients from 0.
fn potential(field: &Field, shrinkage: &Shrinkage, frame: &LocalCosines, r: &[f64]) -> Vec<f64> {
    let (grid, n) = (field.grid, r.len());
    let local = frame.local_row(grid);
    let (mut w, mut e) = (vec![0.0; local * grid.height], vec![0.0; n]);
    let mut apply = |of: &[f64], out: &mut [f64]| {
        field.blur.apply(grid, false, of, &mut e);
        clear_unmeasured(field, &mut e);
        field.blur.apply(grid, true, &e, out);
        w.par_chunks_mut(local).enumerate().for_each(|(i, w)| {
            frame.row(grid, of, i, w);
            shrinkage.clear_others(&(i * grid.width..(i + 1) * grid.width), w);
        });
        frame.add_adjoint(grid, 1.0, &w, out);
    };
    let (mut psi, mut residual) = (vec![0.0; n], r.to_vec());
    let (mut direction, mut image) = (r.to_vec(), vec![0.0; n]);
    let mut square = vector::dot(&residual, &residual);
    for _ in 0..STEPS {
        apply(&direction, &mut image);
        let curvature = vector::dot(&direction, &image);
        // Nothing is left, or what is left is rounding.
        if !(curvature > 0.0 && square > 0.0) {
            break;
        }
        let step = square / curvature;
        vector::add_scaled(&mut psi, step, &direction);
        vector::add_scaled(&mut residual, -step, &image);
        let before = std::mem::replace(&mut square, vector::dot(&residual, &residual));
        direction.par_iter_mut().zip(&residual).for_each(|(d, r)| *d = r + square / before * *d);
    }
    psi
}
