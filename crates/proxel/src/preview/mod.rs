//! Pictures of meshes: a small software renderer, the same bits on every machine and thread count.
//!
//! Scenes stand side by side under one camera and at one scale. Light is a key light with a soft
//! shadow, a sky whose occlusion is worked out for every vertex, and a weak fill from the side.
//!
//! ```no_run
//! use proxel::preview::{Camera, Model, Scene, Style, render};
//! # let (points, triangles) = (vec![[0.0; 3]; 3], vec![[0, 1, 2]]);
//! let scene = Scene { models: vec![Model::new(points, triangles)] };
//! let image = render(&[scene], &Camera::default(), &Style::default(), 800, 600);
//! image.write_png("picture.png".as_ref())?;
//! # Ok::<(), proxel_mesh::MeshError>(())
//! ```

mod camera;
mod checker;
mod color;
mod contours;
mod distortion;
mod image;
mod light;
mod lines;
mod normals;
mod raster;
mod shade;
#[cfg(test)]
mod tests;
mod uv_map;
#[cfg(test)]
mod uv_tests;
mod vec;

pub use camera::Camera;
pub use checker::{Checker, draw_checkerboard};
pub use color::{PIN_RED, SAND, blend, colour_map};
pub use contours::{Contours, draw_distances};
pub use distortion::{FLIPPED, heat_map, singular_values, stretch_color, stretches};
pub use image::{Image, animate_pngs};
pub use uv_map::{UvPicture, draw_uv_map};

use camera::{Frame, View};
use normals::corner_normals;
use rayon::prelude::*;
use shade::Shader;
use vec::V3;

/// A triangle mesh with colours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// Vertex positions in any units.
    pub points: Vec<[f64; 3]>,
    /// Counter-clockwise seen from outside; both sides are drawn.
    pub triangles: Vec<[u32; 3]>,
    /// sRGB in [0, 1], one for each vertex; missing ones are [`SAND`].
    pub colors: Vec<[f32; 3]>,
    /// Texture coordinates, instead of colours.
    pub checker: Option<Checker>,
    /// A function of the vertices, instead of colours.
    pub contours: Option<Contours>,
}

impl Model {
    /// A model in the default colour.
    pub fn new(points: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> Self {
        Model { points, triangles, colors: Vec::new(), checker: None, contours: None }
    }

    /// Colours the vertices by numbers in [0, 1] (see [`colour_map`]).
    #[must_use]
    pub fn colored_by(mut self, values: &[f64]) -> Self {
        self.colors = values.iter().map(|&t| colour_map(t)).collect();
        self
    }

    /// Tints vertices red: those that are pinned.
    #[must_use]
    pub fn pinned(mut self, vertices: impl IntoIterator<Item = u32>) -> Self {
        self.colors.resize(self.points.len(), SAND);
        for v in vertices {
            if let Some(c) = self.colors.get_mut(v as usize) {
                *c = blend(*c, PIN_RED, 0.85);
            }
        }
        self
    }
}

/// What stands in one panel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// All that is drawn, in any order.
    pub models: Vec<Model>,
}

/// How it is drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Style {
    /// Samples of a pixel along each side.
    pub samples: usize,
    /// Whether there is a ground that takes shadows, below the lowest point.
    pub ground: bool,
    /// Above this angle between two faces, in degrees, their edge is sharp.
    pub crease: f64,
    /// sRGB of the background at the top and at the bottom.
    pub background: [[f32; 3]; 2],
}

impl Default for Style {
    fn default() -> Self {
        Style { samples: 3, ground: true, crease: 50.0, background: [[0.975, 0.98, 0.985], [0.875, 0.895, 0.92]] }
    }
}

/// All models of a scene as one, centred and scaled so that all scenes fit a ball of radius 1.
struct Body {
    points: Vec<V3>,
    triangles: Vec<[u32; 3]>,
    normals: Vec<[V3; 3]>,                   // of the corners of each triangle
    albedo: Vec<[f32; 3]>,                   // linear
    checkers: Vec<(usize, Checker)>,         // each with its first triangle
    contours: Vec<(usize, usize, Contours)>, // each with its first triangle and its first vertex
}

