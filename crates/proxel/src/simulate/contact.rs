//! What touches what: planes in front of which points of bodies stay, from solids.

use super::world::{Touching, World};
use proxel_model::contact::{Contacts, Touch};
use proxel_model::solid::{Nearest, Placed, Solid};
use rayon::prelude::*;
use std::collections::BTreeMap;

type V3 = [f64; 3];

/// A point nearer to a wall than this part of its body's size has a plane in front of it; so have all that would pass one.
const NEAR: f64 = 0.01;
/// A point this near to a wall has met it, in units of its body's size.
const MET: f64 = 1e-9;
/// Steps on the way of a point to a wall.
const PACES: usize = 48;
/// Normals with more than this for a product, 8 degrees apart or less, are those of a smooth surface.
const SMOOTH: f64 = 0.99;
/// Most planes of a wall that a point keeps besides the nearest one.
const KEPT: usize = 2;

/// The obstacles during a step.
pub(super) struct Walls {
    now: Vec<Placed>,    // at the end of the step
    before: Vec<Placed>, // at its beginning
    friction: Vec<f64>,
}

/// Forces between points and walls, kept from step to step: (point, wall) and the force along the normal.
pub(super) type Known = BTreeMap<(u32, u32), f64>;

impl Walls {
    /// From time `from` to time `to`.
    pub fn new(world: &World, from: f64, to: f64) -> Self {
        let at = |t: f64| world.obstacles.iter().map(|o| o.at(t, world.center)).collect();
        Walls { now: at(to), before: at(from), friction: world.obstacles.iter().map(|o| o.friction).collect() }
    }

    /// The solids at the end of the step.
    pub fn solids(&self) -> &[Placed] {
        &self.now
    }

    /// How deep points are in walls, at most: depth, place in `touching`, wall. 0 where none is inside.
    pub fn deepest(&self, touching: &Touching, x: &[f64]) -> (f64, usize, usize) {
        let depths: Vec<(f64, usize)> = (0..touching.who.len())
            .into_par_iter()
            .map(|k| {
                let c = touching.points.at(k, x);
                let depth = |wall: &Placed| -wall.nearest(c).distance;
                let deeper = |a: (f64, usize), b: (f64, usize)| if b.0 > a.0 || b.0.is_nan() { b } else { a };
                self.now.iter().map(depth).zip(0..).fold((0.0, 0), deeper)
            })
            .collect();
        depths.iter().enumerate().fold((0.0, 0, 0), |most, (k, (depth, wall))| {
            if *depth > most.0 || depth.is_nan() { (*depth, k, *wall) } else { most }
        })
    }

    /// Planes for points on their way from x to y: where the way first meets a wall, or where a wall is near its end.
    pub fn meet(&self, world: &World, x: &[f64], y: &[f64], known: &Known) -> Vec<Touch> {
        let touching = &world.touching;
        let of_point = |k: usize| {
            let (from, to) = (touching.points.at(k, x), touching.points.at(k, y));
            let size = world.bodies[touching.who[k].0].size;
            let walls = self.now.iter().enumerate();
            let met = walls.filter_map(|(w, wall)| Some((w, meet(wall, from, to, size)?)));
            met.map(|(w, near)| self.touch(k, w, &near, known.get(&(k as u32, w as u32)).copied(), from)).collect()
        };
        let all: Vec<Vec<Touch>> = (0..touching.who.len()).into_par_iter().map(of_point).collect();
        all.into_iter().flatten().collect()
    }

