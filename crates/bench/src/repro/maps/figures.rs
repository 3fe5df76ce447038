//! Figures 3, 5, 9, 10 and 11 of the WRAPD paper.

use super::{Target, curves, settings};
use crate::BenchError;
use crate::maps::{MapRun, Phase};
use crate::plot::{Axis, Line, Panel};
use crate::repro::context::Context;
use crate::table::{Table, seconds};
use proxel::mesh::Mesh;
use proxel::preview::{Camera, UvPicture, draw_checkerboard, draw_uv_map, stretches};
use proxel::settings::{UnwrapMethod, UnwrapSettings};
use std::fmt::Write as _;

/// The plots go on to this relative error.
const SHOWN: f64 = 1e-8;

/// Pixels of the pictures.
const MAP: [usize; 2] = [640, 640];
const SURFACE: [usize; 2] = [1000, 500];

/// Figure 11: energy, energy error and phases of the paper's methods and `auto`, the map and the textured surface.
pub fn figure11(context: &mut Context<'_>) -> Result<(), BenchError> {
    use UnwrapMethod::{Akvf, Auto, Bcqn, Cm, Slim, Wrapd, WrapdCm};
    for name in context.models.clone() {
        let target = Target::load(context, &name)?;
        let mut runs = Vec::new();
        for method in [Wrapd, WrapdCm, Cm, Slim, Akvf, Bcqn, Auto] {
            runs.push(target.run(context, method.as_str(), &settings(context, method), SHOWN)?);
        }
        let panels = [
            curves::energy("Energy", &runs, target.least),
            curves::error("Energy error", &runs, target.least),
            curves::phases("From the early to the late phase", &runs, target.least),
        ];
        let _ = writeln!(
            context.text,
            "## {name}\n\n{} Dashed while triangles are flipped, where the energy is that of the local variable; a mark where that \
             ends for good.\n",
            target.about
        );
        context.plot(&name, &name, &panels)?;
        if let Some(run) = runs.last() {
            pictures(context, &target.mesh, run)?;
        }
    }
    Ok(())
}

/// Figure 3: how long the global step goes on.
pub fn figure3(context: &mut Context<'_>) -> Result<(), BenchError> {
    let _ = writeln!(
        context.text,
        "The global step ends after a step that, to first order, gains less than kappa times what the local step has gained. A \
         kappa close to 0 solves it precisely, a large one takes a single step. The paper's is 2.\n"
    );
    let kappas: &[f64] = if context.options.quick { &[2.0, 1e-3] } else { &[2.0, 1e6, 0.1, 1e-3, 1e-6] };
    let vary = |base: &UnwrapSettings, kappa: f64| {
        let mut settings = base.clone();
        settings.admm.kappa = kappa;
        settings
    };
    sweep(context, UnwrapMethod::Wrapd, kappas, "kappa", &vary, true)
}

/// Figure 5: with and without rotation awareness and reweighting.
pub fn figure5(context: &mut Context<'_>) -> Result<(), BenchError> {
    use UnwrapMethod::{AdmmPd, RAdmm, WAdmm, Wrapd};
    for name in context.models.clone() {
        let target = Target::load(context, &name)?;
        let mut runs = Vec::new();
        for method in [AdmmPd, WAdmm, RAdmm, Wrapd] {
            runs.push(target.run(context, method.as_str(), &settings(context, method), SHOWN)?);
        }
        let _ = writeln!(context.text, "## {name}\n\n{}\n\n{}", target.about, table(&runs, target.least));
        let panels =
            [curves::energy("Energy", &runs, target.least), curves::error("Energy error", &runs, target.least)];
        context.plot(&name, &name, &panels)?;
        if let Some(run) = runs.last() {
            pictures(context, &target.mesh, run)?;
        }
    }
    Ok(())
}

