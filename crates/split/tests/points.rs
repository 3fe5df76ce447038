//! Springs from points that nodes carry: gradient and matrix against finite differences.

use proxel_split::{PointSpring, Quadratic};

/// Over five nodes in space, the last one fixed.
fn quadratic() -> Quadratic {
    let spring = |nodes, weights, target, stiffness| PointSpring { nodes, weights, target, stiffness };
    Quadratic {
        springs: vec![(1, 0.7, [0.1, -0.3, 0.2])],
        points: vec![
            spring([0, 1, 2, 3], [0.4, 0.3, 0.2, 0.1], [1.0, 0.5, -0.5], 3.0),
            spring([1, 4, 2, 0], [0.25, 0.5, 0.125, 0.125], [0.0, 2.0, 0.3], 0.5),
            // A node that stands at two places.
            spring([3, 3, 0, 0], [0.5, 0.25, 0.25, 0.0], [0.2, 0.1, 0.7], 2.0),
        ],
        loads: Vec::new(),
        constant: 0.0,
        ..Quadratic::default()
    }
}

const N: usize = 5;
const FREE: usize = 4;

fn position() -> Vec<f64> {
    (0..3 * N).map(|i| ((7 * i + 3) % 11) as f64 / 5.0 - 1.0).collect()
}

#[test]
fn the_gradient_is_that_of_the_value() {
    let (f, x) = (quadratic(), position());
    let mut grad = vec![0.0; 3 * FREE];
    f.value_and_gradient(&x, 3, Some(&mut grad));
    for i in 0..3 * FREE {
        let at = |h: f64| {
            let mut y = x.clone();
            y[i] += h;
            f.value_and_gradient(&y, 3, None)
        };
        // Central differences of a quadratic are exact up to rounding.
        assert!(((at(0.5) - at(-0.5)) - grad[i]).abs() < 1e-12, "{i}");
    }
}

#[test]
fn the_matrix_is_the_derivative_of_the_gradient() {
    let (f, x) = (quadratic(), position());
    let mut matrix = [[0.0; FREE]; FREE];
    for spring in &f.points {
        spring.for_each_entry(FREE, &mut |i, j, entry| {
            assert!(i >= j, "the lower triangle");
            matrix[i][j] += entry;
            if i != j {
                matrix[j][i] += entry;
            }
        });
    }
    matrix[1][1] += 0.7;
    let gradient = |x: &[f64]| {
        let mut grad = vec![0.0; 3 * FREE];
        f.value_and_gradient(x, 3, Some(&mut grad));
        grad
    };
    for j in 0..FREE {
        for d in 0..3 {
            let mut y = x.clone();
            y[3 * j + d] += 1.0;
            let (after, before) = (gradient(&y), gradient(&x));
            for i in 0..FREE {
                let change = after[3 * i + d] - before[3 * i + d];
                assert!((change - matrix[i][j]).abs() < 1e-12, "{i} {j}: {change} is not {}", matrix[i][j]);
            }
        }
    }
}

#[test]
fn a_gap_is_the_way_from_the_target_to_the_point() {
    let x = position();
    let spring = PointSpring { nodes: [0, 1, 2, 3], weights: [0.1, 0.2, 0.3, 0.4], ..PointSpring::default() };
    let point: Vec<f64> = (0..3).map(|d| (0..4).map(|i| (i + 1) as f64 / 10.0 * x[3 * i + d]).sum()).collect();
    let gap = PointSpring { target: [point[0], point[1], point[2] - 1.0], ..spring }.gap(&x, 3);
    assert!((0..2).all(|d| gap[d].abs() < 1e-15) && (gap[2] - 1.0).abs() < 1e-15, "{gap:?}");
}
