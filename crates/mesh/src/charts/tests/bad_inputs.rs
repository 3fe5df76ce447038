//! The sixteen inputs that readers and users meet: a patch with one defect each.

use super::*;
use crate::error::ErrorKind;

fn patch(n: usize) -> Mesh {
    let at = |i: usize| -1.0 + 2.0 * i as f64 / n as f64;
    let mut points = Vec::new();
    for i in 0..=n {
        for j in 0..=n {
            let (x, y) = (at(i), at(j));
            points.push([x, y, 0.6 * (2.5 * x).sin() * (2.0 * y).cos()]);
        }
    }
    let mut triangles = Vec::new();
    for i in 0..n {
        for j in 0..n {
            let a = (i * (n + 1) + j) as u32;
            let b = a + n as u32 + 1;
            triangles.extend([[a, b, a + 1], [a + 1, b, b + 1]]);
        }
    }
    Mesh::from_triangles("patch", points, &triangles)
}

fn triangles(mesh: &Mesh) -> Vec<[u32; 3]> {
    mesh.faces.as_triangles().unwrap()
}

fn with(mesh: &Mesh, triangles: &[[u32; 3]]) -> Mesh {
    Mesh::from_triangles("patch", mesh.points.clone(), triangles)
}

#[test]
fn clean_scaled_and_moved_patches_are_left_as_they_are() {
    let clean = patch(40);
    for map in [|c: f64| c, |c: f64| 1e-6 * c, |c: f64| 1e8 * c, |c: f64| c + 1e6] {
        let mesh = clean.with_points(clean.points.iter().map(|p| p.map(map)).collect()).unwrap();
        let out = charted(&mesh);
        assert_eq!((out.charts.len(), out.seams.len(), out.repairs.len(), out.warnings.len()), (1, 0, 0, 0));
        assert_eq!(out.charts[0].triangles, triangles(&clean));
        assert!(out.charts[0].vertices.iter().copied().eq(0..1681));
    }
}

#[test]
fn a_closed_sphere_is_cut() {
    let n = 24;
    let mut points = vec![[0.0, 0.0, 1.0]];
    for i in 1..n {
        for j in 0..n {
            let (t, p) = (std::f64::consts::PI * i as f64 / n as f64, std::f64::consts::TAU * j as f64 / n as f64);
            points.push([t.sin() * p.cos(), t.sin() * p.sin(), t.cos()]);
        }
    }
    points.push([0.0, 0.0, -1.0]);
    let last = points.len() as u32 - 1;
    let at = |i: usize, j: usize| (1 + (i - 1) * n + j % n) as u32;
    let mut t = Vec::new();
    for j in 0..n {
        t.extend([[0, at(1, j), at(1, j + 1)], [last, at(n - 1, j + 1), at(n - 1, j)]]);
        for i in 1..n - 1 {
            t.extend([[at(i, j), at(i + 1, j), at(i, j + 1)], [at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)]]);
        }
    }
    let out = charted(&Mesh::from_triangles("sphere", points, &t));
    assert_eq!(loops(&out), [1]);
    assert!(out.repairs.iter().any(|r| r.contains("no boundary")));
}

#[test]
fn what_can_be_mapped_is_and_what_was_repaired_is_named() {
    let clean = patch(40);
    let t = triangles(&clean);

    let mut unreferenced = clean.clone();
    unreferenced.points.push([5.0; 3]);
    let out = charted(&unreferenced);
    assert_eq!(
        (out.charts.len(), &out.warnings[..]),
        (1, &["1 vertex is in no face, the first is 1681".to_owned()][..])
    );

    let mut merged = clean.clone();
    merged.points[500] = merged.points[501];
    let out = charted(&merged);
    assert_eq!((out.charts[0].triangles.len(), out.repairs.len()), (3200, 0));

    let mut more = t.clone();
    more.push(t[0]);
    let out = charted(&with(&clean, &more));
    assert_eq!(out.repairs, ["1 face repeats an earlier face, face 3200: it was mapped with the first of its kind"]);
    assert_eq!(out.places[9600..], out.places[..3]);

    let mut fan = clean.clone();
    fan.points.push([0.0, 0.0, 3.0]);
    let mut more = t.clone();
    more.push([t[1600][0], t[1600][1], 1681]);
    // That edge lies on the border: the new face goes on there, though listed the other way round.
    let out = charted(&with(&fan, &more));
    assert_eq!((loops(&out), out.seams.len(), &out.reversed_faces[..]), (vec![1], 0, &[3200][..]));
    more[3200] = [t[1640][0], t[1640][1], 1681];
    let out = charted(&with(&fan, &more));
    assert_eq!((loops(&out), out.seams.len()), (vec![1, 1], 1));
    assert!(out.repairs[0].contains("three faces or more"));

    let mut turned = t.clone();
    turned[800].reverse();
    let out = charted(&with(&clean, &turned));
    assert_eq!((out.reversed_faces.clone(), out.repairs.len(), out.charts.len()), (vec![800], 1, 1));

    let small = patch(20);
    let mut two = triangles(&small);
    two.extend(triangles(&small).iter().map(|t| t.map(|v| v + 441)));
    let points = small.points.iter().copied().chain(small.points.iter().map(|p| [p[0] + 5.0, p[1], p[2]])).collect();
    assert_eq!(loops(&charted(&Mesh::from_triangles("two", points, &two))), [1, 1]);

    let holed: Vec<_> = t.iter().enumerate().filter(|(i, _)| !(780..786).contains(i)).map(|(_, t)| *t).collect();
    assert_eq!(loops(&charted(&with(&clean, &holed))), [2]);

    let mut twice = t.clone();
    twice[1617] = [twice[1617][0], twice[1617][0], twice[1617][1]];
    let out = charted(&with(&clean, &twice));
    assert_eq!(out.repairs, ["1 face uses a vertex twice, face 1617: it was left out of the map"]);
    assert_eq!(loops(&out), [2]);
    assert!(out.places[4851..4854].iter().all(Option::is_some));
}

#[test]
fn what_cannot_be_resolved_is_an_error() {
    let clean = patch(40);
    let kind = |m: &Mesh| charts(m, &ChartOptions::default()).unwrap_err().kind();
    let mut nan = clean.clone();
    nan.points[500][0] = f64::NAN;
    assert_eq!(kind(&nan), ErrorKind::NonFinite);
    // A negative index that resolves to nothing never gets past a reader.
    let mut far = triangles(&clean);
    far[3][0] = 1_000_000;
    assert_eq!(kind(&with(&clean, &far)), ErrorKind::IndexOutOfRange);
    assert_eq!(kind(&Mesh::default()), ErrorKind::Empty);
    assert_eq!(kind(&with(&clean, &[[0, 0, 1]])), ErrorKind::Empty);
}
