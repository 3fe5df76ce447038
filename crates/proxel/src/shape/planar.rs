//! Planar faces.

use super::measure::{self, Change, ShapeReport, changes, diagonals, planarity};
use super::problem::{Demand, Posed, Shape, Unit};
use super::solve::{Solved, in_threads, report, solve};
use super::{FaceErrors, ShapeError, ShapeInput, ShapeMethod, ShapeSettings, Shaped};
use crate::deform::Hooks;
use proxel_mesh::topology::face_edges;
use proxel_model::constraint::{Cells, EdgeDifference, Length, MeanCentred, Planar};
use std::collections::BTreeMap;
use std::time::Instant;

/// The part of the shortest edge of the input that no edge of a result of `auto` is below: half, and what rounding
/// takes.
const SHORTEST: f64 = 0.501;

/// Moves vertices until every face is planar: least closeness to the reference and fairing under hard planarity, A(29).
/// What is returned holds for the positions as returned.
///
/// # Errors
/// Input that describes no problem. A run that does not converge is no error: see [`Shaped::status`].
pub fn planarize(input: &ShapeInput, settings: &ShapeSettings, hooks: &mut Hooks<'_>) -> Result<Shaped, ShapeError> {
    let began = Instant::now();
    settings.check().map_err(ShapeError)?;
    in_threads(settings.threads, |threads| {
        let shape = Shape::new(input)?;
        let solved = solve(&shape, posed(&shape, settings)?, &[], &input.mesh, settings, hooks, began)?;
        let faces = &shape.faces;
        let off =
            |points: &[[f64; 3]]| planarity(points, faces).into_iter().map(|h| h / shape.mean_edge).collect::<Vec<_>>();
        let (violation, before) = (off(&solved.after), off(&shape.start));
        let [max, mean] = changes(&before, &violation);
        let [diagonals_max, _] = changes(&diagonals(&shape.start, faces), &diagonals(&solved.after, faces));
        let unit = shape.mean_edge_of_user();
        let absolute = |c: Change| Change { before: c.before * unit, after: c.after * unit };
        let told = ShapeReport {
            planarity_max: Some(max),
            planarity_mean: Some(mean),
            planarity_max_absolute: Some(absolute(max)),
            planarity_mean_absolute: Some(absolute(mean)),
            planarity_diagonals_max: Some(diagonals_max),
            ..measure::common(&shape, &solved)
        };
        let Solved { positions, distance, ended, .. } = solved;
        let settings = serde_json::to_value(settings).unwrap_or_default();
        let report = report("planarize", settings, &ended, &shape, told, threads);
        let faces = vec![FaceErrors { name: "planarity".to_string(), before, after: violation }];
        Ok(Shaped { positions, status: ended.status, report, faces, distance })
    })
}

/// A, section 4.2.
fn posed(shape: &Shape, settings: &ShapeSettings) -> Result<Posed, ShapeError> {
    let mut posed = shape.posed(settings)?;
    let mut by_corners: BTreeMap<usize, (Vec<u32>, Vec<u32>)> = BTreeMap::new();
    for (f, face) in shape.faces.iter().enumerate().filter(|(_, face)| face.len() > 3) {
        let (nodes, ids) = by_corners.entry(face.len()).or_default();
        nodes.extend_from_slice(face);
        ids.push(f as u32);
    }
    for (corners, (nodes, ids)) in by_corners {
        let demand = Demand::hard(settings.mu, "face", Unit::Length).numbered(ids);
        posed.constrain(Cells::<MeanCentred, _>::new(nodes, corners, Planar)?, demand);
    }
    if settings.method == ShapeMethod::Auto && !posed.constraints.is_empty() {
        // The objective of the paper knows no shape of faces, and its minimum may have edges of next to no length.
        let least = SHORTEST * shape.shortest;
        if least > 0.0 {
            let edges = face_edges(&shape.faces).into_flattened();
            let lengths = Length::within(least, f64::INFINITY);
            let demand = Demand::hard(settings.mu, "edge", Unit::Plain);
            posed.constrain(Cells::<EdgeDifference, _>::new(edges, 2, lengths)?, demand);
        }
    }
    Ok(posed)
}
