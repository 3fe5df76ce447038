//! The obstacles of a scene: solids on their ways.

use super::closed_mesh::{ClosedMesh, terrain};
use super::scene::{ObstacleSpec, SceneFile, ShapeSpec};
use super::scenery::Drawn;
use super::track::Motion;
use crate::pins::{InputError, RigidMotion, Rotation};
use proxel_mesh::topology::surface;
use proxel_model::solid::{Brick, Capsule, Cylinder, Ground, Pit, Placed, Placement, Solid, Sphere};
use std::sync::Arc;

type V3 = [f64; 3];

/// A solid in the world.
#[derive(Clone, Debug)]
pub(super) struct Obstacle {
    pub name: String,
    pub friction: f64,
    solid: Arc<dyn Solid>,
    motion: Motion,
    /// What pictures show of it.
    pub drawn: Drawn,
}

impl Obstacle {
    /// Obstacle `k` of a scene.
    pub fn new(file: &SceneFile, k: usize, spec: &ObstacleSpec) -> Result<Self, InputError> {
        let place = format!("obstacle[{k}]");
        let (solid, home, drawn) = solid(file, &format!("{place}.shape"), &spec.shape)?;
        let motion = Motion::new(&format!("{place}.keyframe"), spec.velocity, &spec.keyframes, home)?;
        Ok(Obstacle { name: spec.name.clone(), friction: spec.friction, solid, motion, drawn })
    }

    /// The solid at a time, seen from `center`.
    pub fn at(&self, time: f64, center: V3) -> Placed {
        let Placement { rotation, shift } = self.motion.at(time);
        let shift = [0, 1, 2].map(|d| shift[d] - center[d]);
        Placed { solid: self.solid.clone(), placement: Placement { rotation, shift } }
    }

    /// Whether it never moves.
    pub fn is_still(&self) -> bool {
        self.motion.is_still()
    }
}

type Built = (Arc<dyn Solid>, Placement, Drawn);

fn solid(file: &SceneFile, place: &str, shape: &ShapeSpec) -> Result<Built, InputError> {
    Ok(match shape {
        ShapeSpec::HalfSpace { point, normal } | ShapeSpec::Plane { point, normal } => {
            let normal = unit(*normal);
            (Arc::new(Ground { normal }), Placement::at(*point), Drawn::Ground { normal, pit: 0.0 })
        }
        ShapeSpec::Sphere { center, radius } => {
            (Arc::new(Sphere { radius: *radius }), Placement::at(*center), Drawn::ball(*radius))
        }
        ShapeSpec::Box { center, size, rotate } => {
            let rotation = rows(rotate);
            let half = size.map(|s| s / 2.0);
            (Arc::new(Brick { half }), Placement { rotation, shift: *center }, Drawn::brick(half))
        }
        ShapeSpec::Capsule { from, to, radius } => {
            let half = [0, 1, 2].map(|d| to[d] / 2.0 - from[d] / 2.0);
            let center = [0, 1, 2].map(|d| to[d] / 2.0 + from[d] / 2.0);
            (Arc::new(Capsule { half, radius: *radius }), Placement::at(center), Drawn::capsule(half, *radius))
        }
        ShapeSpec::Cylinder { center, axis, radius, length } => {
            let half = length.map_or(f64::INFINITY, |l| l / 2.0);
            let (axis, radius) = (unit(*axis), *radius);
            let drawn = Drawn::cylinder(axis, radius, half);
            (Arc::new(Cylinder { axis, radius, half }), Placement::at(*center), drawn)
        }
        ShapeSpec::Pit { center, normal, radius } => {
            let (normal, radius) = (unit(*normal), *radius);
            (Arc::new(Pit { normal, radius }), Placement::at(*center), Drawn::Ground { normal, pit: radius })
        }
        ShapeSpec::HeightField { origin, spacing, heights, depth } => {
            let (points, triangles) = terrain(*spacing, heights, *depth);
            closed(file, place, points, triangles, *origin)?
        }
        ShapeSpec::Mesh { file: path, scale, rotate, translate } => {
            let mesh =
                file.mesh(path).map_err(|e| file.refuse(&format!("{place}.mesh"), &e.to_string(), "correct it"))?;
            let motion = pose(rotate);
            let points = mesh.points.iter().map(|p| {
                let p = motion.apply(p.map(|v| v * scale));
                [0, 1, 2].map(|d| p[d] + translate[d])
            });
            closed(file, place, points.collect(), surface(&mesh).fan_triangles(), [0.0; 3])?
        }
    })
}

/// A closed mesh around the middle of its box.
fn closed(
    file: &SceneFile,
    place: &str,
    points: Vec<V3>,
    triangles: Vec<[u32; 3]>,
    origin: V3,
) -> Result<Built, InputError> {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in &points {
        (low, high) = ([0, 1, 2].map(|d| low[d].min(p[d])), [0, 1, 2].map(|d| high[d].max(p[d])));
    }
    let middle = [0, 1, 2].map(|d| low[d] / 2.0 + high[d] / 2.0);
    let local: Vec<V3> = points.iter().map(|p| [0, 1, 2].map(|d| p[d] - middle[d])).collect();
    let solid = ClosedMesh::new(&local, &triangles)
        .map_err(|e| file.refuse(place, &e, "give a closed surface whose faces fit each other"))?;
    let home = Placement::at([0, 1, 2].map(|d| middle[d] + origin[d]));
    Ok((Arc::new(solid), home, Drawn::Whole(local, triangles)))
}

/// The turn of a pose around the origin, or around the centre that it names.
pub(super) fn pose(rotate: &Option<Rotation>) -> RigidMotion {
    rotate.map_or_else(RigidMotion::identity, |r| RigidMotion::rotation(r.axis, r.angle, r.center.unwrap_or_default()))
}

/// The rows of a turn.
fn rows(rotate: &Option<Rotation>) -> [V3; 3] {
    let turn = rotate.map_or_else(RigidMotion::identity, |r| RigidMotion::rotation(r.axis, r.angle, [0.0; 3]));
    let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|e| turn.apply(e));
    [0, 1, 2].map(|r| columns.map(|c| c[r]))
}

/// In units of its largest component a length neither overflows nor vanishes.
fn unit(v: V3) -> V3 {
    let largest = v.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    let v = v.map(|c| c / largest);
    let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
    v.map(|c| c / length)
}
