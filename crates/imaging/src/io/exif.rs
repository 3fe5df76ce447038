//! EXIF: directories of tags as in TIFF, carried between blocks of their own (PNG, JPEG) and files of TIFF.

/// What is kept of the first directory of a TIFF: what says something of the picture, not of how its pixels lie.
const KEPT: [u16; 14] = [
    0x010e, // description
    0x010f, // maker
    0x0110, // model
    ORIENTATION,
    0x011a, // resolution along the row,
    0x011b, // along the column,
    0x0128, // and its unit
    0x0131, // software
    0x0132, // date
    0x013b, // artist
    0x8298, // copyright
    EXIF,
    GPS,
    0x4746, // rating
];

const ORIENTATION: u16 = 0x0112;
const EXIF: u16 = 0x8769;
const GPS: u16 = 0x8825;
const INTEROPERABILITY: u16 = 0xa005;

/// Tags whose value is the place of another directory.
const DIRECTORIES: [u16; 3] = [EXIF, GPS, INTEROPERABILITY];

/// How deep directories are nested: the first, EXIF, interoperability.
const DEPTH: usize = 3;

/// A tag and its value, in little-endian order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Entry {
    pub tag: u16,
    pub kind: u16,
    pub value: Value,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Value {
    Bytes(Vec<u8>),
    Directory(Vec<Entry>),
}

/// Bytes of a value of a type, and of the numbers that it is made of; none where the type is unknown.
pub(super) fn sizes(kind: u16) -> Option<(usize, usize)> {
    match kind {
        1 | 2 | 6 | 7 => Some((1, 1)),
        3 | 8 => Some((2, 2)),
        4 | 9 | 11 | 13 => Some((4, 4)),
        5 | 10 => Some((8, 4)),
        12 => Some((8, 8)),
        _ => None,
    }
}

/// The bytes of a file with an order.
struct Bytes<'a> {
    data: &'a [u8],
    big: bool,
    left: usize, // of values that may still be taken: together they are no more than the file
}

impl Bytes<'_> {
    fn short(&self, at: usize) -> Option<u16> {
        let b: [u8; 2] = self.data.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(if self.big { u16::from_be_bytes(b) } else { u16::from_le_bytes(b) })
    }

    fn long(&self, at: usize) -> Option<usize> {
        let b: [u8; 4] = self.data.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if self.big { u32::from_be_bytes(b) } else { u32::from_le_bytes(b) } as usize)
    }

    /// The entries of a directory that can be read.
    fn directory(&mut self, at: usize, depth: usize) -> Option<Vec<Entry>> {
        let count = usize::from(self.short(at)?);
        let mut entries = Vec::new();
        for k in 0..count {
            entries.extend(self.entry(at + 2 + 12 * k, depth));
        }
        Some(entries)
    }

    fn entry(&mut self, at: usize, depth: usize) -> Option<Entry> {
        let (tag, kind) = (self.short(at)?, self.short(at + 2)?);
        if DIRECTORIES.contains(&tag) {
            let place = self.long(at + 8)?;
            let inside = if depth > 1 { self.directory(place, depth - 1)? } else { return None };
            return Some(Entry { tag, kind: 4, value: Value::Directory(inside) });
        }
        let (size, number) = sizes(kind)?;
        let length = self.long(at + 4)?.checked_mul(size)?;
        let from = if length <= 4 { at + 8 } else { self.long(at + 8)? };
        let mut value = self.data.get(from..from.checked_add(length)?)?.to_vec();
        self.left = self.left.checked_sub(length)?;
        if self.big {
            value.chunks_exact_mut(number).for_each(<[u8]>::reverse);
        }
        Some(Entry { tag, kind, value: Value::Bytes(value) })
    }
}

/// The first directory of a block or a TIFF and those within it; none where there is none, or it is damaged.
pub(super) fn parse(data: &[u8]) -> Option<Vec<Entry>> {
    let big = match data.get(..4)? {
        b"II*\0" => false,
        b"MM\0*" => true,
        _ => return None,
    };
    let mut bytes = Bytes { data, big, left: data.len() };
    let first = bytes.long(4)?;
    bytes.directory(first, DEPTH)
}

/// What of them is of the picture. Twice the same tag is once.
pub(super) fn kept(entries: Vec<Entry>) -> Vec<Entry> {
    let mut kept: Vec<Entry> = entries.into_iter().filter(|e| KEPT.contains(&e.tag)).collect();
    kept.sort_by_key(|e| e.tag);
    kept.dedup_by_key(|e| e.tag);
    kept
}

