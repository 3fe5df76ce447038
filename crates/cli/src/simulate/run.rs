//! From a scene to a folder of frames.

use std::path::{Path, PathBuf};
use std::time::Instant;

use proxel::problem_file::ProblemFile;
use proxel::report::{Report, Seconds, TraceRow};
use proxel::shape::recipe_schema;
use proxel::simulate::{Folder, FrameRecord, Hooks, Progress, SceneFile, Simulation, State, schema as scene_schema};

use super::{SchemaArgs, SimulateArgs};
use crate::files::{Outputs, write_text};
use crate::interrupt::{Interrupt, exit_status};
use crate::progress::Bar;
use crate::refusal::Refusal;

/// Prints the JSON Schema of scenes, or of recipes.
pub fn schema(args: &SchemaArgs) -> Result<u8, Refusal> {
    let schema = if args.what == "recipe" { recipe_schema() } else { scene_schema() };
    let text = serde_json::to_string_pretty(&schema);
    say!("{}", text.map_err(|e| Refusal::new(format!("the schema cannot be printed: {e}")))?);
    Ok(0)
}

/// Reads, simulates, writes each frame as it comes.
pub fn run(args: &SimulateArgs) -> Result<u8, Refusal> {
    let file = args.read()?;
    if args.run.show_settings {
        let text = file.completed()?;
        say!("{}", text.trim_end());
        return Ok(0);
    }
    let Some(out) = &args.out else { return Err(Refusal::new("--out is needed; see proxel simulate --help")) };
    Outputs::default()
        .file("--report", args.run.report.as_deref(), &[])?
        .file("--trace", args.run.trace.as_deref(), &[])?
        .file("--preview", args.run.preview.as_deref(), &["png"])?
        .file("--dump", args.dump.as_deref(), &["json"])?
        .check()?;
    let interrupt = Interrupt::listen()?;
    let began = Instant::now();
    // Of what is dumped nothing may change while it is simulated.
    let file = if args.dump.is_some() { file.embedded()? } else { file };
    let simulation = Simulation::new(&file, args.run.threads)?;
    let setup = began.elapsed().as_secs_f64();
    let mut run = Run {
        args,
        file: &file,
        simulation,
        began,
        setup,
        written: 0.0,
        worst: ("converged".to_string(), String::new()),
        rows: Vec::new(),
        begun: None,
    };
    let folder = run.open(out)?;
    run.play(folder, &interrupt)
}

struct Run<'a> {
    args: &'a SimulateArgs,
    file: &'a SceneFile,
    simulation: Simulation,
    began: Instant,
    setup: f64,
    written: f64,            // seconds spent writing
    worst: (String, String), // status and reason of the worst frame so far
    rows: Vec<String>,       // of the trace
    begun: Option<State>,    // what the last frame began with, where it is to be dumped
}

/// How bad an end is: a run is as good as its worst frame.
fn rank(status: &str) -> usize {
    ["converged", "stopped", "cancelled", "failed"].iter().position(|s| *s == status).unwrap_or(0)
}

