//! Figure 12: geodesic distances by the nearest integrable field, where acceleration saves iterations and costs time; beside
//! the sparse system that has the same minimum.

use super::course::{Course, Point, Residual};
use super::{csv, panel};
use crate::BenchError;
use crate::repro::context::Context;
use crate::table::{Table, seconds};
use proxel::geodesic::{Hooks, geodesic, gradient_problem};
use proxel::mesh::topology::boundary_surface;
use proxel::mesh::{Mesh, generate, read_mesh};
use proxel::preview::draw_distances;
use proxel::settings::{GeodesicMethod, GeodesicSettings, GradientForm};
use proxel::split::{Acceleration, Admm, AdmmSettings, Algorithm, Cycle, Direct, Method, Order, normalized};
use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Instant;

/// Files, problems and sources of the papers' codes.
const MODELS: [(&str, &str, u32); 3] =
    [("bunny_nf42k", "bunny", 9689), ("kitten_nf20k", "kitten", 0), ("eight_nf8k", "eight", 0)];

/// What was measured with the authors' code on the bunny, to 1e-3, 1e-4, 1e-5: plain, m = 6.
const THEIRS: [(&str, [usize; 3]); 2] = [("admm", [551, 911, 1390]), ("aa-admm-2 m=6", [243, 464, 764])];

const LEVELS: [f64; 5] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6];

/// A copy counts for three numbers there, for the two of its face's plane here.
const PER_COPY: f64 = 1.5;

/// A surface and its source.
struct Found {
    name: String,
    mesh: Mesh,
    vertex: u32,
}

/// See [`crate::repro::ALL`].
///
/// # Errors
/// A mesh that cannot be read, a file that cannot be written.
pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let (found, source) = surfaces(&context.models, context.options.quick)?;
    let settings = GeodesicSettings::default();
    let _ = writeln!(
        context.text,
        "{source}\n\n## The problem\n\nmin sum_f A_f |G_f - g_f|^2 such that e . G_f = e . G_f' along each edge; g from a heat step \
         of one squared mean edge, solved directly. Gradients of faces begin as in Ouyang et al.'s code, \
         whose copies are 0 at first; those along edges at g. z-x-u, mu = {}, areas in units of their mean; the bounding box has the diagonal 1. \
         Residual: the combined one, sqrt(mu sum A (|S G - Y|^2 + |S dG|^2) / N), N with three numbers a copy; theirs has the order \
         x-z-u and weighs the second part by A^2. After a slash: iterations of Ouyang et al.'s code, as measured.\n",
        settings.mu
    );
    let mut courses = Vec::new();
    let mut times = Table::new(["surface", "poisson", "admm to 1e-5", "aa-admm to 1e-5", "rms apart at the end"]);
    for Found { name, mesh, vertex } in found {
        let vertex = if (vertex as usize) < mesh.n_verts() { vertex } else { 0 };
        let mut of_mesh = Vec::new();
        for (method, form, window) in [
            ("admm", GradientForm::Faces, None),
            ("aa-admm-2 m=6", GradientForm::Faces, Some(6)),
            ("edges admm", GradientForm::Edges, None),
            ("edges aa-admm-2 m=6", GradientForm::Edges, Some(6)),
        ] {
            let settings = GeodesicSettings { form, ..settings.clone() };
            of_mesh.push(course(context, (&name, method), (&mesh, vertex, &settings), window)?);
        }
        let _ = writeln!(context.text, "## {name}\n\n{}", table(&of_mesh));
        let shown: Vec<&Course> = of_mesh.iter().collect();
        let panels =
            [panel("iterations", &shown, Residual::Combined, false), panel("time", &shown, Residual::Combined, true)];
        context.plot(&name, &name, &panels)?;
        compare(context, (&name, &mesh, vertex), &of_mesh, &mut times)?;
        courses.extend(of_mesh);
    }
    let _ = writeln!(
        context.text,
        "## Seconds\n\nThe sparse system with its analysis and factors and the heat step; iterations alone of the others. Where a \
         surface has handles the nearest integrable field need not be a gradient, and the two differ.\n\n{times}"
    );
    context.csv = Some(csv(&courses, &LEVELS));
    Ok(())
}

/// The surfaces of the data that are asked for, all if none is; a ball's skin where there are none, and in a hurry.
fn surfaces(wanted: &[String], quick: bool) -> Result<(Vec<Found>, String), BenchError> {
    let folder = std::env::var_os("PROXEL_DATA").map(|root| PathBuf::from(root).join("geodesic"));
    let folder = folder.filter(|_| !quick);
    let mut found = Vec::new();
    for (file, name, vertex) in MODELS {
        if !wanted.is_empty() && !wanted.iter().any(|w| w == name) {
            continue;
        }
        let path = folder.as_ref().map(|folder| folder.join(format!("{file}.obj")));
        if let Some(path) = path.filter(|path| path.exists()) {
            let mesh = read_mesh(&path).map_err(BenchError::from_display)?;
            found.push(Found { name: name.to_string(), mesh, vertex });
        }
    }
    if !found.is_empty() {
        let names: Vec<String> = found.iter().map(|f| f.name.clone()).collect();
        return Ok((found, format!("Data: {}.", names.join(", "))));
    }
    let ball = generate::ball(1.0, 0.12).map_err(BenchError::from_display)?;
    let skin = Mesh::from_triangles("ball", ball.points.clone(), &boundary_surface(&ball.tets));
    let vertex = skin.faces.get(0)[0];
    let source = "Data: none; the skin of a ball stands in. Set PROXEL_DATA to the folder that holds `geodesic/`.";
    Ok((vec![Found { name: "ball".to_string(), mesh: skin, vertex }], source.to_string()))
}

