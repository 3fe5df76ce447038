//! Bodies as scenes describe them.

use crate::keyframes::Key;
use crate::pins::{Combine, Group, Index, Region, Rotation, Sphere};
use crate::settings::{Material, SurfaceModel};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A body: a mesh from a file or a generator, what it is made of, where it starts and what holds it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BodySpec {
    /// Its name, in messages and files.
    pub name: String,
    /// Its mesh at rest: a file of any format, seen from the scene's folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh: Option<String>,
    /// A mesh without a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub generate: Option<Generate>,
    /// Where it starts if not at rest: a file with positions of the same vertices.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<String>,
    /// Scales rest shape and start around the origin, first.
    pub scale: f64,
    /// Turns them, second; around the origin unless `center` says otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotate: Option<Rotation>,
    /// Moves them, last. m.
    pub translate: [f64; 3],
    /// Velocity at the start, m/s.
    pub velocity: [f64; 3],
    /// Spin at the start around the centre of mass, rad/s.
    pub angular_velocity: [f64; 3],
    /// What a mesh of faces is: the skin of a body, carried by a lattice of tetrahedra (embed), or a sheet (shell).
    pub model: SurfaceModel,
    /// Cells of the lattice along the longest side.
    pub resolution: usize,
    /// The material where no region says otherwise.
    pub material: Material,
    /// Materials of regions of the mesh, by their numbers.
    pub regions: BTreeMap<String, Material>,
    /// kg/m^3 for tetrahedra, kg/m^2 for triangles, kg/m for edges.
    pub density: f64,
    /// Bending stiffness of triangles, N m.
    pub bending: f64,
    /// Hard limits [LO, HI] of the principal stretches.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub strain_limit: Option<[f64; 2]>,
    /// Whether every tetrahedron, triangle and edge of the mesh is elastic, not only those of the highest dimension.
    pub mixed: bool,
    /// Whether inverted tetrahedra at rest are turned instead of refused.
    pub fix_orientation: bool,
    /// What holds it.
    #[serde(rename = "pin")]
    pub pins: Vec<PinSpec>,
}

impl Default for BodySpec {
    fn default() -> Self {
        BodySpec {
            name: String::new(),
            mesh: None,
            generate: None,
            start: None,
            scale: 1.0,
            rotate: None,
            translate: [0.0; 3],
            velocity: [0.0; 3],
            angular_velocity: [0.0; 3],
            model: SurfaceModel::default(),
            resolution: 24,
            material: Material::default(),
            regions: BTreeMap::new(),
            density: 1000.0,
            bending: 0.0,
            strain_limit: None,
            mixed: false,
            fix_orientation: false,
            pins: Vec::new(),
        }
    }
}

/// Meshes without files, around the origin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Generate {
    /// A box of cubes, each split into tetrahedra.
    Bar {
        /// Cubes along x, y and z.
        cells: [usize; 3],
        /// Lengths of the sides, m.
        size: [f64; 3],
        /// How a cube is split.
        #[serde(default)]
        split: Split,
    },
    /// A sheet of squares in the plane z = 0, each split into triangles.
    Cloth {
        /// Squares along x and y.
        cells: [usize; 2],
        /// Lengths of the sides, m.
        size: [f64; 2],
    },
    /// A ball of tetrahedra.
    Ball {
        /// m
        radius: f64,
        /// Edge of the lattice that it is cut from, m.
        cell: f64,
    },
    /// A torus of tetrahedra around the z axis.
    Torus {
        /// Radius of the circle, m.
        major: f64,
        /// Radius of the tube, m.
        minor: f64,
        /// Edge of the lattice that it is cut from, m.
        cell: f64,
    },
}

/// How a cube is split into tetrahedra.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Split {
    /// Five, mirrored from cube to cube, so that faces fit.
    #[default]
    Five,
    /// Six around a diagonal.
    Six,
    /// Five, the same in each cube: diagonals of neighbours cross, as in the bars of Overby et al. 2017.
    FiveAlike,
}

/// Vertices that are held, chosen where the body starts, and where they go.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PinSpec {
    /// Its name, in messages.
    pub name: String,
    /// Chooses these vertices, 0-based.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub indices: Option<Vec<Index>>,
    /// Chooses the vertices in an axis-aligned box.
    #[serde(rename = "box", skip_serializing_if = "Option::is_none")]
    pub region: Option<Region>,
    /// Chooses the vertices in a ball.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sphere: Option<Sphere>,
    /// Chooses the vertices on the side of a plane that its normal points to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plane: Option<crate::pins::HalfSpace>,
    /// Whether a vertex must be in all of the above or in any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub combine: Option<Combine>,
    /// Moves them at this velocity from time 0 on, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity: Option<[f64; 3]>,
    /// Moves them from place to place, by times.
    #[serde(rename = "keyframe", skip_serializing_if = "Vec::is_empty")]
    pub keyframes: Vec<PinKey>,
}

/// Where pinned vertices are at a time: as they start, turned and shifted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PinKey {
    /// s; may be before 0.
    pub time: f64,
    /// A turn around an axis through `center`, or the vertices' centroid; degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotate: Option<Rotation>,
    /// A shift, after the turn, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub translate: Option<[f64; 3]>,
    /// The position of each vertex instead, by ascending index.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub targets: Option<Vec<[f64; 3]>>,
}

impl PinKey {
    pub(in crate::simulate) fn key(&self) -> (f64, Key) {
        (self.time, Key { rotate: self.rotate, translate: self.translate, matrix: None, targets: self.targets.clone() })
    }
}

impl PinSpec {
    /// The group of vertices that it chooses.
    pub(in crate::simulate) fn group(&self) -> Group {
        Group {
            indices: self.indices.clone(),
            region: self.region,
            sphere: self.sphere,
            plane: self.plane,
            combine: self.combine,
            ..Group::default()
        }
    }
}
