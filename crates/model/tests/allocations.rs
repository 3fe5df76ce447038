//! A step allocates nothing once every buffer has grown to its size.

use proxel_model::elements::{Elements, Linear, Polar, Rest};
use proxel_model::energy::NeoHookean;
use proxel_split::{
    Acceleration, Admm, AdmmSettings, Algorithm, Direct, GlobalStep, Inertia, Lbfgs, LbfgsSettings, Method, Problem,
    Quadratic, Range, Reweighting, Term,
};
use proxel_testkit::meshes;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use std::alloc::System;

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// A cantilever under a load, two chunks of elements and more.
fn cantilever(polar: bool) -> Problem {
    let beam = meshes::beam(24, 4, 4, 0.25);
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
    let energy = NeoHookean { mu: 1.0, lambda: 4.0 };
    let term: Box<dyn Term> = match polar {
        true => Box::new(Elements::<3, 3, Polar>::new(&solid, energy, 10.0)),
        false => Box::new(Elements::<3, 3, Linear>::new(&solid, energy, 10.0)),
    };
    let mut loads = vec![0.0; rest.len()];
    loads.iter_mut().skip(2).step_by(3).for_each(|b| *b = -1e-5);
    let quadratic = Quadratic { loads, ..Default::default() };
    Problem { dim: 3, n_free, x0: rest, terms: vec![term], quadratic, barrier: true }
}

#[test]
fn steady_state_allocates_nothing() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("two threads");
    pool.install(|| {
        for polar in [true, false] {
            let global: Box<dyn GlobalStep> = match polar {
                true => Box::new(Lbfgs::new(LbfgsSettings::default())),
                false => Box::new(Direct),
            };
            // A trigger of 1 reweights and refactors in nearly every iteration.
            let reweighting = Some(Reweighting {
                range: Range::Late { from: 3, min: 0.1, max: 10.0 },
                trigger: 1.0,
                hardening: None,
            });
            let settings = AdmmSettings { name: "test".to_string(), global, reweighting, renewed_at: None };
            let mut method = Admm::new(cantilever(polar), settings).expect("a pinned beam");
            let refactored = steady(&mut method, &format!("polar: {polar}"));
            assert!(refactored > 20, "{refactored} refactorisations");
        }
        // In the same test, since what is counted is what all threads do.
        for algorithm in [Algorithm::One, Algorithm::Two, Algorithm::Three, Algorithm::Four, Algorithm::Envelope] {
            let mut problem = cantilever(false);
            let target = problem.x0[..3 * problem.n_free].to_vec();
            problem.quadratic.inertia = Inertia::new(vec![1e-3; problem.n_free], target, 3).expect("masses");
            let (name, global) = ("test".to_string(), Box::new(Direct));
            let settings = AdmmSettings { name, global, reweighting: None, renewed_at: None };
            let admm = Admm::new(problem, settings).expect("a pinned beam");
            let mut method = Acceleration::anderson(algorithm, 5).of(admm).expect("a smooth energy");
            steady(&mut *method, &format!("{algorithm:?}"));
        }
    });
}

/// Steps of a method until buffers have grown, then some that are watched; refactorisations.
fn steady(method: &mut dyn Method, name: &str) -> usize {
    let mut refactored = 0;
    let mut step = || {
        refactored += usize::from(method.step().expect("a step").refactorised);
        method.energy();
        method.evaluate();
        method.residuals();
    };
    for _ in 0..20 {
        step();
    }
    // The pool's own queues may grow now and then; what a step allocates would show in every round.
    let quietest = (0..5)
        .map(|_| {
            let region = Region::new(ALLOCATOR);
            for _ in 0..3 {
                step();
            }
            region.change().allocations
        })
        .min();
    assert_eq!(quietest, Some(0), "{name}");
    refactored
}
