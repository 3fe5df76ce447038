//! Smooth normals that keep creases.

use super::vec::{V3, add, cross, direction, dot, scale, sub};

/// The normal of each corner of each triangle: the mean of the normals of the faces around its
/// vertex, weighted by their angle there, over those within `crease` degrees of its own.
pub(super) fn corner_normals(points: &[V3], triangles: &[[u32; 3]], crease: f64) -> Vec<[V3; 3]> {
    let faces: Vec<V3> = triangles.iter().map(|t| face_normal(t.map(|v| points[v as usize]))).collect();
    let mut starts = vec![0u32; points.len() + 1];
    triangles.iter().flatten().for_each(|&v| starts[v as usize + 1] += 1);
    (0..points.len()).for_each(|v| starts[v + 1] += starts[v]);
    let mut next = starts.clone();
    let mut corners = vec![(0u32, 0u8); 3 * triangles.len()]; // the triangles around each vertex
    for (i, t) in triangles.iter().enumerate() {
        for (k, &v) in t.iter().enumerate() {
            corners[next[v as usize] as usize] = (i as u32, k as u8);
            next[v as usize] += 1;
        }
    }
    let angles: Vec<[f64; 3]> = triangles.iter().map(|t| corner_angles(t.map(|v| points[v as usize]))).collect();
    let least = crease.to_radians().cos();
    let normal = |i: usize, v: u32| {
        let around = &corners[starts[v as usize] as usize..starts[v as usize + 1] as usize];
        let near = around.iter().filter(|c| dot(faces[c.0 as usize], faces[i]) >= least);
        let sum =
            near.fold([0.0; 3], |sum, &(f, k)| add(sum, scale(angles[f as usize][k as usize], faces[f as usize])));
        direction(sum, faces[i])
    };
    triangles.iter().enumerate().map(|(i, t)| t.map(|v| normal(i, v))).collect()
}

pub(super) fn face_normal([a, b, c]: [V3; 3]) -> V3 {
    direction(cross(sub(b, a), sub(c, a)), [0.0; 3])
}

fn corner_angles(x: [V3; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| {
        let (u, v) = (sub(x[(k + 1) % 3], x[k]), sub(x[(k + 2) % 3], x[k]));
        let n = cross(u, v);
        dot(n, n).sqrt().atan2(dot(u, v))
    })
}
