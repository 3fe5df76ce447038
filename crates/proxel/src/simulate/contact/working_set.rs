//! Which planes hold which points while a step is solved.
//!
//! What points may do, to stay outside of solids, is not convex. A step is solved over convex parts of it: from an anchor, a
//! place where all points are outside, each point is held in front of the smooth surfaces of some patches that its anchor is
//! in front of. Patches are only added then, where a point is inside of a solid and no plane of it knows, or has passed
//! through one. There are only so many patches; so this ends, with all points outside, and the objective not above that at the
//! anchor, from where Newton's method descends. That place is the next anchor: planes of patches that a point does not touch
//! are dropped, those it is nearest to are put there. Each anchor has a lower objective than the one before, so that no set
//! of planes comes again; and where no plane with a force is dropped, forces are along normals of what is touched.
//!
//! At a ridge a point is held by one of the faces, and by all of them in a hollow. No point can rest on a ridge with a force:
//! of all ways out in front of one face or the other, one goes down.

use super::{V3, Walls, distance, dot};
use crate::simulate::contact::Known;
use crate::simulate::world::World;
use proxel_model::contact::{Contacts, Touch};
use proxel_model::solid::Solid;
use rayon::prelude::*;

/// A point nearer to a wall than this part of its body's size has a plane in front of it.
const NEAR: f64 = 0.01;
/// A point touches what is as near as this part of its body's size.
const TOUCHING: f64 = 1e-7;
/// A point that presses on the plane of a face is beside that face where it is farther from it than this part of its body's
/// size. In a shallow hollow it is as much farther as it is deep behind the other face, over the sine of the angle.
const BESIDE: f64 = 1e-5;
/// A tangent that is turned by more than this cosine is not taken anew: the point has come to the other side of something round.
const ROUND: f64 = 0.5;
/// Most patches of a wall that hold a point.
const MOST: usize = 12;

/// The planes of a step.
pub(in crate::simulate) struct WorkingSet {
    start: Vec<f64>,
    anchor: Option<Vec<f64>>, // none as long as it is where points would be had they moved with each wall
    clear: Vec<Clear>,        // of each point for each wall
    grips: Grips,
}

/// When friction learns of the forces along normals that it is of. Only while it does not, a step minimises something.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::simulate) enum Grips {
    /// With every renewal.
    #[default]
    Renewed,
    /// At anchors.
    AtAnchors,
    /// Where a plane takes over from another one.
    Kept,
}

/// A ball that a wall is not in.
#[derive(Clone, Copy, Default)]
struct Clear {
    center: V3,
    radius: f64,
}

impl Clear {
    fn holds(&self, c: V3) -> bool {
        distance(c, self.center) < self.radius
    }
}

/// What has become of the planes.
#[derive(Default)]
pub(in crate::simulate) struct Renewed {
    pub touches: Vec<Touch>,
    /// Planes that had to be added, or that were dropped and bore a force.
    pub changed: usize,
    /// How deep a point is inside of a wall that no plane knows of, or behind a plane, at most, in units of its body's size.
    pub depth: f64,
}

impl Renewed {
    fn gather(parts: Vec<Renewed>) -> Renewed {
        let mut all = Renewed::default();
        for mut part in parts {
            all.touches.append(&mut part.touches);
            all.changed += part.changed;
            all.depth = if part.depth <= all.depth { all.depth } else { part.depth };
        }
        all
    }
}

impl WorkingSet {
    /// For a step that begins at x.
    pub fn new(world: &World, walls: &Walls, x: &[f64]) -> Self {
        let clear = vec![Clear::default(); world.touching.who.len() * walls.solids().len()];
        WorkingSet { start: x.to_vec(), anchor: None, clear, grips: Grips::default() }
    }

    /// From now on.
    pub fn set_grips(&mut self, grips: Grips) {
        self.grips = grips;
    }

