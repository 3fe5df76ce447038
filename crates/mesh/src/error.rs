//! The one error type of this crate: a single line that names the file, the item and the remedy.

use std::fmt;
use std::path::Path;

/// What went wrong, for programs; the text of [`MeshError`] is for people.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorKind {
    /// The file does not exist.
    NotFound,
    /// The operating system refused to read or write.
    Io,
    /// The extension names no format that this crate knows.
    UnknownFormat,
    /// A known format, but a part of it that this crate does not read or write.
    Unsupported,
    /// The file ends before everything that it announces was read.
    Truncated,
    /// A word stands where a number should.
    NotANumber,
    /// A coordinate is NaN or infinite.
    NonFinite,
    /// An index points past the last vertex.
    IndexOutOfRange,
    /// A negative index in a format that has none, or one that reaches before the first vertex.
    NegativeIndex,
    /// A vertex occurs twice in one element.
    RepeatedVertex,
    /// No vertices, or no elements where elements are needed.
    Empty,
    /// Counts contradict each other.
    CountMismatch,
    /// A count or size claims more than the file can hold.
    OversizedClaim,
    /// The structure of the file is not that of its format.
    Malformed,
    /// An element without volume or area.
    ZeroVolume,
    /// A tetrahedron turned inside out.
    NegativeVolume,
    /// A parameter of a generator that makes no mesh.
    InvalidParameter,
}

/// The thing in a mesh that an error or a warning is about. Indices are 0-based in file order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Item {
    /// A vertex.
    Vertex(usize),
    /// A tetrahedron.
    Tetrahedron(usize),
    /// A triangle, quad or polygon.
    Face(usize),
    /// An edge element.
    Edge(usize),
}

impl fmt::Display for Item {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Item::Vertex(i) => write!(f, "vertex {i} (0-based)"),
            Item::Tetrahedron(i) => write!(f, "tetrahedron {i} (0-based)"),
            Item::Face(i) => write!(f, "face {i} (0-based)"),
            Item::Edge(i) => write!(f, "edge {i} (0-based)"),
        }
    }
}

/// A failure to read, write or accept a mesh. `Display` is exactly one line:
/// `FILE: line L: ITEM: what is wrong; what to do`.
#[derive(Clone, PartialEq, Eq)]
pub struct MeshError(Box<Inner>);

#[derive(Clone, PartialEq, Eq)]
struct Inner {
    kind: ErrorKind,
    file: String,
    line: Option<usize>,
    item: Option<Item>,
    what: String,
    remedy: String,
}

/// The result of everything here that can fail.
pub type Result<T> = std::result::Result<T, MeshError>;

impl MeshError {
    /// An error about a file (or a mesh of that name) as a whole.
    pub fn new(kind: ErrorKind, file: impl Into<String>, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        let (file, what, remedy) = (file.into(), what.into(), remedy.into());
        MeshError(Box::new(Inner { kind, file, line: None, item: None, what, remedy }))
    }

    /// Adds the 1-based line of the file.
    #[must_use]
    pub fn at_line(mut self, line: usize) -> Self {
        self.0.line = Some(line);
        self
    }

    /// Adds the vertex or element.
    #[must_use]
    pub fn at_item(mut self, item: Item) -> Self {
        self.0.item = Some(item);
        self
    }

    /// The class of the error.
    pub fn kind(&self) -> ErrorKind {
        self.0.kind
    }

    /// The file, as the caller named it.
    pub fn file(&self) -> &str {
        &self.0.file
    }

    /// The 1-based line, where the format has lines.
    pub fn line(&self) -> Option<usize> {
        self.0.line
    }

    /// The vertex or element, where there is one.
    pub fn item(&self) -> Option<Item> {
        self.0.item
    }

    /// What the user can do about it.
    pub fn remedy(&self) -> &str {
        &self.0.remedy
    }

    /// Wraps an error of the operating system; `doing` is "read" or "write".
    pub(crate) fn io(path: &Path, doing: &str, error: &std::io::Error) -> Self {
        use std::io::ErrorKind as Os;
        let file = path.display().to_string();
        match error.kind() {
            Os::NotFound => MeshError::new(ErrorKind::NotFound, file, "no such file", "check the path"),
            Os::PermissionDenied => MeshError::new(
                ErrorKind::Io,
                file,
                format!("permission to {doing} was denied"),
                "change its permissions or give another path",
            ),
            _ => MeshError::new(ErrorKind::Io, file, format!("cannot {doing}: {error}"), "check the path and the disk"),
        }
    }
}

impl fmt::Display for MeshError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Inner { file, line, item, what, remedy, .. } = &*self.0;
        let mut text = format!("{file}: ");
        if let Some(line) = line {
            text += &format!("line {line}: ");
        }
        if let Some(item) = item {
            text += &format!("{item}: ");
        }
        text += what;
        text += "; ";
        text += remedy;
        // A file name or a foreign message may hold a line break: the promise is one line.
        for c in text.chars() {
            if c.is_control() { write!(f, "{}", c.escape_default())? } else { write!(f, "{c}")? }
        }
        Ok(())
    }
}

impl fmt::Debug for MeshError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "MeshError({:?}: {self})", self.0.kind)
    }
}

impl std::error::Error for MeshError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn display_is_one_line_with_every_part() {
        let e = MeshError::new(ErrorKind::NonFinite, "a\nb.node", "x is NaN", "repair it")
            .at_line(7)
            .at_item(Item::Vertex(3));
        assert_eq!(e.to_string(), "a\\nb.node: line 7: vertex 3 (0-based): x is NaN; repair it");
    }
}
