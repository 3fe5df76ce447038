//! Meshes of known topology.

use std::f64::consts::TAU;

use super::*;

pub fn mesh(points: Vec<[f64; 3]>, triangles: &[[u32; 3]]) -> Mesh {
    Mesh::from_triangles("test", points, triangles)
}

/// Points that do not lie on each other, for meshes whose topology is all that matters.
pub fn scattered(n: usize) -> Vec<[f64; 3]> {
    (0..n).map(|i| [1.3, 2.1, 3.7].map(|k| (k * i as f64).sin())).collect()
}

/// A grid of m x n quads on a torus, a cylinder (`wrap` in one direction) or a rectangle, with triangles. `twist` turns
/// the first direction around where it closes: a Moebius strip, a Klein bottle.
pub fn grid(m: usize, n: usize, wrap: [bool; 2], twist: bool, quads: bool) -> Mesh {
    let (mv, nv) = (m + usize::from(!wrap[0]), n + usize::from(!wrap[1]));
    let at = |i: usize, j: usize| {
        let turns = twist && i == m;
        let j = if turns { if wrap[1] { (n - j % n) % n } else { n - j } } else { j };
        ((i % mv) * nv + j % nv) as u32
    };
    let points = (0..mv * nv)
        .map(|k| {
            let (u, v) = (TAU * (k / nv) as f64 / m as f64, TAU * (k % nv) as f64 / n as f64);
            let r = 3.0 + v.cos();
            [r * u.cos(), r * u.sin(), v.sin()]
        })
        .collect();
    let mut faces = crate::Polygons::new();
    for i in 0..m {
        for j in 0..n {
            let q = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            if quads {
                faces.push(&q);
            } else {
                faces.push(&[q[0], q[1], q[2]]);
                faces.push(&[q[0], q[2], q[3]]);
            }
        }
    }
    Mesh { name: "grid".into(), points, faces, ..Mesh::default() }
}

/// A flat ring of m x n quads.
pub fn annulus(m: usize, n: usize, quads: bool) -> Mesh {
    let mut out = grid(m, n, [true, false], false, quads);
    for (k, p) in out.points.iter_mut().enumerate() {
        let (angle, r) = (TAU * (k / (n + 1)) as f64 / m as f64, 1.0 + (k % (n + 1)) as f64 / n as f64);
        *p = [r * angle.cos(), r * angle.sin(), 0.0];
    }
    out
}

pub fn tetrahedron() -> Mesh {
    let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    mesh(points, &[[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
}

/// The surface of n x n x n cells with square faces.
pub fn cube(n: usize) -> Mesh {
    let mut index = std::collections::BTreeMap::new();
    let mut out = Mesh { name: "cube".into(), ..Mesh::default() };
    for axis in 0..3 {
        for end in [0, n] {
            for i in 0..n {
                for j in 0..n {
                    let corner = |di: usize, dj: usize| {
                        let mut p = [0; 3];
                        (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (end, i + di, j + dj);
                        p
                    };
                    let mut q = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                    if end == 0 {
                        q.reverse();
                    }
                    let q = q.map(|p| {
                        *index.entry(p).or_insert_with(|| {
                            out.points.push(p.map(|c| c as f64 / n as f64));
                            out.points.len() as u32 - 1
                        })
                    });
                    out.faces.push(&q);
                }
            }
        }
    }
    out
}

/// Several meshes as one, without common vertices.
pub fn together(meshes: &[Mesh]) -> Mesh {
    let mut out = Mesh { name: "together".into(), ..Mesh::default() };
    for m in meshes {
        let base = out.points.len() as u32;
        out.points.extend(m.points.iter().map(|p| [p[0] + 10.0 * f64::from(base), p[1], p[2]]));
        m.faces.iter().for_each(|p| out.faces.push(&p.iter().map(|v| v + base).collect::<Vec<_>>()));
    }
    out
}

/// Two tori joined where each lacks a triangle: genus 2.
pub fn double_torus() -> Mesh {
    let one = grid(9, 7, [true; 2], false, false);
    let n = one.points.len() as u32;
    let two = together(&[one.clone(), one.clone()]);
    let triangles = two.faces.as_triangles().unwrap();
    let holes = [40, 40 + one.faces.len()];
    // The three vertices of the second hole become those of the first, in the other direction.
    let (a, b) = (triangles[holes[0]], triangles[holes[1]]);
    let moved = |v: u32| match b.iter().position(|&w| w == v) {
        Some(k) => a[(3 - k) % 3],
        None => v,
    };
    let rest: Vec<[u32; 3]> =
        (0..triangles.len()).filter(|f| !holes.contains(f)).map(|f| triangles[f].map(moved)).collect();
    assert!(rest.iter().flatten().all(|&v| v < 2 * n));
    mesh(two.points, &rest)
}

/// The surface of a body, with vertices that no face uses left in.
pub fn skin(body: &Mesh) -> Mesh {
    mesh(body.points.clone(), &crate::topology::boundary_surface(&body.tets))
}
