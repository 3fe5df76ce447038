use super::*;
use crate::energy::{Arap, NeoHookean, SymmetricDirichlet};
use proxel_split::Term;
use proxel_testkit::random::SplitMix as Random;

/// A strip of 3 x 2 x 2 cubes of five or six tetrahedra would do; this is a fan: node 0 and 1 as an axis, a ring around it.
fn ring(n: u32) -> (Vec<f64>, Vec<u32>) {
    let mut x = vec![0.0, 0.0, 0.0, 0.1, -0.2, 1.0];
    for i in 0..n {
        let a = f64::from(i) * std::f64::consts::TAU / f64::from(n);
        x.extend([1.5 * a.cos(), a.sin(), 0.4 + 0.1 * (3.0 * a).sin()]);
    }
    let tets = (0..n).flat_map(|i| [0, 2 + i, 2 + (i + 1) % n, 1]).collect();
    (x, tets)
}

fn deformed(x: &[f64], random: &mut Random, amount: f64) -> Vec<f64> {
    x.iter().map(|v| 1.2 * v + amount * random.uniform(-1.0, 1.0)).collect()
}

/// Central differences of `f` at x, over the first `n` entries, against `grad`.
fn assert_gradient(mut f: impl FnMut(&[f64]) -> f64, x: &[f64], grad: &[f64]) {
    let scale = grad.iter().fold(0.0, |m: f64, g| m.max(g.abs()));
    assert!(scale > 0.0);
    for i in 0..grad.len() {
        let h = 1e-6;
        let at = |d: f64| {
            let mut y = x.to_vec();
            y[i] += d;
            y
        };
        let slope = (f(&at(h)) - f(&at(-h))) / (2.0 * h);
        assert!(
            (slope - grad[i]).abs() <= 2e-7 * scale,
            "entry {i}: {slope} by differences, {} by formula, scale {scale}",
            grad[i]
        );
    }
}

fn check_term<T: Term>(mut term: T, x: &[f64], random: &mut Random) {
    let n = x.len();
    let mut grad = vec![0.0; n];
    let first = term.energy(x, Some(&mut grad));
    assert_eq!(first, term.energy(x, None), "with and without its gradient");
    assert_gradient(|y| term.energy(y, None).value, x, &grad);
    // The penalty around a random local state.
    let mut c = vec![0.0; term.local_len()];
    term.couple(x, &mut c);
    let u: Vec<f64> = c.iter().map(|_| random.uniform(-0.2, 0.2)).collect();
    let z: Vec<f64> = c.iter().map(|c| c + random.uniform(-0.1, 0.1)).collect();
    let p: Vec<f64> = z.iter().zip(&u).map(|(z, u)| z - u).collect();
    grad.fill(0.0);
    let penalty = term.penalty(x, &p, &mut grad);
    if let Some(energy) = penalty.energy {
        assert_eq!(energy, first);
    }
    let mut unused = vec![0.0; n];
    assert_gradient(|y| term.penalty(y, &p, &mut unused).value, x, &grad);
    // The local step: u takes up the gap, p follows, and the gradient is that of the penalty at the new p.
    let (mut p1, mut u1) = (p.clone(), u.clone());
    let mut begin = vec![0.0; n];
    let report = term.local_step(x, &mut p1, &mut u1, &mut begin);
    assert_eq!(report.missed, 0);
    for i in 0..c.len() {
        let z1 = p1[i] + u1[i];
        assert!((u1[i] - (u[i] + c[i] - z1)).abs() < 1e-12);
    }
    grad.fill(0.0);
    let objective = term.penalty(x, &p1, &mut grad).value;
    assert!((objective - report.objective).abs() <= 1e-12 * objective.abs(), "{objective} {}", report.objective);
    let scale = grad.iter().fold(0.0, |m: f64, g| m.max(g.abs()));
    assert!(grad.iter().zip(&begin).all(|(a, b)| (a - b).abs() <= 1e-12 * scale));
    let residual = term.residual(x, &p1, &u1);
    assert!(residual.gap2 > 0.0 && residual.size2 > residual.gap2);
    // A prox lowers the Lagrangian from wherever z was in its domain: again from the z that it found, with the old u.
    let mut p2: Vec<f64> = p1.iter().zip(&u1).zip(&u).map(|((p, u1), u)| p + u1 - u).collect();
    let mut u2 = u.clone();
    let second = term.local_step(x, &mut p2, &mut u2, &mut begin);
    let tolerance = 1e-9 * (1.0 + second.penalty_after.abs());
    assert!((second.penalty_before - report.penalty_after).abs() <= tolerance, "{second:?} after {report:?}");
    assert!(second.lagrangian_change().abs() <= tolerance, "{second:?}");
    assert!(second.moved2 <= tolerance, "{second:?}");
}

