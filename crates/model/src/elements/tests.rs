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
        assert!((slope - grad[i]).abs() <= 2e-7 * scale, "entry {i}: {slope} by differences, {} by formula, scale {scale}", grad[i]);
    }
}

fn check_term<T: Term>(mut term: T, dim: usize, x: &[f64], random: &mut Random) {
    let n = x.len();
    let mut grad = vec![0.0; n];
    term.moved();
    let first = term.energy(x, Some(&mut grad));
    let again = term.energy(x, None);
    assert_eq!(first, again, "from what was saved");
    assert_gradient(
        |y| {
            term.moved();
            term.energy(y, None).value
        },
        x,
        &grad,
    );
    // The penalty around a random local state.
    let mut z = vec![0.0; term.local_len()];
    term.moved();
    term.couple(x, &mut z);
    let u: Vec<f64> = z.iter().map(|_| random.uniform(-0.2, 0.2)).collect();
    for z in &mut z {
        *z += random.uniform(-0.1, 0.1);
    }
    grad.fill(0.0);
    term.penalty(x, &z, &u, &mut grad);
    assert_gradient(
        |y| {
            term.moved();
            let mut unused = vec![0.0; n];
            term.penalty(y, &z, &u, &mut unused).value
        },
        x,
        &grad,
    );
    // The local step: the change of the Lagrangian is what the values say, and u takes up the gap.
    term.moved();
    let mut c = vec![0.0; z.len()];
    term.couple(x, &mut c);
    let (mut z1, mut u1) = (z.clone(), u.clone());
    let report = term.local_step(x, &mut z1, &mut u1);
    assert_eq!(report.missed, 0);
    let mut unused = vec![0.0; n];
    let blocks = z.len() / term.local_len().max(1);
    assert_eq!(blocks, 1);
    for i in 0..z.len() {
        assert!((u1[i] - (u[i] + c[i] - z1[i])).abs() < 1e-12);
    }
    let after = term.penalty(x, &z1, &u.iter().map(|v| -v).collect::<Vec<_>>(), &mut unused);
    assert!(after.gap2 >= 0.0);
    // A prox lowers the Lagrangian from wherever z was in its domain.
    let (mut z2, mut u2) = (z1.to_vec(), u.to_vec());
    let second = term.local_step(x, &mut z2, &mut u2);
    assert!(second.lagrangian_change() <= 1e-9 * (1.0 + second.penalty_after.abs()), "{second:?}");
    assert!(dim > 0);
}

#[test]
fn gradients_against_differences() {
    let mut random = Random::new(7);
    let (rest, tets) = ring(11);
    let x = deformed(&rest, &mut random, 0.15);
    let solid = Rest::<3, 3>::new(&rest, &tets).unwrap();
    let nh = NeoHookean { mu: 1.0, lambda: 5.0 };
    check_term(Elements::<3, 3, Polar>::new(&solid, nh, 3.0), 3, &x, &mut random);
    check_term(Elements::<3, 3, Linear>::new(&solid, nh, 3.0), 3, &x, &mut random);
    let triangles: Vec<u32> = (0..11).flat_map(|i| [0, 2 + i, 2 + (i + 1) % 11]).collect();
    let sheet = Rest::<3, 2>::new(&rest, &triangles).unwrap();
    check_term(Elements::<3, 2, Polar>::new(&sheet, SymmetricDirichlet::default(), 4.0), 3, &x, &mut random);
    check_term(Elements::<3, 2, Linear>::new(&sheet, Arap::default(), 2.0), 3, &x, &mut random);
    let edges: Vec<u32> = (0..11).flat_map(|i| [0, 2 + i]).collect();
    let springs = Rest::<3, 1>::new(&rest, &edges).unwrap();
    check_term(Elements::<3, 1, Polar>::new(&springs, Arap::default(), 2.0), 3, &x, &mut random);
    check_term(Elements::<3, 1, Linear>::new(&springs, Arap::default(), 2.0), 3, &x, &mut random);
    let flat: Vec<f64> = rest.chunks(3).enumerate().filter(|(i, _)| *i != 1).flat_map(|(_, p)| [p[0], p[1]]).collect();
    let fan: Vec<u32> = (0..11).flat_map(|i| [0, 1 + i, 1 + (i + 1) % 11]).collect();
    let y = deformed(&flat, &mut random, 0.1);
    let plane = Rest::<2, 2>::new(&flat, &fan).unwrap();
    check_term(Elements::<2, 2, Polar>::new(&plane, nh, 3.0), 2, &y, &mut random);
    check_term(Elements::<2, 2, Linear>::new(&plane, nh, 3.0), 2, &y, &mut random);
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
        term.moved();
        term.penalty(x, &z, &z, &mut grad);
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
    let mut z = vec![0.0; term.local_len()];
    term.couple(&x, &mut z);
    let mut u = vec![0.0; z.len()];
    term.local_step(&x, &mut z, &mut u);
    let before: Vec<f64> = (0..term.n_elems()).map(|e| u[e % 8 + e / 8 * 48] * term.weight2[e]).collect();
    let ratio = term.propose_weights((0.1, 10.0));
    assert!(ratio > 1.0 && ratio <= 10.0 + 1e-12, "{ratio}");
    assert_eq!(term.propose_weights((1.0, 1.0)), 1.0, "clamped to the base weight");
    term.propose_weights((0.1, 10.0));
    term.take_weights(&mut u);
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
