//! Figure 10: deconvolution by total variation, accelerated in each of the variables that the iteration is a fixed point in.

use super::course::{Course, Point, Residual};
use super::{csv, panel};
use crate::BenchError;
use crate::repro::context::Context;
use crate::table::Table;
use proxel::imaging::io::read_image;
use proxel::imaging::restore::{Edges, Field, Form, Iteration, Model, psnr};
use proxel::imaging::{Grid, Image, Psf};
use proxel::split::{Cycle, LocalReport, Method, normalized};
use proxel_testkit::SplitMix;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Instant;

const LEVELS: [f64; 4] = [1e-2, 1e-3, 1e-4, 1e-5];

/// lambda_1 of A(31), lambda_2 being 1, and the standard deviation of the noise: those of the authors' follow-up code.
const LAMBDA: f64 = 400.0;
const NOISE: f64 = 0.01;

/// Name, form, rho, iteration, and what another implementation counted to the levels on `camera`.
type Row = (&'static str, Form, f64, Iteration, &'static str);

const ROWS: [Row; 11] = {
    const fn anderson(both: bool, relaxation: f64) -> Iteration {
        Iteration::Anderson { window: 6, both, relaxation }
    }
    const fn admm(relaxation: f64) -> Iteration {
        Iteration::Admm { relaxation }
    }
    [
        ("both split, admm", Form::Split, 30.0, admm(1.0), "33 94 166 497"),
        ("both split, aa m=6", Form::Split, 30.0, anderson(true, 1.0), "26 62 106"),
        ("v, admm", Form::Held, 20.0, admm(1.0), "8 34 147"),
        ("v, relaxed 1.8", Form::Held, 20.0, admm(1.8), "9 24 85"),
        ("v, fast + restart", Form::Held, 20.0, Iteration::Fast { both: false }, "11 28 98"),
        ("v, aa m=6", Form::Held, 20.0, anderson(false, 1.0), "7 26 104 456"),
        ("v, aa m=6, relaxed 1.8", Form::Held, 20.0, anderson(false, 1.8), "8 25 90"),
        ("(z, u), fast + restart", Form::Held, 20.0, Iteration::Fast { both: true }, ""),
        ("(z, u), aa m=6", Form::Held, 20.0, anderson(true, 1.0), "8 30 135"),
        ("v, admm, rho 100", Form::Held, 100.0, admm(1.0), "10 69 249"),
        ("v, relaxed 1.8, rho 100", Form::Held, 100.0, admm(1.8), "11 58 182"),
    ]
};

/// An image and what is known of it.
struct Scene {
    name: &'static str,
    truth: Option<Vec<Vec<f64>>>,
    seen: Image,
    psf: Psf,
    source: String,
}

