//! Speed and memory as ratios within one run, beside the thresholds that were set for them.

mod closest;
mod decompositions;
mod fields;
mod growth;
mod images;
mod iteration;
mod memory;
mod precision;
mod results;
mod samples;
mod solves;
mod wires;

pub use growth::growth;
pub use memory::{CHILD, Footprint, child, footprint};
pub use results::{Machine, Results, committed, fill_page, page};
pub use samples::Samples;

use crate::BenchError;
use crate::parts::{centaur_or_beam, pool};
use crate::table::Table;
use proxel::mesh::{Mesh, read_mesh};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// One line of the result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// What was measured.
    pub quantity: String,
    /// What it was measured against.
    pub against: String,
    /// The figures behind the ratio.
    pub figures: String,
    /// The ratio, of minima where times were repeated.
    pub ratio: Option<f64>,
    /// The ratio of medians, where times were repeated: near the other one on a quiet machine.
    pub of_medians: Option<f64>,
    /// What it is to be.
    pub threshold: Option<Threshold>,
}

/// What a ratio is to be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Threshold {
    /// No more than this.
    AtMost(f64),
    /// No less than this.
    AtLeast(f64),
}

impl Threshold {
    /// Whether a ratio meets it.
    pub fn is_met(self, ratio: f64) -> bool {
        match self {
            Threshold::AtMost(v) => ratio <= v,
            Threshold::AtLeast(v) => ratio >= v,
        }
    }
}

impl std::fmt::Display for Threshold {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Threshold::AtMost(v) => write!(f, "at most {v}"),
            Threshold::AtLeast(v) => write!(f, "at least {v}"),
        }
    }
}

/// The rows as Markdown.
pub fn table(rows: &[Row]) -> String {
    let mut table = Table::new(["quantity", "against", "least; median", "ratio", "of medians", "threshold", "met"]);
    for row in rows {
        let number = |r: Option<f64>| r.map_or(String::new(), |r| format!("{r:.3}"));
        let threshold = row.threshold.map_or(String::new(), |t| t.to_string());
        let met = match (row.ratio, row.threshold) {
            (Some(ratio), Some(threshold)) => if threshold.is_met(ratio) { "yes" } else { "no" }.to_string(),
            _ => String::new(),
        };
        table.row([
            row.quantity.clone(),
            row.against.clone(),
            row.figures.clone(),
            number(row.ratio),
            number(row.of_medians),
            threshold,
            met,
        ]);
    }
    table.to_string()
}

/// A mesh, called as its file is, wherever that lies: rows are committed.
fn read(file: &Path) -> Result<Mesh, BenchError> {
    let mesh = read_mesh(file).map_err(BenchError::from_display)?;
    let name = file.file_name().map_or(mesh.name.clone(), |name| name.to_string_lossy().into_owned());
    Ok(Mesh { name, ..mesh })
}

/// Rows by the first word of their name.
type Rows<'a> = (&'a str, &'a dyn Fn(&mut dyn FnMut(&str)) -> Result<Vec<Row>, BenchError>);

/// Measures all rows that need no other program, or the `only` ones. `repeats` is how often each part of an iteration is timed.
///
/// # Errors
/// Data that cannot be read, a child process that fails, a name that there is not.
pub fn measure(repeats: usize, only: Option<&str>, tell: &mut dyn FnMut(&str)) -> Result<Vec<Row>, BenchError> {
    let all: [Rows<'_>; 9] = [
        ("decompositions", &|_| decompositions::rows(repeats)),
        ("closest", &|_| closest::rows(repeats)),
        ("images", &|_| images::rows(repeats)),
        ("precision", &|_| pool(1)?.install(|| precision::rows(512, repeats))),
        ("wires", &|_| wires::rows(repeats.div_ceil(2))),
        ("fields", &|_| fields::rows(repeats)),
        ("iteration", &|_| iteration::rows(&centaur_or_beam()?, repeats)),
        ("memory", &|_| memory::rows()),
        ("solves", &solves::rows),
    ];
    let mut rows = Vec::new();
    for (name, measured) in all.iter().filter(|(name, _)| only.is_none_or(|only| only == *name)) {
        tell(name);
        rows.extend(measured(tell)?);
    }
    if rows.is_empty() {
        let names: Vec<&str> = all.iter().map(|(name, _)| *name).collect();
        return Err(BenchError(format!("there are no such rows; there are {}", names.join(", "))));
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_say_which_way() {
        assert!(Threshold::AtMost(1.5).is_met(1.5) && !Threshold::AtMost(1.5).is_met(1.6));
        assert!(Threshold::AtLeast(6.0).is_met(6.0) && !Threshold::AtLeast(6.0).is_met(5.9));
        assert!(!Threshold::AtMost(1.5).is_met(f64::NAN));
    }
}
