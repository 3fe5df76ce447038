//! What every reproduction has: options, models, results on their way to the files.

use crate::BenchError;
use crate::data::{self, Model};
use crate::plot::{self, Axis, Line, Panel};
use crate::runs::{LEVELS, Level, Run, Runner};
use crate::table;
use proxel::settings::DeformSettings;
use std::fmt::Write as _;
use std::path::PathBuf;

/// Options of the reproductions.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Folder for the results; made where it is not there.
    pub out: PathBuf,
    /// Names of models; `beam` is generated. Empty: those that the reproduction is about.
    pub models: Vec<String>,
    /// Threads; all processors where none is given.
    pub threads: Option<usize>,
    /// Most iterations of a run, where given.
    pub max_iters: Option<usize>,
    /// Squared weight multipliers (the paper's beta) that methods with static weights are tried with.
    pub weight_scales: Vec<f64>,
    /// Repetitions of every run; seconds are the least of them.
    pub repeats: usize,
    /// Meshes of a reproduction that makes them, where given.
    pub count: Option<usize>,
    /// Few models, few values, few iterations: to see that all works.
    pub quick: bool,
}

/// A row of the CSV.
#[derive(Clone, Debug, PartialEq)]
pub struct Reached {
    /// Name of the model.
    pub problem: String,
    /// Name of the method.
    pub method: String,
    /// What was to be reached.
    pub level: String,
    /// After how many iterations and seconds it was, if it was.
    pub at: Option<(usize, f64)>,
}

/// A reproduction under way.
pub struct Context<'a> {
    name: &'static str,
    /// Its options.
    pub options: &'a Options,
    /// The models it is to run on.
    pub models: Vec<String>,
    /// The Markdown so far.
    pub text: String,
    /// All runs so far, for the CSV.
    pub runs: Vec<Run>,
    /// Further rows of the CSV.
    pub reached: Vec<Reached>,
    /// The whole CSV, where a reproduction has columns of its own.
    pub csv: Option<String>,
    levels: Vec<Level>,
    tell: &'a mut dyn FnMut(&str),
}

impl<'a> Context<'a> {
    pub(super) fn new(
        name: &'static str,
        options: &'a Options,
        models: Vec<String>,
        tell: &'a mut dyn FnMut(&str),
    ) -> Self {
        let levels = LEVELS.iter().copied().filter(|level| matches!(level, Level::Position(_))).collect();
        Context {
            name,
            options,
            models,
            text: String::new(),
            runs: Vec::new(),
            reached: Vec::new(),
            csv: None,
            levels,
            tell,
        }
    }

    /// Says what is being done.
    pub fn tell(&mut self, what: &str) {
        (self.tell)(what);
    }

    /// Most iterations of a run.
    pub fn max_iters(&self) -> usize {
        self.options.max_iters.unwrap_or(if self.options.quick { 300 } else { 2000 })
    }

    /// The levels that a run goes on to, and that the CSV lists; position errors unless set otherwise.
    pub fn set_levels(&mut self, levels: &[Level]) {
        self.levels = levels.to_vec();
    }

    /// Under what the runs were made.
    pub fn conditions(&self) -> String {
        let processors = std::thread::available_parallelism().map_or(1, |n| n.get());
        let threads = self.options.threads.unwrap_or(processors);
        let repeats = match self.options.repeats {
            0 | 1 => String::new(),
            n => format!(", the least of {n} runs"),
        };
        format!(
            "Proxel {}, {threads} threads of {processors} processors, at most {} iterations a run. Seconds are wall time from the \
             end of reading, orders and factorisations included{repeats}. Position error: |X - X*| / |X_0 - X*| over free \
             vertices; energy error: (E - E*) / (E_0 - E*).",
            env!("CARGO_PKG_VERSION"),
            self.max_iters(),
        )
    }

    /// The same of time steps, whose levels are residuals.
    pub fn step_conditions(&self) -> String {
        let processors = std::thread::available_parallelism().map_or(1, |n| n.get());
        let threads = self.options.threads.unwrap_or(processors);
        format!(
            "Proxel {}, {threads} threads of {processors} processors. Seconds are wall time of iterations, without \
             factorisations.",
            env!("CARGO_PKG_VERSION"),
        )
    }

    /// The same of maps.
    pub fn map_conditions(&self) -> String {
        let processors = std::thread::available_parallelism().map_or(1, |n| n.get());
        let threads = self.options.threads.unwrap_or(processors);
        let repeats = match self.options.repeats {
            0 | 1 => String::new(),
            n => format!(" The least of {n} runs."),
        };
        format!(
            "Proxel {}, {threads} threads of {processors} processors. Seconds are wall time from the end of reading; start \
             maps, orders and factorisations are included.{repeats} Energies are symmetric Dirichlet, 1 at an isometry.",
            env!("CARGO_PKG_VERSION"),
        )
    }

