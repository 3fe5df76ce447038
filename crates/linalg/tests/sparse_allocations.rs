//! A solve allocates nothing once its scratch has grown, and neither does a refactorisation.
#![allow(unsafe_code)] // a counting allocator

use proxel_linalg::sparse::{Cholesky, MixedCholesky, MixedScratch, Ordering, SolveScratch, Symbolic};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

mod common;

struct Counting;
static COUNT: AtomicUsize = AtomicUsize::new(0);

// SAFETY: forwards to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.fetch_add(1, SeqCst);
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, p: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(p, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn steady_state_allocates_nothing() {
    let m = common::grid(15, 14, 13, &mut common::Random(1));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    pool.install(|| {
        let symbolic = Arc::new(Symbolic::analyze(&m.pattern, Ordering::Auto).unwrap());
        let mut factor = Cholesky::<f64>::new(symbolic.clone());
        let mut mixed = MixedCholesky::new(&m.pattern, symbolic).unwrap();
        let (mut scratch, mut mixed_scratch) = (SolveScratch::new(), MixedScratch::new());
        let mut x = vec![1.0; m.n() * 4];
        let mut round = || {
            factor.refactor(&m.values).unwrap();
            mixed.refactor(&m.values).unwrap();
            for nrhs in [4, 3, 2, 1] {
                let x = &mut x[..m.n() * nrhs];
                factor.solve_in_place(x, nrhs, &mut scratch).unwrap();
                mixed.solve_in_place(x, nrhs, 1e-12, &mut mixed_scratch).unwrap();
            }
        };
        round();
        // The pool's own queues may still grow in the first rounds; a leak of ours would show in every round.
        let quietest = (0..5)
            .map(|_| {
                let before = COUNT.load(SeqCst);
                round();
                COUNT.load(SeqCst) - before
            })
            .min();
        assert_eq!(quietest, Some(0));
    });
}
