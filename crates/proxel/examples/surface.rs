//! A surface without tetrahedra: two balls that overlap, with a hole, bent as one body and written as animated glTF.
//!
//! `cargo run --release -p proxel --example surface [OUT.glb]`

use proxel::deform::{DeformInput, Hooks, deform};
use proxel::mesh::{Fields, Frame, Mesh, Polygons, write_series};
use proxel::settings::DeformSettings;
use std::f64::consts::PI;

/// A ball of n x 2n quads around (x, 0, 0); the first `open` rings of faces at its upper pole are left out.
fn add_ball(mesh: &mut Mesh, n: usize, x: f64, open: usize) {
    let first = mesh.points.len();
    for i in 0..=n {
        for j in 0..2 * n {
            let ((s, c), (t, u)) = ((PI * i as f64 / n as f64).sin_cos(), (PI * j as f64 / n as f64).sin_cos());
            mesh.points.push([x + s * u, s * t, c]);
        }
    }
    let v = |i: usize, j: usize| (first + 2 * n * i + j % (2 * n)) as u32;
    for i in open..n {
        for j in 0..2 * n {
            // At the poles a quad is a triangle.
            match i {
                0 => mesh.faces.push(&[v(0, j), v(1, j), v(1, j + 1)]),
                i if i + 1 == n => mesh.faces.push(&[v(i, j), v(i + 1, j), v(i, j + 1)]),
                _ => mesh.faces.push(&[v(i, j), v(i + 1, j), v(i + 1, j + 1), v(i, j + 1)]),
            }
        }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut rest = Mesh { name: "two-balls".into(), faces: Polygons::new(), ..Mesh::default() };
    add_ball(&mut rest, 16, -0.7, 0);
    add_ball(&mut rest, 16, 0.7, 2);

    // The left end stays; the right end is turned by 60 degrees around y.
    let mut used = vec![false; rest.n_verts()];
    rest.faces.indices().iter().for_each(|&v| used[v as usize] = true);
    let (sin, cos) = 60f64.to_radians().sin_cos();
    let mut fixed = Vec::new();
    for (v, &[x, y, z]) in rest.points.iter().enumerate().filter(|(v, _)| used[*v]) {
        if x < -1.4 {
            fixed.push((v as u32, [x, y, z]));
        } else if x > 1.4 {
            fixed.push((v as u32, [cos * x + sin * z, y, cos * z - sin * x]));
        }
    }
    let input = DeformInput { rest, fixed, ..DeformInput::default() };
    let settings = DeformSettings { resolution: 16, ..DeformSettings::default() };
    let result = deform(&input, &settings, &mut Hooks::default())?;

    let report = &result.report;
    let lattice = report.lattice.as_ref().ok_or("a closed surface has a lattice")?;
    println!("{} after {} iterations: {}", report.status, report.iterations, report.reason);
    println!(
        "{} tetrahedra, pins off by {:.1e} of the size before they were put in place",
        lattice.tetrahedra, lattice.pin_error
    );
    assert_eq!(report.inverted, Some(0));
    for (v, target) in &input.fixed {
        assert_eq!(result.positions[*v as usize], *target);
    }

    let folder = std::env::temp_dir();
    let out = std::env::args_os().nth(1).map_or_else(|| folder.join("proxel-two-balls.glb"), Into::into);
    let frames = [&input.rest.points, &result.positions].into_iter().enumerate();
    let frames = frames.map(|(i, p)| Ok(Frame { time: i as f64, points: p.clone(), fields: Fields::none() }));
    write_series(&out, &input.rest, frames)?;
    println!("wrote {}", out.display());
    Ok(())
}
