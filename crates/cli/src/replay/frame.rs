//! A frame of a simulation, once more.

use std::time::Instant;

use proxel::report::{Report, Seconds, TraceRow};
use proxel::simulate::{FrameRecord, Hooks, SceneFile, Simulation, State};
use proxel_mesh::write_mesh;
use serde::Serialize;

use super::ReplayArgs;
use crate::files::{Outputs, write_report, write_text};
use crate::interrupt::{Interrupt, exit_status};
use crate::refusal::Refusal;

/// A report, and all that is known of the frame.
#[derive(Serialize)]
struct WholeReport<'a> {
    #[serde(flatten)]
    report: Report,
    frames: [&'a FrameRecord; 1],
}

pub fn run(args: &ReplayArgs, mut scene: SceneFile, state: State) -> Result<u8, Refusal> {
    let r = &args.run;
    scene.change(|scene| {
        let solver = &mut scene.solver;
        solver.method = args.method.unwrap_or(solver.method);
        solver.max_iters = args.max_iters.unwrap_or(solver.max_iters);
        solver.tol = args.tol.unwrap_or(solver.tol);
        // The frame may be one past the last that was asked for.
        scene.time.frames = scene.time.frames.max(state.frame().saturating_add(1));
    })?;
    if r.show_settings {
        say!("{}", scene.completed()?.trim_end());
        return Ok(0);
    }
    let bodies = scene.scene().bodies.len();
    if let Some(out) = args.out.as_deref().filter(|_| bodies != 1) {
        let text = format!("{}: the frame has {bodies} bodies, a mesh has one; leave --out out", out.display());
        return Err(Refusal::new(text));
    }
    let mut outputs = Outputs::default();
    if let Some(out) = &args.out {
        outputs = outputs.mesh("--out", out)?;
    }
    outputs
        .file("--report", r.report.as_deref(), &[])?
        .file("--trace", r.trace.as_deref(), &[])?
        .file("--preview", r.preview.as_deref(), &["png"])?
        .check()?;
    let interrupt = Interrupt::listen()?;
    let began = Instant::now();
    let mut simulation = Simulation::new(&scene, r.threads)?;
    simulation.resume(state)?;
    let setup = began.elapsed().as_secs_f64();
    let before = simulation.frame_count();
    let mut rows = vec![format!("frame,step,{}", TraceRow::HEADER)];
    let record = {
        let mut on_row = |frame: usize, step: usize, row: &TraceRow| {
            rows.push(format!("{frame},{step},{}", row.to_csv()));
        };
        let mut hooks = Hooks { cancel: interrupt.solving(), ..Hooks::default() };
        hooks.time_limit = r.time_limit.map(|limit| (began, limit));
        if r.trace.is_some() {
            hooks.trace = Some(&mut on_row);
        }
        simulation.advance(&mut hooks)?
    };
    let solve = began.elapsed().as_secs_f64() - setup;
    interrupt.writing();
    let began = Instant::now();
    let mut written = Vec::new();
    // A frame that was dropped left everything where it was.
    let is_whole = simulation.frame_count() > before;
    if let Some(out) = args.out.as_ref().filter(|_| is_whole) {
        for (_, mesh, fields) in &simulation.frame(record.clone())?.bodies {
            write_mesh(out, mesh, fields)?;
            written.push(out);
        }
    }
    if let Some(path) = r.preview.as_ref().filter(|_| is_whole) {
        simulation.preview().write_png(path)?;
        written.push(path);
    }
    if let Some(path) = &r.trace {
        write_text(path, &(rows.join("\n") + "\n"))?;
        written.push(path);
    }
    if let Some(path) = &r.report {
        let seconds = Seconds { read: 0.0, setup, solve, write: began.elapsed().as_secs_f64() };
        let end = (record.status.as_str(), record.reason.as_str());
        let whole =
            WholeReport { report: simulation.report(std::slice::from_ref(&record), end, seconds), frames: [&record] };
        write_report(path, &whole)?;
        written.push(path);
    }
    if !r.quiet {
        say!("{}: frame {}, {} iterations, {solve:.2} s", record.status, record.frame, record.iterations);
        if !record.reason.is_empty() {
            say!("{}", record.reason);
        }
        say!(
            "energies: kinetic {:.6e}, elastic {:.6e}, potential {:.6e}; penetration {:.1e} m",
            record.kinetic,
            record.elastic,
            record.potential,
            record.max_penetration
        );
        written.iter().for_each(|path| say!("wrote {}", path.display()));
    }
    Ok(exit_status(&record.status, &record.reason))
}
