//! Generated sheets: grids with random diagonals, bent into shapes that are hard to flatten.

use proxel::mesh::Mesh;
use proxel_testkit::SplitMix;
use std::f64::consts::{PI, TAU};

/// A sheet of about so many faces.
pub(super) fn random(faces: usize, random: &mut SplitMix, made: &mut Vec<String>) -> Mesh {
    let aspect = random.log_uniform(0.1, 10.0);
    let cells = (faces as f64 / 2.0).max(10.0);
    let nx = ((cells * aspect).sqrt().round() as usize).max(2);
    let ny = ((cells / aspect).sqrt().round() as usize).max(2);
    let (about, shape) = shape(random);
    made.push(format!("sheet of {nx} x {ny} cells, {about}"));
    let mut points = Vec::with_capacity((nx + 1) * (ny + 1));
    for j in 0..=ny {
        for i in 0..=nx {
            points.push(shape(i as f64 / nx as f64, j as f64 / ny as f64));
        }
    }
    let mut triangles = Vec::with_capacity(2 * nx * ny);
    for j in 0..ny {
        for i in 0..nx {
            let a = (i + (nx + 1) * j) as u32;
            let (b, c, d) = (a + 1, a + nx as u32 + 1, a + nx as u32 + 2);
            match random.below(2) {
                0 => triangles.extend([[a, b, d], [a, d, c]]),
                _ => triangles.extend([[a, b, c], [b, d, c]]),
            }
        }
    }
    Mesh::from_triangles("sheet", points, &triangles)
}

type Shape = Box<dyn Fn(f64, f64) -> [f64; 3]>;

/// Where the point (u, v) of the unit square goes.
fn shape(random: &mut SplitMix) -> (String, Shape) {
    let strength = random.log_uniform(0.1, 10.0);
    let waves = 1.0 + random.below(8) as f64;
    match random.below(8) {
        0 => (format!("a bump of height {strength:.2}"), {
            Box::new(move |u, v| {
                let r2 = (u - 0.5).powi(2) + (v - 0.5).powi(2);
                [u, v, strength * (-30.0 * r2).exp()]
            })
        }),
        1 => (format!("{waves} waves of height {strength:.2}"), {
            Box::new(move |u, v| [u, v, strength / waves * (TAU * waves * u).sin() * (TAU * waves * v).cos()])
        }),
        2 => (format!("{waves} folds of height {strength:.2}"), {
            Box::new(move |u, v| [u, v, strength * ((waves * u).fract() - 0.5).abs()])
        }),
        // Nearly closed: the rim is a small circle.
        3 => {
            let open = random.log_uniform(0.01, 0.5);
            (format!("a sphere with an opening of {open:.3}"), {
                Box::new(move |u, v| {
                    // The square to a disk, the disk to a sphere without a cap.
                    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
                    let (x, y) = (a * (1.0 - 0.5 * b * b).sqrt(), b * (1.0 - 0.5 * a * a).sqrt());
                    let (r, angle) = (x.hypot(y).min(1.0), y.atan2(x));
                    let polar = r * PI * (1.0 - open);
                    [polar.sin() * angle.cos(), polar.sin() * angle.sin(), polar.cos()]
                })
            })
        }
        4 => (format!("a helicoid of {waves} turns"), {
            Box::new(move |u, v| {
                let angle = TAU * waves * u;
                [v * angle.cos(), v * angle.sin(), strength * u]
            })
        }),
        5 => (format!("a roll of {waves} turns"), {
            Box::new(move |u, v| {
                let angle = TAU * waves * u;
                let radius = 0.2 + u;
                [radius * angle.cos(), radius * angle.sin(), strength * v]
            })
        }),
        6 => {
            let tip = random.log_uniform(1e-3, 0.3);
            (format!("a finger of length {:.1}", 3.0 * strength), {
                Box::new(move |u, v| {
                    // A tube slit open, narrow at one end.
                    let (angle, radius) = (0.98 * TAU * u, 0.2 * (1.0 - (1.0 - tip) * v));
                    [radius * angle.cos(), radius * angle.sin(), 3.0 * strength * v]
                })
            })
        }
        _ => (format!("a saddle of {waves} lobes, height {strength:.2}"), {
            Box::new(move |u, v| {
                let (a, b) = (u - 0.5, v - 0.5);
                let (r2, angle) = (a * a + b * b, b.atan2(a));
                [a, b, 4.0 * strength * r2 * (waves * angle).sin()]
            })
        }),
    }
}
