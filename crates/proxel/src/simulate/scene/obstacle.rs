//! Obstacles as scenes describe them.

use crate::pins::Rotation;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A solid that no vertex of a body may enter, at rest or on its way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObstacleSpec {
    /// Its name, in messages.
    #[serde(default)]
    pub name: String,
    /// What it is.
    pub shape: ShapeSpec,
    /// Coulomb's coefficient of friction; for auto and the methods of Newton's kind.
    #[serde(default)]
    pub friction: f64,
    /// Moves it at this velocity from time 0 on, m/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<[f64; 3]>,
    /// Moves it from place to place, by times.
    #[serde(default, rename = "keyframe", skip_serializing_if = "Vec::is_empty")]
    pub keyframes: Vec<MotionKey>,
}

/// Where an obstacle is at a time: as its shape says, turned and shifted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MotionKey {
    /// s
    pub time: f64,
    /// A turn around an axis through `center`, or the shape's own centre or point; degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotate: Option<Rotation>,
    /// A shift, after the turn, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub translate: Option<[f64; 3]>,
}

/// The solids. Lengths in m.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum ShapeSpec {
    /// All that is behind a plane; the normal points to where bodies may be.
    HalfSpace {
        /// A point of the plane.
        point: [f64; 3],
        /// Its normal, of any length.
        normal: [f64; 3],
    },
    /// The same as a half-space.
    Plane {
        /// A point of the plane.
        point: [f64; 3],
        /// Its normal, of any length.
        normal: [f64; 3],
    },
    /// A ball.
    Sphere {
        /// Its centre.
        center: [f64; 3],
        /// Its radius.
        radius: f64,
    },
    /// A box along the axes, which `rotate` turns around its centre.
    Box {
        /// Its centre.
        center: [f64; 3],
        /// Lengths of its sides.
        size: [f64; 3],
        /// Turns it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        rotate: Option<Rotation>,
    },
    /// All points near a segment.
    Capsule {
        /// One end of the segment.
        from: [f64; 3],
        /// The other end.
        to: [f64; 3],
        /// Its radius.
        radius: f64,
    },
    /// A cylinder, endless where it has no length.
    Cylinder {
        /// Its centre.
        center: [f64; 3],
        /// The direction of its axis, of any length.
        axis: [f64; 3],
        /// Its radius.
        radius: f64,
        /// Its length.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        length: Option<f64>,
    },
    /// A half-space without a ball around a point of its plane: a bowl.
    Pit {
        /// The centre of the bowl, on the plane.
        center: [f64; 3],
        /// The normal of the plane, of any length.
        normal: [f64; 3],
        /// The radius of the bowl.
        radius: f64,
    },
    /// The ground below heights over a grid in the plane y = 0, down to a flat bottom.
    HeightField {
        /// The corner of the grid, where its first height stands; its y is added to all heights.
        origin: [f64; 3],
        /// Distances between columns, along x, and between rows, along z.
        spacing: [f64; 2],
        /// Rows of heights, all of the same length, 2 or more of each.
        heights: Vec<Vec<f64>>,
        /// How far the bottom is below the lowest height.
        depth: f64,
    },
    /// A closed surface of triangles.
    Mesh {
        /// A file of any format, seen from the scene's folder.
        file: String,
        /// Scales it around the origin, first.
        #[serde(default = "one")]
        scale: f64,
        /// Turns it around the origin unless `center` says otherwise, second.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        rotate: Option<Rotation>,
        /// Moves it, last.
        #[serde(default)]
        translate: [f64; 3],
    },
}

fn one() -> f64 {
    1.0
}
