//! The picture of a deformation: rest, start and result side by side.

use super::{DeformInput, Deformation, Extras};
use crate::preview::{Camera, Image, Model, Scene, Style, render};
use proxel_mesh::topology::{boundary_surface, face_edges, surface, tet_edges};

/// Size of a panel.
const PANEL: [usize; 2] = [720, 640];

/// Rest, start (where it is not the rest shape) and result; pins are red, the result has the colours
/// of its energy density, square root, on a scale that most of it fills.
///
/// A mesh with edges and triangles both has its edges drawn as cables, one of triangles beside tetrahedra its boundary too,
/// if `mixed`.
pub fn draw_deformation(input: &DeformInput, mixed: bool, result: &Deformation, extras: &Extras) -> Image {
    let mut triangles = surface(&input.rest).fan_triangles();
    if mixed && !input.rest.faces.is_empty() {
        triangles.extend(boundary_surface(&input.rest.tets));
    }
    let pins: Vec<u32> = input.fixed.iter().map(|f| f.0).collect();
    let model = |points: &[[f64; 3]]| Model::new(points.to_vec(), triangles.clone());
    let mut scenes = vec![model(&input.rest.points).pinned(pins.iter().copied())];
    if result.start != input.rest.points {
        scenes.push(model(&result.start).pinned(pins.iter().copied()));
    }
    let strain = vertex_strain(input, extras);
    scenes.push(model(&result.positions).colored_by(&strain).pinned(pins));
    let mut scenes: Vec<Scene> = scenes.into_iter().map(|m| Scene { models: vec![m] }).collect();
    if mixed && !input.rest.edges.is_empty() {
        let starts = (scenes.len() == 3).then_some(&result.start);
        let positions = [Some(&input.rest.points), starts, Some(&result.positions)];
        for (scene, points) in scenes.iter_mut().zip(positions.into_iter().flatten()) {
            scene.models.push(cables(points, &input.rest.edges));
        }
    }
    render(&scenes, &Camera::default(), &Style::default(), PANEL[0] * scenes.len(), PANEL[1])
}

/// How thick a cable is drawn, in units of the size of all.
const CABLE: f64 = 0.006;

/// Edges as thin prisms of six sides.
fn cables(points: &[[f64; 3]], edges: &[[u32; 2]]) -> Model {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for p in points {
        for d in 0..3 {
            (low[d], high[d]) = (low[d].min(p[d]), high[d].max(p[d]));
        }
    }
    let radius = CABLE * (0..3).map(|d| high[d] - low[d]).fold(0.0, f64::max);
    let (mut corners, mut triangles) = (Vec::new(), Vec::new());
    for edge in edges {
        let ends = edge.map(|v| points[v as usize]);
        let along = [0, 1, 2].map(|d| ends[1][d] - ends[0][d]);
        // Across: away from the axis that the edge is least along.
        let least = (0..3).min_by(|a, b| along[*a].abs().total_cmp(&along[*b].abs())).unwrap_or(0);
        let axis = [0, 1, 2].map(|d| f64::from(u8::from(d == least)));
        let u = unit(cross(along, axis));
        let v = unit(cross(along, u));
        let first = corners.len() as u32;
        for k in 0..6 {
            let (s, c) = (f64::from(k) * std::f64::consts::FRAC_PI_3).sin_cos();
            for end in ends {
                corners.push([0, 1, 2].map(|d| end[d] + radius * (c * u[d] + s * v[d])));
            }
        }
        for k in 0..6 {
            let (a, b) = (first + 2 * k, first + 2 * ((k + 1) % 6));
            triangles.extend([[a, b, a + 1], [b, b + 1, a + 1]]);
        }
    }
    Model::new(corners, triangles)
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = a.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    a.map(|x| x / length)
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
    // Springs on the edges of faces have densities of edges.
    let springs = if mesh.tets.is_empty() { face_edges(&mesh.faces) } else { tet_edges(&mesh.tets) };
    if springs.len() == extras.energy_density.len() {
        springs.iter().zip(&extras.energy_density).for_each(|(e, &d)| add(e, d));
    } else if mesh.tets.len() == extras.energy_density.len() {
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
