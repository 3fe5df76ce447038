//! A plane with a bowl in it.

use super::{Nearest, Solid, V3, across, add, dot, in_front_of_others, most_in_front, norm, unit_or};

/// The ground below a plane through the origin, without a ball around the origin: a bowl to fall into.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pit {
    /// The unit normal of the plane, out of the ground.
    pub normal: [f64; 3],
    /// The radius of the bowl.
    pub radius: f64,
}

impl Solid for Pit {
    fn nearest(&self, x: V3) -> Nearest {
        let height = dot(self.normal, x);
        let flat = add(x, -height, self.normal);
        let (out, r, rho) = (unit_or(flat, across(self.normal)), norm(x), norm(flat));
        let inside = height < 0.0 && r > self.radius;
        let sign = if inside { -1.0 } else { 1.0 };
        // The plane where it is nearest, or its rim.
        let on_plane = if rho >= self.radius {
            Nearest { point: flat, normal: self.normal, distance: height }
        } else {
            let point = out.map(|o| self.radius * o);
            let from = add(x, -1.0, point);
            let up = unit_or(add(self.normal, -1.0, out), self.normal);
            Nearest { point, normal: unit_or(from.map(|f| sign * f), up), distance: sign * norm(from) }
        };
        if height > 0.0 {
            return on_plane;
        }
        // The bowl, seen from within: its normal points to the origin.
        let inward = unit_or(x.map(|c| -c), self.normal);
        let bowl = Nearest { point: inward.map(|n| -self.radius * n), normal: inward, distance: self.radius - r };
        if bowl.distance.abs() <= on_plane.distance.abs() { bowl } else { on_plane }
    }

    /// The plane, the bowl.
    fn patch(&self, x: V3) -> u32 {
        most_in_front(self, 2, x)
    }

    fn on_patch(&self, patch: u32, x: V3) -> Nearest {
        let (normal, distance) = match patch {
            0 => (self.normal, dot(self.normal, x)),
            _ => (unit_or(x.map(|c| -c), self.normal), self.radius - norm(x)),
        };
        Nearest { point: add(x, -distance, normal), normal, distance }
    }

    fn away(&self, patch: u32, x: V3) -> f64 {
        in_front_of_others(self, 2, patch, x)
    }
}
