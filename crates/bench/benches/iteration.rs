//! A whole WRAPD iteration with one inner step and its parts alone, on 1 and 2 threads.
//!
//! The data is the centaur's where `PROXEL_DATA` names the data folder, else a generated beam of about as many tetrahedra.
#![allow(missing_docs)] // divan's macros make public items

use divan::{Bencher, counter::ItemsCount};
use proxel::split::Method;
use proxel_bench::data::Model;
use proxel_bench::parts::{Parts, centaur_or_beam, iteration, pool};
use std::cell::RefCell;
use std::sync::OnceLock;

const THREADS: [usize; 2] = [1, 2];

fn model() -> &'static Model {
    static MODEL: OnceLock<Model> = OnceLock::new();
    MODEL.get_or_init(|| centaur_or_beam().unwrap_or_else(|e| panic!("{e}")))
}

fn main() {
    let model = model();
    println!("{}: {} tetrahedra, times of one pass over all", model.name, model.input.rest.tets.len());
    divan::main();
}

#[divan::bench(args = THREADS, sample_count = 40, sample_size = 1)]
fn whole_iteration(bencher: Bencher<'_, '_>, threads: usize) {
    let pool = pool(threads).expect("threads");
    let mut method = pool.install(|| iteration(model())).expect("a problem");
    bencher
        .counter(ItemsCount::new(model().input.rest.tets.len()))
        .bench_local(|| pool.install(|| method.step()).expect("a step"));
}

fn part(bencher: Bencher<'_, '_>, threads: usize, run: impl Fn(&mut Parts) + Sync) {
    let pool = pool(threads).expect("threads");
    let parts = RefCell::new(pool.install(|| Parts::new(model())).expect("a problem"));
    bencher
        .counter(ItemsCount::new(model().input.rest.tets.len()))
        .with_inputs(|| parts.borrow_mut().prepare())
        .bench_local_values(|()| {
            let parts = &mut *parts.borrow_mut();
            pool.install(|| run(parts));
        });
}

macro_rules! parts {
    ($($name:ident $run:expr;)*) => {
        $(#[divan::bench(args = THREADS, sample_count = 40, sample_size = 1)]
        fn $name(bencher: Bencher<'_, '_>, threads: usize) {
            part(bencher, threads, $run);
        })*
    };
}
parts! {
    solve_3_right_hand_sides |parts| parts.solve().expect("a factor");
    svd_sweep Parts::svd_sweep;
    svd_sweep_and_gradient Parts::penalty;
    prox_sweep Parts::local_step;
    energy_pass Parts::energy;
    candidate_weights Parts::candidate_weights;
    refactorisation |parts| parts.refactor().expect("positive definite");
}
