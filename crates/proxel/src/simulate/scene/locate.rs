//! Lines of values in files.

use toml::de::{DeArray, DeTable, DeValue};

/// The steps of a place such as `body[0].shape.radius`.
fn steps(place: &str) -> impl Iterator<Item = Step<'_>> {
    place.split(['.', '[']).map(|part| match part.strip_suffix(']').map(str::parse) {
        Some(Ok(index)) => Step::Index(index),
        _ => Step::Key(part),
    })
}

enum Step<'a> {
    Key(&'a str),
    Index(usize),
}

/// The 1-based line where the item at a place begins; that of the last item on the way there which the file has. `None`
/// where it has none of them.
pub(super) fn line_in_toml(text: &str, place: &str) -> Option<usize> {
    let root = DeTable::parse(text).ok()?;
    let mut table = Some(root.get_ref());
    let mut array: Option<&DeArray<'_>> = None;
    let mut found = None;
    for step in steps(place) {
        let value = match step {
            Step::Key(key) => {
                table.and_then(|t| t.iter().find(|(k, _)| k.get_ref() == key)).map(|(k, v)| (k.span(), v))
            }
            Step::Index(index) => array.and_then(|a| a.get(index)).map(|v| (v.span(), v)),
        };
        let Some((span, value)) = value else { break };
        found = Some(span.start);
        (table, array) = match value.get_ref() {
            DeValue::Table(t) => (Some(t), None),
            DeValue::Array(a) => (None, Some(a)),
            _ => (None, None),
        };
    }
    found.map(|at| 1 + text[..at.min(text.len())].matches('\n').count())
}

/// The same for JSON, in a text that parses.
pub(super) fn line_in_json(text: &str, place: &str) -> Option<usize> {
    let mut scan = Scan { bytes: text.as_bytes(), at: 0 };
    let mut found = None;
    for step in steps(place) {
        let entered = match step {
            Step::Key(key) => scan.enter(key),
            Step::Index(index) => scan.enter_at(index),
        };
        let Some(at) = entered else { break };
        found = Some(at);
    }
    found.map(|at| 1 + text[..at.min(text.len())].matches('\n').count())
}

/// A place in valid JSON.
struct Scan<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Scan<'_> {
    fn blanks(&mut self) {
        while self.bytes.get(self.at).is_some_and(|b| b.is_ascii_whitespace() || *b == b',' || *b == b':') {
            self.at += 1;
        }
    }

    /// Behind the string that begins here, and what it says, escapes as they stand.
    fn string(&mut self) -> &[u8] {
        let from = self.at + 1;
        self.at = from;
        while self.bytes.get(self.at).is_some_and(|b| *b != b'"') {
            self.at += if self.bytes[self.at] == b'\\' { 2 } else { 1 };
        }
        let to = self.at.min(self.bytes.len());
        self.at += 1;
        self.bytes.get(from..to).unwrap_or_default()
    }

    /// Behind the value that begins here.
    fn skip(&mut self) {
        let mut depth = 0usize;
        loop {
            match self.bytes.get(self.at) {
                None => return,
                Some(b'"') => {
                    self.string();
                }
                Some(b'{' | b'[') => {
                    depth += 1;
                    self.at += 1;
                }
                Some(b'}' | b']') if depth == 0 => return,
                Some(b'}' | b']') => {
                    depth -= 1;
                    self.at += 1;
                }
                Some(b',') if depth == 0 => return,
                Some(_) => self.at += 1,
            }
            let ends = matches!(self.bytes.get(self.at), None | Some(b',' | b'}' | b']'));
            if depth == 0 && ends {
                return;
            }
        }
    }

    /// Into the value of a key of the object that begins here; where the key stands.
    fn enter(&mut self, key: &str) -> Option<usize> {
        self.blanks();
        if self.bytes.get(self.at) != Some(&b'{') {
            return None;
        }
        self.at += 1;
        loop {
            self.blanks();
            if self.bytes.get(self.at) != Some(&b'"') {
                return None;
            }
            let at = self.at;
            let same = self.string() == key.as_bytes();
            self.blanks();
            if same {
                return Some(at);
            }
            self.skip();
        }
    }

    /// Into an item of the array that begins here; where it stands.
    fn enter_at(&mut self, index: usize) -> Option<usize> {
        self.blanks();
        if self.bytes.get(self.at) != Some(&b'[') {
            return None;
        }
        self.at += 1;
        for _ in 0..index {
            self.blanks();
            self.skip();
        }
        self.blanks();
        (!matches!(self.bytes.get(self.at), None | Some(b']'))).then_some(self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_found_in_both() {
        let toml = "a = 1\n[[b]]\nc = { d = 2 }\n[[b]]\ne = [1,\n 2]\n[b.f]\ng = 3\n";
        let of = |place| line_in_toml(toml, place);
        assert_eq!((of("a"), of("b[0].c.d"), of("b[1].e[1]"), of("b[1].f.g")), (Some(1), Some(3), Some(6), Some(8)));
        assert_eq!((of("b[1].x"), of("z")), (Some(4), None), "the last that is there");
        let json =
            "{\n \"a\": \"x,}\\\"\",\n \"b\": [{\"c\": [1, {\"q\": 2}]},\n {\"d\":\n 4, \"e\": -1e3}],\n \"g\": null}";
        let of = |place| line_in_json(json, place);
        assert_eq!((of("a"), of("b[0].c[1].q"), of("b[1].e"), of("g")), (Some(2), Some(3), Some(5), Some(6)));
        assert_eq!((of("b[7]"), of("z"), of("b[1].z")), (Some(3), None, Some(4)));
    }
}
