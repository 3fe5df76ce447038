//! A chart with the rest shapes of its triangles in the plane, and what is measured on it.

use super::metric::Stretch;
use rayon::prelude::*;
use std::sync::Arc;

/// A triangle whose height is less than this part of its longest side has no shape in f64.
const THIN: f64 = 1e-10;

/// What is added to the sides of such a triangle, in mean edges of the chart.
const PADDING: f64 = 1e-4;

/// How much a stand-in counts in what is minimised: enough to keep it from flipping, too little to be seen in the map.
const STAND_IN: f64 = 1e-6;

/// Triangles summed by one task.
const CHUNK: usize = 4096;

/// A connected, oriented surface with a border, scaled to area 1.
pub struct Flat<'a> {
    /// Its vertices in space, in the user's units.
    pub points: &'a [[f64; 3]],
    /// Its triangles.
    pub triangles: &'a [[u32; 3]],
    /// Its border, longest loop first.
    pub loops: &'a [Vec<u32>],
    /// Rest edges from corner 0, as columns, each triangle in a frame of its own.
    pub shapes: Arc<[[[f64; 2]; 2]]>,
    /// Triangles that have no shape of their own in space and were given a small one; sorted. They count in no energy.
    pub degenerate: Vec<u32>,
    /// Length of a unit of the user's in units of the shapes: 1 / sqrt(area).
    pub scale: f64,
}

impl<'a> Flat<'a> {
    /// None where the chart has no area.
    pub fn new(points: &'a [[f64; 3]], triangles: &'a [[u32; 3]], loops: &'a [Vec<u32>]) -> Option<Self> {
        Self::stretched(points, triangles, loops, None)
    }

    /// With the lengths, and so the area, that target metrics ask for.
    pub(super) fn stretched(
        points: &'a [[f64; 3]],
        triangles: &'a [[u32; 3]],
        loops: &'a [Vec<u32>],
        metric: Option<&[Stretch]>,
    ) -> Option<Self> {
        let shape = |(t, triangle): (usize, &[u32; 3])| Shape::of(points, *triangle, metric.map(|m| &m[t]));
        let raw: Vec<Shape> = triangles.par_iter().enumerate().with_min_len(CHUNK).map(shape).collect();
        let degenerate: Vec<u32> = (0..raw.len() as u32).filter(|t| raw[*t as usize].is_thin()).collect();
        let area: f64 = raw.iter().filter(|s| !s.is_thin()).map(Shape::area).sum();
        let scale = area.sqrt().recip();
        if !(scale.is_finite() && scale > 0.0) {
            return None;
        }
        let mean = raw.iter().map(|s| s.sides.iter().sum::<f64>()).sum::<f64>() / (3 * raw.len().max(1)) as f64;
        let mut shapes: Vec<[[f64; 2]; 2]> = raw.iter().map(|s| s.columns.map(|row| row.map(|v| v * scale))).collect();
        for t in &degenerate {
            let sides = raw[*t as usize].sides.map(|side| side + PADDING * mean);
            shapes[*t as usize] = from_sides(sides).map(|row| row.map(|v| v * scale));
        }
        Some(Flat { points, triangles, loops, shapes: shapes.into(), degenerate, scale })
    }

    /// How much each triangle counts in what is minimised; none where all count alike.
    pub(super) fn counted(&self, weights: Option<&[f64]>) -> Option<Vec<f64>> {
        if self.degenerate.is_empty() {
            return weights.map(<[f64]>::to_vec);
        }
        let mut counted = weights.map_or_else(|| vec![1.0; self.triangles.len()], <[f64]>::to_vec);
        for t in &self.degenerate {
            counted[*t as usize] *= STAND_IN;
        }
        Some(counted)
    }

    /// Whether a triangle has a shape of its own, so that it counts in energies.
    pub fn counts(&self, t: usize) -> bool {
        self.degenerate.is_empty() || self.degenerate.binary_search(&(t as u32)).is_err()
    }
}

/// A triangle in a frame of its own.
struct Shape {
    columns: [[f64; 2]; 2],
    sides: [f64; 3], // |b - a|, |c - a|, |c - b|
}

