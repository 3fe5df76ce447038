use super::*;
use proxel::mesh::Mesh;
use proxel::mesh::generate::cloth;

fn body(mesh: Mesh, shape: BatchShape, moduli: (f64, f64)) -> Body {
    let lame = Lame::from_young_poisson(moduli.0, moduli.1).expect("a material");
    let (limits, pins, wind, walls) = (None, Vec::new(), None, None);
    Body { mesh, shape, lame, moduli, density: 1522.0, limits, pins, wind, walls }
}

fn sheet() -> Body {
    let mesh = cloth([6, 4], [1.5, 1.0]).expect("a sheet");
    Body {
        density: 1.0,
        limits: Some((0.95, 1.05)),
        pins: vec![0, 28],
        ..body(mesh, BatchShape::Triangles, (50.0, 0.1))
    }
}

#[test]
fn violations_are_those_of_the_stretches() {
    let moving = Moving::new(sheet()).expect("a sheet");
    // Stretched by 1.2 along a direction and by 0.9 across, then turned out of the plane.
    let (s, c) = 0.3_f64.sin_cos();
    let points = moving.body.mesh.points.iter().map(|p| {
        let (u, v) = (1.2 * (c * p[0] + s * p[1]), 0.9 * (c * p[1] - s * p[0]));
        [u, 0.6 * v, 0.8 * v]
    });
    let x = moving.flat(&points.collect::<Vec<_>>());
    for violation in moving.violations(&x) {
        assert!((violation - 0.15).abs() < 1e-12, "{violation}");
    }
    let own = moving.problem(Splitting::Linear, 1.0).expect("a problem").energy(&x, None).violation;
    assert!((own - 0.15).abs() < 1e-9, "{own}");
    assert!(moving.violations(&moving.rest).iter().all(|v| *v == 0.0));
}

#[test]
fn wind_goes_from_triangle_to_triangle() {
    let wind = Wind { velocity: [0.0, 0.0, 9.0], coupling: 10.0, share: 0.5 };
    let x = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0];
    let mut v = [0.0; 12];
    wind.blow(&[0, 1, 2, 1, 3, 2], &x, &mut v);
    // -0.5 dt 10 A v_n |v_n| with v_n = -9, then with two corners that move already.
    let first = 0.5 * DT * 10.0 * 0.5 * 81.0;
    let second = 0.5 * DT * 10.0 * 0.5 * (2.0 / 3.0 * first - 9.0_f64).powi(2);
    for (corner, push) in [first, first + second, first + second, second].into_iter().enumerate() {
        assert!((v[3 * corner + 2] - push).abs() < 1e-12 && v[3 * corner] == 0.0, "{corner}: {v:?}");
    }
}

#[test]
fn held_vertices_stay_and_free_ones_fall() {
    let mut moving = Moving::new(sheet()).expect("a sheet");
    let before = moving.state().0;
    moving.advance(20).expect("a step");
    let (after, velocities) = moving.state();
    for (v, (p, q)) in before.iter().zip(&after).enumerate() {
        let held = [0, 28].contains(&v);
        assert_eq!(p == q, held, "{v}");
        assert_eq!(velocities[v] == [0.0; 3], held, "{v}");
    }
    assert_eq!(moving.frames(), 1);
}
