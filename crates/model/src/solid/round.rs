//! Solids around the origin: sphere, box, capsule, cylinder.

use super::{Nearest, Solid, V3, across, add, dot, in_front_of_others, most_in_front, norm, unit_or};

/// A ball around the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Its radius.
    pub radius: f64,
}

impl Solid for Sphere {
    fn nearest(&self, x: V3) -> Nearest {
        around([0.0; 3], x, self.radius, [0.0, 1.0, 0.0])
    }
}

/// The surface point of a ball; `up` is the normal for its centre.
fn around(center: V3, x: V3, radius: f64, up: V3) -> Nearest {
    let from = add(x, -1.0, center);
    let normal = unit_or(from, up);
    Nearest { point: add(center, radius, normal), normal, distance: norm(from) - radius }
}

/// The box |x_d| <= half_d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brick {
    /// Half of its sides.
    pub half: [f64; 3],
}

impl Solid for Brick {
    fn nearest(&self, x: V3) -> Nearest {
        let over = [0, 1, 2].map(|d| x[d].abs() - self.half[d]);
        let sides = over.iter().filter(|o| **o > 0.0).count();
        let sign = |d: usize| if x[d] < 0.0 { -1.0 } else { 1.0 };
        if sides > 1 {
            let point = [0, 1, 2].map(|d| x[d].clamp(-self.half[d], self.half[d]));
            let from = add(x, -1.0, point);
            return Nearest { point, normal: unit_or(from, [0.0, 1.0, 0.0]), distance: norm(from) };
        }
        // In front of one face, or inside: the face that is farthest out, whose normal has no rounding.
        let face = (0..3).max_by(|a, b| over[*a].total_cmp(&over[*b])).unwrap_or(0);
        let normal = [0, 1, 2].map(|d| if d == face { sign(d) } else { 0.0 });
        Nearest { point: add(x, -over[face], normal), normal, distance: over[face] }
    }

    /// 2 d for the face at half_d, 2 d + 1 for the one across.
    fn patch(&self, x: V3) -> u32 {
        most_in_front(self, 6, x)
    }

    fn on_patch(&self, patch: u32, x: V3) -> Nearest {
        let (d, sign) = ((patch as usize / 2).min(2), if patch.is_multiple_of(2) { 1.0 } else { -1.0 });
        let normal = [0, 1, 2].map(|c| if c == d { sign } else { 0.0 });
        let distance = sign * x[d] - self.half[d];
        Nearest { point: add(x, -distance, normal), normal, distance }
    }

    fn away(&self, patch: u32, x: V3) -> f64 {
        in_front_of_others(self, 6, patch, x)
    }
}

/// All points within `radius` of the segment from -half to half.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// Half of the segment.
    pub half: [f64; 3],
    /// Its radius.
    pub radius: f64,
}

impl Solid for Capsule {
    fn nearest(&self, x: V3) -> Nearest {
        let length2 = dot(self.half, self.half);
        let along = if length2 > 0.0 { (dot(self.half, x) / length2).clamp(-1.0, 1.0) } else { 0.0 };
        let up = if length2 > 0.0 { across(unit_or(self.half, [0.0, 1.0, 0.0])) } else { [0.0, 1.0, 0.0] };
        around(self.half.map(|h| along * h), x, self.radius, up)
    }
}

/// The points within `radius` of an axis through the origin and within `half` of the origin along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// The unit direction of the axis.
    pub axis: [f64; 3],
    /// Its radius.
    pub radius: f64,
    /// Half of its length, infinite for one without ends.
    pub half: f64,
}

impl Solid for Cylinder {
    fn nearest(&self, x: V3) -> Nearest {
        let along = dot(self.axis, x);
        let radial = add(x, -along, self.axis);
        let out = unit_or(radial, across(self.axis));
        let (over_side, over_end) = (norm(radial) - self.radius, along.abs() - self.half);
        let end = if along < 0.0 { self.axis.map(|a| -a) } else { self.axis };
        if over_side > 0.0 && over_end > 0.0 {
            let from = add(out.map(|o| over_side * o), over_end, end);
            let distance = norm(from);
            return Nearest { point: add(x, -1.0, from), normal: unit_or(from, out), distance };
        }
        let (normal, distance) = if over_side > over_end { (out, over_side) } else { (end, over_end) };
        Nearest { point: add(x, -distance, normal), normal, distance }
    }

    /// The side, and the ends along the axis and against it.
    fn patch(&self, x: V3) -> u32 {
        most_in_front(self, 3, x)
    }

    fn on_patch(&self, patch: u32, x: V3) -> Nearest {
        let along = dot(self.axis, x);
        let (normal, distance) = match patch {
            0 => {
                let radial = add(x, -along, self.axis);
                (unit_or(radial, across(self.axis)), norm(radial) - self.radius)
            }
            1 => (self.axis, along - self.half),
            _ => (self.axis.map(|a| -a), -along - self.half),
        };
        Nearest { point: add(x, -distance, normal), normal, distance }
    }

    fn away(&self, patch: u32, x: V3) -> f64 {
        in_front_of_others(self, 3, patch, x)
    }
}
