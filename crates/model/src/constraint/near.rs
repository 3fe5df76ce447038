//! Points near to others.

use super::{Hint, Relation, Row, Set, V3, norm, sub};
use std::sync::Arc;

/// What has a nearest point: a surface, a curve.
pub trait Closest: Send + Sync {
    /// The point nearest to x. Where there are several, always the same one.
    fn closest(&self, x: V3) -> V3;

    /// The same point, found from where a query near by has ended. See [`Hint`].
    fn closest_from(&self, x: V3, hint: &mut Hint) -> V3 {
        let _ = hint;
        self.closest(x)
    }
}

/// A point for each element.
#[derive(Clone, Debug)]
pub struct Points(pub Vec<V3>);

/// Each vertex on something that all share, such as a reference surface, or each at a point of its own.
#[derive(Clone)]
pub enum Near {
    /// On what has nearest points.
    Shared(Arc<dyn Closest>),
    /// At points, one an element.
    At(Points),
}

impl Near {
    fn target(&self, e: usize, x: V3) -> V3 {
        match self {
            Near::Shared(shared) => shared.closest(x),
            Near::At(Points(points)) => points.get(e).copied().unwrap_or(x),
        }
    }
}

impl Set for Near {
    fn project(&self, e: usize, v: &mut [V3]) {
        for v in v {
            *v = self.target(e, *v);
        }
    }

    fn project_from(&self, e: usize, v: &mut [V3], hint: &mut Hint) {
        match (self, v) {
            (Near::Shared(shared), [v]) => *v = shared.closest_from(*v, hint),
            (_, v) => self.project(e, v),
        }
    }

    fn takes_hints(&self) -> bool {
        matches!(self, Near::Shared(_))
    }

    fn violation(&self, e: usize, v: &[V3]) -> f64 {
        v.iter().fold(0.0, |m: f64, v| {
            let off = norm(sub(*v, self.target(e, *v)));
            if off <= m { m } else { off }
        })
    }

    /// The plane across the way to the nearest point; for points all three coordinates.
    fn linearize(&self, e: usize, v: &[V3], _: f64, row: &mut dyn FnMut(Row<'_>)) {
        let Some(v) = v.first() else { return };
        let off = sub(*v, self.target(e, *v));
        match self {
            Near::Shared(_) => {
                let length = norm(off);
                if length > 0.0 {
                    row(Row { value: length, relation: Relation::Zero, gradient: &[off.map(|c| c / length)] });
                }
            }
            Near::At(_) => {
                for d in 0..3 {
                    let axis = [0, 1, 2].map(|c| f64::from(u8::from(c == d)));
                    row(Row { value: off[d], relation: Relation::Zero, gradient: &[axis] });
                }
            }
        }
    }
}
