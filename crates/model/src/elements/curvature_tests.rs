//! Second derivatives of batches against differences of their gradients, for every energy and shape.

use super::*;
use crate::energy::{Energy, EnergyVisitor, Lame, names, visit_1d, visit_2d, visit_3d};
use proxel_linalg::sparse::BlockMatrix;
use proxel_split::Projection;
use proxel_testkit::random::SplitMix as Random;

/// A batch around some nodes: rest positions, elements, and the pattern of its free nodes, all but the last.
struct Case<const D: usize, const K: usize> {
    rest: Rest<D, K>,
    x: Vec<f64>,
    free: usize,
    pattern: SymPattern,
}

impl<const D: usize, const K: usize> Case<D, K> {
    /// Elements of consecutive nodes in a random cloud, moved by `amount` from a stretched state.
    fn new(random: &mut Random, amount: f64) -> Self {
        let n = 9;
        let positions: Vec<f64> = loop {
            let cloud: Vec<f64> = (0..n * D).map(|_| random.uniform(-1.0, 1.0)).collect();
            if let Ok(rest) = Rest::<D, K>::new(&cloud, &Self::elements(n, &cloud))
                && (0..n - K).all(|e| rest.measure(e) > 0.05)
            {
                break cloud;
            }
        };
        let elements = Self::elements(n, &positions);
        let rest = Rest::<D, K>::new(&positions, &elements).expect("measured above");
        let x = positions.iter().map(|v| 1.1 * v + amount * random.uniform(-1.0, 1.0)).collect();
        let free = n - 1;
        let cliques: Vec<Vec<u32>> =
            elements.chunks(K + 1).map(|e| e.iter().copied().filter(|v| (*v as usize) < free).collect()).collect();
        let pattern = SymPattern::from_cliques(free, &cliques).expect("nodes in range");
        Case { rest, x, free, pattern }
    }

    /// Runs of K + 1 nodes, turned to positive measure where there is a sign.
    fn elements(n: usize, x: &[f64]) -> Vec<u32> {
        let mut out = Vec::new();
        for first in 0..n - K {
            let mut e: Vec<u32> = (first..=first + K).map(|v| v as u32).collect();
            let edge = |k: usize, d: usize| x[e[k] as usize * D + d] - x[e[0] as usize * D + d];
            let negative = match (D, K) {
                (2, 2) => edge(1, 0) * edge(2, 1) - edge(1, 1) * edge(2, 0) < 0.0,
                (3, 3) => {
                    let minor = |a: usize, b: usize| edge(2, a) * edge(3, b) - edge(2, b) * edge(3, a);
                    edge(1, 0) * minor(1, 2) + edge(1, 1) * minor(2, 0) + edge(1, 2) * minor(0, 1) < 0.0
                }
                _ => false,
            };
            if negative {
                e.swap(0, 1);
            }
            out.extend(e);
        }
        out
    }
}

/// The dense matrix behind a [`BlockMatrix`].
fn dense(matrix: &BlockMatrix) -> Vec<Vec<f64>> {
    let n = matrix.n();
    (0..n)
        .map(|j| {
            let (mut e, mut column) = (vec![0.0; n], vec![0.0; n]);
            e[j] = 1.0;
            matrix.multiply(&e, &mut column).expect("lengths fit");
            column
        })
        .collect()
}

/// The least eigenvalue, and the largest magnitude, of a symmetric matrix, by Jacobi's rotations.
fn extremes(mut a: Vec<Vec<f64>>) -> (f64, f64) {
    let n = a.len();
    for _ in 0..30 {
        for p in 0..n {
            for q in p + 1..n {
                if a[p][q] == 0.0 {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let t = if theta == 0.0 { 1.0 } else { t };
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for k in 0..n {
                    let (x, y) = (a[k][p], a[k][q]);
                    (a[k][p], a[k][q]) = (c * x - s * y, s * x + c * y);
                }
                for k in 0..n {
                    let (x, y) = (a[p][k], a[q][k]);
                    (a[p][k], a[q][k]) = (c * x - s * y, s * x + c * y);
                }
            }
        }
    }
    let diagonal = || (0..n).map(|i| a[i][i]);
    (diagonal().fold(f64::INFINITY, f64::min), diagonal().fold(0.0, |m: f64, v| m.max(v.abs())))
}

/// How many states had a true Hessian that was positive semidefinite element by element, and how many had not.
#[derive(Default)]
struct Seen {
    definite: usize,
    indefinite: usize,
}

struct Check<'a, const D: usize, const K: usize> {
    case: &'a Case<D, K>,
    seen: &'a mut Seen,
}

