//! Obstacles and pressure, each against what it should be, by itself.

use proxel_model::obstacle::{HalfSpace, Obstacle};
use proxel_model::points::{OfPoints, Points};
use proxel_model::pressure::Pressure;
use proxel_split::{Potential, Term};
use proxel_testkit::{SplitMix, check_gradient};

/// An octahedron, oriented outwards.
fn octahedron() -> (Vec<f64>, Vec<[u32; 3]>) {
    let x = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    let t = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    (x.as_flattened().to_vec(), t.to_vec())
}

#[test]
fn pressure_is_minus_p_times_volume_and_has_its_gradient() {
    let (x, triangles) = octahedron();
    assert!(Pressure::border(&triangles).is_empty());
    let value = Pressure::new(triangles.clone(), 3.0, &x).value_and_gradient(&x, None);
    assert!((value + 3.0 * 4.0 / 3.0).abs() < 1e-14, "an octahedron of volume 4/3: {value}");
    let far: Vec<f64> = x.iter().map(|x| x + 5.0).collect();
    let moved = Pressure::new(triangles.clone(), 3.0, &x).value_and_gradient(&far, None);
    assert!((moved - value).abs() < 1e-12, "closed: where it is does not matter");
    let mut random = SplitMix::new(3);
    let bent: Vec<f64> = x.iter().map(|x| x + random.uniform(-0.2, 0.2)).collect();
    for open in [false, true] {
        let patch = if open { triangles[..5].to_vec() } else { triangles.clone() };
        assert_eq!(Pressure::border(&patch).is_empty(), !open);
        let pressure = Pressure::new(patch, -1.7, &x);
        let mut g = vec![0.0; 18];
        pressure.value_and_gradient(&bent, Some(&mut g));
        check_gradient(|x| pressure.value_and_gradient(x, None), &g, &bent, 1e-3, 1e-8).unwrap();
        let mut hessian = vec![0.0; 18 * 18];
        pressure.for_each_block(&bent, &mut |v, w, block| {
            for (i, row) in block.iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    hessian[(3 * v + i) * 18 + 3 * w + j] += value;
                    if v != w {
                        hessian[(3 * w + j) * 18 + 3 * v + i] += value;
                    }
                }
            }
        });
        let h = 1e-5;
        for k in 0..18 {
            let gradient_at = |step: f64| {
                let mut x = bent.clone();
                x[k] += step;
                let mut g = vec![0.0; 18];
                pressure.value_and_gradient(&x, Some(&mut g));
                g
            };
            let (above, below) = (gradient_at(h), gradient_at(-h));
            for i in 0..18 {
                let difference = (above[i] - below[i]) / (2.0 * h);
                assert!(
                    (difference - hessian[i * 18 + k]).abs() < 1e-9,
                    "{i} {k}: {difference} {}",
                    hessian[i * 18 + k]
                );
            }
        }
        if !open {
            // A pressure pushes a closed surface nowhere.
            for d in 0..3 {
                assert!(g.iter().skip(d).step_by(3).sum::<f64>().abs() < 1e-13);
            }
        }
    }
    // A node inside the patch feels p A n / 3 of its faces, whatever the plane.
    let fan = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4]];
    let force = |plane: &[f64]| {
        let mut g = vec![0.0; 18];
        Pressure::new(fan.to_vec(), 2.0, plane).value_and_gradient(&x, Some(&mut g));
        g.iter().map(|g| -g).collect::<Vec<_>>()
    };
    let (near, far) = (force(&x), force(&bent));
    assert!((12..15).all(|d| (near[d] - far[d]).abs() < 1e-12), "{near:?} {far:?}");
    // All of it: the pressure on the square of area 2 that the patch is seen as.
    assert!((near.iter().skip(2).step_by(3).sum::<f64>() - 2.0 * 2.0).abs() < 1e-12, "{near:?}");
    let near = &near[12..15];
    // Four faces of area sqrt(3)/2 with a vertical part of the normal of 1/sqrt(3).
    assert!((near[2] - 2.0 * 4.0 * 0.5 / 3.0).abs() < 1e-12 && near[0].abs() < 1e-14, "{near:?}");
}

