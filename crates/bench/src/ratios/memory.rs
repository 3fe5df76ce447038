//! What a solve takes of memory, measured in a process of its own.

use super::{Row, Threshold};
use crate::BenchError;
use crate::parts::centaur_or_beam;
use proxel::deform::{Hooks, deform};
use proxel::settings::{DeformSettings, MethodName};

/// The argument that makes the program the child which is measured.
pub const CHILD: &str = "--memory-child";

/// Iterations of the solve that is measured: past the first reweighting.
const ITERATIONS: usize = 60;

/// Memory of a process that read a model and solved it for some iterations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Footprint {
    /// Its largest resident memory.
    pub peak: u64,
    /// Bytes of the factor, workspace included.
    pub factor: u64,
    /// Tetrahedra.
    pub tets: u64,
}

/// Solves, and gives its footprint as text for the parent: what the program does when its argument is [`CHILD`].
///
/// # Errors
/// A model that cannot be read or solved; a system without /proc.
pub fn child() -> Result<String, BenchError> {
    let model = centaur_or_beam()?;
    let settings = DeformSettings {
        method: MethodName::Wrapd,
        max_iters: ITERATIONS,
        threads: Some(2),
        ..DeformSettings::default()
    };
    let mut input = model.input;
    input.reference = None; // what only measures is no part of a solve
    let end = deform(&input, &settings, &mut Hooks::default()).map_err(BenchError::from_display)?;
    Ok(format!("{} {} {}", peak_bytes()?, end.report.factor_bytes.unwrap_or(0), input.rest.tets.len()))
}

/// Largest resident memory of this process.
///
/// # Errors
/// A system without /proc.
pub fn peak_bytes() -> Result<u64, BenchError> {
    let status =
        std::fs::read_to_string("/proc/self/status").map_err(|e| BenchError(format!("/proc/self/status: {e}")))?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:")).and_then(|l| l.split_whitespace().next());
    let kilobytes: Option<u64> = line.and_then(|v| v.parse().ok());
    kilobytes.map(|k| k * 1024).ok_or_else(|| BenchError("/proc/self/status: it has no VmHWM".to_string()))
}

/// Runs this program as its own child.
///
/// # Errors
/// A child that fails.
pub fn footprint() -> Result<Footprint, BenchError> {
    let program = std::env::current_exe().map_err(BenchError::from_display)?;
    let output = std::process::Command::new(program).arg(CHILD).output().map_err(BenchError::from_display)?;
    let text = String::from_utf8_lossy(&output.stdout);
    let numbers: Vec<u64> = text.split_whitespace().filter_map(|w| w.parse().ok()).collect();
    match numbers[..] {
        [peak, factor, tets] if output.status.success() => Ok(Footprint { peak, factor, tets }),
        _ => Err(BenchError(format!("the memory child failed: {}", String::from_utf8_lossy(&output.stderr).trim()))),
    }
}

pub(super) fn rows() -> Result<Vec<Row>, BenchError> {
    let Footprint { peak, factor, tets } = footprint()?;
    let megabytes = |b: u64| b as f64 / 1e6;
    Ok(vec![Row {
        quantity: format!("bytes of {ITERATIONS} iterations of wrapd less the factor"),
        against: format!("{tets} tetrahedra"),
        figures: format!("{:.1} MB, the factor {:.1} MB", megabytes(peak), megabytes(factor)),
        ratio: Some(peak.saturating_sub(factor) as f64 / tets.max(1) as f64),
        of_medians: None,
        threshold: Some(Threshold::AtMost(640.0)),
    }])
}
