//! `proxel wavefront`: the wavefront between two images of a coded sensor.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use clap::builder::PossibleValuesParser;
use proxel::imaging::io::{Depth, Format, ImageFile, encode, read_image};
use proxel::imaging::wavefront::{MOST_COEFFICIENTS, Plane, SimulateSettings, coefficients, simulate};
use proxel::imaging::{Image, ImageError};
use proxel::report::{TraceRow, peak_bytes};
use proxel::settings::{WavefrontMethod, WavefrontSettings};
use proxel::wavefront::{Hooks, Wavefront, draw_wavefront, measure, wavefront};
use proxel_mesh::atomic_write;

use crate::args::{RunArgs, show_settings};
use crate::files::{Outputs, write_report, write_trace};
use crate::interrupt::{Interrupt, exit_status};
use crate::refusal::Refusal;

/// The arguments of `proxel wavefront`.
#[derive(Args)]
#[command(after_help = "\
Examples:
  proxel wavefront reference.png captured.png --out phi.tif --preview phi.png
  proxel wavefront reference.tif captured.tif --out phi.npy --zernike 15 --report phi.json
  proxel wavefront --simulate 512,2,0 --out pair/       reference.png, captured.png, phi.npy of a known wavefront

phi moves the image: captured(p + grad phi(p)) = reference(p). It has the mean 0 and is in square pixels, times --scale.
.tif holds single precision, .npy double. Images: PNG, TIFF, JPEG, .npy.")]
pub struct WavefrontArgs {
    /// The image without the wavefront.
    #[arg(value_name = "REFERENCE", required_unless_present_any = ["show_settings", "simulate"])]
    pub reference: Option<PathBuf>,
    /// The image with it.
    #[arg(value_name = "CAPTURED", required_unless_present_any = ["show_settings", "simulate"])]
    pub captured: Option<PathBuf>,
    /// The wavefront: .tif or .npy. With --simulate a folder, made if it is not there.
    #[arg(long, short, value_name = "FILE", required_unless_present = "show_settings")]
    pub out: Option<PathBuf>,
    /// Write a synthetic pair instead: pixels of a side, largest shift in pixels, seed of the random numbers.
    #[arg(long, value_name = "SIZE,MAX_SHIFT,SEED", conflicts_with_all = ["reference", "captured"])]
    pub simulate: Option<String>,
    /// So many Zernike coefficients (Noll's order, over the largest disk in the middle) in the report, and on the screen.
    #[arg(long, value_name = "N")]
    pub zernike: Option<usize>,
    #[command(flatten)]
    pub run: RunArgs,
    #[command(flatten)]
    pub method: WavefrontMethodArgs,
}

/// How it is solved.
#[derive(Args)]
#[command(next_help_heading = "Method")]
pub struct WavefrontMethodArgs {
    /// auto: the fastest; admm; relaxed: over-relaxed; aa: accelerated, z and u; aa-z: accelerated, z alone; fast: with momentum;
    /// gmres: accelerated by GMRES; pcg: conjugate gradients without splitting.
    #[arg(long, value_name = "NAME", value_parser = methods(), default_value = WavefrontMethod::default().as_str())]
    pub method: String,
    /// How smooth the wavefront is to be, for images with values from 0 to 255.
    #[arg(long, value_name = "BETA", default_value_t = WavefrontSettings::default().beta, allow_negative_numbers = true)]
    pub beta: f64,
    /// Penalty of the splitting.
    #[arg(long, value_name = "MU", default_value_t = WavefrontSettings::default().mu, allow_negative_numbers = true)]
    pub mu: f64,
    /// The wavefront is found on so many pixels more on each side.
    #[arg(long, value_name = "L", default_value_t = WavefrontSettings::default().margin)]
    pub margin: usize,
    /// The pyramid of images halves them down to no less than so many pixels.
    #[arg(long, value_name = "N", default_value_t = WavefrontSettings::default().coarsest)]
    pub coarsest: usize,
    /// Warps of each level.
    #[arg(long, value_name = "N", default_value_t = WavefrontSettings::default().warps)]
    pub warps: usize,
    /// Compare the images as they are, not their textures.
    #[arg(long)]
    pub no_texture: bool,
    /// Leave out the 3 x 3 median of phi that ends each warp.
    #[arg(long)]
    pub no_median: bool,
    /// Multiply the result: from square pixels to the units of the sensor.
    #[arg(long, value_name = "S", default_value_t = WavefrontSettings::default().scale, allow_negative_numbers = true)]
    pub scale: f64,
    /// Columns of Anderson's history.
    #[arg(long, value_name = "M", default_value_t = WavefrontSettings::default().anderson)]
    pub anderson: usize,
    /// Over-relaxation of `relaxed`.
    #[arg(long, value_name = "A", default_value_t = WavefrontSettings::default().relaxation, allow_negative_numbers = true)]
    pub relaxation: f64,
    /// Iterations after which gmres begins anew.
    #[arg(long, value_name = "N", default_value_t = WavefrontSettings::default().restart)]
    pub restart: usize,
    /// Stop each linearised problem after so many iterations.
    #[arg(long, value_name = "N", default_value_t = WavefrontSettings::default().max_iters)]
    pub max_iters: usize,
    /// A linearised problem has converged when its primal and dual residual are below T.
    #[arg(long, value_name = "T", default_value = format!("{:e}", WavefrontSettings::default().tol), allow_negative_numbers = true)]
    pub tol: f64,
}

