//! Smoothing that can only improve: a vertex moves towards the middle of its neighbours if the
//! worst tetrahedron around it gets better.

use crate::check::{corners, mean_ratio};
use crate::topology::{tet_faces, vertex_elements};
use crate::vec3::{V3, add, dot, lerp, scale, sub};

/// Runs `rounds` sweeps in the order of the vertices. Vertices `on_surface` stay on `field` = 0;
/// their neighbours are those on the surface.
pub(super) fn smooth(
    field: &dyn Fn(V3) -> f64,
    points: &mut [V3],
    tets: &[[u32; 4]],
    on_surface: &[bool],
    cell: f64,
    rounds: usize,
) {
    let around = vertex_elements(points.len(), tets.iter().map(|t| &t[..]));
    let boundary = tet_faces(tets).boundary;
    let boundary_around = vertex_elements(points.len(), boundary.iter().map(|t| &t[..]));
    for _ in 0..rounds {
        for v in 0..points.len() {
            let row = around.row(v);
            let here = points[v];
            let middle = if on_surface[v] {
                mean_of_others(points, &boundary, boundary_around.row(v), v)
            } else {
                mean_of_others(points, tets, row, v)
            };
            let Some(middle) = middle else { continue };
            let worst = |points: &[V3]| {
                row.iter().map(|&t| mean_ratio(corners(points, tets[t as usize]))).fold(f64::INFINITY, f64::min)
            };
            let before = worst(points);
            for step in [1.0, 0.5] {
                points[v] = lerp(here, middle, step);
                // The projection is dear and moves little: only for what promises to be better.
                if on_surface[v] && worst(points) > before {
                    points[v] = project(field, points[v], cell);
                }
                if worst(points) > before {
                    break;
                }
                points[v] = here;
            }
        }
    }
}

/// The mean of all corners but `v` itself, each as often as it occurs.
fn mean_of_others<const K: usize>(points: &[V3], elements: &[[u32; K]], row: &[u32], v: usize) -> Option<V3> {
    let mut sum = [0.0; 3];
    let mut n = 0;
    for &e in row {
        for &w in &elements[e as usize] {
            if w as usize != v {
                sum = add(sum, points[w as usize]);
                n += 1;
            }
        }
    }
    (n > 0).then(|| scale(1.0 / f64::from(n), sum))
}

/// Chord steps along the gradient at `p` onto `field` = 0.
fn project(field: &dyn Fn(V3) -> f64, mut p: V3, cell: f64) -> V3 {
    let g = gradient(field, p, 1e-5 * cell);
    let g2 = dot(g, g);
    if g2 == 0.0 {
        return p;
    }
    for _ in 0..20 {
        let f = field(p);
        if f.abs() < 1e-11 * cell {
            break;
        }
        p = sub(p, scale(f / g2, g));
    }
    p
}

fn gradient(field: &dyn Fn(V3) -> f64, p: V3, h: f64) -> V3 {
    std::array::from_fn(|c| {
        let (mut a, mut b) = (p, p);
        a[c] -= h;
        b[c] += h;
        (field(b) - field(a)) / (2.0 * h)
    })
}
