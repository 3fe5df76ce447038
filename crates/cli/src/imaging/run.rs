//! Reads, solves, writes.

use std::path::Path;
use std::time::Instant;

use proxel::imaging::io::{ImageFile, read_image};
use proxel::imaging::restore::psnr;
use proxel::imaging::{Image, Psf};
use proxel::report::peak_bytes;
use proxel::restore::{Hooks, Input, RestoreRow, Restored, draw_restored, restore};
use proxel::settings::RestoreSettings;

use super::args::{DeblurArgs, DenoiseArgs, InpaintArgs, RestoreArgs};
use super::psf;
use crate::args::show_settings;
use crate::files::{Outputs, write_report, write_text};
use crate::interrupt::{Interrupt, exit_status};
use crate::progress::Bar;
use crate::refusal::Refusal;
use crate::wavefront::write_image;

/// `proxel deblur`
pub fn deblur(args: &DeblurArgs) -> Result<u8, Refusal> {
    let settings = args.restore.settings()?;
    if args.restore.run.show_settings {
        return show_settings(&settings);
    }
    // Clap asks for it unless settings are shown.
    let psf = args.psf.as_deref().ok_or_else(|| Refusal::new("--psf is needed; see proxel deblur --help"))?;
    let psf = psf::parse(psf, args.psf_center.as_deref())?;
    run("deblur", args.image.as_deref(), &args.restore, settings, psf, None)
}

/// `proxel denoise`
pub fn denoise(args: &DenoiseArgs) -> Result<u8, Refusal> {
    let settings = args.restore.settings()?;
    if args.restore.run.show_settings {
        return show_settings(&settings);
    }
    run("denoise", args.image.as_deref(), &args.restore, settings, Psf::identity(), None)
}

/// `proxel inpaint`
pub fn inpaint(args: &InpaintArgs) -> Result<u8, Refusal> {
    let settings = args.restore.settings()?;
    if args.restore.run.show_settings {
        return show_settings(&settings);
    }
    let mask = args.mask.as_deref().ok_or_else(|| Refusal::new("--mask is needed; see proxel inpaint --help"))?;
    run("inpaint", args.image.as_deref(), &args.restore, settings, Psf::identity(), Some(mask))
}

fn run(
    command: &str,
    image: Option<&Path>,
    args: &RestoreArgs,
    settings: RestoreSettings,
    psf: Psf,
    mask: Option<&Path>,
) -> Result<u8, Refusal> {
    let (Some(path), Some(out)) = (image, args.out.as_deref()) else {
        return Err(Refusal::new(format!("IMAGE and --out are needed; see proxel {command} --help")));
    };
    let r = &args.run;
    Outputs::default()
        .file("--out", Some(out), &["png", "tif", "tiff", "npy"])?
        .file("--report", r.report.as_deref(), &[])?
        .file("--trace", r.trace.as_deref(), &[])?
        .file("--preview", r.preview.as_deref(), &["png"])?
        .check()?;
    let interrupt = Interrupt::listen()?;
    let began = Instant::now();
    let file = read_image(path)?;
    let truth = args.truth.as_deref().map(read_image).transpose()?;
    let mask = mask.map(|mask| known_pixels(mask, &file)).transpose()?;
    let read = began.elapsed().as_secs_f64();

    let bar = Bar::new(r.quiet, settings.max_iters);
    let mut rows = Vec::new();
    let mut on_row = |row: &RestoreRow| rows.push(*row);
    let mut on_progress = |iteration: usize, energy: f64| bar.show_energy(iteration, energy);
    let mut hooks = Hooks { cancel: interrupt.solving(), ..Hooks::default() };
    if r.trace.is_some() {
        hooks.trace = Some(&mut on_row);
    }
    if bar.is_shown() {
        hooks.progress = Some(&mut on_progress);
    }
    let truth = truth.as_ref().map(|truth| &truth.image);
    let input = Input { command, image: &file.image, psf, mask: mask.as_deref(), truth };
    let result = restore(&input, &settings, &mut hooks);
    bar.clear();
    let mut result = result.map_err(|e| Refusal::new(format!("{}: {e}", path.display())))?;
    result.report.seconds.read = read;
    result.report.warnings.extend(file.notes.iter().map(|note| format!("{}: {note}", path.display())));
    interrupt.writing();
    write(args, out, (file, truth), &mut result, &rows)?;
    Ok(exit_status(result.status.as_str(), &result.report.reason))
}

/// The first channel of a mask, which has to have the image's size.
fn known_pixels(path: &Path, file: &ImageFile) -> Result<Vec<f64>, Refusal> {
    let (mask, image) = (read_image(path)?.image, &file.image);
    if (mask.width, mask.height) != (image.width, image.height) {
        let sizes = format!("{} x {}, the image {} x {}", mask.width, mask.height, image.width, image.height);
        return Err(Refusal::new(format!("{}: the mask is {sizes}", path.display())));
    }
    mask.channels.into_iter().next().ok_or_else(|| Refusal::new(format!("{}: no channel", path.display())))
}

/// Each pixel of a plane as often as it takes to make it as large as an image.
fn repeated(plane: &[f64], (width, height): (usize, usize), to: &Image) -> Vec<f64> {
    let at = |k: usize| k / to.width * height / to.height * width + k % to.width * width / to.width;
    (0..to.n_pixels()).filter_map(|k| plane.get(at(k)).copied()).collect()
}

/// What was seen, as large as the result.
fn finer(seen: &Image, to: &Image) -> Image {
    let size = (seen.width, seen.height);
    let channels = seen.channels.iter().map(|plane| repeated(plane, size, to)).collect();
    Image { width: to.width, height: to.height, channels }
}

/// The file with the result in it; alpha grows with the image.
fn restored(mut file: ImageFile, image: &Image) -> ImageFile {
    let size = (file.image.width, file.image.height);
    file.alpha = file.alpha.map(|alpha| repeated(&alpha, size, image));
    let size = (image.width, image.height);
    file.image = Image { width: size.0, height: size.1, ..file.image };
    file.with_image(image.clone())
}

fn write(
    args: &RestoreArgs,
    out: &Path,
    (file, truth): (ImageFile, Option<&Image>),
    result: &mut Restored,
    rows: &[RestoreRow],
) -> Result<(), Refusal> {
    let began = Instant::now();
    let mut written = vec![out.display().to_string()];
    let before = finer(&file.image, &result.image);
    let lost = write_image(out, &restored(file, &result.image))?;
    result.report.warnings.extend(lost);
    if let (Some(truth), Some(of)) = (truth, &mut result.report.restore) {
        // Of the file, whose bits may be fewer.
        of.psnr = Some(psnr(&read_image(out)?.image.channels, &truth.channels)).filter(|v| v.is_finite());
    }
    if let Some(path) = &args.run.preview {
        draw_restored(&before, &result.image).write_png(path)?;
        written.push(path.display().to_string());
    }
    if let Some(path) = &args.run.trace {
        let lines: Vec<String> = rows.iter().map(RestoreRow::to_csv).collect();
        write_text(path, &format!("{}\n{}\n", RestoreRow::header(), lines.join("\n")))?;
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
        if let Some(of) = &report.restore {
            let noise = of.noise.map_or(String::new(), |noise| format!(", noise {noise:.4}"));
            say!("lambda {:.4}{noise}, boundary {}, regulariser {}", of.lambda, of.boundary, of.regulariser);
            if let (Some(before), Some(after)) = (of.psnr_input, of.psnr) {
                say!("PSNR {after:.2} dB, {before:.2} dB before");
            }
        }
        written.iter().for_each(|path| say!("wrote {path}"));
    }
    Ok(())
}
