//! Long vectors that are used again: made anew each time, most of their cost would be pages that the system has to clear.

use crate::Spectra;

/// Vectors given back, and room for transforms.
#[derive(Default)]
pub(crate) struct Room {
    spare: Vec<Vec<f64>>,
    pub(crate) spectra: Spectra,
}

impl Room {
    /// A vector of this length, of any numbers.
    pub(crate) fn take(&mut self, n: usize) -> Vec<f64> {
        match self.spare.iter().position(|spare| spare.len() == n) {
            Some(k) => self.spare.swap_remove(k),
            None => vec![0.0; n],
        }
    }

    /// Of zeros.
    pub(crate) fn zeros(&mut self, n: usize) -> Vec<f64> {
        let mut zeros = self.take(n);
        zeros.fill(0.0);
        zeros
    }

    /// These are needed no more.
    pub(crate) fn give<const K: usize>(&mut self, vectors: [Vec<f64>; K]) {
        self.spare.extend(vectors);
    }
}
