//! The picture of a deformation: rest, start and result side by side.

use proxel::deform::{DeformInput, Deformation, Extras};
use proxel::preview::{Camera, Image, Model, Scene, Style, render};
use proxel_mesh::topology::surface;

/// Size of a panel.
const PANEL: [usize; 2] = [720, 640];

/// Rest, start (where it is not the rest shape) and result; pins are red, the result has the colours
/// of its energy density, square root, on a scale that most of it fills.
pub fn of_deformation(input: &DeformInput, result: &Deformation, extras: &Extras) -> Image {
    let triangles = surface(&input.rest).fan_triangles();
    let pins: Vec<u32> = input.fixed.iter().map(|f| f.0).collect();
    let model = |points: &[[f64; 3]]| Model::new(points.to_vec(), triangles.clone());
    let mut scenes = vec![model(&input.rest.points).pinned(pins.iter().copied())];
    if result.start != input.rest.points {
        scenes.push(model(&result.start).pinned(pins.iter().copied()));
    }
    let strain = vertex_strain(input, extras);
    scenes.push(model(&result.positions).colored_by(&strain).pinned(pins));
    let scenes: Vec<Scene> = scenes.into_iter().map(|m| Scene { models: vec![m] }).collect();
    render(&scenes, &Camera::default(), &Style::default(), PANEL[0] * scenes.len(), PANEL[1])
}

/// The part of the vertices whose colours are told apart; the few beyond it are as bright as can be.
const MOST: f64 = 0.98;

/// sqrt(energy density) of the elements around each vertex, on average, over that of most vertices.
fn vertex_strain(input: &DeformInput, extras: &Extras) -> Vec<f64> {
    let mesh = &input.rest;
    let mut sums = vec![(0.0, 0.0); mesh.n_verts()];
    let mut add = |corners: &[u32], density: f64| {
        for &v in corners.iter().filter(|_| density.is_finite()) {
            let (sum, n) = &mut sums[v as usize];
            *sum += density.max(0.0).sqrt();
            *n += 1.0;
        }
    };
    // Springs have densities of edges, which are not drawn.
    if mesh.tets.len() == extras.energy_density.len() {
        mesh.tets.iter().zip(&extras.energy_density).for_each(|(t, &d)| add(t, d));
    } else if mesh.faces.len() == extras.energy_density.len() {
        mesh.faces.iter().zip(&extras.energy_density).for_each(|(f, &d)| add(f, d));
    }
    let means: Vec<f64> = sums.into_iter().map(|(sum, n)| if n > 0.0 { sum / n } else { 0.0 }).collect();
    let mut sorted = means.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let top = sorted.get((MOST * sorted.len() as f64) as usize).copied().unwrap_or(0.0);
    means.into_iter().map(|m| if top > 0.0 { m / top } else { 0.0 }).collect()
}
