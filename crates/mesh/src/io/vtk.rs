//! Legacy VTK, text and binary, versions 2 to 5: unstructured grids and polygonal data. Written as
//! text of version 3, which every reader takes.

use std::io::{self, Write};

use super::numbers::{show, write_point};
use super::scalar::Scalar;
use super::text::Text;
use super::vtk_cells::{Cells, POLYGON, REGION, cell_arrays, cell_regions, cells, is_region, n_cells};
use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::fields::Fields;
use crate::mesh::Mesh;

struct Reader<'a> {
    text: Text<'a>,
    binary: bool,
}

pub(crate) fn parse(file: &str, data: &[u8]) -> Result<Mesh> {
    let mut reader = header(file, data)?;
    let mut mesh = Mesh { name: file.to_owned(), ..Mesh::default() };
    let mut cells = Cells::default();
    let mut lists = None; // CELLS, waiting for CELL_TYPES
    let mut over_cells = false;
    while let Some(word) = reader.text.next_word() {
        match word {
            b"POINTS" => {
                let n = reader.text.expect_count("points", 3)?;
                let kind = reader.kind()?;
                let numbers = reader.numbers(3 * n, kind)?;
                if let Some(k) = numbers.iter().position(|x| !x.is_finite()) {
                    let what = format!("a coordinate is {}", numbers[k]);
                    return Err(MeshError::new(ErrorKind::NonFinite, file, what, "replace it by a finite number")
                        .at_item(Item::Vertex(k / 3)));
                }
                mesh.points = numbers.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
            }
            b"CELLS" => lists = Some(reader.lists()?),
            b"CELL_TYPES" => {
                let n = reader.text.expect_count("cell types", 1)?;
                let kinds = reader.integers(n, Scalar::I32)?;
                let Some((offsets, corners)) = lists.take() else {
                    return Err(reader.malformed("CELL_TYPES without CELLS"));
                };
                if offsets.len() != n + 1 {
                    return Err(reader.malformed(format!("{n} types for {} cells", offsets.len() - 1)));
                }
                for (k, w) in kinds.iter().zip(offsets.windows(2)) {
                    let kind = u8::try_from(*k).unwrap_or(u8::MAX);
                    cells.push(file, &mut mesh, kind, &corners[w[0]..w[1]], 0)?;
                }
            }
            b"VERTICES" | b"LINES" | b"POLYGONS" | b"TRIANGLE_STRIPS" => {
                let kind = match word {
                    b"VERTICES" => 2,
                    b"LINES" => 4,
                    b"POLYGONS" => POLYGON,
                    _ => 6,
                };
                let (offsets, corners) = reader.lists()?;
                for w in offsets.windows(2) {
                    cells.push(file, &mut mesh, kind, &corners[w[0]..w[1]], 0)?;
                }
            }
            b"CELL_DATA" | b"POINT_DATA" => {
                over_cells = word == b"CELL_DATA";
                reader.text.expect_int("a number of tuples")?;
            }
            b"METADATA" => reader.text.skip_paragraph(),
            b"FIELD" => {
                reader.text.expect_word("the name of a field")?;
                for _ in 0..reader.text.expect_count("arrays", 4)? {
                    let name = reader.text.expect_word("the name of an array")?;
                    if name == b"METADATA" {
                        reader.text.skip_paragraph();
                        continue;
                    }
                    let components = reader.text.expect_count("components", 0)?;
                    let n = reader.text.expect_count("tuples", 0)?;
                    let kind = reader.kind()?;
                    let numbers = reader.numbers(reader.product(components, n)?, kind)?;
                    if over_cells && components == 1 && std::str::from_utf8(name).is_ok_and(is_region) {
                        cells.set_regions(&mut mesh, &numbers);
                    }
                }
            }
            b"SCALARS" if over_cells => {
                let name = reader.text.expect_word("the name of an array")?;
                let kind = reader.kind()?;
                let mut components = 1;
                if reader.text.peek_word() != Some(b"LOOKUP_TABLE") {
                    components = reader.text.expect_count("components", 0)?;
                }
                reader.text.expect_word("LOOKUP_TABLE")?;
                reader.text.expect_word("the name of a table")?;
                let n = mesh.tets.len() + mesh.faces.len() + mesh.edges.len();
                let numbers = reader.numbers(reader.product(components, n)?, kind)?;
                if components == 1 && std::str::from_utf8(name).is_ok_and(is_region) {
                    cells.set_regions(&mut mesh, &numbers);
                }
            }
            // Arrays come last, and these are none that we have a use for.
            _ if !mesh.points.is_empty() && word.iter().all(|b| b.is_ascii_uppercase() || *b == b'_') => break,
            _ => return Err(reader.malformed(format!("{} where a section is expected", show(word)))),
        }
    }
    if lists.is_some() {
        return Err(reader.text.truncated("CELL_TYPES"));
    }
    Ok(mesh)
}

