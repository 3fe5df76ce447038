//! Reading VTU, the XML files of ParaView: unstructured grids with arrays in text, in base64 or appended,
//! raw or in base64, plain or in zlib blocks.

use std::io::Read;

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use roxmltree::{Document, Node};

use super::numbers::{parse_f64, parse_int, show};
use super::scalar::Scalar;
use super::vtk_cells::{Cells, is_region};
use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::mesh::Mesh;

/// Writers differ about padding.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

struct Reader<'a> {
    file: &'a str,
    /// What follows the underscore of `AppendedData`.
    appended: &'a [u8],
    appended_raw: bool,
    length: Scalar,
    big_endian: bool,
    zlib: bool,
}

enum Numbers {
    Real(Vec<f64>),
    Whole(Vec<i64>),
}

pub(crate) fn parse(file: &str, data: &[u8]) -> Result<Mesh> {
    let bad = |what: String| {
        let remedy = "check that the file is a VTU file, or save it again";
        MeshError::new(ErrorKind::Malformed, file, what, remedy)
    };
    // Raw data is no XML: the document ends where the data begins.
    let tag = b"<AppendedData";
    let split = data.windows(tag.len()).position(|w| w == tag);
    let (xml, appended, appended_raw) = match split {
        None => (data, &data[..0], false),
        Some(at) => {
            let rest = &data[at..];
            let start = rest.iter().position(|&b| b == b'>').map(|end| {
                let skip = rest[end..].iter().position(|&b| b == b'_');
                (end, skip.map(|s| end + s + 1))
            });
            let Some((end, Some(body))) = start else {
                return Err(bad("the appended data does not start with `_`".into()));
            };
            let raw = !rest[..end].windows(6).any(|w| w == b"base64");
            (&data[..at], &rest[body..], raw)
        }
    };
    let text = std::str::from_utf8(xml).map_err(|_| bad("it is no text in UTF-8".into()))?;
    let closed;
    let text = if split.is_some() {
        closed = format!("{text}</VTKFile>");
        &closed
    } else {
        text
    };
    let document = Document::parse(text).map_err(|e| bad(format!("it is no valid XML: {e}")))?;
    let root = document.root_element();
    if !root.has_tag_name("VTKFile") {
        return Err(bad(format!("its root is {} instead of VTKFile", show(root.tag_name().name().as_bytes()))));
    }
    let kind = root.attribute("type").unwrap_or_default();
    if kind != "UnstructuredGrid" {
        return Err(MeshError::new(
            ErrorKind::Unsupported,
            file,
            format!("data of the kind {}", show(kind.as_bytes())),
            "convert it to an UnstructuredGrid",
        ));
    }
    let zlib = match root.attribute("compressor") {
        None => false,
        Some("vtkZLibDataCompressor") => true,
        Some(other) => {
            return Err(MeshError::new(
                ErrorKind::Unsupported,
                file,
                format!("arrays compressed by {}", show(other.as_bytes())),
                "save it with zlib or without compression",
            ));
        }
    };
    let length = if root.attribute("header_type") == Some("UInt64") { Scalar::U64 } else { Scalar::U32 };
    let big_endian = root.attribute("byte_order") == Some("BigEndian");
    let reader = Reader { file, appended, appended_raw, length, big_endian, zlib };
    let mut mesh = Mesh { name: file.to_owned(), ..Mesh::default() };
    let mut cells = Cells::default();
    let mut regions = Vec::new();
    for piece in root.descendants().filter(|n| n.has_tag_name("Piece")) {
        reader.piece(piece, &mut mesh, &mut cells, &mut regions)?;
    }
    if !regions.is_empty() {
        cells.set_regions(&mut mesh, &regions);
    }
    Ok(mesh)
}

fn child<'a>(node: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    node.children().find(|n| n.has_tag_name(name))
}

