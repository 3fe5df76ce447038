//! What the user sees of a batch: a bar, a line for each mesh that did not converge, and the sum.

use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::path::Path;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use super::results::{End, Record};

/// Counts by status.
pub struct Tally {
    counts: BTreeMap<End, usize>,
    before: usize,
    total: usize,
    quiet: bool,
    bar: Option<ProgressBar>,
    results: String,
}

impl Tally {
    /// Of so many meshes.
    pub fn new(quiet: bool, total: usize, results: &Path) -> Self {
        let bar = (!quiet && std::io::stderr().is_terminal()).then(|| {
            let bar = ProgressBar::new(total as u64);
            let style = ProgressStyle::with_template("{spinner} [{bar:24}] {pos}/{len} meshes, {elapsed}, {msg}");
            if let Ok(style) = style {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.enable_steady_tick(Duration::from_millis(100));
            bar
        });
        Tally { counts: BTreeMap::new(), before: 0, total, quiet, bar, results: results.display().to_string() }
    }

    /// One more has ended, now or in an earlier run.
    pub fn add(&mut self, record: &Record, is_new: bool) {
        *self.counts.entry(record.status).or_default() += 1;
        self.before += usize::from(!is_new);
        if is_new && !self.quiet && record.status != End::Converged {
            let text = format!("{}: {}: {}", record.status.as_str(), record.mesh, record.reason);
            let line: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
            match &self.bar {
                Some(bar) => bar.println(line),
                None => eprintln!("{line}"),
            }
        }
        if let Some(bar) = &self.bar {
            bar.inc(1);
            bar.set_message(self.counted());
        }
    }

    fn counted(&self) -> String {
        let each = End::ALL.iter().filter_map(|e| self.counts.get(e).map(|n| format!("{n} {}", e.as_str())));
        each.collect::<Vec<_>>().join(", ")
    }

    /// The sum, in one line.
    pub fn say(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        if self.quiet {
            return;
        }
        let seen: usize = self.counts.values().sum();
        let mut parts = vec![format!("{} meshes: {}", self.total, self.counted())];
        if seen < self.total {
            parts.push(format!("{} not begun", self.total - seen));
        }
        if self.before > 0 {
            parts.push(format!("{} of them in an earlier run", self.before));
        }
        say!("{}; see {}", parts.join(", "), self.results);
    }

    /// 0 all converged, 3 some were stopped, 1 some have no result.
    pub fn exit_status(&self) -> u8 {
        match self.counts.keys().max() {
            None | Some(End::Converged) => 0,
            Some(End::Stopped) => 3,
            Some(_) => 1,
        }
    }
}
