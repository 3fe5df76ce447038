//! On the ARAP energy with the weights of W(21) the local step is trivial, P = I, W(18)-(19): rotation-aware ADMM is
//! L-BFGS on the energy, and reweighting has nothing to do.

use proxel_model::elements::{Coupling, Elements, Linear, Polar, Rest, Shape, Simplex};
use proxel_model::energy::{Arap, Energy};
use proxel_split::{
    Admm, AdmmSettings, Direct, GlobalStep, Lbfgs, LbfgsSettings, Method, NormalMatrix, Problem, Quadratic,
    Reweighting, Term, vector,
};
use proxel_testkit::{SplitMix, meshes};

/// A beam with one end held and the other twisted and pulled, free nodes first, from a rough start.
fn twisted_beam<C: Coupling<3, 3>>() -> Problem
where
    Simplex: Shape<3, 3>,
{
    let beam = meshes::beam(12, 3, 3, 0.25);
    let length = 3.0;
    let is_fixed = |p: &[f64; 3]| p[0] < 1e-9 || p[0] > length - 1e-9;
    let mut order: Vec<usize> = (0..beam.vertices.len()).collect();
    order.sort_by_key(|v| (is_fixed(&beam.vertices[*v]), *v));
    let mut number = vec![0; order.len()];
    for (place, v) in order.iter().enumerate() {
        number[*v] = place as u32;
    }
    let rest: Vec<f64> = order.iter().flat_map(|v| beam.vertices[*v]).collect();
    let tets: Vec<u32> = beam.tets.iter().flatten().map(|v| number[*v as usize]).collect();
    let mut random = SplitMix::new(11);
    let x0: Vec<f64> = order
        .iter()
        .flat_map(|v| {
            let p = beam.vertices[*v];
            let (sin, cos) = (1.2 * p[0] / length).sin_cos();
            let (y, z) = (p[1] - 0.375, p[2] - 0.375);
            let noise = if is_fixed(&p) { 0.0 } else { 0.02 };
            [1.1 * p[0], y * cos - z * sin, y * sin + z * cos].map(|c| c + random.uniform(-noise, noise))
        })
        .collect();
    let n_free = order.iter().filter(|v| !is_fixed(&beam.vertices[**v])).count();
    let solid = Rest::<3, 3>::new(&rest, &tets).expect("a beam");
    let arap = Arap::default();
    let base = Energy::<3>::rest_stiffness(&arap);
    assert_eq!(base, 2.0, "w^2 = 2 V");
    let term: Box<dyn Term> = Box::new(Elements::<3, 3, C>::new(&solid, arap, base));
    Problem { dim: 3, n_free, x0, terms: vec![term], quadratic: Quadratic::default(), barrier: false }
}

fn admm(problem: Problem, global: impl GlobalStep + 'static, reweighting: Option<Reweighting>) -> Admm {
    Admm::new(
        problem,
        AdmmSettings { name: "test".to_string(), global: Box::new(global), reweighting, renewed_at: None },
    )
    .expect("a pinned beam")
}

/// L-BFGS as in Nocedal and Wright, Algorithm 7.4 and 7.5, with H0 = A^-1 and unit steps, on the energy itself.
fn lbfgs(problem: &mut Problem, steps: usize, window: usize) -> Vec<Vec<f64>> {
    let mut normal = NormalMatrix::new(problem).expect("a pinned beam");
    let n = problem.n_free * 3;
    let mut x = problem.x0.clone();
    let mut g = vec![0.0; n];
    problem.energy(&x, Some(&mut g));
    let mut pairs: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut path = vec![x.clone()];
    for _ in 0..steps {
        let mut q = g.clone();
        let mut alphas = Vec::new();
        for (s, y) in pairs.iter().rev() {
            let alpha = dot(s, &q) / dot(y, s);
            q.iter_mut().zip(y).for_each(|(q, y)| *q -= alpha * y);
            alphas.push(alpha);
        }
        normal.solve(&mut q).expect("a solve");
        for ((s, y), alpha) in pairs.iter().zip(alphas.iter().rev()) {
            let beta = dot(y, &q) / dot(y, s);
            q.iter_mut().zip(s).for_each(|(q, s)| *q += (alpha - beta) * s);
        }
        let before = x.clone();
        x.iter_mut().zip(&q).for_each(|(x, q)| *x -= q);
        let g_before = g.clone();
        problem.energy(&x, Some(&mut g));
        let s: Vec<f64> = x[..n].iter().zip(&before).map(|(a, b)| a - b).collect();
        let y: Vec<f64> = g.iter().zip(&g_before).map(|(a, b)| a - b).collect();
        if dot(&s, &y) > 0.0 {
            pairs.push((s, y));
        }
        if pairs.len() > window {
            pairs.remove(0);
        }
        path.push(x.clone());
    }
    path
}

#[test]
fn inner_steps_put_end_to_end_are_lbfgs() {
    let mut method = admm(twisted_beam::<Polar>(), Lbfgs::new(LbfgsSettings::default()), None);
    let path = lbfgs(&mut twisted_beam::<Polar>(), 60, 6);
    let size = vector::norm(&path[0]);
    let mut inner = 0;
    let mut iterations = 0;
    while inner < 40 {
        inner += method.step().expect("a step").inner;
        iterations += 1;
        let apart: Vec<f64> = method.x().iter().zip(&path[inner]).map(|(a, b)| a - b).collect();
        assert!(vector::norm(&apart) <= 1e-12 * size, "{} after {inner} steps", vector::norm(&apart) / size);
        // P = I: the diagonal is 1, the rest 0, in every lane.
        for (i, p) in method.p()[0].iter().enumerate() {
            let want = if i / 8 % 6 < 3 { 1.0 } else { 0.0 };
            assert!((p - want).abs() < 1e-13, "entry {i} of P is {p}");
        }
    }
    assert!(iterations > 5 && vector::norm(&path[40]) > 0.0);
    let moved: Vec<f64> = path[40].iter().zip(&path[0]).map(|(a, b)| a - b).collect();
    assert!(vector::norm(&moved) > 1e-3 * size, "the test beam has to move");
}

#[test]
fn reweighting_changes_nothing_where_the_hessian_is_constant() {
    let mut plain = admm(twisted_beam::<Linear>(), Direct, None);
    let mut reweighted = admm(twisted_beam::<Linear>(), Direct, Some(Reweighting::quasi_static()));
    for _ in 0..80 {
        let (a, b) = (plain.step().expect("a step"), reweighted.step().expect("a step"));
        assert!(!b.refactorised);
        assert_eq!(a, b);
        assert_eq!(plain.x(), reweighted.x(), "to the last bit");
    }
}

#[test]
fn linear_and_rotation_aware_reach_the_same_minimum() {
    let gradient = |method: &mut Admm, steps: usize| {
        for _ in 0..steps {
            method.step().expect("a step");
        }
        method.evaluate().gradient_norm
    };
    let mut linear = admm(twisted_beam::<Linear>(), Direct, None);
    let mut polar = admm(twisted_beam::<Polar>(), Lbfgs::new(LbfgsSettings::default()), None);
    let start = polar.evaluate().gradient_norm;
    assert!(gradient(&mut polar, 120) < 1e-9 * start);
    assert!(gradient(&mut linear, 1500) < 1e-7 * start);
    let apart: Vec<f64> = linear.x().iter().zip(polar.x()).map(|(a, b)| a - b).collect();
    assert!(vector::norm(&apart) < 1e-6 * vector::norm(polar.x()), "{}", vector::norm(&apart));
}
