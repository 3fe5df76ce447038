//! A bound on stretch: charts whose maps pass it are cut further.
//!
//! A slit from the boundary into the stretched region lets a map relax and costs the shortest seam, so it is tried
//! first and kept where it takes away half of the excess. Elsewhere the chart is parted in two through the worst
//! place: each half has about half of the curvature. Maps of the parts begin with that of the whole.

use super::chart::{ChartInput, ChartMap};
use super::flat::{Flat, jacobian};
use super::metric;
use super::pins::pinned;
use super::{Hooks, SMALL, UnwrapError, UnwrapInput};
use crate::settings::UnwrapSettings;
use proxel_mesh::charts::{Chart, Charts, Part, halving_cut, relief_cut, split};
use rayon::prelude::*;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Cuts of one chart of the mesh, those of its parts included.
const MOST_CUTS: usize = 64;
/// No part has fewer triangles: a surface is not splintered, whatever the bound.
const LEAST_TRIANGLES: usize = 8;
/// What a slit may leave of the excess to be worth its length.
const GAIN: f64 = 0.5;

/// What came of the bound.
#[derive(Default)]
pub(super) struct Bounded {
    pub cuts: usize,
    pub warnings: Vec<String>,
}

/// Cuts the charts whose maps pass `bound` and solves again, until no triangle does or no cut is left. Charts with pins
/// stay whole.
pub(super) fn bound(
    bound: f64,
    input: &UnwrapInput,
    charts: &mut Charts,
    maps: &mut Vec<ChartMap>,
    settings: &UnwrapSettings,
    hooks: &mut Hooks<'_>,
    began: Instant,
) -> Result<Bounded, UnwrapError> {
    let job = Job { bound, input, settings, began };
    let pinned = pinned(input, charts);
    let mut out = Bounded::default();
    let mut over = Vec::new();
    for (c, (chart, map)) in charts.charts.iter().zip(maps.iter()).enumerate() {
        let worst = job.strain(chart, map).worst;
        if worst > bound && pinned[c] {
            out.warnings.push(format!("{}; it has pins, and was not cut", job.too_much(c, chart, worst)));
        } else if worst > bound {
            over.push(c);
        }
    }
    let is_small = |c: usize| charts.charts[c].triangles.len() < SMALL && over.len() > 1;
    let (traced, cancel) = (hooks.traced, hooks.cancel.clone());
    let mut results: Vec<Option<Result<Cut, UnwrapError>>> = over.iter().map(|_| None).collect();
    for (result, &c) in results.iter_mut().zip(&over).filter(|(_, c)| !is_small(**c)) {
        *result = Some(job.cut(&charts.charts[c], &maps[c], hooks));
    }
    results.par_iter_mut().zip(&over).filter(|(_, c)| is_small(**c)).for_each(|(result, &c)| {
        let mut hooks = Hooks { progress: None, traced, cancel: cancel.clone() };
        *result = Some(job.cut(&charts.charts[c], &maps[c], &mut hooks));
    });
    let (mut parts, mut new_maps) = (Vec::new(), Vec::new());
    for (c, result) in over.into_iter().zip(results.into_iter().flatten()) {
        let cut = result?;
        out.cuts += cut.cuts;
        let (of, maps_of): (Vec<Chart>, Vec<ChartMap>) = cut.pieces.into_iter().map(|p| (p.chart, p.map)).unzip();
        parts.push((c, of));
        new_maps.push(maps_of);
    }
    if parts.is_empty() {
        return Ok(out);
    }
    let numbers = charts.replace(&input.mesh, parts)?;
    for (numbers, of) in numbers.iter().zip(new_maps) {
        for (&c, map) in numbers.iter().zip(of) {
            let worst = job.strain(&charts.charts[c], &map).worst;
            if worst > bound {
                out.warnings.push(format!(
                    "{}; allow more, or refine the mesh there",
                    job.too_much(c, &charts.charts[c], worst)
                ));
            }
            // Parts after the first follow the last chart in this order.
            match maps.get_mut(c) {
                Some(to) => *to = map,
                None => maps.push(map),
            }
        }
    }
    Ok(out)
}

struct Job<'a> {
    bound: f64,
    input: &'a UnwrapInput,
    settings: &'a UnwrapSettings,
    began: Instant,
}

/// What a chart became.
struct Cut {
    pieces: Vec<Piece>,
    cuts: usize,
}

struct Piece {
    chart: Chart,
    map: ChartMap,
    strain: Strain,
}

/// How a map passes the bound.
#[derive(Default)]
struct Strain {
    worst: f64,       // largest max(s1, 1 / s2); infinite where a triangle is flipped
    excess: f64,      // sum of area * ln(stretch / bound), capped, over triangles that pass it
    region: Vec<u32>, // their vertices, ascending
    center: u32,      // a vertex of the worst
}

/// The logarithm that a flipped triangle counts with.
const FLIPPED: f64 = 20.0;

