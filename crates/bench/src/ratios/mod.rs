//! Speed and memory as ratios within one run, beside the thresholds that were set for them.

mod closest;
mod decompositions;
mod growth;
mod images;
mod iteration;
mod memory;
mod samples;
mod solves;
mod wires;

pub use growth::growth;
pub use images::rows as images;
pub use memory::{CHILD, Footprint, child, footprint};
pub use samples::Samples;

use crate::BenchError;
use crate::parts::centaur_or_beam;
use crate::table::Table;

/// One line of the result.
#[derive(Clone, Debug)]
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
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// Measures all rows that need no other program. `repeats` is how often each part of an iteration is timed.
///
/// # Errors
/// Data that cannot be read, a child process that fails.
pub fn measure(repeats: usize, tell: &mut dyn FnMut(&str)) -> Result<Vec<Row>, BenchError> {
    tell("decompositions");
    let mut rows = decompositions::rows(repeats)?;
    tell("nearest points");
    rows.extend(closest::rows(repeats)?);
    tell("images: an iteration and its transforms");
    rows.extend(images(repeats)?);
    tell("wires: an iteration and its parts");
    rows.extend(wires::rows(repeats.div_ceil(2))?);
    let model = centaur_or_beam()?;
    tell(&format!("{}: an iteration and its parts", model.name));
    rows.extend(iteration::rows(&model, repeats)?);
    tell(&format!("{}: memory, in a process of its own", model.name));
    rows.extend(memory::rows()?);
    rows.extend(solves::rows(tell)?);
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