    /// Does something for each point, with what is known to be clear around it; in order.
    fn for_each_point(
        &mut self,
        world: &World,
        walls: &Walls,
        one: impl Fn(usize, &mut [Clear], &(Vec<f64>, Option<Vec<f64>>)) -> Renewed + Sync,
    ) -> Renewed {
        let mut clear = std::mem::take(&mut self.clear);
        let places = (std::mem::take(&mut self.start), self.anchor.take());
        let n = walls.solids().len().max(1);
        debug_assert_eq!(clear.len(), world.touching.who.len() * walls.solids().len());
        let parts = clear.par_chunks_mut(n).enumerate().map(|(k, clear)| one(k, clear, &places)).collect();
        (self.start, self.anchor) = places;
        self.clear = clear;
        Renewed::gather(parts)
    }

    /// Planes for points on their way from the start to y: where the way first meets a wall, or where a wall is near its end.
    pub fn first(&mut self, world: &World, walls: &Walls, y: &[f64], known: &Known) -> Vec<Touch> {
        let points = &world.touching.points;
        let one = |k: usize, clear: &mut [Clear], (start, _): &(Vec<f64>, Option<Vec<f64>>)| {
            let (c, to) = (points.at(k, start), points.at(k, y));
            let size = world.bodies[world.touching.who[k].0].size;
            let mut out = Renewed::default();
            for (w, (wall, clear)) in walls.solids().iter().zip(clear).enumerate() {
                let from = walls.carried(w, c);
                let here = wall.nearest(from);
                let way = distance(from, to);
                if here.distance > way + NEAR * size {
                    *clear = Clear { center: from, radius: here.distance };
                    continue;
                }
                let met = if here.distance < -TOUCHING * size {
                    Some((wall.patch(from), from))
                } else {
                    wall.entered(from, to, TOUCHING * size, &[])
                };
                let met = met.or_else(|| {
                    let near = wall.nearest(to);
                    *clear = Clear { center: to, radius: near.distance };
                    (near.distance < NEAR * size).then(|| (wall.patch(to), to))
                });
                if let Some((patch, at)) = met {
                    let force = known.get(&(k as u32, w as u32)).copied().unwrap_or(0.0);
                    out.touches.push(walls.touch((k, w, patch), at, force, c));
                }
            }
            out
        };
        self.for_each_point(world, walls, one).touches
    }

    /// The planes at x with the forces that `old` has found there, tangents of curved patches taken anew; with more of them
    /// where points are inside of walls, or have passed through them, and no plane is in the way.
    pub fn renew(&mut self, world: &World, walls: &Walls, old: &Contacts, x: &[f64]) -> Renewed {
        let points = &world.touching.points;
        let is_rubbing = self.grips == Grips::Renewed;
        let one = |k: usize, clear: &mut [Clear], (start, anchor): &(Vec<f64>, Option<Vec<f64>>)| {
            let (c, began): (V3, V3) = (points.at(k, x), points.at(k, start));
            let size = world.bodies[world.touching.who[k].0].size;
            let tolerance = TOUCHING * size;
            let mut out = Renewed::default();
            for (w, (wall, clear)) in walls.solids().iter().zip(clear).enumerate() {
                let own: Vec<&Touch> = of_point(old, k).iter().filter(|t| t.other as usize == w).collect();
                let from = match anchor {
                    Some(anchor) => points.at(k, anchor),
                    None => walls.carried(w, began),
                };
                if own.is_empty() && clear.holds(c) && clear.holds(from) {
                    continue;
                }
                let mut behind = 0.0_f64;
                let mut known = Vec::with_capacity(own.len() + 1);
                for t in own {
                    let force = old.pressure(t, x);
                    let mut touch = walls.touch((k, w, t.patch), c, force, began);
                    if dot(touch.normal, t.normal) < ROUND {
                        touch = Touch { force, grip: walls.friction[w] * force, ..*t };
                    }
                    if !is_rubbing {
                        touch.grip = t.grip;
                    }
                    behind = behind.max(touch.height - dot(touch.normal, c));
                    known.push(t.patch);
                    out.touches.push(touch);
                }
                let mut depth = behind;
                if behind <= tolerance && !(clear.holds(c) && clear.holds(from)) && known.len() < MOST {
                    let near = wall.nearest(c);
                    if near.distance > 0.0 {
                        *clear = Clear { center: c, radius: near.distance };
                    }
                    depth = depth.max(-near.distance);
                    let is_inside = near.distance < -tolerance;
                    let entered = if clear.holds(from) { None } else { wall.entered(from, c, tolerance, &known) };
                    let inside = || is_inside.then(|| (wall.patch(c), c)).filter(|(patch, _)| !known.contains(patch));
                    if let Some((patch, at)) = entered.or_else(inside) {
                        out.touches.push(walls.touch((k, w, patch), at, 0.0, began));
                        out.changed += 1;
                    } else if known.is_empty() && near.distance < NEAR * size {
                        let patch = wall.patch(c);
                        if wall.on_patch(patch, from).distance >= -tolerance {
                            out.touches.push(walls.touch((k, w, patch), c, 0.0, began));
                        }
                    }
                }
                out.depth = out.depth.max(depth / size);
            }
            out
        };
        self.for_each_point(world, walls, one)
    }

