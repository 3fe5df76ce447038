//! From files to files.

use std::path::{Path, PathBuf};
use std::time::Instant;

use proxel::deform::{DeformInput, Deformation, Hooks, Progress, deform, draw_deformation, extras};
use proxel::pins::{HalfSpace, Handles, PinFile};
use proxel::problem_file::ProblemFile;
use proxel::report::{TraceRow, peak_bytes};
use proxel::settings::DeformSettings;
use proxel::split::Status;
use proxel_mesh::{Mesh, not_carried, read_mesh, read_points, write_mesh};

use super::{DeformArgs, Outlets, animate};
use crate::args::show_settings;
use crate::files::{Outputs, write_report, write_trace};
use crate::interrupt::{Interrupt, exit_status};
use crate::progress::Bar;
use crate::refusal::Refusal;

/// What is said where the result is the rest shape.
const IDLE: &str = "nothing moves the body; give --init, pins with targets, or loads";

/// Where results go.
#[derive(Default)]
pub struct Files {
    /// Meshes, each with its format; the first is the result proper.
    pub meshes: Vec<PathBuf>,
    /// JSON.
    pub report: Option<PathBuf>,
    /// CSV.
    pub trace: Option<PathBuf>,
    /// PNG.
    pub preview: Option<PathBuf>,
    /// The lattice that carried a surface.
    pub lattice: Option<PathBuf>,
}

/// What is solved, and what is known about it.
pub struct Inputs {
    /// The problem.
    pub input: DeformInput,
    /// Oddities of the input that did not hinder.
    pub warnings: Vec<String>,
    /// Seconds spent reading.
    pub read: f64,
}

/// Reads, solves, writes.
pub fn run(args: &DeformArgs) -> Result<u8, Refusal> {
    let settings = args.settings()?;
    if args.solve.run.show_settings {
        return show_settings(&settings);
    }
    // Clap asks for both unless settings are shown.
    let (Some(rest), Some(out)) = (&args.rest, &args.solve.out) else {
        return Err(Refusal::new("REST and --out are needed; see proxel deform --help"));
    };
    let s = &args.solve.run;
    if let Some(dump) = &args.dump {
        Outputs::default().file("--dump", Some(dump), &["json"])?.check()?;
    }
    if let Some(keyframes) = &args.keyframes {
        let outlets = Outlets { out: out.clone(), report: s.report.clone(), trace: s.trace.clone() };
        outlets.check()?;
        let interrupt = Interrupt::listen()?;
        let mut inputs = read(args, rest, &settings)?;
        inputs.warnings.retain(|w| w != IDLE);
        return animate(inputs, keyframes, args.frame_time, &settings, &outlets, &interrupt, s.quiet);
    }
    let files = Files {
        meshes: vec![out.clone()],
        report: s.report.clone(),
        trace: s.trace.clone(),
        preview: s.preview.clone(),
        lattice: args.surface.lattice_out.clone(),
    };
    files.check()?;
    let interrupt = Interrupt::listen()?;
    let inputs = read(args, rest, &settings)?;
    if files.preview.is_some() && inputs.input.rest.tets.is_empty() && inputs.input.rest.faces.is_empty() {
        let text = format!("{}: it has edges only, nothing to draw; leave --preview out", rest.display());
        return Err(Refusal::new(text));
    }
    if files.lattice.is_some() && (!inputs.input.rest.tets.is_empty() || inputs.input.rest.faces.is_empty()) {
        return Err(no_lattice(&inputs.input.rest));
    }
    if let Some(dump) = &args.dump {
        ProblemFile::deform(&inputs.input, &settings)?.write(dump)?;
    }
    solve_and_write(inputs, &settings, &files, &interrupt, s.quiet)
}

impl Files {
    /// Checks that all can be written.
    pub fn check(&self) -> Result<(), Refusal> {
        let mut outputs = Outputs::default();
        for mesh in &self.meshes {
            outputs = outputs.mesh("--out", mesh)?;
        }
        if let Some(lattice) = &self.lattice {
            outputs = outputs.mesh("--lattice-out", lattice)?;
        }
        let outputs = outputs.file("--report", self.report.as_deref(), &[])?;
        let outputs = outputs.file("--trace", self.trace.as_deref(), &[])?;
        outputs.file("--preview", self.preview.as_deref(), &["png"])?.check()
    }

