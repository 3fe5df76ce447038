//! Solids that nothing may enter: where their surface is nearest.

mod pit;
mod placed;
mod round;
#[cfg(test)]
mod tests;
mod way;

pub use pit::Pit;
pub use placed::{Placed, Placement};
pub use round::{Brick, Capsule, Cylinder, Sphere};

type V3 = [f64; 3];

/// The point of a solid's surface that is nearest to some point x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// That point.
    pub point: [f64; 3],
    /// The unit normal there, out of the solid: (x - point) / |x - point| outside, the opposite inside.
    pub normal: [f64; 3],
    /// |x - point|, negative inside.
    pub distance: f64,
}

/// A closed set with a surface of patches, each a part of a smooth surface that goes on beyond it without an end: the planes of
/// faces, the cylinder of a rod. What is in front of such a surface can be held there as one smooth constraint; the distance
/// from the solid itself bends at its edges.
pub trait Solid: Send + Sync + std::fmt::Debug {
    /// The point of the surface nearest to x. Where there are several, always the same one.
    fn nearest(&self, x: [f64; 3]) -> Nearest;

    /// Of the patches at the point of the surface nearest to x the one whose smooth surface x is farthest in front of, or
    /// least behind. Where x is inside, one that it is behind.
    fn patch(&self, _x: [f64; 3]) -> u32 {
        0
    }

    /// The point nearest to x of the smooth surface that a patch is part of.
    fn on_patch(&self, _patch: u32, x: [f64; 3]) -> Nearest {
        self.nearest(x)
    }

    /// How far a point in front of the smooth surface of a patch, and near to it, is from needing that patch: from the
    /// patch itself, or in front of another one that keeps it outside alone.
    fn away(&self, _patch: u32, _x: [f64; 3]) -> f64 {
        0.0
    }

    /// The patch that a straight way from a point outside enters the solid through first, and a point of its surface there;
    /// none where the way ends by at most `tolerance` behind it, or where `known` patches keep what is in front of them
    /// outside.
    fn entered(&self, from: [f64; 3], to: [f64; 3], tolerance: f64, known: &[u32]) -> Option<(u32, [f64; 3])> {
        if known.is_empty() { way::traced(self, from, to, tolerance) } else { None }
    }
}

/// The points with n . x <= 0: the ground below a plane through the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// The unit normal, out of the ground.
    pub normal: [f64; 3],
}

impl Solid for Ground {
    fn nearest(&self, x: V3) -> Nearest {
        let distance = dot(self.normal, x);
        Nearest { point: add(x, -distance, self.normal), normal: self.normal, distance }
    }
}

/// Of several solids the one that x is deepest in, or nearest to.
pub fn deepest<'a>(solids: impl IntoIterator<Item = &'a Placed>, x: [f64; 3]) -> Option<Nearest> {
    let mut least: Option<Nearest> = None;
    for solid in solids {
        let nearest = solid.nearest(x);
        if least.is_none_or(|l| nearest.distance < l.distance) {
            least = Some(nearest);
        }
    }
    least
}

/// Of a solid that a point is outside of where it is in front of one of the first `n` patches: the patch that x is farthest in
/// front of, or least behind.
fn most_in_front(solid: &impl Solid, n: u32, x: V3) -> u32 {
    let distance = |patch: u32| solid.on_patch(patch, x).distance;
    (1..n).fold(0, |most, patch| if distance(patch) > distance(most) { patch } else { most })
}

/// Of such a solid: how far x is in front of a patch other than this one; 0 where it is in front of none.
fn in_front_of_others(solid: &impl Solid, n: u32, patch: u32, x: V3) -> f64 {
    (0..n).filter(|other| *other != patch).fold(0.0, |most, other| solid.on_patch(other, x).distance.max(most))
}

fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn norm(a: V3) -> f64 {
    dot(a, a).sqrt()
}

/// a + s b
fn add(a: V3, s: f64, b: V3) -> V3 {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

/// v over its length; `other` where it has none.
fn unit_or(v: V3, other: V3) -> V3 {
    let length = norm(v);
    if length > 0.0 { v.map(|c| c / length) } else { other }
}

/// A unit vector that is normal to the unit vector n.
fn across(n: V3) -> V3 {
    let least = (0..3).min_by(|a, b| n[*a].abs().total_cmp(&n[*b].abs())).unwrap_or(0);
    let axis = [0, 1, 2].map(|d| if d == least { 1.0 } else { 0.0 });
    unit_or(add(axis, -dot(axis, n), n), [1.0, 0.0, 0.0])
}
