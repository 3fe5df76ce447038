use super::*;
use crate::generate::{CellSplit, beam};
use crate::topology::boundary_surface;

/// A sphere of n x 2n quads, outward.
fn sphere(n: usize, center: V3, radius: f64) -> (Vec<V3>, Vec<[u32; 3]>) {
    let m = 2 * n;
    let mut points = Vec::new();
    for i in 0..=n {
        for j in 0..m {
            let (s, c) = (PI * i as f64 / n as f64).sin_cos();
            let (t, u) = (2.0 * PI * j as f64 / m as f64).sin_cos();
            points.push([center[0] + radius * s * u, center[1] + radius * s * t, center[2] + radius * c]);
        }
    }
    let mut triangles = Vec::new();
    for i in 0..n {
        for j in 0..m {
            let v = |i: usize, j: usize| (i * m + j % m) as u32;
            let (a, b, c, d) = (v(i, j), v(i + 1, j), v(i + 1, j + 1), v(i, j + 1));
            if i + 1 < n {
                triangles.push([a, b, c]);
            }
            if i > 0 {
                triangles.push([a, c, d]);
            }
        }
    }
    (points, triangles)
}

/// Points everywhere around and in the ball of this radius.
fn cloud(n: usize, radius: f64) -> Vec<V3> {
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    let mut next = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        radius * ((state >> 11) as f64 / (1u64 << 52) as f64 - 1.0)
    };
    (0..n).map(|_| [next(), next(), next()]).collect()
}

fn worst(points: &[V3], triangles: &[[u32; 3]], q: &[V3]) -> f64 {
    let tree = WindingTree::new(points, triangles);
    let error = |&q: &V3| (tree.at(q) - winding_number(points, triangles, q)).abs();
    q.iter().map(error).fold(0.0, f64::max)
}

#[test]
fn a_closed_surface_separates_zero_from_one() {
    let (points, triangles) = sphere(24, [0.0; 3], 1.0);
    let tree = WindingTree::new(&points, &triangles);
    let mut seen = [0, 0];
    for q in cloud(2000, 1.5) {
        let r = norm(q);
        if (0.97..1.03).contains(&r) {
            continue; // between the sphere and its triangles
        }
        let inside = r < 1.0;
        let exact = winding_number(&points, &triangles, q);
        assert!((exact - f64::from(u8::from(inside))).abs() < 1e-12, "{q:?}: {exact}");
        assert_eq!(tree.at(q) > 0.5, inside, "{q:?}");
        seen[usize::from(inside)] += 1;
    }
    assert!(seen[0] > 1000 && seen[1] > 200, "{seen:?}");
}

/// Measured: 5.6e-3 at worst.
#[test]
fn the_tree_agrees_with_the_sum() {
    let (points, mut triangles) = sphere(24, [0.3, -0.2, 0.1], 1.0);
    let q = cloud(2000, 2.5);
    assert!(worst(&points, &triangles, &q) < 1e-2);
    // A third of the triangles missing, and a few turned around.
    triangles.retain(|t| t[0] % 3 != 0);
    triangles.iter_mut().step_by(17).for_each(|t| t.swap(1, 2));
    assert!(worst(&points, &triangles, &q) < 1e-2);
    // A few triangles only: no group to speak of, so the sum itself.
    assert!(worst(&points, &triangles[..5], &q[..200]) < 1e-2);
    assert_eq!(WindingTree::new(&points, &[]).at(q[0]), 0.0);
}

#[test]
fn far_away_the_moments_are_the_solid_angles() {
    // The error of three moments falls with the fourth power of the distance or faster.
    let (points, triangles) = sphere(8, [0.0; 3], 1.0);
    let half: Vec<[u32; 3]> = triangles.into_iter().filter(|t| points[t[1] as usize][2] > 0.1).collect();
    let corners: Vec<[V3; 3]> = half.iter().map(|t| t.map(|v| points[v as usize])).collect();
    let moments = moments::Moments::of(&corners);
    let error = |r: f64| {
        let q = [0.3 * r, 0.4 * r, -0.866 * r];
        (moments.seen_from(q, 1.0).unwrap() - winding_number(&points, &half, q)).abs()
    };
    assert!(error(4.0) < 1e-3, "{}", error(4.0));
    assert!(error(8.0) < error(4.0) / 12.0 && error(16.0) < error(8.0) / 12.0, "{} {}", error(8.0), error(16.0));
}

#[test]
fn overlapping_surfaces_add() {
    let (mut points, mut triangles) = sphere(12, [0.0; 3], 1.0);
    let (more, others) = sphere(12, [0.8, 0.0, 0.0], 1.0);
    let n = points.len() as u32;
    points.extend(more);
    triangles.extend(others.iter().map(|t| t.map(|v| v + n)));
    let tree = WindingTree::new(&points, &triangles);
    for (q, w) in [([0.4, 0.0, 0.1], 2.0), ([-0.5, 0.0, 0.0], 1.0), ([1.5, 0.1, 0.0], 1.0), ([0.0, 3.0, 0.0], 0.0)] {
        assert!((tree.at(q) - w).abs() < 1e-2, "{q:?}: {}", tree.at(q));
        assert!((winding_number(&points, &triangles, q) - w).abs() < 1e-12);
    }
}

#[test]
fn an_open_surface_has_a_half_at_its_hole() {
    // A cube without its lid: in the plane of the lid, in its middle, half of the view is free.
    let body = beam([6; 3], [1.0; 3], CellSplit::Six).unwrap();
    let mut faces = boundary_surface(&body.tets);
    faces.retain(|f| !f.iter().all(|&v| body.points[v as usize][2] == 0.5));
    let tree = WindingTree::new(&body.points, &faces);
    let exact = |q| winding_number(&body.points, &faces, q);
    assert!((exact([0.0, 0.0, 0.5]) - 0.5).abs() < 1e-12);
    // The lid seen from the centre of the cube is a sixth of the sphere.
    assert!((exact([0.0; 3]) - 5.0 / 6.0).abs() < 1e-12);
    assert!((tree.at([0.0; 3]) - 5.0 / 6.0).abs() < 1e-2);
    assert!(tree.at([0.0, 0.0, -0.6]).abs() < 0.2);
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let (points, triangles) = sphere(24, [0.0; 3], 1.0);
    let q = cloud(3000, 1.5);
    let of = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| WindingTree::new(&points, &triangles).at_all(&q))
    };
    let bits = |w: Vec<f64>| w.into_iter().map(f64::to_bits).collect::<Vec<_>>();
    assert_eq!(bits(of(1)), bits(of(5)));
}
