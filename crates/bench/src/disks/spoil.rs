//! What a scan, a script or a careless export does to positions.

use proxel::mesh::{Mesh, topology};
use proxel_testkit::SplitMix;

/// Up to three of: noise along normals, jitter of all coordinates, anisotropic scaling, spikes, slivers, a change of units.
pub(super) fn random(mesh: &mut Mesh, random: &mut SplitMix, made: &mut Vec<String>) {
    for _ in 0..random.below(4) {
        match random.below(6) {
            0 => {
                let size = random.log_uniform(0.01, 2.0);
                let edge = mean_edge(mesh);
                let normals = normals(mesh);
                for (p, n) in mesh.points.iter_mut().zip(&normals) {
                    let by = size * edge * random.normal();
                    *p = [0, 1, 2].map(|d| p[d] + by * n[d]);
                }
                made.push(format!("noise of {size:.2} edges along normals"));
            }
            1 => {
                let size = random.log_uniform(0.01, 0.7);
                let edge = mean_edge(mesh);
                for p in &mut mesh.points {
                    *p = p.map(|v| v + size * edge * random.normal());
                }
                made.push(format!("noise of {size:.2} edges"));
            }
            2 => {
                let rotation = random.rotation();
                let factors = [1.0, random.log_uniform(0.02, 1.0), random.log_uniform(0.02, 1.0)];
                for p in &mut mesh.points {
                    *p = [0, 1, 2].map(|i| factors[i] * (0..3).map(|j| rotation[i][j] * p[j]).sum::<f64>());
                }
                made.push(format!("scaled by 1, {:.3}, {:.3}", factors[1], factors[2]));
            }
            3 => {
                let count = 1 + random.below(5);
                let edge = mean_edge(mesh);
                let size = random.log_uniform(2.0, 50.0);
                let normals = normals(mesh);
                for _ in 0..count.min(mesh.points.len()) {
                    let v = random.below(mesh.points.len());
                    mesh.points[v] = [0, 1, 2].map(|d| mesh.points[v][d] + size * edge * normals[v][d]);
                }
                made.push(format!("{count} spikes of {size:.1} edges"));
            }
            4 => slivers(mesh, random, made),
            _ => {
                let factor = random.log_uniform(1e-6, 1e6);
                for p in &mut mesh.points {
                    *p = p.map(|v| v * factor);
                }
                made.push(format!("in units of {factor:.1e}"));
            }
        }
    }
}

/// Some faces into three, at a point that can lie close to a side.
fn slivers(mesh: &mut Mesh, random: &mut SplitMix, made: &mut Vec<String>) {
    let mut triangles = mesh.faces.fan_triangles();
    if triangles.is_empty() {
        return;
    }
    let least = random.log_uniform(1e-6, 0.1);
    let count = 1 + random.below(triangles.len() / 10 + 1);
    for _ in 0..count {
        let f = random.below(triangles.len());
        let [a, b, c] = triangles[f];
        let w: [f64; 3] = std::array::from_fn(|_| random.log_uniform(least, 1.0));
        let sum: f64 = w.iter().sum();
        let at = |d: usize| [a, b, c].iter().zip(&w).map(|(v, w)| w / sum * mesh.points[*v as usize][d]).sum();
        let new = mesh.points.len() as u32;
        mesh.points.push([0, 1, 2].map(at));
        triangles[f] = [a, b, new];
        triangles.extend([[b, c, new], [c, a, new]]);
    }
    *mesh = Mesh::from_triangles(mesh.name.clone(), std::mem::take(&mut mesh.points), &triangles);
    made.push(format!("{count} faces into slivers of {least:.0e}"));
}

fn mean_edge(mesh: &Mesh) -> f64 {
    let edges = topology::face_edges(&mesh.faces);
    let length = |[a, b]: &[u32; 2]| {
        let (p, q) = (mesh.points[*a as usize], mesh.points[*b as usize]);
        (0..3).map(|d| (p[d] - q[d]).powi(2)).sum::<f64>().sqrt()
    };
    edges.iter().map(length).sum::<f64>() / edges.len().max(1) as f64
}

/// Unit normals of the vertices, weighted by area; zero where there is none.
fn normals(mesh: &Mesh) -> Vec<[f64; 3]> {
    let mut sums = vec![[0.0; 3]; mesh.points.len()];
    for t in mesh.faces.fan_triangles() {
        let [a, b, c] = t.map(|v| mesh.points[v as usize]);
        let (e, f) = ([0, 1, 2].map(|d| b[d] - a[d]), [0, 1, 2].map(|d| c[d] - a[d]));
        let n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
        for v in t {
            for d in 0..3 {
                sums[v as usize][d] += n[d];
            }
        }
    }
    let unit = |n: [f64; 3]| {
        let length = n.iter().map(|v| v * v).sum::<f64>().sqrt();
        if length > 0.0 { n.map(|v| v / length) } else { n }
    };
    sums.into_iter().map(unit).collect()
}
