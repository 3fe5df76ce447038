//! From files to files.

use std::path::{Path, PathBuf};
use std::time::Instant;

use proxel::deform::{Hooks, Progress};
use proxel::report::{TraceRow, peak_bytes};
use proxel::shape::{Change, ShapeError, ShapeInput, Shaped, draw_shaped};
use proxel::split::Status;
use proxel_mesh::{Fields, Mesh, not_carried, write_mesh};

use crate::args::SolveArgs;
use crate::files::{Outputs, write_report, write_trace};
use crate::interrupt::{Interrupt, exit_status};
use crate::progress::Bar;
use crate::refusal::Refusal;

/// What shapes an input.
type Solve<'a> = &'a mut dyn FnMut(&ShapeInput, &mut Hooks<'_>) -> Result<Shaped, ShapeError>;

/// Reads, solves, writes.
pub fn run(
    args: &SolveArgs,
    read: &mut dyn FnMut() -> Result<ShapeInput, Refusal>,
    solve: Solve<'_>,
) -> Result<u8, Refusal> {
    let common = &args.run;
    let Some(out) = &args.out else {
        return Err(Refusal::new("--out is needed; see --help"));
    };
    Outputs::default()
        .mesh("--out", out)?
        .file("--report", common.report.as_deref(), &[])?
        .file("--trace", common.trace.as_deref(), &[])?
        .file("--preview", common.preview.as_deref(), &["png"])?
        .check()?;
    let interrupt = Interrupt::listen()?;
    let began = Instant::now();
    let input = read()?;
    let read = began.elapsed().as_secs_f64();
    if let Some(n) = common.threads {
        // For what follows the solve. A pool that is there already is no harm.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(n).build_global();
    }
    let bar = Bar::new(common.quiet, args.max_iters);
    let mut rows: Vec<TraceRow> = Vec::new();
    let mut on_progress = |p: &Progress| bar.show(p);
    let mut on_row = |row: &TraceRow| rows.push(*row);
    let mut hooks = Hooks { cancel: interrupt.solving(), ..Hooks::default() };
    if bar.is_shown() {
        hooks.progress = Some(&mut on_progress);
    }
    if common.trace.is_some() {
        hooks.trace = Some(&mut on_row);
    }
    let solved = solve(&input, &mut hooks);
    bar.clear();
    let mut result = solved?;
    interrupt.writing();
    let began = Instant::now();
    let mut written = Vec::new();
    let mesh = input.mesh.with_points(result.positions.clone())?;
    let fields = fields(&result);
    // Of a failed run nothing is worth keeping but what it says.
    let failed = result.status == Status::Failed;
    if !failed {
        write_mesh(out, &mesh, &fields)?;
        written.push(out.clone());
    }
    if let Some(path) = common.preview.as_ref().filter(|_| !failed) {
        draw_shaped(&input.mesh, &mesh, &result.faces).write_png(path)?;
        written.push(path.clone());
    }
    if let Some(path) = &common.trace {
        write_trace(path, &rows)?;
        written.push(path.clone());
    }
    result.report.seconds.read = read;
    result.report.seconds.write = began.elapsed().as_secs_f64();
    result.report.peak_bytes = peak_bytes();
    if let Some(path) = &common.report {
        write_report(path, &result.report)?;
        written.push(path.clone());
    }
    if !common.quiet {
        say(&input.mesh, out, &result, &written)?;
    }
    Ok(exit_status(result.status.as_str(), &result.report.reason))
}

/// The errors of each face, and the distance of each vertex from the reference.
fn fields(result: &Shaped) -> Fields {
    let mut fields = Fields::none();
    for errors in &result.faces {
        fields.cell(&errors.name, 1, errors.after.clone());
    }
    fields.point("reference_distance", 1, result.distance.clone());
    fields
}

fn say(input: &Mesh, out: &Path, result: &Shaped, written: &[PathBuf]) -> Result<(), Refusal> {
    let r = &result.report;
    for warning in &r.warnings {
        eprintln!("warning: {warning}");
    }
    let lost = not_carried(out, input, &Fields::none())?;
    if !lost.is_empty() {
        eprintln!("warning: {} does not carry {}", out.display(), lost.join(" and "));
    }
    say!("{} after {} iterations, {:.2} s: {}", r.status, r.iterations, r.seconds.setup + r.seconds.solve, r.reason);
    if let Some(shape) = &r.shape {
        let change = |(name, change): (&str, Option<Change>)| {
            change.map(|c| format!("{name} {:.3e} -> {:.3e}", c.before, c.after))
        };
        let told = [
            ("planarity max", shape.planarity_max),
            ("mean", shape.planarity_mean),
            ("edge error max", shape.edge_error_max),
            ("mean", shape.edge_error_mean),
            ("angle error max (degrees)", shape.angle_error_max),
            ("mean distance from the reference", shape.reference_distance_mean),
        ];
        say!("{}", told.into_iter().filter_map(change).collect::<Vec<_>>().join(", "));
        for c in &shape.constraints {
            let (hard, max) = (if c.hard { "hard" } else { "soft" }, c.violation_max);
            say!("{} ({hard}, {} elements): violation max {:.3e} -> {:.3e}", c.name, c.elements, max.before, max.after);
        }
        for v in shape.violated.iter().take(3) {
            eprintln!(
                "warning: {} {} (0-based), vertices {:?}, is off by {:.1e}",
                v.kind, v.index, v.vertices, v.violation
            );
        }
    }
    written.iter().for_each(|path| say!("wrote {}", path.display()));
    Ok(())
}