impl Job<'_> {
    fn cut(&self, chart: &Chart, map: &ChartMap, hooks: &mut Hooks<'_>) -> Result<Cut, UnwrapError> {
        let strain = self.strain(chart, map);
        let mut open = vec![Piece { chart: chart.clone(), map: map.clone(), strain }];
        let mut out = Cut { pieces: Vec::new(), cuts: 0 };
        // The worst first, so that the cuts are spent where they are needed most.
        while let Some(i) = (0..open.len()).max_by(|&a, &b| open[a].strain.worst.total_cmp(&open[b].strain.worst)) {
            let piece = open.swap_remove(i);
            if piece.strain.worst <= self.bound || out.cuts == MOST_CUTS || self.is_over(hooks) {
                out.pieces.push(piece);
                continue;
            }
            match self.relieve(&piece, hooks)? {
                Some(parts) => {
                    out.cuts += 1;
                    open.extend(parts);
                }
                None => out.pieces.push(piece),
            }
        }
        // The order in which a split lists them.
        out.pieces.sort_by_key(|p| p.chart.faces.first().copied());
        Ok(out)
    }

    fn is_over(&self, hooks: &Hooks<'_>) -> bool {
        let late = self.settings.time_limit.is_some_and(|limit| self.began.elapsed().as_secs_f64() > limit);
        late || hooks.cancel.load(Ordering::Relaxed)
    }

    /// The parts after the next cut; none where no cut is left.
    fn relieve(&self, piece: &Piece, hooks: &mut Hooks<'_>) -> Result<Option<Vec<Piece>>, UnwrapError> {
        let mesh = &self.input.mesh;
        let slit = relief_cut(mesh, &piece.chart, &piece.strain.region)?;
        if !slit.is_empty() {
            let parts = split(mesh, &piece.chart, &slit)?;
            // A single edge may open nothing.
            let opens = parts.iter().map(|p| p.parent.len()).sum::<usize>() > piece.chart.vertices.len();
            if opens && is_whole(&parts) {
                let parts = self.solve(piece, parts, hooks)?;
                let excess: f64 = parts.iter().map(|p| p.strain.excess).sum();
                if excess <= GAIN * piece.strain.excess {
                    return Ok(Some(parts));
                }
            }
        }
        let cut = halving_cut(mesh, &piece.chart, piece.strain.center)?;
        if cut.is_empty() {
            return Ok(None);
        }
        let parts = split(mesh, &piece.chart, &cut)?;
        if parts.len() < 2 || !is_whole(&parts) {
            return Ok(None);
        }
        self.solve(piece, parts, hooks).map(Some)
    }

    fn solve(&self, piece: &Piece, parts: Vec<Part>, hooks: &mut Hooks<'_>) -> Result<Vec<Piece>, UnwrapError> {
        let mesh = &self.input.mesh;
        let solve = |Part { chart, parent }: Part| {
            let input = ChartInput {
                chart: &chart,
                points: chart.vertices.iter().map(|&v| mesh.points[v as usize]).collect(),
                start: Some(parent.iter().map(|&v| piece.map.uv[v as usize]).collect()),
                pins: Vec::new(),
                weights: self.input.weights.as_ref().map(|w| chart.faces.iter().map(|&f| w[f as usize]).collect()),
                metric: metric::of_faces(self.input, &chart.faces),
            };
            let map = super::solve(&input, self.settings, hooks, self.began)?;
            let strain = self.strain(&chart, &map);
            Ok::<_, UnwrapError>(Piece { chart, map, strain })
        };
        parts.into_iter().map(solve).collect()
    }

    /// Measures the map of a chart at the scale that it has, over the triangles with an area.
    fn strain(&self, chart: &Chart, map: &ChartMap) -> Strain {
        let points: Vec<_> = chart.vertices.iter().map(|&v| self.input.mesh.points[v as usize]).collect();
        let metric = metric::of_faces(self.input, &chart.faces);
        let flat = Flat::stretched(&points, &chart.triangles, &chart.loops, metric.as_deref());
        let Some(flat) = flat else { return Strain::default() };
        let mut out = Strain::default();
        for t in (0..chart.triangles.len()).filter(|&t| flat.counts(t)) {
            let of = chart.triangles[t];
            let (stretch, area) = stretch(flat.shapes[t], of.map(|v| map.uv[v as usize].map(|x| x * flat.scale)));
            if stretch > out.worst {
                (out.worst, out.center) = (stretch, of[0]);
            }
            if stretch > self.bound {
                out.excess += area * (stretch / self.bound).ln().min(FLIPPED);
                out.region.extend(of);
            }
        }
        out.region.sort_unstable();
        out.region.dedup();
        out
    }

    fn too_much(&self, c: usize, chart: &Chart, worst: f64) -> String {
        let face = chart.faces.first().copied().unwrap_or(0);
        format!(
            "{}: chart {c} (with face {face}, 0-based) has triangles stretched {worst:.3} times, more than {}",
            self.input.mesh.name, self.bound
        )
    }
}

/// Whether no part is a splinter.
fn is_whole(parts: &[Part]) -> bool {
    parts.iter().all(|p| p.chart.triangles.len() >= LEAST_TRIANGLES) || parts.len() == 1
}

/// max(s1, 1 / s2) of the map from a triangle with these edges (as columns) to these corners, and its rest area.
/// Infinite where it is flipped.
fn stretch(shape: [[f64; 2]; 2], corners: [[f64; 2]; 3]) -> (f64, f64) {
    let [first, second] = jacobian(shape, corners);
    let det = first[0] * second[1] - first[1] * second[0];
    let s1 =
        0.5 * ((first[0] + second[1]).hypot(first[1] - second[0]) + (first[0] - second[1]).hypot(first[1] + second[0]));
    let stretch = if det > 0.0 { s1.max(s1 / det) } else { f64::INFINITY };
    (stretch, 0.5 * shape[0][0] * shape[1][1])
}
