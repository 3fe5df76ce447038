//! Output files: checked before the work, written whole after it.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use proxel::report::TraceRow;
use proxel_mesh::{Format, atomic_write, check_writable};

use crate::refusal::Refusal;

/// The files that writing a mesh to `path` makes: two for TetGen.
pub fn mesh_files(path: &Path) -> Result<Vec<PathBuf>, Refusal> {
    Ok(match Format::from_path(path)? {
        Format::TetGen => vec![path.with_extension("node"), path.with_extension("ele")],
        _ => vec![path.to_owned()],
    })
}

/// The outputs of a run, by the option that names them.
#[derive(Default)]
pub struct Outputs {
    files: Vec<(&'static str, PathBuf)>,
}

impl Outputs {
    /// Adds a mesh.
    pub fn mesh(mut self, option: &'static str, path: &Path) -> Result<Self, Refusal> {
        self.files.extend(mesh_files(path)?.into_iter().map(|f| (option, f)));
        Ok(self)
    }

    /// Adds a file whose extension must be one of these (any if there are none).
    pub fn file(mut self, option: &'static str, path: Option<&Path>, extensions: &[&str]) -> Result<Self, Refusal> {
        let Some(path) = path else { return Ok(self) };
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        if !extensions.is_empty() && !extensions.contains(&extension.as_str()) && !is_device(path) {
            let wanted = extensions.join(" or .");
            let text = format!("{}: {option} writes .{wanted} files; give a name that ends so", path.display());
            return Err(Refusal::new(text));
        }
        self.files.push((option, path.to_owned()));
        Ok(self)
    }

    /// Checks that all can be written and no two are the same.
    pub fn check(&self) -> Result<(), Refusal> {
        let mut seen: HashMap<PathBuf, &str> = HashMap::new();
        for (option, path) in &self.files {
            check_writable(path)?;
            if is_device(path) {
                continue;
            }
            let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
            let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
            let name = folder.join(path.file_name().unwrap_or_default());
            if let Some(other) = seen.insert(name, option) {
                let text = format!("{}: {other} and {option} name the same file; give them two names", path.display());
                return Err(Refusal::new(text));
            }
        }
        Ok(())
    }
}

/// `/dev/null`, `/dev/stdout`, a pipe.
fn is_device(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir())
}

/// Writes text, whole or not at all.
pub fn write_text(path: &Path, text: &str) -> Result<(), Refusal> {
    Ok(atomic_write(path, |w| w.write_all(text.as_bytes()))?)
}

/// Writes a report as JSON.
pub fn write_report(path: &Path, report: &impl serde::Serialize) -> Result<(), Refusal> {
    let text =
        serde_json::to_string_pretty(report).map_err(|e| Refusal::new(format!("the report cannot be written: {e}")))?;
    write_text(path, &(text + "\n"))
}

/// Writes the rows of a trace as CSV.
pub fn write_trace(path: &Path, rows: &[TraceRow]) -> Result<(), Refusal> {
    let lines: Vec<String> = rows.iter().map(TraceRow::to_csv).collect();
    write_text(path, &format!("{}\n{}\n", TraceRow::HEADER, lines.join("\n")))
}
