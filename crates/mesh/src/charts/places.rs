//! The places of all corners, and what they say about edges and vertices.

use super::edges::Edges;
use super::select::Role;
use super::{Charts, Place, plural};
use crate::mesh::Mesh;

/// The place of each corner of the mesh, from those of the half-edges (`corner` is where each starts).
pub(super) fn of_corners(mesh: &Mesh, roles: &[Role], corner: &[u32], places: &[Place]) -> Vec<Option<Place>> {
    let faces = &mesh.faces;
    let mut out = vec![None; faces.indices().len()];
    corner.iter().zip(places).for_each(|(&c, &p)| out[c as usize] = Some(p));
    let corners = |f: usize| faces.offsets()[f] as usize..faces.offsets()[f + 1] as usize;
    for (f, role) in roles.iter().enumerate() {
        if let Role::CopyOf(first) = role {
            for c in corners(f) {
                let same = corners(*first as usize).find(|&d| faces.indices()[d] == faces.indices()[c]);
                out[c] = same.and_then(|d| out[d]);
            }
        }
    }
    // Vertices of faces that are left out, and all places that they have elsewhere.
    let left: Vec<usize> = (0..roles.len()).filter(|&f| roles[f] == Role::LeftOut).collect();
    let mut wanted: Vec<u32> = left.iter().flat_map(|&f| faces.get(f)).copied().collect();
    wanted.sort_unstable();
    wanted.dedup();
    if wanted.is_empty() {
        return out;
    }
    let mut at: Vec<(u32, Place)> = Vec::new();
    for (&v, place) in faces.indices().iter().zip(&out) {
        if let Some(p) = place
            && wanted.binary_search(&v).is_ok()
        {
            at.push((v, *p));
        }
    }
    at.sort_unstable();
    at.dedup();
    let of = |v: u32| &at[at.partition_point(|e| e.0 < v)..at.partition_point(|e| e.0 <= v)];
    for f in left {
        // All in one chart where that is possible.
        let chart = faces.get(f).iter().find_map(|&v| of(v).first()).map(|e| e.1.chart);
        for c in corners(f) {
            let all = of(faces.indices()[c]);
            out[c] = all.iter().find(|e| Some(e.1.chart) == chart).or(all.first()).map(|e| e.1);
        }
    }
    out
}

/// The edges of several taken faces whose corners have different places there, ascending.
pub(super) fn seams(mesh: &Mesh, edges: &Edges, roles: &[Role], places: &[Option<Place>]) -> Vec<[u32; 2]> {
    let faces = &mesh.faces;
    let mut face = vec![0u32; faces.indices().len()];
    for f in 0..faces.len() {
        face[faces.offsets()[f] as usize..faces.offsets()[f + 1] as usize].fill(f as u32);
    }
    let next = |c: u32| {
        let f = face[c as usize] as usize;
        if c + 1 == faces.offsets()[f + 1] { faces.offsets()[f] } else { c + 1 }
    };
    let mut out = Vec::new();
    for (edge, sides) in edges.iter() {
        let mut ends =
            sides.iter().map(|&i| i as u32).filter(|&c| roles[face[c as usize] as usize] == Role::Taken).map(|c| {
                let (here, there) = (places[c as usize], places[next(c) as usize]);
                if faces.indices()[c as usize] == edge[0] { (here, there) } else { (there, here) }
            });
        if let Some(first) = ends.next()
            && ends.any(|e| e != first)
        {
            out.push(edge);
        }
    }
    out
}

/// Sentences about vertices that no face uses, that had to be doubled, and about corners without a place.
pub(super) fn report_vertices(mesh: &Mesh, roles: &[Role], out: &mut Charts) {
    let mut used = vec![false; mesh.n_verts()];
    mesh.faces.indices().iter().for_each(|&v| used[v as usize] = true);
    let mut unused = (0..used.len()).filter(|&v| !used[v]);
    if let Some(first) = unused.next() {
        let n = 1 + unused.count();
        out.warnings.push(format!("{} in no face, the first is {first}", plural(n, "vertex is", "vertices are")));
    }
    // A vertex of several places without a seam at it joins parts that touch there only.
    let mut on_seam = vec![false; mesh.n_verts()];
    out.seams.iter().flatten().for_each(|&v| on_seam[v as usize] = true);
    let mut seen = vec![0u8; mesh.n_verts()];
    out.charts.iter().flat_map(|c| &c.vertices).for_each(|&v| seen[v as usize] = seen[v as usize].saturating_add(1));
    let mut pinched = (0..seen.len()).filter(|&v| seen[v] > 1 && !on_seam[v]);
    if let Some(first) = pinched.next() {
        let n = 1 + pinched.count();
        out.repairs.push(format!(
            "{} parts of the surface that share no edge there, the first is {first}: doubled in the map",
            plural(n, "vertex joins", "vertices join")
        ));
    }
    let lost = roles.iter().enumerate().find(|(f, _)| {
        let w = [mesh.faces.offsets()[*f] as usize, mesh.faces.offsets()[*f + 1] as usize];
        out.places[w[0]..w[1]].iter().any(Option::is_none)
    });
    if let Some((f, _)) = lost {
        out.warnings
            .push(format!("some corners of faces that were left out have no place in the map, the first in face {f}"));
    }
}