    fn write(
        &self,
        input: &DeformInput,
        settings: &DeformSettings,
        result: &Deformation,
    ) -> Result<Vec<String>, Refusal> {
        let lattice = match (&self.lattice, &result.carried) {
            (Some(_), None) => return Err(no_lattice(&input.rest)),
            (Some(path), Some(carried)) => Some((path, carried)),
            (None, _) => None,
        };
        let mut written = Vec::new();
        let mut mesh = input.rest.with_points(result.positions.clone())?;
        if let Some(tets) = &result.repaired_tets {
            mesh.tets.clone_from(tets);
        }
        let extras = extras(input, settings, result)?;
        let fields = extras.to_fields(&mesh);
        for path in &self.meshes {
            write_mesh(path, &mesh, &fields)?;
            written.push(path.display().to_string());
        }
        if let Some((path, carried)) = lattice {
            let (lattice, fields) = carried.lattice()?;
            write_mesh(path, &lattice, &fields)?;
            written.push(path.display().to_string());
        }
        if let Some(path) = &self.preview {
            draw_deformation(input, settings.mixed, result, &extras).write_png(path)?;
            written.push(path.display().to_string());
        }
        Ok(written)
    }
}

fn no_lattice(rest: &Mesh) -> Refusal {
    let what = "no lattice is made, its elements are deformed themselves";
    Refusal::new(format!("{}: {what}; leave --lattice-out out", rest.name))
}

fn read(args: &DeformArgs, rest: &Path, settings: &DeformSettings) -> Result<Inputs, Refusal> {
    let began = Instant::now();
    let mesh = read_mesh(rest)?;
    let same_size = |path: &Path, what: &str| -> Result<Vec<[f64; 3]>, Refusal> {
        let points = read_points(path)?;
        if points.len() == mesh.n_verts() {
            return Ok(points);
        }
        Err(Refusal::new(format!(
            "{}: it has {} vertices, {} has {}; give a {what} of the same mesh",
            path.display(),
            points.len(),
            rest.display(),
            mesh.n_verts()
        )))
    };
    let start = args.init.as_deref().map(|p| same_size(p, "start")).transpose()?;
    let reference = args.reference.as_deref().map(|p| same_size(p, "reference")).transpose()?;
    let mut handles = match &args.pins {
        Some(path) => PinFile::read(path)?.resolve(&mesh.points, start.as_deref())?,
        None => Handles::default(),
    };
    let mut warnings = std::mem::take(&mut handles.warnings);
    check_regions(args, &mesh, settings, &mut warnings)?;
    let mut pressures = handles.pressures;
    pressures.extend(args.material.pressure.map(|p| ((0..mesh.n_verts() as u32).collect(), p)));
    let mut obstacles = handles.obstacles;
    obstacles.extend(
        args.material.obstacle.iter().map(|o| HalfSpace { point: [o[0], o[1], o[2]], normal: [o[3], o[4], o[5]] }),
    );
    let loaded = settings.weighs() || !handles.loads.is_empty() || !pressures.is_empty();
    let constrained = !handles.equalities.is_empty() || !obstacles.is_empty();
    if start.is_none() && !handles.moved && !loaded && !constrained {
        warnings.push(IDLE.to_owned());
    }
    let input = DeformInput {
        rest: mesh,
        start,
        fixed: handles.fixed,
        soft: handles.soft,
        loads: handles.loads,
        pressures,
        equalities: handles.equalities,
        obstacles,
        groups: handles.groups,
        reference,
        ..DeformInput::default()
    };
    Ok(Inputs { input, warnings, read: began.elapsed().as_secs_f64() })
}

