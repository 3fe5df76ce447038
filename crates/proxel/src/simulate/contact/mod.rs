//! What touches what: planes in front of which points of bodies stay, from solids.

mod working_set;

pub(super) use working_set::{Grips, WorkingSet, is_complementary};

use super::world::{Touching, World};
use proxel_model::contact::{Contacts, Touch};
use proxel_model::solid::{Placed, Solid};
use rayon::prelude::*;
use std::collections::BTreeMap;

type V3 = [f64; 3];

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

    /// Whether a wall has friction.
    pub fn rub(&self) -> bool {
        self.friction.iter().any(|mu| *mu > 0.0)
    }

    /// Touches with the grips that their forces give.
    pub fn gripping(&self, touches: &[Touch]) -> Vec<Touch> {
        let grip = |t: &Touch| self.friction.get(t.other as usize).map_or(0.0, |mu| mu * t.force);
        touches.iter().map(|t| Touch { grip: grip(t), ..*t }).collect()
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

    /// Where a point would be had it moved with a wall since the beginning of the step.
    fn carried(&self, wall: usize, start: V3) -> V3 {
        self.now[wall].placement.apply(self.before[wall].placement.undo(start))
    }

    /// A point in front of a patch of a wall, by the plane where the surface of that is nearest to `at`.
    fn touch(&self, (point, wall, patch): (usize, usize, u32), at: V3, force: f64, start: V3) -> Touch {
        let near = self.now[wall].on_patch(patch, at);
        Touch {
            point: point as u32,
            other: wall as u32,
            patch,
            normal: near.normal,
            height: dot(near.normal, near.point),
            force,
            grip: self.friction[wall] * force,
            anchor: self.carried(wall, start),
        }
    }
}

fn dot(a: V3, b: V3) -> f64 {
    (0..3).map(|d| a[d] * b[d]).sum()
}

fn distance(a: V3, b: V3) -> f64 {
    (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt()
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
