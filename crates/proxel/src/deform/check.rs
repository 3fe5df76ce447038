//! Checks of what comes with a mesh, before anything is built.

use super::{DeformError, DeformInput};
use proxel_mesh::Mesh;

/// The least and the largest size of a mesh: the sixth power of it, in whatever units, is a number.
const SIZES: [f64; 2] = [1e-45, 1e45];

/// Refuses meshes whose volumes are no numbers.
pub(crate) fn check_size(name: &str, mesh: &Mesh) -> Result<(), DeformError> {
    let Some((low, high)) = mesh.bounding_box() else { return Ok(()) };
    let size = (0..3).map(|d| high[d] - low[d]).fold(0.0, f64::max);
    if size > 0.0 && !(SIZES[0]..=SIZES[1]).contains(&size) {
        return Err(DeformError(format!(
            "{name}: its vertices are {size:e} apart, and its volume is no number; give it in other units"
        )));
    }
    Ok(())
}

/// Lengths, numbers and indices of everything that comes with the mesh.
pub(crate) fn check_vectors(name: &str, n: usize, input: &DeformInput) -> Result<(), DeformError> {
    for (what, positions) in [("start", &input.start), ("reference", &input.reference)] {
        let Some(positions) = positions else { continue };
        if positions.len() != n {
            return Err(DeformError(format!(
                "{name}: it has {n} vertices, the {what} {}; give a {what} of the same mesh",
                positions.len()
            )));
        }
        if let Some(v) = positions.iter().position(|p| p.iter().any(|c| !c.is_finite())) {
            return Err(DeformError(format!(
                "{name}: a coordinate of vertex {v} (0-based) of the {what} is not finite; replace it"
            )));
        }
    }
    if let Some(fill) = &input.fill
        && (fill.len() != input.rest.tets.len() || fill.iter().any(|f| !(*f > 0.0 && *f <= 1.0)))
    {
        return Err(DeformError(format!(
            "{name}: fill has {} numbers for {} tetrahedra; give each a part above 0 and at most 1",
            fill.len(),
            input.rest.tets.len()
        )));
    }
    let nodes = input.skin.iter().flat_map(|skin| (0..skin.n() as u32).filter_map(|v| skin.at(v)));
    if let Some((nodes, _)) = nodes.into_iter().find(|(nodes, _)| nodes.iter().any(|v| *v as usize >= n)) {
        return Err(DeformError(format!(
            "{name}: the vertices {nodes:?} carry a vertex of the skin, the {n} vertices are numbered from 0; correct it"
        )));
    }
    for tie in &input.ties {
        let sum: f64 = tie.weights.iter().sum();
        if tie.nodes.iter().any(|v| *v as usize >= n) || (sum - 1.0).abs().is_nan() || (sum - 1.0).abs() > 1e-9 {
            return Err(DeformError(format!(
                "{name}: a tie of vertices {:?} with weights {:?}; name vertices of the mesh, with weights that add up to 1",
                tie.nodes, tie.weights
            )));
        }
    }
    let vectors = input.fixed.iter().map(|(v, p)| ("pin", *v, *p));
    let vectors = vectors.chain(input.ties.iter().map(|t| ("tie", t.nodes[0], t.target)));
    let vectors = vectors.chain(input.soft.iter().map(|(v, p, _)| ("soft spring", *v, *p)));
    let vectors = vectors.chain(input.loads.iter().map(|(v, p)| ("load", *v, *p)));
    for (what, v, vector) in vectors {
        if v as usize >= n {
            return Err(DeformError(format!(
                "{name}: a {what} names vertex {v}, the {n} vertices are numbered 0 to {}; correct it",
                n.max(1) - 1
            )));
        }
        if vector.iter().any(|c| !c.is_finite()) {
            return Err(DeformError(format!(
                "{name}: the {what} at vertex {v} (0-based) has a number that is not finite; replace it"
            )));
        }
    }
    let mut fixed: Vec<&(u32, [f64; 3])> = input.fixed.iter().collect();
    fixed.sort_by_key(|pin| pin.0);
    if let Some(pair) = fixed.windows(2).find(|pair| pair[0].0 == pair[1].0 && pair[0].1 != pair[1].1) {
        return Err(DeformError(format!(
            "{name}: vertex {} (0-based) is pinned twice, at {:?} and at {:?}; give it one place",
            pair[0].0, pair[0].1, pair[1].1
        )));
    }
    if let Some((v, _, k)) = input.soft.iter().find(|(_, _, k)| !(*k >= 0.0 && k.is_finite())) {
        return Err(DeformError(format!(
            "{name}: the soft spring at vertex {v} (0-based) has stiffness {k}; it must not be negative"
        )));
    }
    Ok(())
}