#[test]
fn gradients_against_differences() {
    let mut random = Random::new(7);
    let (rest, tets) = ring(11);
    let x = deformed(&rest, &mut random, 0.15);
    let solid = Rest::<3, 3>::new(&rest, &tets).unwrap();
    let nh = NeoHookean { mu: 1.0, lambda: 5.0 };
    check_term(Elements::<3, 3, Polar>::new(&solid, nh, 3.0), &x, &mut random);
    check_term(Elements::<3, 3, Linear>::new(&solid, nh, 3.0), &x, &mut random);
    let triangles: Vec<u32> = (0..11).flat_map(|i| [0, 2 + i, 2 + (i + 1) % 11]).collect();
    let sheet = Rest::<3, 2>::new(&rest, &triangles).unwrap();
    check_term(Elements::<3, 2, Polar>::new(&sheet, SymmetricDirichlet::default(), 4.0), &x, &mut random);
    check_term(Elements::<3, 2, Linear>::new(&sheet, Arap::default(), 2.0), &x, &mut random);
    let edges: Vec<u32> = (0..11).flat_map(|i| [0, 2 + i]).collect();
    let springs = Rest::<3, 1>::new(&rest, &edges).unwrap();
    check_term(Elements::<3, 1, Polar>::new(&springs, Arap::default(), 2.0), &x, &mut random);
    check_term(Elements::<3, 1, Linear>::new(&springs, Arap::default(), 2.0), &x, &mut random);
    let flat: Vec<f64> = rest.chunks(3).enumerate().filter(|(i, _)| *i != 1).flat_map(|(_, p)| [p[0], p[1]]).collect();
    let fan: Vec<u32> = (0..11).flat_map(|i| [0, 1 + i, 1 + (i + 1) % 11]).collect();
    let y = deformed(&flat, &mut random, 0.1);
    let plane = Rest::<2, 2>::new(&flat, &fan).unwrap();
    check_term(Elements::<2, 2, Polar>::new(&plane, nh, 3.0), &y, &mut random);
    check_term(Elements::<2, 2, Linear>::new(&plane, nh, 3.0), &y, &mut random);
}

#[test]
fn the_normal_matrix_is_the_hessian_of_the_linear_penalty() {
    let (rest, tets) = ring(9);
    let mut random = Random::new(3);
    let x = deformed(&rest, &mut random, 0.3);
    let solid = Rest::<3, 3>::new(&rest, &tets).unwrap();
    let mut term = Elements::<3, 3, Linear>::new(&solid, Arap::default(), 2.0);
    let n = rest.len() / 3;
    let free = n - 2;
    let mut all: Vec<Vec<u32>> = Vec::new();
    term.for_each_element(&mut |nodes| all.push(nodes.iter().copied().filter(|v| (*v as usize) < free).collect()));
    let pattern = SymPattern::from_cliques(free, &all).unwrap();
    let mut values = vec![0.0; pattern.nnz()];
    term.add_normal(&pattern, &mut values);
    let z = vec![0.0; term.local_len()];
    let mut g = |x: &[f64]| {
        let mut grad = vec![0.0; free * 3];
        term.penalty(x, &z, &mut grad);
        grad
    };
    for j in 0..free {
        let mut y = x.clone();
        y[j * 3] += 1.0;
        let (g0, g1) = (g(&x), g(&y));
        for i in 0..free {
            let entry = pattern.slot(i.max(j), i.min(j)).map_or(0.0, |s| values[s]);
            assert!((g1[i * 3] - g0[i * 3] - entry).abs() < 1e-11, "({i}, {j})");
        }
    }
}

#[test]
fn reweighting_keeps_the_force() {
    let (rest, tets) = ring(9);
    let mut random = Random::new(5);
    let x = deformed(&rest, &mut random, 0.3);
    let solid = Rest::<3, 3>::new(&rest, &tets).unwrap();
    let mut term = Elements::<3, 3, Polar>::new(&solid, NeoHookean { mu: 1.0, lambda: 5.0 }, 3.0);
    let mut p = vec![0.0; term.local_len()];
    term.couple(&x, &mut p);
    let mut u = vec![0.0; p.len()];
    term.local_step(&x, &mut p, &mut u, &mut vec![0.0; x.len()]);
    let before: Vec<f64> = (0..term.n_elems()).map(|e| u[e % 8 + e / 8 * 48] * term.weight2[e]).collect();
    let ratio = term.propose_weights((0.1, 10.0));
    assert!(ratio > 1.0 && ratio <= 10.0 + 1e-12, "{ratio}");
    assert_eq!(term.propose_weights((1.0, 1.0)), 1.0, "clamped to the base weight");
    term.propose_weights((0.1, 10.0));
    term.take_weights(&mut p, &mut u);
    for (e, before) in before.iter().enumerate() {
        let after = u[e % 8 + e / 8 * 48] * term.weight2[e];
        assert!((after - before).abs() <= 1e-14 * before.abs());
    }
    assert_eq!(term.propose_weights((0.1, 10.0)), 1.0, "they are what the stretches ask for");
}

#[test]
fn an_element_without_volume_is_refused_by_number() {
    let (rest, mut tets) = ring(5);
    tets.swap(8, 9);
    let Err(ElementError::Measure { element, measure }) = Rest::<3, 3>::new(&rest, &tets) else { panic!("taken") };
    assert_eq!(element, 2);
    assert!(measure < 0.0);
    assert!(matches!(Rest::<3, 3>::new(&rest, &[0, 1, 2, 99]), Err(ElementError::Index { element: 0, node: 99 })));
}
