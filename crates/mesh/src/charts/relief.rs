//! Cuts that let a chart relax where its map is stretched.

use super::Chart;
use super::geometry::{Metric, cosine};
use super::graph::{Graph, Growth};
use super::half_edges::{NONE, sorted};
use super::split::{Cells, cells, in_range};
use crate::error::Result;
use crate::mesh::Mesh;
use crate::vec3::sub;

/// A vertex whose angles differ from a full turn by more than this (30 degrees) is a cone: what a map stretches there
/// is relieved by a cut to the vertex itself and by no other.
const CONE: f64 = std::f64::consts::PI / 6.0;
/// Ends that are tried for a cut in two, at equal distances along the boundary.
const ENDS: usize = 24;
/// What an edge at a vertex that a path should not touch costs more: longer than any path.
const DETOUR: u64 = 1 << 40;

/// The edges (local vertices, smaller first, ascending) of a short cut from the boundary into a region of a chart: to
/// its sharpest cone inside the chart, or where it has none to its deepest vertex. Empty where all of the region lies
/// on the boundary.
///
/// # Errors
/// A chart that is none or not of this mesh; a vertex out of range.
pub fn relief_cut(mesh: &Mesh, chart: &Chart, region: &[u32]) -> Result<Vec<[u32; 2]>> {
    let Cells { surface, .. } = cells(mesh, chart)?;
    in_range(mesh, chart, region)?;
    let points: Vec<_> = chart.vertices.iter().map(|&v| mesh.points[v as usize]).collect();
    let metric = Metric::new(&points, 0..points.len() as u32);
    let graph = Graph::new(&surface, &surface.vertex, points.len(), &metric);
    let mut growth = Growth::new(graph.n);
    chart.loops.iter().flatten().for_each(|&v| growth.seed(v));
    growth.run(&graph, &graph.cost);
    let depth = |v: u32| growth.distance[v as usize];
    let inside = || region.iter().copied().filter(|&v| depth(v) > 0 && depth(v) < u64::MAX);
    let defect = defects(chart, &metric);
    let sharpest = inside().max_by(|&a, &b| defect[a as usize].total_cmp(&defect[b as usize]).then(b.cmp(&a)));
    let target = match sharpest {
        Some(v) if defect[v as usize] > CONE => Some(v),
        _ => inside().max_by_key(|&v| (depth(v), std::cmp::Reverse(v))),
    };
    let Some(target) = target else { return Ok(Vec::new()) };
    let mut cut: Vec<_> = growth.path(&graph, target).map(|e| graph.ends[e as usize]).collect();
    cut.iter_mut().for_each(|[a, b]| [*a, *b] = sorted(*a, *b));
    cut.sort_unstable();
    Ok(cut)
}

