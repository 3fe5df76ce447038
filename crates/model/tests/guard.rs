//! The guard against inversion, and what quasi-Newton methods ask of terms, against slow twins.

use proxel_model::elements::{Elements, Linear, Rest};
use proxel_model::energy::{Energy, NeoHookean};
use proxel_split::{InversionGuard, NormalMatrix, Problem, Quadratic, Term};
use proxel_testkit::{SplitMix, meshes};

const ENERGY: NeoHookean = NeoHookean { mu: 2.0, lambda: 5.0 };

/// A beam at rest, its left end held; positions, tetrahedra and the problem.
fn beam() -> (Vec<f64>, Vec<u32>, Problem) {
    let beam = meshes::beam(6, 2, 2, 0.25);
    let mut order: Vec<usize> = (0..beam.vertices.len()).collect();
    order.sort_by_key(|v| (beam.vertices[*v][0] < 1e-9, *v));
    let mut number = vec![0; order.len()];
    for (place, v) in order.iter().enumerate() {
        number[*v] = place as u32;
    }
    let rest: Vec<f64> = order.iter().flat_map(|v| beam.vertices[*v]).collect();
    let tets: Vec<u32> = beam.tets.iter().flatten().map(|v| number[*v as usize]).collect();
    let n_free = order.iter().filter(|v| beam.vertices[**v][0] > 1e-9).count();
    let solid = Rest::<3, 3>::new(&rest, &tets).expect("a beam");
    let term: Box<dyn Term> = Box::new(Elements::<3, 3, Linear>::new(&solid, ENERGY, 7.0));
    let quadratic = Quadratic::default();
    let problem = Problem { dim: 3, n_free, x0: rest.clone(), terms: vec![term], quadratic, barrier: true };
    (rest, tets, problem)
}

fn volume(x: &[f64], t: &[u32]) -> f64 {
    let e = |k: usize, d: usize| x[t[k] as usize * 3 + d] - x[t[0] as usize * 3 + d];
    let m: [[f64; 3]; 3] = std::array::from_fn(|k| std::array::from_fn(|d| e(k + 1, d)));
    m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
        + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
}

fn moved(x: &[f64], q: &[f64], t: f64) -> Vec<f64> {
    x.iter().enumerate().map(|(i, x)| x - t * q.get(i).copied().unwrap_or(0.0)).collect()
}

#[test]
fn the_limit_is_where_the_first_element_loses_its_volume() {
    let (rest, tets, problem) = beam();
    let mut guard = InversionGuard::new(&problem);
    assert!(!guard.is_armed());
    guard.arm(&rest);
    assert!(guard.is_armed());
    let mut random = SplitMix::new(5);
    let mut limited = 0;
    for size in [0.02, 0.1, 0.3] {
        for _ in 0..10 {
            let q: Vec<f64> = (0..problem.n_free * 3).map(|_| random.uniform(-size, size)).collect();
            let limit = guard.limit(&rest, &q, 2.0);
            let least = |t: f64| {
                let x = moved(&rest, &q, t);
                tets.chunks_exact(4).map(|t| volume(&x, t)).fold(f64::INFINITY, f64::min)
            };
            for k in 0..=100 {
                assert!(least(limit.min(2.0) * f64::from(k) / 100.0) >= -1e-12, "before the limit {limit}");
            }
            if limit.is_finite() {
                limited += 1;
                assert!(least(limit * 1.0001) < 0.0, "after the limit {limit}");
            }
        }
    }
    assert!((5..30).contains(&limited), "{limited} of 30 limited");
}

#[test]
fn the_filter_keeps_volumes_to_first_order_and_lets_harmless_directions_be() {
    let (rest, tets, problem) = beam();
    let mut guard = InversionGuard::new(&problem);
    guard.arm(&rest);
    // v + C p by differences of the cubic v(x + t p): its slope at 0.
    let linear = |q: &[f64]| {
        let h = 1e-6;
        let at = |t: f64, tet: &[u32]| volume(&moved(&rest, q, t), tet);
        let slopes = tets.chunks_exact(4).map(|t| at(0.0, t) + (at(h, t) - at(-h, t)) / (2.0 * h));
        slopes.fold(f64::INFINITY, f64::min) / volume(&rest, &tets[..4])
    };
    let mut random = SplitMix::new(6);
    for (size, acts) in [(0.002, false), (0.15, true)] {
        let before: Vec<f64> = (0..problem.n_free * 3).map(|_| random.uniform(-size, size)).collect();
        let mut q = before.clone();
        assert_eq!(guard.filter(&rest, &mut q), acts);
        assert_eq!(q == before, !acts);
        if acts {
            let (before, after) = (linear(&before), linear(&q));
            assert!(before < -0.5 && after > 0.25 * before, "{before} became {after}");
        }
    }
}

#[test]
fn the_patch_gradient_sums_the_faces_of_one_rings() {
    let (rest, tets, problem) = beam();
    let mut areas = vec![0.0; problem.n_free];
    for t in tets.chunks_exact(4) {
        for k in 0..4 {
            if let Some(area) = areas.get_mut(t[k] as usize) {
                let face: Vec<u32> = t.iter().copied().filter(|v| *v != t[k]).collect();
                let e = |a: usize, d: usize| rest[face[a] as usize * 3 + d] - rest[face[0] as usize * 3 + d];
                let (a, b): ([f64; 3], [f64; 3]) = (std::array::from_fn(|d| e(1, d)), std::array::from_fn(|d| e(2, d)));
                let n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
                *area += 0.5 * n.iter().map(|n| n * n).sum::<f64>().sqrt();
            }
        }
    }
    let hessian = ENERGY.hessian([1.0_f64; 3]);
    let norm = hessian.iter().flatten().map(|h| h * h).sum::<f64>().sqrt();
    let wanted = norm * areas.iter().map(|a| a * a).sum::<f64>().sqrt();
    assert!((problem.patch_gradient() - wanted).abs() < 1e-12 * wanted);
}

#[test]
fn scale_weights_and_products_are_those_of_the_elements() {
    let (rest, tets, problem) = beam();
    let term = &problem.terms[0];
    let total: f64 = tets.chunks_exact(4).map(|t| volume(&rest, t) / 6.0).sum();
    let scale = term.scale();
    assert!((scale.measure - total).abs() < 1e-12 * total);
    assert!((scale.weight2 - 7.0 * total).abs() < 1e-12 * total);
    let mut weights = vec![0.0; term.local_len()];
    term.local_weights2(&mut weights);
    // Nine numbers an element; padding weighs nothing.
    assert!((weights.iter().sum::<f64>() - 9.0 * 7.0 * total).abs() < 1e-11 * total);
    // A x by the solve: A^-1 (A x) = x.
    let mut normal = NormalMatrix::new(&problem).expect("a held beam");
    let mut random = SplitMix::new(7);
    let x: Vec<f64> = (0..problem.n_free * 3).map(|_| random.uniform(-1.0, 1.0)).collect();
    let mut y = vec![0.0; x.len()];
    normal.multiply(&x, &mut y).expect("a vector of the right length");
    normal.solve(&mut y).expect("a vector of the right length");
    assert!(x.iter().zip(&y).all(|(x, y)| (x - y).abs() < 1e-12));
}
