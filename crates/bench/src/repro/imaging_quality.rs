//! What deconvolution with everything automatic reaches, beside the best lambda and the best constant Wiener filter.

use super::aa::chart;
use super::context::Context;
use crate::BenchError;
use crate::table::Table;
use proxel::imaging::io::read_image;
use proxel::imaging::restore::psnr;
use proxel::imaging::{Fourier, Grid, Image, Psf, convolve};
use proxel::restore::{Hooks, Input, Restored, restore};
use proxel::settings::{RegulariserName, RestoreSettings};
use proxel_testkit::SplitMix;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Images of scikit-image that its wheel holds, under CC0.
const IMAGES: [&str; 5] = ["camera", "brick", "grass", "gravel", "coffee"];

/// The standard deviation of the noise.
const NOISE: f64 = 0.01;

/// Steps of a factor of 2 in lambda to either side of the one that was chosen.
const STEPS: i32 = 3;

/// An image, and what is seen of it.
struct Scene {
    /// What lies within the reach of the blur from the border is cut off.
    truth: Image,
    seen: Image,
    /// What was seen, not cut off: it wraps around.
    whole: Image,
    psf: Psf,
}

/// See [`super::ALL`].
///
/// # Errors
/// Data that cannot be read, a file that cannot be written.
pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let quick = context.options.quick;
    let folder = std::env::var_os("PROXEL_DATA").map(|root| PathBuf::from(root).join("imaging")).unwrap_or_default();
    let (images, source) = images(&folder, quick)?;
    let steps = if quick { 1 } else { STEPS };
    let most = context.options.max_iters.unwrap_or(if quick { 60 } else { 300 });
    let _ = writeln!(
        context.text,
        "{source}\n\n## What is compared\n\nImages are blurred, noise of standard deviation {NOISE} is added, and what lies within \
         the reach of the blur from the border is cut off, so that nothing is known beyond it. *auto*: `proxel deblur` \
         as it is, all automatic; *best lambda*: the best PSNR of {} values around that, by factors of 2; *Wiener*: \
         conj(H) F / (|H|^2 + c) with the best constant c, *Laplacian*: conj(H) F / (|H|^2 + c L^2), L its symbol, both of the \
         image before the border was cut off, which wraps around as they assume. All in dB on the same pixels, by the truth; at most {most} iterations a run, tolerance 1e-4.\n",
        2 * steps + 1
    );
    let columns = [
        "image",
        "blur",
        "noise",
        "regulariser",
        "lambda",
        "seen",
        "auto",
        "best lambda",
        "at",
        "Wiener",
        "Laplacian",
        "auto - best",
        "auto - Wiener",
        "auto - Laplacian",
    ];
    let mut table = Table::new(columns.map(str::to_string));
    let mut csv = "image,blur,noise,regulariser,lambda,seen,auto,best,best_lambda,wiener,laplacian\n".to_string();
    for (name, image) in &images {
        for (blur, psf) in blurs(&folder, quick)? {
            let scene = scene(image, psf)?;
            let settings = RestoreSettings {
                tol: 1e-4,
                max_iters: most,
                threads: context.options.threads,
                ..RestoreSettings::default()
            };
            let auto = solve(&scene, &settings)?;
            let of = auto.report.restore.clone().unwrap_or_default();
            let before = psnr(&scene.seen.channels, &scene.truth.channels);
            let reached = psnr(&auto.image.channels, &scene.truth.channels);
            let (mut best, mut at) = (reached, of.lambda);
            // What was taken, which another lambda alone would not take.
            let regulariser = RegulariserName::from_name(&of.regulariser).unwrap_or_default();
            for step in (-steps..=steps).filter(|step| *step != 0) {
                let lambda = of.lambda * 2f64.powi(step);
                let other = solve(&scene, &RestoreSettings { lambda: Some(lambda), regulariser, ..settings.clone() })?;
                let reached = psnr(&other.image.channels, &scene.truth.channels);
                if reached > best {
                    (best, at) = (reached, lambda);
                }
            }
            let [wiener, laplacian] = wiener(&scene);
            let noise = of.noise.unwrap_or(f64::NAN);
            context.tell(&format!(
                "{name}, {blur}: auto {reached:.2} dB, best {best:.2}, Wiener {wiener:.2}, {laplacian:.2}"
            ));
            let db = |v: f64| format!("{v:.2}");
            table.row([
                name.clone(),
                blur.clone(),
                format!("{noise:.4}"),
                of.regulariser.clone(),
                format!("{:.0}", of.lambda),
                db(before),
                db(reached),
                db(best),
                format!("{at:.0}"),
                db(wiener),
                db(laplacian),
                db(reached - best),
                db(reached - wiener),
                db(reached - laplacian),
            ]);
            let _ = writeln!(
                csv,
                "{name},{blur},{noise:.5},{},{:.4},{before:.4},{reached:.4},{best:.4},{at:.4},{wiener:.4},{laplacian:.4}",
                of.regulariser, of.lambda
            );
        }
    }
    let _ = writeln!(context.text, "{table}");
    context.csv = Some(csv);
    Ok(())
}

