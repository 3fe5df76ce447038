//! Words as numbers, numbers as vertex indices, and how both go wrong.

use std::io::{self, Write};

use crate::error::{ErrorKind, Item, MeshError, Result};

/// Why a number is no vertex index.
pub(crate) enum BadIndex {
    /// Below zero.
    Negative { index: i64 },
    /// Below the base.
    Small { index: i64, base: u32 },
    /// Past the last vertex.
    Large { index: i64, base: u32, n: usize },
    /// Past what 32 bits hold.
    Huge { index: i64 },
}

impl BadIndex {
    pub fn into_error(self, file: &str) -> MeshError {
        match self {
            BadIndex::Negative { index } => MeshError::new(
                ErrorKind::NegativeIndex,
                file,
                format!("vertex index {index} is negative"),
                "correct the index",
            ),
            BadIndex::Small { index, base } => MeshError::new(
                ErrorKind::IndexOutOfRange,
                file,
                format!("vertex index {index} is out of range, vertices are numbered from {base}"),
                "correct the index",
            ),
            BadIndex::Large { index, base, n } => MeshError::new(
                ErrorKind::IndexOutOfRange,
                file,
                format!(
                    "vertex index {index} is out of range, the {n} vertices are numbered {base} to {}",
                    n as i128 + i128::from(base) - 1
                ),
                "correct the index or add the missing vertices",
            ),
            BadIndex::Huge { index } => MeshError::new(
                ErrorKind::IndexOutOfRange,
                file,
                format!("vertex index {index} is out of range, no index may exceed 4294967294"),
                "correct the index",
            ),
        }
    }
}

/// A number of a file, counted from `base`, as a 0-based index.
pub(crate) fn vertex_index(index: i64, base: u32) -> std::result::Result<u32, BadIndex> {
    if index < 0 {
        return Err(BadIndex::Negative { index });
    }
    if index < i64::from(base) {
        return Err(BadIndex::Small { index, base });
    }
    match u32::try_from(index - i64::from(base)) {
        Ok(v) if v < u32::MAX => Ok(v),
        _ => Err(BadIndex::Huge { index }),
    }
}

/// A finite coordinate of vertex `i`.
pub(crate) fn coordinate(file: &str, line: usize, word: &[u8], i: usize) -> Result<f64> {
    match parse_f64(word) {
        Some(x) if x.is_finite() => Ok(x),
        Some(_) => Err(MeshError::new(
            ErrorKind::NonFinite,
            file,
            format!("coordinate {} is not finite", show(word)),
            "replace it by a finite number",
        )
        .at_line(line)
        .at_item(Item::Vertex(i))),
        None => Err(not_a_number(file, line, word, "a coordinate").at_item(Item::Vertex(i))),
    }
}

/// The error that a word is no number.
pub(crate) fn not_a_number(file: &str, line: usize, word: &[u8], what: &str) -> MeshError {
    let what = format!("{} is no number where {what} is expected", show(word));
    MeshError::new(ErrorKind::NotANumber, file, what, "correct the word").at_line(line)
}

/// A word of the file as it may stand in a message: quoted, escaped, short.
pub(crate) fn show(word: &[u8]) -> String {
    const LONGEST: usize = 32;
    let cut = &word[..word.len().min(LONGEST)];
    let dots = if word.len() > LONGEST { "..." } else { "" };
    format!("`{}{dots}`", cut.escape_ascii())
}

/// A decimal integer with an optional sign; `None` for anything else.
pub(crate) fn parse_int(word: &[u8]) -> Option<i64> {
    // The hot case, a handful of digits, without the detour over UTF-8.
    if !word.is_empty() && word.len() <= 18 && word.iter().all(u8::is_ascii_digit) {
        return Some(word.iter().fold(0, |n, &d| n * 10 + i64::from(d - b'0')));
    }
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// A decimal number, correctly rounded; also `nan` and `inf`, which callers refuse by name.
pub(crate) fn parse_f64(word: &[u8]) -> Option<f64> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// Writes `x y z` with 17 significant digits, from which every f64 comes back bit for bit.
pub(crate) fn write_point(w: &mut dyn Write, p: &[f64; 3]) -> io::Result<()> {
    write!(w, "{:.16e} {:.16e} {:.16e}", p[0], p[1], p[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers() {
        assert_eq!(parse_int(b"-12"), Some(-12));
        assert_eq!(parse_int(b"9223372036854775808"), None);
        assert_eq!(parse_int(b"1.0"), None);
        assert_eq!(parse_int(b""), None);
    }
}
