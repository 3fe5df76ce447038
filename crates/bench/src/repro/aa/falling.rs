//! Figures 5 and 6: a horse falls into a pit, and among cylinders.

use super::course::Course;
use super::figure4::COUNTING;
use super::step::{Step, Way};
use super::step_report::{LEVELS, panels, position_panel, positions, residuals};
use super::{csv, most};
use crate::BenchError;
use crate::motion::{self, Ended, Find, Moving, Scene, Splitting};
use crate::repro::context::Context;
use crate::table::{Table, seconds};
use proxel::mesh::topology::surface;
use proxel::preview::{Camera, Model, Style, render};
use proxel::simulate::{BodyState, Hooks};
use std::fmt::Write as _;

/// Iterations of a run.
const MOST: usize = 1500;
/// What the residual is told after, as it was measured.
const AFTER: usize = 200;
/// Frames of the simulation from the start.
const WHOLE: usize = 60;
/// Accepted iterations of Algorithm 4, m = 6, whose time the pictures are taken at.
const PICTURE_AT: usize = 50;
/// A depth that is drawn as bright as can be, in mean edges.
const BRIGHT: f64 = 0.1;

/// What differs between the two figures.
struct Figure {
    find: fn() -> Result<Find, BenchError>,
    /// Frames that are looked at, counted from 1, iterations of Algorithm 4, m = 6, for each of the frames before, and names.
    /// Of frames that the authors' implementation was measured on for 200 iterations it is not known how those before were
    /// solved.
    frames: &'static [(usize, usize, &'static str)],
    what: &'static str,
    camera: Camera,
}

/// Figure 5.
///
/// # Errors
/// A mesh that cannot be read, a file that cannot be written.
pub fn figure5(context: &mut Context<'_>) -> Result<(), BenchError> {
    run(
        context,
        &Figure {
            find: motion::pit,
            frames: &[(30, 60, "pit"), (34, 13, "pit frame 34")],
            what: "It falls from 5.5 m on the ground at y = -3 m, with a bowl of radius 1 m around (0, -3, 0) in it.",
            camera: Camera { toward_eye: [0.35, 0.75, 1.0], ..Camera::default() },
        },
    )
}

/// Figure 6.
///
/// # Errors
/// A mesh that cannot be read, a file that cannot be written.
pub fn figure6(context: &mut Context<'_>) -> Result<(), BenchError> {
    run(
        context,
        &Figure {
            find: motion::cylinders,
            frames: &[(20, 60, "cylinders"), (30, 60, "cylinders frame 30"), (22, 13, "cylinders frame 22")],
            what: "It falls among 23 endless cylinders of radius 0.4 m, in rows 1.5 m apart, on a slope of 30 degrees.",
            camera: Camera { toward_eye: [0.35, 0.3, 1.0], ..Camera::default() },
        },
    )
}

fn run(context: &mut Context<'_>, figure: &Figure) -> Result<(), BenchError> {
    let Find { body, source, .. } = (figure.find)()?;
    let _ = writeln!(
        context.text,
        "{source}\n\n## The problem\n\nA body of {} tetrahedra, 1522 kg/m^3, corotated, E = 1e7, nu = 0.499; w^2 = k V with the bulk modulus k. \
         {} Every vertex is split off for contact, with w^2 = 2 k of soft rubber, nu = 0.399; no friction. dt = 1/30 s. Frames \
         before the one that is looked at are solved by Algorithm 4 with m = 6, in as many iterations as is told. {COUNTING}\n\nauto and \
         newton are those of `simulate`, on the same step: Newton's method on an augmented Lagrangian of contact. They split \
         nothing and have no such residual; what all methods can be compared by is the position error, the largest distance of a vertex \
         from the lower one of the ends that auto and newton converge to at a tolerance of 1e-10, in mean edges. A step has several minima: an \
         error that does not vanish may tell of another one, and the objective tells which is lower. Violation: depth in an obstacle, in \
         metres. Seconds include no set-up of the splittings, and all of auto's and newton's.\n",
        body.mesh.tets.len(),
        figure.what
    );
    let a = body.mean_edge();
    let mut moving = Moving::new(body)?;
    let scene = Scene::new(&moving, &context.options.out, &context.file("horse"))?;
    let frames = if context.options.quick { &figure.frames[..1] } else { figure.frames };
    let mut courses = Vec::new();
    let mut solved_by = None;
    for (frame, before, problem) in frames {
        if solved_by.is_some_and(|by| by != before) {
            moving = Moving::new(moving.body)?;
        }
        solved_by = Some(before);
        while moving.frames() + 1 < *frame {
            moving.advance(*before)?;
        }
        let _ = writeln!(context.text, "## Frame {frame}\n\nEach frame before in {before} iterations.\n");
        courses.extend(step(context, figure, &scene, &moving, (*frame, problem), a)?);
    }
    whole(context, &scene, &moving)?;
    context.csv = Some(csv(&courses, &LEVELS));
    Ok(())
}

