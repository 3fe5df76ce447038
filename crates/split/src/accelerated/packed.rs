//! The state of an iteration as one vector.

use super::carrier::Extrapolated;
use crate::Problem;
use crate::admm::State;
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
                for ((z, p), u) in self.values[range.clone()].iter_mut().zip(&state.p[t]).zip(&state.u[t]) {
                    *z = p + u;
                }
            }
            let (_, u, p) = self.parts();
            u[range.clone()].copy_from_slice(&state.u[t]);
            p[range].copy_from_slice(&state.p[t]);
        }
        self.parts().0.copy_from_slice(state.x);
    }

    /// The point `values`, laid out like those here, becomes the state. Where z is not part of it, that of `state` stays, and
    /// p follows u, which stays too where it is no part either; where z is all of it, u follows from z by A(21), and x is left to the global step.
    pub fn unpack(&self, values: &[f64], state: &mut State<'_>, problem: &mut Problem) {
        let local = self.local();
        if self.extrapolated != Extrapolated::Local {
            state.x.copy_from_slice(&values[..self.free]);
        }
        if self.extrapolated == Extrapolated::Positions {
            return;
        }
        for (t, range) in self.terms.iter().enumerate() {
            let at = |first: usize| &values[first + range.start..first + range.end];
            match self.extrapolated {
                Extrapolated::All => {
                    state.u[t].copy_from_slice(at(self.free));
                    state.p[t].copy_from_slice(at(self.free + local));
                }
                Extrapolated::PositionsAndDual => {
                    let new = at(self.free);
                    for ((p, old), new) in state.p[t].iter_mut().zip(&state.u[t]).zip(new) {
                        *p += old - new;
                    }
                    state.u[t].copy_from_slice(new);
                }
                Extrapolated::Positions => {}
                Extrapolated::Local => {
                    let z = at(0);
                    problem.terms[t].dual(z, &mut state.u[t]);
                    for ((p, z), u) in state.p[t].iter_mut().zip(z).zip(&state.u[t]) {
                        *p = z - u;
                    }
                }
            }
        }
    }

    /// All of it as it was packed.
    pub fn restore(&mut self, state: &mut State<'_>) {
        for t in 0..self.terms.len() {
            let range = self.terms[t].clone();
            let (_, u, p) = self.parts();
            state.u[t].copy_from_slice(&u[range.clone()]);
            state.p[t].copy_from_slice(&p[range]);
        }
        state.x.copy_from_slice(self.parts().0);
    }
}
