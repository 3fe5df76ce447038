//! Edges of a length, or of lengths within a range.

use super::{Relation, Row, Set, V3, norm, scale};

/// low <= |v| <= high, with `low` = `high` for a length that is to be met. Lengths of all elements, or of each.
#[derive(Clone, Debug)]
pub struct Length {
    ranges: Vec<[f64; 2]>, // one for all, or one each
}

impl Length {
    /// The same length for all.
    pub fn equal(length: f64) -> Self {
        Length { ranges: vec![[length; 2]] }
    }

    /// The same range for all.
    pub fn within(low: f64, high: f64) -> Self {
        Length { ranges: vec![[low, high]] }
    }

    /// A range for each element.
    pub fn each(ranges: Vec<[f64; 2]>) -> Self {
        Length { ranges }
    }

    fn range(&self, e: usize) -> [f64; 2] {
        self.ranges.get(e).or(self.ranges.first()).copied().unwrap_or([0.0, f64::INFINITY])
    }
}

impl Set for Length {
    fn project(&self, e: usize, v: &mut [V3]) {
        let [low, high] = self.range(e);
        for v in v {
            let length = norm(*v);
            let wanted = length.max(low).min(high);
            // Of no direction all are as near.
            *v = if length > 0.0 { scale(wanted / length, *v) } else { [wanted, 0.0, 0.0] };
        }
    }

    /// | |v| - nearest length | over that length, the error of A(30); where that is 0, |v|.
    fn violation(&self, e: usize, v: &[V3]) -> f64 {
        let [low, high] = self.range(e);
        v.iter().fold(0.0, |m: f64, v| {
            let length = norm(*v);
            let wanted = length.max(low).min(high);
            let off = (length - wanted).abs() / if wanted > 0.0 { wanted } else { 1.0 };
            if off <= m { m } else { off }
        })
    }

    fn linearize(&self, e: usize, v: &[V3], near: f64, row: &mut dyn FnMut(Row<'_>)) {
        let [low, high] = self.range(e);
        let Some(v) = v.first() else { return };
        let length = norm(*v);
        let along = if length > 0.0 { scale(1.0 / length, *v) } else { [1.0, 0.0, 0.0] };
        if low == high {
            return row(Row { value: length - low, relation: Relation::Zero, gradient: &[along] });
        }
        if length - high > -near {
            row(Row { value: length - high, relation: Relation::NotAbove, gradient: &[along] });
        }
        if low - length > -near {
            row(Row { value: low - length, relation: Relation::NotAbove, gradient: &[scale(-1.0, along)] });
        }
    }
}
