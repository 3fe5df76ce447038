use super::*;

const AREA: [f64; 11] = [1.0, 2.0, 0.5, 1.5, 0.7, 1.1, 0.9, 2.0, 1.3, 0.4, 1.6];

/// Three triangles at an edge, number 0; the others in a row, each with an edge in common with the next.
fn field() -> FaceField {
    let turned = |a: f64| [a.cos(), a.sin()];
    let directions: Vec<_> = (0..11).map(|f| [0.0, 1.0, 2.0].map(|k| turned(0.8 * f as f64 + k + 0.3))).collect();
    let edges: Vec<[u32; 3]> =
        (0..11).map(|f: u32| if f < 3 { [0, 2 * f + 1, 2 * f + 2] } else { [f + 4, f + 5, 99] }).collect();
    FaceField::new(17, &edges, &directions, &AREA, 1.0)
}

/// The copies of which x is 0 and u is v, and where they lie after a step.
fn project(field: &mut FaceField, v: &[f64]) -> Vec<f64> {
    let (x, mut grad, mut u) = (vec![0.0; 22], vec![0.0; 22], v.to_vec());
    let mut p: Vec<f64> = v.iter().map(|v| -v).collect();
    let cycle = Cycle { order: proxel_split::Order::Zxu, ..Cycle::PLAIN };
    field.cycle_step(&cycle, &x, &mut p, &mut u, &mut grad);
    p.iter().zip(&u).map(|(p, u)| p + u).collect()
}

/// How far copies are from agreeing.
fn apart(field: &FaceField, v: &[f64]) -> f64 {
    let along = |f: usize, k: usize| (0..2).map(|d| field.direction[place(f, k, d)] * v[place(f, k, d)]).sum::<f64>();
    let crowd = [along(0, 0), along(1, 0), along(2, 0)];
    let row = (3..10).map(|f| (along(f, 1) - along(f + 1, 0)).abs());
    let crowd = (crowd[0] - crowd[1]).abs().max((crowd[0] - crowd[2]).abs());
    row.fold(crowd, f64::max)
}

fn sample(seed: f64) -> Vec<f64> {
    (0..2 * PAIRS).map(|i| (i as f64 * 0.7 + seed).sin()).collect()
}

/// In the norm of areas the step ends at the nearest point: what is in the set stays, and no other point of it is nearer.
#[test]
fn the_nearest_field() {
    let mut field = field();
    let v = sample(0.0);
    let z = project(&mut field, &v);
    assert!(apart(&field, &v) > 0.1 && apart(&field, &z) < 1e-15);
    let again = project(&mut field, &z);
    assert!(z.iter().zip(&again).all(|(a, b)| (a - b).abs() < 1e-15));
    let places = || (0..11).flat_map(|f| (0..3).flat_map(move |k| (0..2).map(move |d| (f, place(f, k, d)))));
    let distance = |y: &[f64]| -> f64 { places().map(|(f, at)| AREA[f] * (y[at] - v[at]).powi(2)).sum() };
    for k in 0..50 {
        let y: Vec<f64> = z.iter().zip(sample(k as f64)).map(|(z, s)| z + 0.1 * s).collect();
        let y = project(&mut field, &y);
        assert!(distance(&y) >= distance(&z), "{k}");
    }
    // Edges of one face are free.
    assert!((0..2).all(|d| z[place(5, 2, d)] == v[place(5, 2, d)] && z[place(0, 1, d)] == v[place(0, 1, d)]));
    let mut weights = vec![0.0; 2 * PAIRS];
    field.local_weights2(&mut weights);
    assert!(weights[place(5, 2, 1)] == 0.0 && weights[place(5, 1, 1)] == AREA[5] && weights[place(2, 0, 0)] == 0.5);
    assert_eq!(field.local_dim(), 2 * (3 + 14));
}

/// The gradient is that of the penalty, by differences; reports agree with sums.
#[test]
fn a_local_step() {
    let mut field = field();
    let x: Vec<f64> = (0..22).map(|i| (i as f64).cos()).collect();
    let (mut p, mut u, mut grad) = (sample(1.0), sample(2.0), vec![0.0; 22]);
    let report = field.local_step(&x, &mut p, &mut u, &mut grad);
    let value = |field: &mut FaceField, x: &[f64]| field.penalty(x, &p, &mut [0.0; 22]).value;
    assert!((report.objective - value(&mut field, &x)).abs() < 1e-12 * report.objective);
    for i in 0..22 {
        let (mut up, mut down) = (x.clone(), x.clone());
        up[i] += 1e-4;
        down[i] -= 1e-4;
        let slope = (value(&mut field, &up) - value(&mut field, &down)) / 2e-4;
        assert!((slope - grad[i]).abs() < 1e-8, "{i}: {slope} {}", grad[i]);
    }
    let residual = field.residual(&x, &p, &u);
    assert!((report.gap2 - residual.gap2).abs() < 1e-12 * report.gap2 && report.gap2 > 0.0);
    let mut copies = vec![0.0; p.len()];
    field.couple(&x, &mut copies);
    let z: Vec<f64> = p.iter().zip(&u).map(|(p, u)| p + u).collect();
    assert!(field.energy(&x, None).violation > 0.1 && apart(&field, &z) < 1e-14);
    assert!((0..11).all(|f| copies[place(f, 2, 1)] == x[2 * f + 1]));
}
