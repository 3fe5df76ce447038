//! `proxel geodesic`: distances on a surface.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use clap::builder::PossibleValuesParser;
use proxel::geodesic::{Geodesic, Hooks, geodesic};
use proxel::preview::draw_distances;
use proxel::report::{TraceRow, peak_bytes};
use proxel::settings::{GeodesicMethod, GeodesicSettings, GradientForm};
use proxel_mesh::topology::surface;
use proxel_mesh::{Fields, Format, Mesh, not_carried, read_mesh_lenient, write_mesh};

use crate::args::{RunArgs, show_settings};
use crate::files::{Outputs, write_report, write_text, write_trace};
use crate::interrupt::{Interrupt, exit_status};
use crate::refusal::Refusal;

/// The arguments of `proxel geodesic`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  proxel geodesic bunny.obj --source 9689 --out distance.vtu --preview distance.png
  proxel geodesic terrain.ply --source 0,512,77 --out distance.csv        to the nearest of three
  proxel geodesic bunny.obj --source 9689 --method aa-admm --out d.ply    without a global system

The distance is a vertex attribute of .ply, .vtu and .vtk files, named distance; .csv has a line for each vertex. Where
no path leads it is inf.")]
pub struct GeodesicArgs {
    /// The surface: .obj, .ply, .stl, .off, .gltf, .glb or any other mesh with faces; of tetrahedra the boundary.
    #[arg(value_name = "MESH", required_unless_present = "show_settings")]
    pub mesh: Option<PathBuf>,
    /// Vertices (0-based) to measure from; several are parted by commas.
    #[arg(long, value_name = "V[,V...]", value_delimiter = ',', required_unless_present = "show_settings")]
    pub source: Vec<u32>,
    /// The mesh with its distances, or a list of them: .ply, .vtu, .vtk or .csv.
    #[arg(long, short, value_name = "FILE", required_unless_present = "show_settings")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub run: RunArgs,
    #[command(flatten)]
    pub method: GeodesicMethodArgs,
}

/// How it is solved.
#[derive(Args)]
#[command(next_help_heading = "Method")]
pub struct GeodesicMethodArgs {
    /// auto: the fastest; poisson: one sparse system; admm: the nearest integrable field by splitting; aa-admm: the same,
    /// accelerated.
    #[arg(long, value_name = "NAME", value_parser = methods(), default_value = GeodesicMethod::default().as_str())]
    pub method: String,
    /// Unknowns of the splitting: a gradient for each face, or a difference for each edge.
    #[arg(long, value_name = "faces|edges", value_parser = forms(), default_value = GradientForm::default().as_str())]
    pub form: String,
    /// For how long heat flows, in squared mean lengths of edges: longer is smoother and less exact.
    #[arg(long, value_name = "T", default_value_t = GeodesicSettings::default().time, allow_negative_numbers = true)]
    pub time: f64,
    /// Penalty of the splitting.
    #[arg(long, value_name = "MU", default_value_t = GeodesicSettings::default().mu, allow_negative_numbers = true)]
    pub mu: f64,
    /// Columns of Anderson's history.
    #[arg(long, value_name = "M", default_value_t = GeodesicSettings::default().anderson)]
    pub anderson: usize,
    /// Stop the splitting after so many iterations.
    #[arg(long, value_name = "N", default_value_t = GeodesicSettings::default().max_iters)]
    pub max_iters: usize,
    /// The splitting has converged when its primal and dual residual are below T.
    #[arg(long, value_name = "T", default_value = format!("{:e}", GeodesicSettings::default().tol), allow_negative_numbers = true)]
    pub tol: f64,
}

fn methods() -> PossibleValuesParser {
    PossibleValuesParser::new(GeodesicMethod::ALL.map(GeodesicMethod::as_str))
}

fn forms() -> PossibleValuesParser {
    PossibleValuesParser::new(GradientForm::ALL.map(GradientForm::as_str))
}

impl GeodesicArgs {
    fn settings(&self) -> Result<GeodesicSettings, Refusal> {
        self.run.check()?;
        let method = &self.method;
        let settings = GeodesicSettings {
            // Clap lets no other names through.
            method: GeodesicMethod::from_name(&method.method).unwrap_or_default(),
            form: GradientForm::from_name(&method.form).unwrap_or_default(),
            time: method.time,
            mu: method.mu,
            anderson: method.anderson,
            tol: method.tol,
            max_iters: method.max_iters,
            time_limit: self.run.time_limit,
            threads: self.run.threads,
        };
        settings.check().map_err(Refusal::new)?;
        Ok(settings)
    }
}

