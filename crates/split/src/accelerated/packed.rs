//! The state of an iteration as one vector.

use super::carrier::{CHUNK, Extrapolated};
use crate::admm::State;
use crate::{Problem, vector};
use rayon::prelude::*;
use std::ops::Range;

/// x of the free nodes, p and u as they were, and the part of them that is extrapolated in a vector of its own.
#[derive(Clone)]
pub(super) struct Packed {
    /// What is extrapolated: x, u, p, or x and u, or x, or z.
    pub values: Vec<f64>,
    kept: Vec<f64>, // what else is needed to restore the state
    free: usize,
    terms: Vec<Range<usize>>, // of each term, in a vector over all local variables
    extrapolated: Extrapolated,
}

impl Packed {
    pub fn new(state: &State<'_>, extrapolated: Extrapolated) -> Self {
        let free = state.x.len();
        let mut end = 0;
        let mut terms = Vec::with_capacity(state.u.len());
        for u in state.u.iter() {
            terms.push(end..end + u.len());
            end += u.len();
        }
        let (values, kept) = match extrapolated {
            Extrapolated::All => (free + 2 * end, 0),
            Extrapolated::PositionsAndDual => (free + end, end),
            Extrapolated::Positions => (free, 2 * end),
            Extrapolated::Local => (end, free + 2 * end),
        };
        Packed { values: vec![0.0; values], kept: vec![0.0; kept], free, terms, extrapolated }
    }

    fn local(&self) -> usize {
        self.terms.last().map_or(0, |last| last.end)
    }

    /// x, u and p, as they were packed.
    fn parts(&mut self) -> (&mut [f64], &mut [f64], &mut [f64]) {
        let (free, local) = (self.free, self.local());
        match self.extrapolated {
            Extrapolated::PositionsAndDual => {
                let (x, u) = self.values.split_at_mut(free);
                (x, u, &mut self.kept)
            }
            Extrapolated::Positions => {
                let (u, p) = self.kept.split_at_mut(local);
                (&mut self.values, u, p)
            }
            all_or_local => {
                let whole = if all_or_local == Extrapolated::All { &mut self.values } else { &mut self.kept };
                let (x, rest) = whole.split_at_mut(free);
                let (u, p) = rest.split_at_mut(local);
                (x, u, p)
            }
        }
    }

    pub fn pack(&mut self, state: &State<'_>) {
        for t in 0..self.terms.len() {
            let range = self.terms[t].clone();
            if self.extrapolated == Extrapolated::Local {
                let z = self.values[range.clone()].par_iter_mut().zip(state.p[t].par_iter().zip(&state.u[t]));
                z.with_min_len(CHUNK).for_each(|(z, (p, u))| *z = p + u);
            }
            let (_, u, p) = self.parts();
            vector::copy(&mut u[range.clone()], &state.u[t]);
            vector::copy(&mut p[range], &state.p[t]);
        }
        vector::copy(self.parts().0, state.x);
    }

    /// The point `values`, laid out like those here, becomes the state. Where z is not part of it, that of `state` stays, and
    /// p follows u, which stays too where it is no part either; where z is all of it, u follows from z by A(21), and x is
    /// left to the global step.
    pub fn unpack(&self, values: &[f64], state: &mut State<'_>, problem: &mut Problem) {
        let local = self.local();
        if self.extrapolated != Extrapolated::Local {
            vector::copy(state.x, &values[..self.free]);
        }
        if self.extrapolated == Extrapolated::Positions {
            return;
        }
        for (t, range) in self.terms.iter().enumerate() {
            let at = |first: usize| &values[first + range.start..first + range.end];
            match self.extrapolated {
                Extrapolated::All => {
                    vector::copy(&mut state.u[t], at(self.free));
                    vector::copy(&mut state.p[t], at(self.free + local));
                }
                Extrapolated::PositionsAndDual => {
                    let new = at(self.free);
                    let numbers = state.p[t].par_iter_mut().zip(state.u[t].par_iter_mut()).zip(new);
                    numbers.with_min_len(CHUNK).for_each(|((p, u), new)| {
                        *p += *u - new;
                        *u = *new;
                    });
                }
                Extrapolated::Positions => {}
                Extrapolated::Local => {
                    let z = at(0);
                    problem.terms[t].dual(z, &mut state.u[t]);
                    let numbers = state.p[t].par_iter_mut().zip(z.par_iter().zip(&state.u[t]));
                    numbers.with_min_len(CHUNK).for_each(|(p, (z, u))| *p = z - u);
                }
            }
        }
    }

    /// All of it as it was packed.
    pub fn restore(&mut self, state: &mut State<'_>) {
        for t in 0..self.terms.len() {
            let range = self.terms[t].clone();
            let (_, u, p) = self.parts();
            vector::copy(&mut state.u[t], &u[range.clone()]);
            vector::copy(&mut state.p[t], &p[range]);
        }
        vector::copy(state.x, self.parts().0);
    }
}
