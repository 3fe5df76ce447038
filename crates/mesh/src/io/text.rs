//! Lines, words and numbers of text files, with errors that name the line.

use super::numbers::{BadIndex, coordinate, not_a_number, parse_f64, parse_int, vertex_index};
use crate::error::{ErrorKind, Item, MeshError, Result};

/// A cursor over a text file. It hands out lines (formats where a line is a record) or words
/// (formats where white space is all the same); both count lines for messages.
#[derive(Clone)]
pub(crate) struct Text<'a> {
    file: &'a str,
    data: &'a [u8],
    pos: usize,
    line: usize,
}

/// One line, comment cut off, with at least one word.
#[derive(Clone)]
pub(crate) struct Line<'a> {
    file: &'a str,
    /// 1-based.
    pub number: usize,
    /// Where the words that are left begin in the text (a byte order mark does not count).
    pub at: usize,
    rest: &'a [u8],
}

/// What parts words: all white space of ASCII, the vertical tab too, which `u8::is_ascii_whitespace` leaves out.
pub(crate) fn is_space(b: u8) -> bool {
    matches!(b, b' ' | b'\t' | b'\r' | b'\n' | 0x0b | 0x0c)
}

impl<'a> Text<'a> {
    /// # Errors
    /// [`ErrorKind::Malformed`] if the beginning is no text.
    pub fn new(file: &'a str, data: &'a [u8]) -> Result<Self> {
        let data = data.strip_prefix(b"\xef\xbb\xbf").unwrap_or(data);
        if data.iter().take(1024).any(|&b| b == 0) {
            return Err(MeshError::new(
                ErrorKind::Malformed,
                file,
                "binary data where text is expected",
                "check that the extension names the true format",
            ));
        }
        Ok(Text { file, data, pos: 0, line: 1 })
    }

    /// A cursor over text inside a file whose beginning was checked already.
    pub fn embedded(file: &'a str, data: &'a [u8], pos: usize, line: usize) -> Self {
        Text { file, data, pos, line }
    }

    /// How many bytes of the text are behind the cursor.
    pub fn position(&self) -> usize {
        self.pos
    }

    /// The 1-based number of the current line.
    pub fn line_number(&self) -> usize {
        self.line
    }

