//! A picture of a mesh before and after.

use super::FaceErrors;
use crate::preview::{Camera, Image, Model, Scene, Style, render};
use proxel_mesh::Mesh;

/// Size of a panel.
const PANEL: [usize; 2] = [720, 640];

/// Before and after, coloured by the square root of the first error of the faces around each vertex, on one scale.
pub fn draw_shaped(before: &Mesh, after: &Mesh, errors: &[FaceErrors]) -> Image {
    let of = |mesh: &Mesh, errors: &[f64]| {
        let mut worst = vec![0.0_f64; mesh.n_verts()];
        for (face, error) in mesh.faces.iter().zip(errors) {
            face.iter().for_each(|v| worst[*v as usize] = worst[*v as usize].max(*error));
        }
        worst
    };
    let none = FaceErrors { name: String::new(), before: Vec::new(), after: Vec::new() };
    let errors = errors.first().unwrap_or(&none);
    let values = [of(before, &errors.before), of(after, &errors.after)];
    let top = values.iter().flatten().copied().fold(0.0, f64::max);
    let scene = |(mesh, values): (&Mesh, &Vec<f64>)| {
        let colors: Vec<f64> = values.iter().map(|v| if top > 0.0 { (v / top).sqrt() } else { 0.0 }).collect();
        let model = Model::new(mesh.points.clone(), mesh.faces.fan_triangles()).colored_by(&colors);
        Scene { models: vec![model] }
    };
    let scenes: Vec<Scene> = [before, after].into_iter().zip(&values).map(scene).collect();
    render(&scenes, &Camera::default(), &Style::default(), PANEL[0] * scenes.len(), PANEL[1])
}