/// All methods on a frame.
fn step(
    context: &mut Context<'_>,
    figure: &Figure,
    scene: &Scene,
    moving: &Moving,
    (frame, problem): (usize, &str),
    a: f64,
) -> Result<Vec<Course>, BenchError> {
    let n = most(context, MOST);
    // A step at an impact has many minima: positions are compared with the lowest one that was found.
    let mut exact: Option<(f64, Ended)> = None;
    for method in ["auto", "newton"] {
        let end = scene.step(moving, method, EXACT, context.options.threads)?;
        context.tell(&format!("{problem}: its solution by {method}: {} ({})", end.record.status, end.record.reason));
        let objective = moving.objective(&end.x)?;
        let lower = exact.as_ref().is_none_or(|(least, _)| objective < *least);
        if end.record.status == "converged" && lower {
            exact = Some((objective, end));
        }
    }
    let solution = match &exact {
        Some((objective, _)) => format!("The objective of the solution is {objective:.9e} J."),
        None => "Neither auto nor newton converged, so that there is nothing to compare positions with.".to_string(),
    };
    let step = Step { problem: problem.to_string(), moving, a, exact: exact.map(|(_, end)| end.x) };
    let mut courses = Vec::new();
    for way in Way::all() {
        courses.push(step.course(context, &way, n, 1e-10)?);
    }
    let wrapd = Way::polar("wrapd", Splitting::PolarReweighted);
    courses.push(step.course(context, &wrapd, n, 1e-10)?);
    for method in ["auto", "newton"] {
        courses.push(step.simulated(context, scene, method, (EXACT.0, 1e-9))?);
    }
    let all: Vec<&Course> = courses.iter().collect();
    let _ = writeln!(
        context.text,
        "Forward residuals.\n\n{}\nPositions. {solution}\n\n{}\n{}\n",
        residuals(&all, &[10.0, 1.0, 0.1, 1e-2, 1e-3, 1e-6], AFTER.min(n)),
        positions(moving, &all)?,
        at_equal_time(&all)
    );
    let shown: Vec<&Course> = all.iter().copied().filter(|c| SHOWN.contains(&c.method.as_str())).collect();
    let mut panels = panels(&format!("frame {frame}"), &shown);
    let mut by_position = position_panel(&format!("frame {frame}"), &shown);
    let place = |label: &str| SHOWN.iter().position(|name| *name == label).unwrap_or(0);
    for panel in panels.iter_mut().chain([&mut by_position]) {
        panel.lines.iter_mut().for_each(|line| line.style = place(&line.label));
    }
    if step.exact.is_some() {
        panels.push(by_position);
    }
    context.plot(&format!("frame-{frame}"), problem, &panels)?;
    pictures(context, figure, scene, &step, frame, &all)?;
    Ok(courses)
}

/// Most iterations and tolerance of what positions are compared with.
const EXACT: (usize, f64) = (2000, 1e-10);

/// Methods of the plots.
const SHOWN: [&str; 7] = ["admm", "aa-admm-4 m=3", "aa-admm-4 m=6", "over-relaxation 1.6", "aadr m=6", "wrapd", "auto"];

/// Where plain ADMM and Algorithm 4 are when auto has ended.
fn at_equal_time(courses: &[&Course]) -> String {
    let find = |name: &str| courses.iter().find(|c| c.method == name);
    let Some(end) = find("auto").and_then(|c| c.points.last()).filter(|p| p.position.is_finite()) else {
        return String::new();
    };
    let then = |name: &str| {
        let p = find(name).and_then(|c| c.points.iter().rfind(|p| p.seconds <= end.seconds));
        p.map_or("before its first iteration".to_string(), |p| {
            format!("a position error of {:.1e} after {} iterations", p.position, p.iteration)
        })
    };
    format!(
        "When auto ends, after {} s, with a position error of {:.1e}, plain ADMM has {} and Algorithm 4 with m = 6 {}.",
        seconds(end.seconds),
        end.position,
        then("admm"),
        then("aa-admm-4 m=6")
    )
}

