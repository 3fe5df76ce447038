//! Solids that nothing may enter: where their surface is nearest.

mod pit;
mod placed;
mod round;
#[cfg(test)]
mod tests;

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

/// A closed set with a surface.
pub trait Solid: Send + Sync + std::fmt::Debug {
    /// The point of the surface nearest to x. Where there are several, always the same one.
    fn nearest(&self, x: [f64; 3]) -> Nearest;
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
