//! Maps of a surface to the plane: what texture coordinates a file has, writing them, and a certificate of what a map
//! is worth.
//!
//! A [`UvMap`] has a coordinate for each *corner* of each face, so that a vertex on a seam has several. [`read_uv`]
//! and [`write_with_uv`] are beside [`read_mesh`](crate::read_mesh) and [`write_mesh`](crate::write_mesh);
//! [`seams_of`] finds the edges along which a map is cut; [`certify`] counts flips and overlaps by exact tests and
//! measures distortion.

mod certificate;
mod files;
#[cfg(test)]
mod fuzz;
mod gltf;
#[cfg(test)]
mod gltf_tests;
mod layout;
mod obj;
pub mod pack;
mod ply;

pub use certificate::{Certificate, CertificateOptions, Distortion, MOST_EXAMPLES, Overlaps, certify, has_rest_area};
pub use files::{Source, as_stored, check_source, parse_uv, read_uv, read_uv_onto, require_uv_format, write_with_uv};

use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::mesh::{Mesh, Polygons};
use layout::Layout;

/// Texture coordinates of the corners of faces: the corner `i` of [`Polygons::indices`] lies at
/// `coordinates[corners[i]]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UvMap {
    /// (u, v), u to the right and v upwards, as in OBJ.
    pub coordinates: Vec<[f64; 2]>,
    /// Parallel to [`Polygons::indices`]: which coordinate the corner has, or [`UvMap::NONE`]. A face has coordinates
    /// at all of its corners or at none.
    pub corners: Vec<u32>,
}

impl UvMap {
    /// In place of a coordinate: the face of this corner is not mapped.
    pub const NONE: u32 = u32::MAX;

    /// A map that gives each corner its value; corners of one vertex with the same value share a coordinate, and the
    /// coordinates are numbered as they first occur. A face with a corner that has none is not mapped.
    ///
    /// # Errors
    /// As [`check`](Self::check).
    pub fn from_values(faces: &Polygons, values: &[Option<[f64; 2]>]) -> Result<Self> {
        let coordinates = values.iter().map(|v| v.unwrap_or_default()).collect();
        let own = |(i, v): (usize, &Option<[f64; 2]>)| if v.is_some() { i as u32 } else { UvMap::NONE };
        let mut map = UvMap { coordinates, corners: values.iter().enumerate().map(own).collect() };
        map.unmap_incomplete(faces);
        map.check(faces)?;
        Ok(map.shared(faces))
    }

    /// The coordinate of corner `i` of [`Polygons::indices`]; `None` where its face is not mapped.
    pub fn at(&self, i: usize) -> Option<[f64; 2]> {
        self.coordinates.get(*self.corners.get(i)? as usize).copied()
    }

    /// The same values at the same corners, with one coordinate for all corners of a vertex that have the same value,
    /// numbered as they first occur, and none that no corner has. The map must have passed [`check`](Self::check).
    #[must_use]
    pub fn shared(&self, faces: &Polygons) -> Self {
        let layout = Layout::new(faces, self);
        let mut number = vec![UvMap::NONE; layout.positions.len()];
        let mut out = UvMap { coordinates: Vec::new(), corners: Vec::with_capacity(self.corners.len()) };
        for (i, &c) in layout.corners.iter().enumerate() {
            let Some(n) = number.get_mut(c as usize) else {
                out.corners.push(UvMap::NONE);
                continue;
            };
            if *n == UvMap::NONE {
                *n = out.coordinates.len() as u32;
                out.coordinates.push(self.coordinates[self.corners[i] as usize]);
            }
            out.corners.push(*n);
        }
        out
    }

    /// Checks that the map belongs to these faces: an entry for each corner, each a coordinate that there is, all
    /// finite, and whole faces only.
    ///
    /// # Errors
    /// [`ErrorKind::CountMismatch`], [`ErrorKind::IndexOutOfRange`], [`ErrorKind::NonFinite`] with the first
    /// face.
    pub fn check(&self, faces: &Polygons) -> Result<()> {
        let bad = |kind, what: String, remedy: &str| MeshError::new(kind, "UV map", what, remedy);
        let (n, have) = (faces.indices().len(), self.corners.len());
        if have != n {
            let what = format!("{have} corners for faces of {n} corners");
            return Err(bad(ErrorKind::CountMismatch, what, "give the map of these faces"));
        }
        if self.coordinates.len() >= UvMap::NONE as usize {
            let what = format!("{} coordinates, 32 bits number fewer", self.coordinates.len());
            return Err(bad(ErrorKind::OversizedClaim, what, "share coordinates between corners"));
        }
        for (f, ends) in faces.offsets().windows(2).enumerate() {
            let own = &self.corners[ends[0] as usize..ends[1] as usize];
            let mapped = own.iter().filter(|&&c| c != UvMap::NONE).count();
            if mapped != 0 && mapped != own.len() {
                let what = format!("{mapped} of its {} corners have coordinates", own.len());
                let remedy = "give all or none of them";
                return Err(bad(ErrorKind::CountMismatch, what, remedy).at_item(Item::Face(f)));
            }
            for &c in own.iter().filter(|&&c| c != UvMap::NONE) {
                let Some(uv) = self.coordinates.get(c as usize) else {
                    let what = format!("coordinate {c} is out of range, there are {}", self.coordinates.len());
                    let e = bad(ErrorKind::IndexOutOfRange, what, "correct the index");
                    return Err(e.at_item(Item::Face(f)));
                };
                if let Some(x) = uv.iter().find(|x| !x.is_finite()) {
                    let e = bad(ErrorKind::NonFinite, format!("a coordinate is {x}"), "replace it by a finite number");
                    return Err(e.at_item(Item::Face(f)));
                }
            }
        }
        Ok(())
    }

    /// Takes the coordinates from faces that do not have them at all corners.
    fn unmap_incomplete(&mut self, faces: &Polygons) {
        for ends in faces.offsets().windows(2) {
            if let Some(own) = self.corners.get_mut(ends[0] as usize..ends[1] as usize)
                && own.contains(&UvMap::NONE)
            {
                own.fill(UvMap::NONE);
            }
        }
    }
}

/// The edges of the mesh, as (smaller, larger) and ascending, along which a map is discontinuous: two faces at the edge
/// have different coordinates at one of its ends.
///
/// Coordinates are compared by value, not by index: files that list a coordinate for each corner anew have seams only
/// where the values differ. Faces without coordinates say nothing about an edge.
///
/// # Errors
/// As [`UvMap::check`].
pub fn seams_of(mesh: &Mesh, uv: &UvMap) -> Result<Vec<[u32; 2]>> {
    uv.check(&mesh.faces)?;
    let layout = Layout::new(&mesh.faces, uv);
    let mut seams = Vec::new();
    layout.for_each_edge(&mesh.faces, |edge, uses| {
        if layout::is_seam(uses) {
            seams.push(edge);
        }
    });
    Ok(seams)
}
