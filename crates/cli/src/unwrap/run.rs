//! From files to files.

use std::path::{Path, PathBuf};
use std::time::Instant;

use proxel::report::peak_bytes;
use proxel::settings::UnwrapSettings;
use proxel::unwrap::{Hooks, MapPictures, MapRow, Progress, UnwrapInput, Unwrapped, unwrap};
use proxel_mesh::uv::{read_uv, require_uv_format, seams_of};
use proxel_mesh::{Mesh, read_mesh_lenient, write_mesh};

use super::{UnwrapArgs, lists, original};
use crate::args::show_settings;
use crate::files::{Outputs, write_report, write_text};
use crate::interrupt::{Interrupt, exit_status};
use crate::progress::Bar;
use crate::refusal::Refusal;

/// Reads, solves, writes.
pub fn run(args: &UnwrapArgs) -> Result<u8, Refusal> {
    let settings = args.settings()?;
    if args.solve.run.show_settings {
        return show_settings(&settings);
    }
    // Clap asks for both unless settings are shown.
    let (Some(path), Some(out)) = (&args.mesh, &args.solve.out) else {
        return Err(Refusal::new("MESH and --out are needed; see proxel unwrap --help"));
    };
    let files = Files {
        out: out.clone(),
        report: args.solve.run.report.clone(),
        trace: args.solve.run.trace.clone(),
        map: args.solve.run.preview.clone(),
        surface: args.preview_3d.clone(),
        heat: args.heatmap.clone(),
    };
    files.check()?;
    let interrupt = Interrupt::listen()?;
    let began = Instant::now();
    let input = read(args, path)?;
    original::check(path, out, &input.mesh)?;
    let read = began.elapsed().as_secs_f64();
    let job = Job { source: Some(path), files: &files, input: &input, read, quiet: args.solve.run.quiet };
    job.run(&settings, &interrupt)
}

/// Where results go.
pub struct Files {
    /// The mesh with its map.
    pub out: PathBuf,
    /// JSON.
    pub report: Option<PathBuf>,
    /// CSV.
    pub trace: Option<PathBuf>,
    /// The map in the plane, PNG.
    pub map: Option<PathBuf>,
    /// The surface with a checkerboard, PNG.
    pub surface: Option<PathBuf>,
    /// The distortion as colours of vertices, PLY.
    pub heat: Option<PathBuf>,
}

impl Files {
    /// Checks that all can be written.
    pub fn check(&self) -> Result<(), Refusal> {
        require_uv_format(&self.out)?;
        Outputs::default()
            .mesh("--out", &self.out)?
            .file("--report", self.report.as_deref(), &[])?
            .file("--trace", self.trace.as_deref(), &[])?
            .file("--preview", self.map.as_deref(), &["png"])?
            .file("--preview-3d", self.surface.as_deref(), &["png"])?
            .file("--heatmap", self.heat.as_deref(), &["ply"])?
            .check()
    }
}

fn read(args: &UnwrapArgs, path: &Path) -> Result<UnwrapInput, Refusal> {
    let mesh = read_mesh_lenient(path)?;
    if mesh.faces.is_empty() {
        return Err(Refusal::new(format!("{}: it has no faces; give a surface", mesh.name)));
    }
    let wanted = args.from_uv || args.seams == "vt";
    let map = if wanted { read_uv(path)? } else { None };
    let given = || {
        map.clone().ok_or_else(|| {
            let option = if args.from_uv { "--from-uv" } else { "--seams vt" };
            Refusal::new(format!("{}: it has no texture coordinates; leave {option} out", mesh.name))
        })
    };
    let seams = match args.seams.as_str() {
        "auto" if !args.from_uv => Vec::new(),
        "auto" | "vt" => seams_of(&mesh, &given()?)?,
        file => lists::seams(&PathBuf::from(file), &mesh)?,
    };
    let start = if args.from_uv { Some(given()?) } else { None };
    let pins = args.pin.as_deref().map_or(Ok(Vec::new()), |p| lists::pins(p, &mesh))?;
    let weights = args.weights.as_deref().map(|p| lists::weights(p, &mesh)).transpose()?;
    let metric = args.metric.as_deref().map(|p| lists::metric(p, &mesh)).transpose()?;
    Ok(UnwrapInput { mesh, seams, start, pins, weights, metric })
}