/// See [`crate::repro::ALL`].
///
/// # Errors
/// Data that cannot be read, a file that cannot be written.
pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let scene = scene(context.options.quick)?;
    let (w, h) = (scene.seen.width, scene.seen.height);
    let _ = writeln!(
        context.text,
        "{}\n\n## The problem\n\nmin lambda |K x - f|^2 + sum |grad x|, lambda = {LAMBDA}, {w} x {h} pixels, periodic; x, z, u start at 0. \
         Residual: the combined one, sqrt(rho (|D x - z|^2 + |dz|^2) / N). It depends on rho, so that methods are to be compared \
         at one rho. `both split`: K x and grad x; `v` = grad x + u, the Douglas-Rachford variable. Last column: counts of \
         another implementation on `camera`. Seconds are those of iterations alone.\n",
        scene.source
    );
    let mut courses = Vec::new();
    let mut table = Table::new(
        ["method"]
            .map(str::to_string)
            .into_iter()
            .chain(LEVELS.iter().map(|level| format!("{level:e}")))
            .chain(["ns a pixel and iteration", "PSNR", "elsewhere"].map(str::to_string)),
    );
    for (name, form, rho, iteration, elsewhere) in ROWS {
        let mut model = Model::new(&scene.seen, scene.psf.clone(), Edges::Periodic, LAMBDA);
        (model.form, model.penalty, model.data_penalty) = (form, Some(rho), Some(rho));
        let built = model.build(None).map_err(BenchError::from_display)?;
        let field = built.field.clone();
        let mut method = built.method(name, iteration).map_err(BenchError::from_display)?;
        let most = context.options.max_iters.unwrap_or(600);
        let image = match iteration {
            Iteration::Fast { both: false } => Some(Cycle::PLAIN),
            Iteration::Anderson { both: false, relaxation, .. } => Some(Cycle { relaxation, ..Cycle::PLAIN }),
            _ => None,
        };
        let course = course(scene.name, name, &mut *method, image, most)?;
        let quality = scene.truth.as_ref().map(|truth| psnr(&field.image(method.x()), truth));
        let last = course.points.last().map_or((0, f64::NAN), |p| (p.iteration, p.combined));
        context.tell(&format!("{name}: {} iterations, residual {:.1e}", last.0, last.1));
        let cell = |level: &f64| match course.reached(Residual::Combined, *level) {
            Some(p) if p.rejected > 0 => format!("{} ({} refused)", p.iteration, p.rejected),
            Some(p) => p.iteration.to_string(),
            None => "-".to_string(),
        };
        let nanoseconds = format!("{:.0}", 1e9 * course.median() / (w * h) as f64);
        let quality = quality.map_or("-".to_string(), |db| format!("{db:.2}"));
        let end = [nanoseconds, quality, elsewhere.to_string()];
        table.row([name.to_string()].into_iter().chain(LEVELS.iter().map(cell)).chain(end));
        courses.push(course);
    }
    let _ = writeln!(context.text, "{table}");
    let shown: Vec<&Course> = courses.iter().filter(|course| !course.method.contains("rho")).collect();
    let panels =
        [panel("iterations", &shown, Residual::Combined, false), panel("time", &shown, Residual::Combined, true)];
    context.plot(scene.name, "deconvolution", &panels)?;
    context.csv = Some(csv(&courses, &LEVELS));
    Ok(())
}

/// `imaging/camera-snake15.npy` (blurred and noisy, float64) or `imaging/camera.png` (sharp) of the data; else a chart.
fn scene(quick: bool) -> Result<Scene, BenchError> {
    let read = |path: PathBuf| -> Result<Option<Image>, BenchError> {
        if quick || !path.exists() {
            return Ok(None);
        }
        Ok(Some(read_image(&path).map_err(BenchError::from_display)?.image))
    };
    let folder = std::env::var_os("PROXEL_DATA").map(|root| PathBuf::from(root).join("imaging")).unwrap_or_default();
    let psf = match read(folder.join("snake15.txt"))? {
        Some(k) => Psf::new(k.width, k.height, k.channels.concat(), None).map_err(BenchError::from_display)?,
        None => Psf::motion(13.0, 35.0).map_err(BenchError::from_display)?,
    };
    let kernel = if psf.width == 15 { "snake15.txt" } else { "motion:13,35" };
    let sharp = read(folder.join("camera.png"))?;
    if let Some(seen) = read(folder.join("camera-snake15.npy"))? {
        let truth = sharp.map(|image| image.channels);
        let source = "Data: camera-snake15.npy, blurred by snake15.txt.".to_string();
        return Ok(Scene { name: "camera", truth, seen, psf, source });
    }
    let (name, sharp) = match sharp {
        Some(image) => ("camera", image),
        None => ("chart", chart(if quick { 96 } else { 512 })?),
    };
    let source = match name {
        "camera" => format!(
            "Data: camera.png, blurred here by {kernel}, with noise of our own: counts differ a little from those elsewhere."
        ),
        _ => format!(
            "Data: none; a generated chart, blurred by {kernel}. Set PROXEL_DATA to the folder that holds `imaging/` with scikit-image's \
             camera.png: counts elsewhere are of that."
        ),
    };
    let field = Field::new(sharp.width, sharp.height, 1, &psf, Edges::Periodic).map_err(BenchError::from_display)?;
    let grid = Grid::new(sharp.width, sharp.height);
    let mut blurred = vec![0.0; grid.len()];
    field.blur.apply(grid, false, &sharp.channels[0], &mut blurred);
    let mut random = SplitMix::new(1);
    blurred.iter_mut().for_each(|v| *v += NOISE * random.normal());
    let seen = Image::new(sharp.width, sharp.height, vec![blurred]).map_err(BenchError::from_display)?;
    Ok(Scene { name, truth: Some(sharp.channels), seen, psf, source })
}

