//! A function on a surface as colours and isolines.

use super::checker::half_turn;
use super::color::{blend, colour_map};
use super::{Camera, Image, Model, Scene, Style, render};

/// A number for each vertex, drawn as a colour with lines at equal steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contours {
    /// The numbers; triangles with one that is not finite are grey.
    pub values: Vec<f64>,
    /// The values that the first and the last colour stand for.
    pub range: [f64; 2],
    /// From one line to the next.
    pub step: f64,
}

/// Part of a step that a line covers.
const LINE: f64 = 0.14;

/// Colour of the lines.
const INK: [f32; 3] = [0.10, 0.11, 0.20];

impl Contours {
    /// The sRGB colour at barycentric coordinates `w` of a triangle of these corners; `None` where one has no number.
    pub(super) fn color(&self, corners: [usize; 3], w: [f64; 3]) -> Option<[f32; 3]> {
        let [Some(a), Some(b), Some(c)] = corners.map(|v| self.values.get(v)) else { return None };
        let value = w[0] * a + w[1] * b + w[2] * c;
        if !value.is_finite() {
            return Some(colour_map(f64::NAN));
        }
        let extent = self.range[1] - self.range[0];
        let color = colour_map(if extent > 0.0 { (value - self.range[0]) / extent } else { 0.0 });
        let phase = (value / self.step).rem_euclid(1.0);
        Some(if phase < LINE { blend(color, INK, 0.75) } else { color })
    }
}

/// Lines from the least to the largest value.
const LINES: f64 = 24.0;

/// Lines are thin, and what the picture shows.
const SAMPLES: usize = 4;

/// Draws a surface with distances as colours and isolines, from the front and from behind, side by side.
pub fn draw_distances(
    points: &[[f64; 3]],
    triangles: &[[u32; 3]],
    distance: &[f64],
    width: usize,
    height: usize,
) -> Image {
    let finite = || distance.iter().copied().filter(|d| d.is_finite());
    let range = [finite().fold(0.0, f64::min), finite().fold(0.0, f64::max)];
    let step = (range[1] - range[0]) / LINES;
    let contours = Contours { values: distance.to_vec(), range, step: if step > 0.0 { step } else { 1.0 } };
    let front = Model { contours: Some(contours), ..Model::new(points.to_vec(), triangles.to_vec()) };
    let mut back = front.clone();
    let camera = Camera::default();
    half_turn(&mut back.points, camera.up);
    let style = Style { samples: SAMPLES, ..Style::default() };
    render(&[front, back].map(|m| Scene { models: vec![m] }), &camera, &style, width, height)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_colours() {
        let c = Contours { values: vec![0.0, 1.0, 1.0, f64::INFINITY], range: [0.0, 1.0], step: 0.25 };
        let at = |t: f64| c.color([0, 1, 2], [1.0 - t, t, 0.0]);
        assert_eq!(at(0.4), Some(colour_map(0.4)));
        assert_eq!(at(0.51), Some(blend(colour_map(0.51), INK, 0.75)));
        assert_eq!(c.color([0, 1, 3], [0.5, 0.25, 0.25]), Some(colour_map(f64::NAN)));
        assert_eq!(c.color([0, 1, 4], [0.5, 0.25, 0.25]), None);
    }
}
