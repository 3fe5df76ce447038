//! What a map is worth, from its coordinates alone: signs and overlaps by exact arithmetic, distortion in the
//! measures of the literature.

mod distortion;
mod exact;
mod overlaps;
mod pairs;
mod seams;
#[cfg(test)]
mod tests;

pub use distortion::Distortion;
pub use exact::has_rest_area;
pub use overlaps::Overlaps;

use rayon::prelude::*;

use super::UvMap;
use super::layout::Layout;
use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::mesh::Polygons;
use crate::topology::components;
use distortion::Measure;
use exact::Plane;

/// How many faces or pairs of faces a certificate names of each kind.
pub const MOST_EXAMPLES: usize = 100;

/// What [`certify`] must be told.
#[derive(Clone, Debug, Default)]
pub struct CertificateOptions {
    /// Faces whose listed order is against the orientation of their chart: the signs of their areas are turned around.
    pub reversed_faces: Vec<u32>,
}

/// A triangle of a face, split as a fan around its first corner.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    pub face: u32,
    pub corners: [u32; 3], // places in Polygons::indices()
}

/// What is known of a map. Polygons count as the triangles of the fan around their first corner; all counts are of
/// triangles unless they say otherwise.
#[derive(Clone, Debug, PartialEq)]
pub struct Certificate {
    /// Triangles of mapped faces.
    pub triangles: usize,
    /// Faces without coordinates; they are in nothing that follows.
    pub unmapped_faces: usize,
    /// Triangles without area on the surface: they are no flips, and in no measure of distortion.
    pub no_rest_area: usize,
    /// Triangles whose signed area in the plane is negative, by exact arithmetic.
    pub flips: usize,
    /// Faces of the first of them, ascending.
    pub flipped_faces: Vec<u32>,
    /// Triangles that have area on the surface and exactly none in the plane.
    pub zero_area: usize,
    /// Faces of the first of them, ascending.
    pub zero_area_faces: Vec<u32>,
    /// Where the map is not injective.
    pub overlaps: Overlaps,
    /// How far the map is from an isometry.
    pub distortion: Distortion,
    /// Charts: faces that share UV vertices are in one.
    pub charts: usize,
    /// The length on the surface of the edges along which the map is discontinuous.
    pub seam_length: f64,
    /// `seam_length` over the diagonal of the bounding box of all vertices (0 where that is 0).
    pub relative_seam_length: f64,
    /// The largest over the smallest texel density of a chart, sqrt(area in the plane / area on the surface); 1 for a
    /// single chart. Charts without area on either side are left out.
    pub density_spread: f64,
    /// The sum of the absolute areas of all triangles in the plane.
    pub uv_area: f64,
    /// The smallest and the largest corner of the box around all used coordinates; `None` where no face is mapped.
    pub uv_box: Option<[[f64; 2]; 2]>,
    /// `uv_area` over the area of the unit square where the map lies in it, over that of the square around the map (its
    /// side is the longer one of `uv_box`) elsewhere: 1 is a map without waste.
    pub packing: f64,
}