impl Run<'_> {
    /// The folder, with frame 0 or with the frames of before.
    fn open(&mut self, out: &Path) -> Result<Folder, Refusal> {
        if self.args.resume {
            let (folder, state) = Folder::reopen(out, self.file)?;
            self.simulation.resume(state)?;
            for record in folder.records() {
                self.judge(record);
            }
            return Ok(folder);
        }
        let mut folder = Folder::create(out, self.file)?;
        let record = self.simulation.start_record();
        self.write(&mut folder, record)?;
        Ok(folder)
    }

    fn judge(&mut self, record: &FrameRecord) {
        if rank(&record.status) > rank(&self.worst.0) {
            self.worst = (record.status.clone(), format!("frame {}: {}", record.frame, record.reason));
        }
    }

    fn write(&mut self, folder: &mut Folder, record: FrameRecord) -> Result<(), Refusal> {
        let began = Instant::now();
        let simulation = &self.simulation;
        let frame = simulation.frame(record)?;
        let preview = simulation.scene().output.preview.then(|| simulation.preview());
        let report = self.report(folder, "stopped", "it broke off after this frame; go on with --resume");
        folder.write(&frame, preview.as_ref(), simulation.state(), &report, simulation.ledger())?;
        self.written += began.elapsed().as_secs_f64();
        Ok(())
    }

    /// Frame after frame.
    fn play(&mut self, mut folder: Folder, interrupt: &Interrupt) -> Result<u8, Refusal> {
        let total = self.simulation.scene().time.frames;
        let bar = Bar::of(self.args.run.quiet, total, "frames");
        let cancel = interrupt.solving();
        while self.simulation.frame_count() < total {
            let done = self.simulation.frame_count();
            if self.args.dump.is_some() {
                self.begun = Some(self.simulation.state().clone());
            }
            let record = {
                let mut on_progress = |p: &Progress| bar.show_frame(done, p.iterations);
                let rows = &mut self.rows;
                let mut on_row = |frame: usize, step: usize, row: &TraceRow| {
                    rows.push(format!("{frame},{step},{}", row.to_csv()));
                };
                let mut hooks = Hooks { cancel: cancel.clone(), ..Hooks::default() };
                hooks.time_limit = self.args.run.time_limit.map(|limit| (self.began, limit));
                if bar.is_shown() {
                    hooks.progress = Some(&mut on_progress);
                }
                if self.args.run.trace.is_some() {
                    hooks.trace = Some(&mut on_row);
                }
                self.simulation.advance(&mut hooks)
            };
            let record = match record {
                Ok(record) => record,
                Err(e) => {
                    self.worst = ("failed".into(), format!("frame {}: {e}", done + 1));
                    break;
                }
            };
            self.judge(&record);
            if self.simulation.frame_count() == done {
                // Dropped: cancelled, out of time, or failed.
                break;
            }
            self.write(&mut folder, record)?;
        }
        bar.clear();
        interrupt.writing();
        self.finish(&folder)
    }

    fn finish(&mut self, folder: &Folder) -> Result<u8, Refusal> {
        let began = Instant::now();
        let mut written: Vec<PathBuf> = vec![folder.path().join("frames.pvd"), folder.path().join("frames.csv")];
        written.extend(folder.finish()?);
        self.written += began.elapsed().as_secs_f64();
        let (status, mut reason) = self.worst.clone();
        let (done, total) = (self.simulation.frame_count(), self.simulation.scene().time.frames);
        if status == "converged" {
            reason = format!("all steps of {done} frames converged");
        }
        let report = self.report(folder, &status, &reason);
        let text = folder.write_report(&report, self.simulation.ledger())?;
        written.push(folder.path().join("report.json"));
        if let (Some(path), Some(state)) = (&self.args.dump, &self.begun) {
            ProblemFile::simulate(self.file, state)?.write(path)?;
            written.push(path.clone());
        }
        if let Some(path) = &self.args.run.report {
            write_text(path, &text)?;
            written.push(path.clone());
        }
        if let Some(path) = &self.args.run.trace {
            let header = format!("frame,step,{}", TraceRow::HEADER);
            let rows: Vec<&str> = std::iter::once(&header).chain(&self.rows).map(String::as_str).collect();
            write_text(path, &(rows.join("\n") + "\n"))?;
            written.push(path.clone());
        }
        if let Some(path) = &self.args.run.preview {
            self.simulation.preview().write_png(path)?;
            written.push(path.clone());
        }
        if !self.args.run.quiet {
            for warning in &report.warnings {
                eprintln!("warning: {warning}");
            }
            for repair in &report.repaired {
                eprintln!("repaired: {repair}");
            }
            say!("{status}: {done} of {total} frames, {} iterations, {:.2} s", report.iterations, self.seconds());
            if status != "converged" {
                say!("{reason}");
            }
            written.iter().for_each(|path| say!("wrote {}", path.display()));
        }
        Ok(exit_status(&status, &reason))
    }

    fn seconds(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    fn report(&self, folder: &Folder, status: &str, reason: &str) -> Report {
        let solve = (self.seconds() - self.setup - self.written).max(0.0);
        let seconds = Seconds { read: 0.0, setup: self.setup, solve, write: self.written };
        self.simulation.report(folder.records(), (status, reason), seconds)
    }
}
