//! `--keyframes`: a body that follows its handles, as an animation.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use proxel::deform::{Deformer, Frame, Hooks, Progress};
use proxel::keyframes::{Animation, KeyframeFile};
use proxel::report::{Report, Seconds, TraceRow, peak_bytes};
use proxel::settings::DeformSettings;
use proxel::split::Status;
use proxel_mesh::{Fields, Format, MOST_GLTF_FRAMES, MeshError, check_series_output, write_series};
use serde::Serialize;

use super::run::Inputs;
use crate::files::{Outputs, write_report, write_text};
use crate::interrupt::{CANCELLED, Interrupt};
use crate::progress::Bar;
use crate::refusal::Refusal;

/// Where an animation goes.
pub struct Outlets {
    /// The animation; the extension names the format.
    pub out: PathBuf,
    /// JSON.
    pub report: Option<PathBuf>,
    /// CSV.
    pub trace: Option<PathBuf>,
}

impl Outlets {
    /// Checks that all can be written.
    pub fn check(&self) -> Result<(), Refusal> {
        check_series_output(&self.out)?;
        let outputs = Outputs::default().file("--out", Some(&self.out), &[])?;
        let outputs = outputs.file("--report", self.report.as_deref(), &[])?;
        outputs.file("--trace", self.trace.as_deref(), &[])?.check()
    }

    fn check_count(&self, frames: usize) -> Result<(), Refusal> {
        let gltf = matches!(Format::from_path(&self.out), Ok(Format::Gltf | Format::Glb));
        if gltf && frames > MOST_GLTF_FRAMES {
            return Err(Refusal::new(format!(
                "{}: {frames} frames are too many for animated glTF, which takes {MOST_GLTF_FRAMES}; lower \
                 frames_per_second, or write a .pvd",
                self.out.display()
            )));
        }
        Ok(())
    }
}

/// What became of a frame.
#[derive(Clone, Debug, Serialize)]
struct FrameReport {
    frame: usize,
    time: f64,
    status: &'static str,
    reason: String,
    iterations: usize,
    inner_iterations: usize,
    refactorisations: usize,
    energy: Option<f64>,
    gradient_norm: Option<f64>,
    gradient_ratio: Option<f64>,
    inverted: u64,
    min_stretch: Option<f64>,
    max_stretch: Option<f64>,
    seconds: f64,
    /// Whether it is in the animation; what was cut short is not, unless there is no other.
    written: bool,
    #[serde(skip)]
    warned: bool,
}

impl FrameReport {
    fn new(index: usize, time: f64, frame: &Frame, seconds: f64, written: bool) -> Self {
        let finite = |v: f64| v.is_finite().then_some(v);
        FrameReport {
            frame: index,
            time,
            status: frame.status.as_str(),
            reason: frame.reason.clone(),
            iterations: frame.iterations,
            inner_iterations: frame.inner_iterations,
            refactorisations: frame.refactorisations,
            energy: finite(frame.energy),
            gradient_norm: frame.gradient_norm,
            gradient_ratio: frame.gradient_ratio,
            inverted: frame.inverted,
            min_stretch: finite(frame.min_stretch),
            max_stretch: finite(frame.max_stretch),
            seconds,
            written,
            warned: !frame.warnings.is_empty(),
        }
    }
}

/// The report of any run, of which the last frame is the result, and all frames.
#[derive(Serialize)]
struct AnimationReport {
    #[serde(flatten)]
    report: Report,
    frames: Vec<FrameReport>,
}

/// How bad an end is: a run is as good as its worst frame.
fn rank(status: Status) -> u8 {
    match status {
        Status::Converged => 0,
        Status::Stopped => 1,
        Status::Cancelled => 2,
        Status::Failed => 3,
    }
}

/// Reads the keyframes and holds them against the groups of the pins.
pub fn keyframes(path: &Path, deformer: &Deformer) -> Result<Animation, Refusal> {
    Ok(KeyframeFile::read(path)?.resolve(deformer.groups(), |v| deformer.home_of(v))?)
}

/// One frame after the other.
struct Player<'a> {
    deformer: Deformer,
    animation: &'a Animation,
    settings: &'a DeformSettings,
    frame_time: Option<f64>,
    interrupt: &'a Interrupt,
    bar: Bar,
    began: Instant,
    tracing: bool,
    rows: Vec<String>,
    frames: Vec<FrameReport>,
    worst: Status,
    reason: String,
    refused: Option<Refusal>,
    warnings: Vec<String>,
}

