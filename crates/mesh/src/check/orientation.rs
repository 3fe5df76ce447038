//! Signs of volumes and areas, decided in exact arithmetic (Shewchuk 1997).

use robust::{Coord, Coord3D, orient2d, orient3d};

use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::mesh::Mesh;
use crate::vec3::{Sum, V3, cross, det4, norm, sub};

/// Below this mean ratio a tetrahedron counts as a sliver: nearly flat for its edge lengths.
/// Real scans have them (volumes down to 5e-12 of the largest), so they are a warning only.
pub const SLIVER_MEAN_RATIO: f64 = 1e-2;

/// The tetrahedra by the sign of their volume.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TetCheck {
    /// Those of negative volume, ascending.
    pub negative: Vec<u32>,
    /// Those of exactly zero volume, ascending.
    pub zero: Vec<u32>,
    /// Those of positive volume but of a mean ratio below [`SLIVER_MEAN_RATIO`].
    pub slivers: Vec<u32>,
    /// The smallest and the largest volume, signed (0, 0 without tetrahedra).
    pub volumes: (f64, f64),
    /// The sum of all signed volumes.
    pub total: f64,
}

/// The volume of a tetrahedron, det(b - a, c - a, d - a) / 6.
pub fn volume([a, b, c, d]: [V3; 4]) -> f64 {
    det4(a, b, c, d) / 6.0
}

/// The mean ratio 12 (3 V)^(2/3) / sum of the squared edge lengths, in [0, 1]: 1 for the regular
/// tetrahedron, 0 where flat or inverted. Liu and Joe 1994.
pub fn mean_ratio(corners: [V3; 4]) -> f64 {
    let [a, b, c, d] = corners;
    let edges = [sub(b, a), sub(c, a), sub(d, a), sub(c, b), sub(d, b), sub(d, c)];
    // Scaled first, so that neither 1e-150 nor 1e150 leaves the range of f64.
    let longest = edges.iter().map(|&e| e.iter().fold(0.0, |m: f64, x| m.max(x.abs()))).fold(0.0, f64::max);
    if longest == 0.0 || !longest.is_finite() {
        return 0.0;
    }
    let e = edges.map(|e| e.map(|x| x / longest));
    let squares: f64 = e.iter().flatten().map(|x| x * x).sum();
    let v = det4([0.0; 3], e[0], e[1], e[2]) / 6.0;
    12.0 * (3.0 * v.max(0.0)).cbrt().powi(2) / squares
}

pub(crate) fn corners(points: &[V3], tet: [u32; 4]) -> [V3; 4] {
    tet.map(|v| points[v as usize])
}

/// A power of two that brings the largest coordinate near 1, so that the predicates neither
/// overflow nor underflow. Scaling by it changes no sign.
fn unit_scale(points: &[V3]) -> f64 {
    let largest = points.as_flattened().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    if largest == 0.0 || !largest.is_finite() {
        return 1.0;
    }
    let exponent = largest.log2().floor().clamp(-1000.0, 1000.0) as i32;
    2f64.powi(-exponent)
}

/// The exact sign of det(b - a, c - a, d - a): 1, 0 or -1.
fn orientation([a, b, c, d]: [V3; 4], s: f64) -> i8 {
    let p = |v: V3| Coord3D { x: v[0] * s, y: v[1] * s, z: v[2] * s };
    // Shewchuk's predicate has the opposite sign.
    let det = -orient3d(p(a), p(b), p(c), p(d));
    if det > 0.0 { 1 } else { -i8::from(det < 0.0) }
}

/// Examines every tetrahedron. Indices must be in range.
pub fn check_tets(points: &[[f64; 3]], tets: &[[u32; 4]]) -> TetCheck {
    let mut out = TetCheck::default();
    let mut total = Sum::default();
    let s = unit_scale(points);
    for (i, &t) in tets.iter().enumerate() {
        let x = corners(points, t);
        let v = volume(x);
        match orientation(x, s) {
            1 if mean_ratio(x) < SLIVER_MEAN_RATIO => out.slivers.push(i as u32),
            1 => {}
            0 => out.zero.push(i as u32),
            _ => out.negative.push(i as u32),
        }
        if i == 0 {
            out.volumes = (v, v);
        }
        out.volumes = (out.volumes.0.min(v), out.volumes.1.max(v));
        total.add(v);
    }
    out.total = total.value();
    out
}

