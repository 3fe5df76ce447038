//! Results as a file, and the page that is made of it.

use super::{Row, table};
use crate::BenchError;
use crate::data;
use proxel::mesh::atomic_write;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What encloses the part of the page that is made of results.
const BEGIN: &str = "<!-- made by `cargo xtask performance` of crates/bench/results/ratios.json: begin -->\n";
const END: &str = "<!-- end -->\n";

/// What a run of the program has measured, and where.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Results {
    /// Version of the program.
    pub version: String,
    /// Where it ran.
    pub machine: Machine,
    /// How often each part was timed, where that was kept.
    pub repeats: Option<usize>,
    /// Whether real models were there.
    pub real_models: bool,
    /// What was measured.
    pub rows: Vec<Row>,
}

/// Where a program ran, as far as the system tells.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// What the processor calls itself.
    pub processor: String,
    /// Threads that run at a time.
    pub threads: usize,
    /// Operating system and architecture.
    pub system: String,
    /// Processes that wanted to run, on average over the minute before: above 0 something else disturbs what is timed.
    pub load: Option<f64>,
}

impl Machine {
    /// This one.
    pub fn here() -> Self {
        let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
        let cpus = read("/proc/cpuinfo");
        let named = cpus.lines().find_map(|l| l.strip_prefix("model name")?.split_once(':'));
        Machine {
            processor: named.map_or("a processor without a name", |(_, name)| name.trim()).to_string(),
            threads: std::thread::available_parallelism().map_or(1, |n| n.get()),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            load: read("/proc/loadavg").split_whitespace().next().and_then(|v| v.parse().ok()),
        }
    }
}

impl Results {
    /// Of rows that were measured here; `machine` is what was seen before.
    pub fn new(rows: Vec<Row>, repeats: usize, machine: Machine) -> Self {
        let real_models = data::folder().is_some();
        let version = env!("CARGO_PKG_VERSION").to_string();
        Results { version, machine, repeats: Some(repeats), real_models, rows }
    }

    /// From a file that [`Results::write`] has left.
    ///
    /// # Errors
    /// A file that cannot be read, or is none of results.
    pub fn read(path: &Path) -> Result<Self, BenchError> {
        let bad = |e: &dyn std::fmt::Display| BenchError(format!("{}: {e}", path.display()));
        let text = std::fs::read_to_string(path).map_err(|e| bad(&e))?;
        serde_json::from_str(&text).map_err(|e| bad(&e))
    }

    /// Writes the file, as JSON.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), BenchError> {
        let mut text = serde_json::to_string_pretty(self).map_err(BenchError::from_display)?;
        text.push('\n');
        atomic_write(path, |out| out.write_all(text.as_bytes())).map_err(BenchError::from_display)
    }

    /// As Markdown: where it was measured, and the table.
    pub fn markdown(&self) -> String {
        let Machine { processor, threads, system, load } = &self.machine;
        let load = load.map_or(String::new(), |load| format!(", load {load} before"));
        let timed = self.repeats.map_or(String::new(), |n| format!("; each part timed {n} times"));
        let models = if self.real_models { "" } else { "; without real models, generated ones in their places" };
        format!(
            "Version {}, {processor}, {threads} threads, {system}{load}{timed}{models}.\n\n{}",
            self.version,
            table(&self.rows)
        )
    }

    /// A page with these results in the place of those that it has.
    ///
    /// # Errors
    /// A page without the two lines that enclose them.
    pub fn fill(&self, page: &str) -> Result<String, BenchError> {
        let parts = page.split_once(BEGIN).and_then(|(before, rest)| Some((before, rest.split_once(END)?.1)));
        let (before, after) = parts.ok_or_else(|| {
            BenchError(format!(
                "the page has no place for results; give it the lines {} and {}",
                BEGIN.trim(),
                END.trim()
            ))
        })?;
        Ok(format!("{before}{BEGIN}\n{}\n{END}{after}", self.markdown()))
    }
}

/// The committed results.
pub fn committed() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("results").join("ratios.json")
}

/// The page that is made of them.
pub fn page() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/performance.md")
}

/// Puts the committed results into the page.
///
/// # Errors
/// Files that cannot be read or written, and a page without a place for results.
pub fn fill_page() -> Result<String, BenchError> {
    let (results, page) = (Results::read(&committed())?, page());
    let text = std::fs::read_to_string(&page).map_err(|e| BenchError(format!("{}: {e}", page.display())))?;
    let filled = results.fill(&text)?;
    atomic_write(&page, |out| out.write_all(filled.as_bytes())).map_err(BenchError::from_display)?;
    Ok(format!("{}: {} rows", page.display(), results.rows.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ratios::Threshold;

    fn results() -> Results {
        let row = |quantity: &str, threshold| Row {
            quantity: quantity.to_string(),
            against: "b".to_string(),
            figures: "1.00; 2.00 ms".to_string(),
            ratio: Some(1.0 / 3.0),
            of_medians: None,
            threshold,
        };
        let rows = vec![row("one", Some(Threshold::AtLeast(0.25))), row("two", None)];
        Results::new(rows, 3, Machine { load: None, ..Machine::here() })
    }

    #[test]
    fn the_page_shows_the_committed_results() {
        let text = std::fs::read_to_string(page()).unwrap();
        let results = Results::read(&committed()).unwrap();
        assert!(results.rows.len() > 10, "{} rows", results.rows.len());
        let filled = results.fill(&text).unwrap();
        assert_eq!(filled, text, "docs/performance.md is not of the results; run `cargo xtask performance`");
        let mut other = results;
        other.rows[0].ratio = Some(1e6);
        assert_ne!(other.fill(&text).unwrap(), text);
    }

    #[test]
    fn results_come_back_from_their_file() {
        let folder = std::env::temp_dir().join(format!("proxel-results-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let (path, results) = (folder.join("ratios.json"), results());
        results.write(&path).unwrap();
        assert_eq!(Results::read(&path).unwrap(), results);
        std::fs::write(&path, "{}").unwrap();
        let said = Results::read(&path).unwrap_err().to_string();
        assert!(said.contains("ratios.json") && said.contains("version"), "{said}");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_page_without_a_place_is_refused() {
        let results = results();
        assert!(results.fill("# Performance\n").unwrap_err().to_string().contains("no place for results"));
        let once = results.fill(&format!("a\n{BEGIN}stale\n{END}b\n")).unwrap();
        assert!(once.starts_with("a\n") && once.ends_with("b\n") && !once.contains("stale"));
        assert!(once.contains("| one | b | 1.00; 2.00 ms | 0.333 |  | at least 0.25 | yes |"), "{once}");
        assert_eq!(results.fill(&once).unwrap(), once);
    }
}