    /// The next line that holds more than white space and a `#` comment. A backslash at the very
    /// end joins a line with the following one.
    pub fn next_line(&mut self) -> Option<Line<'a>> {
        while self.pos < self.data.len() {
            let (start, number) = (self.pos, self.line);
            let end = loop {
                let rest = &self.data[self.pos..];
                let eol = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
                let end = self.pos + eol;
                self.pos = (end + 1).min(self.data.len());
                self.line += 1;
                let joined = self.data[start..end].trim_ascii_end().ends_with(b"\\");
                if !joined || self.pos >= self.data.len() {
                    break end;
                }
            };
            let text = &self.data[start..end];
            let text = &text[..text.iter().position(|&b| b == b'#').unwrap_or(text.len())];
            if text.iter().any(|&b| !is_space(b)) {
                return Some(Line { file: self.file, number, at: start, rest: text });
            }
        }
        None
    }

    /// The next line, or the error that the file ended before `what`.
    pub fn expect_line(&mut self, what: impl FnOnce() -> String) -> Result<Line<'a>> {
        self.next_line().ok_or_else(|| self.truncated(what()))
    }

    /// The next word, across line breaks and `#` comments.
    pub fn next_word(&mut self) -> Option<&'a [u8]> {
        loop {
            while let Some(&b) = self.data.get(self.pos) {
                if !is_space(b) {
                    break;
                }
                self.line += usize::from(b == b'\n');
                self.pos += 1;
            }
            if self.data.get(self.pos)? == &b'#' {
                let rest = &self.data[self.pos..];
                self.pos += rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
                continue;
            }
            let rest = &self.data[self.pos..];
            let len = rest.iter().position(|&b| is_space(b)).unwrap_or(rest.len());
            self.pos += len;
            return Some(&rest[..len]);
        }
    }

    /// The next word without moving on.
    pub fn peek_word(&self) -> Option<&'a [u8]> {
        self.clone().next_word()
    }

    /// The rest of the current line, raw.
    pub fn take_line(&mut self) -> &'a [u8] {
        let rest = &self.data[self.pos..];
        let len = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        self.pos = (self.pos + len + 1).min(self.data.len());
        self.line += 1;
        rest[..len].trim_ascii_end()
    }

    /// Skips to the end of the current paragraph: past the next blank line.
    pub fn skip_paragraph(&mut self) {
        self.take_line();
        while self.pos < self.data.len() && !self.take_line().is_empty() {}
    }

    /// The next `n` bytes, raw.
    pub fn take_bytes(&mut self, n: usize, what: &str) -> Result<&'a [u8]> {
        match self.data[self.pos..].get(..n) {
            Some(bytes) => {
                self.pos += n;
                Ok(bytes)
            }
            None => Err(self.truncated(what)),
        }
    }

    /// Skips past the next occurrence of `word`; false if there is none.
    pub fn skip_past(&mut self, word: &[u8]) -> bool {
        let found = self.data[self.pos..].windows(word.len()).position(|w| w == word);
        if let Some(at) = found {
            self.line += self.data[self.pos..self.pos + at].iter().filter(|&&b| b == b'\n').count();
            self.pos += at + word.len();
        }
        found.is_some()
    }

    /// The next word, or the error that the file ended before `what`.
    pub fn expect_word(&mut self, what: &str) -> Result<&'a [u8]> {
        self.next_word().ok_or_else(|| self.truncated(what))
    }

    /// The next word as an integer.
    pub fn expect_int(&mut self, what: &str) -> Result<i64> {
        let word = self.expect_word(what)?;
        parse_int(word).ok_or_else(|| self.not_a_number(word, what))
    }

    /// The next word as any number.
    pub fn expect_f64(&mut self, what: &str) -> Result<f64> {
        let word = self.expect_word(what)?;
        parse_f64(word).ok_or_else(|| self.not_a_number(word, what))
    }

    /// The next word as a coordinate of vertex `i`: finite.
    pub fn expect_coordinate(&mut self, i: usize) -> Result<f64> {
        let word = self.expect_word("a coordinate")?;
        coordinate(self.file, self.line, word, i)
    }

    /// The next word as an index of a vertex, not yet held against the number of vertices.
    pub fn expect_vertex(&mut self, base: u32, item: Item) -> Result<u32> {
        let index = self.expect_int("a vertex index")?;
        vertex_index(index, base).map_err(|e| e.into_error(self.file).at_line(self.line).at_item(item))
    }

    /// The next word as a count of things that take at least `min_bytes` each: refused where the
    /// rest of the file cannot hold them, so that nobody allocates for a false claim.
    pub fn expect_count(&mut self, what: &str, min_bytes: usize) -> Result<usize> {
        let count = self.expect_int(&format!("the number of {what}"))?;
        self.claim(count, what, min_bytes)
    }

    /// Holds a count against the rest of the file, as [`expect_count`](Self::expect_count) does.
    pub fn claim(&self, count: i64, what: &str, min_bytes: usize) -> Result<usize> {
        let room = (self.data.len() - self.pos + 1) / min_bytes.max(1);
        match usize::try_from(count) {
            Ok(n) if n <= room => Ok(n),
            Ok(n) => Err(self.error(
                ErrorKind::OversizedClaim,
                format!("{n} {what} are announced, but the rest of the file holds at most {room}"),
                "the count is wrong or the file is truncated",
            )),
            Err(_) => Err(self.error(
                ErrorKind::CountMismatch,
                format!("the number of {what} is {count}"),
                "give a count of zero or more",
            )),
        }
    }

    /// An error at the current line.
    pub fn error(&self, kind: ErrorKind, what: impl Into<String>, remedy: &str) -> MeshError {
        MeshError::new(kind, self.file, what, remedy).at_line(self.line)
    }

    /// The error that a word is no number.
    pub fn not_a_number(&self, word: &[u8], what: &str) -> MeshError {
        not_a_number(self.file, self.line, word, what)
    }

    /// The error that the file ended too early.
    pub fn truncated(&self, what: impl AsRef<str>) -> MeshError {
        MeshError::new(
            ErrorKind::Truncated,
            self.file,
            format!("the file ends before {}", what.as_ref()),
            "it is truncated: write or copy it again",
        )
    }
}

