//! Generated bodies: positive volumes, closed oriented boundaries of the right topology, quality.

use std::collections::HashMap;

use proxel_mesh::check::{check_tets, mean_ratio, require_volumes};
use proxel_mesh::generate::{OctopusSettings, ball, octopus, torus};
use proxel_mesh::topology::{boundary_surface, mesh_components};
use proxel_mesh::{Mesh, Polygons, topology};

/// V - E + F of the boundary, after checking that every edge has exactly two triangles that run
/// along it in opposite directions.
fn boundary_euler(mesh: &Mesh) -> i64 {
    let triangles = boundary_surface(&mesh.tets);
    let mut directed: HashMap<[u32; 2], u32> = HashMap::new();
    for t in &triangles {
        for e in topology::polygon_edges(t) {
            *directed.entry(e).or_default() += 1;
        }
    }
    for (&[a, b], &n) in &directed {
        assert_eq!((n, directed.get(&[b, a])), (1, Some(&1)), "edge {a}-{b} is no manifold edge");
    }
    let mut used: Vec<u32> = triangles.as_flattened().to_vec();
    used.sort_unstable();
    used.dedup();
    let edges = topology::face_edges(&Polygons::from(&triangles[..])).len();
    used.len() as i64 - edges as i64 + triangles.len() as i64
}

/// The volume inside the boundary by the divergence theorem. Equal to the sum of the volumes only if
/// nothing overlaps and every tetrahedron has the sign that its neighbours give it.
fn enclosed(mesh: &Mesh) -> f64 {
    let p = |v: u32| mesh.points[v as usize];
    let triple = |[a, b, c]: [[f64; 3]; 3]| {
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    boundary_surface(&mesh.tets).iter().map(|t| triple(t.map(p)) / 6.0).sum()
}

/// The smallest and the largest dihedral angle in degrees.
fn dihedral_range(mesh: &Mesh) -> (f64, f64) {
    let sub = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let mut range = (180f64, 0f64);
    for t in &mesh.tets {
        let x = t.map(|v| mesh.points[v as usize]);
        for [i, j] in topology::TET_EDGES {
            let mut others = (0..4).filter(|k| *k != i && *k != j);
            let (k, l) = (others.next().unwrap(), others.next().unwrap());
            let e = sub(x[j], x[i]);
            let flat = |p: [f64; 3]| {
                let q = sub(p, x[i]);
                let s = dot(q, e) / dot(e, e);
                [q[0] - s * e[0], q[1] - s * e[1], q[2] - s * e[2]]
            };
            let (u, v) = (flat(x[k]), flat(x[l]));
            let angle = (dot(u, v) / (dot(u, u) * dot(v, v)).sqrt()).clamp(-1.0, 1.0).acos().to_degrees();
            range = (range.0.min(angle), range.1.max(angle));
        }
    }
    range
}

fn examine(mesh: &Mesh, euler: i64, min_dihedral: f64) {
    let check = require_volumes(mesh).unwrap();
    assert!(check.slivers.is_empty());
    assert_eq!(boundary_euler(mesh), euler);
    assert!((enclosed(mesh) / check.total - 1.0).abs() < 1e-12);
    let components = mesh_components(mesh);
    assert_eq!((components.count, components.unreferenced().count()), (1, 0));
    let (lo, hi) = dihedral_range(mesh);
    let worst = mesh.tets.iter().map(|t| mean_ratio(t.map(|v| mesh.points[v as usize]))).fold(1.0, f64::min);
    println!(
        "{}: {} vertices, {} tets, dihedral {lo:.2} to {hi:.2}, worst mean ratio {worst:.3}",
        mesh.name,
        mesh.points.len(),
        mesh.tets.len()
    );
    assert!(lo > min_dihedral, "smallest dihedral angle {lo}");
}

#[test]
fn ball_is_a_sphere_inside() {
    let mesh = ball(1.0, 0.2).unwrap();
    examine(&mesh, 2, 14.0);
    for &v in boundary_surface(&mesh.tets).as_flattened() {
        let p = mesh.points[v as usize];
        assert!((p[0].hypot(p[1]).hypot(p[2]) - 1.0).abs() < 1e-10);
    }
    let volume = check_tets(&mesh.points, &mesh.tets).total;
    assert!((volume / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 0.02);
}

#[test]
fn torus_has_a_hole() {
    examine(&torus(1.0, 0.4, 0.15).unwrap(), 0, 14.0);
}

#[test]
fn octopus_is_one_closed_body_with_named_parts() {
    let o = octopus(&OctopusSettings::default()).unwrap();
    examine(&o.mesh, 2, 15.0);
    assert!((20_000..40_000).contains(&o.mesh.tets.len()));
    assert_eq!(o.arms.len(), 8);
    assert!(o.core.len() > 100);
    for arm in &o.arms {
        assert!(arm.tip.len() > 10, "{} vertices in a tip", arm.tip.len());
        let end = arm.axis.last().unwrap();
        for &v in &arm.tip {
            let p = o.mesh.points[v as usize];
            assert!((0..3).map(|c| (p[c] - end[c]).powi(2)).sum::<f64>().sqrt() < 0.5);
        }
    }
    assert_eq!(o.groups().len(), 9);
    assert_eq!(o, octopus(&OctopusSettings::default()).unwrap(), "the same bits again");
}

#[test]
fn octopus_at_other_resolutions() {
    for cell in [0.16, 0.125] {
        let o = octopus(&OctopusSettings { cell, ..Default::default() }).unwrap();
        examine(&o.mesh, 2, 10.0);
    }
}

#[test]
fn nonsense_is_refused() {
    assert!(ball(0.0, 0.1).is_err());
    assert!(ball(1.0, 1e-9).is_err());
    assert!(ball(f64::INFINITY, 0.1).is_err());
    assert!(torus(1.0, 1.0, 0.1).is_err());
    for (arms, cell) in [(0, 0.1), (17, 0.1), (8, 0.3), (8, f64::NAN), (8, 1e-6)] {
        assert!(octopus(&OctopusSettings { arms, cell }).is_err());
    }
}
