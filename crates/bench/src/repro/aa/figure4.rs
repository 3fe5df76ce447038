//! Figure 4: a flag in the wind whose strains have hard limits.

use super::course::Course;
use super::step::{Step, Way};
use super::step_report::{self, LEVELS, panels, residuals};
use super::{csv, most};
use crate::BenchError;
use crate::motion::{self, Find, Moving, Scene, Splitting};
use crate::repro::context::Context;
use crate::table::{Table, seconds};
use proxel::preview::{Camera, Model, Style, render};
use proxel::split::{Acceleration, Algorithm};
use std::fmt::Write as _;

/// Frames that are looked at, counted from 1, and their names.
const FRAMES: [(usize, &str); 3] = [(5, "flag"), (15, "flag frame 15"), (30, "flag frame 30")];
/// Iterations of Algorithm 4, m = 6, for the frames before.
const BEFORE: usize = 60;
/// Iterations of a run, and of those that are to converge.
const MOST: usize = 300;
const LONG: usize = 3000;
/// Accepted iterations of Algorithm 4, m = 6, whose time the pictures are taken at.
const PICTURE_AT: usize = 100;
/// A violation that is drawn as bright as can be.
const BRIGHT: f64 = 0.1;

/// See [`crate::repro::ALL`].
///
/// # Errors
/// A mesh that cannot be read, a file that cannot be written.
pub fn run(context: &mut Context<'_>) -> Result<(), BenchError> {
    let Find { body, source, .. } = motion::flag()?;
    let _ = writeln!(
        context.text,
        "{source}\n\n## The problem\n\nA sheet of {} triangles, 1 kg/m^2, held at two corners, in wind of (25, 0, 5) m/s and under gravity. \
         Corotated triangles, E = 50, nu = 0.1, singular values of each deformation gradient within [0.95, 1.05]; w^2 = k A with the \
         bulk modulus k; dt = 1/30 s. Frames before the one that is looked at are solved by {BEFORE} iterations of Algorithm 4 with \
         m = 6. {COUNTING}\n",
        body.mesh.faces.len()
    );
    let a = body.mean_edge();
    let mut moving = Moving::new(body)?;
    let frames = if context.options.quick { &FRAMES[..1] } else { &FRAMES[..] };
    let (mut courses, mut text) = (Vec::new(), String::new());
    for (frame, problem) in frames {
        while moving.frames() + 1 < *frame {
            moving.advance(BEFORE)?;
        }
        let step = Step { problem: problem.to_string(), moving: &moving, a, exact: None };
        let n = most(context, MOST);
        let mut of_frame = Vec::new();
        for way in Way::all() {
            of_frame.push(step.course(context, &way, n, 1e-10)?);
        }
        let wrapd = Way::polar("wrapd", Splitting::PolarReweighted);
        of_frame.push(step.course(context, &wrapd, n, 1e-10)?);
        let all: Vec<&Course> = of_frame.iter().collect();
        let _ = writeln!(context.text, "## Frame {frame}\n\n{}", residuals(&all, &[1.0, 0.1, 1e-2, 1e-3, 1e-4], n));
        let shown: Vec<&Course> = all.iter().copied().filter(|c| SHOWN.contains(&c.method.as_str())).collect();
        let mut panels = panels(&format!("frame {frame}"), &shown);
        panels.push(violation_panel(&all));
        context.plot(&format!("frame-{frame}"), problem, &panels)?;
        pictures(context, &moving, *frame, &all)?;
        if *frame == FRAMES[0].0 {
            text = converging(context, &step)?;
        }
        courses.extend(of_frame);
    }
    let _ = writeln!(context.text, "{text}");
    context.csv = Some(csv(&courses, &LEVELS));
    Ok(())
}

/// Methods of the plots: as many as there are colours.
const SHOWN: [&str; 6] = ["admm", "aa-admm-4 m=1", "aa-admm-4 m=6", "aa-admm-2 m=6", "over-relaxation 1.6", "aadr m=6"];

/// What the tables of steps say.
pub(super) const COUNTING: &str = "Iterations are accepted ones; one cycle of z, x and u comes before the first and is none. In \
    brackets proposals that were refused until then. Residuals are forward residuals, A(24) of the z-x-u iteration and A(22) of \
    x-z-u, normalised by A(27) with a = the mean edge; violations are those of positions. Rows of the authors' are what was \
    measured with their implementation, from states that differ by rounding and what it grows to.";

/// The largest strain violation against seconds.
fn violation_panel(courses: &[&Course]) -> crate::plot::Panel {
    const VIOLATIONS: [&str; 4] = ["admm", "aa-admm-4 m=1", "aa-admm-4 m=6", "wrapd"];
    let shown: Vec<Course> = courses
        .iter()
        .filter(|c| VIOLATIONS.contains(&c.method.as_str()))
        .map(|c| {
            let mut course = (*c).clone();
            course.points.iter_mut().for_each(|p| p.position = p.violation);
            course
        })
        .collect();
    let mut panel = step_report::position_panel("strain violation", &shown.iter().collect::<Vec<_>>());
    // The colours of the other panels.
    for line in &mut panel.lines {
        line.style = SHOWN.iter().position(|name| *name == line.label).unwrap_or(SHOWN.len());
    }
    panel.y_label = "largest violation".to_string();
    panel
}

