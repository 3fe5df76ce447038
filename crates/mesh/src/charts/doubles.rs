//! Edges that join the same two vertices of the surface twice.
//!
//! Faces know their vertices only, so that two edges between the same two vertices are one edge to whoever reads the
//! chart, and a straight one in the map. They come from non-manifold edges, and from polygons whose diagonal is an
//! edge or a diagonal elsewhere (two quads that share two edges in a row). All but the first are freed by taking the
//! faces along them out of their surroundings: an isolated face shares no vertex.

use super::edges::Edges;
use super::glue::Oriented;
use super::half_edges::{NONE, sorted};

/// An edge or diagonal: its ends on the surface, what it is, the cells along it.
struct Line {
    ends: [u32; 2],
    key: u32,
    cells: [u32; 2],
}

/// The mesh faces to isolate, ascending. `branching` are the mesh edges of three faces or more, ascending.
pub(super) fn doubled_faces(surface: &Oriented, fan: &[u32], edges: &Edges, branching: &[[u32; 2]]) -> Vec<u32> {
    let h = &surface.half_edges;
    let mut diagonals: Vec<([u32; 2], u32, u32)> = Vec::new(); // mesh vertices, first half-edge of the cell, other end
    for c in 0..h.n_cells() {
        let side = h.side(c);
        for k in side.start + 2..side.end.saturating_sub(1).max(side.start + 2) {
            diagonals.push((sorted(h.vertex[side.start], h.vertex[k]), side.start as u32, k as u32));
        }
    }
    if diagonals.is_empty() && branching.is_empty() {
        return Vec::new();
    }
    diagonals.sort_unstable();
    let mut doubtful: Vec<[u32; 2]> = branching.to_vec();
    doubtful.extend(
        diagonals
            .chunk_by(|a, b| a.0 == b.0)
            .filter(|g| g.len() > 1 || edges.sides(g[0].0[0], g[0].0[1]).next().is_some())
            .map(|g| g[0].0),
    );
    doubtful.sort_unstable();
    doubtful.dedup();

    let mut lines = Vec::new();
    for (_, from, to) in diagonals.into_iter().filter(|d| doubtful.binary_search(&d.0).is_ok()) {
        let cell = h.cell[from as usize];
        lines.push(Line { ends: sorted(fan[from as usize], fan[to as usize]), key: to, cells: [cell; 2] });
    }
    for g in 0..h.len() as u32 {
        let next = h.next(g);
        let m = h.mate[g as usize];
        let once = m == NONE || g < m;
        if once && doubtful.binary_search(&sorted(h.vertex[g as usize], h.vertex[next as usize])).is_ok() {
            let cell = h.cell[g as usize];
            let other = if m == NONE { cell } else { h.cell[m as usize] };
            lines.push(Line { ends: sorted(fan[g as usize], fan[next as usize]), key: g, cells: [cell, other] });
        }
    }
    lines.sort_unstable_by_key(|l| (l.ends, l.key));
    let mut faces: Vec<u32> = lines
        .chunk_by(|a, b| a.ends == b.ends)
        .flat_map(|same| &same[1..])
        .flat_map(|l| l.cells)
        .map(|c| surface.face[c as usize])
        .collect();
    faces.sort_unstable();
    faces.dedup();
    faces
}