fn solve(scene: &Scene, settings: &RestoreSettings) -> Result<Restored, BenchError> {
    let input = Input { command: "deblur", image: &scene.seen, psf: scene.psf.clone(), mask: None, truth: None };
    restore(&input, settings, &mut Hooks::default()).map_err(BenchError::from_display)
}

/// Those of the folder; a chart where there are none.
fn images(folder: &Path, quick: bool) -> Result<(Vec<(String, Image)>, String), BenchError> {
    let mut images = Vec::new();
    for name in IMAGES {
        let path = folder.join(format!("{name}.png"));
        if path.exists() && !quick {
            images.push((name.to_string(), read_image(&path).map_err(BenchError::from_display)?.image));
        }
    }
    if images.is_empty() {
        let text = "Data: none; a generated chart. Set PROXEL_DATA to the folder that holds `imaging/` with camera.png, brick.png, \
            grass.png, gravel.png and coffee.png of scikit-image 0.26.0 (its wheel has them in skimage/data).";
        return Ok((vec![("chart".to_string(), chart(if quick { 96 } else { 512 })?)], text.to_string()));
    }
    let names: Vec<&str> = images.iter().map(|(name, _)| name.as_str()).collect();
    let source = format!("Data: {} of scikit-image.", names.join(", "));
    Ok((images, source))
}

fn blurs(folder: &Path, quick: bool) -> Result<Vec<(String, Psf)>, BenchError> {
    let path = folder.join("snake15.txt");
    let snake = if path.exists() {
        let k = read_image(&path).map_err(BenchError::from_display)?.image;
        ("snake15".to_string(), Psf::new(k.width, k.height, k.channels.concat(), None))
    } else {
        ("motion:13,35".to_string(), Psf::motion(13.0, 35.0))
    };
    let others = [("gaussian:1.6".to_string(), Psf::gaussian(1.6)), ("disk:4".to_string(), Psf::disk(4.0))];
    let all = std::iter::once(snake).chain(others).take(if quick { 1 } else { 3 });
    all.map(|(name, psf)| Ok((name, psf.map_err(BenchError::from_display)?))).collect()
}

fn scene(image: &Image, psf: Psf) -> Result<Scene, BenchError> {
    let (w, h) = (image.width, image.height);
    let fourier = Fourier::new(w, h);
    let spectrum = psf.spectrum(&fourier);
    let mut random = SplitMix::new(3);
    let mut blurred = Vec::new();
    for plane in &image.channels {
        let mut out = vec![0.0; w * h];
        convolve(Grid::new(w, h), &fourier, &spectrum, false, plane, &mut out);
        out.iter_mut().for_each(|v| *v += NOISE * random.normal());
        blurred.push(out);
    }
    let whole = Image::new(w, h, blurred).map_err(BenchError::from_display)?;
    let (truth, seen) = (cut(image, &psf)?, cut(&whole, &psf)?);
    Ok(Scene { truth, seen, whole, psf })
}

/// The pixels that are further from the border than the blur reaches.
fn cut(image: &Image, psf: &Psf) -> Result<Image, BenchError> {
    let (i0, j0) = (psf.height / 2, psf.width / 2);
    let (w, h) = (image.width.saturating_sub(2 * j0), image.height.saturating_sub(2 * i0));
    let rows = |plane: &Vec<f64>| (0..h).flat_map(|i| plane[(i + i0) * image.width + j0..][..w].to_vec()).collect();
    Image::new(w, h, image.channels.iter().map(rows).collect()).map_err(BenchError::from_display)
}

/// The PSNR of the Wiener filters with the best constant c, on the pixels that are not cut off: of |H|^2 + c, and of |H|^2 + c
/// L^2, L the symbol of the Laplacian; constants by factors of 2^(1/2).
fn wiener(scene: &Scene) -> [f64; 2] {
    let (w, h) = (scene.whole.width, scene.whole.height);
    let fourier = Fourier::new(w, h);
    let spectrum = scene.psf.spectrum(&fourier);
    let part = |k: usize, n: usize| 2.0 - 2.0 * (TAU * k as f64 / n as f64).cos();
    let laplacian = |k: usize| (part(k % h, h) + part(k / h, w)).powi(2);
    let mut best = [f64::NEG_INFINITY; 2];
    for k in 0..=68 {
        let constant = 1e-6 * 2f64.powf(0.5 * (k / 2) as f64);
        let weight = |frequency: usize| if k % 2 == 0 { 1.0 } else { laplacian(frequency) };
        let filter: Vec<_> = (spectrum.iter().enumerate())
            .map(|(at, gain)| gain.conj() / (gain.norm_sqr() + constant * weight(at)))
            .collect();
        let mut channels = Vec::new();
        for plane in &scene.whole.channels {
            let mut out = vec![0.0; w * h];
            convolve(Grid::new(w, h), &fourier, &filter, false, plane, &mut out);
            channels.push(out);
        }
        let filtered = Image { width: w, height: h, channels };
        if let Ok(inner) = cut(&filtered, &scene.psf) {
            best[k % 2] = best[k % 2].max(psnr(&inner.channels, &scene.truth.channels));
        }
    }
    best
}