/// Examines a map of the faces of a mesh.
///
/// Signs are exact for coordinates that are zero or larger than 1e-140 times the largest one (beyond that products
/// leave the range of f64). The result is the same for any number of threads.
///
/// # Errors
/// A map that does not belong to the faces, an index out of range, a coordinate that is not finite.
pub fn certify(points: &[[f64; 3]], faces: &Polygons, uv: &UvMap, options: &CertificateOptions) -> Result<Certificate> {
    uv.check(faces)?;
    check_points(points, faces)?;
    let reversed = reversed_mask(faces.len(), &options.reversed_faces)?;
    let layout = Layout::new(faces, uv);
    let plane = Plane::new(&layout.positions);
    let triangles = fan(faces, &layout);
    let vertices = faces.indices();
    let measures: Vec<Measure> = triangles
        .par_iter()
        .map(|t| {
            let rest = t.corners.map(|c| points[vertices[c as usize] as usize]);
            let ids = t.corners.map(|c| layout.corners[c as usize]);
            Measure::new(rest, &plane, ids, reversed[t.face as usize])
        })
        .collect();
    let parts = components(layout.positions.len(), UvFaces { faces, layout: &layout }.iter());
    let copies = overlaps::copies(faces, &layout);
    let (seam_length, boundary) = seams::seams(points, faces, &layout, &copies);
    let overlaps = overlaps::overlaps(&plane, &layout, &triangles, &measures, &copies, &boundary);
    let chart_of = |t: &Triangle| parts.of_vertex[layout.corners[t.corners[0] as usize] as usize].unwrap_or(0);
    let charts: Vec<u32> = triangles.iter().map(chart_of).collect();
    let uv_area = distortion::uv_area(&measures);
    let uv_box = layout
        .positions
        .iter()
        .map(|&p| [p, p])
        .reduce(|[lo, hi], [p, _]| [[lo[0].min(p[0]), lo[1].min(p[1])], [hi[0].max(p[0]), hi[1].max(p[1])]]);
    let named = |pick: fn(&Measure) -> bool| {
        let all = || measures.iter().zip(&triangles).filter(move |(m, _)| pick(m)).map(|(_, t)| t.face);
        let mut first: Vec<u32> = all().take(MOST_EXAMPLES).collect();
        first.dedup();
        (all().count(), first)
    };
    let (flips, flipped_faces) = named(|m| m.area > 0.0 && m.sign < 0);
    let (zero_area, zero_area_faces) = named(|m| m.area > 0.0 && m.sign == 0);
    let diagonal = seams::diagonal(points);
    Ok(Certificate {
        triangles: triangles.len(),
        unmapped_faces: (0..faces.len()).filter(|&f| !is_mapped(faces, &layout, f)).count(),
        no_rest_area: measures.iter().filter(|m| m.area == 0.0).count(),
        flips,
        flipped_faces,
        zero_area,
        zero_area_faces,
        overlaps,
        distortion: Distortion::new(&measures),
        charts: parts.count,
        seam_length,
        relative_seam_length: if diagonal > 0.0 { seam_length / diagonal } else { 0.0 },
        density_spread: distortion::density_spread(&measures, &charts, parts.count),
        uv_area,
        uv_box,
        packing: uv_box.map_or(0.0, |b| packing(uv_area, b)),
    })
}

fn packing(area: f64, [low, high]: [[f64; 2]; 2]) -> f64 {
    let unit = (0..2).all(|d| low[d] >= 0.0 && high[d] <= 1.0);
    let side = if unit { 1.0 } else { (high[0] - low[0]).max(high[1] - low[1]) };
    if side > 0.0 { area / side / side } else { 0.0 }
}

fn check_points(points: &[[f64; 3]], faces: &Polygons) -> Result<()> {
    let bad = |kind, what: String, remedy: &str| MeshError::new(kind, "mesh", what, remedy);
    for (f, face) in faces.iter().enumerate() {
        for &v in face {
            let Some(p) = points.get(v as usize) else {
                let what = format!("vertex {v} is out of range, there are {}", points.len());
                return Err(bad(ErrorKind::IndexOutOfRange, what, "correct the index").at_item(Item::Face(f)));
            };
            if p.iter().any(|x| !x.is_finite()) {
                let e = bad(ErrorKind::NonFinite, "a coordinate is not finite".into(), "replace it by a finite number");
                return Err(e.at_item(Item::Vertex(v as usize)));
            }
        }
    }
    Ok(())
}

fn reversed_mask(n: usize, reversed: &[u32]) -> Result<Vec<bool>> {
    let mut mask = vec![false; n];
    for &f in reversed {
        let Some(m) = mask.get_mut(f as usize) else {
            let what = format!("reversed face {f} is out of range, there are {n} faces");
            return Err(MeshError::new(ErrorKind::IndexOutOfRange, "mesh", what, "correct the index"));
        };
        *m = true;
    }
    Ok(mask)
}

fn is_mapped(faces: &Polygons, layout: &Layout, face: usize) -> bool {
    let from = faces.offsets()[face] as usize;
    layout.corners.get(from).is_some_and(|&c| c != UvMap::NONE) && from < faces.offsets()[face + 1] as usize
}

/// The triangles of all mapped faces, in file order.
fn fan(faces: &Polygons, layout: &Layout) -> Vec<Triangle> {
    let mut out = Vec::with_capacity(faces.indices().len().saturating_sub(2 * faces.len()));
    for (f, ends) in faces.offsets().windows(2).enumerate() {
        if is_mapped(faces, layout, f) {
            out.extend((ends[0] + 2..ends[1]).map(|k| Triangle { face: f as u32, corners: [ends[0], k - 1, k] }));
        }
    }
    out
}

/// The mapped faces as lists of UV vertices.
struct UvFaces<'a> {
    faces: &'a Polygons,
    layout: &'a Layout,
}

impl<'a> UvFaces<'a> {
    fn iter(&self) -> impl Iterator<Item = &'a [u32]> + use<'a> {
        let (faces, layout) = (self.faces, self.layout);
        let corners = move |f: usize| &layout.corners[faces.offsets()[f] as usize..faces.offsets()[f + 1] as usize];
        (0..faces.len()).filter(move |&f| is_mapped(faces, layout, f)).map(corners)
    }
}
