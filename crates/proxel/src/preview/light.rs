//! What light reaches where: shadow maps of single directions, and of the whole sky.

use super::Body;
use super::camera::perpendicular;
use super::raster::Buffer;
use super::vec::{V3, add, cross, dot, scale};
use rayon::prelude::*;

/// What a distant light sees.
pub(super) struct ShadowMap {
    axes: [V3; 3], // right, up, toward the light
    buffer: Buffer,
    per_unit: f64, // texels
}

/// Half the edge of the square that a map covers: the bodies fit a ball of radius sqrt 3.
const REACH: f64 = 1.8;

impl ShadowMap {
    /// The map of a light in the direction `to_light`, of `size` x `size` texels.
    pub fn new(body: &Body, to_light: V3, size: usize) -> Self {
        let right = perpendicular(to_light);
        let axes = [right, cross(to_light, right), to_light];
        let per_unit = 0.5 * size as f64 / REACH;
        let place = |p: &V3| {
            // Far below everything is nearness 0; the map is linear, so nearness may be too.
            let q = axes.map(|a| dot(*p, a));
            q.iter().all(|c| c.is_finite()).then(|| [(q[0] + REACH) * per_unit, (q[1] + REACH) * per_unit, q[2] + 4.0])
        };
        let projected: Vec<Option<V3>> = body.points.iter().map(place).collect();
        ShadowMap { axes, buffer: Buffer::draw(size, size, &projected, &body.triangles), per_unit }
    }

    /// The lit part, 0 to 1, of a square of texels around `p`, `radius` texels to each side. Points
    /// within `bias` of the nearest surface count as lit.
    pub fn lit(&self, p: V3, bias: f64, radius: i64) -> f32 {
        let [x, y, z] = self.axes.map(|a| dot(p, a));
        let (x, y) = ((x + REACH) * self.per_unit - 0.5, (y + REACH) * self.per_unit - 0.5);
        let threshold = (z + 4.0 + bias) as f32;
        let (i, j) = (x.floor() as i64, y.floor() as i64);
        let (u, v) = ((x - i as f64) as f32, (y - j as f64) as f32);
        let n = self.buffer.width as i64;
        let mut sum = 0.0;
        for dj in -radius..=radius + 1 {
            // The square has soft ends, so that the shadow moves smoothly between texels.
            let wv = if dj == -radius {
                1.0 - v
            } else if dj == radius + 1 {
                v
            } else {
                1.0
            };
            for di in -radius..=radius + 1 {
                let wu = if di == -radius {
                    1.0 - u
                } else if di == radius + 1 {
                    u
                } else {
                    1.0
                };
                let (tx, ty) = (i + di, j + dj);
                let inside = (0..n).contains(&tx) && (0..n).contains(&ty);
                let dark = inside && self.buffer.nearness[(ty * n + tx) as usize] > threshold;
                sum += if dark { 0.0 } else { wu * wv };
            }
        }
        sum / ((2 * radius + 1) * (2 * radius + 1)) as f32
    }
}

/// Directions of the sky that are tried.
const SKY: usize = 96;
/// Texels of their maps along each side.
const SKY_TEXELS: usize = 384;
/// Cells of the ground along each side, for the sky's soft light.
const SKY_CELLS: usize = 120;

/// How much of the sky is seen, cosine-weighted, 0 to 1: from each vertex along its normal, and from
/// a grid on the ground whose points `ground` gives.
pub(super) fn sky(body: &Body, up: V3, ground: impl Fn(f64, f64) -> V3 + Sync) -> (Vec<f32>, GroundLight) {
    let normals = vertex_normals(body);
    let maps: Vec<(V3, ShadowMap)> =
        (0..SKY).map(|k| sky_direction(k, up)).map(|d| (d, ShadowMap::new(body, d, SKY_TEXELS))).collect();
    let seen = |p: V3, n: V3, bias: f64| {
        let (mut seen, mut all) = (0.0, 0.0);
        for (d, map) in &maps {
            let cosine = dot(n, *d) as f32;
            if cosine > 0.0 {
                all += cosine;
                seen += cosine * map.lit(add(p, scale(bias, n)), bias, 0);
            }
        }
        if all > 0.0 { seen / all } else { 1.0 }
    };
    let vertices = (0..normals.len()).into_par_iter().map(|v| seen(body.points[v], normals[v], 0.012)).collect();
    (vertices, GroundLight::new(SKY_CELLS, |u, v| seen(ground(u, v), up, 0.002)))
}

/// Light on the ground: a grid over (u, v) in [-1, 1]^2.
pub(super) struct GroundLight {
    cells: usize,
    values: Vec<f32>, // (cells + 1)^2, u fastest
}

impl GroundLight {
    /// Works out `light` at every corner of `cells` x `cells` cells.
    pub fn new(cells: usize, light: impl Fn(f64, f64) -> f32 + Sync) -> Self {
        let along = |i: usize| 2.0 * i as f64 / cells as f64 - 1.0;
        let at = |g: usize| light(along(g % (cells + 1)), along(g / (cells + 1)));
        GroundLight { cells, values: (0..(cells + 1) * (cells + 1)).into_par_iter().map(at).collect() }
    }

    /// Between the corners; 1, all light, beyond the grid.
    pub fn at(&self, u: f64, v: f64) -> f32 {
        let n = self.cells as f64;
        let (x, y) = (0.5 * (u + 1.0) * n, 0.5 * (v + 1.0) * n);
        if !(x >= 0.0 && y >= 0.0 && x < n && y < n) {
            return 1.0;
        }
        let (i, j) = (x as usize, y as usize);
        let (a, b) = ((x - i as f64) as f32, (y - j as f64) as f32);
        let at = |i: usize, j: usize| self.values[j * (self.cells + 1) + i];
        (1.0 - b) * ((1.0 - a) * at(i, j) + a * at(i + 1, j)) + b * ((1.0 - a) * at(i, j + 1) + a * at(i + 1, j + 1))
    }
}

/// The k-th of SKY directions spread evenly over the half of the sphere around `up` and a little below
/// it: a Fibonacci lattice.
fn sky_direction(k: usize, up: V3) -> V3 {
    const GOLDEN: f64 = 2.399_963_229_728_653; // radians
    let right = perpendicular(up);
    let forth = cross(up, right);
    let z = 1.0 - 1.25 * (k as f64 + 0.5) / SKY as f64;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (s, c) = (GOLDEN * k as f64).sin_cos();
    add(scale(z, up), add(scale(r * c, right), scale(r * s, forth)))
}

/// One normal for each vertex.
fn vertex_normals(body: &Body) -> Vec<V3> {
    let mut sum = vec![[0.0; 3]; body.points.len()];
    for (t, n) in body.triangles.iter().zip(&body.normals) {
        for k in 0..3 {
            sum[t[k] as usize] = add(sum[t[k] as usize], n[k]);
        }
    }
    sum.into_iter().map(|n| super::vec::direction(n, [0.0; 3])).collect()
}