/// The edges (local vertices, smaller first, ascending) of a cut through a vertex that parts a chart in two, with the
/// least length over the area of the smaller part among those to some ends along the boundary. Empty where none parts
/// it: in a chart of a few triangles.
///
/// # Errors
/// A chart that is none or not of this mesh; a vertex out of range.
pub fn halving_cut(mesh: &Mesh, chart: &Chart, through: u32) -> Result<Vec<[u32; 2]>> {
    let Cells { surface, .. } = cells(mesh, chart)?;
    in_range(mesh, chart, &[through])?;
    let points: Vec<_> = chart.vertices.iter().map(|&v| mesh.points[v as usize]).collect();
    let metric = Metric::new(&points, 0..points.len() as u32);
    let graph = Graph::new(&surface, &surface.vertex, points.len(), &metric);
    // Both arms of the cut keep off the boundary until they end there, and the second keeps off the first.
    let mut avoided = vec![false; graph.n];
    chart.loops.iter().flatten().for_each(|&v| avoided[v as usize] = true);
    let mut first = Growth::new(graph.n);
    chart.loops.iter().flatten().for_each(|&v| first.seed(v));
    first.run_until(&graph, &graph.cost, |v| v == through);
    let arm: Vec<u32> = first.path(&graph, through).collect();
    arm.iter().flat_map(|&e| graph.ends[e as usize]).for_each(|v| avoided[v as usize] = true);
    let landing = arm.last().map_or(through, |&e| {
        let [a, b] = graph.ends[e as usize];
        if first.distance[a as usize] == 0 { a } else { b }
    });
    let Some(rim) = chart.loops.iter().find(|l| l.contains(&landing)) else { return Ok(Vec::new()) };
    let avoids = |v: u32| v != through && avoided[v as usize];
    let detour = |ends: &[u32; 2]| DETOUR * ends.iter().filter(|&&v| avoids(v)).count() as u64;
    let weight: Vec<u64> = graph.ends.iter().zip(&graph.cost).map(|(ends, c)| c.saturating_add(detour(ends))).collect();
    let mut second = Growth::new(graph.n);
    second.seed(through);
    second.run(&graph, &weight);

    let area: Vec<f64> = (0..surface.n_cells())
        .map(|c| {
            let side = surface.side(c);
            (side.start + 2..side.end).map(|k| metric.area([side.start, k - 1, k].map(|h| surface.vertex[h]))).sum()
        })
        .collect();
    let mut best: Option<(f64, Vec<u32>)> = None;
    let ends = ENDS.min(rim.len());
    for end in (0..ends).map(|i| rim[i * rim.len() / ends]).filter(|&v| v != landing && v != through) {
        let cut: Vec<u32> = arm.iter().copied().chain(second.path(&graph, end)).collect();
        let length: u64 = cut.iter().map(|&e| graph.cost[e as usize]).sum();
        let lesser = lesser_area(&surface, &graph, &cut, &area);
        let score = length as f64 / lesser;
        if lesser > 0.0 && best.as_ref().is_none_or(|b| score < b.0) {
            best = Some((score, cut));
        }
    }
    let mut cut: Vec<_> = best.map_or_else(Vec::new, |b| b.1).iter().map(|&e| graph.ends[e as usize]).collect();
    cut.iter_mut().for_each(|[a, b]| [*a, *b] = sorted(*a, *b));
    cut.sort_unstable();
    cut.dedup();
    Ok(cut)
}

/// |2 pi - sum of angles| of each vertex; of those on the boundary it means nothing.
fn defects(chart: &Chart, metric: &Metric<'_>) -> Vec<f64> {
    let mut turn = vec![std::f64::consts::TAU; chart.vertices.len()];
    for t in &chart.triangles {
        for k in 0..3 {
            let [a, b, c] = [0, 1, 2].map(|i| metric.at(t[(k + i) % 3]));
            turn[t[k] as usize] -= cosine(sub(b, a), sub(c, a)).acos();
        }
    }
    turn.iter_mut().for_each(|t| *t = t.abs());
    turn
}

/// The area that a cut parts from the largest part; 0 where it parts nothing.
fn lesser_area(surface: &super::half_edges::HalfEdges, graph: &Graph, cut: &[u32], area: &[f64]) -> f64 {
    let mut open: Vec<u32> = cut.iter().map(|&e| graph.half_edge[e as usize]).collect();
    open.sort_unstable();
    let mut seen = vec![false; surface.n_cells()];
    let (mut largest, mut total) = (0.0f64, 0.0);
    let mut queue = Vec::new();
    for first in 0..surface.n_cells() {
        if std::mem::replace(&mut seen[first], true) {
            continue;
        }
        queue.push(first);
        let mut part = 0.0;
        while let Some(c) = queue.pop() {
            part += area[c];
            for h in surface.side(c) {
                let m = surface.mate[h];
                if m == NONE || open.binary_search(&m.min(h as u32)).is_ok() {
                    continue;
                }
                let d = surface.cell[m as usize] as usize;
                if !std::mem::replace(&mut seen[d], true) {
                    queue.push(d);
                }
            }
        }
        total += part;
        largest = largest.max(part);
    }
    total - largest
}
