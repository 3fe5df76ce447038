//! Whether triangles are a chart: a connected, oriented manifold of genus 0 with a boundary.

use super::Chart;
use super::half_edges::{HalfEdges, NONE, sorted};
use crate::mesh::Mesh;

impl Chart {
    /// What keeps this from being a chart, `None` if it is one. It looks at the triangles and loops alone and uses no
    /// coordinates: every edge has one triangle or two of opposite directions, the triangles around each vertex form
    /// one fan, all hang together over edges, V - E + F = 2 - (number of loops), and `loops` are the boundary.
    pub fn defect(&self) -> Option<String> {
        let n = self.vertices.len();
        if self.faces.len() != self.triangles.len() {
            return Some(format!("it has {} triangles and {} faces", self.triangles.len(), self.faces.len()));
        }
        let surface = match glue_triangles(n, &self.triangles) {
            Ok(surface) => surface,
            Err(defect) => return Some(defect),
        };
        let found = match disk_with_holes(&surface, n) {
            Ok(loops) => loops,
            Err(defect) => return Some(defect),
        };
        let mut next = vec![NONE; n];
        found
            .iter()
            .for_each(|&h| next[surface.vertex[h as usize] as usize] = surface.vertex[surface.next(h) as usize]);
        let mut listed = 0;
        for l in &self.loops {
            for k in 0..l.len() {
                if next.get(l[k] as usize) != Some(&l[(k + 1) % l.len()]) {
                    return Some(format!("the loops leave the boundary at vertex {}", l[k]));
                }
            }
            listed += l.len();
        }
        (listed != found.len()).then(|| format!("its loops have {listed} vertices, its boundary {}", found.len()))
    }

    /// Whether it is a disk: a single loop bounds it.
    pub fn is_disk(&self) -> bool {
        self.loops.len() == 1
    }
}

/// What keeps a mesh from being a disk as it stands, `None` if it is one: all faces, fans around their first corners,
/// are one connected manifold in one direction, with one loop for its boundary and genus 0. Vertices that no face uses
/// are passed over. Coordinates play no part.
pub fn disk_defect(mesh: &Mesh) -> Option<String> {
    if let Err(e) = mesh.check_indices() {
        return Some(e.to_string());
    }
    let surface = match glue_triangles(mesh.n_verts(), &mesh.faces.fan_triangles()) {
        Ok(surface) => surface,
        Err(defect) => return Some(defect),
    };
    let mut used = vec![false; mesh.n_verts()];
    surface.vertex.iter().for_each(|&v| used[v as usize] = true);
    match disk_with_holes(&surface, used.iter().filter(|&&u| u).count()) {
        Err(defect) => Some(defect),
        Ok(_) => match surface.boundary_loops().len() {
            1 => None,
            loops => Some(format!("its boundary has {loops} loops")),
        },
    }
}

/// Triangles glued along the edges that they share, or the first edge where that is impossible.
pub(super) fn glue_triangles(n_verts: usize, triangles: &[[u32; 3]]) -> Result<HalfEdges, String> {
    if let Some(i) = triangles.iter().position(|t| t.iter().any(|&v| v as usize >= n_verts)) {
        return Err(format!("triangle {i} has a vertex out of range"));
    }
    if let Some(i) = triangles.iter().position(|t| t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) {
        return Err(format!("triangle {i} has a vertex twice"));
    }
    let n = 3 * triangles.len();
    let mut surface = HalfEdges {
        offsets: (0..=triangles.len() as u32).map(|i| 3 * i).collect(),
        cell: (0..n as u32).map(|h| h / 3).collect(),
        vertex: triangles.as_flattened().to_vec(),
        mate: vec![NONE; n],
    };
    let mut starts = vec![0u32; n_verts + 1];
    let ends = |h: u32| sorted(surface.vertex[h as usize], surface.vertex[surface.next(h) as usize]);
    (0..n as u32).for_each(|h| starts[ends(h)[0] as usize + 1] += 1);
    (0..n_verts).for_each(|v| starts[v + 1] += starts[v]);
    let mut next = starts.clone();
    let mut items = vec![0u64; n];
    for h in 0..n as u32 {
        let [a, b] = ends(h);
        items[next[a as usize] as usize] = u64::from(b) << 32 | u64::from(h);
        next[a as usize] += 1;
    }
    for v in 0..n_verts {
        let row = &mut items[starts[v] as usize..starts[v + 1] as usize];
        row.sort_unstable();
        for group in row.chunk_by(|a, b| a >> 32 == b >> 32) {
            let other = group[0] >> 32;
            match *group {
                [_] => {}
                [g, h] => {
                    let (g, h) = (g as u32, h as u32);
                    if surface.vertex[g as usize] == surface.vertex[h as usize] {
                        return Err(format!("edge {v} {other} has two triangles of the same direction"));
                    }
                    surface.mate[g as usize] = h;
                    surface.mate[h as usize] = g;
                }
                _ => return Err(format!("edge {v} {other} has {} triangles", group.len())),
            }
        }
    }
    Ok(surface)
}

/// The boundary half-edges of a connected surface of genus 0 with a boundary that has one fan at each of its `n_verts`
/// vertices, or what it lacks.
fn disk_with_holes(surface: &HalfEdges, n_verts: usize) -> Result<Vec<u32>, String> {
    let parts = surface.components().1;
    if parts != 1 {
        return Err(format!("it has {parts} connected parts"));
    }
    let fans = surface.fans().1;
    if fans != n_verts {
        return Err(format!("{n_verts} vertices have {fans} fans"));
    }
    let boundary: Vec<u32> = (0..surface.len() as u32).filter(|&h| surface.mate[h as usize] == NONE).collect();
    if boundary.is_empty() {
        return Err("it has no boundary".into());
    }
    let loops = surface.boundary_loops().len();
    let euler = euler(surface, n_verts, boundary.len());
    if euler != 2 - loops as i64 {
        return Err(format!("its Euler characteristic is {euler} with {loops} loops"));
    }
    Ok(boundary)
}

/// V - E + F.
pub(super) fn euler(surface: &HalfEdges, n_verts: usize, n_boundary: usize) -> i64 {
    n_verts as i64 - ((surface.len() + n_boundary) / 2) as i64 + surface.n_cells() as i64
}