/// Figure 9: seconds a vertex of the early and the late phase, as histograms over all surfaces.
pub fn figure9(context: &mut Context<'_>) -> Result<(), BenchError> {
    use UnwrapMethod::{Akvf, Auto, Cm, Slim, Wrapd, WrapdCm};
    const METHODS: [UnwrapMethod; 6] = [Auto, Wrapd, WrapdCm, Cm, Slim, Akvf];
    const PHASES: [Phase; 2] = [Phase::EarlyDual, Phase::Late];
    let mut times: [[Vec<f64>; 6]; 2] = Default::default();
    let mut disks = disks(context)?;
    for name in context.models.clone() {
        disks.push(crate::maps::load(&name)?);
    }
    let count = disks.len();
    let mut skipped = 0;
    for mesh in disks {
        let vertices = mesh.n_verts() as f64;
        let Some(target) = converged(context, mesh)? else {
            skipped += 1;
            continue;
        };
        for (k, method) in METHODS.into_iter().enumerate() {
            let run = target.run(context, method.as_str(), &settings(context, method), crate::maps::LATE)?;
            for (all, phase) in times.iter_mut().zip(PHASES) {
                let time = run.reached(phase, target.least).map_or(f64::INFINITY, |row| row.seconds / vertices);
                all[k].push(time);
            }
        }
    }
    let _ = writeln!(
        context.text,
        "{count} surfaces: those of `parameterization/` and random disks; {skipped} whose least energy was not found left out. \
         Microseconds a vertex, median (part of the surfaces on which the phase was reached).\n"
    );
    let mut table = Table::new(["method", "early", "late"]);
    for (k, method) in METHODS.iter().enumerate() {
        let cell = |times: &Vec<f64>| {
            let mut sorted = times.clone();
            sorted.sort_by(f64::total_cmp);
            let reached = sorted.iter().filter(|t| t.is_finite()).count();
            let median = sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN);
            format!("{} ({:.0} %)", seconds(1e6 * median), 100.0 * reached as f64 / sorted.len().max(1) as f64)
        };
        table.row([method.as_str().to_string(), cell(&times[0][k]), cell(&times[1][k])]);
    }
    let _ = writeln!(context.text, "{table}");
    let panels: Vec<Panel> =
        PHASES.iter().zip(&times).map(|(phase, times)| histogram(&phase.to_string(), &METHODS, times)).collect();
    context.plot("", "Seconds a vertex", &panels)
}

/// Disks besides the surfaces that are found.
fn disks(context: &mut Context<'_>) -> Result<Vec<Mesh>, BenchError> {
    let wanted = context.options.count.unwrap_or(if context.options.quick { 4 } else { 100 });
    let sources = crate::disks::sources(crate::maps::folder("surfaces").as_deref())?;
    Ok((0..).filter_map(|seed| crate::disks::disk(seed, &sources).ok()).take(wanted).map(|d| d.mesh).collect())
}

/// A surface with its least energy, where `auto` finds it.
fn converged(context: &mut Context<'_>, mesh: Mesh) -> Result<Option<Target>, BenchError> {
    let settings = UnwrapSettings { tol: 1e-10, ..settings(context, UnwrapMethod::Auto) };
    let run = crate::maps::run(&mesh, "auto", &settings, 0.0, 1)?;
    let good = run.end.status == proxel::split::Status::Converged;
    let least = run.rows.iter().filter(|r| r.flips == 0).map(|r| r.energy).fold(f64::INFINITY, f64::min);
    Ok(good.then(|| Target { mesh, least, about: String::new() }))
}

