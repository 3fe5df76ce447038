//! The metric against itself, derivatives against differences, and the minimum against that of the engine.

use super::elements::MetricElements;
use super::traced::Traced;
use super::{Attempt, Candidates, Global, Moduli, Motion, Trial, VectorModel, VectorSettings};
use crate::data;
use proxel::model::elements::{Elements, Polar, Rest};
use proxel::model::energy::{Energy, Lame, NeoHookean};
use proxel::settings::Material;
use proxel::split::{Hardening, LbfgsSettings, Reweighting, Term};

const MODULI: Moduli = Moduli { deviatoric: 3.0, volumetric: 11.0 };

fn rubber() -> NeoHookean {
    <NeoHookean as Energy<3>>::from_lame(&Lame::new(1.0, 20.0).expect("moduli"))
}

/// Two tetrahedra at rest, and deformed.
fn pair() -> (Vec<f64>, [u32; 8], Vec<f64>) {
    let rest = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
    let x = rest.iter().enumerate().map(|(i, v)| v + 0.3 * (1.7 * i as f64).sin()).collect();
    (rest, [0, 1, 2, 3, 1, 2, 3, 4], x)
}

#[test]
fn moduli_at_rest_are_those_of_linear_elasticity() {
    let moduli = Moduli::of_hessian(&rubber(), [1.0; 3]);
    assert!((moduli.deviatoric - 2.0).abs() < 1e-12 && (moduli.volumetric - 62.0).abs() < 1e-12, "{moduli:?}");
    let a = [[1.0, 0.5, 0.0], [0.5, -2.0, 0.3], [0.0, 0.3, 4.0]];
    // |dev A|^2 = |A|^2 - tr^2/3 = 21.68 - 3
    assert!((MODULI.norm2(&a) - (3.0 * 18.68 + 11.0 * 3.0)).abs() < 1e-12);
    let b = MODULI.carried_over(Moduli { deviatoric: 6.0, volumetric: 5.5 }, &a);
    assert!((b[0][1] - 0.25).abs() < 1e-15 && (b[0][0] + b[1][1] + b[2][2] - 6.0).abs() < 1e-14, "{b:?}");
}

#[test]
fn the_prox_in_the_metric_beats_all_around_it() {
    let energy = rubber();
    for v in [[1.4, 1.0, 0.6], [2.0, 1.9, 1.8], [0.5, 0.2, -0.3]] {
        let traced = Traced { energy, factor: MODULI.of_trace(), target: v[0] + v[1] + v[2] };
        let prox = traced.prox(v, MODULI.deviatoric, [1.0; 3]);
        let at = |s: [f64; 3]| {
            let gap = [[s[0] - v[0], 0.0, 0.0], [0.0, s[1] - v[1], 0.0], [0.0, 0.0, s[2] - v[2]]];
            energy.value(s) + 0.5 * MODULI.norm2(&gap)
        };
        assert!(prox.converged, "{v:?}");
        for n in 0..20usize.pow(3) {
            let s = [n % 20, n / 20 % 20, n / 400].map(|i| 0.02 + 0.12 * i as f64);
            assert!(at(prox.s) <= at(s), "{v:?}: {s:?} is better than {:?}", prox.s);
        }
    }
}

#[test]
fn the_gradient_is_the_slope_of_the_penalty() {
    let (rest, tets, mut x) = pair();
    let mut term = MetricElements::new(&rest, &tets, rubber(), MODULI, Candidates::Each, 1.0).expect("elements");
    let p: Vec<f64> = (0..term.local_len()).map(|i| 1.0 + 0.4 * (2.3 * i as f64).cos()).collect();
    let mut grad = vec![0.0; x.len()];
    term.penalty(&x, &p, &mut grad);
    for i in 0..x.len() {
        let mut at = |h: f64| {
            x[i] += h;
            let value = term.penalty(&x, &p, &mut [0.0; 15]).value;
            x[i] -= h;
            value
        };
        let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
        assert!((slope - grad[i]).abs() < 1e-7 * (1.0 + grad[i].abs()), "{i}: {slope} {}", grad[i]);
    }
}

#[test]
fn equal_moduli_are_the_scalar_weights_of_the_engine() {
    let (positions, tets, x) = pair();
    let k = 7.0;
    let scalar = Moduli::scalar(k);
    let mut ours =
        MetricElements::new(&positions, &tets, rubber(), scalar, Candidates::Largest, 1.0).expect("elements");
    let rest = Rest::<3, 3>::new(&positions, &tets).expect("rest");
    let mut theirs = Elements::<3, 3, Polar>::new(&rest, rubber(), k);
    let step = |term: &mut dyn Term| {
        let (mut p, mut u) = (vec![0.0; term.local_len()], vec![0.0; term.local_len()]);
        let mut grad = vec![0.0; 15];
        term.couple(&positions, &mut p);
        let report = term.local_step(&x, &mut p, &mut u, &mut grad);
        (report, grad)
    };
    let ((a, grad_a), (b, grad_b)) = (step(&mut ours), step(&mut theirs));
    for (a, b) in [(a.value_after, b.value_after), (a.penalty_after, b.penalty_after), (a.moved2, b.moved2)] {
        assert!((a - b).abs() < 1e-9 * b.abs(), "{a} {b}");
    }
    for (a, b) in grad_a.iter().zip(&grad_b) {
        assert!((a - b).abs() < 1e-9, "{grad_a:?} {grad_b:?}");
    }
}

#[test]
fn every_metric_and_global_step_ends_at_the_same_minimum() {
    let material = Material { poisson: 0.45, ..Material::default() };
    let model = data::solved_of(Motion::Twist.model([4, 2, 2]).expect("a beam"), &material, 1e-11).expect("solved");
    let trial = Trial::new(&model, &material).expect("a trial");
    let g = Energy::<3>::mean_stiffness(trial.energy());
    let base = Moduli { deviatoric: 0.5 * g, volumetric: g };
    let scalar = Global::Scalar { mix: 0.5, settings: LbfgsSettings { line_search: true, ..LbfgsSettings::default() } };
    let vector = |model| Global::Vector(VectorSettings { model, refresh: 5, window: 8, kappa: 1.0, max_inner: 20 });
    let schedule = Reweighting { hardening: Some(Hardening::default()), ..Reweighting::quasi_static() };
    for (reweighting, global) in [
        (None, scalar),
        (Some((Candidates::Each, schedule)), scalar),
        (None, vector(VectorModel::Laplacian)),
        (None, vector(VectorModel::GaussNewton)),
    ] {
        let counts = trial.run(&Attempt { base, reweighting, global }, 500).expect("a run");
        assert!(counts.converged.is_some() && counts.error < 1e-6, "{global:?}: {counts:?}");
        assert!(counts.close.is_some_and(|count| count.iterations < 100), "{counts:?}");
    }
}