impl<const D: usize, const K: usize> EnergyVisitor<K> for Check<'_, D, K>
where
    Simplex: Shape<D, K>,
    Linear: Coupling<D, K>,
    Polar: Coupling<D, K>,
{
    type Output = ();
    fn visit<E: Energy<K>>(self, energy: E) {
        let Case { rest, x, free, pattern } = self.case;
        let base = energy.rest_stiffness();
        let mut term = Elements::<D, K, Polar>::new(rest, energy, base);
        let n = free * D;
        if !term.energy(x, None).value.is_finite() {
            return; // outside the domain of a barrier
        }
        term.prepare(pattern);
        let mut hessian = |projection| {
            let mut matrix = BlockMatrix::new(pattern, D).expect("a small matrix");
            term.add_hessian(x, projection, matrix.values_mut());
            dense(&matrix)
        };
        let all =
            [Projection::None, Projection::Clamp, Projection::Absolute, Projection::Reweighted, Projection::Killing];
        let [raw, clamped, absolute, proxy, killing] = all.map(&mut hessian);
        let scale = raw.iter().flatten().fold(0.0, |m: f64, v| m.max(v.abs()));
        let h = 1e-5;
        let gradient = |term: &mut Elements<D, K, Polar>, j: usize, d: f64| {
            let (mut y, mut g) = (x.clone(), vec![0.0; n]);
            y[j] += d;
            term.energy(&y, Some(&mut g));
            g
        };
        for j in 0..n {
            let (up, down) = (gradient(&mut term, j, h), gradient(&mut term, j, -h));
            for i in 0..n {
                let slope = (up[i] - down[i]) / (2.0 * h);
                let gap = (slope - raw[j][i]).abs();
                assert!(gap <= 2e-5 * scale, "{} {D}x{K} ({i}, {j}): {slope} {} of {scale}", E::NAME, raw[j][i]);
                assert!((raw[j][i] - raw[i][j]).abs() <= 1e-13 * scale);
            }
        }
        for projected in [&clamped, &absolute, &proxy, &killing] {
            let (least, size) = extremes(projected.clone());
            assert!(least >= -1e-10 * size, "{} {D}x{K}: {least} of {size}", E::NAME);
        }
        let same = |a: &Vec<Vec<f64>>| {
            a.iter().flatten().zip(raw.iter().flatten()).all(|(a, b)| (a - b).abs() <= 1e-11 * scale)
        };
        assert_eq!(same(&clamped), same(&absolute), "both change it, or none");
        if same(&clamped) {
            self.seen.definite += 1;
        } else {
            // Clamping adds what absolute values add twice.
            for i in 0..n {
                for j in 0..n {
                    let (once, twice) = (clamped[i][j] - raw[i][j], absolute[i][j] - raw[i][j]);
                    assert!((2.0 * once - twice).abs() <= 1e-9 * scale, "{}: {once} {twice}", E::NAME);
                }
            }
            self.seen.indefinite += 1;
        }
    }
}

macro_rules! check {
    ($name:ident $visit:ident $d:literal $k:literal) => {
        #[test]
        fn $name() {
            let lame = Lame::new(1.3, 2.1).expect("a material");
            let mut random = Random::new(40 + 10 * $d + $k);
            let mut seen = Seen::default();
            for amount in [0.0, 0.05, 0.3] {
                let case = Case::<$d, $k>::new(&mut random, amount);
                for energy in names($k) {
                    $visit(energy, &lame, Check { case: &case, seen: &mut seen }).expect("known");
                }
            }
            assert!(seen.definite >= 1 && seen.indefinite >= 1, "{} {}", seen.definite, seen.indefinite);
        }
    };
}
check!(tetrahedra visit_3d 3 3);
check!(triangles_in_space visit_2d 3 2);
check!(triangles_in_the_plane visit_2d 2 2);
check!(springs_in_space visit_1d 3 1);
check!(springs_in_the_plane visit_1d 2 1);

#[test]
fn a_warped_step_is_the_step_to_second_order_and_a_turn_exactly() {
    let mut random = Random::new(3);
    let case = Case::<3, 3>::new(&mut random, 0.1);
    let energy = crate::energy::Arap::default();
    let mut term = Elements::<3, 3, Polar>::new(&case.rest, energy, 2.0);
    let n = case.free * 3;
    let step: Vec<f64> = (0..n).map(|_| random.uniform(-1.0, 1.0)).collect();
    // F - T of the step t d, up to sign, against that of the straight target: the normal matrix times -t d.
    let mut straight = vec![0.0; n];
    let mut normal = vec![0.0; case.pattern.nnz()];
    term.add_normal(&case.pattern, &mut normal);
    case.pattern.multiply(&normal, &step, 3, &mut straight).expect("lengths fit");
    let gap = |term: &mut Elements<3, 3, Polar>, t: f64| {
        let scaled: Vec<f64> = step.iter().map(|d| t * d).collect();
        let mut grad = vec![0.0; n];
        term.add_warped_gradient(&case.x, &scaled, &mut grad);
        grad.iter().zip(&straight).map(|(g, s)| (g + t * s).powi(2)).sum::<f64>().sqrt()
    };
    let (coarse, fine) = (gap(&mut term, 1e-4), gap(&mut term, 1e-5));
    assert!(coarse > 0.0 && (coarse / fine / 100.0 - 1.0).abs() < 0.2, "{coarse} {fine}");

    // All corners of one element turned by 0.3 about z: its F turns by that, up to the fifth order.
    let (x, tets) = (vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], [0, 1, 2, 3]);
    let rest = Rest::<3, 3>::new(&x, &tets).expect("a tetrahedron");
    let mut term = Elements::<3, 3, Polar>::new(&rest, energy, 2.0);
    let angle = 0.3;
    let spin: Vec<f64> = x.chunks(3).flat_map(|p| [-angle * p[1], angle * p[0], 0.0]).collect();
    let mut grad = vec![0.0; 12];
    term.add_warped_gradient(&x, &spin, &mut grad);
    let turned: Vec<f64> = x
        .chunks(3)
        .flat_map(|p| {
            let (sin, cos) = f64::sin_cos(angle);
            [cos * p[0] - sin * p[1] - p[0], sin * p[0] + cos * p[1] - p[1], 0.0]
        })
        .collect();
    let pattern = SymPattern::from_cliques(4, &[tets]).expect("four nodes");
    let mut normal = vec![0.0; pattern.nnz()];
    term.add_normal(&pattern, &mut normal);
    let mut want = vec![0.0; 12];
    pattern.multiply(&normal, &turned, 3, &mut want).expect("lengths fit");
    let size = want.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    for (g, w) in grad.iter().zip(&want) {
        assert!((g + w).abs() < angle.powi(5) * size, "{g} {w}");
    }
}