impl Body {
    fn new(scene: &Scene, frame: &Frame, crease: f64) -> Self {
        let (mut points, mut triangles, mut albedo) = (Vec::new(), Vec::new(), Vec::new());
        let (mut checkers, mut contours) = (Vec::new(), Vec::new());
        for model in &scene.models {
            let first = points.len() as u32;
            points.extend(model.points.iter().map(|&p| frame.inward(p)));
            let colour = |v: usize| model.colors.get(v).copied().unwrap_or(SAND).map(color::to_linear);
            albedo.extend((0..model.points.len()).map(colour));
            // What cannot be drawn is left out: bad indices, coordinates that are not finite.
            let drawable = |t: &&[u32; 3]| {
                let at = |v: &u32| model.points.get(*v as usize);
                t.iter().all(|v| at(v).is_some_and(|p| p.iter().all(|c| c.is_finite())))
            };
            if let Some(checker) = &model.checker {
                let kept = model.triangles.iter().zip(&checker.uv).filter(|(t, _)| drawable(t)).map(|(_, uv)| *uv);
                checkers.push((triangles.len(), Checker { uv: kept.collect(), edge: checker.edge }));
            }
            if let Some(c) = &model.contours {
                contours.push((triangles.len(), first as usize, c.clone()));
            }
            triangles.extend(model.triangles.iter().filter(drawable).map(|t| t.map(|v| v + first)));
        }
        let normals = corner_normals(&points, &triangles, crease);
        Body { points, triangles, normals, albedo, checkers, contours }
    }

    /// The linear colour of triangle `i` at barycentric coordinates `w`.
    fn albedo(&self, i: usize, w: [f64; 3]) -> [f32; 3] {
        let last = self.checkers.partition_point(|(first, _)| *first <= i).checked_sub(1);
        let checker = last.map(|k| &self.checkers[k]);
        if let Some(color) = checker.and_then(|(first, checker)| checker.color(i - first, w)) {
            return color.map(color::to_linear);
        }
        let t = self.triangles[i];
        let last = self.contours.partition_point(|(first, ..)| *first <= i).checked_sub(1);
        let contours = last.map(|k| &self.contours[k]);
        let color = contours.and_then(|(_, first, contours)| contours.color(t.map(|v| v as usize - first), w));
        if let Some(color) = color {
            return color.map(color::to_linear);
        }
        [0, 1, 2].map(|c| (0..3).map(|k| w[k] as f32 * self.albedo[t[k] as usize][c]).sum())
    }
}

/// Draws the scenes side by side into a picture of `width` x `height` pixels, all under one camera
/// that is moved so far away that each fits its panel.
pub fn render(scenes: &[Scene], camera: &Camera, style: &Style, width: usize, height: usize) -> Image {
    let models = || scenes.iter().flat_map(|s| &s.models);
    let frame = Frame::around(models().flat_map(|m| m.points.iter().copied()));
    let panels = scenes.len().max(1);
    let samples = style.samples.clamp(1, 8);
    let bodies: Vec<Body> = scenes.iter().map(|s| Body::new(s, &frame, style.crease)).collect();
    let edges: Vec<usize> = (0..=panels).map(|i| i * width / panels).collect();
    let narrowest = edges.windows(2).map(|w| w[1] - w[0]).min().unwrap_or(width);
    let view = View::framing(camera, bodies.iter().map(|b| &b.points[..]), narrowest, height);
    let mut image = Image::filled(width, height, style.background);
    for (i, body) in bodies.iter().enumerate() {
        let panel = edges[i + 1] - edges[i];
        let view = view.resized(panel * samples, height * samples);
        let shader = Shader::new(body, &view, style);
        let rows: Vec<Vec<[u8; 3]>> = (0..height).into_par_iter().map(|y| shader.row(y, panel, samples)).collect();
        for (y, row) in rows.iter().enumerate() {
            image.put_row(edges[i], y, row);
        }
    }
    image
}