fn header<'a>(file: &'a str, data: &'a [u8]) -> Result<Reader<'a>> {
    let mut text = Text::embedded(file, data, 0, 1);
    let malformed = |text: &Text<'_>, what: String| {
        text.error(ErrorKind::Malformed, what, "check that the file is a legacy VTK file")
    };
    let first = text.take_line();
    if !first.starts_with(b"# vtk DataFile Version") {
        return Err(MeshError::new(
            ErrorKind::Malformed,
            file,
            "the first line is not `# vtk DataFile Version ...`",
            "check that the file is a legacy VTK file",
        ));
    }
    text.take_line(); // a title
    let binary = match text.expect_word("ASCII or BINARY")? {
        b"ASCII" => false,
        b"BINARY" => true,
        other => return Err(malformed(&text, format!("{} instead of ASCII or BINARY", show(other)))),
    };
    match text.expect_word("DATASET")? {
        b"DATASET" => {}
        other => return Err(malformed(&text, format!("{} instead of DATASET", show(other)))),
    }
    match text.expect_word("the kind of data")? {
        b"UNSTRUCTURED_GRID" | b"POLYDATA" => Ok(Reader { text, binary }),
        other => Err(text.error(
            ErrorKind::Unsupported,
            format!("data of the kind {}", show(other)),
            "convert it to UNSTRUCTURED_GRID or POLYDATA",
        )),
    }
}

impl Reader<'_> {
    fn malformed(&self, what: impl Into<String>) -> MeshError {
        self.text.error(ErrorKind::Malformed, what, "write the file again with another program")
    }

    fn kind(&mut self) -> Result<Scalar> {
        let word = self.text.expect_word("a number type")?;
        let known = std::str::from_utf8(word).ok().and_then(|w| Scalar::named(&w.to_ascii_lowercase()));
        match (known, word) {
            (_, b"vtkIdType") => Ok(Scalar::I32),
            (Some(kind), _) => Ok(kind),
            (None, _) => Err(self.malformed(format!("unknown number type {}", show(word)))),
        }
    }

    fn product(&self, a: usize, b: usize) -> Result<usize> {
        a.checked_mul(b).ok_or_else(|| self.malformed(format!("an array of {a} times {b} numbers")))
    }

    /// The bytes of `n` binary numbers, or `None` in text after checking that it may hold them.
    fn block(&mut self, n: usize, kind: Scalar) -> Result<Option<&[u8]>> {
        if !self.binary {
            self.text.claim(i64::try_from(n).unwrap_or(i64::MAX), "numbers", 2)?;
            return Ok(None);
        }
        self.text.take_line();
        let size = self.product(n, kind.size())?;
        self.text.take_bytes(size, "the numbers that it announces").map(Some)
    }

    fn numbers(&mut self, n: usize, kind: Scalar) -> Result<Vec<f64>> {
        if let Some(bytes) = self.block(n, kind)? {
            return Ok(bytes.chunks_exact(kind.size()).map(|b| kind.f64(b, true)).collect());
        }
        (0..n).map(|_| self.text.expect_f64("a number")).collect()
    }

    fn integers(&mut self, n: usize, kind: Scalar) -> Result<Vec<i64>> {
        if let Some(bytes) = self.block(n, kind)? {
            return Ok(bytes.chunks_exact(kind.size()).map(|b| kind.i64(b, true)).collect());
        }
        (0..n).map(|_| self.text.expect_int("an integer")).collect()
    }

    /// Lists of vertices: where each starts in the second array, and the end. Either
    /// `<n> <size>` and for each its length and members, or since version 5 `<n + 1> <size>` and the
    /// two arrays.
    fn lists(&mut self) -> Result<(Vec<usize>, Vec<i64>)> {
        let n = self.text.expect_count("cells", 1)?;
        let size = self.text.expect_count("indices", 1)?;
        if self.text.peek_word() == Some(b"OFFSETS") {
            self.text.next_word();
            let kind = self.kind()?;
            let offsets = self.integers(n, kind)?;
            match self.text.expect_word("CONNECTIVITY")? {
                b"CONNECTIVITY" => {}
                other => return Err(self.malformed(format!("{} instead of CONNECTIVITY", show(other)))),
            }
            let kind = self.kind()?;
            let corners = self.integers(size, kind)?;
            let sound = offsets.first().is_none_or(|&o| o == 0)
                && offsets.windows(2).all(|w| w[0] <= w[1])
                && offsets.last().is_none_or(|&o| o <= size as i64);
            if !sound {
                return Err(self.malformed("the offsets of the cells do not ascend within their list"));
            }
            let mut offsets: Vec<usize> = offsets.iter().map(|&o| o as usize).collect();
            if offsets.is_empty() {
                offsets.push(0);
            }
            return Ok((offsets, corners));
        }
        let all = self.integers(size, Scalar::I32)?;
        let (mut offsets, mut corners) = (vec![0], Vec::with_capacity(size.saturating_sub(n)));
        let mut rest = &all[..];
        for i in 0..n {
            let list = rest.split_first().and_then(|(&k, tail)| tail.split_at_checked(usize::try_from(k).ok()?));
            let Some((list, tail)) = list else {
                return Err(
                    self.malformed(format!("cell {i} (0-based) reaches past the {size} numbers of its section"))
                );
            };
            corners.extend_from_slice(list);
            offsets.push(corners.len());
            rest = tail;
        }
        if !rest.is_empty() {
            return Err(self.malformed(format!("{} numbers are left over after {n} cells", rest.len())));
        }
        Ok((offsets, corners))
    }
}

