//! Like elements with a set each.

use super::{Reduction, Row, Rows, Set, V3};
use rayon::prelude::*;
use std::marker::PhantomData;

/// Elements of as many corners each, a reduction R and a set each.
#[derive(Clone, Debug)]
pub struct Cells<R, S> {
    pub(super) nodes: Vec<u32>, // corners of all elements, one after another
    pub(super) corners: usize,
    pub(super) rows: usize,
    pub(super) set: S,
    reduction: PhantomData<R>,
}

/// Why elements cannot carry a set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CellsError(pub String);

impl std::fmt::Display for CellsError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for CellsError {}

/// Elements handled by one task.
pub(super) const CHUNK: usize = 256;

impl<R: Reduction, S: Set> Cells<R, S> {
    /// Of elements with `corners` corners each, which `nodes` lists one after another.
    ///
    /// # Errors
    /// A number of corners that the reduction is not for, a list that is not of whole elements, or one too long to be
    /// numbered.
    pub fn new(nodes: Vec<u32>, corners: usize, set: S) -> Result<Self, CellsError> {
        let rows = R::rows(corners).filter(|_| nodes.len().is_multiple_of(corners.max(1)));
        match rows {
            Some(rows) if nodes.len() < u32::MAX as usize => {
                Ok(Cells { nodes, corners, rows, set, reduction: PhantomData })
            }
            Some(_) => Err(CellsError(format!("{} corners are too many to be numbered", nodes.len()))),
            None => Err(CellsError(format!("{} nodes are no elements of {corners} corners for this set", nodes.len()))),
        }
    }

    /// Number of elements.
    pub fn len(&self) -> usize {
        self.nodes.len() / self.corners
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// The sets.
    pub fn set(&self) -> &S {
        &self.set
    }

    /// The nodes of an element.
    pub fn element(&self, e: usize) -> &[u32] {
        &self.nodes[e * self.corners..(e + 1) * self.corners]
    }

    /// How far each element is outside of its set.
    pub fn violations(&self, x: &[V3]) -> Vec<f64> {
        let mut out = vec![0.0; self.len()];
        out.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
            let mut v = vec![[0.0; 3]; self.rows];
            for (k, out) in out.iter_mut().enumerate() {
                let e = chunk * CHUNK + k;
                R::reduce(x, self.element(e), &mut v);
                *out = self.set.violation(e, &v);
            }
        });
        out
    }

    /// The largest violation; infinite where one is not a number.
    pub fn violation(&self, x: &[V3]) -> f64 {
        let worst = self.violations(x).into_iter().fold(0.0_f64, |m, v| if v <= m { m } else { v });
        if worst.is_nan() { f64::INFINITY } else { worst }
    }

    /// Adds what the sets are to first order around x; inequalities that hold by more than `near` may be left out.
    pub fn add_rows(&self, x: &[V3], near: f64, out: &mut Rows) {
        let (mut v, mut spread) = (vec![[0.0; 3]; self.rows], vec![[0.0; 3]; self.corners]);
        for e in 0..self.len() {
            let nodes = self.element(e);
            R::reduce(x, nodes, &mut v);
            let mut which = 0;
            self.set.linearize(e, &v, near, &mut |row: Row<'_>| {
                spread[..row.gradient.len()].copy_from_slice(row.gradient);
                spread[row.gradient.len()..].fill([0.0; 3]);
                R::spread(&mut spread);
                out.push((e as u32, which), nodes, &spread, row.value, row.relation);
                which += 1;
            });
        }
    }
}
