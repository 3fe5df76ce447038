//! Figure 8: a square of cloth with hard strain limits.

use super::context::{Context, position_panel};
use super::variants::Variant;
use crate::BenchError;
use crate::data::Model;
use crate::runs::{LEVELS, Level, Run};
use crate::table::{Table, cost, seconds};
use proxel::deform::{DeformInput, Deformation, Hooks, deform};
use proxel::preview::{Camera, Model as Shape, Scene, Style, render};
use proxel::samples::{Sample, cloth};
use proxel::settings::{DeformSettings, MethodName};
use std::fmt::Write as _;

/// Squares along a side of the cloth: about the density of the paper's picture.
const CELLS: usize = 64;

/// Position errors of WRAPD whose times the pictures are taken at.
const PICTURES: [f64; 3] = [0.3, 0.1, 0.01];

/// Size of a picture of one state.
const PICTURE: [usize; 2] = [480, 420];

pub(super) fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let cells = if context.options.quick { 12 } else { CELLS };
    let Sample { input, settings, .. } = cloth(cells).map_err(BenchError::from_display)?;
    context.tell("cloth: its solution");
    let exact = DeformSettings { tol: 1e-11, max_iters: 50_000, ..settings.clone() };
    let end = deform(&input, &exact, &mut Hooks::default()).map_err(BenchError::from_display)?;
    if end.report.status != "converged" {
        return Err(BenchError(format!("the cloth's reference did not converge: {}", end.report.reason)));
    }
    let least_energy =
        end.report.energy.ok_or_else(|| BenchError("the cloth's reference has no energy".to_string()))?;
    let number = |v: Option<f64>| v.unwrap_or(f64::NAN);
    let _ = writeln!(
        context.text,
        "## The problem\n\nA square of cloth of {cells} x {cells} cells ({} triangles), {} N/m stiff (ARAP), {:e} N m against bending, \
         {} kg/m^2 under gravity, its corners held closer together than they were; it starts in waves. Hard limits: stretches in \
         [0.95, 1.05]. X* is WRAPD's own result at residuals of 1e-11 ({} iterations), whose stretches are in \
         [{:.9}, {:.9}]. The minimum is one of several: which of them a method finds from a far start is not a matter of speed, so \
         that a position error that does not vanish tells that another one was found.\n",
        input.rest.faces.len(),
        settings.material.young,
        settings.bending,
        settings.density,
        end.report.iterations,
        number(end.report.min_stretch),
        number(end.report.max_stretch),
    );
    let model = Model {
        name: "cloth".to_string(),
        input: DeformInput { reference: Some(end.positions.clone()), ..input },
        read: 0.0,
    };
    let problem = (model, least_energy);
    let scales = match (context.options.weight_scales.as_slice(), context.options.quick) {
        ([], false) => vec![0.5, 1.0, 2.0, 4.0],
        ([], true) => vec![1.0],
        (given, _) => given.to_vec(),
    };
    let mut of = |variant: Variant| -> Result<(Run, DeformSettings), BenchError> {
        let all = DeformSettings { method: variant.settings.method, admm: variant.settings.admm, ..settings.clone() };
        Ok((context.run(&problem, &variant.name, all.clone())?, all))
    };
    let wrapd = of(Variant::of(MethodName::Wrapd))?;
    let admm_pd =
        scales.iter().map(|s| of(Variant::scaled(MethodName::AdmmPd, *s))).collect::<Result<Vec<_>, BenchError>>()?;

    let positions: Vec<Level> = LEVELS.iter().copied().filter(|level| matches!(level, Level::Position(_))).collect();
    let mut table = Table::new(["method".to_string()].into_iter().chain(positions.iter().map(Level::to_string)));
    for (run, _) in std::iter::once(&wrapd).chain(&admm_pd) {
        table.row([run.method.clone()].into_iter().chain(positions.iter().map(|level| cost(run, *level))));
    }
    let _ = writeln!(
        context.text,
        "## Position error against time\n\nIterations (seconds) to each position error; ADMM-PD with each multiplier of its squared \
         weights.\n\n{table}"
    );
    let lines: Vec<(&Run, usize)> =
        std::iter::once(&wrapd).chain(&admm_pd).enumerate().map(|(k, (run, _))| (run, k)).collect();
    context.plot("", "Cloth with hard strain limits", &[position_panel("Cloth", &lines)])?;

    // The multiplier with the least error when WRAPD is at the last picture.
    let last = time_at(&wrapd.0, PICTURES[PICTURES.len() - 1]);
    let error_then = |run: &Run| run.points.iter().rfind(|p| p.seconds <= last).map_or(1.0, |p| p.position_error);
    let rival = admm_pd.iter().min_by(|a, b| error_then(&a.0).total_cmp(&error_then(&b.0)));
    let Some(rival) = rival else { return Ok(()) };
    pictures(context, &problem.0, &wrapd, rival)
}

