//! Where the way of a point enters a solid.

use super::{Nearest, Solid, V3, add, dot, norm};

/// Steps on the way of a point to a solid.
const PACES: usize = 48;

/// By sphere tracing (Hart 1996): where a solid is at a distance, the way is free for as long.
pub(super) fn traced<S: Solid + ?Sized>(solid: &S, from: V3, to: V3, tolerance: f64) -> Option<(u32, V3)> {
    let way = add(to, -1.0, from);
    let length = norm(way);
    let (mut gone, mut at) = (0.0, from);
    for _ in 0..PACES {
        let near = solid.nearest(at);
        if near.distance <= tolerance {
            break;
        }
        gone += near.distance;
        if gone >= length || length == 0.0 {
            return None;
        }
        at = add(from, gone / length, way);
    }
    let patch = solid.patch(at);
    let Nearest { point, normal, .. } = solid.on_patch(patch, at);
    // Where paces were not enough the way is along the surface, and in front of it as far as is known.
    let behind = dot(normal, add(to, -1.0, point)) < -tolerance;
    behind.then_some((patch, point))
}
