//! The report: what a run did, for programs. Keys are the same for every command; null where one does not apply.

use crate::shape::ShapeReport;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Wall time of the parts of a run, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Seconds {
    /// Reading files.
    pub read: f64,
    /// Checks, orders, the first factor.
    pub setup: f64,
    /// Iterating.
    pub solve: f64,
    /// Writing files.
    pub write: f64,
}

/// The report of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Version of Proxel.
    pub version: String,
    /// The command.
    pub command: String,
    /// All settings, with defaults filled in.
    pub settings: serde_json::Value,
    /// The method.
    pub method: String,
    /// converged, stopped, failed or cancelled.
    pub status: String,
    /// Why it ended.
    pub reason: String,
    /// Iterations done.
    pub iterations: usize,
    /// Their inner steps.
    pub inner_iterations: usize,
    /// Factorisations after the first.
    pub refactorisations: usize,
    /// Objective of the result.
    pub energy: Option<f64>,
    /// Norm of its gradient over free vertices.
    pub gradient_norm: Option<f64>,
    /// The same over min(|g(X0)|, characteristic gradient).
    pub gradient_ratio: Option<f64>,
    /// Elements of the result with a measure of zero or below.
    pub inverted: Option<u64>,
    /// Least signed stretch.
    pub min_stretch: Option<f64>,
    /// Largest stretch.
    pub max_stretch: Option<f64>,
    /// |X - X*| / |X0 - X*| over free vertices, where a reference was given.
    pub position_error: Option<f64>,
    /// |W(c(Dx) - z)| / |W z| at the last iterate.
    pub primal_residual: Option<f64>,
    /// |W(z - z_before)| / |W z| likewise.
    pub dual_residual: Option<f64>,
    /// Iterations taken.
    pub accepted: usize,
    /// Iterations refused.
    pub rejected: usize,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// What was repaired in the input.
    pub repaired: Vec<String>,
    /// Wall time.
    pub seconds: Seconds,
    /// Largest resident memory of the process.
    pub peak_bytes: Option<u64>,
    /// Memory of the factor.
    pub factor_bytes: Option<u64>,
    /// Threads used.
    pub threads: usize,
    /// The sum of the reaction forces of each group of pins and of each obstacle (`obstacle 0`, ..): what the body exerts on
    /// it.
    #[serde(default)]
    pub reactions: BTreeMap<String, [f64; 3]>,
    /// The lattice, where a surface was carried by one.
    pub lattice: Option<LatticeReport>,
    /// What is known of a map; its keys stand beside the others.
    #[serde(flatten)]
    pub map: Option<MapReport>,
    /// What is known of a mesh under geometric constraints; its keys stand beside the others.
    #[serde(flatten)]
    pub shape: Option<ShapeReport>,
    /// What is known of distances, likewise.
    #[serde(flatten)]
    pub geodesic: Option<GeodesicReport>,
    /// What is known of a restored image, likewise.
    #[serde(flatten)]
    pub restore: Option<RestoreReport>,
    /// What is known of a wavefront, likewise.
    #[serde(flatten)]
    pub wavefront: Option<WavefrontReport>,
}

/// What `deblur`, `denoise` and `inpaint` add to a report.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RestoreReport {
    /// What was taken to lie beyond the border: periodic, neumann or unknown.
    pub boundary: String,
    /// How what was seen was compared: quadratic, poisson or huber.
    pub data: String,
    /// What huber took for a small difference; null for others.
    pub threshold: Option<f64>,
    /// The result has so many times the rows and columns of what was seen.
    pub scale: usize,
    /// What was asked of the image: tv, tgv or frame.
    pub regulariser: String,
    /// What was minimised.
    pub objective: String,
    /// lambda_1 of A(31), as given or chosen.
    pub lambda: f64,
    /// How many were compared by their estimated risk; 0 where it was given.
    pub lambdas_tried: usize,
    /// Standard deviation of the noise (under poisson that of a pixel of value 1), as given or estimated; null where neither
    /// was asked for.
    pub noise: Option<f64>,
    /// Penalty of the splitting.
    pub penalty: f64,
    /// Columns and rows of the field that was solved for; the most of a part where there were parts.
    pub field: [usize; 2],
    /// Parts that the image was cut to; 0 where it was solved for as a whole. `relative_gap` is then the largest of a part with
    /// its `gap_range`, residuals are the largest, iterations those of all, and there is no objective of the whole.
    pub tiles: usize,
    /// How much lower the objective can be at most, over images with values in `gap_range`; null where there is no bound.
    pub duality_gap: Option<f64>,
    /// The same over the objective.
    pub relative_gap: Option<f64>,
    /// See `duality_gap`.
    pub gap_range: Option<[f64; 2]>,
    /// Of the result against the truth, in dB; null where there is none.
    pub psnr: Option<f64>,
    /// Of the input, likewise.
    pub psnr_input: Option<f64>,
}

/// What `wavefront` adds to a report.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WavefrontReport {
    /// Levels of the pyramid.
    pub levels: usize,
    /// Linearised problems that were solved, one a warp.
    pub problems: usize,
    /// Least value of phi.
    pub phi_min: f64,
    /// Largest value of phi.
    pub phi_max: f64,
    /// Root mean square of phi, whose mean is 0.
    pub phi_rms: f64,
    /// Largest |grad phi| between pixels: shift of the image, in pixels.
    pub shift_max: f64,
    /// Coefficients in Noll's order from number 1, where they were asked for.
    pub zernike: Vec<f64>,
}