#[test]
fn the_prox_of_an_obstacle_is_the_nearest_point_of_its_side() {
    let plane = HalfSpace { normal: [0.6, 0.0, 0.8], height: 0.5 };
    let mut term = Obstacle::new(plane, Points::of_nodes(vec![0, 2]), vec![2.0, 3.0], 1.0);
    assert!(term.is_hard());
    let mut random = SplitMix::new(4);
    let (mut pushed, mut left) = (0, 0);
    for _ in 0..200 {
        let x: [f64; 9] = random.array(-1.0, 1.0);
        let (mut p, mut u): ([f64; 6], [f64; 6]) = (random.array(-1.0, 1.0), random.array(-0.3, 0.3));
        let v: Vec<f64> = (0..6).map(|i| x[i % 3 + 6 * (i / 3)] + u[i]).collect();
        let mut g = [0.0; 9];
        let report = term.local_step(&x, &mut p, &mut u, &mut g);
        for k in 0..2 {
            let z: Vec<f64> = (0..3).map(|d| p[3 * k + d] + u[3 * k + d]).collect();
            assert!(plane.distance(&z) >= -1e-15);
            let moved: f64 = (0..3).map(|d| (z[d] - v[3 * k + d]).powi(2)).sum::<f64>().sqrt();
            assert!((moved - (-plane.distance(&v[3 * k..3 * k + 3])).max(0.0)).abs() < 1e-14, "the nearest point");
            *(if moved > 0.0 { &mut pushed } else { &mut left }) += 1;
        }
        let mut again = [0.0; 9];
        let penalty = term.penalty(&x, &p, &mut again);
        assert!((penalty.value - report.objective).abs() < 1e-14 && again == g);
        let deepest = [0, 2].map(|n| -plane.distance(&x[3 * n..3 * n + 3])).into_iter().fold(0.0, f64::max);
        assert!((term.energy(&x, None).violation - deepest).abs() < 1e-15);
        let of = std::cell::RefCell::new(&mut term);
        check_gradient(|x| of.borrow_mut().penalty(x, &p, &mut []).value, &g, &x, 1e-3, 1e-8).unwrap();
    }
    assert!(pushed > 50 && left > 50);
}

#[test]
fn points_are_obstructed_and_pressed_through_the_nodes_that_carry_them() {
    // Three points: a node, the middle of an edge, a point in a tetrahedron.
    let mut points = Points::of_nodes(vec![4]);
    points.push(&[0, 2, 3], &[0.5, 0.5, 0.0]);
    points.push(&[1, 2, 3, 4], &[0.1, 0.2, 0.3, 0.4]);
    assert_eq!((points.len(), points.n(), points.parts(1).0), (3, 5, &[0, 2][..]));
    let mut random = SplitMix::new(5);
    let x: [f64; 15] = random.array(-1.0, 1.0);
    let middle: [f64; 3] = points.at(1, &x);
    assert!((0..3).all(|d| (middle[d] - (x[d] + x[6 + d]) / 2.0).abs() < 1e-15));

    let plane = HalfSpace { normal: [0.6, 0.0, 0.8], height: 0.9 };
    let weight2 = [2.0, 3.0, 0.5];
    let mut term = Obstacle::new(plane, points.clone(), weight2.to_vec(), 1.0);
    let p: [f64; 9] = random.array(-1.0, 1.0);
    let mut g = vec![0.0; 15];
    term.penalty(&x, &p, &mut g);
    let of = std::cell::RefCell::new(&mut term);
    check_gradient(|x| of.borrow_mut().penalty(x, &p, &mut []).value, &g, &x, 1e-3, 1e-8).unwrap();
    // The normal matrix is the second derivative of the penalty; node 4 is fixed.
    let mut cliques: Vec<Vec<u32>> = Vec::new();
    term.for_each_element(&mut |nodes| cliques.push(nodes.iter().copied().filter(|n| *n < 4).collect()));
    let pattern = proxel_linalg::sparse::SymPattern::from_cliques(4, &cliques).unwrap();
    let mut values = vec![0.0; pattern.nnz()];
    term.add_normal(&pattern, &mut values);
    for i in 0..4 {
        for j in 0..=i {
            let weight = |k: usize, n: usize| {
                let (nodes, weights) = points.parts(k);
                nodes.iter().position(|v| *v as usize == n).map_or(0.0, |at| weights[at])
            };
            let by_hand: f64 = (0..3).map(|k| weight2[k] * weight(k, i) * weight(k, j)).sum();
            let entry = pattern.slot(i, j).map_or(0.0, |slot| values[slot]);
            assert!((entry - by_hand).abs() < 1e-15, "{i} {j}: {entry} {by_hand}");
        }
    }

    let (nodes, triangles) = octahedron();
    let pressure = Pressure::new(triangles, -1.7, &nodes);
    let mut carried = Points::default();
    for _ in 0..6 {
        carried.push(&[0, 1, 2, 3], &random.array::<4>(0.1, 0.4));
    }
    let pressure = OfPoints { potential: pressure, points: carried };
    assert_eq!(pressure.n(), 4);
    let x: [f64; 12] = random.array(-1.0, 1.0);
    let mut g = [0.0; 12];
    let value = pressure.value_and_gradient(&x, Some(&mut g));
    assert!(value == pressure.value_and_gradient(&x, None) && value != 0.0);
    check_gradient(|x| pressure.value_and_gradient(x, None), &g, &x, 1e-3, 1e-7).unwrap();
}