impl Shape {
    fn of(points: &[[f64; 3]], t: [u32; 3], metric: Option<&Stretch>) -> Self {
        let [a, b, c] = t.map(|v| points[v as usize]);
        let minus = |p: [f64; 3], q: [f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
        let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
        let [e, f, g] = [minus(b, a), minus(c, a), minus(c, b)].map(|e| metric.map_or(e, |m| m.apply(e)));
        let cross = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
        let sides = [e, f, g].map(|e| dot(e, e).sqrt());
        let columns = match sides[0] > 0.0 {
            true => [[sides[0], dot(e, f) / sides[0]], [0.0, dot(cross, cross).sqrt() / sides[0]]],
            false => [[0.0; 2]; 2],
        };
        Shape { columns, sides }
    }

    fn area(&self) -> f64 {
        0.5 * self.columns[0][0] * self.columns[1][1]
    }

    /// A NaN is thin too.
    fn is_thin(&self) -> bool {
        let longest = self.sides.iter().fold(0.0, |m: f64, s| m.max(*s));
        let enough = 2.0 * self.area() > THIN * longest * longest;
        !enough
    }
}

/// The triangle with the sides |b - a|, |c - a|, |c - b|, which obey the triangle inequality.
fn from_sides([ab, ac, bc]: [f64; 3]) -> [[f64; 2]; 2] {
    let x = (ab * ab + ac * ac - bc * bc) / (2.0 * ab);
    [[ab, x], [0.0, (ac * ac - x * x).max(0.0).sqrt()]]
}

/// Triangles that are not counter-clockwise, by exact arithmetic.
pub fn flips(triangles: &[[u32; 3]], uv: &[[f64; 2]]) -> usize {
    let flipped = |t: &&[u32; 3]| {
        let [a, b, c] = t.map(|v| uv[v as usize]).map(|p| robust::Coord { x: p[0], y: p[1] });
        // A NaN is a flip too.
        let sound = robust::orient2d(a, b, c) > 0.0;
        !sound
    };
    triangles.par_iter().with_min_len(CHUNK).filter(flipped).count()
}

/// (1/4) sum A (|J|^2 + |J^-1|^2) / sum A of a map in units of the shapes, over triangles with a shape of their own: the
/// normalised symmetric Dirichlet energy, 1 at an isometry, with |det J| where a triangle is flipped.
pub fn symmetric_dirichlet(chart: &Flat<'_>, uv: &[[f64; 2]]) -> f64 {
    let [square, inverse, area] = sums(chart, uv);
    0.25 * (square + inverse) / area
}

/// The factor of the map that makes its symmetric Dirichlet energy least; 1 where there is none.
pub fn best_scale(chart: &Flat<'_>, uv: &[[f64; 2]]) -> f64 {
    let [square, inverse, _] = sums(chart, uv);
    let factor = (inverse / square).powf(0.25);
    if factor.is_finite() && factor > 0.0 { factor } else { (2.0 / square).sqrt().clamp(f64::MIN_POSITIVE, f64::MAX) }
}

/// The columns of J = [q - p, r - p] [[a, b], [0, d]]^-1, of the map from a triangle with these edges (as columns) to these
/// corners.
pub(super) fn jacobian([[a, b], [_, d]]: [[f64; 2]; 2], [p, q, r]: [[f64; 2]; 3]) -> [[f64; 2]; 2] {
    let first = [(q[0] - p[0]) / a, (q[1] - p[1]) / a];
    let second = [(r[0] - p[0] - b * first[0]) / d, (r[1] - p[1] - b * first[1]) / d];
    [first, second]
}

/// sum A |J|^2, sum A |J^-1|^2, sum A.
fn sums(chart: &Flat<'_>, uv: &[[f64; 2]]) -> [f64; 3] {
    let of_chunk = |c: usize| {
        let range = c * CHUNK..((c + 1) * CHUNK).min(chart.triangles.len());
        let mut sums = [0.0; 3];
        for t in range.filter(|t| chart.counts(*t)) {
            let shape = chart.shapes[t];
            let area = 0.5 * shape[0][0] * shape[1][1];
            let [first, second] = jacobian(shape, chart.triangles[t].map(|v| uv[v as usize]));
            let square = first[0] * first[0] + first[1] * first[1] + second[0] * second[0] + second[1] * second[1];
            let det = first[0] * second[1] - first[1] * second[0];
            sums[0] += area * square;
            sums[1] += area * square / (det * det);
            sums[2] += area;
        }
        sums
    };
    let parts: Vec<[f64; 3]> = (0..chart.triangles.len().div_ceil(CHUNK)).into_par_iter().map(of_chunk).collect();
    parts.iter().fold([0.0; 3], |s, p| [s[0] + p[0], s[1] + p[1], s[2] + p[2]])
}