/// Holds the regions that have materials against those that there are.
fn check_regions(
    args: &DeformArgs,
    mesh: &Mesh,
    settings: &DeformSettings,
    warnings: &mut Vec<String>,
) -> Result<(), Refusal> {
    let Some(path) = &args.material.materials else { return Ok(()) };
    let regions = if mesh.tets.is_empty() { &mesh.face_regions } else { &mesh.tet_regions };
    let Some(regions) = regions else {
        let text = format!("{}: it has no regions; leave --materials out or give a mesh with regions", mesh.name);
        return Err(Refusal::new(text));
    };
    for region in settings.materials.keys().filter(|r| !regions.contains(r)) {
        warnings.push(format!("{}: region {region} has no elements in {}", path.display(), mesh.name));
    }
    Ok(())
}

/// Solves, writes everything, says how it went; returns the exit status.
pub fn solve_and_write(
    inputs: Inputs,
    settings: &DeformSettings,
    files: &Files,
    interrupt: &Interrupt,
    quiet: bool,
) -> Result<u8, Refusal> {
    if let Some(n) = settings.threads {
        // For what follows the solve. A pool that is there already is no harm.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(n).build_global();
    }
    let Inputs { input, mut warnings, read } = inputs;
    let bar = Bar::new(quiet, settings.max_iters);
    let mut rows: Vec<TraceRow> = Vec::new();
    let mut on_progress = |p: &Progress| bar.show(p);
    let mut on_row = |row: &TraceRow| rows.push(*row);
    let mut hooks = Hooks { cancel: interrupt.solving(), ..Hooks::default() };
    if bar.is_shown() {
        hooks.progress = Some(&mut on_progress);
    }
    if files.trace.is_some() {
        hooks.trace = Some(&mut on_row);
    }
    let solved = deform(&input, settings, &mut hooks);
    bar.clear();
    let mut result = solved?;

    interrupt.writing();
    let began = Instant::now();
    // Of a failed run nothing is worth keeping but what it says.
    let failed = result.status == Status::Failed;
    let mut written = if failed { Vec::new() } else { files.write(&input, settings, &result)? };
    if let Some(path) = &files.trace {
        write_trace(path, &rows)?;
        written.push(path.display().to_string());
    }
    let report = &mut result.report;
    warnings.append(&mut report.warnings);
    report.warnings = warnings;
    report.seconds.read = read;
    report.seconds.write = began.elapsed().as_secs_f64();
    report.peak_bytes = peak_bytes();
    if let Some(path) = &files.report {
        write_report(path, &report)?;
        written.push(path.display().to_string());
    }
    if !quiet {
        say(&input, files, &result, &written)?;
    }
    Ok(exit_status(result.status.as_str(), &result.report.reason))
}

fn say(input: &DeformInput, files: &Files, result: &Deformation, written: &[String]) -> Result<(), Refusal> {
    let r = &result.report;
    for warning in &r.warnings {
        eprintln!("warning: {warning}");
    }
    for repair in &r.repaired {
        eprintln!("repaired: {repair}");
    }
    // Who asks for several formats knows that they differ.
    for path in files.meshes.iter().filter(|_| files.meshes.len() == 1) {
        let lost = not_carried(path, &input.rest, &proxel_mesh::Fields::none())?;
        if !lost.is_empty() && result.status != Status::Failed {
            eprintln!("warning: {} does not carry {}", path.display(), lost.join(" and "));
        }
    }
    let number = |v: Option<f64>| v.map_or_else(|| "undefined".to_owned(), |v| format!("{v:.6e}"));
    say!("{} after {} iterations, {:.2} s: {}", r.status, r.iterations, r.seconds.setup + r.seconds.solve, r.reason);
    say!(
        "energy {}, gradient ratio {}, inverted {}, stretches {} to {}",
        number(r.energy),
        r.gradient_ratio.map_or_else(|| "undefined".to_owned(), |v| format!("{v:.1e}")),
        r.inverted.unwrap_or(0),
        r.min_stretch.map_or_else(|| "undefined".to_owned(), |v| format!("{v:.3}")),
        r.max_stretch.map_or_else(|| "undefined".to_owned(), |v| format!("{v:.3}")),
    );
    if !written.is_empty() {
        say!("wrote {}", written.join(", "));
    }
    Ok(())
}
