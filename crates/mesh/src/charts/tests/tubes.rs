//! Surfaces with several boundary loops: those with limbs are cut, what is flat is not.

use std::f64::consts::TAU;

use super::shapes::*;
use super::*;
use crate::Polygons;

/// A surface of revolution with `n` vertices a ring and a ring for each (radius, height); `slant` tilts the last one.
fn lathe(profile: &[[f64; 2]], n: usize, slant: f64) -> Mesh {
    let mut points = Vec::new();
    for (i, [r, z]) in profile.iter().enumerate() {
        let tilt = if i + 1 == profile.len() { slant } else { 0.0 };
        points
            .extend((0..n).map(|k| TAU * k as f64 / n as f64).map(|a| [r * a.cos(), r * a.sin(), z + tilt * a.cos()]));
    }
    let at = |i: usize, k: usize| (i * n + k % n) as u32;
    let mut faces = Polygons::new();
    for i in 1..profile.len() {
        for k in 0..n {
            faces.push(&[at(i - 1, k), at(i - 1, k + 1), at(i, k + 1)]);
            faces.push(&[at(i - 1, k), at(i, k + 1), at(i, k)]);
        }
    }
    Mesh { name: "lathe".into(), points, faces, ..Mesh::default() }
}

fn tube(length: f64, slant: f64) -> Mesh {
    let rings = 16;
    let profile: Vec<_> = (0..=rings).map(|i| [1.0, length * f64::from(i) / f64::from(rings)]).collect();
    lathe(&profile, 24, slant)
}

/// Without the faces at some vertices.
fn pierced(mesh: &Mesh, at: &[u32]) -> Mesh {
    let mut faces = Polygons::new();
    mesh.faces.iter().filter(|f| !f.iter().any(|v| at.contains(v))).for_each(|f| faces.push(f));
    Mesh { faces, ..mesh.clone() }
}

fn length(mesh: &Mesh, seams: &[[u32; 2]]) -> f64 {
    let at = |v: u32| mesh.points[v as usize];
    seams.iter().map(|&[a, b]| crate::vec3::norm(crate::vec3::sub(at(a), at(b)))).sum()
}

#[test]
fn a_long_tube_is_cut_from_end_to_end() {
    for (long, slant) in [(3.0, 0.0), (10.0, 0.0), (10.0, 0.8)] {
        let mesh = tube(long, slant);
        let out = charted(&mesh);
        assert_eq!(loops(&out), [1], "{long}");
        assert!(length(&mesh, &out.seams) < long + 1e-9, "{long}: no longer than the tube");
        assert!(out.repairs[0].starts_with("1 part of the surface has limbs and several"), "{:?}", out.repairs);
    }
}

#[test]
fn what_is_short_or_flat_is_not_cut() {
    let hemisphere: Vec<_> = (1..=12).rev().map(|i| TAU / 48.0 * f64::from(i)).map(|a| [a.sin(), a.cos()]).collect();
    let washer: Vec<_> = (0..=9).map(|i| [10.0 - f64::from(i), 0.0]).collect();
    for (name, mesh) in [
        ("short tube", tube(0.8, 0.0)),
        ("flat annulus", lathe(&washer, 24, 0.0)),
        ("hemisphere with a hole at its pole", lathe(&hemisphere, 24, 0.0)),
    ] {
        let out = charted(&mesh);
        assert_eq!((loops(&out), out.seams.len()), (vec![2], 0), "{name}");
    }
    let sheet = pierced(&crate::generate::cloth([20, 20], [1.0, 1.0]).unwrap(), &[100, 200, 300]);
    assert_eq!(loops(&charted(&sheet)), [4]);
}

#[test]
fn limbs_are_reached_past_small_holes() {
    // A bottle without a bottom: the cut goes to its closed end, or to the open one; a hole in its side stays.
    let profile: Vec<_> = (0..=30).map(|i| f64::from(i) / 3.0).map(|z| [if z < 5.0 { 2.0 } else { 0.7 }, z]).collect();
    let open = lathe(&profile, 24, 0.0);
    let closed = {
        let mut mesh = open.clone();
        let rim = 30 * 24;
        mesh.points.push([0.0, 0.0, 10.0]);
        (0..24).for_each(|k| mesh.faces.push(&[rim + k, rim + (k + 1) % 24, 31 * 24]));
        mesh
    };
    let whole = charted(&open);
    assert_eq!(loops(&whole), [1]);
    let out = charted(&pierced(&open, &[20 * 24 + 7]));
    assert!(length(&open, &out.seams) < 1.1 * length(&open, &whole.seams));
    // The closed bottle is a disk, which is never cut; with a hole in it, its closed end is a limb.
    assert_eq!((loops(&charted(&closed)), charted(&closed).seams.len()), (vec![1], 0));
    let out = charted(&pierced(&closed, &[20 * 24 + 7]));
    assert!(out.seams.iter().flatten().any(|&v| v >= 28 * 24), "{:?}", out.seams);
}

#[test]
fn a_box_without_the_middles_of_its_ends_is_a_tube() {
    let mut mesh = cube(6);
    mesh.points.iter_mut().for_each(|p| p[2] *= 8.0);
    let middle = |p: [f64; 3]| (0..2).all(|c| (p[c] - 0.5).abs() < 0.4);
    let ends: Vec<u32> = (0..mesh.n_verts() as u32)
        .filter(|&v| middle(mesh.points[v as usize]) && mesh.points[v as usize][2] % 8.0 == 0.0)
        .collect();
    let out = charted(&pierced(&mesh, &ends));
    assert_eq!(loops(&out), [1], "{:?}", out.repairs);
}
