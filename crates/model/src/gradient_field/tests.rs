use super::*;
use proxel_split::{Cycle, Term};

/// Numbers of eight faces in a local vector.
const BLOCK: usize = 48;

const AREA: [f64; 11] = [1.0, 2.0, 0.5, 1.5, 0.7, 1.1, 0.9, 2.0, 1.3, 0.4, 1.6];

/// Three triangles at an edge, number 0; the others in a row, each with an edge in common with the next.
fn place(f: usize, k: usize, d: usize) -> usize {
    FaceField::at(f, k, d)
}

fn field() -> FaceField {
    let turned = |a: f64| [a.cos(), a.sin()];
    let directions: Vec<_> = (0..11).map(|f| [0.0, 1.0, 2.0].map(|k| turned(0.8 * f as f64 + k + 0.3))).collect();
    let edges: Vec<[u32; 3]> =
        (0..11).map(|f: u32| if f < 3 { [0, 2 * f + 1, 2 * f + 2] } else { [f + 4, f + 5, 99] }).collect();
    FaceField::on_faces(17, &edges, &directions, &AREA, 1.0)
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
    let along = |f: usize, k: usize| (0..2).map(|d| field.direction()[place(f, k, d)] * v[place(f, k, d)]).sum::<f64>();
    let crowd = [along(0, 0), along(1, 0), along(2, 0)];
    let row = (3..10).map(|f| (along(f, 1) - along(f + 1, 0)).abs());
    let crowd = (crowd[0] - crowd[1]).abs().max((crowd[0] - crowd[2]).abs());
    row.fold(crowd, f64::max)
}

fn sample(seed: f64) -> Vec<f64> {
    (0..2 * BLOCK).map(|i| (i as f64 * 0.7 + seed).sin()).collect()
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
    let mut weights = vec![0.0; 2 * BLOCK];
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

struct Faces {
    n: usize, // edges
    edges: Vec<[u32; 3]>,
    signs: Vec<[f64; 3]>,
    weights: Vec<[f64; 3]>, // squared
    lengths: Vec<f64>,
}

impl Faces {
    fn field(&self) -> Result<Box<dyn Term>, TooManyFaces> {
        field_on_edges(self.n, &self.edges, &self.signs, &self.weights, &self.lengths)
    }
}

/// So many faces around edge 0, and ten others.
fn around_an_edge(crowd: usize) -> Faces {
    let mut edges: Vec<[u32; 3]> = (0..crowd as u32).map(|f| [2 * f + 1, 0, 2 * f + 2]).collect();
    let first = 2 * crowd as u32;
    edges.extend((0..10).map(|f| [first + 2 * f, first + 2 * f + 1, first + 2 * f + 2]));
    let n = first as usize + 21;
    let signs = (0..edges.len()).map(|f| [0, 1, 2].map(|k| if (f * f + k) % 3 == 0 { -1.0 } else { 1.0 })).collect();
    let lengths: Vec<f64> = (0..n).map(|e| 1.0 + 0.4 * (e as f64).sin()).collect();
    // Squared weights of one face are as 1 / l^2.
    let weights = edges.iter().enumerate();
    let weights = weights.map(|(f, e)| e.map(|e| (1.0 + f as f64) / lengths[e as usize].powi(2))).collect();
    Faces { n, edges, signs, weights, lengths }
}

/// Sums vanish around every face, copies of a face move by s l^2 times one number, which is that of the nearest point, and the
/// gradient is that of the penalty.
#[test]
fn differences_around_faces() {
    for crowd in [2, 3, 7] {
        let faces = around_an_edge(crowd);
        let mut field = faces.field().unwrap();
        let Faces { n, edges, signs, weights, lengths } = faces;
        let x: Vec<f64> = (0..n).map(|e| (1.3 * e as f64).cos()).collect();
        let len = field.local_len();
        let (mut p, mut u, mut grad) = (vec![0.0; len], vec![0.0; len], vec![0.0; n]);
        let (mut w2, mut z) = (vec![0.0; len], vec![0.0; len]);
        field.local_weights2(&mut w2);
        assert_eq!(w2.iter().filter(|w2| **w2 > 0.0).count(), 3 * edges.len());
        let report = field.local_step(&x, &mut p, &mut u, &mut grad);
        (0..len).for_each(|i| z[i] = p[i] + u[i]);
        // Copies by the face and the edge that their weights are of.
        let copy = |f: usize, k: usize| {
            let like = |i: &usize| w2[*i] == weights[f][k] && (u[*i] + z[*i] - x[edges[f][k] as usize]).abs() < 1e-14;
            let found: Vec<usize> = (0..len).filter(like).collect();
            assert_eq!(found.len(), 1, "{crowd} {f} {k}");
            found[0]
        };
        for f in 0..edges.len() {
            let at = [0, 1, 2].map(|k| copy(f, k));
            let sum: f64 = (0..3).map(|k| signs[f][k] * z[at[k]]).sum();
            assert!(sum.abs() < 1e-14, "{crowd} {f}: {sum}");
            let moved = [0, 1, 2].map(|k| (z[at[k]] - x[edges[f][k] as usize]) * weights[f][k] * signs[f][k]);
            assert!(moved.iter().all(|m| (m - moved[0]).abs() < 1e-13), "{crowd} {f}: {moved:?}");
        }
        let value = |field: &mut dyn Term, x: &[f64]| field.penalty(x, &p, &mut vec![0.0; n]).value;
        assert!((report.objective - value(&mut *field, &x)).abs() < 1e-12 * report.objective);
        for e in 0..n {
            let (mut up, mut down) = (x.clone(), x.clone());
            (up[e], down[e]) = (x[e] + 1e-4, x[e] - 1e-4);
            let slope = (value(&mut *field, &up) - value(&mut *field, &down)) / 2e-4;
            assert!((slope - grad[e]).abs() < 1e-7, "{crowd} {e}: {slope} {}", grad[e]);
        }
        let sums = edges.iter().zip(&signs).map(|(e, s)| (0..3).map(|k| s[k] * x[e[k] as usize]).sum::<f64>().abs());
        let mean = edges.iter().flatten().map(|e| lengths[*e as usize]).sum::<f64>() / (3 * edges.len()) as f64;
        let worst = sums.fold(0.0, f64::max) / mean;
        assert!((field.energy(&x, None).violation - worst).abs() < 1e-13);
    }
}

#[test]
fn an_edge_of_many_faces_is_refused() {
    let refused = around_an_edge(17).field().err();
    assert_eq!(refused, Some(TooManyFaces { edge: 0, faces: 17, most: 16 }));
}