fn methods() -> PossibleValuesParser {
    PossibleValuesParser::new(WavefrontMethod::ALL.map(WavefrontMethod::as_str))
}

impl WavefrontArgs {
    fn settings(&self) -> Result<WavefrontSettings, Refusal> {
        self.run.check()?;
        let m = &self.method;
        let settings = WavefrontSettings {
            // Clap lets no other names through.
            method: WavefrontMethod::from_name(&m.method).unwrap_or_default(),
            beta: m.beta,
            mu: m.mu,
            margin: m.margin,
            coarsest: m.coarsest,
            warps: m.warps,
            texture: !m.no_texture,
            median: !m.no_median,
            scale: m.scale,
            anderson: m.anderson,
            relaxation: m.relaxation,
            restart: m.restart,
            tol: m.tol,
            max_iters: m.max_iters,
            time_limit: self.run.time_limit,
            threads: self.run.threads,
        };
        settings.check().map_err(Refusal::new)?;
        if let Some(n) = self.zernike.filter(|n| !(1..=MOST_COEFFICIENTS).contains(n)) {
            return Err(Refusal::new(format!("--zernike is {n}; ask for 1 to {MOST_COEFFICIENTS} coefficients")));
        }
        Ok(settings)
    }
}

/// Reads, solves, writes.
pub fn run(args: &WavefrontArgs) -> Result<u8, Refusal> {
    let settings = args.settings()?;
    if args.run.show_settings {
        return show_settings(&settings);
    }
    let needed = || Refusal::new("REFERENCE, CAPTURED and --out are needed; see proxel wavefront --help");
    let out = args.out.as_ref().ok_or_else(needed)?;
    if let Some(text) = &args.simulate {
        return make_pair(args, text, out);
    }
    // Clap asks for all three unless settings are shown or a pair is made.
    let (Some(reference), Some(captured)) = (&args.reference, &args.captured) else { return Err(needed()) };
    let r = &args.run;
    Outputs::default()
        .file("--out", Some(out), &["tif", "tiff", "npy"])?
        .file("--report", r.report.as_deref(), &[])?
        .file("--trace", r.trace.as_deref(), &[])?
        .file("--preview", r.preview.as_deref(), &["png"])?
        .check()?;
    let interrupt = Interrupt::listen()?;
    let began = Instant::now();
    let (one, two) = (read_image(reference)?, read_image(captured)?);
    let read = began.elapsed().as_secs_f64();

    let mut rows = Vec::new();
    let mut on_row = |row: &TraceRow| rows.push(*row);
    let mut hooks = Hooks { cancel: interrupt.solving(), ..Hooks::default() };
    if r.trace.is_some() {
        hooks.trace = Some(&mut on_row);
    }
    let names = |e: String| Refusal::new(format!("{}, {}: {e}", reference.display(), captured.display()));
    let mut result = wavefront(&one.image, &two.image, &settings, &mut hooks).map_err(|e| names(e.0))?;
    result.report.seconds.read = read;
    for (path, file) in [(reference, &one), (captured, &two)] {
        result.report.warnings.extend(file.notes.iter().map(|note| format!("{}: {note}", path.display())));
        if file.alpha.is_some() {
            result.report.warnings.push(format!("{}: alpha was not looked at", path.display()));
        }
    }
    if Format::from_path(out)? == Format::Tiff {
        // As it will be read back.
        result.phi.channels[0].iter_mut().for_each(|v| *v = f64::from(*v as f32));
        if let Some(report) = &mut result.report.wavefront {
            measure(report, &result.phi, settings.scale);
        }
    }
    if let Some(n) = args.zernike {
        let phi = &result.phi;
        let plane = Plane { width: phi.width, height: phi.height, values: phi.channels[0].clone() };
        let found = coefficients(&plane, n)?;
        if let Some(report) = &mut result.report.wavefront {
            report.zernike = found;
        }
    }
    interrupt.writing();
    write(args, out, &mut result, &rows)?;
    Ok(exit_status(result.status.as_str(), &result.report.reason))
}

