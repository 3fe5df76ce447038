//! Patches that are grown face by face, and random walks along edges.

use super::{NONE, Source};
use proxel::mesh::{Mesh, topology};
use proxel_testkit::SplitMix;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// How much of the order of growth is chance: none makes round patches, all makes branched ones with slits.
const CHANCE: [f64; 4] = [0.1, 1.0, 10.0, 1e6];

/// A disk of about so many faces of a surface: it grows from a random face, and takes a face only where it stays a disk.
pub(super) fn random(source: &Source, faces: usize, random: &mut SplitMix, made: &mut Vec<String>) -> Mesh {
    let chance = CHANCE[random.below(CHANCE.len())];
    let first = random.below(source.triangles.len());
    let mut taken = vec![false; source.triangles.len()];
    let mut inside = vec![false; source.mesh.points.len()];
    let mut chosen: Vec<[u32; 3]> = Vec::new();
    let mut queue = BinaryHeap::new();
    queue.push((Reverse(0_u64), first as u32));
    while let Some((Reverse(rank), f)) = queue.pop() {
        let f = f as usize;
        if taken[f] || chosen.len() >= faces || !(chosen.is_empty() || keeps(source, f, &taken, &inside)) {
            continue;
        }
        taken[f] = true;
        chosen.push(source.triangles[f]);
        for v in source.triangles[f] {
            inside[v as usize] = true;
        }
        for g in source.neighbours[f].into_iter().filter(|g| *g != NONE && !taken[*g as usize]) {
            queue.push((Reverse(rank + 1000 + random.uniform(0.0, 1000.0 * chance) as u64), g));
        }
    }
    made.push(format!("patch of {} ({} faces, chance {chance})", source.mesh.name, chosen.len()));
    Mesh::from_triangles(source.mesh.name.clone(), source.mesh.points.clone(), &chosen)
}

/// Whether the patch stays a disk with face f: it meets it along one edge with nothing at the third corner, or along two.
fn keeps(source: &Source, f: usize, taken: &[bool], inside: &[bool]) -> bool {
    let shared = |k: usize| source.neighbours[f][k] != NONE && taken[source.neighbours[f][k] as usize];
    match (0..3).filter(|k| shared(*k)).count() {
        1 => {
            let k = (0..3).find(|k| shared(*k)).unwrap_or(0);
            !inside[source.triangles[f][(k + 2) % 3] as usize]
        }
        2 => true,
        _ => false,
    }
}

/// Vertices of edges with one face.
fn boundary(mesh: &Mesh) -> Vec<u32> {
    let sorted = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
    let mut edges: Vec<[u32; 2]> = mesh.faces.iter().flat_map(topology::polygon_edges).map(sorted).collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).filter(|group| group.len() == 1).map(|group| group[0][0]).collect()
}

/// Edges of random walks over a mesh, each going on about straight.
pub(super) fn walks(mesh: &Mesh, random: &mut SplitMix) -> Vec<[u32; 2]> {
    let edges = topology::face_edges(&mesh.faces);
    let mut around = vec![Vec::new(); mesh.points.len()];
    for [a, b] in &edges {
        around[*a as usize].push(*b);
        around[*b as usize].push(*a);
    }
    // A slit begins on the boundary, where there is one: inside it would make a hole.
    let border = boundary(mesh);
    let first = match border.is_empty() {
        false => border[random.below(border.len())],
        true if edges.is_empty() => return Vec::new(),
        true => edges[random.below(edges.len())][0],
    };
    let mut path = Vec::new();
    let mut visited: Vec<u32> = vec![first];
    let steps = (edges.len() as f64).sqrt() as usize;
    for _ in 0..1 + random.below(8) {
        // Each begins on one of those before it, so that they hang together.
        let mut at = visited[random.below(visited.len())];
        let mut heading: [f64; 3] = random.array(-1.0, 1.0);
        for _ in 0..1 + random.below(steps.max(1)) {
            let away = |b: &u32| [0, 1, 2].map(|d| mesh.points[*b as usize][d] - mesh.points[at as usize][d]);
            let dot = |a: &[f64; 3], b: &[f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
            let straight = |b: &u32| dot(&away(b), &heading) / dot(&away(b), &away(b)).sqrt();
            let Some(next) = around[at as usize].iter().copied().max_by(|a, b| straight(a).total_cmp(&straight(b)))
            else {
                break;
            };
            path.push([at.min(next), at.max(next)]);
            let (step, turn): ([f64; 3], [f64; 3]) = (away(&next), random.array(-0.4, 0.4));
            let length = dot(&step, &step).sqrt().max(f64::MIN_POSITIVE);
            heading = [0, 1, 2].map(|d| step[d] / length + turn[d]);
            at = next;
            visited.push(at);
        }
    }
    path
}
