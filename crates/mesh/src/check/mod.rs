//! What is wrong with a mesh: exact orientation, shape quality, and a full diagnosis.

mod orientation;
mod quality;
mod report;
mod surface;

pub(crate) use orientation::corners;
pub use orientation::{
    SLIVER_MEAN_RATIO, TetCheck, TriangleCheck, check_tets, check_triangles, fix_orientation, mean_ratio,
    require_areas, require_volumes, volume,
};
pub use quality::{Spread, TetQuality, dihedral_angles, tet_quality, triangle_angles};
pub use report::{Problem, Report, Severity, diagnose, require_solvable};
pub use surface::{SurfaceTopology, surface_topology};
