//! A ball and a torus, by isosurface stuffing.

use super::{invalid, positive, stuff};
use crate::error::Result;
use crate::mesh::Mesh;
use crate::vec3::norm;

/// A ball of the given radius around the origin, of lattice cells of edge `cell`.
///
/// # Errors
/// Lengths that are not positive; a cell too coarse or too fine for the radius.
pub fn ball(radius: f64, cell: f64) -> Result<Mesh> {
    positive("the radius", radius)?;
    let mesh = stuff(&|p| norm(p) - radius, [-radius; 3], [radius; 3], cell)?;
    Ok(Mesh { name: "ball".into(), ..mesh })
}

/// A torus around the z axis: a tube of radius `minor` along a circle of radius `major`.
///
/// # Errors
/// As [`ball`]; also a tube that fills the hole.
pub fn torus(major: f64, minor: f64, cell: f64) -> Result<Mesh> {
    positive("the major radius", major)?;
    positive("the minor radius", minor)?;
    if major - minor < cell {
        return Err(invalid(
            format!("a torus of radii {major} and {minor} has no hole of a cell's size"),
            "give a larger major radius or a smaller cell",
        ));
    }
    let r = major + minor;
    let field = |p: [f64; 3]| (p[0].hypot(p[1]) - major).hypot(p[2]) - minor;
    let mesh = stuff(&field, [-r, -r, -minor], [r, r, minor], cell)?;
    Ok(Mesh { name: "torus".into(), ..mesh })
}
