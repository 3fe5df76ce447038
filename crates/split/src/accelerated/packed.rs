//! The state of an iteration as one vector.

use crate::admm::State;
use std::ops::Range;

/// x of the free nodes, u, and p: what is extrapolated first, p last, as it may stay behind.
#[derive(Clone)]
pub(super) struct Packed {
    /// What is extrapolated; with p where z is part of it.
    pub values: Vec<f64>,
    p: Vec<f64>, // where z is not: that of the point that was packed
    free: usize,
    u: Vec<Range<usize>>, // of each term, in `values`
    carries_z: bool,
}

impl Packed {
    pub fn new(state: State<'_>, carries_z: bool) -> Self {
        let free = state.x.len();
        let mut end = free;
        let mut ranges = Vec::with_capacity(state.u.len());
        for u in state.u.iter() {
            ranges.push(end..end + u.len());
            end += u.len();
        }
        let local = end - free;
        let (values, p) = if carries_z { (end + local, 0) } else { (end, local) };
        Packed { values: vec![0.0; values], p: vec![0.0; p], free, u: ranges, carries_z }
    }

    /// Where p of term t is: in `values` or in `p`.
    fn p_range(&self, t: usize) -> Range<usize> {
        let local = self.u.last().map_or(0, |last| last.end - self.free);
        let shift = |i: usize| if self.carries_z { i + local } else { i - self.free };
        shift(self.u[t].start)..shift(self.u[t].end)
    }

    pub fn pack(&mut self, state: &State<'_>) {
        self.values[..self.free].copy_from_slice(state.x);
        for t in 0..self.u.len() {
            self.values[self.u[t].clone()].copy_from_slice(&state.u[t]);
            let at = self.p_range(t);
            let p = if self.carries_z { &mut self.values } else { &mut self.p };
            p[at].copy_from_slice(&state.p[t]);
        }
    }

    /// Where z is not carried, that of `state` stays, and p follows u.
    pub fn unpack(&self, state: &mut State<'_>) {
        state.x.copy_from_slice(&self.values[..self.free]);
        for t in 0..self.u.len() {
            let u = &self.values[self.u[t].clone()];
            if self.carries_z {
                state.p[t].copy_from_slice(&self.values[self.p_range(t)]);
            } else {
                for ((p, old), new) in state.p[t].iter_mut().zip(&state.u[t]).zip(u) {
                    *p += old - new;
                }
            }
            state.u[t].copy_from_slice(u);
        }
    }

    /// All of it as it was packed.
    pub fn restore(&self, state: &mut State<'_>) {
        state.x.copy_from_slice(&self.values[..self.free]);
        for t in 0..self.u.len() {
            let (p, u) = self.local(t);
            state.p[t].copy_from_slice(p);
            state.u[t].copy_from_slice(u);
        }
    }

    /// p and u of a term, as they were packed.
    pub fn local(&self, t: usize) -> (&[f64], &[f64]) {
        let p = if self.carries_z { &self.values } else { &self.p };
        (&p[self.p_range(t)], &self.values[self.u[t].clone()])
    }
}