/// Plain ADMM, Algorithm 4 and WRAPD after the same time.
fn pictures(context: &mut Context<'_>, moving: &Moving, frame: usize, courses: &[&Course]) -> Result<(), BenchError> {
    const SIZE: [usize; 2] = [460, 400];
    let ways = [Way::plain("admm", 1.0), Way::four(6), Way::polar("wrapd", Splitting::PolarReweighted)];
    let find = |name: &str| courses.iter().find(|c| c.method == name);
    let time = find("aa-admm-4 m=6")
        .and_then(|c| c.points.iter().rfind(|p| p.iteration <= PICTURE_AT))
        .map_or(0.0, |p| p.seconds);
    let triangles = moving.body.mesh.faces.fan_triangles();
    let mut table = Table::new(["method", "iterations", "largest violation", "mean violation"]);
    let mut scenes = Vec::new();
    for way in &ways {
        let iterations =
            find(&way.name).and_then(|c| c.points.iter().rfind(|p| p.seconds <= time)).map_or(1, |p| p.iteration);
        let x = way.after(moving, iterations)?;
        let of_element = moving.violations(&x);
        let mut at_vertex = vec![0.0_f64; moving.body.mesh.n_verts()];
        for (t, violation) in triangles.iter().zip(&of_element) {
            t.iter().for_each(|v| at_vertex[*v as usize] = at_vertex[*v as usize].max(*violation));
        }
        let shades: Vec<f64> = at_vertex.iter().map(|v| (v / BRIGHT).min(1.0)).collect();
        let model = Model::new(moving.vertices(&x), triangles.clone()).colored_by(&shades);
        scenes.push(proxel::preview::Scene { models: vec![model] });
        let largest = of_element.iter().fold(0.0_f64, |m, v| m.max(*v));
        let mean = of_element.iter().sum::<f64>() / of_element.len().max(1) as f64;
        table.row([way.name.clone(), iterations.to_string(), format!("{largest:.3}"), format!("{mean:.4}")]);
    }
    let style = Style { ground: false, ..Style::default() };
    let camera = Camera { toward_eye: [-0.25, 0.2, 1.0], ..Camera::default() };
    let image = render(&scenes, &camera, &style, SIZE[0] * scenes.len(), SIZE[1]);
    let file = context.file(&format!("frame-{frame}.png"));
    image.write_png(&context.options.out.join(&file)).map_err(BenchError::from_display)?;
    let _ = writeln!(
        context.text,
        "After {} s, the time of {PICTURE_AT} iterations of Algorithm 4 with m = 6; from the left as in the table. Colours: strain \
         violation of triangles, {BRIGHT} as bright as can be.\n\n![Frame {frame} at equal time]({file})\n\n{table}",
        seconds(time)
    );
    Ok(())
}

/// Settings and methods that go on where plain ADMM and Algorithm 4 circle, on the frame of the step.
fn converging(context: &mut Context<'_>, step: &Step<'_>) -> Result<String, BenchError> {
    let n = context.options.max_iters.unwrap_or(if context.options.quick { 300 } else { LONG });
    let six = Acceleration::anderson(Algorithm::Four, 6);
    let mut ways = Vec::new();
    for mu in [1.0, 4.0, 16.0, 64.0] {
        ways.push(Way::plain(&format!("admm mu={mu}"), mu));
        ways.push(Way::accelerated(&format!("aa-admm-4 m=6 mu={mu}"), mu, six));
    }
    let mut ways: Vec<(Way, usize)> = ways.into_iter().map(|way| (way, n)).collect();
    // Their global steps take many inner ones.
    let polar = [("r-admm", Splitting::Polar), ("wrapd", Splitting::PolarReweighted)];
    ways.extend(polar.map(|(name, splitting)| (Way::polar(name, splitting), n.min(MOST))));
    let mut table = Table::new(["method", "iterations", "primal residual", "dual residual", "violation", "seconds"]);
    for (way, n) in &ways {
        let (course, primal, dual) = step.to_the_end(way, *n, TOLERANCE)?;
        let Some(last) = course.points.last() else { continue };
        context.tell(&format!(
            "{}: {}: {} iterations, primal {primal:.1e}, dual {dual:.1e}, violation {:.1e}",
            step.problem, way.name, last.iteration, last.violation
        ));
        table.row([
            way.name.clone(),
            last.iteration.to_string(),
            format!("{primal:.1e}"),
            format!("{dual:.1e}"),
            format!("{:.1e}", last.violation),
            seconds(last.seconds),
        ]);
    }
    let scene = Scene::new(step.moving, &context.options.out, &context.file("flag"))?;
    let auto = scene.step(step.moving, "auto", (n, TOLERANCE), context.options.threads)?;
    let number = |v: Option<f64>| v.map_or("-".to_string(), |v| format!("{v:.1e}"));
    table.row([
        format!("auto of `simulate` ({})", auto.record.status),
        auto.record.iterations.to_string(),
        number(auto.record.forward),
        String::new(),
        format!("{:.1e}", step.moving.violations(&auto.x).into_iter().fold(0.0, f64::max)),
        seconds(auto.record.seconds),
    ]);
    Ok(format!(
        "## What converges\n\nFrame {}, to residuals of {TOLERANCE:e} or {n} iterations, {MOST} where stretches are split. Residuals are those of each splitting, |W(c(Dx) - z)| \
         and |W(z - z_before)| over |W z|. mu multiplies w^2.\n\n{table}",
        FRAMES[0].0
    ))
}

/// Relative residuals that are called converged.
const TOLERANCE: f64 = 1e-9;
