//! The safe penalty: what it is worked out from, and that the iteration descends as Theorem 3.5 says.

use proxel_mesh::generate::{Bars, bars};
use proxel_model::elements::{Batch, BatchShape, BatchWeights, batch};
use proxel_model::energy::Lame;
use proxel_split::{Admm, AdmmSettings, Cycle, Direct, Inertia, Method, Order, Problem, Quadratic, SafePenalty, Term};

const DT: f64 = 1.0 / 30.0;

fn term(positions: &[f64], tets: &[[u32; 4]], energy: &str, lame: &Lame) -> Box<dyn Term> {
    let weights = |_| BatchWeights { base: lame.bulk(), softening: 1.0 };
    let of = Batch {
        shape: BatchShape::Tetrahedra,
        positions,
        flattened: None,
        elements: tets.as_flattened(),
        fill: None,
        energy,
        lame,
        limits: None,
        rotation_aware: false,
        singular_values: false,
        weights: &weights,
    };
    batch(&of).expect("good tetrahedra").0
}

/// A step of implicit Euler, or without inertia a pose, of a bar whose ends have moved apart; lengths times `size`, moduli
/// times `young`.
fn problem(energy: &str, inert: bool, size: f64, young: f64) -> Problem {
    let bars: Bars = bars(1, [6, 2, 2], 1.0, 0.0).expect("cubes");
    let lame = Lame::from_young_poisson(young, 0.3).expect("moduli");
    let rest: Vec<f64> = bars.vertices.iter().flatten().map(|v| size * v).collect();
    let n = 3 * bars.n_free;
    let mut x0 = rest.clone();
    x0[n..].chunks_exact_mut(3).for_each(|p| p[0] += (0.05 * size).copysign(p[0]));
    // Nothing of what moves inside is where a minimum would be.
    x0[..n].iter_mut().enumerate().for_each(|(i, x)| *x += 0.02 * size * (i as f64 * 1.7).sin());
    let mut quadratic = Quadratic::default();
    if inert {
        // Masses that keep m/dt^2 against the stiffness whatever the units.
        let mass = |m: &f64| m * size * young / 1e5 / (DT * DT);
        let stiffness = bars.masses(1000.0)[..bars.n_free].iter().map(mass).collect();
        quadratic.inertia = Inertia::new(stiffness, rest[..n].to_vec(), 3).expect("masses");
    }
    let terms = vec![term(&rest, &bars.tets[0], energy, &lame)];
    Problem { dim: 3, n_free: bars.n_free, x0, terms, quadratic, barrier: false }
}

fn admm(problem: Problem) -> Admm {
    let settings =
        AdmmSettings { name: "test".to_string(), global: Box::new(Direct), reweighting: None, renewed_at: None };
    Admm::new(problem, settings).expect("a bar that is held")
}

fn refused(admm: Admm) -> String {
    admm.with_safe_penalty().err().expect("a refusal").to_string()
}

/// 1/2 sum w^2 u^2
fn dual_part(admm: &mut Admm) -> f64 {
    let u = admm.u().to_vec();
    let mut sum = 0.0;
    for (term, u) in admm.problem().terms.iter().zip(&u) {
        let mut weights = vec![0.0; u.len()];
        term.local_weights2(&mut weights);
        sum += weights.iter().zip(u).map(|(w, u)| 0.5 * w * u * u).sum::<f64>();
    }
    sum
}

#[test]
fn the_lagrangian_falls_by_what_theorem_3_5_promises_and_steps_are_summable() {
    for inert in [true, false] {
        let mut admm = admm(problem("stvk", inert, 1.0, 1e5)).with_safe_penalty().expect("stvk without loads");
        let safe = admm.safe_penalty().expect("it has one");
        assert!(safe.mu > 1.0 && safe.lipschitz > 0.0 && safe.lipschitz < 0.5 && safe.descent() > 0.0, "{safe:?}");
        let start = admm.energy().value;
        assert!((start - safe.start).abs() <= 1e-12 * start);
        let (mut before, mut steps) = (f64::INFINITY, Vec::new());
        for k in 0..2000 {
            let report = admm.step().expect("a step");
            // After the local half: L(x^k, z^k, u^k) of A(4).
            let lagrangian = report.local.objective + report.local.value_after - dual_part(&mut admm);
            if k == 0 {
                // The start fits: prox(Dx0 + u0) is Dx0, and L is T(x0, z0).
                assert!(report.local.moved2 <= 1e-16 * report.local.objective.max(start), "{report:?}");
                assert!((lagrangian - start).abs() < 1e-9 * start, "{lagrangian} {start}");
            } else if report.local.moved2.sqrt() > 1e-5 * steps.first().copied().unwrap_or(0.0) {
                let (fall, promised) = (before - lagrangian, safe.descent() * report.local.moved2);
                assert!(fall >= promised - 1e-13 * start, "{inert} {k}: {fall} of {promised}");
                steps.push(report.local.moved2.sqrt());
            }
            before = lagrangian;
        }
        // Summable: what the last half adds is next to nothing beside the first.
        assert!(steps.len() > 20, "{}", steps.len());
        let sum = |s: &[f64]| s.iter().sum::<f64>();
        let half = steps.len() / 2;
        assert!(sum(&steps[half..]) < 0.2 * sum(&steps[..half]), "{steps:?}");
        let end = admm.energy().value;
        assert!(end < start, "{end} {start}");
    }
}

