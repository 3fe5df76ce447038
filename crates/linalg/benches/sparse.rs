//! Order, analysis, factor and solve of the sparse Cholesky, in milliseconds: minima over repetitions.
//!
//! The matrix is `sum V_e D^T D` of the centaur's tetrahedra with its pins eliminated when `PROXEL_DATA` names the
//! data folder, else that of a grid of about as many vertices.
//!
//! `cargo bench -p proxel-linalg --bench sparse -- [threads...]`

use proxel_linalg::sparse::{
    Cholesky, MixedCholesky, MixedScratch, Ordering, Scalar, SolveScratch, SymPattern, Symbolic,
};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Rest positions, tetrahedra and pinned vertices.
struct Mesh {
    name: &'static str,
    vertices: Vec<[f64; 3]>,
    tets: Vec<[u32; 4]>,
    pinned: Vec<bool>,
}

fn numbers(path: &Path) -> Option<Vec<f64>> {
    let text = std::fs::read_to_string(path).ok()?;
    text.split_whitespace().map(|word| word.parse().ok()).collect()
}

fn centaur() -> Option<Mesh> {
    let folder = Path::new(&std::env::var_os("PROXEL_DATA")?).join("quasistatic/centaur");
    let nodes = numbers(&folder.join("rest.node"))?;
    let tets = numbers(&folder.join("rest.ele"))?;
    let vertices: Vec<[f64; 3]> = nodes[4..].chunks_exact(4).map(|v| [v[1], v[2], v[3]]).collect();
    let tets = tets[3..].chunks_exact(5).map(|t| [t[1] as u32, t[2] as u32, t[3] as u32, t[4] as u32]).collect();
    let mut pinned = vec![false; vertices.len()];
    for pin in numbers(&folder.join("handles.txt"))? {
        pinned[pin as usize] = true;
    }
    Some(Mesh { name: "centaur", vertices, tets, pinned })
}

/// A bar of cubes, six tetrahedra each, pinned at both ends.
fn bar(a: usize, b: usize, c: usize) -> Mesh {
    let id = |i: usize, j: usize, k: usize| ((i * (b + 1) + j) * (c + 1) + k) as u32;
    let (mut vertices, mut tets, mut pinned) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..=a {
        for j in 0..=b {
            for k in 0..=c {
                vertices.push([i as f64, j as f64, k as f64]);
                pinned.push(i == 0 || i == a);
                if i < a && j < b && k < c {
                    for path in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
                        let mut corner = [i, j, k];
                        let mut tet = [id(i, j, k); 4];
                        for (step, axis) in path.into_iter().enumerate() {
                            corner[axis] += 1;
                            tet[step + 1] = id(corner[0], corner[1], corner[2]);
                        }
                        tets.push(tet);
                    }
                }
            }
        }
    }
    Mesh { name: "bar", vertices, tets, pinned }
}

/// `sum V_e D^T D` over the free vertices, D the gradients of the linear basis functions.
fn laplacian(mesh: &Mesh) -> (SymPattern, Vec<f64>) {
    let mut number = vec![u32::MAX; mesh.vertices.len()];
    let mut n = 0;
    for (v, &pinned) in mesh.pinned.iter().enumerate() {
        if !pinned {
            number[v] = n;
            n += 1;
        }
    }
    let free: Vec<Vec<u32>> =
        mesh.tets.iter().map(|t| t.iter().map(|&v| number[v as usize]).filter(|&v| v != u32::MAX).collect()).collect();
    let pattern = SymPattern::from_cliques(n as usize, &free).expect("vertices were counted");
    let mut values = vec![0.0; pattern.nnz()];
    for tet in &mesh.tets {
        let p = tet.map(|v| mesh.vertices[v as usize]);
        let edge = |a: usize, b: usize| std::array::from_fn::<f64, 3, _>(|k| p[b][k] - p[a][k]);
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (e, f, g) = (edge(0, 1), edge(0, 2), edge(0, 3));
        let six = dot(e, cross(f, g));
        let mut gradient = [[0.0; 3], cross(f, g), cross(g, e), cross(e, f)];
        for k in 0..3 {
            for corner in 1..4 {
                gradient[corner][k] /= six;
            }
            gradient[0][k] = -(gradient[1][k] + gradient[2][k] + gradient[3][k]);
        }
        for a in 0..4 {
            for b in 0..=a {
                let (i, j) = (number[tet[a] as usize], number[tet[b] as usize]);
                if i != u32::MAX && j != u32::MAX {
                    let slot = pattern.slot(i as usize, j as usize).expect("elements are cliques");
                    values[slot] += six.abs() / 6.0 * dot(gradient[a], gradient[b]);
                }
            }
        }
    }
    (pattern, values)
}

