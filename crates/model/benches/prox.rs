//! The proximal operators: time per item is time per element, on one thread and the best instruction set.
//!
//! `warm` starts within 1e-3 of the solution, as in the late iterations of a splitting; `cold` starts at rest.

use divan::counter::ItemsCount;
use divan::{Bencher, Divan};
use proxel_linalg::simd::{F8, Isa, Kernel, LANES, Mask, Real, dispatch};
use proxel_model::energy::*;
use proxel_testkit::SplitMix;

const ELEMENTS: usize = 98_304;

/// Blocks of eight elements, component by component.
struct Problem<E, const K: usize> {
    energy: E,
    v: Vec<[[f64; LANES]; K]>,
    warm: Vec<[[f64; LANES]; K]>,
    k: f64,
}

struct Sweep<'a, E, const K: usize>(&'a Problem<E, K>, &'a mut [[[f64; LANES]; K]]);

impl<E: Energy<K>, const K: usize> Kernel for Sweep<'_, E, K> {
    /// Elements that did not converge.
    type Output = u32;
    #[inline(always)]
    fn run<I: Isa>(self) -> u32 {
        let Sweep(problem, out) = self;
        let k = F8::<I>::splat(problem.k);
        let mut missed = 0;
        for ((v, warm), out) in problem.v.iter().zip(&problem.warm).zip(out) {
            let (mut a, mut b) = ([k; K], [k; K]);
            for i in 0..K {
                a[i] = F8::load(&v[i]);
                b[i] = F8::load(&warm[i]);
            }
            let p = problem.energy.prox(a, k, b);
            for i in 0..K {
                p.s[i].store(&mut out[i]);
            }
            missed += (!p.converged).count();
        }
        missed
    }
}

/// Targets as in a posed mesh: stretches of 0.6 to 1.5; k is the default weight.
fn problem<E: Energy<K>, const K: usize>(warm: bool) -> Problem<E, K> {
    let lame = Lame::from_young_poisson(1e7, 0.45).expect("rubber is a material");
    let energy = E::from_lame(&lame);
    let mut random = SplitMix::new(3);
    let blocks = ELEMENTS / LANES;
    let v = (0..blocks).map(|_| std::array::from_fn(|_| random.array(0.6, 1.5))).collect();
    let rest = vec![[[1.0; LANES]; K]; blocks];
    let k = energy.slope_stiffness();
    let mut problem = Problem { energy, v, warm: rest, k };
    if warm {
        let mut solution = problem.warm.clone();
        dispatch(Sweep(&problem, &mut solution));
        for x in solution.as_flattened_mut().as_flattened_mut() {
            *x += random.uniform(-1e-3, 1e-3);
        }
        problem.warm = solution;
    }
    problem
}

fn bench<E: Energy<K>, const K: usize>(bencher: Bencher<'_, '_>, warm: bool) {
    let problem = problem::<E, K>(warm);
    let mut out = problem.warm.clone();
    assert_eq!(dispatch(Sweep(&problem, &mut out)), 0, "elements that do not converge");
    bencher.counter(ItemsCount::new(ELEMENTS)).bench_local(|| dispatch(Sweep(&problem, &mut out)));
}

macro_rules! benches {
    ($($energy:ident [$($k:tt)*])*) => {
        $(#[allow(non_snake_case)]
        mod $energy {
            use super::*;
            const DIMENSIONS: &[usize] = &[$($k),*];

            #[divan::bench(args = DIMENSIONS)]
            fn warm(bencher: Bencher<'_, '_>, k: usize) {
                $(if k == $k { return bench::<proxel_model::energy::$energy, $k>(bencher, true) })*
            }

            #[divan::bench(args = DIMENSIONS)]
            fn cold(bencher: Bencher<'_, '_>, k: usize) {
                $(if k == $k { return bench::<proxel_model::energy::$energy, $k>(bencher, false) })*
            }
        })*
    };
}
proxel_model::for_each_energy!(benches);

fn main() {
    Divan::from_args().main();
}
