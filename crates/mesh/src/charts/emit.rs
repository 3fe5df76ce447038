//! From a surface that is cut to charts.

use super::geometry::Metric;
use super::half_edges::{HalfEdges, NONE, by_group};
use super::{Chart, Place};

/// The charts of a surface, numbered by their first faces, and the place of each half-edge's start.
/// `face` is the mesh face of each cell; `flipped(cell)` says whether it is listed the other way round there.
pub(super) fn charts(
    surface: &HalfEdges,
    face: &[u32],
    flipped: impl Fn(u32) -> bool,
    metric: &Metric<'_>,
) -> (Vec<Chart>, Vec<Place>) {
    let (fan, n_fans) = surface.fans();
    let (chart, n_charts) = surface.components();
    // Local vertices: by mesh vertex, then by fan, in each chart.
    let mut fans: Vec<(u32, u32, u32)> = Vec::with_capacity(n_fans); // chart, mesh vertex, fan
    for h in 0..surface.len() {
        if fan[h] as usize == fans.len() {
            fans.push((chart[surface.cell[h] as usize], surface.vertex[h], fan[h]));
        }
    }
    fans.sort_unstable();
    let mut charts: Vec<Chart> = (0..n_charts).map(|_| Chart::default()).collect();
    let mut local = vec![0u32; n_fans];
    for &(c, v, f) in &fans {
        let vertices = &mut charts[c as usize].vertices;
        local[f as usize] = vertices.len() as u32;
        vertices.push(v);
    }
    drop(fans);
    let cells = by_group(&chart, n_charts);
    for (c, out) in charts.iter_mut().enumerate() {
        for &cell in cells.row(c) {
            let side = surface.side(cell as usize);
            let at = |k: usize| local[fan[side.start + k] as usize];
            let n = side.len();
            for k in 2..n {
                // The k-th triangle of the fan as it is listed: reversed cells run through their corners backwards.
                let k = if flipped(cell) { n + 1 - k } else { k };
                out.triangles.push([at(0), at(k - 1), at(k)]);
                out.faces.push(face[cell as usize]);
            }
        }
    }
    let loops = surface.boundary_loops();
    for i in 0..loops.len() {
        let row = loops.row(i);
        let c = chart[surface.cell[row[0] as usize] as usize] as usize;
        let mut vertices: Vec<u32> = row.iter().map(|&h| local[fan[h as usize] as usize]).collect();
        let first = (0..vertices.len()).min_by_key(|&k| vertices[k]).unwrap_or(0);
        vertices.rotate_left(first);
        charts[c].loops.push(vertices);
    }
    for chart in &mut charts {
        sort_loops(chart, metric);
    }
    let places = (0..surface.len())
        .map(|h| Place { chart: chart[surface.cell[h] as usize], vertex: local[fan[h] as usize] })
        .collect();
    debug_assert!(surface.mate.iter().all(|&m| m == NONE || (m as usize) < surface.len()));
    (charts, places)
}

/// The longest loop first; of equally long ones that of the smallest vertex.
fn sort_loops(chart: &mut Chart, metric: &Metric<'_>) {
    if chart.loops.len() < 2 {
        return;
    }
    let length = |l: &[u32]| -> f64 {
        let at = |k: usize| chart.vertices[l[k % l.len()] as usize];
        (0..l.len()).map(|k| metric.length(at(k), at(k + 1))).sum()
    };
    let mut loops: Vec<(f64, Vec<u32>)> = chart.loops.iter().map(|l| (length(l), l.clone())).collect();
    loops.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.first().cmp(&b.1.first())));
    chart.loops = loops.into_iter().map(|l| l.1).collect();
}
