//! Input that is refused, in one line.

use std::fmt;

use proxel::deform::DeformError;
use proxel::pins::InputError;
use proxel::shape::ShapeError;
use proxel::simulate::SimulateError;
use proxel::unwrap::UnwrapError;
use proxel_mesh::MeshError;

/// Why a command does nothing: file, item, remedy. `Display` is one line.
#[derive(Debug)]
pub struct Refusal(String);

impl Refusal {
    /// A refusal with this text.
    pub fn new(text: impl Into<String>) -> Self {
        Refusal(text.into())
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Names of files may hold line breaks: the promise is one line.
        for c in self.0.chars() {
            if c.is_control() { write!(f, "{}", c.escape_default())? } else { write!(f, "{c}")? }
        }
        Ok(())
    }
}

impl From<MeshError> for Refusal {
    fn from(e: MeshError) -> Self {
        Refusal(e.to_string())
    }
}

impl From<InputError> for Refusal {
    fn from(e: InputError) -> Self {
        Refusal(e.to_string())
    }
}

impl From<DeformError> for Refusal {
    fn from(e: DeformError) -> Self {
        Refusal(e.to_string())
    }
}

impl From<UnwrapError> for Refusal {
    fn from(e: UnwrapError) -> Self {
        Refusal(e.to_string())
    }
}

impl From<SimulateError> for Refusal {
    fn from(e: SimulateError) -> Self {
        Refusal(e.to_string())
    }
}

impl From<ShapeError> for Refusal {
    fn from(e: ShapeError) -> Self {
        Refusal(e.to_string())
    }
}