/// What is mapped, and where to.
pub struct Job<'a> {
    /// The file that the mesh was read from, whose attributes are kept.
    pub source: Option<&'a Path>,
    /// Where results go.
    pub files: &'a Files,
    /// The problem.
    pub input: &'a UnwrapInput,
    /// Seconds spent reading.
    pub read: f64,
    /// Whether nothing is printed.
    pub quiet: bool,
}

impl Job<'_> {
    /// Solves, writes, says how it went; returns the exit status.
    pub fn run(&self, settings: &UnwrapSettings, interrupt: &Interrupt) -> Result<u8, Refusal> {
        let result = self.solve(settings, interrupt)?;
        interrupt.writing();
        self.write(result)
    }

    fn solve(&self, settings: &UnwrapSettings, interrupt: &Interrupt) -> Result<Unwrapped, Refusal> {
        if let Some(n) = settings.threads {
            // For what follows the solve. A pool that is there already is no harm.
            let _ = rayon::ThreadPoolBuilder::new().num_threads(n).build_global();
        }
        let bar = Bar::new(self.quiet, settings.max_iters);
        let mut on_progress = |p: &Progress| bar.show(p);
        let mut hooks = Hooks { traced: self.files.trace.is_some(), cancel: interrupt.solving(), ..Hooks::default() };
        if bar.is_shown() {
            hooks.progress = Some(&mut on_progress);
        }
        let result = unwrap(self.input, settings, &mut hooks);
        bar.clear();
        Ok(result?)
    }

    fn write(&self, mut result: Unwrapped) -> Result<u8, Refusal> {
        let began = Instant::now();
        let mesh = &self.input.mesh;
        let mut written = Vec::new();
        // A map that is not finite is none; anything else is kept, whatever became of the run.
        let kept = result.uv.coordinates.iter().flatten().all(|v| v.is_finite());
        if kept {
            let certificate = original::write_map(self.source, &self.files.out, mesh, &mut result)?;
            written.push(self.files.out.display().to_string());
            result.certified(&certificate, mesh);
            self.draw(mesh, &result, &mut written)?;
        }
        if let Some(path) = &self.files.trace {
            let lines: Vec<String> = result.rows.iter().map(MapRow::to_csv).collect();
            write_text(path, &format!("{}\n{}\n", MapRow::header(), lines.join("\n")))?;
            written.push(path.display().to_string());
        }
        let report = &mut result.report;
        report.seconds.read = self.read;
        report.seconds.write = began.elapsed().as_secs_f64();
        report.peak_bytes = peak_bytes();
        if let Some(path) = &self.files.report {
            write_report(path, &report)?;
            written.push(path.display().to_string());
        }
        if !self.quiet {
            say(&result, &written);
        }
        Ok(exit_status(result.status.as_str(), &result.report.reason))
    }

    fn draw(&self, mesh: &Mesh, result: &Unwrapped, written: &mut Vec<String>) -> Result<(), Refusal> {
        let Files { map, surface, heat, .. } = self.files;
        if map.is_none() && surface.is_none() && heat.is_none() {
            return Ok(());
        }
        let packed = result.report.map.as_ref().is_some_and(|m| m.density.is_some());
        let pictures = MapPictures::new(mesh, &result.uv, packed);
        map.as_ref().map_or(Ok(()), |path| pictures.map().write_png(path))?;
        surface.as_ref().map_or(Ok(()), |path| pictures.surface().write_png(path))?;
        heat.as_ref().map_or(Ok(()), |path| write_mesh(path, mesh, &pictures.heat()?))?;
        written.extend([map, surface, heat].into_iter().flatten().map(|path| path.display().to_string()));
        Ok(())
    }
}

fn say(result: &Unwrapped, written: &[String]) {
    let r = &result.report;
    for warning in &r.warnings {
        eprintln!("warning: {warning}");
    }
    for repair in &r.repaired {
        eprintln!("repaired: {repair}");
    }
    say!("{} after {} iterations, {:.2} s: {}", r.status, r.iterations, r.seconds.setup + r.seconds.solve, r.reason);
    if let Some(m) = &r.map {
        let energy = r.energy.map_or_else(|| "undefined".to_owned(), |e| format!("{e:.6}"));
        say!(
            "energy {energy} (1 is an isometry), {} flips, {} overlaps, {} charts, seams {:.2}, packing {:.2}",
            m.flips,
            m.overlaps,
            m.charts,
            m.seam_length,
            m.packing
        );
    }
    for file in written {
        say!("wrote {file}");
    }
}