/// Plain ADMM, Algorithm 4 and auto after the same time.
fn pictures(
    context: &mut Context<'_>,
    figure: &Figure,
    scene: &Scene,
    step: &Step<'_>,
    frame: usize,
    courses: &[&Course],
) -> Result<(), BenchError> {
    const SIZE: [usize; 2] = [480, 460];
    let find = |name: &str| courses.iter().find(|c| c.method == name);
    let time = find("aa-admm-4 m=6")
        .and_then(|c| c.points.iter().rfind(|p| p.iteration <= PICTURE_AT))
        .map_or(0.0, |p| p.seconds);
    let triangles = surface(&step.moving.body.mesh).fan_triangles();
    let obstacles = scene.simulation("auto", 1, 1e-9, context.options.threads)?.scenery();
    let mut table = Table::new(["method", "iterations", "seconds", "position error", "deepest vertex, m"]);
    let mut scenes = Vec::new();
    for way in [Some(Way::plain("admm", 1.0)), Some(Way::four(6)), None] {
        let name = way.as_ref().map_or("auto", |way| &way.name);
        let Some(course) = find(name) else { continue };
        // The iteration that was under way then is completed where none was done.
        let Some(point) = course.points.iter().rfind(|p| p.seconds <= time).or(course.points.first()) else { continue };
        let x = match &way {
            Some(way) => way.after(step.moving, point.iteration)?,
            None => scene.step(step.moving, name, (point.iteration, 1e-9), context.options.threads)?.x,
        };
        let depths = step.moving.depths(&x);
        let shades: Vec<f64> =
            step.moving.of_vertices(&depths).iter().map(|d| (d / (BRIGHT * step.a)).min(1.0)).collect();
        let body = Model::new(step.moving.vertices(&x), triangles.clone()).colored_by(&shades);
        let mut models = obstacles.clone();
        models.push(body);
        scenes.push(proxel::preview::Scene { models });
        table.row([
            name.to_string(),
            point.iteration.to_string(),
            seconds(point.seconds),
            format!("{:.1e}", point.position),
            format!("{:.1e}", depths.iter().fold(0.0_f64, |m, d| m.max(*d))),
        ]);
    }
    let image = render(&scenes, &figure.camera, &Style::default(), SIZE[0] * scenes.len(), SIZE[1]);
    let file = context.file(&format!("frame-{frame}.png"));
    image.write_png(&context.options.out.join(&file)).map_err(BenchError::from_display)?;
    let _ = writeln!(
        context.text,
        "After {} s, the time of {PICTURE_AT} iterations of Algorithm 4 with m = 6; from the left as in the table. Colours: depth of \
         vertices in an obstacle, {:.4} m as bright as can be.\n\n![Frame {frame} at equal time]({file})\n\n{table}",
        seconds(time),
        BRIGHT * step.a
    );
    Ok(())
}

/// The whole simulation by auto, from the start.
fn whole(context: &mut Context<'_>, scene: &Scene, moving: &Moving) -> Result<(), BenchError> {
    let frames = if context.options.quick { 24 } else { WHOLE };
    let mut simulation = scene.simulation("auto", 2000, 1e-9, context.options.threads)?;
    let positions = moving.body.mesh.points.clone();
    let state = BodyState { velocities: vec![[0.0; 3]; positions.len()], positions };
    simulation.place(0, &[state]).map_err(BenchError::from_display)?;
    let size = moving.body.size();
    let (mut converged, mut deepest, mut gradient, mut touching) = (0, 0.0_f64, 0.0_f64, 0);
    let (mut iterations, mut took, mut longest, mut stopped) = (0, 0.0, 0.0_f64, Vec::new());
    for _ in 0..frames {
        let record = simulation.advance(&mut Hooks::default()).map_err(BenchError::from_display)?;
        if record.status == "converged" {
            converged += 1;
        } else {
            stopped.push(format!("frame {}: {} ({})", record.frame, record.status, record.reason));
        }
        deepest = deepest.max(record.max_penetration / size);
        let ratio = record.gradient_off_contact.unwrap_or(f64::INFINITY) / record.gradient_bound;
        gradient = gradient.max(ratio);
        touching = touching.max(record.contacts);
        iterations += record.iterations;
        took += record.seconds;
        longest = longest.max(record.seconds);
        context.tell(&format!(
            "whole: frame {}: {}, {} iterations, {} contacts, deepest {:.1e}",
            record.frame, record.status, record.iterations, record.contacts, record.max_penetration
        ));
    }
    let _ = writeln!(
        context.text,
        "## All frames by auto\n\n{frames} frames from the start, tolerance 1e-9: {converged} converged. The deepest vertex after any \
         of them is {deepest:.1e} of the body's size inside of an obstacle; the gradient over vertices that touch nothing is at most {gradient:.2} of \
         what convergence asks of all. At most {touching} vertices press on something. {iterations} iterations, {} s, the longest frame {} s.\n\n{}",
        seconds(took),
        seconds(longest),
        stopped.iter().map(|s| format!("- {s}\n")).collect::<String>()
    );
    Ok(())
}