    /// Settings with the common options filled in.
    pub fn settings(&self, base: DeformSettings) -> DeformSettings {
        // The runs end where their levels are reached, not where the gradient vanishes.
        DeformSettings { max_iters: self.max_iters(), threads: self.options.threads, tol: 1e-14, ..base }
    }

    /// Loads a model.
    ///
    /// # Errors
    /// A model that is not there.
    pub fn load(&mut self, name: &str) -> Result<(Model, f64), BenchError> {
        self.tell(&format!("{name}: reading"));
        let model = data::load(name)?;
        let least_energy = model.least_energy()?;
        Ok((model, least_energy))
    }

    /// Runs a method on a model and keeps the run.
    ///
    /// # Errors
    /// Settings that make no problem.
    pub fn run(
        &mut self,
        (model, least_energy): &(Model, f64),
        method: &str,
        settings: DeformSettings,
    ) -> Result<Run, BenchError> {
        let settings = self.settings(settings);
        let runner = Runner { model, least_energy: *least_energy, levels: &self.levels, repeats: self.options.repeats };
        let run = runner.run(method, &settings)?;
        let last = run.last();
        self.tell(&format!(
            "{}: {method}: {} iterations, {} s, position error {:.1e}, energy error {:.1e} ({})",
            model.name,
            last.iteration,
            table::seconds(last.seconds),
            last.position_error,
            last.energy_error,
            run.reason
        ));
        self.runs.push(run.clone());
        Ok(run)
    }

    /// Draws panels into the file NAME-SUFFIX.svg and shows it in the text.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn plot(&mut self, suffix: &str, title: &str, panels: &[Panel]) -> Result<(), BenchError> {
        let file = if suffix.is_empty() { format!("{}.svg", self.name) } else { format!("{}-{suffix}.svg", self.name) };
        plot::write(&self.options.out.join(&file), title, panels)?;
        let _ = writeln!(self.text, "![{title}]({file})\n");
        Ok(())
    }

    /// The name of a file of this reproduction.
    pub fn file(&self, suffix: &str) -> String {
        format!("{}-{suffix}", self.name)
    }

    /// Writes NAME.md and NAME.csv.
    pub(super) fn finish(self) -> Result<(), BenchError> {
        let file = |ending: &str| self.options.out.join(format!("{}.{ending}", self.name));
        table::write(&file("md"), &self.text)?;
        let mut csv = table::csv(&self.runs, &self.levels);
        for Reached { problem, method, level, at } in &self.reached {
            let cells = at.map_or_else(|| ",".to_string(), |(iterations, seconds)| format!("{iterations},{seconds}"));
            let _ = writeln!(csv, "{problem},{method},{level},{cells}");
        }
        table::write(&file("csv"), self.csv.as_ref().unwrap_or(&csv))?;
        (self.tell)(&format!("wrote {}", file("md").display()));
        Ok(())
    }
}

/// Position error against seconds.
pub fn position_panel(title: &str, runs: &[(&Run, usize)]) -> Panel {
    panel(title, "position error", runs, (1e-5, 1.5), |p| p.position_error)
}

/// Energy error against seconds.
pub fn energy_panel(title: &str, runs: &[(&Run, usize)]) -> Panel {
    panel(title, "energy error", runs, (1e-12, 1.5), |p| p.energy_error)
}

fn panel(
    title: &str,
    y_label: &str,
    runs: &[(&Run, usize)],
    (low, high): (f64, f64),
    value: fn(&crate::runs::Point) -> f64,
) -> Panel {
    let after_start = |run: &Run| run.points.iter().skip(1).map(|p| (p.seconds, value(p))).collect::<Vec<_>>();
    let lines: Vec<Line> = runs
        .iter()
        .map(|(run, style)| Line { label: run.method.clone(), points: after_start(run), style: *style, marked: false })
        .collect();
    let points = || lines.iter().flat_map(|l| &l.points);
    let least = points().map(|p| p.1).filter(|v| *v > 0.0).fold(high, f64::min).max(low);
    let most = points().map(|p| p.1).filter(|v| v.is_finite()).fold(1.0, f64::max);
    Panel {
        title: title.to_string(),
        x_label: "seconds".to_string(),
        y_label: y_label.to_string(),
        x: Axis::log_around(points().map(|p| p.0)),
        y: Axis::log(least / 1.5, (most * 1.5).min(1e3)),
        lines,
        map: None,
    }
}
