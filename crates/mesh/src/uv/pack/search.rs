//! The largest common scale at which all charts find a place.

use rayon::prelude::*;

use super::Placement;
use super::chart::Prepared;
use super::hull::{P2, turn};
use super::page::Page;
use super::raster::masks;

/// What is kept free, in units of the page.
pub(super) struct Room {
    /// Between charts and the sides of the page.
    pub border: f64,
    /// Between charts.
    pub padding: f64,
}

/// Some chart found no place.
pub(super) struct Full;

/// Scales that are tried at once; so many that the work does not depend on the number of threads.
const AT_ONCE: usize = 4;
/// Rounds after the scale is known to a step; each divides what is open by AT_ONCE + 1.
const ROUNDS: usize = 3;
/// Between the scales of the first round that looks for the order of magnitude, and of later ones.
const STEP: f64 = 0.8;
const FAR_STEP: f64 = 0.4;
/// Below this part of the largest conceivable scale, padding takes all the room.
const SMALLEST: f64 = 1e-4;

/// Cells along each side of the page: enough that what a chart loses to cells that it covers in part is a few
/// percent. Positions are multiples of a cell; it has nothing to do with pixels.
fn cells(charts: usize) -> usize {
    match charts {
        0..=100 => 1024,
        101..=2000 => 2048,
        _ => 4096,
    }
}

/// Puts charts on the page, at the given common scale or at the largest one found.
pub(super) fn fit(charts: &[Prepared], room: &Room, scale: Option<f64>) -> Result<Vec<Placement>, Full> {
    let usable = 1.0 - 2.0 * room.border;
    let side = charts.iter().map(Prepared::side).fold(0.0, f64::max);
    let area: f64 = charts.iter().map(|c| c.area).sum();
    let order = order(charts);
    let run = |scale: f64| lay_out(charts, &order, room, scale);
    if let Some(scale) = scale {
        return if side * scale <= usable { run(scale).ok_or(Full) } else { Err(Full) };
    }
    if side == 0.0 {
        return run(1.0).ok_or(Full); // points only
    }
    let most = usable / side;
    if let [chart] = charts {
        return Ok(vec![alone(chart, most)]);
    }
    // From what no packing can beat, were there no overlaps within charts, downward (or upward, where there are).
    let start = most.min(usable / area.sqrt());
    let mut best: Option<(f64, Vec<Placement>)> = None;
    let (mut top, mut step) = (start, STEP);
    let mut failed = f64::INFINITY;
    while best.is_none() && top > SMALLEST * start {
        let scales: Vec<f64> = (0..AT_ONCE as i32).map(|i| top * step.powi(i)).collect();
        (best, failed) = largest(&scales, failed, &run);
        top *= step.powi(AT_ONCE as i32);
        step = FAR_STEP;
    }
    let (mut scale, mut placements) = best.ok_or(Full)?;
    while failed == f64::INFINITY && scale < most {
        let scales: Vec<f64> = (1..=AT_ONCE as i32).map(|i| (scale * STEP.powi(-i)).min(most)).collect();
        let (better, f) = largest(&scales, failed, &run);
        failed = f;
        match better {
            Some(better) => (scale, placements) = better,
            None => break,
        }
    }
    for _ in 0..ROUNDS {
        if failed == f64::INFINITY {
            break;
        }
        let part = |i: usize| scale + (failed - scale) * i as f64 / (AT_ONCE + 1) as f64;
        let scales: Vec<f64> = (1..=AT_ONCE).map(part).collect();
        let (better, f) = largest(&scales, failed, &run);
        failed = f;
        if let Some(better) = better {
            (scale, placements) = better;
        }
    }
    Ok(placements)
}

type Found = Option<(f64, Vec<Placement>)>;

/// The largest of some scales that works, and the smallest above it known to fail (of these, or `failed`).
fn largest(scales: &[f64], failed: f64, run: &(impl Fn(f64) -> Option<Vec<Placement>> + Sync)) -> (Found, f64) {
    let results: Vec<Found> = scales.par_iter().map(|&s| run(s).map(|p| (s, p))).collect();
    let best = results.into_iter().flatten().max_by(|a, b| a.0.total_cmp(&b.0));
    let floor = best.as_ref().map_or(0.0, |b| b.0);
    let failed = scales.iter().copied().filter(|&s| s > floor).fold(failed, f64::min);
    (best, failed)
}

/// The longest chart first: what is long finds no place later.
fn order(charts: &[Prepared]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..charts.len()).collect();
    order.sort_by(|&i, &j| {
        let key = |c: &Prepared| (c.side(), c.area);
        let (a, b) = (key(&charts[i]), key(&charts[j]));
        b.0.total_cmp(&a.0).then(b.1.total_cmp(&a.1)).then(i.cmp(&j))
    });
    order
}

/// Each chart in order goes where its top is the lowest. `None` if one finds no place.
fn lay_out(charts: &[Prepared], order: &[usize], room: &Room, scale: f64) -> Option<Vec<Placement>> {
    let side = cells(charts.len());
    let cell = (1.0 - 2.0 * room.border) / side as f64;
    let (per_unit, radius) = (scale / cell, room.padding / cell);
    let margin = radius.ceil() as usize + 1;
    let longest = charts.iter().map(Prepared::side).fold(0.0, f64::max) * per_unit;
    let mut page = Page::new(side, margin, (longest as usize).min(side) + 2 + 2 * margin);
    let mut out = vec![None; charts.len()];
    for group in order.chunks(64) {
        let made: Vec<_> = group
            .par_iter()
            .map(|&i| {
                let fits = charts[i].side() * per_unit <= side as f64;
                fits.then(|| masks(&charts[i], per_unit, radius, margin, charts[i].rotate))
            })
            .collect();
        for (&i, masks) in group.iter().zip(made) {
            let masks = masks?;
            let mut best: Option<(usize, [usize; 2])> = None;
            let mut below = usize::MAX;
            for (k, mask) in masks.iter().enumerate() {
                if let Some(place) = page.find(mask, below) {
                    below = place[1] + mask.height;
                    best = Some((k, place));
                }
            }
            let (k, place) = best?;
            page.put(&masks[k].solid, place);
            let size = [masks[0].width as f64, masks[0].height as f64];
            // The corner of the box, in cells, from which the turned chart begins.
            let from = [[0.0, 0.0], [size[1], 0.0], size, [0.0, size[0]]][k];
            let corner = [0, 1].map(|c| room.border + cell * (place[c] as f64 + from[c]));
            out[i] = Some(placement(&charts[i], scale, QUARTERS[k], corner));
        }
    }
    out.into_iter().collect()
}

const QUARTERS: [P2; 4] = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];

/// A single chart in the middle of the page.
fn alone(chart: &Prepared, scale: f64) -> Placement {
    placement(chart, scale, QUARTERS[0], chart.size.map(|s| 0.5 - 0.5 * scale * s))
}

/// The map of a chart whose upright box is turned by `quarter` about its lower left corner, which goes to `corner`.
fn placement(chart: &Prepared, scale: f64, quarter: P2, corner: P2) -> Placement {
    // p' = scale quarter (turned (p - middle) - chart.corner) + corner
    let rotation = turn(quarter, chart.turned);
    let (m, low) = (turn(rotation, chart.middle), turn(quarter, chart.corner));
    Placement { scale, rotation, offset: [0, 1].map(|c| corner[c] - scale * (m[c] + low[c])) }
}