impl From<ImageError> for Refusal {
    fn from(e: ImageError) -> Self {
        Refusal::new(e.0)
    }
}

/// Writes an image, whole or not at all; says what the format does not hold.
pub fn write_image(path: &Path, file: &ImageFile) -> Result<Vec<String>, Refusal> {
    let encoded =
        encode(file, Format::from_path(path)?).map_err(|e| Refusal::new(format!("{}: {e}", path.display())))?;
    atomic_write(path, |w| w.write_all(&encoded.bytes))?;
    Ok(encoded.lost.into_iter().map(|lost| format!("{}: {lost}", path.display())).collect())
}

fn write(args: &WavefrontArgs, out: &Path, result: &mut Wavefront, rows: &[TraceRow]) -> Result<(), Refusal> {
    let began = Instant::now();
    let mut written = vec![out.display().to_string()];
    let lost = write_image(out, &ImageFile::new(result.phi.clone(), Depth::F32))?;
    result.report.warnings.extend(lost);
    if let Some(path) = &args.run.preview {
        draw_wavefront(&result.phi).write_png(path)?;
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
        let seconds = report.seconds.setup + report.seconds.solve;
        say!("{} after {} iterations, {seconds:.2} s: {}", report.status, report.iterations, report.reason);
        if let Some(w) = &report.wavefront {
            say!("phi from {:.4} to {:.4}, shifts up to {:.3} pixels", w.phi_min, w.phi_max, w.shift_max);
            w.zernike.iter().enumerate().for_each(|(k, c)| say!("Z{:<3} {c:12.6}", k + 1));
        }
        written.iter().for_each(|path| say!("wrote {path}"));
    }
    Ok(())
}

/// SIZE,MAX_SHIFT,SEED.
fn parse_simulation(text: &str) -> Result<SimulateSettings, Refusal> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let parsed = match parts.as_slice() {
        [size, shift, seed] => size.parse().ok().zip(shift.parse().ok()).zip(seed.parse().ok()),
        _ => None,
    };
    let Some(((size, max_shift), seed)) = parsed else {
        return Err(Refusal::new(format!("--simulate {text}: give SIZE,MAX_SHIFT,SEED such as 512,2,0")));
    };
    Ok(SimulateSettings { size, max_shift, seed })
}

/// Writes a pair and its wavefront to a folder.
fn make_pair(args: &WavefrontArgs, text: &str, folder: &Path) -> Result<u8, Refusal> {
    let pair = simulate(&parse_simulation(text)?)?;
    std::fs::create_dir_all(folder)
        .map_err(|e| Refusal::new(format!("{}: the folder cannot be made: {e}", folder.display())))?;
    let files: [(&str, Image, Depth); 3] = [
        ("reference.png", pair.reference, Depth::U16),
        ("captured.png", pair.captured, Depth::U16),
        ("phi.npy", pair.phi, Depth::F64),
    ];
    let paths = files.each_ref().map(|(name, ..)| folder.join(name));
    let outputs = paths.iter().try_fold(Outputs::default(), |outputs, path| outputs.file("--out", Some(path), &[]))?;
    outputs.check()?;
    for (path, (_, image, depth)) in paths.iter().zip(files) {
        let lost = write_image(path, &ImageFile::new(image, depth))?;
        if !args.run.quiet {
            lost.iter().for_each(|lost| eprintln!("warning: {lost}"));
            say!("wrote {}", path.display());
        }
    }
    Ok(0)
}