/// Examines every tetrahedron and refuses a mesh with one of zero or negative volume.
///
/// # Errors
/// [`ErrorKind::NegativeVolume`] or [`ErrorKind::ZeroVolume`] with the first such tetrahedron, its
/// volume and how many there are.
pub fn require_volumes(mesh: &Mesh) -> Result<TetCheck> {
    let check = check_tets(&mesh.points, &mesh.tets);
    match volume_error(mesh, &check) {
        None => Ok(check),
        Some(e) => Err(e),
    }
}

pub(crate) fn volume_error(mesh: &Mesh, check: &TetCheck) -> Option<MeshError> {
    let (negative, zero) = (check.negative.first(), check.zero.first());
    let first = *negative.into_iter().chain(zero).min()?;
    let is_negative = negative == Some(&first);
    let v = volume(corners(&mesh.points, mesh.tets[first as usize]));
    let counts = match (check.negative.len(), check.zero.len()) {
        (n, 0) => format!("{n} of {} are negative", mesh.tets.len()),
        (0, z) => format!("{z} of {} are zero", mesh.tets.len()),
        (n, z) => format!("{n} of {} are negative and {z} zero", mesh.tets.len()),
    };
    let (kind, what, remedy) = if is_negative {
        let remedy = "turn the inverted ones with --fix-orientation";
        (ErrorKind::NegativeVolume, format!("its volume is negative ({v:.3e}); {counts}"), remedy)
    } else {
        let remedy = "move its vertices or remove it (--fix-orientation turns inverted ones only)";
        (ErrorKind::ZeroVolume, format!("its volume is zero; {counts}"), remedy)
    };
    Some(mesh.error(kind, what, remedy).at_item(Item::Tetrahedron(first as usize)))
}

/// Turns every tetrahedron of negative volume by swapping its last two corners, and returns how
/// many there were. Zero volumes stay as they are.
pub fn fix_orientation(points: &[[f64; 3]], tets: &mut [[u32; 4]]) -> usize {
    let s = unit_scale(points);
    let mut turned = 0;
    for t in tets {
        if orientation(corners(points, *t), s) < 0 {
            t.swap(2, 3);
            turned += 1;
        }
    }
    turned
}

/// The triangles by their area.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleCheck {
    /// Those of exactly zero area, ascending.
    pub zero: Vec<u32>,
    /// In a planar mesh those that turn clockwise, ascending.
    pub negative: Vec<u32>,
    /// The smallest and the largest area, signed where planar.
    pub areas: (f64, f64),
    /// The sum of all areas.
    pub total: f64,
}

/// Examines every triangle; areas are signed where `planar`. Indices must be in range.
pub fn check_triangles(points: &[[f64; 3]], triangles: &[[u32; 3]], planar: bool) -> TriangleCheck {
    let mut out = TriangleCheck::default();
    let mut total = Sum::default();
    let s = unit_scale(points);
    // A triangle in space is degenerate exactly if its three projections are.
    let flat = |[a, b, c]: [V3; 3], i: usize, j: usize| {
        let p = |v: V3| Coord { x: v[i] * s, y: v[j] * s };
        orient2d(p(a), p(b), p(c))
    };
    for (i, t) in triangles.iter().enumerate() {
        let x = t.map(|v| points[v as usize]);
        let normal = cross(sub(x[1], x[0]), sub(x[2], x[0]));
        let z = flat(x, 0, 1);
        let mut area = 0.5 * norm(normal);
        if z == 0.0 && flat(x, 1, 2) == 0.0 && flat(x, 2, 0) == 0.0 {
            out.zero.push(i as u32);
        } else if planar && z < 0.0 {
            area = -area;
            out.negative.push(i as u32);
        }
        if i == 0 {
            out.areas = (area, area);
        }
        out.areas = (out.areas.0.min(area), out.areas.1.max(area));
        total.add(area);
    }
    out.total = total.value();
    out
}

