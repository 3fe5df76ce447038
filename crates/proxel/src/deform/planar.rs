//! Problems in a plane: triangles and edges with two coordinates a vertex.

use super::elements::Cells;
use super::{DeformError, DeformInput};
use crate::settings::DeformSettings;
use proxel_mesh::Mesh;

/// Heights that differ by more than this part of the mesh's size are no plane.
const FLAT: f64 = 1e-12;

/// Checks that all of the input lies in one plane z = const. and nothing pulls out of it.
pub(super) fn check(
    name: &str,
    input: &DeformInput,
    settings: &DeformSettings,
    kinds: &[Cells],
) -> Result<(), DeformError> {
    if kinds.iter().any(|cells| matches!(cells, Cells::Tets(_))) {
        return Err(DeformError(format!(
            "{name}: it has tetrahedra, which are not planar; leave --planar out or give triangles or edges"
        )));
    }
    let points = &input.rest.points;
    let (mut low, mut high) = (points[0], points[0]);
    for p in points {
        for d in 0..3 {
            (low[d], high[d]) = (low[d].min(p[d]), high[d].max(p[d]));
        }
    }
    let size = (high[0] - low[0]).max(high[1] - low[1]).max(low[2].abs());
    let z = low[2];
    let is_off = |p: &[f64; 3]| (p[2] - z).abs() > FLAT * size;
    let refuse = |what: &str, v: usize, height: f64| {
        Err(DeformError(format!(
            "{name}: {what} vertex {v} (0-based) has z = {height}, others {z}; --planar needs all in one plane z = const."
        )))
    };
    for (what, positions) in
        [("", Some(points)), ("in the start", input.start.as_ref()), ("in the reference", input.reference.as_ref())]
    {
        if let Some((v, p)) = positions.iter().flat_map(|p| p.iter()).enumerate().find(|(_, p)| is_off(p)) {
            return refuse(what, v, p[2]);
        }
    }
    let targets = input.fixed.iter().map(|(v, p)| (v, p)).chain(input.soft.iter().map(|(v, p, _)| (v, p)));
    if let Some((v, p)) = targets.into_iter().find(|(_, p)| is_off(p)) {
        return refuse("the target of", *v as usize, p[2]);
    }
    if let Some((v, force)) = input.loads.iter().find(|(_, force)| force[2] != 0.0) {
        return Err(DeformError(format!(
            "{name}: the load on vertex {v} (0-based) has the z component {}; it must be 0 with --planar",
            force[2]
        )));
    }
    if settings.gravity[2] != 0.0 {
        return Err(DeformError(format!(
            "gravity has the z component {}; it must be 0 with --planar",
            settings.gravity[2]
        )));
    }
    Ok(())
}

/// Gives every triangle a positive area by the order of its corners, which changes nothing but signs. All of them clockwise
/// is a sheet seen from below; some of them is a fold, and repaired on request only: says what was.
pub(super) fn orient(
    name: &str,
    mesh: &Mesh,
    settings: &DeformSettings,
    kinds: &mut [Cells],
) -> Result<Option<String>, DeformError> {
    let mut repaired = None;
    for cells in kinds {
        let Cells::Triangles(triangles) = cells else { continue };
        let clockwise: Vec<usize> =
            (0..triangles.len()).filter(|t| area(triangles[*t].map(|v| mesh.points[v as usize])) < 0.0).collect();
        let mixed = !clockwise.is_empty() && clockwise.len() < triangles.len();
        if mixed && !settings.fix_orientation {
            return Err(DeformError(format!(
                "{name}: {} of {} triangles are clockwise, the first is {} (0-based); orient them alike or use --fix-orientation",
                clockwise.len(),
                triangles.len(),
                clockwise[0]
            )));
        }
        if mixed {
            let (n, first) = (clockwise.len(), clockwise[0]);
            repaired = Some(format!("{name}: {n} clockwise triangles were turned, the first is {first} (0-based)"));
        }
        for t in clockwise {
            triangles[t].swap(1, 2);
        }
    }
    Ok(repaired)
}

/// Signed area of a triangle in the plane.
fn area([a, b, c]: [[f64; 3]; 3]) -> f64 {
    ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0
}
