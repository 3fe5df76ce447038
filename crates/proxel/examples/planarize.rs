//! A wavy roof of quads whose faces are made planar.
//!
//! `cargo run --release --example planarize`, with a folder as argument to keep the two meshes.

use proxel::deform::Hooks;
use proxel::mesh::{Fields, Mesh, Polygons, write_mesh};
use proxel::shape::{ShapeInput, ShapeSettings, planarize};
use std::path::PathBuf;

/// n x n quads over a saddle with waves.
fn roof(n: usize) -> Mesh {
    let mut points = Vec::new();
    for i in 0..=n {
        for j in 0..=n {
            let [x, y] = [i, j].map(|k| 2.0 * k as f64 / n as f64 - 1.0);
            points.push([x, y, 0.4 * (x * x - y * y) + 0.08 * (5.0 * x + 2.0 * y).sin()]);
        }
    }
    let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
    let mut faces = Polygons::new();
    for i in 0..n {
        for j in 0..n {
            faces.push(&[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    Mesh { name: "roof".to_string(), points, faces, ..Mesh::default() }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let input = ShapeInput { mesh: roof(24), reference: None };
    let shaped = planarize(&input, &ShapeSettings::planarize(), &mut Hooks::default())?;
    println!("{}: {}", shaped.report.status, shaped.report.reason);
    if let Some(shape) = &shaped.report.shape {
        println!("planarity over the mean edge: {:?}", shape.planarity_max);
        println!("mean distance from the roof as it was: {:?}", shape.reference_distance_mean);
    }
    if let Some(folder) = std::env::args_os().nth(1).map(PathBuf::from) {
        write_mesh(&folder.join("roof.obj"), &input.mesh, &Fields::none())?;
        write_mesh(&folder.join("planar.obj"), &input.mesh.with_points(shaped.positions)?, &Fields::none())?;
    }
    Ok(())
}
