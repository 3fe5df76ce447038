//! What is known of a frame.

use crate::report::TraceRow;
use proxel_mesh::{Fields, Mesh};
use serde::{Deserialize, Deserializer, Serialize};

/// A frame as numbers: a row of frames.csv, and more for the report.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// 0 is the start.
    pub frame: usize,
    /// s
    pub time: f64,
    /// J
    #[serde(deserialize_with = "finite_or_infinite")]
    pub kinetic: f64,
    /// Energy of elements and of bending, J.
    #[serde(deserialize_with = "finite_or_infinite")]
    pub elastic: f64,
    /// -sum m g . x, J.
    #[serde(deserialize_with = "finite_or_infinite")]
    pub potential: f64,
    /// sum m v, kg m/s.
    pub momentum: [f64; 3],
    /// sum m x cross v around the origin, kg m^2/s.
    pub angular_momentum: [f64; 3],
    /// Steps that the frame took.
    pub steps: usize,
    /// Iterations of all its steps.
    pub iterations: usize,
    /// Those that were refused.
    pub rejected: usize,
    /// The forward residual of the last step, normalised by A(27): the root of A(22), or A(24) in the z-x-u order, over
    /// sqrt(N_z) times the mean edge at rest, the penalty mu being in the weights. None where nothing was split.
    pub forward: Option<f64>,
    /// The combined residual A(11), or A(12), likewise.
    pub combined: Option<f64>,
    /// How far stretches are beyond hard limits, at most.
    #[serde(deserialize_with = "finite_or_infinite")]
    pub max_strain_violation: f64,
    /// How deep a vertex is in an obstacle, at most, m.
    #[serde(deserialize_with = "finite_or_infinite")]
    pub max_penetration: f64,
    /// Elements with a measure of zero or below.
    pub inverted: u64,
    /// Norm of the gradient of the last step's objective over free vertices, forces of contact included; none for sets that
    /// are split off.
    pub gradient: Option<f64>,
    /// The same over vertices that touch nothing.
    pub gradient_off_contact: Option<f64>,
    /// What the gradient had to be below.
    #[serde(deserialize_with = "finite_or_infinite")]
    pub gradient_bound: f64,
    /// Vertices that press on an obstacle.
    pub contacts: usize,
    /// start, converged, stopped, failed or cancelled: the worst of its steps.
    pub status: String,
    /// Why.
    pub reason: String,
    /// Wall time.
    pub seconds: f64,
}

/// JSON has no infinity: a number that was none is null there.
fn finite_or_infinite<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(d)?.unwrap_or(f64::INFINITY))
}

impl FrameRecord {
    /// The header of frames.csv.
    pub const HEADER: &'static str = "frame,time,kinetic,elastic,potential,px,py,pz,lx,ly,lz,iterations,rejected,forward,\
                                      combined,max_strain_violation,max_penetration,status,seconds";

    /// The row of frames.csv; numbers always parse, `inf` where undefined.
    pub fn to_csv(&self) -> String {
        let number = TraceRow::number;
        let [px, py, pz] = self.momentum.map(number);
        let [lx, ly, lz] = self.angular_momentum.map(number);
        [
            self.frame.to_string(),
            number(self.time),
            number(self.kinetic),
            number(self.elastic),
            number(self.potential),
            px,
            py,
            pz,
            lx,
            ly,
            lz,
            self.iterations.to_string(),
            self.rejected.to_string(),
            number(self.forward.unwrap_or(f64::INFINITY)),
            number(self.combined.unwrap_or(f64::INFINITY)),
            number(self.max_strain_violation),
            number(self.max_penetration),
            self.status.clone(),
            number(self.seconds),
        ]
        .join(",")
    }

    /// Kinetic, elastic and potential energy together.
    pub fn energy(&self) -> f64 {
        self.kinetic + self.elastic + self.potential
    }
}

/// A frame: numbers, and each body as a mesh with its fields.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Numbers.
    pub record: FrameRecord,
    /// The name of each body, its mesh as it is, and displacement, velocity, stress, contact and reaction forces.
    pub bodies: Vec<(String, Mesh, Fields)>,
}