/// Examines every triangle and refuses a mesh with one of zero area.
///
/// # Errors
/// [`ErrorKind::ZeroVolume`] with the first such triangle and how many there are.
pub fn require_areas(mesh: &Mesh, triangles: &[[u32; 3]]) -> Result<TriangleCheck> {
    let check = check_triangles(&mesh.points, triangles, mesh.planar);
    match check.zero.first() {
        None => Ok(check),
        Some(&first) => {
            let what = format!("its area is zero; {} of {} are zero", check.zero.len(), triangles.len());
            Err(mesh
                .error(ErrorKind::ZeroVolume, what, "move its vertices or remove it")
                .at_item(Item::Face(first as usize)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit() -> Mesh {
        let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        Mesh::from_tets("unit", points, vec![[0, 1, 2, 3]])
    }

    #[test]
    fn volume_and_quality_at_any_scale() {
        let r = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        assert!((mean_ratio([r[0], r[2], r[1], r[3]]) - 1.0).abs() < 1e-14);
        assert_eq!(mean_ratio(r), 0.0, "inverted");
        for s in [1e-150, 1.0, 1e150] {
            let x = [r[0], r[2], r[1], r[3]].map(|p| p.map(|c| s * c));
            assert!((mean_ratio(x) - 1.0).abs() < 1e-14);
        }
        assert_eq!(volume(corners(&unit().points, [0, 1, 2, 3])), 1.0 / 6.0);
    }

    #[test]
    fn negative_is_named_and_can_be_turned() {
        let mut mesh = unit();
        assert!(require_volumes(&mesh).is_ok());
        mesh.tets = vec![[0, 1, 2, 3], [0, 2, 1, 3]];
        assert_eq!(
            require_volumes(&mesh).unwrap_err().to_string(),
            "unit: tetrahedron 1 (0-based): its volume is negative (-1.667e-1); 1 of 2 are \
             negative; turn the inverted ones with --fix-orientation"
        );
        assert_eq!(fix_orientation(&mesh.points, &mut mesh.tets), 1);
        assert_eq!(require_volumes(&mesh).unwrap().total, 2.0 / 6.0);
    }

    #[test]
    fn exact_arithmetic_decides_about_zero() {
        // The fourth point on the plane x + y + z = 0.1 + 0.2 + 0.3 up to rounding: floating point
        // sees noise, the exact sign is what counts, at every scale.
        for s in [1.0, 2f64.powi(-500), 2f64.powi(500)] {
            let mut mesh = unit();
            mesh.points = vec![[0.0; 3], [1.0, 1.0, 0.0], [0.1, 0.1, 0.0], [0.3, 0.3, 0.0]];
            mesh.points[3][2] = 5e-17;
            mesh.points = mesh.points.iter().map(|p| p.map(|c| s * c)).collect();
            let e = require_volumes(&mesh).unwrap_err();
            assert_eq!((e.kind(), e.item()), (ErrorKind::ZeroVolume, Some(Item::Tetrahedron(0))));
            mesh.points[2][1] = mesh.points[2][1].next_up();
            let sign = check_tets(&mesh.points, &mesh.tets);
            assert_eq!((sign.zero.len(), sign.negative.len(), sign.slivers.len()), (0, 0, 1));
        }
    }

    #[test]
    fn triangles() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let tris = [[0, 1, 2], [0, 2, 1], [0, 1, 3], [0, 4, 3]];
        let c = check_triangles(&points, &tris[..3], true);
        assert_eq!((c.negative, c.zero), (vec![1], vec![2]));
        assert_eq!(check_triangles(&points, &tris, false).zero, [2]);
    }
}