impl Reader<'_> {
    fn bad(&self, what: impl Into<String>) -> MeshError {
        MeshError::new(ErrorKind::Malformed, self.file, what, "it is damaged: save it again")
    }

    fn piece<'a>(&self, piece: Node<'a, 'a>, mesh: &mut Mesh, cells: &mut Cells, regions: &mut Vec<f64>) -> Result<()> {
        let base = u32::try_from(mesh.points.len()).map_err(|_| self.bad("over 2^32 points"))?;
        let points = child(piece, "Points").and_then(|p| child(p, "DataArray"));
        let Some(points) = points else { return Ok(()) };
        let numbers = match self.array(points)? {
            Numbers::Real(x) => x,
            Numbers::Whole(x) => x.iter().map(|&x| x as f64).collect(),
        };
        if numbers.len() % 3 != 0 {
            return Err(self.bad(format!("{} numbers are no points of three coordinates", numbers.len())));
        }
        if let Some(k) = numbers.iter().position(|x| !x.is_finite()) {
            let what = format!("a coordinate is {}", numbers[k]);
            return Err(MeshError::new(ErrorKind::NonFinite, self.file, what, "replace it by a finite number")
                .at_item(Item::Vertex(base as usize + k / 3)));
        }
        mesh.points.extend(numbers.chunks_exact(3).map(|c| [c[0], c[1], c[2]]));
        self.count(piece, "NumberOfPoints", numbers.len() / 3)?;
        let Some(lists) = child(piece, "Cells") else { return Ok(()) };
        let named = |name: &str| -> Result<Vec<i64>> {
            let array = lists.children().find(|n| n.has_tag_name("DataArray") && n.attribute("Name") == Some(name));
            match array.map(|a| self.array(a)).transpose()? {
                Some(Numbers::Whole(x)) => Ok(x),
                Some(Numbers::Real(_)) => Err(self.bad(format!("the array `{name}` holds no integers"))),
                None => Err(self.bad(format!("the cells have no array `{name}`"))),
            }
        };
        let (corners, offsets, kinds) = (named("connectivity")?, named("offsets")?, named("types")?);
        self.count(piece, "NumberOfCells", kinds.len())?;
        if offsets.len() != kinds.len() {
            return Err(self.bad(format!("{} offsets for {} types of cells", offsets.len(), kinds.len())));
        }
        let mut start = 0;
        for (i, (&end, &kind)) in offsets.iter().zip(&kinds).enumerate() {
            let list = usize::try_from(end).ok().and_then(|end| corners.get(start..end));
            let Some(list) = list else {
                return Err(self.bad(format!("the offset {end} of cell {i} (0-based) is out of range")));
            };
            cells.push(self.file, mesh, u8::try_from(kind).unwrap_or(u8::MAX), list, base)?;
            start += list.len();
        }
        let region = child(piece, "CellData")
            .into_iter()
            .flat_map(|d| d.children())
            .find(|n| n.has_tag_name("DataArray") && n.attribute("Name").is_some_and(is_region));
        if let Some(region) = region {
            match self.array(region)? {
                Numbers::Real(x) => regions.extend(x),
                Numbers::Whole(x) => regions.extend(x.iter().map(|&x| x as f64)),
            }
        }
        Ok(())
    }

    /// Holds the count that a piece announces against what was read.
    fn count(&self, piece: Node<'_, '_>, name: &str, found: usize) -> Result<()> {
        match piece.attribute(name).and_then(|n| parse_int(n.trim().as_bytes())) {
            Some(n) if n == found as i64 => Ok(()),
            Some(n) => Err(MeshError::new(
                ErrorKind::CountMismatch,
                self.file,
                format!("{name} is {n}, but there are {found}"),
                "it is damaged: save it again",
            )),
            None => Err(self.bad(format!("a piece has no {name}"))),
        }
    }

    fn array(&self, node: Node<'_, '_>) -> Result<Numbers> {
        let name = show(node.attribute("Name").unwrap_or("without name").as_bytes());
        let kind = node.attribute("type").unwrap_or_default();
        let kind = Scalar::named(kind)
            .ok_or_else(|| self.bad(format!("the array {name} is of unknown type {}", show(kind.as_bytes()))))?;
        let text = node.text().unwrap_or_default();
        let bytes = match node.attribute("format").unwrap_or("ascii") {
            "ascii" => {
                let mut words = text.split_ascii_whitespace().map(str::as_bytes);
                let wrong = |w: &[u8]| {
                    let what = format!("{} is no number in the array {name}", show(w));
                    MeshError::new(ErrorKind::NotANumber, self.file, what, "correct the word")
                };
                return if kind.is_float() {
                    words.map(|w| parse_f64(w).ok_or_else(|| wrong(w))).collect::<Result<_>>().map(Numbers::Real)
                } else {
                    words
                        .try_fold(Vec::new(), |mut v, w| {
                            v.push(parse_int(w).ok_or_else(|| wrong(w))?);
                            Ok(v)
                        })
                        .map(Numbers::Whole)
                };
            }
            "binary" => {
                let text: Vec<u8> = text.bytes().filter(|b| !b.is_ascii_whitespace()).collect();
                self.decode(&Source::Base64(&text), &name)?
            }
            "appended" => {
                let offset = node.attribute("offset").and_then(|o| parse_int(o.trim().as_bytes()));
                let rest = offset
                    .and_then(|o| usize::try_from(o).ok())
                    .and_then(|o| self.appended.get(o..))
                    .ok_or_else(|| self.truncated(&name))?;
                self.decode(&if self.appended_raw { Source::Raw(rest) } else { Source::Base64(rest) }, &name)?
            }
            other => {
                return Err(self.bad(format!("the array {name} is in the unknown format {}", show(other.as_bytes()))));
            }
        };
        if bytes.len() % kind.size() != 0 {
            return Err(self.bad(format!("the array {name} ends within a number")));
        }
        let each = bytes.chunks_exact(kind.size());
        Ok(if kind.is_float() {
            Numbers::Real(each.map(|b| kind.f64(b, self.big_endian)).collect())
        } else {
            Numbers::Whole(each.map(|b| kind.i64(b, self.big_endian)).collect())
        })
    }

    fn truncated(&self, name: &str) -> MeshError {
        let what = format!("the file ends before the array {name} does");
        MeshError::new(ErrorKind::Truncated, self.file, what, "it is truncated: write or copy it again")
    }

    /// The bytes of an array behind its length, or behind the table of its compressed blocks.
    fn decode(&self, source: &Source<'_>, name: &str) -> Result<Vec<u8>> {
        let cut = || self.truncated(name);
        let width = self.length.size();
        let lengths = |bytes: &[u8]| -> Vec<usize> {
            let all = bytes.chunks_exact(width);
            all.map(|b| usize::try_from(self.length.i64(b, self.big_endian)).unwrap_or(usize::MAX)).collect()
        };
        if !self.zlib {
            let n = lengths(&source.take(width).ok_or_else(cut)?)[0];
            let all = source.take(width.checked_add(n).ok_or_else(cut)?).ok_or_else(cut)?;
            return Ok(all[width..].to_vec());
        }
        // Number of blocks, size of each, size of a shorter last one (or 0), compressed sizes.
        let blocks = lengths(&source.take(width).ok_or_else(cut)?)[0];
        if blocks == 0 {
            return Ok(Vec::new());
        }
        let table = blocks.checked_add(3).and_then(|n| n.checked_mul(width)).ok_or_else(cut)?;
        let head = lengths(&source.take(table).ok_or_else(cut)?);
        let rest = source.after(table).ok_or_else(cut)?;
        let packed = head[3..].iter().try_fold(0usize, |sum, &n| sum.checked_add(n)).ok_or_else(cut)?;
        let packed = rest.take(packed).ok_or_else(cut)?;
        let (mut out, mut pos) = (Vec::new(), 0);
        for (i, &n) in head[3..].iter().enumerate() {
            let size = if i + 1 == blocks && head[2] > 0 { head[2] } else { head[1] };
            let before = out.len();
            // Never more than announced, and no more memory than really comes out.
            let limit = (size as u64).saturating_add(1);
            let block = flate2::read::ZlibDecoder::new(&packed[pos..pos + n]).take(limit).read_to_end(&mut out);
            if block.is_err() || out.len() - before != size {
                return Err(self.bad(format!("block {i} of the array {name} cannot be unpacked")));
            }
            pos += n;
        }
        Ok(out)
    }
}

/// Encoded bytes of which the end is not known.
enum Source<'a> {
    Raw(&'a [u8]),
    Base64(&'a [u8]),
}

impl<'a> Source<'a> {
    /// The first `n` bytes.
    fn take(&self, n: usize) -> Option<Vec<u8>> {
        match self {
            Source::Raw(bytes) => bytes.get(..n).map(<[u8]>::to_vec),
            Source::Base64(text) => {
                let text = text.get(..n.div_ceil(3).checked_mul(4)?.min(text.len()))?;
                let mut bytes = BASE64.decode(text).ok()?;
                bytes.truncate(n);
                (bytes.len() == n).then_some(bytes)
            }
        }
    }

    /// What follows `n` bytes that were encoded on their own.
    fn after(&self, n: usize) -> Option<Source<'a>> {
        match self {
            Source::Raw(bytes) => bytes.get(n..).map(Source::Raw),
            Source::Base64(text) => text.get(n.div_ceil(3).checked_mul(4)?..).map(Source::Base64),
        }
    }
}