    /// Planes for points where they are now, with the forces that `old` has found. What was met in a hollow stays: a plane
    /// of before that bears a force and has the new plane's point in front of it.
    pub fn renew(&self, world: &World, old: &Contacts, x: &[f64], start: &[f64]) -> Vec<Touch> {
        let touching = &world.touching;
        let of_point = |k: usize| {
            let c: V3 = touching.points.at(k, x);
            let size = world.bodies[touching.who[k].0].size;
            let from = old.touches().partition_point(|t| (t.point as usize) < k);
            let before: Vec<&Touch> = old.touches()[from..].iter().take_while(|t| t.point as usize == k).collect();
            let mut out = Vec::new();
            for (w, wall) in self.now.iter().enumerate() {
                let own = || before.iter().filter(|t| t.other as usize == w);
                let near = wall.nearest(c);
                let pressed = own().map(|t| old.pressure(t, x));
                let all: f64 = pressed.clone().sum();
                if !(near.distance < NEAR * size || all > 0.0) {
                    continue;
                }
                let dot = |a: V3, b: V3| (0..3).map(|d| a[d] * b[d]).sum::<f64>();
                // Where the surface is smooth the new plane is but the old one a little further on.
                let bent = |t: &Touch| dot(t.normal, near.normal) < SMOOTH;
                let hollow = |t: &&&Touch| bent(t) && dot(t.normal, near.point) - t.height > MET * size;
                let mut kept: Vec<Touch> = own()
                    .filter(hollow)
                    .map(|t| Touch { force: old.pressure(t, x), ..**t })
                    .filter(|t| t.force > 0.0)
                    .collect();
                kept.sort_by(|a, b| b.force.total_cmp(&a.force));
                kept.truncate(KEPT);
                let rest = all - kept.iter().map(|t| t.force).sum::<f64>();
                let mut touch = self.touch(k, w, &near, Some(rest.max(0.0)), touching.points.at(k, start));
                touch.grip = self.friction[w] * all;
                kept.iter_mut().for_each(|t| t.grip = 0.0);
                out.push(touch);
                out.append(&mut kept);
            }
            out
        };
        let all: Vec<Vec<Touch>> = (0..touching.who.len()).into_par_iter().map(of_point).collect();
        all.into_iter().flatten().collect()
    }

    fn touch(&self, k: usize, w: usize, near: &Nearest, force: Option<f64>, start: V3) -> Touch {
        let force = force.unwrap_or(0.0);
        let stuck = self.now[w].placement.apply(self.before[w].placement.undo(start));
        Touch {
            point: k as u32,
            other: w as u32,
            normal: near.normal,
            height: (0..3).map(|d| near.normal[d] * near.point[d]).sum(),
            force,
            grip: self.friction[w] * force,
            anchor: stuck,
        }
    }
}

/// What is nearest on a wall where the way of a point meets it, by sphere tracing (Hart 1996): where the wall is at a
/// distance, the way is free for as long. Else what is nearest at its end, if that is near.
fn meet(wall: &Placed, from: V3, to: V3, size: f64) -> Option<Nearest> {
    let way = [0, 1, 2].map(|d| to[d] - from[d]);
    let length = way.iter().map(|w| w * w).sum::<f64>().sqrt();
    let mut gone = 0.0;
    let mut near = wall.nearest(from);
    for _ in 0..PACES {
        if near.distance <= MET * size {
            return Some(near);
        }
        gone += near.distance;
        if gone >= length || length == 0.0 {
            let end = wall.nearest(to);
            return (end.distance < NEAR * size).then_some(end);
        }
        near = wall.nearest([0, 1, 2].map(|d| from[d] + gone / length * way[d]));
    }
    Some(near)
}

/// Forces between points and walls as they were found at x.
pub(super) fn learn(contacts: &Contacts, x: &[f64]) -> Known {
    let mut known = Known::new();
    for touch in contacts.touches() {
        let force = contacts.pressure(touch, x);
        if force > 0.0 {
            *known.entry((touch.point, touch.other)).or_insert(0.0) += force;
        }
    }
    known
}

#[cfg(test)]
mod tests {
    use super::*;
    use proxel_model::solid::{Cylinder, Ground, Placement};
    use std::sync::Arc;

    #[test]
    fn ways_are_traced_to_the_first_wall() {
        let at = Placement::at([0.0, 1.0, 0.0]);
        let rod = Placed { solid: Arc::new(Cylinder { axis: [0.0, 0.0, 1.0], radius: 0.1, half: 9.0 }), placement: at };
        // Through the rod and out on the other side: its near side is met.
        let near = meet(&rod, [0.01, 2.0, 0.0], [0.01, 0.0, 0.0], 1.0).unwrap();
        assert!(near.normal[1] > 0.9 && near.distance.abs() <= 1e-9, "{near:?}");
        assert!(meet(&rod, [0.3, 2.0, 0.0], [0.3, 0.0, 0.0], 1.0).is_none());
        assert!(meet(&rod, [0.0, 2.0, 0.0], [0.0, 2.0, 0.0], 1.0).is_none());
        let floor = Placed { solid: Arc::new(Ground { normal: [0.0, 1.0, 0.0] }), placement: Placement::at([0.0; 3]) };
        assert!(meet(&floor, [0.0, 5.0, 0.0], [9.0, 0.005, 0.0], 1.0).is_some_and(|n| n.distance > 0.004));
        assert!(meet(&floor, [0.0, -0.5, 0.0], [0.0, -0.6, 0.0], 1.0).is_some(), "from inside it is met at once");
    }
}
