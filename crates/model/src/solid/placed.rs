//! Solids somewhere, and on the way somewhere else.

use super::{Nearest, Solid, V3, add};
use std::sync::Arc;

/// The rigid motion x -> R x + t.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// R, by rows.
    pub rotation: [[f64; 3]; 3],
    /// t
    pub shift: [f64; 3],
}

impl Placement {
    /// A shift.
    pub fn at(shift: [f64; 3]) -> Self {
        Placement { rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], shift }
    }

    /// R v
    pub fn turn(&self, v: [f64; 3]) -> [f64; 3] {
        self.rotation.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
    }

    /// R^T v
    pub fn turn_back(&self, v: [f64; 3]) -> [f64; 3] {
        let r = &self.rotation;
        [0, 1, 2].map(|d| r[0][d] * v[0] + r[1][d] * v[1] + r[2][d] * v[2])
    }

    /// R x + t
    pub fn apply(&self, x: [f64; 3]) -> [f64; 3] {
        add(self.turn(x), 1.0, self.shift)
    }

    /// R^T (x - t)
    pub fn undo(&self, x: [f64; 3]) -> [f64; 3] {
        self.turn_back(add(x, -1.0, self.shift))
    }
}

/// A solid where it is now.
#[derive(Clone, Debug)]
pub struct Placed {
    /// Around its own origin.
    pub solid: Arc<dyn Solid>,
    /// From its own coordinates to those of the world.
    pub placement: Placement,
}

impl Solid for Placed {
    fn nearest(&self, x: V3) -> Nearest {
        let Nearest { point, normal, distance } = self.solid.nearest(self.placement.undo(x));
        Nearest { point: self.placement.apply(point), normal: self.placement.turn(normal), distance }
    }

    fn patch(&self, x: V3) -> u32 {
        self.solid.patch(self.placement.undo(x))
    }

    fn on_patch(&self, patch: u32, x: V3) -> Nearest {
        let Nearest { point, normal, distance } = self.solid.on_patch(patch, self.placement.undo(x));
        Nearest { point: self.placement.apply(point), normal: self.placement.turn(normal), distance }
    }

    fn away(&self, patch: u32, x: V3) -> f64 {
        self.solid.away(patch, self.placement.undo(x))
    }

    fn entered(&self, from: V3, to: V3, tolerance: f64, known: &[u32]) -> Option<(u32, V3)> {
        let (from, to) = (self.placement.undo(from), self.placement.undo(to));
        let (patch, point) = self.solid.entered(from, to, tolerance, known)?;
        Some((patch, self.placement.apply(point)))
    }
}
