//! What is kept of one vector of the calls.

use crate::vector;

/// The vector of the call before, and its differences between calls, oldest ones being written over.
///
/// A difference is made in the pass over the columns that needs it first, tile by tile, so that none is read again from memory.
#[derive(Default)]
pub(super) struct History {
    before: Vec<f64>,
    columns: Vec<Vec<f64>>,
}

impl History {
    /// The column, empty where there was none yet.
    pub(super) fn column(&self, i: usize) -> &[f64] {
        self.columns.get(i).map_or(&[], Vec::as_slice)
    }

    /// This call is the one before from here on.
    pub(super) fn remember(&mut self, now: &[f64]) {
        self.before.resize(now.len(), 0.0);
        vector::copy(&mut self.before, now);
    }

    /// Column `place`, for the others to be read while it is written.
    fn take(&mut self, place: usize, n: usize) -> Vec<f64> {
        if self.columns.len() <= place {
            self.columns.resize_with(place + 1, Vec::new);
        }
        let mut new = std::mem::take(&mut self.columns[place]);
        new.resize(n, 0.0);
        new
    }

    /// Column `place` <- now - before, and before <- now; the square of the column's length.
    pub(super) fn advance(&mut self, place: usize, now: &[f64]) -> f64 {
        let mut new = self.take(place, now.len());
        let square = vector::advance(&mut new, &mut self.before, now);
        self.columns[place] = new;
        square
    }

    /// The same, and the products of the first `used` columns with that one and with `now`.
    pub(super) fn advance_then_dots(
        &mut self,
        place: usize,
        used: usize,
        now: &[f64],
        products: &mut Vec<(f64, f64)>,
    ) -> f64 {
        let mut new = self.take(place, now.len());
        let (before, columns) = (&mut self.before, &self.columns);
        let square =
            vector::advance_then_dots(&mut new, before, now, place, used, &|i| columns[i].as_slice(), products);
        self.columns[place] = new;
        square
    }

    /// The same as [`History::advance`], and out <- now - sum c_i column_i.
    pub(super) fn advance_then_extrapolate(&mut self, place: usize, now: &[f64], c: &[f64], out: &mut [f64]) {
        let mut new = self.take(place, now.len());
        let (before, columns) = (&mut self.before, &self.columns);
        vector::advance_then_subtract_combination(out, &mut new, before, now, place, c, &|i| columns[i].as_slice());
        self.columns[place] = new;
    }
}
