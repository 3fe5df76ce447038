//! Why charts cannot be packed.

use std::fmt;

/// A refusal, in one line with what is wrong and what to do.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum PackError {
    /// The page has no pixels.
    Resolution,
    /// The padding is negative, no number, or as wide as the page.
    Padding {
        /// In pixels.
        padding: f64,
        /// Pixels along each side of the page.
        resolution: u32,
    },
    /// The density is not positive and finite.
    Density(f64),
    /// A density is given for charts that are all without area.
    NoArea,
    /// A chart has no triangles.
    NoTriangles {
        /// 0-based.
        chart: usize,
    },
    /// A triangle names a vertex that its chart does not have.
    Index {
        /// 0-based.
        chart: usize,
        /// 0-based within the chart.
        triangle: usize,
    },
    /// A coordinate is NaN, infinite, or so large that an area overflows.
    NonFinite {
        /// 0-based.
        chart: usize,
        /// 0-based within the chart.
        vertex: usize,
    },
    /// A rest area is negative or not finite.
    RestArea {
        /// 0-based.
        chart: usize,
    },
    /// At this density the charts do not fit the page.
    DensityTooHigh {
        /// Texels per unit of length, as asked for.
        density: f64,
        /// Texels per unit of length at which they fit.
        most: f64,
    },
    /// The padding around so many charts takes the whole page.
    NoRoom {
        /// Their number.
        charts: usize,
        /// In pixels.
        padding: f64,
    },
}

impl fmt::Display for PackError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            PackError::Resolution => write!(f, "a page of 0 pixels; give a positive resolution"),
            PackError::Padding { padding, resolution } => write!(
                f,
                "a padding of {padding} pixels on a page of {resolution}; give a number from 0 to below the resolution"
            ),
            PackError::Density(d) => {
                write!(f, "a density of {d} texels per unit of length; give a positive number or none")
            }
            PackError::NoArea => write!(f, "a density is given, but no chart has an area; pack without a density"),
            PackError::NoTriangles { chart } => write!(f, "chart {chart} (0-based): it has no triangles; leave it out"),
            PackError::Index { chart, triangle } => write!(
                f,
                "chart {chart} (0-based): triangle {triangle} (0-based) has a vertex that is out of range; correct it"
            ),
            PackError::NonFinite { chart, vertex } => write!(
                f,
                "chart {chart} (0-based): vertex {vertex} (0-based) has a coordinate that is no number of usable size; \
                 correct it"
            ),
            PackError::RestArea { chart } => {
                write!(f, "chart {chart} (0-based): its rest area is negative or no number; correct it")
            }
            PackError::DensityTooHigh { density, most } => write!(
                f,
                "at {density} texels per unit of length the charts do not fit the page; lower the density to {most:.6} \
                 or raise the resolution"
            ),
            PackError::NoRoom { charts, padding } => write!(
                f,
                "a padding of {padding} pixels leaves no room for {charts} charts; lower the padding or raise the \
                 resolution"
            ),
        }
    }
}

impl std::error::Error for PackError {}