    /// x is the next anchor: planes of patches that points do not touch are dropped, and there are those of the nearest ones,
    /// which take over what forces there are. `changed` are the planes with a force of patches that are not touched.
    pub fn accept(&mut self, world: &World, walls: &Walls, old: &Contacts, x: &[f64]) -> Renewed {
        let points = &world.touching.points;
        let is_rubbing = self.grips != Grips::Kept;
        let one = |k: usize, clear: &mut [Clear], (start, _): &(Vec<f64>, Option<Vec<f64>>)| {
            let (c, began): (V3, V3) = (points.at(k, x), points.at(k, start));
            let size = world.bodies[world.touching.who[k].0].size;
            let mut out = Renewed::default();
            for (w, (wall, clear)) in walls.solids().iter().zip(clear).enumerate() {
                let own = || of_point(old, k).iter().filter(|t| t.other as usize == w);
                if own().next().is_none() && clear.holds(c) && distance(c, clear.center) + NEAR * size < clear.radius {
                    continue;
                }
                let near = wall.nearest(c);
                if near.distance > 0.0 {
                    *clear = Clear { center: c, radius: near.distance };
                }
                let mut left: Vec<(V3, f64)> = Vec::new();
                let before = out.touches.len();
                for t in own() {
                    // Multipliers are those at x already: taken again they would go too far.
                    let force = t.force;
                    if wall.away(t.patch, c) <= BESIDE * size {
                        let touch = walls.touch((k, w, t.patch), c, force, began);
                        out.touches.push(if is_rubbing { touch } else { Touch { grip: t.grip, ..touch } });
                    } else if force > 0.0 {
                        left.push((t.normal, force));
                        out.changed += 1;
                    }
                }
                let patch = wall.patch(c);
                let has = out.touches[before..].iter().any(|t| t.patch == patch);
                if !has && (near.distance < NEAR * size || !left.is_empty()) {
                    let mut touch = walls.touch((k, w, patch), c, 0.0, began);
                    touch.force = left.iter().map(|(n, force)| force * dot(*n, touch.normal).max(0.0)).sum();
                    touch.grip = walls.friction[w] * touch.force;
                    out.touches.push(touch);
                }
            }
            out
        };
        let renewed = self.for_each_point(world, walls, one);
        self.anchor = Some(x.to_vec());
        renewed
    }
}

/// The touches of a point.
fn of_point(contacts: &Contacts, k: usize) -> &[Touch] {
    let touches = contacts.touches();
    let from = touches.partition_point(|t| (t.point as usize) < k);
    let to = touches.partition_point(|t| t.point as usize <= k);
    touches.get(from..to).unwrap_or(&[])
}

/// Whether all forces are between points and patches that they touch.
pub(in crate::simulate) fn is_complementary(world: &World, walls: &Walls, contacts: &Contacts, x: &[f64]) -> bool {
    let touching = &world.touching;
    contacts.touches().par_iter().all(|t| {
        let (k, c): (usize, V3) = (t.point as usize, touching.points.at(t.point as usize, x));
        let Some(wall) = walls.solids().get(t.other as usize) else { return false };
        let size = world.bodies[touching.who[k].0].size;
        contacts.pressure(t, x) <= 0.0 || wall.away(t.patch, c) <= BESIDE * size
    })
}
