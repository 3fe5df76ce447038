//! From files to files.

use std::path::{Path, PathBuf};
use std::time::Instant;

use proxel::deform::{Hooks, Progress};
use proxel::preview::{Camera, Image, Model, Scene, Style, render};
use proxel::report::TraceRow;
use proxel::shape::{ShapeInput, Shaped, planarity, planarize};
use proxel::split::Status;
use proxel_mesh::{Fields, Mesh, not_carried, read_mesh_lenient, write_mesh};

use super::PlanarizeArgs;
use crate::args::show_settings;
use crate::files::{Outputs, peak_bytes, write_report, write_trace};
use crate::interrupt::{Interrupt, exit_status};
use crate::progress::Bar;
use crate::refusal::Refusal;

/// Reads, solves, writes.
pub fn run(args: &PlanarizeArgs) -> Result<u8, Refusal> {
    let settings = args.settings()?;
    let common = &args.solve.run;
    if common.show_settings {
        return show_settings(&settings);
    }
    // Clap asks for both unless settings are shown.
    let (Some(path), Some(out)) = (&args.mesh, &args.solve.out) else {
        return Err(Refusal::new("MESH and --out are needed; see proxel planarize --help"));
    };
    Outputs::default()
        .mesh("--out", out)?
        .file("--report", common.report.as_deref(), &[])?
        .file("--trace", common.trace.as_deref(), &[])?
        .file("--preview", common.preview.as_deref(), &["png"])?
        .check()?;
    let interrupt = Interrupt::listen()?;
    let began = Instant::now();
    // What a file has that is no mesh to solve on is refused with the face it is about.
    let mesh = read_mesh_lenient(path)?;
    let reference = args.reference.as_deref().map(read_mesh_lenient).transpose()?;
    let input = ShapeInput { mesh, reference };
    let read = began.elapsed().as_secs_f64();
    if let Some(n) = settings.threads {
        // For what follows the solve. A pool that is there already is no harm.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(n).build_global();
    }
    let bar = Bar::new(common.quiet, settings.max_iters);
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
    let solved = planarize(&input, &settings, &mut hooks);
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
        picture(&input.mesh, &mesh).write_png(path)?;
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

/// The planarity of each face, over the mean edge, and the distance of each vertex from the reference.
fn fields(result: &Shaped) -> Fields {
    let mut fields = Fields::none();
    fields.cell("planarity", 1, result.violation.clone());
    fields.point("reference_distance", 1, result.distance.clone());
    fields
}

/// Size of a panel.
const PANEL: [usize; 2] = [720, 640];

/// Before and after, coloured by the square root of the planarity of the faces around each vertex, on one scale.
fn picture(before: &Mesh, after: &Mesh) -> Image {
    let of = |mesh: &Mesh| {
        let mut worst = vec![0.0_f64; mesh.n_verts()];
        for (face, height) in mesh.faces.iter().zip(planarity(&mesh.points, &mesh.faces)) {
            face.iter().for_each(|v| worst[*v as usize] = worst[*v as usize].max(height));
        }
        worst
    };
    let values = [of(before), of(after)];
    let top = values.iter().flatten().copied().fold(0.0, f64::max);
    let scene = |(mesh, values): (&Mesh, &Vec<f64>)| {
        let colors: Vec<f64> = values.iter().map(|v| if top > 0.0 { (v / top).sqrt() } else { 0.0 }).collect();
        let model = Model::new(mesh.points.clone(), mesh.faces.fan_triangles()).colored_by(&colors);
        Scene { models: vec![model] }
    };
    let scenes: Vec<Scene> = [before, after].into_iter().zip(&values).map(scene).collect();
    render(&scenes, &Camera::default(), &Style::default(), PANEL[0] * scenes.len(), PANEL[1])
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
        let change = |name: &str, change: Option<proxel::shape::Change>| {
            change.map(|c| format!("{name} {:.3e} -> {:.3e}", c.before, c.after)).unwrap_or_default()
        };
        say!(
            "over the mean edge: {}, {}, {}",
            change("planarity max", shape.planarity_max),
            change("mean", shape.planarity_mean),
            change("mean distance from the reference", shape.reference_distance_mean),
        );
        for v in shape.violated.iter().take(3) {
            eprintln!(
                "warning: {} {} (0-based) is off its plane by {:.1e} of the mean edge",
                v.kind, v.index, v.violation
            );
        }
    }
    written.iter().for_each(|path| say!("wrote {}", path.display()));
    Ok(())
}