fn course(
    context: &mut Context<'_>,
    (problem, name): (&str, &str),
    (mesh, vertex, settings): (&Mesh, u32, &GeodesicSettings),
    window: Option<usize>,
) -> Result<Course, BenchError> {
    let parts = AdmmSettings { name: name.to_string(), global: Box::new(Direct), reweighting: None, renewed_at: None };
    let mut built = gradient_problem(mesh, &[vertex], settings).map_err(BenchError::from_display)?;
    if settings.form == GradientForm::Faces {
        // Their Y and dual begin at 0, so that the first x-update leaves next to nothing of g: w g / (w + 3), w = 2 / mu.
        let w = 2.0 / settings.mu;
        built.x0.iter_mut().for_each(|x| *x *= w / (w + 3.0));
    }
    let admm = Admm::new(built, parts).map_err(BenchError::from_display)?;
    let admm = admm.with_cycle(Cycle { order: Order::Zxu, ..Cycle::PLAIN }).map_err(BenchError::from_display)?;
    let mut method: Box<dyn Method> = match window {
        Some(m) => Acceleration::anderson(Algorithm::Two, m).of(admm).map_err(BenchError::from_display)?,
        None => Box::new(admm),
    };
    let a = if settings.form == GradientForm::Faces { PER_COPY.sqrt() } else { 1.0 };
    let (most, floor) = (context.options.max_iters.unwrap_or(3000), LEVELS[LEVELS.len() - 1]);
    let course = combined(problem, name, &mut *method, a, (most, floor))?;
    let last = course.points.last().map_or((0, f64::NAN), |p| (p.iteration, p.combined));
    context.tell(&format!("{problem}: {name}: {} iterations, residual {:.1e}", last.0, last.1));
    Ok(course)
}

/// Steps until the combined residual A(12) is below `floor`; what it takes to know that is no part of the time.
pub(super) fn combined(
    problem: &str,
    name: &str,
    method: &mut dyn Method,
    a: f64,
    (most, floor): (usize, f64),
) -> Result<Course, BenchError> {
    let n = method.problem().local_dim();
    let mut points: Vec<Point> = Vec::new();
    let (mut seconds, mut rejected) = (0.0, 0);
    for iteration in 1..=most {
        let began = Instant::now();
        let report = method.step().map_err(BenchError::from_display)?;
        seconds += began.elapsed().as_secs_f64();
        rejected += report.trial.rejected;
        let squares = method.squared_residuals();
        let of = |square: Option<f64>| square.map_or(f64::INFINITY, |square| normalized(square, n, a));
        let (forward, combined) = (of(squares.map(|s| s.forward)), of(squares.map(|s| s.combined)));
        points.push(Point { iteration, seconds, rejected, forward, combined, position: f64::INFINITY, violation: 0.0 });
        if combined <= floor {
            break;
        }
    }
    Ok(Course { problem: problem.to_string(), method: name.to_string(), points, x: method.x().to_vec() })
}

fn table(courses: &[Course]) -> Table {
    let levels = LEVELS.iter().map(|level| format!("{level:e}"));
    let mut table = Table::new(["method".to_string()].into_iter().chain(levels).chain(["ms an iteration".to_string()]));
    for course in courses {
        let theirs = THEIRS.iter().find(|(method, _)| course.problem == "bunny" && *method == course.method);
        let cell = |(k, level): (usize, &f64)| {
            let ours = course.reached(Residual::Combined, *level).map_or("-".to_string(), |p| match p.rejected {
                0 => p.iteration.to_string(),
                n => format!("{} (+{n})", p.iteration),
            });
            match theirs.and_then(|(_, counts)| counts.get(k.checked_sub(1)?)) {
                Some(count) => format!("{ours} / {count}"),
                None => ours,
            }
        };
        let cells = [course.method.clone()].into_iter().chain(LEVELS.iter().enumerate().map(cell));
        table.row(cells.chain([format!("{:.2}", 1e3 * course.median())]));
    }
    table
}

/// The distances of the sparse system and their picture, its time, and how far the splitting's are from them.
fn compare(
    context: &Context<'_>,
    (name, mesh, vertex): (&str, &Mesh, u32),
    courses: &[Course],
    times: &mut Table,
) -> Result<(), BenchError> {
    let of = |method| GeodesicSettings { method, tol: 1e-7, ..GeodesicSettings::default() };
    let began = Instant::now();
    let direct = geodesic(mesh, &[vertex], &of(GeodesicMethod::Poisson), &mut Hooks::default())
        .map_err(BenchError::from_display)?;
    let took = began.elapsed().as_secs_f64();
    let split = geodesic(mesh, &[vertex], &of(GeodesicMethod::AaAdmm), &mut Hooks::default())
        .map_err(BenchError::from_display)?;
    let pairs: Vec<f64> = direct
        .distance
        .iter()
        .zip(&split.distance)
        .filter(|(a, _)| a.is_finite())
        .map(|(a, b)| (a - b).powi(2))
        .collect();
    let farthest = direct.report.geodesic.map_or(1.0, |g| g.distance_max);
    let apart = (pairs.iter().sum::<f64>() / pairs.len().max(1) as f64).sqrt() / farthest;
    let reached = |method: &str| {
        let course = courses.iter().find(|c| c.method == method);
        course.and_then(|c| c.reached(Residual::Combined, 1e-5)).map_or("-".to_string(), |p| seconds(p.seconds))
    };
    times.row([name.to_string(), seconds(took), reached("admm"), reached("aa-admm-2 m=6"), format!("{apart:.1e}")]);
    let triangles = mesh.faces.fan_triangles();
    let picture = draw_distances(&mesh.points, &triangles, &direct.distance, 1440, 720);
    let path = context.options.out.join(context.file(&format!("{name}.png")));
    picture.write_png(&path).map_err(BenchError::from_display)
}
