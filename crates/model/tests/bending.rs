//! The bending form is positive semidefinite, does not see affine maps, and equals what folds cost edge by edge.

use proxel_model::bending::Bending;
use proxel_testkit::{SplitMix, check_gradient};

/// A rectangle of cells of 0.1 x 0.13, two triangles each.
fn sheet(cells: [usize; 2]) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let [nx, ny] = cells;
    let points = (0..(nx + 1) * (ny + 1)).map(|v| [(v % (nx + 1)) as f64 * 0.1, (v / (nx + 1)) as f64 * 0.13, 0.0]);
    let cell = |c: usize| {
        let a = (c % nx + (nx + 1) * (c / nx)) as u32;
        let (b, c, d) = (a + 1, a + nx as u32 + 1, a + nx as u32 + 2);
        if a.is_multiple_of(2) { [[a, b, d], [a, d, c]] } else { [[a, b, c], [b, d, c]] }
    };
    (points.collect(), (0..nx * ny).flat_map(cell).collect())
}

/// Moves the inside of a flat sheet within its plane, so that no two triangles are alike.
fn irregular(points: &mut [[f64; 3]]) {
    let mut random = SplitMix::new(5);
    for p in points {
        p[0] += random.uniform(-0.02, 0.02);
        p[1] += random.uniform(-0.02, 0.02);
    }
}

fn value(bending: &Bending, x: &[[f64; 3]]) -> f64 {
    bending.form(1.0).value_and_gradient(x.as_flattened(), 3, None)
}

#[test]
fn no_direction_gains_energy_and_affine_maps_cost_none() {
    let (mut points, triangles) = sheet([6, 5]);
    irregular(&mut points);
    let bending = Bending::new(points.as_flattened(), 3, &triangles);
    assert_eq!(bending.n_hinges(), 3 * 60 / 2 - 11, "3 sides of 60 triangles, 22 on the border");
    assert_eq!(bending.boundary, 22);
    let mut random = SplitMix::new(6);
    let scale = value(&bending, &points.iter().map(|_| random.array(-1.0, 1.0)).collect::<Vec<[f64; 3]>>());
    for _ in 0..200 {
        let x: Vec<[f64; 3]> = points.iter().map(|_| random.array(-1.0, 1.0)).collect();
        assert!(value(&bending, &x) > 0.0);
    }
    for _ in 0..20 {
        let (a, t): ([[f64; 3]; 3], [f64; 3]) = ([(); 3].map(|()| random.array(-2.0, 2.0)), random.array(-5.0, 5.0));
        let x: Vec<[f64; 3]> =
            points.iter().map(|p| [0, 1, 2].map(|r| t[r] + (0..3).map(|c| a[r][c] * p[c]).sum::<f64>())).collect();
        let mut g = vec![0.0; 3 * x.len()];
        let e = bending.form(1.0).value_and_gradient(x.as_flattened(), 3, Some(&mut g));
        assert!(e.abs() < 1e-12 * scale, "{e:e} of {scale:e}");
        assert!(g.iter().all(|g| g.abs() < 1e-11 * scale), "K times affine positions is 0");
    }
}

/// x rolled up without stretching: lines x = const. stay straight, the strips between them are flat.
fn folded(points: &[[f64; 3]], width: f64, angles: &[f64]) -> Vec<[f64; 3]> {
    let x0 = points.iter().map(|p| p[0]).fold(f64::INFINITY, f64::min);
    points
        .iter()
        .map(|p| {
            let column = ((p[0] - x0) / width).round() as usize;
            let (mut x, mut z, mut direction) = (0.0, 0.0, 0.0_f64);
            for angle in &angles[..column] {
                direction += angle;
                x += width * direction.cos();
                z += width * direction.sin();
            }
            [x, p[1], z]
        })
        .collect()
}

