//! What is kept of one vector of the calls.

use crate::vector;

/// The vector of the last calls as they were given, the oldest being written over: one more than the window has columns,
/// which are their differences and are nowhere but in registers ([`vector::difference_dots`]).
#[derive(Default)]
pub(super) struct History {
    calls: Vec<Vec<f64>>,
    newest: usize,
}

impl History {
    /// Room for the differences of `window` calls.
    pub(super) fn new(window: usize) -> Self {
        History { calls: vec![Vec::new(); window + 1], newest: 0 }
    }

    /// The vector of the call that was `age` calls before the newest.
    pub(super) fn call(&self, age: usize) -> &[f64] {
        let places = self.calls.len();
        &self.calls[(self.newest + places - age) % places]
    }

    /// The oldest one's place in memory, for `n` numbers that are now the newest; to be given back to [`History::put`].
    fn take(&mut self, n: usize) -> Vec<f64> {
        let place = (self.newest + 1) % self.calls.len();
        let mut kept = std::mem::take(&mut self.calls[place]);
        kept.resize(n, 0.0);
        kept
    }

    fn put(&mut self, kept: Vec<f64>) {
        self.newest = (self.newest + 1) % self.calls.len();
        self.calls[self.newest] = kept;
    }

    /// This call is the newest from here on.
    pub(super) fn remember(&mut self, now: &[f64]) {
        let mut kept = self.take(now.len());
        vector::copy(&mut kept, now);
        self.put(kept);
    }

    /// The same, and the products of the newest `used` differences with the newest one and with `now`, newest first.
    pub(super) fn remember_then_dots(&mut self, now: &[f64], used: usize, products: &mut Vec<(f64, f64)>) {
        let mut kept = self.take(now.len());
        vector::copy_then_difference_dots(&mut kept, now, used, &|age| self.call(age), products);
        self.put(kept);
    }

    /// The same as [`History::remember`], and out <- now - sum_j c_j (difference j), newest first.
    pub(super) fn remember_then_extrapolate(&mut self, now: &[f64], c: &[f64], out: &mut [f64]) {
        let mut kept = self.take(now.len());
        vector::copy_then_subtract_differences(out, &mut kept, now, c, &|age| self.call(age));
        self.put(kept);
    }
}