/// The bytes of directories that are to stand at `at` in a little-endian file, and where the first one begins.
pub(super) fn lay_out(entries: &[Entry], at: usize) -> Option<(Vec<u8>, u32)> {
    let mut bytes = Vec::new();
    let mut rows = Vec::new();
    for entry in entries {
        let mut held = [0; 4];
        let count = match &entry.value {
            Value::Directory(inside) => {
                let (within, first) = lay_out(inside, at + bytes.len())?;
                bytes.extend(within);
                held = first.to_le_bytes();
                1
            }
            Value::Bytes(value) => {
                if value.len() <= 4 {
                    held[..value.len()].copy_from_slice(value);
                } else {
                    held = u32::try_from(at + bytes.len()).ok()?.to_le_bytes();
                    bytes.extend_from_slice(value);
                }
                value.len() / sizes(entry.kind)?.0
            }
        };
        if bytes.len() % 2 == 1 {
            bytes.push(0); // places are even
        }
        rows.extend(entry.tag.to_le_bytes());
        rows.extend(entry.kind.to_le_bytes());
        rows.extend(u32::try_from(count).ok()?.to_le_bytes());
        rows.extend(held);
    }
    let first = u32::try_from(at + bytes.len()).ok()?;
    bytes.extend(u16::try_from(entries.len()).ok()?.to_le_bytes());
    bytes.extend(rows);
    bytes.extend([0; 4]);
    Some((bytes, first))
}

/// A block of its own.
pub(super) fn block(entries: &[Entry]) -> Option<Vec<u8>> {
    let (bytes, first) = lay_out(entries, 8)?;
    Some([b"II*\0".as_slice(), &first.to_le_bytes(), &bytes].concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Vec<Entry> {
        let bytes = |tag, kind, value: &[u8]| Entry { tag, kind, value: Value::Bytes(value.to_vec()) };
        let within = |tag, inside| Entry { tag, kind: 4, value: Value::Directory(inside) };
        let interoperability = within(INTEROPERABILITY, vec![bytes(1, 2, b"R98\0")]);
        vec![
            bytes(0x010f, 2, b"maker\0"),
            bytes(ORIENTATION, 3, &[6, 0]),
            bytes(0x011a, 5, &[72, 0, 0, 0, 1, 0, 0, 0]),
            within(EXIF, vec![bytes(0x829a, 5, &[1, 0, 0, 0, 60, 0, 0, 0]), interoperability]),
            within(GPS, vec![bytes(0, 1, &[2, 3, 0, 0])]),
        ]
    }

    #[test]
    fn blocks_come_back() {
        let entries = sample();
        let block = block(&entries).unwrap();
        assert_eq!(parse(&block), Some(entries.clone()));
        assert_eq!(kept(entries.clone()), entries);
        for n in 0..block.len() {
            let _ = parse(&block[..n]);
        }
    }

    #[test]
    fn the_other_byte_order() {
        let big = b"MM\0*\0\0\0\x08\0\x02\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\x01\x1a\0\x05\0\0\0\x01\0\0\0\x26\0\0\0\0\0\0\0\x48\0\0\0\x01";
        let found = parse(big).unwrap();
        assert_eq!(found[0].value, Value::Bytes(vec![6, 0]));
        assert_eq!(found[1].value, Value::Bytes(vec![72, 0, 0, 0, 1, 0, 0, 0]));
    }

    /// Directories within themselves, and values that overlap again and again, end.
    #[test]
    fn no_more_is_taken_than_the_file_has() {
        let mut turning = b"II*\0\x08\0\0\0\x01\0\x69\x87\x04\0\x01\0\0\0\x08\0\0\0".to_vec();
        turning.extend([0; 8]);
        assert!(parse(&turning).is_some_and(|e| e.len() <= 1));
        let mut swollen = b"II*\0\x08\0\0\0\xe8\x03".to_vec();
        for _ in 0..1000 {
            swollen.extend(b"\x0e\x01\x02\0\x00\x20\0\0\0\0\0\0");
        }
        let taken: usize =
            parse(&swollen).unwrap().iter().map(|e| if let Value::Bytes(b) = &e.value { b.len() } else { 0 }).sum();
        assert!(taken <= swollen.len());
    }
}