/// Least milliseconds over repetitions within `seconds`, at least three.
fn least(seconds: f64, mut f: impl FnMut()) -> f64 {
    let (start, mut best, mut count) = (Instant::now(), Duration::MAX, 0);
    while count < 3 || start.elapsed().as_secs_f64() < seconds {
        let t = Instant::now();
        f();
        best = best.min(t.elapsed());
        count += 1;
    }
    best.as_secs_f64() * 1e3
}

fn factor_and_solve<T: Scalar>(symbolic: &Arc<Symbolic>, values: &[f64], name: &str) {
    let n = symbolic.n();
    let mut factor = Cholesky::<T>::new(symbolic.clone());
    let refactor = least(1.0, || factor.refactor(values).expect("positive definite"));
    let mut scratch = SolveScratch::new();
    let solves: Vec<String> = [3, 2, 1]
        .into_iter()
        .map(|nrhs| {
            let rhs: Vec<f64> = (0..n * nrhs).map(|k| ((k * 7919) % 1000) as f64 / 500.0 - 1.0).collect();
            let mut x = rhs.clone();
            let ms = least(1.0, || {
                x.copy_from_slice(&rhs);
                factor.solve_in_place(&mut x, nrhs, &mut scratch).expect("factored");
            });
            format!("{nrhs} rhs {ms:.2}")
        })
        .collect();
    println!(
        "  {name}: refactor {refactor:.1}  solve {}   ({:.1} + {:.1} MB)",
        solves.join("  "),
        factor.bytes().0 as f64 / 1e6,
        factor.bytes().1 as f64 / 1e6
    );
}

/// Solves to 1e-12 with an f32 factor.
fn mixed(pattern: &SymPattern, symbolic: &Arc<Symbolic>, values: &[f64], threads: usize) {
    let n = symbolic.n();
    let mut factor = MixedCholesky::new(pattern, symbolic.clone()).expect("the same pattern");
    factor.refactor(values).expect("positive definite");
    let rhs: Vec<f64> = (0..n * 3).map(|k| ((k * 7919) % 1000) as f64 / 500.0 - 1.0).collect();
    let (mut x, mut scratch, mut end) = (rhs.clone(), MixedScratch::new(), None);
    let ms = least(0.5, || {
        x.copy_from_slice(&rhs);
        end = factor.solve_in_place(&mut x, 3, 1e-12, &mut scratch).ok();
    });
    println!("  f32 corrected, {threads} threads: 3 rhs {ms:.2}  {end:?}");
}

fn main() {
    let threads: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let threads = if threads.is_empty() { vec![1, 2] } else { threads };
    let mesh = centaur().unwrap_or_else(|| bar(60, 20, 20));
    let (pattern, values) = laplacian(&mesh);
    println!("{}: n {}, {} entries", mesh.name, pattern.n(), pattern.nnz());
    let orderings = match std::env::var("ORDERINGS").as_deref() {
        Ok("all") => vec![Ordering::Amf, Ordering::Amd, Ordering::NestedDissection],
        _ => vec![Ordering::Auto],
    };
    for ordering in orderings {
        let analyze = |o: Ordering| Symbolic::analyze(&pattern, o).expect("sound pattern");
        let total = least(0.5, || drop(analyze(ordering.clone())));
        let symbolic = Arc::new(analyze(ordering.clone()));
        let given = Ordering::Given(symbolic.permutation().forward().to_vec());
        let analysis = least(0.5, || drop(analyze(given.clone())));
        println!(
            "{ordering:?}: order {:.1}, analysis {analysis:.1}, nnz(L) {}, {:.3} GF, {} supernodes",
            total - analysis,
            symbolic.factor_nnz(),
            symbolic.factor_flops() / 1e9,
            symbolic.supernode_count()
        );
        for &count in &threads {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("a pool");
            pool.install(|| {
                factor_and_solve::<f64>(&symbolic, &values, &format!("f64, {count} threads"));
                factor_and_solve::<f32>(&symbolic, &values, &format!("f32, {count} threads"));
                mixed(&pattern, &symbolic, &values, count);
            });
        }
    }
}
