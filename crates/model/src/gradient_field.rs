//! When a field on a triangle mesh is the gradient of a function, locally: two sets of copies (Tao, Zhang, Deng, Peng 2019,
//! *Parallel and scalable heat methods for geodesic distance computation*).

mod edges;
mod faces;
mod field;
#[cfg(test)]
mod tests;

pub use edges::{AroundFaces, TooManyFaces, field_on_edges};
pub use faces::{AlongEdges, FaceField};
pub use field::{CopiedField, Ties};
