//! What holds and loads a body: pins, soft springs, loads, equalities and obstacles, read from a small file.
//!
//! A text file lists 0-based vertex indices, any number a line, `#` starts a comment; each of these
//! vertices is pinned where the start has it. A `.toml` or `.json` file has named groups instead:
//!
//! ```toml
//! [groups.foot]                                  # stays where the start has it
//! box = { min = [-1, -1, -1], max = [1, -0.9, 1] }
//!
//! [groups.hand]                                  # goes to a new place
//! sphere = { center = [0, 2, 0], radius = 0.3 }
//! rotate = { axis = [0, 0, 1], angle = 90 }      # degrees, around the group's centroid
//! translate = [0, 0.5, 0]
//!
//! [groups.string]                                # pulled, not held
//! indices = [12, 13]
//! targets = [[0, 3, 0], [0, 3, 0.1]]
//! stiffness = 1e4
//!
//! [groups.wind]                                  # pushed
//! plane = { point = [0, 1, 0], normal = [0, 1, 0] }
//! force = { total = [10, 0, 0] }
//!
//! [groups.lung]                                  # inflated: faces with all corners in the group
//! sphere = { center = [0, 1, 0], radius = 0.5 }
//! pressure = 50                                  # force over area, along the outward normal
//!
//! [[equality]]                                   # sum a_i x_i = value, exactly
//! vertices = [3, 4]
//! coefficients = [1, -1]
//! value = [0, 0.1, 0]
//!
//! [[obstacle]]                                   # all vertices stay on the side that the normal points to
//! point = [0, -1, 0]
//! normal = [0, 1, 0]
//! ```
//!
//! [`PinFile::read`] parses and checks what can be checked alone, [`PinFile::resolve`] holds it
//! against a body, [`PinFile::refined`] carries it over to a refined one.

mod around;
mod error;
mod group;
mod motion;
mod refine;
mod resolve;
mod rigid;
mod select;
#[cfg(test)]
mod tests;
mod text;

pub use around::EqualityRow;
pub use error::InputError;
pub use group::{Combine, Force, Group, HalfSpace, Index, Region, Rotation, Scaling, Sphere};
pub use resolve::Handles;
pub use rigid::RigidMotion;

use std::collections::BTreeMap;
use std::path::Path;

use around::Around;

use proxel_mesh::atomic_write;

/// A pins file as it was written: not yet held against any mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct PinFile {
    /// The file, for messages.
    name: String,
    content: Content,
    around: Around,
}

#[derive(Clone, Debug, PartialEq)]
enum Content {
    /// Indices in file order, each with its 1-based line.
    List(Vec<(u32, usize)>),
    /// Groups by name.
    Groups(BTreeMap<String, Group>),
}

impl PinFile {
    /// Reads a pins file: groups where the extension is `.toml` or `.json`, else a list of indices.
    ///
    /// # Errors
    /// A file that cannot be read, or the first thing in it that is no index or no group, with its
    /// line.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let name = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|e| InputError::io(path, &e))?;
        let Ok(content) = String::from_utf8(bytes) else {
            return Err(InputError::new(name, "it is no text", "give a text, .toml or .json file"));
        };
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("toml") => Self::from_toml(name, &content),
            Some("json") => Self::from_json(name, &content),
            _ => Self::from_text(name, &content),
        }
    }

    /// Parses a list of indices; `name` stands in messages for the file.
    ///
    /// # Errors
    /// The first word that is no vertex index, with its line.
    pub fn from_text(name: impl Into<String>, content: &str) -> Result<Self, InputError> {
        let name = name.into();
        let list = text::parse(&name, content)?;
        Ok(PinFile { name, content: Content::List(list), around: Around::default() })
    }

    /// Parses groups written in TOML.
    ///
    /// # Errors
    /// A syntax error, an unknown key, a group that contradicts itself.
    pub fn from_toml(name: impl Into<String>, content: &str) -> Result<Self, InputError> {
        let name = name.into();
        let (groups, around) = group::parse_toml(&name, content)?;
        Ok(PinFile { name, content: Content::Groups(groups), around })
    }

    /// Parses groups written in JSON: `{"groups": {"hand": {"indices": [1, 2]}}}`.
    ///
    /// # Errors
    /// As [`from_toml`](Self::from_toml).
    pub fn from_json(name: impl Into<String>, content: &str) -> Result<Self, InputError> {
        let name = name.into();
        let (groups, around) = group::parse_json(&name, content)?;
        Ok(PinFile { name, content: Content::Groups(groups), around })
    }

    /// The groups, where the file has groups.
    pub fn groups(&self) -> Option<&BTreeMap<String, Group>> {
        match &self.content {
            Content::List(_) => None,
            Content::Groups(groups) => Some(groups),
        }
    }

    /// The file as [`write`](Self::write) puts it at a path of this extension: a list as a list,
    /// groups as JSON where the extension is `.json`, else as TOML.
    ///
    /// # Errors
    /// Groups under a name that would be read as a list, or a list under one that would be read as
    /// groups.
    pub fn to_text(&self, path: &Path) -> Result<String, InputError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        let file = path.display().to_string();
        let bad = |what: &str, remedy: &str| Err(InputError::new(file.clone(), what, remedy));
        match (&self.content, extension.as_deref()) {
            (Content::List(_), Some("toml" | "json")) => {
                bad("a list of pins cannot be written as groups", "name a file that ends in .txt")
            }
            (Content::List(list), _) => Ok(list.iter().map(|(v, _)| format!("{v}\n")).collect()),
            (Content::Groups(groups), Some("json")) => group::to_json(&file, groups, &self.around),
            (Content::Groups(groups), Some("toml")) => group::to_toml(&file, groups, &self.around),
            (Content::Groups(_), _) => {
                bad("groups of pins cannot be written as a list", "name a file that ends in .toml or .json")
            }
        }
    }

    /// Writes the file, whole or not at all.
    ///
    /// # Errors
    /// As [`to_text`](Self::to_text), or a path that cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), InputError> {
        let text = self.to_text(path)?;
        atomic_write(path, |w| w.write_all(text.as_bytes())).map_err(InputError::from)
    }
}