/// Shares of the surfaces over classes of time a vertex, five to a decade.
fn histogram(title: &str, methods: &[UnwrapMethod], times: &[Vec<f64>]) -> Panel {
    const CLASSES: f64 = 5.0;
    let class = |t: f64| (CLASSES * t.log10()).floor() as i64;
    let finite = || times.iter().flatten().copied().filter(|t| t.is_finite() && *t > 0.0);
    let (low, high) = finite().map(class).fold((i64::MAX, i64::MIN), |(a, b), c| (a.min(c), b.max(c)));
    let edge = |c: i64| 10f64.powf(c as f64 / CLASSES);
    let of = |(style, (method, times)): (usize, (&UnwrapMethod, &Vec<f64>))| {
        let mut points = Vec::new();
        for c in low..=high.max(low) {
            let part =
                times.iter().filter(|t| t.is_finite() && class(**t) == c).count() as f64 / times.len().max(1) as f64;
            points.extend([(edge(c), part), (edge(c + 1), part)]);
        }
        Line { label: method.as_str().to_string(), points, style, marked: false }
    };
    let lines: Vec<Line> =
        if low <= high { methods.iter().zip(times).enumerate().map(of).collect() } else { Vec::new() };
    let most = lines.iter().flat_map(|l| &l.points).map(|p| p.1).fold(0.1, f64::max);
    Panel {
        title: title.to_string(),
        x_label: "seconds a vertex".to_string(),
        y_label: "part of the surfaces".to_string(),
        x: Axis::log_around(lines.iter().flat_map(|l| &l.points).map(|p| p.0)),
        y: Axis::linear(0.0, 1.1 * most),
        lines,
        map: None,
    }
}

/// Runs of a method at some values of a setting.
fn sweep(
    context: &mut Context<'_>,
    method: UnwrapMethod,
    values: &[f64],
    what: &str,
    vary: &dyn Fn(&UnwrapSettings, f64) -> UnwrapSettings,
    inner: bool,
) -> Result<(), BenchError> {
    for name in context.models.clone() {
        let target = Target::load(context, &name)?;
        let mut runs = Vec::new();
        for value in values {
            let settings = vary(&settings(context, method), *value);
            runs.push(target.run(context, &format!("{} {what}={value:e}", method.as_str()), &settings, SHOWN)?);
        }
        let _ = writeln!(context.text, "## {name}\n\n{}\n\n{}", target.about, table(&runs, target.least));
        let mut panels = vec![curves::error("Energy error", &runs, target.least)];
        if inner {
            panels.push(curves::inner("Work of the global step", &runs));
        }
        context.plot(&name, &name, &panels)?;
    }
    Ok(())
}

/// What runs needed for the phases.
fn table(runs: &[MapRun], least: f64) -> Table {
    let mut table =
        Table::new(["method", "eta (tau) by energy_z", "eta (tau)", "N_c (t_c)", "inner steps an iteration"]);
    for run in runs {
        let inner: usize = run.rows.iter().map(|r| r.inner).sum();
        let iterations = run.rows.last().map_or(0, |r| r.iteration).max(1);
        let mut row = vec![run.method.clone()];
        row.extend(Phase::ALL.map(|phase| super::cost(run, phase, least)));
        row.push(format!("{:.2}", inner as f64 / iterations as f64));
        table.row(row);
    }
    table
}

/// The map of a run coloured by distortion, and a checkerboard on the surface.
fn pictures(context: &mut Context<'_>, mesh: &Mesh, run: &MapRun) -> Result<(), BenchError> {
    let triangles = mesh.faces.fan_triangles();
    let uv = corners(mesh, run);
    let stretch = stretches(&mesh.points, &triangles, &uv);
    let map = draw_uv_map(
        &UvPicture { triangles: &triangles, uv: &uv, stretch: &stretch, unit_square: false },
        MAP[0],
        MAP[1],
    );
    let surface = draw_checkerboard(&mesh.points, &triangles, &uv, &Camera::default(), SURFACE[0], SURFACE[1]);
    for (image, what) in [(&map, "map"), (&surface, "surface")] {
        let file = context.file(&format!("{}-{what}.png", mesh.name));
        image.write_png(&context.options.out.join(&file)).map_err(BenchError::from_display)?;
        let _ = writeln!(context.text, "![{} by {}: {what}]({file})\n", mesh.name, run.method);
    }
    Ok(())
}

/// The map at the corners of each triangle of the fans.
fn corners(mesh: &Mesh, run: &MapRun) -> Vec<[[f64; 2]; 3]> {
    let mut all = Vec::new();
    let mut first = 0;
    for face in mesh.faces.iter() {
        let at = |k: usize| run.end.uv.at(first + k).unwrap_or([f64::NAN; 2]);
        all.extend((1..face.len().saturating_sub(1)).map(|k| [at(0), at(k), at(k + 1)]));
        first += face.len();
    }
    all
}
