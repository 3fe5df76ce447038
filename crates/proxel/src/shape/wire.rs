//! Wire meshes: edges of one length, and angles within a range.

use super::measure::{self, ShapeReport, changes};
use super::problem::{Demand, Posed, Shape, Unit};
use super::solve::{Solved, in_threads, report, sizes, solve};
use super::{FaceErrors, ShapeError, ShapeInput, ShapeMethod, ShapeSettings, Shaped};
use crate::deform::Hooks;
use proxel_mesh::topology::{face_edges, polygon_edges};
use proxel_model::constraint::{AngleRange, Cells, EdgeDifference, Length, TipDifferences, V3};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// How a wire mesh is made: those of every shape, and what its wires are to be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WireSettings {
    /// The length of all edges, in units of the mesh; the mean length of its edges without it.
    pub edge_length: Option<f64>,
    /// The least angle between two edges of a face that follow each other, in degrees.
    pub min_angle: f64,
    /// The largest, likewise.
    pub max_angle: f64,
    /// How often faces are subdivided into quads first.
    pub subdivide: usize,
    /// Method and weights.
    #[serde(flatten)]
    pub shape: ShapeSettings,
}

impl Default for WireSettings {
    /// Those of Garg et al. 2014 and Zhang et al. 2019.
    fn default() -> Self {
        WireSettings {
            edge_length: None,
            min_angle: 45.0,
            max_angle: 135.0,
            subdivide: 0,
            shape: ShapeSettings { mu: 1000.0, fairing: 0.0, ..ShapeSettings::planarize() },
        }
    }
}

impl WireSettings {
    /// The defaults for a method: penalties of the implementations of Ouyang et al. 2020 and Peng et al. 2018; for ADMM,
    /// plain and accelerated, three times that of Zhang et al. 2019, which after as many iterations leaves less error of
    /// edges and angles for 3 % more distance from the reference (`docs/wire.md`).
    pub fn by(method: ShapeMethod) -> Self {
        let base = Self::default();
        let mu = match method {
            ShapeMethod::Admm | ShapeMethod::AaAdmm => 3.0 * base.shape.mu,
            ShapeMethod::Aadr => 1e4,
            ShapeMethod::Shapeup => 100.0,
            _ => base.shape.mu,
        };
        WireSettings { shape: ShapeSettings { method, mu, ..base.shape }, ..base }
    }

    /// Checks numbers that would make no sense.
    ///
    /// # Errors
    /// Names the option, its value and what to give.
    pub fn check(&self) -> Result<(), String> {
        if let Some(l) = self.edge_length.filter(|l| !(*l > 0.0 && l.is_finite())) {
            return Err(format!("--edge-length is {l}; give a positive length"));
        }
        let (low, high) = (self.min_angle, self.max_angle);
        if !(0.0..=180.0).contains(&low) || !(0.0..=180.0).contains(&high) || low > high {
            return Err(format!(
                "--min-angle is {low} and --max-angle {high}; give degrees from 0 to 180, the least first"
            ));
        }
        if self.subdivide > 8 {
            return Err(format!("--subdivide is {}; give at most 8, each makes four times the faces", self.subdivide));
        }
        self.shape.check()
    }
}