impl<'a> Iterator for Line<'a> {
    type Item = &'a [u8];

    /// The next word of the line.
    fn next(&mut self) -> Option<&'a [u8]> {
        let blank = |b: &u8| is_space(*b) || *b == b'\\';
        let start = self.rest.iter().position(|b| !blank(b))?;
        let rest = &self.rest[start..];
        let len = rest.iter().position(blank).unwrap_or(rest.len());
        let (word, rest) = rest.split_at(len);
        self.at += start + len;
        self.rest = rest;
        Some(word)
    }
}

impl Line<'_> {
    /// The next word as an integer.
    pub fn int(&mut self, what: &str) -> Result<i64> {
        let word = self.next().ok_or_else(|| self.missing(what))?;
        parse_int(word).ok_or_else(|| self.not_a_number(word, what))
    }

    /// The next word as an integer, or `default` at the end of the line.
    pub fn int_or(&mut self, default: i64, what: &str) -> Result<i64> {
        match self.next() {
            None => Ok(default),
            Some(word) => parse_int(word).ok_or_else(|| self.not_a_number(word, what)),
        }
    }

    /// The next word as a coordinate of vertex `i`.
    pub fn coordinate(&mut self, i: usize) -> Result<f64> {
        let word = self.next().ok_or_else(|| self.missing("a coordinate").at_item(Item::Vertex(i)))?;
        coordinate(self.file, self.number, word, i)
    }

    /// The next word as a vertex index of an element over `n` vertices numbered from `base`.
    pub fn vertex(&mut self, base: u32, n: usize, item: Item) -> Result<u32> {
        let index = self.int("a vertex index").map_err(|e| e.at_item(item))?;
        let at = |e: BadIndex| e.into_error(self.file).at_line(self.number).at_item(item);
        let v = vertex_index(index, base).map_err(at)?;
        if (v as usize) < n { Ok(v) } else { Err(at(BadIndex::Large { index, base, n })) }
    }

    /// Checks that nothing but numbers follows (attributes, markers, colours that we skip).
    pub fn only_numbers_follow(&mut self) -> Result<()> {
        while let Some(word) = self.next() {
            if parse_f64(word).is_none() {
                return Err(self.not_a_number(word, "an attribute"));
            }
        }
        Ok(())
    }

    /// An error at this line.
    pub fn error(&self, kind: ErrorKind, what: impl Into<String>, remedy: &str) -> MeshError {
        MeshError::new(kind, self.file, what, remedy).at_line(self.number)
    }

    /// The error that the line ended too early.
    pub fn missing(&self, what: &str) -> MeshError {
        self.error(
            ErrorKind::Truncated,
            format!("the line ends before {what}"),
            "complete the line; the file may be truncated",
        )
    }

    /// The error that a word is no number.
    pub fn not_a_number(&self, word: &[u8], what: &str) -> MeshError {
        not_a_number(self.file, self.number, word, what)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_skip_comments_and_join_at_backslashes() {
        let mut t = Text::new("f", b"\xef\xbb\xbf# c\n\n a b # x\r\nc \\\nd\ne").unwrap();
        let mut lines = Vec::new();
        while let Some(l) = t.next_line() {
            lines.push((l.number, l.map(|w| w.escape_ascii().to_string()).collect::<Vec<_>>()));
        }
        let words = |s: &str| s.split(' ').map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(lines, [(3, words("a b")), (4, words("c d")), (6, words("e"))]);
    }

    #[test]
    fn words_cross_lines_and_count_them() {
        let mut t = Text::new("f", b"1 #x\n 2.5\nnan").unwrap();
        assert_eq!(t.expect_int("n").unwrap(), 1);
        assert_eq!(t.expect_coordinate(0).unwrap(), 2.5);
        let e = t.expect_coordinate(4).unwrap_err();
        assert_eq!((e.kind(), e.line(), e.item()), (ErrorKind::NonFinite, Some(3), Some(Item::Vertex(4))));
        assert_eq!(t.expect_word("the end").unwrap_err().kind(), ErrorKind::Truncated);
    }
}
