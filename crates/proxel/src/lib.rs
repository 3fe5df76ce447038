//! Proxel minimises deformation energies under constraints.
//!
//! This crate is the facade: applications that turn a description (meshes, pins, settings) into a problem for the
//! splitting engine and its result back into what the user gave. [`deform`] poses bodies, [`keyframes`] move their
//! handles, [`simulate`] lets them fall. [`geodesic`] measures surfaces, [`shape`] makes their faces planar. [`wavefront`]
//! compares images, [`restore`] sharpens them.
//! [`compose`] solves what users put together, [`problem_file`] keeps a problem, to be solved again.

pub mod compose;
pub mod deform;
pub mod geodesic;
pub mod keyframes;
pub mod pins;
pub mod preview;
pub mod problem_file;
pub mod report;
pub mod restore;
pub mod samples;
pub mod settings;
pub mod shape;
pub mod simulate;
mod threads;
pub mod unwrap;
pub mod wavefront;

pub use proxel_imaging as imaging;
pub use proxel_linalg as linalg;
pub use proxel_mesh as mesh;
pub use proxel_model as model;
pub use proxel_split as split;
