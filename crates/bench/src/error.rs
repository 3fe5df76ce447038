//! Errors: sentences for whoever started the program.

/// Why a bench or a reproduction cannot be done: a sentence that names the item and the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BenchError(pub String);

impl std::fmt::Display for BenchError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for BenchError {}

impl BenchError {
    /// From any error that explains itself.
    pub fn from_display(e: impl std::fmt::Display) -> Self {
        BenchError(e.to_string())
    }
}