pub(crate) fn write(mesh: &Mesh, fields: &Fields, w: &mut dyn Write) -> io::Result<()> {
    writeln!(w, "# vtk DataFile Version 3.0\nproxel\nASCII\nDATASET UNSTRUCTURED_GRID")?;
    writeln!(w, "POINTS {} double", mesh.points.len())?;
    for p in &mesh.points {
        write_point(w, p)?;
        writeln!(w)?;
    }
    let n = n_cells(mesh);
    let size: usize = cells(mesh).map(|(_, c)| c.len() + 1).sum();
    writeln!(w, "CELLS {n} {size}")?;
    for (_, corners) in cells(mesh) {
        write!(w, "{}", corners.len())?;
        for v in corners {
            write!(w, " {v}")?;
        }
        writeln!(w)?;
    }
    writeln!(w, "CELL_TYPES {n}")?;
    for (kind, _) in cells(mesh) {
        writeln!(w, "{kind}")?;
    }
    let array = |w: &mut dyn Write, name: &str, components: usize, data: &[f64]| -> io::Result<()> {
        let name: String = name.split_whitespace().collect::<Vec<_>>().join("_");
        writeln!(w, "{name} {components} {} double", data.len() / components)?;
        for row in data.chunks(components) {
            let row: Vec<String> = row.iter().map(|x| format!("{x:.16e}").replace("NaN", "nan")).collect();
            writeln!(w, "{}", row.join(" "))?;
        }
        Ok(())
    };
    let regions = cell_regions(mesh);
    if regions.is_some() || !fields.cell.is_empty() {
        writeln!(w, "CELL_DATA {n}")?;
        if let Some(regions) = regions {
            writeln!(w, "SCALARS {REGION} int 1\nLOOKUP_TABLE default")?;
            for r in regions {
                writeln!(w, "{r}")?;
            }
        }
        if !fields.cell.is_empty() {
            writeln!(w, "FIELD FieldData {}", fields.cell.len())?;
            for (name, components, data) in cell_arrays(mesh, fields) {
                array(w, name, components, &data)?;
            }
        }
    }
    if !fields.point.is_empty() {
        writeln!(w, "POINT_DATA {}\nFIELD FieldData {}", mesh.points.len(), fields.point.len())?;
        for f in &fields.point {
            array(w, &f.name, f.components, &f.data)?;
        }
    }
    Ok(())
}