/// Reads, solves, writes.
pub fn run(args: &GeodesicArgs) -> Result<u8, Refusal> {
    let settings = args.settings()?;
    if args.run.show_settings {
        return show_settings(&settings);
    }
    // Clap asks for both unless settings are shown.
    let (Some(path), Some(out)) = (&args.mesh, &args.out) else {
        return Err(Refusal::new("MESH, --source and --out are needed; see proxel geodesic --help"));
    };
    let outputs = if is_list(out) { Outputs::default().file("--out", Some(out), &[])? } else { carrier(out)? };
    let r = &args.run;
    outputs
        .file("--report", r.report.as_deref(), &[])?
        .file("--trace", r.trace.as_deref(), &[])?
        .file("--preview", r.preview.as_deref(), &["png"])?
        .check()?;
    let interrupt = Interrupt::listen()?;
    let began = Instant::now();
    let mesh = read_mesh_lenient(path)?;
    let read = began.elapsed().as_secs_f64();

    let mut rows = Vec::new();
    let mut on_row = |row: &TraceRow| rows.push(*row);
    let mut hooks = Hooks { cancel: interrupt.solving(), ..Hooks::default() };
    if r.trace.is_some() {
        hooks.trace = Some(&mut on_row);
    }
    let mut result = geodesic(&mesh, &args.source, &settings, &mut hooks).map_err(|e| Refusal::new(e.to_string()))?;
    result.report.seconds.read = read;
    interrupt.writing();
    write(args, out, &mesh, &mut result, &rows)?;
    Ok(exit_status(result.status.as_str(), &result.report.reason))
}

fn is_list(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"))
}

/// A mesh file that can hold an array over its vertices.
fn carrier(path: &Path) -> Result<Outputs, Refusal> {
    match Format::from_path(path) {
        Ok(Format::Ply | Format::Vtu | Format::Vtk) => Outputs::default().mesh("--out", path),
        _ => Err(Refusal::new(format!(
            "{}: its format has no place for distances; give a name that ends in .ply, .vtu, .vtk or .csv",
            path.display()
        ))),
    }
}

fn write(
    args: &GeodesicArgs,
    out: &Path,
    mesh: &Mesh,
    result: &mut Geodesic,
    rows: &[TraceRow],
) -> Result<(), Refusal> {
    let began = Instant::now();
    let mut written = vec![out.display().to_string()];
    if is_list(out) {
        let lines: Vec<String> = result.distance.iter().enumerate().map(|(v, d)| format!("{v},{d:?}\n")).collect();
        write_text(out, &format!("vertex,distance\n{}", lines.concat()))?;
    } else {
        let mut fields = Fields::none();
        fields.point("distance", 1, result.distance.clone());
        write_mesh(out, mesh, &fields)?;
        let lost = not_carried(out, mesh, &fields)?;
        if !lost.is_empty() {
            let text = format!("{} does not carry {}", out.display(), lost.join(" and "));
            result.report.warnings.push(text);
        }
    }
    if let Some(path) = &args.run.preview {
        let triangles = surface(mesh).fan_triangles();
        draw_distances(&mesh.points, &triangles, &result.distance, PICTURE[0], PICTURE[1]).write_png(path)?;
        written.push(path.display().to_string());
    }
    if let Some(path) = &args.run.trace {
        write_trace(path, rows)?;
        written.push(path.display().to_string());
    }
    let report = &mut result.report;
    report.seconds.write = began.elapsed().as_secs_f64();
    report.peak_bytes = peak_bytes();
    if let Some(path) = &args.run.report {
        write_report(path, &report)?;
        written.push(path.display().to_string());
    }
    if !args.run.quiet {
        report.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
        report.repaired.iter().for_each(|repair| eprintln!("repaired: {repair}"));
        let seconds = report.seconds.setup + report.seconds.solve;
        say!("{} after {} iterations, {seconds:.2} s: {}", report.status, report.iterations, report.reason);
        if let Some(g) = &report.geodesic {
            say!("farthest {}, |grad| off 1 by {:.4} in the mean", g.distance_max, g.gradient_deviation);
        }
        written.iter().for_each(|path| say!("wrote {path}"));
    }
    Ok(())
}

/// Size of the picture: two views side by side.
const PICTURE: [usize; 2] = [1440, 720];