impl Player<'_> {
    /// The time that a frame has: its own, or what is left of all.
    fn budget(&self) -> Option<Duration> {
        let left = self.settings.time_limit.map(|t| (t - self.began.elapsed().as_secs_f64()).max(0.0));
        let least = match (self.frame_time, left) {
            (Some(a), Some(b)) => a.min(b),
            (a, b) => a.or(b)?,
        };
        Some(Duration::try_from_secs_f64(least).unwrap_or(Duration::MAX))
    }

    /// The frame, unless the animation ends before it.
    fn play(&mut self, k: usize) -> Option<proxel_mesh::Frame> {
        let time = *self.animation.times().get(k)?;
        let over = self.settings.time_limit.is_some_and(|t| k > 0 && self.began.elapsed().as_secs_f64() >= t);
        if over {
            self.end(Status::Stopped, format!("the time is over (--time-limit) before frame {k}"));
            return None;
        }
        let began = Instant::now();
        let frame = match self.solve(k, time) {
            Ok(frame) => frame,
            Err(e) => {
                let text = format!("frame {k} (0-based), at time {time}: {e}; the {k} frames before it were written");
                self.end(Status::Failed, text.clone());
                self.refused = Some(Refusal::new(text));
                return None;
            }
        };
        // What holds for many frames is said for the first.
        if self.frames.iter().all(|f| !f.warned) {
            self.warnings.extend(frame.warnings.iter().map(|w| format!("frame {k} (0-based): {w}")));
        }
        // What was cut short is no frame, unless there is no other.
        let cut = matches!(frame.status, Status::Cancelled | Status::Failed) && k > 0;
        self.frames.push(FrameReport::new(k, time, &frame, began.elapsed().as_secs_f64(), !cut));
        self.end(frame.status, format!("frame {k} (0-based): {}", frame.reason));
        let fields = self.fields(&frame);
        (!cut).then_some(proxel_mesh::Frame { time, points: frame.positions, fields })
    }

    fn solve(&mut self, k: usize, time: f64) -> Result<Frame, proxel::deform::DeformError> {
        self.deformer.set_targets(&self.animation.targets(time))?;
        let budget = self.budget();
        let (bar, rows) = (&self.bar, &mut self.rows);
        let mut on_progress = |p: &Progress| bar.show(p);
        let mut on_row = |row: &TraceRow| rows.push(format!("{k},{}", row.to_csv()));
        let mut hooks = Hooks { cancel: self.interrupt.solving(), ..Hooks::default() };
        if bar.is_shown() {
            hooks.progress = Some(&mut on_progress);
        }
        if self.tracing {
            hooks.trace = Some(&mut on_row);
        }
        self.deformer.step(budget, &mut hooks)
    }

    fn end(&mut self, status: Status, reason: String) {
        if self.reason.is_empty() || rank(status) > rank(self.worst) {
            self.worst = status;
            self.reason = reason;
        }
    }

    fn fields(&self, frame: &Frame) -> Fields {
        let mut fields = Fields::none();
        let rest = &self.deformer.input().rest.points;
        let moved = rest.iter().zip(&frame.positions).flat_map(|(a, b)| (0..3).map(|d| b[d] - a[d])).collect();
        fields.point("displacement", 3, moved);
        let mut pinned = vec![0.0; rest.len()];
        self.deformer.input().fixed.iter().for_each(|f| pinned[f.0 as usize] = 1.0);
        fields.point("pinned", 1, pinned);
        fields
    }
}

