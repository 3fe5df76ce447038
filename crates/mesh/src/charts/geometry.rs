//! Lengths, angles and areas of a surface, free of its units and of where it lies.

use crate::vec3::{V3, add, cross, dot, norm, scale, sub};

/// Positions in units of the largest side of their bounding box, from its corner.
pub(super) struct Metric<'a> {
    points: &'a [V3],
    low: V3,
    unit: f64,
}

/// Lengths are whole numbers of this part of the unit: sums are exact, so that rounding of the coordinates (by their
/// units, by an offset) does not choose between paths that are equally long, as on every symmetric mesh.
const QUANTA: f64 = (1u32 << 24) as f64;

impl<'a> Metric<'a> {
    /// Measures by the vertices that are `used`.
    pub fn new(points: &'a [V3], used: impl Iterator<Item = u32>) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for v in used {
            let p = points[v as usize];
            for c in 0..3 {
                low[c] = low[c].min(p[c]);
                high[c] = high[c].max(p[c]);
            }
        }
        // Halved, so that the largest coordinates do not overflow.
        let half = (0..3).map(|c| 0.5 * high[c] - 0.5 * low[c]).fold(0.0, f64::max);
        Metric { points, low, unit: if half > 0.0 { half } else { 1.0 } }
    }

    /// The position of a vertex, in [0, 2]^3.
    pub fn at(&self, v: u32) -> V3 {
        let p = self.points[v as usize];
        // Far from overflow the difference is formed first: it is what an offset does not change.
        [0, 1, 2].map(|c| match p[c] - self.low[c] {
            d if d.is_finite() => d / self.unit,
            _ => p[c] / self.unit - self.low[c] / self.unit,
        })
    }

    /// The distance of two vertices.
    pub fn length(&self, a: u32, b: u32) -> f64 {
        norm(sub(self.at(a), self.at(b)))
    }

    /// The area vector of a polygon (Newell): its direction is the normal.
    pub fn normal(&self, polygon: &[u32]) -> V3 {
        let Some(&first) = polygon.first() else { return [0.0; 3] };
        let o = self.at(first);
        let corner = |&v: &u32| sub(self.at(v), o);
        let fan = polygon.windows(2).map(|w| cross(corner(&w[0]), corner(&w[1])));
        scale(0.5, fan.fold([0.0; 3], add))
    }

    /// The area of a triangle.
    pub fn area(&self, t: [u32; 3]) -> f64 {
        norm(self.normal(&t))
    }
}

/// A length as a whole number, at least 1: paths of fewer edges win among those of no length.
pub(super) fn quantized(length: f64) -> u64 {
    ((length * QUANTA).round() as u64).max(1)
}

/// The cosine of the angle between two vectors; 1 where one of them is zero.
pub(super) fn cosine(a: V3, b: V3) -> f64 {
    let n = norm(a) * norm(b);
    if n > 0.0 { (dot(a, b) / n).clamp(-1.0, 1.0) } else { 1.0 }
}