#[test]
fn it_depends_on_neither_units_nor_size() {
    let of = |size: f64, young: f64| {
        let mut problem = problem("stvk", true, size, young);
        let x = problem.x0.clone();
        SafePenalty::of(&mut problem, &x).expect("stvk")
    };
    let base = of(1.0, 1e5);
    for (size, young) in [(1e-3, 1e5), (1e3, 1e5), (1.0, 1e-2), (1e-6, 1e11)] {
        let other = of(size, young);
        assert!((other.mu / base.mu - 1.0).abs() < 1e-9, "{other:?} {base:?}");
        assert!((other.lipschitz - base.lipschitz).abs() < 1e-9, "{other:?} {base:?}");
    }
}

#[test]
fn what_the_theorem_does_not_speak_of_is_refused() {
    for energy in ["neo-hookean", "corotated", "arap", "stable-neo-hookean"] {
        let text = refused(admm(problem(energy, true, 1.0, 1e5)));
        assert!(text.contains("term 0") && text.contains("--penalty weights"), "{energy}: {text}");
    }
    let mut loaded = problem("stvk", true, 1.0, 1e5);
    loaded.quadratic.loads = vec![-1.0; loaded.x0.len()];
    assert!(refused(admm(loaded)).contains("loads"));
    let cycle = Cycle { order: Order::Xzu, relaxation: 1.6 };
    let relaxed = admm(problem("stvk", true, 1.0, 1e5)).with_cycle(cycle).expect("over-relaxation");
    assert!(refused(relaxed).contains("x-z-u"));
    let balanced = admm(problem("stvk", true, 1.0, 1e5)).with_balancing(proxel_split::Balancing::default());
    assert!(refused(balanced).contains("static weights"));
}

/// The bounds against what they bound: many pairs of deformation gradients on a level set and between its points.
#[test]
fn bounds_of_level_sets_hold() {
    let corners = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.2, 1.1, 0.0, 0.1, 0.3, 0.9];
    for poisson in [-0.3, 0.0, 0.3, 0.45] {
        let lame = Lame::from_young_poisson(3.0, poisson).expect("moduli");
        let mut term = term(&corners, &[[0, 1, 2, 3]], "stvk", &lame);
        let n = term.local_len();
        let mut weights = vec![0.0; n];
        term.local_weights2(&mut weights);
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
        };
        let (mut sharpest, mut strongest) = (0.0_f64, 0.0_f64);
        for level in [1e-3, 0.1, 10.0] {
            let bound = term.level_bound(level).expect("stvk");
            let mut points: Vec<Vec<f64>> = Vec::new();
            while points.len() < 60 {
                let spread = 0.3 + 1.5 * (0.5 + 0.5 * random());
                let mut x: Vec<f64> = corners.iter().map(|c| c + spread * random()).collect();
                // Towards rest, until it is in the set; halves, so that some are near its border.
                while term.energy(&x, None).value > level {
                    x.iter_mut().zip(&corners).for_each(|(x, c)| *x = c + 0.8 * (*x - c));
                }
                let mut z = vec![0.0; n];
                term.couple(&x, &mut z);
                let mut u = vec![0.0; n];
                term.dual(&z, &mut u);
                let force2: f64 = weights.iter().zip(&u).map(|(w, u)| w * u * u).sum();
                assert!(force2 <= bound.force2, "{poisson} {level}");
                strongest = strongest.max(force2 / bound.force2);
                points.push(z);
            }
            for (i, a) in points.iter().enumerate() {
                let b = &points[(7 * i + 13) % points.len()];
                // Both within the hull: somewhere between two points of the set, and close to it.
                let t = 0.5 + 0.5 * random();
                let z: Vec<f64> = a.iter().zip(b).map(|(a, b)| t * a + (1.0 - t) * b).collect();
                let near: Vec<f64> = a.iter().zip(b).map(|(a, b)| (t - 1e-4) * a + (1.0 - t + 1e-4) * b).collect();
                let (mut u, mut v) = (vec![0.0; n], vec![0.0; n]);
                term.dual(&z, &mut u);
                term.dual(&near, &mut v);
                let norm = |p: &[f64], q: &[f64]| {
                    weights.iter().zip(p.iter().zip(q)).map(|(w, (p, q))| w * (p - q).powi(2)).sum::<f64>().sqrt()
                };
                let moved = norm(&z, &near);
                if moved > 0.0 {
                    let slope = norm(&u, &v) / moved;
                    assert!(slope <= bound.lipschitz * (1.0 + 1e-9), "{poisson} {level}: {slope} {bound:?}");
                    sharpest = sharpest.max(slope / bound.lipschitz);
                }
            }
        }
        assert!(sharpest > 0.02 && strongest > 0.02, "bounds so loose that they say nothing: {sharpest} {strongest}");
    }
}
