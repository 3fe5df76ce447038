//! Meshes of Proxel: topology, file formats, generators, checks.
//!
//! A [`Mesh`] is what a file says, 0-based and in file order; nothing is renumbered, merged or
//! repaired behind the user's back. [`read_mesh`] and [`write_mesh`] pick the format by extension,
//! [`check`] finds what is wrong with a mesh, [`topology`] who touches whom, [`refine`] and [`subdivide`] split
//! elements, [`generate`] makes meshes without files, [`winding`] tells inside from outside, [`embed`] puts any
//! surface into a lattice of tetrahedra, [`uv`] reads, writes and certifies maps of a surface to the plane, and
//! [`write_series`] writes meshes in motion.

pub mod charts;
pub mod check;
pub mod embed;
mod error;
mod fields;
pub mod generate;
mod io;
mod mesh;
pub mod refine;
pub mod subdivide;
pub mod topology;
pub mod uv;
mod vec3;
pub mod winding;

pub use error::{ErrorKind, Item, MeshError, Result};
pub use fields::{Field, Fields};
pub use io::{
    Format, Frame, MOST_GLTF_FRAMES, atomic_write, check_output, check_series_output, check_writable, not_carried,
    parse_mesh, read_mesh, read_mesh_lenient, read_points, write_mesh, write_series,
};
pub use mesh::{Mesh, Polygons};
