//! Decimation without care for shape: random edges are collapsed.

use super::compact;
use proxel::mesh::{Mesh, topology};
use proxel_testkit::SplitMix;

/// Collapses random edges until a random part of the faces is left.
pub(super) fn random(mesh: &Mesh, random: &mut SplitMix, made: &mut Vec<String>) -> Mesh {
    let part = random.uniform(0.1, 0.9);
    let wanted = ((part * mesh.faces.len() as f64) as usize).max(60);
    let mut mesh = mesh.clone();
    let before = mesh.faces.len();
    for _ in 0..40 {
        let n = mesh.faces.len();
        if n <= wanted {
            break;
        }
        mesh = round(&mesh, (n - wanted).div_ceil(2), random);
        if mesh.faces.len() == n {
            break;
        }
    }
    made.push(format!("collapsed from {before} faces to {}", mesh.faces.len()));
    mesh
}

/// At most `most` collapses that do not touch each other: the second end goes to the first, or both to their middle.
fn round(mesh: &Mesh, most: usize, random: &mut SplitMix) -> Mesh {
    let triangles = mesh.faces.fan_triangles();
    let around = topology::vertex_elements(mesh.points.len(), triangles.iter().map(|t| &t[..]));
    let mut edges = topology::face_edges(&mesh.faces);
    for k in (1..edges.len()).rev() {
        edges.swap(k, random.below(k + 1));
    }
    let ring = |v: u32| {
        let of = |f: &u32| triangles[*f as usize];
        let mut ring: Vec<u32> = around.row(v as usize).iter().flat_map(of).filter(|w| *w != v).collect();
        ring.sort_unstable();
        let boundary = ring.chunk_by(|a, b| a == b).any(|group| group.len() == 1);
        ring.dedup();
        (ring, boundary)
    };
    let mut locked = vec![false; mesh.points.len()];
    let mut points = mesh.points.clone();
    let mut to: Vec<u32> = (0..mesh.points.len() as u32).collect();
    let mut done = 0;
    for [a, b] in edges {
        if done >= most {
            break;
        }
        let ((ring_a, border_a), (ring_b, border_b)) = (ring(a), ring(b));
        if ring_a.iter().chain(&ring_b).any(|v| locked[*v as usize]) {
            continue;
        }
        // The link condition: besides the corners opposite the edge they have no common neighbours.
        let common = ring_a.iter().filter(|v| ring_b.binary_search(v).is_ok()).count();
        let faces = around.row(a as usize).iter().filter(|f| triangles[**f as usize].contains(&b)).count();
        let across = border_a && border_b && faces == 2;
        if common != faces || across || (border_b && !border_a) {
            continue;
        }
        if border_a == border_b && random.below(2) == 0 {
            let (p, q) = (points[a as usize], points[b as usize]);
            points[a as usize] = [0, 1, 2].map(|d| 0.5 * (p[d] + q[d]));
        }
        to[b as usize] = a;
        done += 1;
        for v in ring_a.iter().chain(&ring_b) {
            locked[*v as usize] = true;
        }
    }
    let kept = triangles.iter().map(|t| t.map(|v| to[v as usize])).filter(|[a, b, c]| a != b && b != c && c != a);
    compact(&Mesh::from_triangles(mesh.name.clone(), points, &kept.collect::<Vec<_>>()), mesh.name.clone())
}
