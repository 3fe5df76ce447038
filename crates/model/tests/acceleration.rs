//! ADMM and its accelerations on a time step of elastic bars.

use proxel_model::elements::{Batch, BatchShape, BatchWeights, batch};
use proxel_model::energy::Lame;
use proxel_split::{
    Acceleration, Admm, AdmmSettings, Algorithm, Balancing, BuildError, Cycle, Direct, Equalities, Extrapolation,
    History, Inertia, Kind, Method, Order, Problem, Quadratic, normalized,
};
use proxel_testkit::bars::{Bars, bars};

const DT: f64 = 1.0 / 30.0;
const ENERGIES: [&str; 3] = ["corotated", "neo-hookean", "stvk"];

/// A step of implicit Euler from rest: ends moved outwards by `pulled`, gravity; one energy a bar. Start: where inertia would
/// carry it.
fn step(bars: &Bars, lame: &Lame, pulled: f64, rotation_aware: bool) -> Problem {
    let n_free = bars.n_free;
    let mut x0: Vec<f64> = bars.vertices.iter().flatten().copied().collect();
    x0[..3 * n_free].chunks_exact_mut(3).for_each(|p| p[1] -= 9.8 * DT * DT);
    x0[3 * n_free..].chunks_exact_mut(3).for_each(|p| p[0] += pulled.copysign(p[0]));
    let rest: Vec<f64> = bars.vertices.iter().flatten().copied().collect();
    let term = |(tets, energy): (&Vec<[u32; 4]>, &str)| {
        let weights = |_| BatchWeights { base: lame.bulk(), softening: 1.0 };
        let of = Batch {
            shape: BatchShape::Tetrahedra,
            positions: &rest,
            flattened: None,
            elements: tets.as_flattened(),
            fill: None,
            energy,
            lame,
            limits: None,
            rotation_aware,
            singular_values: false,
            weights: &weights,
        };
        batch(&of).expect("good tetrahedra").0
    };
    let terms = bars.tets.iter().zip(ENERGIES).map(term).collect();
    let stiffness = bars.masses(1522.0)[..n_free].iter().map(|m| m / (DT * DT)).collect();
    let inertia = Inertia::new(stiffness, x0[..3 * n_free].to_vec(), 3).expect("masses");
    let quadratic = Quadratic { inertia, ..Quadratic::default() };
    Problem { dim: 3, n_free, x0, terms, quadratic, barrier: false }
}

fn admm(problem: Problem) -> Admm {
    let settings =
        AdmmSettings { name: "test".to_string(), global: Box::new(Direct), reweighting: None, renewed_at: None };
    Admm::new(problem, settings).expect("bars with inertia")
}

fn soft() -> Lame {
    Lame::from_young_poisson(1e7, 0.399).expect("moduli")
}

/// Iterations to each level of the normalised forward residual, with the rejections until then.
fn reached(mut method: Box<dyn Method>, a: f64, levels: &[f64], most: usize) -> Vec<(usize, usize)> {
    let n = method.problem().local_dim();
    let (mut reached, mut rejected) = (Vec::new(), 0);
    for iteration in 1..=most {
        let report = method.step().expect("a step");
        rejected += report.trial.rejected;
        let forward = normalized(method.forward_residual().expect("a splitting"), n, a);
        if iteration == 1 {
            println!("first {forward}");
        }
        while reached.len() < levels.len() && forward <= levels[reached.len()] {
            reached.push((iteration, rejected));
        }
        if reached.len() == levels.len() {
            break;
        }
    }
    reached
}

#[test]
#[ignore = "exploration"]
fn explore() {
    let bars = bars(3, [12, 3, 3], 1.0 / 3.0, 1.75);
    let a = bars.mean_edge();
    let levels = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-10];
    for (name, lame, most) in
        [("soft", soft(), 300), ("rubber", Lame::from_young_poisson(1e7, 0.499).expect("moduli"), 800)]
    {
        let problem = || admm(step(&bars, &lame, 2.0 * DT, false));
        println!("{name} admm {:?}", reached(Box::new(problem()), a, &levels, most));
        for algorithm in [Algorithm::Three, Algorithm::One, Algorithm::Two, Algorithm::Four, Algorithm::Envelope] {
            for window in [1, 3, 6, 10] {
                if window != 6 && algorithm != Algorithm::Three {
                    continue;
                }
                for history in [History::Keep, History::Clear] {
                    let how = Acceleration { history, ..Acceleration::anderson(algorithm, window) };
                    let method = how.of(problem()).expect("a method");
                    println!("{name} {algorithm:?} {window} {history:?} {:?}", reached(method, a, &levels, most));
                }
            }
        }
        for alpha in [1.5, 1.6, 1.7, 1.8] {
            let admm = problem().with_cycle(Cycle { relaxation: alpha, ..Cycle::PLAIN }).expect("a relaxation");
            println!("{name} relax {alpha} {:?}", reached(Box::new(admm), a, &levels, most));
        }
        for corrected in [false, true] {
            let by = Extrapolation::Momentum { eta: 0.999, corrected };
            let how = Acceleration { algorithm: Algorithm::One, by, history: History::AsPublished };
            println!("{name} momentum {corrected} {:?}", reached(how.of(problem()).expect("ok"), a, &levels, most));
        }
        let by = Extrapolation::Anderson { window: 6, mixing: 1.0, kind: Kind::One };
        let how = Acceleration { algorithm: Algorithm::Three, by, history: History::AsPublished };
        println!("{name} type one {:?}", reached(how.of(problem()).expect("ok"), a, &levels, most));
        println!(
            "{name} balancing {:?}",
            reached(Box::new(problem().with_balancing(Balancing::default())), a, &levels, most)
        );
    }
}