/// What `geodesic` adds to a report.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GeodesicReport {
    /// The vertices that distances are measured from.
    pub sources: Vec<u32>,
    /// The largest distance that is finite, in the units of the mesh.
    pub distance_max: f64,
    /// ||grad d| - 1|, weighted by area, over what is reached: 0 for a distance on a plane, where no paths meet.
    pub gradient_deviation: f64,
    /// Vertices to which no path leads.
    pub unreached_vertices: usize,
    /// For how long heat flowed, in squared mean lengths of edges.
    pub heat_time: f64,
}

/// What `unwrap` adds to a report. Flips, overlaps and distortion are those of the file as written and read back.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapReport {
    /// Triangles that are turned over in the map, by exact arithmetic.
    pub flips: usize,
    /// Triangles with an area on the surface and none in the map.
    pub zero_area: usize,
    /// Pairs of triangles whose interiors meet.
    pub overlaps: u64,
    /// Pairs of edges of the borders of charts that cross.
    pub boundary_crossings: u64,
    /// Charts.
    pub charts: usize,
    /// Cuts that were made to keep the bound on stretch.
    pub stretch_cuts: usize,
    /// Length on the surface of the edges along which the map is cut, over the diagonal of the bounding box.
    pub seam_length: f64,
    /// Part of the page that is covered: the unit square, or the square around a map that is not packed.
    pub packing: f64,
    /// Texels per unit of length on the surface, where packed.
    pub density: Option<f64>,
    /// The energy of the local variable at the end.
    pub energy_z: Option<f64>,
    /// The energy against the target metrics, where some were given.
    pub energy_target: Option<f64>,
    /// Faces that are listed against the orientation of their chart.
    pub reversed_faces: usize,
    /// Faces that are not in the map.
    pub unmapped_faces: usize,
    /// sqrt of the area-weighted mean of (s_1^2 + s_2^2) / 2, at the scale of least energy.
    pub l2_stretch: f64,
    /// Largest max(s_1, 1 / s_2) likewise.
    pub linf_stretch: f64,
    /// s_1 / s_2: area-weighted mean.
    pub conformal_distortion: f64,
    /// s_1 / s_2: largest.
    pub conformal_distortion_max: f64,
    /// max(s_1 s_2, 1 / (s_1 s_2)): area-weighted mean.
    pub area_distortion: f64,
    /// max(s_1 s_2, 1 / (s_1 s_2)): largest.
    pub area_distortion_max: f64,
}

/// The lattice of tetrahedra that carried a surface.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LatticeReport {
    /// Cells along the longest side of the surface's bounding box.
    pub resolution: usize,
    /// The length of a cell's side.
    pub cell: f64,
    /// Its nodes.
    pub nodes: usize,
    /// Its tetrahedra, six a cell.
    pub tetrahedra: usize,
    /// The mean winding number at the surface: 0.5 where it is closed, 0 for an open plane.
    pub closedness: f64,
    /// Cells that join what the surface parts.
    pub joined_cells: usize,
    /// The largest distance of a pinned vertex from where it is to be, over the diagonal of the bounding box.
    pub pin_error: f64,
}

/// One row of the trace: the state after `iteration` iterations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TraceRow {
    /// 0 is the start.
    pub iteration: usize,
    /// Wall time since the end of reading, without what only the trace needs.
    pub seconds: f64,
    /// Objective.
    pub energy: f64,
    /// Norm of its gradient over free vertices.
    pub gradient_norm: f64,
    /// |X - X*| / |X0 - X*| over free vertices.
    pub position_error: f64,
    /// |W(c(Dx) - z)| / |W z|
    pub primal_residual: f64,
    /// |W(z - z_before)| / |W z|
    pub dual_residual: f64,
    /// What an accelerator looks at.
    pub merit: f64,
    /// Inner steps of this iteration.
    pub inner: usize,
    /// Whether the system was factored anew after it.
    pub refactorised: bool,
    /// Whether its proposal was taken; an accelerated method has gone on from the last image where it was not.
    pub accepted: bool,
    /// Elements with a measure of zero or below.
    pub inverted: u64,
}

impl TraceRow {
    /// The header of the CSV file.
    pub const HEADER: &'static str = "iteration,seconds,energy,gradient_norm,position_error,primal_residual,dual_residual,\
                                      merit,inner,refactorised,accepted,inverted";

    /// A number that always parses: `inf` where it is not finite.
    pub(crate) fn number(v: f64) -> String {
        if v.is_finite() { format!("{v:e}") } else { "inf".to_string() }
    }

    /// The row as CSV; numbers always parse, `inf` where undefined.
    pub fn to_csv(&self) -> String {
        let number = Self::number;
        [
            self.iteration.to_string(),
            number(self.seconds),
            number(self.energy),
            number(self.gradient_norm),
            number(self.position_error),
            number(self.primal_residual),
            number(self.dual_residual),
            number(self.merit),
            self.inner.to_string(),
            u8::from(self.refactorised).to_string(),
            u8::from(self.accepted).to_string(),
            self.inverted.to_string(),
        ]
        .join(",")
    }
}

/// The largest resident memory of this process so far, where the system tells.
pub fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024 * kib)
}