#[test]
fn folds_cost_what_their_angles_say() {
    let (points, triangles) = sheet([6, 4]);
    let width = 0.1;
    let angles = [0.0, 0.3, -0.7, 1.2, 0.05, 2.5];
    let bending = Bending::new(points.as_flattened(), 3, &triangles);
    let x = folded(&points, width, &angles);
    // Independently: unit normals of the two triangles of every edge give the angle between them.
    let normal = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| x[v as usize]);
        let (u, w) = ([0, 1, 2].map(|d| b[d] - a[d]), [0, 1, 2].map(|d| c[d] - a[d]));
        let n = [u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]];
        let length = n.iter().map(|v| v * v).sum::<f64>().sqrt();
        (n.map(|v| v / length), length / 2.0)
    };
    let mut expected = 0.0;
    let mut folds = 0;
    for (i, a) in triangles.iter().enumerate() {
        for b in &triangles[..i] {
            let shared: Vec<u32> = a.iter().filter(|v| b.contains(v)).copied().collect();
            let [p, q] = shared[..] else { continue };
            let ((na, area_a), (nb, area_b)) = (normal(a), normal(b));
            let cosine: f64 = (0..3).map(|d| na[d] * nb[d]).sum();
            let sin2 = (1.0 - cosine) / 2.0; // sin^2(theta/2)
            let length2: f64 = (0..3).map(|d| (x[p as usize][d] - x[q as usize][d]).powi(2)).sum();
            expected += 6.0 * length2 * sin2 / (area_a + area_b);
            folds += usize::from(sin2 > 1e-6);
        }
    }
    assert_eq!(folds, 5 * 4, "five lines of four edges");
    let found = value(&bending, &x);
    assert!((found - expected).abs() < 1e-12 * expected, "{found} {expected}");
    let four = bending.form(4.0).value_and_gradient(x.as_flattened(), 3, None);
    assert!((four - 4.0 * found).abs() < 1e-12 * four, "linear in K");
}

#[test]
fn edges_without_two_sides_and_triangles_without_angles_are_left_out_and_told() {
    // Three triangles at the edge 0-1, one beside it, and one of no area.
    let points =
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.5, -1.0, 0.0], [0.5, 0.0, 1.0], [1.5, 1.0, 0.0]];
    let mut positions: Vec<[f64; 3]> = points.to_vec();
    positions.push([2.0, 0.0, 0.0]);
    let triangles = [[0, 1, 2], [1, 0, 3], [0, 1, 4], [1, 5, 2], [0, 1, 6]];
    let bending = Bending::new(positions.as_flattened(), 3, &triangles);
    assert_eq!(bending.nonmanifold, [[0, 1]]);
    assert_eq!(bending.degenerate, [4]);
    assert_eq!(bending.n_hinges(), 1, "1-2");
    assert!(bending.form(1.0).is_finite());
}

#[test]
fn what_forces_do_along_a_direction_follows_the_rest_shape() {
    let (mut points, triangles) = sheet([4, 3]);
    irregular(&mut points);
    let mut random = SplitMix::new(8);
    // Curved at rest: cotangents and areas of triangles in space.
    points.iter_mut().for_each(|p| p[2] = 0.4 * (5.0 * p[0]).sin() * p[1] + random.uniform(-0.01, 0.01));
    let n = points.len();
    let some = |random: &mut SplitMix| (0..3 * n).map(|_| random.uniform(-1.0, 1.0)).collect::<Vec<f64>>();
    let (x, w, k) = (some(&mut random), some(&mut random), 0.7);
    let rest = points.as_flattened();
    let phi = |rest: &[f64]| {
        let mut g = vec![0.0; 3 * n];
        Bending::new(rest, 3, &triangles).form(k).value_and_gradient(&x, 3, Some(&mut g));
        g.iter().zip(&w).map(|(g, w)| g * w).sum::<f64>()
    };
    let found = Bending::new(rest, 3, &triangles).rest_sensitivity(rest, k, &x, &w);
    check_gradient(phi, &found, rest, 1e-4, 1e-8).unwrap();
    // Moving or turning the rest shape changes nothing.
    let scale = found.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    for d in 0..3 {
        assert!(found.iter().skip(d).step_by(3).sum::<f64>().abs() < 1e-11 * scale);
        let (e, f) = ((d + 1) % 3, (d + 2) % 3);
        let torque: f64 = found.chunks(3).zip(&points).map(|(g, p)| p[e] * g[f] - p[f] * g[e]).sum();
        assert!(torque.abs() < 1e-11 * scale, "{torque:e}");
    }
    let grown: f64 = found.iter().zip(rest).map(|(g, p)| g * p).sum();
    assert!((grown + 2.0 * phi(rest)).abs() < 1e-10 * scale, "1 / area: a sheet twice as large is a fourth as stiff");
}