/// When a run is at a position error, or its end.
fn time_at(run: &Run, error: f64) -> f64 {
    run.reached(Level::Position(error)).map_or(run.last().seconds, |p| p.seconds)
}

/// Both methods at equal times, one above the other.
fn pictures(
    context: &mut Context<'_>,
    model: &Model,
    wrapd: &(Run, DeformSettings),
    rival: &(Run, DeformSettings),
) -> Result<(), BenchError> {
    let text = format!(
        "## Pictures at equal time\n\nThe start, then what a run that is stopped at the time returns; {} above, {} below. Colours: \
         distance from X*.\n\n![WRAPD at equal times]({})\n\n![ADMM-PD at equal times]({})\n\n",
        wrapd.0.method,
        rival.0.method,
        context.file("wrapd.png"),
        context.file("admm-pd.png")
    );
    let mut table =
        Table::new(["seconds", "wrapd: iterations", "position error", "admm-pd: iterations", "position error"]);
    let triangles = model.input.rest.faces.fan_triangles();
    let start = model.input.start.clone().unwrap_or_else(|| model.input.rest.points.clone());
    let reference = model.input.reference.clone().unwrap_or_else(|| start.clone());
    let pins: Vec<u32> = model.input.fixed.iter().map(|f| f.0).collect();
    let scene = |points: &[[f64; 3]]| {
        let far = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt();
        // A distance of a twentieth of the cloth's side is as bright as can be.
        let distances: Vec<f64> = points.iter().zip(&reference).map(|(a, b)| (20.0 * far(a, b)).min(1.0)).collect();
        let shape = Shape::new(points.to_vec(), triangles.clone()).colored_by(&distances).pinned(pins.iter().copied());
        Scene { models: vec![shape] }
    };
    let mut rows: [Vec<Scene>; 2] = [vec![scene(&start)], vec![scene(&start)]];
    for error in PICTURES {
        let time = time_at(&wrapd.0, error);
        let mut cells = vec![seconds(time)];
        for (row, (run, settings)) in rows.iter_mut().zip([wrapd, rival]) {
            let point = run.points.iter().rfind(|p| p.seconds <= time).copied().unwrap_or(run.last());
            let settings = DeformSettings { max_iters: point.iteration, tol: 1e-14, ..settings.clone() };
            let end: Deformation =
                deform(&model.input, &settings, &mut Hooks::default()).map_err(BenchError::from_display)?;
            row.push(scene(&end.positions));
            cells.extend([point.iteration.to_string(), format!("{:.1e}", point.position_error)]);
        }
        table.row(cells);
    }
    let scenes: Vec<Scene> = rows.into_iter().flatten().collect();
    let columns = PICTURES.len() + 1;
    for (row, name) in scenes.chunks(columns).zip(["wrapd", "admm-pd"]) {
        let image = render(row, &Camera::default(), &Style::default(), PICTURE[0] * columns, PICTURE[1]);
        let path = context.options.out.join(context.file(&format!("{name}.png")));
        image.write_png(&path).map_err(BenchError::from_display)?;
    }
    let _ = writeln!(context.text, "{text}{table}");
    Ok(())
}
