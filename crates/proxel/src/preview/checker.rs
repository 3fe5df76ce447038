//! A checkerboard on a surface, by its UV map.

use super::distortion::FLIPPED;
use super::vec::{V3, add, cross, direction, dot, scale, sub};
use super::{Camera, Image, Model, Scene, Style, render};

/// Texture coordinates of a model, drawn as squares of two colours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Checker {
    /// The coordinates of the corners of each triangle of the model.
    pub uv: Vec<[[f64; 2]; 3]>,
    /// The edge of a square, in the units of `uv`.
    pub edge: f64,
}

const LIGHT: [f32; 3] = [0.96, 0.94, 0.90];
const DARK: [f32; 3] = [0.22, 0.42, 0.62];

impl Checker {
    /// Squares such that about `across` of them, were the map an isometry, span the diagonal of the body.
    pub fn new(points: &[[f64; 3]], triangles: &[[u32; 3]], uv: Vec<[[f64; 2]; 3]>, across: f64) -> Self {
        let (mut lo, mut hi) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let (mut rest, mut mapped) = (0.0, 0.0);
        for (t, uv) in triangles.iter().zip(&uv) {
            let [Some(a), Some(b), Some(c)] = t.map(|v| points.get(v as usize)) else { continue };
            let n = cross(sub(*b, *a), sub(*c, *a));
            let plane = (uv[1][0] - uv[0][0]) * (uv[2][1] - uv[0][1]) - (uv[1][1] - uv[0][1]) * (uv[2][0] - uv[0][0]);
            if !(plane.is_finite() && dot(n, n).is_finite()) {
                continue;
            }
            (rest, mapped) = (rest + dot(n, n).sqrt(), mapped + plane.abs());
            for p in [a, b, c] {
                lo = [0, 1, 2].map(|k| lo[k].min(p[k]));
                hi = [0, 1, 2].map(|k| hi[k].max(p[k]));
            }
        }
        let size = sub(hi, lo);
        let edge = dot(size, size).sqrt() / across * f64::sqrt(mapped / rest);
        Checker { uv, edge: if edge > 0.0 && edge.is_finite() { edge } else { 1.0 } }
    }

    /// The sRGB colour of triangle `i` at barycentric coordinates `w`: that of the square, in flipped triangles
    /// [`FLIPPED`] in its place of the lighter one. `None` without coordinates.
    pub(super) fn color(&self, i: usize, w: [f64; 3]) -> Option<[f32; 3]> {
        let [a, b, c] = *self.uv.get(i)?;
        let square = |k: usize| ((w[0] * a[k] + w[1] * b[k] + w[2] * c[k]) / self.edge).floor();
        let dark = (square(0) + square(1)).rem_euclid(2.0) >= 1.0;
        let flipped = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) < 0.0;
        Some(match (dark, flipped) {
            (true, _) => DARK,
            (false, true) => FLIPPED,
            (false, false) => LIGHT,
        })
    }
}

/// About how many squares span the body.
const ACROSS: f64 = 48.0;
/// Squares are small, and their edges are what the picture shows.
const SAMPLES: usize = 4;

/// Draws a surface with a checkerboard from the front and from behind, side by side.
pub fn draw_checkerboard(
    points: &[[f64; 3]],
    triangles: &[[u32; 3]],
    uv: &[[[f64; 2]; 3]],
    camera: &Camera,
    width: usize,
    height: usize,
) -> Image {
    let checker = Checker::new(points, triangles, uv.to_vec(), ACROSS);
    let front = Model { checker: Some(checker), ..Model::new(points.to_vec(), triangles.to_vec()) };
    let mut back = front.clone();
    half_turn(&mut back.points, camera.up);
    let style = Style { samples: SAMPLES, ..Style::default() };
    let scenes = [front, back].map(|m| Scene { models: vec![m] });
    render(&scenes, camera, &style, width, height)
}

/// Turns points by 180 degrees around an upright line through the middle of their box.
pub(super) fn half_turn(points: &mut [V3], up: V3) {
    let up = direction(up, [0.0, 1.0, 0.0]);
    let (mut lo, mut hi) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in points.iter().filter(|p| p.iter().all(|c| c.is_finite())) {
        lo = [0, 1, 2].map(|k| lo[k].min(p[k]));
        hi = [0, 1, 2].map(|k| hi[k].max(p[k]));
    }
    let middle = [0, 1, 2].map(|k| 0.5 * lo[k] + 0.5 * hi[k]);
    for p in points {
        let d = sub(*p, middle);
        *p = add(middle, sub(scale(2.0 * dot(d, up), up), d));
    }
}
