//! Packing of charts into the unit square at one texel density.
//!
//! Charts keep their relative scales: all get one common factor, the largest for which they fit. Each is turned so
//! that its smallest enclosing rectangle is upright (Freeman and Shapira, "Determining the minimum-area encasing
//! rectangle for an arbitrary closed curve", 1975; found by rotating calipers, Toussaint 1983), and then by any
//! multiple of 90 degrees; none is mirrored. Outlines are compared as bitmaps, not as boxes, so that a chart may lie
//! in the bay of another one or in its hole.
//!
//! The distance is a guarantee. A chart A covers the cells that A meets; it may be put where no cell met by the set
//! of points within the padding of A is covered by another chart. If a of A and b of B were closer than the padding,
//! the cell of b would be met by both.
//!
//! Published packers were weighed: jagua-rs and its users nest polygons for cutting, where minutes of optimisation
//! are spent on the layout of tens of parts and the scale is given; packers of rectangles give away the bays. Charts
//! come in thousands, with outlines of 10^5 edges and overlaps, and a bitmap does not care.

mod bitmap;
mod chart;
mod error;
mod hull;
mod page;
mod raster;
mod search;
#[cfg(test)]
mod tests;

pub use error::PackError;

use chart::Prepared;

/// A chart to be packed.
#[derive(Clone, Copy, Debug)]
pub struct PackChart<'a> {
    /// Its vertices in the plane, (n, 2), at the same units of length in all charts.
    pub uv: &'a [[f64; 2]],
    /// Its triangles; they may be flipped or overlap.
    pub triangles: &'a [[u32; 3]],
    /// The area of these triangles on the surface; it enters [`Packing::density`] only.
    pub rest_area: f64,
}

/// What is asked of a packing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PackOptions {
    /// The least distance of two charts, in pixels; from the border of the page a chart stays half of it.
    pub padding: f64,
    /// Pixels along each side of the page.
    pub resolution: u32,
    /// Whether charts may be turned.
    pub rotate: bool,
    /// Texels per unit of length on the surface, instead of as many as fit.
    pub density: Option<f64>,
}

impl Default for PackOptions {
    fn default() -> Self {
        PackOptions { padding: 2.0, resolution: 1024, rotate: true, density: None }
    }
}

/// Where a chart goes: p' = scale R p + offset, R = [[cos, -sin], [sin, cos]].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// The factor, the same for all charts.
    pub scale: f64,
    /// Cosine and sine of the angle.
    pub rotation: [f64; 2],
    /// The translation, in the units of the page, whose sides are 1.
    pub offset: [f64; 2],
}

impl Placement {
    /// The point of the page where `p` goes.
    pub fn apply(&self, p: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.rotation;
        [self.scale * (c * p[0] - s * p[1]) + self.offset[0], self.scale * (s * p[0] + c * p[1]) + self.offset[1]]
    }
}

/// Charts in the unit square.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Packing {
    /// One for each chart, in the given order.
    pub placements: Vec<Placement>,
    /// The sum of the areas of all triangles on the page, which has area 1. Overlaps within a chart count twice.
    pub efficiency: f64,
    /// Texels per unit of length: resolution sqrt(sum of areas on the page / sum of rest areas); of charts without
    /// rest area resolution times scale.
    pub density: f64,
}

/// Packs charts into the unit square.
///
/// The result is the same for any number of threads. Time is that of sorting the edges and of some ten rasterisations.
///
/// # Errors
/// Options without meaning, a chart that cannot be drawn, and charts for which the page has no room at the given
/// density or with the given padding.
pub fn pack(charts: &[PackChart<'_>], options: &PackOptions) -> Result<Packing, PackError> {
    let border = check(options)?;
    let prepared = Prepared::all(charts, options.rotate)?;
    let area: f64 = prepared.iter().map(|c| c.area).sum();
    let rest: f64 = charts.iter().map(|c| c.rest_area).sum();
    let per_unit = if rest > 0.0 { (area / rest).sqrt() } else { 1.0 }; // lengths in the map over those on the surface
    let resolution = f64::from(options.resolution);
    let given = match options.density {
        None => None,
        Some(density) if per_unit > 0.0 => Some(density / resolution / per_unit),
        Some(_) => return Err(PackError::NoArea),
    };
    let room = search::Room { border, padding: options.padding / resolution };
    let placements = match search::fit(&prepared, &room, given) {
        Ok(placements) => placements,
        Err(search::Full) => {
            let most = given.and_then(|_| search::fit(&prepared, &room, None).ok());
            let most = most.and_then(|p| p.first().map(|p| p.scale * resolution * per_unit));
            return Err(match (options.density, most) {
                (Some(density), Some(most)) => PackError::DensityTooHigh { density, most },
                _ => PackError::NoRoom { charts: charts.len(), padding: options.padding },
            });
        }
    };
    let scale = placements.first().map_or(0.0, |p| p.scale);
    Ok(Packing { placements, efficiency: scale * scale * area, density: scale * resolution * per_unit })
}

/// Checks the options and gives the distance from the border, in units of the page.
fn check(options: &PackOptions) -> Result<f64, PackError> {
    let PackOptions { padding, resolution, density, .. } = *options;
    if resolution == 0 {
        return Err(PackError::Resolution);
    }
    let border = 0.5 * padding / f64::from(resolution);
    if !(padding >= 0.0 && border < 0.5) {
        return Err(PackError::Padding { padding, resolution });
    }
    match density {
        Some(d) if !(d > 0.0 && d.is_finite()) => Err(PackError::Density(d)),
        _ => Ok(border),
    }
}
