//! The progress of a run, on a terminal only.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use proxel::deform::Progress;

/// A line that says where the run stands.
pub struct Bar(Option<ProgressBar>);

impl Bar {
    /// Shown unless `quiet` or where stderr is no terminal.
    pub fn new(quiet: bool, max_iters: usize) -> Self {
        Bar::of(quiet, max_iters, "iterations")
    }

    /// The same that counts something else.
    pub fn of(quiet: bool, total: usize, what: &str) -> Self {
        if quiet || !std::io::stderr().is_terminal() {
            return Bar(None);
        }
        let bar = ProgressBar::new(total as u64);
        let style = ProgressStyle::with_template(&format!(
            "{{spinner}} [{{bar:24}}] {{pos}}/{{len}} {what}, {{elapsed}}, {{msg}}"
        ));
        if let Ok(style) = style {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_message("setting up");
        bar.enable_steady_tick(Duration::from_millis(100));
        Bar(Some(bar))
    }

    /// Whether anyone looks.
    pub fn is_shown(&self) -> bool {
        self.0.is_some()
    }

    /// Says where the run stands.
    pub fn show(&self, p: &Progress) {
        let Some(bar) = &self.0 else { return };
        bar.set_position(p.iteration as u64);
        bar.set_message(match p.inverted {
            0 => format!("energy {:.8e}", p.energy),
            n => format!("energy {:.8e}, {n} inverted", p.energy),
        });
    }

    /// Says where a run stands that has no elements.
    pub fn show_energy(&self, iteration: usize, energy: f64) {
        self.show(&Progress { iteration, seconds: 0.0, energy, inverted: 0 });
    }

    /// Says how many frames are done, and how many iterations the one under way has taken.
    pub fn show_frame(&self, done: usize, iterations: usize) {
        let Some(bar) = &self.0 else { return };
        bar.set_position(done as u64);
        bar.set_message(format!("frame {}: iteration {iterations}", done + 1));
    }

    /// Takes the line away.
    pub fn clear(&self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
    }
}
