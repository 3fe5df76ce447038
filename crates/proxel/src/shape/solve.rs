//! What all commands that shape a mesh do around their problem.

use super::measure::{self, ShapeReport, Violated};
use super::problem::{Group, Posed, Shape, Unit};
use super::run::{self, Ended};
use super::{ShapeError, ShapeSettings};
use crate::deform::Hooks;
use crate::report::{Report, Seconds};
use crate::threads;
use proxel_mesh::Mesh;
use proxel_model::constraint::V3;
use proxel_split::Status;
use std::time::Instant;

/// What a report calls violated.
const TOLD: f64 = 1e-9;

/// A problem that is solved, in users' coordinates and in its own.
pub(super) struct Solved {
    pub positions: Vec<V3>,
    pub after: Vec<V3>,     // positions as they are written, in own coordinates
    pub distance: Vec<f64>, // of each vertex from the reference, in units of the mesh
    pub groups: Vec<Group>,
    pub violated: Vec<Violated>,
    pub ended: Ended,
}

/// Runs `work` in a pool of so many threads, or of as many as there are processors; it is told how many.
pub(super) fn in_threads<T: Send>(
    threads: Option<usize>,
    work: impl FnOnce(usize) -> Result<T, ShapeError> + Send,
) -> Result<T, ShapeError> {
    let (pool, threads) = threads::pool(threads).map_err(ShapeError)?;
    pool.install(|| work(threads))
}

/// Solves, and looks at what has come of it. Vertices in `fixed` are left where they are to the bit.
pub(super) fn solve(
    shape: &Shape,
    posed: Posed,
    fixed: &[u32],
    input: &Mesh,
    settings: &ShapeSettings,
    hooks: &mut Hooks<'_>,
    began: Instant,
) -> Result<Solved, ShapeError> {
    let groups = posed.groups.clone();
    let ended = run::run(shape, posed, settings, hooks, began)?;
    let mut positions = shape.positions(&ended.x, input);
    if ended.status == Status::Converged {
        fixed.iter().for_each(|v| positions[*v as usize] = input.points[*v as usize]);
    }
    let after = shape.own(&positions);
    let violated = measure::worst(groups.iter().filter(|g| g.hard).flat_map(|g| violations(g, shape, &after)));
    let unit = shape.mean_edge_of_user() / shape.mean_edge;
    let mut each = shape.distances(&after).into_iter().map(|d| d * unit);
    let distance = shape.used.iter().map(|used| if *used { each.next().unwrap_or(0.0) } else { 0.0 }).collect();
    Ok(Solved { positions, after, distance, groups, violated, ended })
}

/// By how much each element of a group is violated, in the unit in which it is told.
pub(super) fn sizes(group: &Group, shape: &Shape, points: &[V3]) -> Vec<f64> {
    let per = match group.unit {
        Unit::Length => 1.0 / shape.mean_edge,
        Unit::Plain => 1.0,
        Unit::Angle => 1f64.to_degrees(),
    };
    let mut sizes = group.cells.violations(points);
    sizes.iter_mut().for_each(|v| *v *= per);
    sizes
}

/// The elements of a group with their violations.
fn violations<'a>(group: &'a Group, shape: &Shape, points: &[V3]) -> impl Iterator<Item = Violated> + use<'a> {
    let index = |e: usize| group.ids.as_ref().and_then(|ids| ids.get(e)).map_or(e, |id| *id as usize);
    // Values that are no numbers are violations too.
    let bad = |(_, v): &(usize, f64)| !matches!(v.partial_cmp(&TOLD), Some(o) if o.is_le());
    sizes(group, shape, points).into_iter().enumerate().filter(bad).map(move |(e, violation)| Violated {
        kind: group.kind.clone(),
        index: index(e),
        vertices: group.cells.nodes(e).to_vec(),
        violation,
    })
}

/// The report of a command.
pub(super) fn report(
    command: &str,
    settings: serde_json::Value,
    run: &Ended,
    shape: &Shape,
    told: ShapeReport,
    threads: usize,
) -> Report {
    Report {
        version: env!("CARGO_PKG_VERSION").to_string(),
        command: command.to_string(),
        method: settings["method"].as_str().unwrap_or_default().to_string(),
        settings,
        status: run.status.as_str().to_string(),
        reason: run.reason.clone(),
        iterations: run.iterations,
        inner_iterations: run.inner,
        refactorisations: run.refactorisations,
        energy: Some(run.energy).filter(|e| e.is_finite()),
        primal_residual: Some(run.residuals.primal).filter(|r| r.is_finite()),
        dual_residual: Some(run.residuals.dual).filter(|r| r.is_finite()),
        accepted: run.accepted,
        rejected: run.rejected,
        warnings: shape.warnings.clone(),
        seconds: Seconds { read: 0.0, setup: run.setup, solve: run.solve, write: 0.0 },
        factor_bytes: Some(run.factor_bytes),
        threads,
        shape: Some(told),
        ..Report::default()
    }
}
