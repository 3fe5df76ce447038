//! Charts made ready: checked, turned upright, with the edges that bound them.

use rayon::prelude::*;

use super::hull::{P2, convex_hull, orientation, smallest_rectangle, smallest_square, turn};
use super::{PackChart, PackError};

/// A chart whose smallest enclosing rectangle is upright, with its lower left corner in the origin.
pub(super) struct Prepared {
    pub points: Vec<P2>,
    pub triangles: Vec<[u32; 3]>,
    /// Edges that contain the border of the union of all triangles: those without a triangle on either side.
    pub outline: Vec<[u32; 2]>,
    /// Whether it may be turned.
    pub rotate: bool,
    /// Width and height.
    pub size: [f64; 2],
    /// The sum of the areas of the triangles.
    pub area: f64,
    /// The point that was turned about, given minus turned, and cosine and sine of the turn.
    pub middle: P2,
    pub turned: P2,
    /// Of the turned box, relative to the turned middle.
    pub corner: P2,
}

impl Prepared {
    /// All charts; a single one is turned into the smallest square, others into their smallest rectangles.
    pub fn all(charts: &[PackChart<'_>], rotate: bool) -> Result<Vec<Prepared>, PackError> {
        let alone = charts.len() == 1;
        charts.par_iter().enumerate().map(|(i, c)| Prepared::new(i, c, rotate, alone)).collect()
    }

    fn new(index: usize, chart: &PackChart<'_>, rotate: bool, alone: bool) -> Result<Prepared, PackError> {
        check(index, chart)?;
        let at = |v: u32| chart.uv[v as usize];
        let outline = outline(chart);
        let corners = outline.as_flattened().iter().map(|&v| at(v));
        let (lo, hi) = bounds(corners.clone());
        let middle = [0, 1].map(|c| 0.5 * lo[c] + 0.5 * hi[c]);
        let inward = |p: P2| [p[0] - middle[0], p[1] - middle[1]];
        // Every corner of the hull of all is an end of an edge of the outline.
        let hull = convex_hull(corners.map(inward).collect());
        let turned = match (rotate, alone) {
            (false, _) => [1.0, 0.0],
            (true, true) => smallest_square(&hull),
            (true, false) => smallest_rectangle(&hull),
        };
        let (corner, far) = bounds(hull.iter().map(|&p| turn(turned, p)));
        let upright = |&p: &P2| {
            let p = turn(turned, inward(p));
            [p[0] - corner[0], p[1] - corner[1]]
        };
        let points: Vec<P2> = chart.uv.iter().map(upright).collect();
        let area = chart.triangles.iter().map(|t| 0.5 * orientation(at(t[0]), at(t[1]), at(t[2])).abs()).sum();
        Ok(Prepared {
            points,
            triangles: chart.triangles.to_vec(),
            outline,
            rotate,
            size: [far[0] - corner[0], far[1] - corner[1]],
            area,
            middle,
            turned,
            corner,
        })
    }

    /// The longer side of the box.
    pub fn side(&self) -> f64 {
        self.size[0].max(self.size[1])
    }
}

fn check(index: usize, chart: &PackChart<'_>) -> Result<(), PackError> {
    let usable = |p: &P2| p.iter().all(|c| c.abs() < LARGEST);
    if chart.triangles.is_empty() {
        return Err(PackError::NoTriangles { chart: index });
    }
    if let Some(vertex) = chart.uv.iter().position(|p| !usable(p)) {
        return Err(PackError::NonFinite { chart: index, vertex });
    }
    let n = chart.uv.len();
    if let Some(triangle) = chart.triangles.iter().position(|t| t.iter().any(|&v| v as usize >= n)) {
        return Err(PackError::Index { chart: index, triangle });
    }
    if !(chart.rest_area >= 0.0 && chart.rest_area.is_finite()) {
        return Err(PackError::RestArea { chart: index });
    }
    Ok(())
}

/// Coordinates below it have products and sums of 2^32 products that do not overflow.
const LARGEST: f64 = 1e140;

pub(super) fn bounds(points: impl Iterator<Item = P2>) -> (P2, P2) {
    points.fold(([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]), |(lo, hi), p| {
        ([lo[0].min(p[0]), lo[1].min(p[1])], [hi[0].max(p[0]), hi[1].max(p[1])])
    })
}

/// The edges that do not have exactly two triangles, one on each side. Where all edges around a vertex have them, the
/// triangles wind around it and cover its surroundings; so the border of what the triangles cover is made of the
/// edges given here, whatever is flipped, folded or flat.
fn outline(chart: &PackChart<'_>) -> Vec<[u32; 2]> {
    // Each edge with the side of its triangle: left (1) or right (-1) of the edge from the smaller vertex.
    let sides = chart.triangles.iter().flat_map(|&[a, b, c]| {
        let area = orientation(chart.uv[a as usize], chart.uv[b as usize], chart.uv[c as usize]);
        let sign = i8::from(area > 0.0) - i8::from(area < 0.0);
        [[a, b], [b, c], [c, a]].map(|[u, v]| {
            let key = u64::from(u.min(v)) << 32 | u64::from(u.max(v));
            (key, if u < v { sign } else { -sign })
        })
    });
    let mut sides: Vec<(u64, i8)> = sides.collect();
    sides.par_sort_unstable();
    let open = sides.chunk_by(|a, b| a.0 == b.0).filter(|e| !matches!(e, [(_, -1), (_, 1)]));
    open.map(|e| [(e[0].0 >> 32) as u32, e[0].0 as u32]).collect()
}
