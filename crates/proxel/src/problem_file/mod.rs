//! A problem in one file: everything that `deform` or a frame of `simulate` begins with, to be solved again anywhere.
//!
//! The file is JSON (docs/problem-files.md). Numbers are written with the digits that bring the same bits back, and the
//! solvers give the same bits for the same numbers, so that a problem which is solved again gives the same figures.
//!
//! ```
//! use proxel::deform::{DeformInput, Hooks, deform};
//! use proxel::mesh::generate::{CellSplit, beam};
//! use proxel::problem_file::ProblemFile;
//! use proxel::settings::DeformSettings;
//!
//! let rest = beam([2, 1, 1], [2.0, 1.0, 1.0], CellSplit::Five)?;
//! let fixed = vec![(0, rest.points[0]), (1, rest.points[1]), (11, [2.5, 1.0, 1.0])];
//! let input = DeformInput { rest, fixed, ..DeformInput::default() };
//! let text = ProblemFile::deform(&input, &DeformSettings::default())?.to_text()?;
//! let ProblemFile::Deform { input: again, settings } = ProblemFile::parse("problem.json", &text)? else { panic!() };
//! let solve = |input| deform(input, &settings, &mut Hooks::default());
//! assert_eq!(solve(&input)?.positions, solve(&again)?.positions);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod mesh;
mod pose;
mod step;
#[cfg(test)]
mod tests;

use crate::deform::DeformInput;
use crate::pins::InputError;
use crate::settings::DeformSettings;
use crate::simulate::{SceneFile, State};
use pose::Pose;
use proxel_mesh::atomic_write;
use serde::{Deserialize, Serialize};
use std::path::Path;
use step::Step;

/// What a file begins with.
const FORMAT: &str = "proxel-problem";
/// Its version; readers refuse others.
const VERSION: u32 = 1;

/// What can be solved again.
#[derive(Clone, Debug)]
pub enum ProblemFile {
    /// A body to be posed.
    Deform {
        /// What is deformed, and how it is held.
        input: Box<DeformInput>,
        /// How.
        settings: Box<DeformSettings>,
    },
    /// A frame of a simulation.
    Simulate {
        /// The scene, with the meshes that it names in it.
        scene: Box<SceneFile>,
        /// What the frame begins with.
        state: State,
    },
}

/// The file as it stands.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    format: String,
    version: u32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    deform: Option<Pose>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    simulate: Option<Step>,
}

impl ProblemFile {
    /// The problem that `deform` is given. Threads and time limits are left out: they change no figure of a run that ends.
    ///
    /// # Errors
    /// An input that only the library makes of a surface in a lattice: dump the surface itself.
    pub fn deform(input: &DeformInput, settings: &DeformSettings) -> Result<Self, InputError> {
        if input.skin.is_some() || input.fill.is_some() || !input.ties.is_empty() {
            return Err(InputError::new(
                &input.rest.name,
                "it is a lattice that carries a surface",
                "write the problem of the surface, of which deform makes the same lattice",
            ));
        }
        let settings = Box::new(DeformSettings { threads: None, time_limit: None, ..settings.clone() });
        Ok(ProblemFile::Deform { input: Box::new(input.clone()), settings })
    }

    /// The frame after `state`.
    ///
    /// # Errors
    /// A mesh that the scene names and that cannot be read.
    pub fn simulate(scene: &SceneFile, state: &State) -> Result<Self, InputError> {
        Ok(ProblemFile::Simulate { scene: Box::new(scene.clone().embedded()?), state: state.clone() })
    }

    /// The text of the file.
    ///
    /// # Errors
    /// A number that is not finite, by what it belongs to: JSON has none such.
    pub fn to_text(&self) -> Result<String, InputError> {
        let (deform, simulate) = match self {
            ProblemFile::Deform { input, settings } => (Some(Pose::of(input, settings)?), None),
            ProblemFile::Simulate { scene, state } => (None, Some(Step::of(scene, state)?)),
        };
        let written = Written { format: FORMAT.to_owned(), version: VERSION, deform, simulate };
        let text = serde_json::to_string(&written)
            .map_err(|e| InputError::new("problem", format!("it cannot be written: {e}"), "report this"))?;
        Ok(text + "\n")
    }

    /// Writes the file, whole or not at all.
    ///
    /// # Errors
    /// As [`Self::to_text`]; a path that cannot be written to.
    pub fn write(&self, path: &Path) -> Result<(), InputError> {
        let text = self.to_text()?;
        atomic_write(path, |w| w.write_all(text.as_bytes()))
            .map_err(|e| InputError::new(path.display().to_string(), e.to_string(), "give another path"))
    }

    /// Reads a file. What the solver checks is checked when it is solved.
    ///
    /// # Errors
    /// A file that cannot be read, and as [`Self::parse`].
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let name = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|e| InputError::io(path, &e))?;
        match String::from_utf8(bytes) {
            Ok(text) => Self::parse(&name, &text),
            Err(_) => Err(InputError::new(name, "it is no text", "give a file that --dump has written")),
        }
    }

    /// Parses a file; `name` stands in messages for it.
    ///
    /// # Errors
    /// What is no such file, or one of another version; arrays that do not fit each other.
    pub fn parse(name: &str, text: &str) -> Result<Self, InputError> {
        let refuse = |what: &str| InputError::new(name, what, "give a file that --dump has written");
        if !text.contains(FORMAT) {
            return Err(refuse("it is no problem file"));
        }
        let written: Written = serde_json::from_str(text).map_err(|e| {
            let said = e.to_string();
            let message = said.rfind(" at line ").map_or(&said[..], |at| &said[..at]);
            InputError::from_serde(name, Some(e.line()).filter(|&l| l > 0), message)
        })?;
        if written.format != FORMAT {
            return Err(refuse("it is no problem file"));
        }
        if written.version != VERSION {
            let (theirs, what) = (written.version, "use the release that has written it, or write it anew");
            return Err(InputError::new(name, format!("its version is {theirs}, this release reads {VERSION}"), what));
        }
        match (written.deform, written.simulate) {
            (Some(pose), None) => pose.into_problem(name),
            (None, Some(step)) => step.into_problem(name),
            _ => Err(refuse("it has to have either deform or simulate")),
        }
    }
}

/// That all numbers are finite.
fn finite<'a>(name: &str, what: &str, numbers: impl IntoIterator<Item = &'a f64>) -> Result<(), InputError> {
    match numbers.into_iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(at) => {
            Err(InputError::new(name, format!("number {at} (0-based) of {what} is not finite"), "give finite numbers"))
        }
    }
}