/// Rings whose period falls towards the border, a staircase of greys, and bars at three slopes, n x n pixels.
///
/// # Errors
/// n = 0.
pub fn chart(n: usize) -> Result<Image, BenchError> {
    let value = |i: usize, j: usize| -> f64 {
        let (y, x) = (i as f64 / n as f64 - 0.5, j as f64 / n as f64 - 0.5);
        let r = y.hypot(x);
        match () {
            () if r < 0.3 => 0.5 + 0.4 * (120.0 * r * r).cos().signum(),
            () if y > 0.35 => (8.0 * (x + 0.5)).floor() / 8.0,
            () if y < -0.35 => 0.2 + 0.6 * f64::from(u8::from((40.0 * (x + 0.4 * y)).sin() > 0.0)),
            () => 0.5 + 0.3 * x,
        }
    };
    let pixels = (0..n * n).map(|k| value(k / n, k % n)).collect();
    Image::new(n, n, vec![pixels]).map_err(BenchError::from_display)
}

/// Steps until the combined residual A(11) is below the last level; those that were refused count, since each is a pass. A
/// first half-iteration from z = u = 0, whose x is 0, is not counted: elsewhere iterations begin with x.
///
/// Where v is accelerated, which `image` has the cycle of, the residual is that of its image: a v that was proposed has a z by
/// the prox, which the one that rides along with it is not.
fn course(
    problem: &str,
    name: &str,
    method: &mut dyn Method,
    image: Option<Cycle>,
    most: usize,
) -> Result<Course, BenchError> {
    let n = method.problem().local_dim();
    let mut points: Vec<Point> = Vec::new();
    let (mut seconds, mut rejected) = (0.0, 0);
    for iteration in 0..=most {
        let began = Instant::now();
        let report = method.step().map_err(BenchError::from_display)?;
        seconds += began.elapsed().as_secs_f64();
        rejected += report.trial.rejected;
        let (local, iteration) = match &image {
            Some(cycle) => (local_of_image(method, cycle).unwrap_or(report.local), iteration + 1 + rejected),
            None if iteration == 0 => continue,
            None => (report.local, iteration + rejected),
        };
        let combined = normalized(local.combined(), n, 1.0);
        let (forward, position) = (f64::INFINITY, f64::INFINITY);
        points.push(Point { iteration, seconds, combined, rejected, forward, position, violation: 0.0 });
        if combined < LEVELS[LEVELS.len() - 1] {
            break;
        }
    }
    Ok(Course { problem: problem.to_string(), method: name.to_string(), points, x: method.x().to_vec() })
}

/// The local step that would follow, on copies.
fn local_of_image(method: &mut dyn Method, cycle: &Cycle) -> Option<LocalReport> {
    let at = method.splitting()?;
    let (mut p, mut u, mut grad) = (at.p.to_vec(), at.u.to_vec(), vec![0.0; at.x.len()]);
    let mut report = LocalReport::default();
    for ((term, p), u) in at.problem.terms.iter_mut().zip(&mut p).zip(&mut u) {
        report += term.cycle_step(cycle, at.x, p, u, &mut grad);
    }
    Some(report)
}
