//! What is wrong with an input, in one line.

use std::fmt;
use std::path::Path;

use proxel_mesh::MeshError;

/// An input that cannot be used. `Display` is exactly one line:
/// `FILE: line L: what is wrong; what to do`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputError {
    file: String,
    line: Option<usize>,
    what: String,
    remedy: String,
}

impl InputError {
    /// An error about a file as a whole.
    pub fn new(file: impl Into<String>, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        InputError { file: file.into(), line: None, what: what.into(), remedy: remedy.into() }
    }

    /// Adds the 1-based line of the file.
    #[must_use]
    pub fn at_line(mut self, line: usize) -> Self {
        self.line = Some(line);
        self
    }

    /// The file, as the caller named it.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The 1-based line, where there is one.
    pub fn line(&self) -> Option<usize> {
        self.line
    }

    /// What is wrong.
    pub fn what(&self) -> &str {
        &self.what
    }

    /// What the user can do about it.
    pub fn remedy(&self) -> &str {
        &self.remedy
    }

    /// Wraps an error of the operating system while reading.
    pub fn io(path: &Path, error: &std::io::Error) -> Self {
        use std::io::ErrorKind;
        let file = path.display().to_string();
        match error.kind() {
            ErrorKind::NotFound => InputError::new(file, "no such file", "check the path"),
            ErrorKind::IsADirectory => InputError::new(file, "it is a folder", "name a file"),
            ErrorKind::PermissionDenied => {
                InputError::new(file, "permission to read was denied", "change its permissions")
            }
            _ => InputError::new(file, format!("cannot read: {error}"), "check the path and the disk"),
        }
    }

    /// Wraps what serde says about a key or a value: the nearest known key or name becomes the remedy.
    pub(crate) fn from_serde(file: &str, line: Option<usize>, message: &str) -> Self {
        let message = message.lines().next().unwrap_or_default().trim();
        let (what, remedy) = match nearest_key(message) {
            Some((unknown, known)) => {
                let kind = if message.starts_with("unknown variant ") { "name" } else { "key" };
                (format!("unknown {kind} `{unknown}`"), format!("did you mean `{known}`?"))
            }
            None => readable(message),
        };
        InputError { file: file.to_owned(), line, what, remedy }
    }
}

/// What a reader says of a value that is of the wrong kind, in the words of those who write files, and what to do.
fn readable(message: &str) -> (String, String) {
    /// What readers call a kind, what it is, and the remedy.
    const KINDS: [(&str, &str, &str); 9] = [
        (
            "invalid type: map, expected a sequence",
            "",
            "give a list; in TOML its sections have double brackets, [[..]]",
        ),
        ("expected f64", "expected a number", "give a number"),
        ("expected usize", "expected a whole number", "give a whole number, 0 or more"),
        ("expected u32", "expected a whole number", "give a whole number, 0 or more"),
        ("expected a boolean", "", "give true or false"),
        ("expected value", "", "give a value; JSON has no NaN and no infinity"),
        ("number out of range", "", "give a finite number"),
        ("EOF while parsing", "", "the file ends too early; complete it"),
        ("wanted exactly 1 element", "", "give exactly one of them"),
    ];
    match KINDS.iter().find(|(said, ..)| message.contains(said)) {
        Some((_, "", remedy)) => (message.to_owned(), (*remedy).to_owned()),
        Some((said, meant, remedy)) => (message.replace(said, meant), (*remedy).to_owned()),
        None => (message.to_owned(), "correct it".to_owned()),
    }
}

/// From "unknown field `radios`, expected one of `center`, `radius`", or from "unexpected keys in table: radios, available keys:
/// center, radius" as the TOML reader has it: (`radios`, `radius`), if one of the known is near.
fn nearest_key(message: &str) -> Option<(&str, &str)> {
    let quoted = message.strip_prefix("unknown field ").or_else(|| message.strip_prefix("unknown variant "));
    let (unknown, known): (&str, Vec<&str>) = match quoted {
        Some(rest) => {
            let mut quoted = rest.split('`').skip(1).step_by(2);
            (quoted.next()?, quoted.collect())
        }
        None => {
            let rest = message.strip_prefix("unexpected keys in table: ")?;
            let (unknown, known) = rest.split_once(", available keys: ")?;
            (unknown.split(", ").next()?, known.split(", ").collect())
        }
    };
    let nearest = known.into_iter().map(|k| (k, edit_distance(unknown, k))).min_by_key(|&(_, distance)| distance);
    let (known, distance) = nearest?;
    (distance <= 1 + unknown.chars().count() / 4).then_some((unknown, known))
}

/// Letters to insert, delete or replace to make `a` into `b` (Levenshtein 1966).
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

impl From<MeshError> for InputError {
    fn from(e: MeshError) -> Self {
        // The text of a MeshError already has all parts in this order.
        let text = e.to_string();
        let what = text.strip_prefix(&format!("{}: ", e.file())).unwrap_or(&text);
        let what = what.strip_suffix(&format!("; {}", e.remedy())).unwrap_or(what);
        InputError::new(e.file(), what, e.remedy())
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let InputError { file, line, what, remedy } = self;
        let text = match line {
            Some(line) => format!("{file}: line {line}: {what}; {remedy}"),
            None => format!("{file}: {what}; {remedy}"),
        };
        // A file name or a foreign message may hold a line break: the promise is one line.
        for c in text.chars() {
            if c.is_control() { write!(f, "{}", c.escape_default())? } else { write!(f, "{c}")? }
        }
        Ok(())
    }
}

impl std::error::Error for InputError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances() {
        assert_eq!(edit_distance("radius", "radius"), 0);
        assert_eq!(edit_distance("radios", "radius"), 1);
        assert_eq!(edit_distance("", "abc"), 3);
        assert_eq!(edit_distance("kitten", "sitting"), 3);
    }

    #[test]
    fn the_nearest_key_is_offered_and_a_far_one_is_not() {
        let m = "unknown field `radios`, expected `center` or `radius`";
        let e = InputError::from_serde("a.toml", Some(3), m);
        assert_eq!(e.to_string(), "a.toml: line 3: unknown key `radios`; did you mean `radius`?");
        let m = "unexpected keys in table: radios, available keys: center, radius";
        let e = InputError::from_serde("a.toml", Some(3), m);
        assert_eq!(e.to_string(), "a.toml: line 3: unknown key `radios`; did you mean `radius`?");
        let m = "unknown field `colour`, expected `center` or `radius`";
        assert_eq!(InputError::from_serde("a.toml", None, m).what(), m);
        for (said, shown) in [
            ("invalid type: string \"fast\", expected f64", "string \"fast\", expected a number; give a number"),
            ("invalid value: integer `-1`, expected usize", "expected a whole number; give a whole number, 0 or more"),
            (
                "invalid type: map, expected a sequence",
                "give a list; in TOML its sections have double brackets, [[..]]",
            ),
            ("invalid length 2, expected an array of length 3", "expected an array of length 3; correct it"),
        ] {
            let text = InputError::from_serde("a.toml", Some(2), said).to_string();
            assert!(text.ends_with(shown) && text.starts_with("a.toml: line 2: "), "{text}");
        }
    }
}