/// Poses the body frame by frame and writes it; returns the exit status.
pub fn animate(
    inputs: Inputs,
    keyframes: &Path,
    frame_time: Option<f64>,
    settings: &DeformSettings,
    outlets: &Outlets,
    interrupt: &Interrupt,
    quiet: bool,
) -> Result<u8, Refusal> {
    let Inputs { input, mut warnings, read } = inputs;
    let began = Instant::now();
    let deformer = Deformer::new(&input, settings)?;
    let animation = self::keyframes(keyframes, &deformer)?;
    let total = animation.times().len();
    outlets.check_count(total)?;
    warnings.extend_from_slice(deformer.warnings());
    let mut mesh = input.rest.clone();
    if let Some(tets) = deformer.repaired_tets() {
        mesh.tets = tets;
    }
    let setup = began.elapsed().as_secs_f64();
    let player = RefCell::new(Player {
        deformer,
        animation: &animation,
        settings,
        frame_time,
        interrupt,
        bar: Bar::new(quiet, settings.max_iters),
        began,
        tracing: outlets.trace.is_some(),
        rows: Vec::new(),
        frames: Vec::new(),
        worst: Status::Converged,
        reason: String::new(),
        refused: None,
        warnings,
    });
    let frames = (0..total).map_while(|k| {
        let mut player = player.borrow_mut();
        // A frame that was cut short is the last one.
        let goes_on = k == 0 || rank(player.worst) < rank(Status::Cancelled);
        goes_on.then(|| player.play(k)).flatten().map(Ok::<_, MeshError>)
    });
    let frames = frames.chain(std::iter::from_fn(|| {
        interrupt.writing();
        None
    }));
    let mut written = write_frames(&outlets.out, &mesh, frames, &player)?;
    let player = player.into_inner();
    player.bar.clear();
    let solve = began.elapsed().as_secs_f64() - setup;
    if let Some(path) = &outlets.trace {
        let header = format!("frame,{}", TraceRow::HEADER);
        let rows: Vec<&str> = std::iter::once(&header).chain(&player.rows).map(String::as_str).collect();
        write_text(path, &(rows.join("\n") + "\n"))?;
        written.push(path.clone());
    }
    let report = report(&player, settings, Seconds { read, setup, solve, write: 0.0 });
    if let Some(path) = &outlets.report {
        let whole = AnimationReport { report, frames: player.frames.clone() };
        write_report(path, &whole)?;
        written.push(path.clone());
    }
    if !quiet {
        say(&player, total, solve + setup, &written);
    }
    if let Some(refused) = player.refused {
        return Err(refused);
    }
    Ok(match player.worst {
        Status::Converged => 0,
        Status::Failed => {
            eprintln!("error: {}", player.reason);
            1
        }
        Status::Stopped => 3,
        Status::Cancelled => CANCELLED,
    })
}

/// Writes the series; what stood in the way of its first frame is told in its own words.
fn write_frames(
    out: &Path,
    mesh: &proxel_mesh::Mesh,
    frames: impl Iterator<Item = Result<proxel_mesh::Frame, MeshError>>,
    player: &RefCell<Player<'_>>,
) -> Result<Vec<PathBuf>, Refusal> {
    let end = write_series(out, mesh, frames);
    let nothing = player.borrow().frames.is_empty();
    match (end, player.borrow_mut().refused.take_if(|_| nothing)) {
        (_, Some(refused)) => Err(refused),
        (end, None) => Ok(end?),
    }
}

fn report(player: &Player<'_>, settings: &DeformSettings, seconds: Seconds) -> Report {
    let last = player.frames.iter().rfind(|f| f.written);
    let sum = |of: fn(&FrameReport) -> usize| player.frames.iter().map(of).sum();
    Report {
        version: env!("CARGO_PKG_VERSION").to_string(),
        command: "deform".to_string(),
        settings: serde_json::to_value(settings).unwrap_or_default(),
        method: settings.method.as_str().to_string(),
        status: player.worst.as_str().to_string(),
        reason: player.reason.clone(),
        iterations: sum(|f| f.iterations),
        inner_iterations: sum(|f| f.inner_iterations),
        refactorisations: sum(|f| f.refactorisations),
        energy: last.and_then(|f| f.energy),
        gradient_norm: last.and_then(|f| f.gradient_norm),
        gradient_ratio: last.and_then(|f| f.gradient_ratio),
        inverted: last.map(|f| f.inverted),
        min_stretch: last.and_then(|f| f.min_stretch),
        max_stretch: last.and_then(|f| f.max_stretch),
        warnings: player.warnings.clone(),
        repaired: player.deformer.repaired().to_vec(),
        seconds,
        peak_bytes: peak_bytes(),
        threads: player.deformer.threads(),
        ..Report::default()
    }
}

fn say(player: &Player<'_>, total: usize, seconds: f64, written: &[PathBuf]) {
    for warning in &player.warnings {
        eprintln!("warning: {warning}");
    }
    for repair in player.deformer.repaired() {
        eprintln!("repaired: {repair}");
    }
    let frames = player.frames.iter().filter(|f| f.written).count();
    let converged = player.frames.iter().filter(|f| f.status == "converged").count();
    let iterations: usize = player.frames.iter().map(|f| f.iterations).sum();
    say!(
        "{}: {frames} of {total} frames, {converged} converged, {iterations} iterations, {seconds:.2} s",
        player.worst.as_str()
    );
    if player.worst != Status::Converged {
        say!("{}", player.reason);
    }
    match written {
        [] => {}
        [one] => say!("wrote {}", one.display()),
        [first, .., last] => say!("wrote {} to {} ({} files)", first.display(), last.display(), written.len()),
    }
}