/// Moves vertices until all edges have one length and angles are within their range: least closeness to the reference
/// under these hard constraints, A(29). The mesh is shaped as it comes; [`subdivide`](super::subdivide) it before.
///
/// # Errors
/// Input that describes no problem. A run that does not converge is no error: see [`Shaped::status`].
pub fn wire(input: &ShapeInput, settings: &WireSettings, hooks: &mut Hooks<'_>) -> Result<Shaped, ShapeError> {
    let began = Instant::now();
    settings.check().map_err(ShapeError)?;
    in_threads(settings.shape.threads, |threads| {
        let shape = Shape::new(input)?;
        let solved = solve(&shape, posed(&shape, settings)?, &[], &input.mesh, &settings.shape, hooks, began)?;
        let of = |kind: &str, points: &[V3]| {
            let groups = solved.groups.iter().filter(|g| g.kind == kind);
            groups.flat_map(|g| sizes(g, &shape, points)).collect::<Vec<f64>>()
        };
        let [edges, edges_before] = [&solved.after, &shape.start].map(|points| of("edge", points));
        let [angles, angles_before] = [&solved.after, &shape.start].map(|points| of("angle", points));
        let [edge_max, edge_mean] = changes(&edges_before, &edges);
        let [angle_max, angle_mean] = changes(&angles_before, &angles);
        let told = ShapeReport {
            edge_error_max: Some(edge_max),
            edge_error_mean: Some(edge_mean),
            angle_error_max: Some(angle_max),
            angle_error_mean: Some(angle_mean),
            ..measure::common(&shape, &solved)
        };
        let faces = vec![
            FaceErrors {
                name: "edge_error".to_string(),
                before: edges_of_faces(&shape, &edges_before),
                after: edges_of_faces(&shape, &edges),
            },
            FaceErrors {
                name: "angle_error".to_string(),
                before: angles_of_faces(&shape, &angles_before),
                after: angles_of_faces(&shape, &angles),
            },
        ];
        let Solved { positions, distance, ended, .. } = solved;
        let settings = serde_json::to_value(settings).unwrap_or_default();
        let report = report("wire", settings, &ended, &shape, told, threads);
        Ok(Shaped { positions, status: ended.status, report, faces, distance })
    })
}

/// A, section 4.2.
fn posed(shape: &Shape, settings: &WireSettings) -> Result<Posed, ShapeError> {
    let mut posed = shape.posed(&settings.shape)?;
    let mu = settings.shape.mu;
    let length = settings.edge_length.map_or(shape.mean_edge, |l| shape.own_length(l));
    let edges = face_edges(&shape.faces).into_flattened();
    let demand = Demand::hard(mu, "edge", Unit::Plain);
    posed.constrain(Cells::<EdgeDifference, _>::new(edges, 2, Length::equal(length))?, demand);
    let tips = shape.faces.iter().flat_map(|face| {
        let k = face.len();
        (0..k).flat_map(move |i| [face[i], face[(i + 1) % k], face[(i + k - 1) % k]])
    });
    let range = AngleRange::new(settings.min_angle.to_radians(), settings.max_angle.to_radians());
    let demand = Demand::hard(mu, "angle", Unit::Angle);
    posed.constrain(Cells::<TipDifferences, _>::new(tips.collect(), 3, range)?, demand);
    Ok(posed)
}

/// The largest error of the edges of each face.
fn edges_of_faces(shape: &Shape, errors: &[f64]) -> Vec<f64> {
    let edges = face_edges(&shape.faces);
    let of = |[a, b]: [u32; 2]| {
        let at = edges.binary_search(&[a.min(b), a.max(b)]);
        at.ok().and_then(|e| errors.get(e)).copied().unwrap_or(0.0)
    };
    shape.faces.iter().map(|face| polygon_edges(face).map(of).fold(0.0, f64::max)).collect()
}

/// The largest error of the angles of each face, which stand in the order of its corners.
fn angles_of_faces(shape: &Shape, errors: &[f64]) -> Vec<f64> {
    let mut rest = errors;
    let mut take = |k: usize| {
        let (own, others) = rest.split_at(k.min(rest.len()));
        rest = others;
        own.iter().copied().fold(0.0, f64::max)
    };
    shape.faces.iter().map(|face| take(face.len())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_flat_and_come_back() {
        let settings = WireSettings { edge_length: Some(0.5), ..WireSettings::default() };
        let value = serde_json::to_value(&settings).expect("plain data");
        assert!(value["edge_length"] == 0.5 && value["method"] == "auto" && value["mu"] == 1000.0, "{value}");
        assert_eq!(serde_json::from_value::<WireSettings>(value).ok(), Some(settings.clone()));
        let bad = |change: &dyn Fn(&mut WireSettings)| {
            let mut settings = settings.clone();
            change(&mut settings);
            settings.check().expect_err("refused")
        };
        assert!(bad(&|s| s.edge_length = Some(-1.0)).contains("--edge-length is -1"));
        assert!(bad(&|s| s.min_angle = 140.0).contains("--min-angle is 140"));
        assert!(bad(&|s| s.max_angle = f64::NAN).contains("--max-angle NaN"));
        assert!(bad(&|s| s.shape.mu = 0.0).contains("--mu"));
    }
}
