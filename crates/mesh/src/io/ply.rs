//! PLY (Stanford), text and binary of both byte orders: vertices, polygons, edges. Other properties
//! and elements are read past.

use std::io::{self, Write};

use super::numbers::{show, vertex_index};
use super::scalar::Scalar;
use super::surface_faces;
use super::text::Text;
use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::fields::{Field, Fields};
use crate::mesh::Mesh;

pub(crate) struct Element {
    pub name: String,
    claimed: i64,
    pub properties: Vec<Property>,
}

pub(crate) struct Property {
    pub name: String,
    pub kind: Scalar,
    pub count: Option<Scalar>, // the type of the length of a list
}

/// The numbers after the header.
pub(crate) enum Body<'a> {
    Text(Text<'a>),
    Binary { file: &'a str, data: &'a [u8], pos: usize, big_endian: bool },
}

/// A number as an index and as a coordinate.
#[derive(Clone, Copy, Default)]
pub(crate) struct Number {
    pub int: i64,
    pub float: f64,
}

pub(crate) fn parse(file: &str, data: &[u8]) -> Result<Mesh> {
    let (elements, mut body) = header(file, data)?;
    let mut mesh = Mesh { name: file.to_owned(), ..Mesh::default() };
    for element in &elements {
        let n = body.claim(element)?;
        match element.name.as_str() {
            "vertex" => read_vertices(file, element, n, &mut body, &mut mesh)?,
            "face" => read_faces(file, element, n, &mut body, &mut mesh)?,
            "edge" => read_edges(file, element, n, &mut body, &mut mesh)?,
            _ => {
                for _ in 0..n {
                    body.row(element, |_, _| {})?;
                }
            }
        }
    }
    Ok(mesh)
}

/// The elements that a file announces, and a cursor behind its header.
pub(crate) fn header<'a>(file: &'a str, data: &'a [u8]) -> Result<(Vec<Element>, Body<'a>)> {
    let bad = |line: usize, what: String| {
        MeshError::new(ErrorKind::Malformed, file, what, "check that the file is a PLY file").at_line(line)
    };
    let (mut pos, mut number) = (0, 0);
    let mut format = None;
    let mut elements: Vec<Element> = Vec::new();
    loop {
        let rest = &data[pos..];
        let Some(len) = rest.iter().position(|&b| b == b'\n') else {
            let e = bad(number + 1, "the header does not end".into());
            return Err(if number == 0 { bad(1, "the first line is not `ply`".into()) } else { e });
        };
        (pos, number) = (pos + len + 1, number + 1);
        let Ok(line) = std::str::from_utf8(&rest[..len]) else {
            return Err(bad(number, "the header is no text".into()));
        };
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        if number == 1 && words != ["ply"] {
            return Err(bad(1, "the first line is not `ply`".into()));
        }
        match words[..] {
            ["end_header"] => break,
            ["format", f, _] => format = Some(f),
            ["element", name, n] => {
                let claimed = super::numbers::parse_int(n.as_bytes());
                let claimed = claimed.ok_or_else(|| bad(number, format!("{} is no number", show(n.as_bytes()))))?;
                elements.push(Element { name: name.to_owned(), claimed, properties: Vec::new() });
            }
            ["property", ref kind @ .., name] => {
                let scalar = |k: &str| {
                    Scalar::named(k).ok_or_else(|| bad(number, format!("unknown type {}", show(k.as_bytes()))))
                };
                let (kind, count) = match *kind {
                    [k] => (scalar(k)?, None),
                    ["list", n, k] => (scalar(k)?, Some(scalar(n)?)),
                    _ => return Err(bad(number, "a property without a type".into())),
                };
                let Some(element) = elements.last_mut() else {
                    return Err(bad(number, "a property before any element".into()));
                };
                element.properties.push(Property { name: name.to_owned(), kind, count });
            }
            ["ply"] | ["comment", ..] | ["obj_info", ..] | [] => {}
            _ => return Err(bad(number, format!("{} is no line of a header", show(line.as_bytes())))),
        }
    }
    let body = match format {
        Some("ascii") => Body::Text(Text::embedded(file, data, pos, number + 1)),
        Some("binary_little_endian") => Body::Binary { file, data, pos, big_endian: false },
        Some("binary_big_endian") => Body::Binary { file, data, pos, big_endian: true },
        _ => return Err(bad(2, "the format is neither ascii nor binary".into())),
    };
    Ok((elements, body))
}

impl Body<'_> {
    /// How many bytes of the file are behind the cursor.
    pub fn position(&self) -> usize {
        match self {
            Body::Text(text) => text.position(),
            Body::Binary { pos, .. } => *pos,
        }
    }

    /// Holds the count of an element against the rest of the file.
    pub fn claim(&self, element: &Element) -> Result<usize> {
        let size = |p: &Property| p.count.unwrap_or(p.kind).size();
        let (least, room, file) = match self {
            Body::Text(text) => return text.claim(element.claimed, &element.name, 2 * element.properties.len()),
            Body::Binary { file, data, pos, .. } => {
                let least = element.properties.iter().map(size).sum::<usize>().max(1);
                (least, (data.len() - pos) / least, file)
            }
        };
        match usize::try_from(element.claimed) {
            Ok(n) if n <= room => Ok(n),
            _ => Err(MeshError::new(
                ErrorKind::OversizedClaim,
                *file,
                format!(
                    "{} of the element `{}` are announced, but the rest of the file holds at most {room} of {least} bytes",
                    element.claimed, element.name
                ),
                "the count is wrong or the file is truncated",
            )),
        }
    }

    /// The next number.
    pub fn number(&mut self, kind: Scalar, what: &str) -> Result<Number> {
        match self {
            Body::Text(text) if kind.is_float() => {
                let float = text.expect_f64(what)?;
                Ok(Number { int: float as i64, float })
            }
            Body::Text(text) => {
                let int = text.expect_int(what)?;
                Ok(Number { int, float: int as f64 })
            }
            Body::Binary { file, data, pos, big_endian } => {
                let Some(bytes) = data[*pos..].get(..kind.size()) else {
                    return Err(truncated(file, what));
                };
                *pos += kind.size();
                Ok(Number { int: kind.i64(bytes, *big_endian), float: kind.f64(bytes, *big_endian) })
            }
        }
    }

    /// Reads one element; `see` gets the place of the property and each of its numbers.
    pub fn row(&mut self, element: &Element, mut see: impl FnMut(usize, Number)) -> Result<()> {
        for (k, p) in element.properties.iter().enumerate() {
            let n = match p.count {
                None => 1,
                Some(kind) => self.number(kind, "the length of a list")?.int,
            };
            for _ in 0..n {
                see(k, self.number(p.kind, &p.name)?);
            }
        }
        Ok(())
    }

    /// Adds the line, in text.
    pub fn locate(&self, e: MeshError) -> MeshError {
        match self {
            Body::Text(text) => e.at_line(text.line_number()),
            Body::Binary { .. } => e,
        }
    }
}

fn truncated(file: &str, what: &str) -> MeshError {
    let what = format!("the file ends before {what}");
    MeshError::new(ErrorKind::Truncated, file, what, "it is truncated: write or copy it again")
}

fn place(file: &str, element: &Element, names: &[&str], list: bool) -> Result<usize> {
    let found = element.properties.iter().position(|p| names.contains(&p.name.as_str()) && p.count.is_some() == list);
    found.ok_or_else(|| {
        let what = format!("the element `{}` has no property `{}`", element.name, names[0]);
        MeshError::new(ErrorKind::Malformed, file, what, "write it with the usual property names")
    })
}

fn read_vertices(file: &str, element: &Element, n: usize, body: &mut Body<'_>, mesh: &mut Mesh) -> Result<()> {
    let axes = [
        place(file, element, &["x"], false)?,
        place(file, element, &["y"], false)?,
        place(file, element, &["z"], false)?,
    ];
    mesh.points.reserve_exact(n);
    for i in mesh.points.len()..mesh.points.len() + n {
        let mut p = [0.0; 3];
        body.row(element, |k, x| {
            if let Some(axis) = axes.iter().position(|&a| a == k) {
                p[axis] = x.float;
            }
        })?;
        if let Some(c) = p.iter().find(|c| !c.is_finite()) {
            let what = format!("a coordinate is {c}");
            let e = MeshError::new(ErrorKind::NonFinite, file, what, "replace it by a finite number");
            return Err(body.locate(e.at_item(Item::Vertex(i))));
        }
        mesh.points.push(p);
    }
    Ok(())
}

fn read_faces(file: &str, element: &Element, n: usize, body: &mut Body<'_>, mesh: &mut Mesh) -> Result<()> {
    let list = place(file, element, &["vertex_indices", "vertex_index"], true)?;
    let mut corners = Vec::new();
    for _ in 0..n {
        let item = Item::Face(mesh.faces.len());
        corners.clear();
        let mut bad = None;
        body.row(element, |k, x| {
            if k == list {
                match vertex_index(x.int, 0) {
                    Ok(v) => corners.push(v),
                    Err(e) => bad = Some(e),
                }
            }
        })?;
        if let Some(e) = bad {
            return Err(body.locate(e.into_error(file).at_item(item)));
        }
        if corners.len() < 3 {
            let what = format!("a face of {} vertices", corners.len());
            let e = MeshError::new(ErrorKind::Malformed, file, what, "give a face three vertices or more");
            return Err(body.locate(e.at_item(item)));
        }
        mesh.faces.push(&corners);
    }
    Ok(())
}

fn read_edges(file: &str, element: &Element, n: usize, body: &mut Body<'_>, mesh: &mut Mesh) -> Result<()> {
    let ends = [place(file, element, &["vertex1"], false)?, place(file, element, &["vertex2"], false)?];
    for i in 0..n {
        let mut e = [0; 2];
        body.row(element, |k, x| {
            if let Some(end) = ends.iter().position(|&p| p == k) {
                e[end] = x.int;
            }
        })?;
        let mut edge = [0; 2];
        for (v, index) in edge.iter_mut().zip(e) {
            let at = |bad: super::numbers::BadIndex| body.locate(bad.into_error(file).at_item(Item::Edge(i)));
            *v = vertex_index(index, 0).map_err(at)?;
        }
        mesh.edges.push(edge);
    }
    Ok(())
}

/// Writes binary little-endian with double coordinates; colours and arrays become further properties, those
/// over cells only where the cells are the faces.
pub(crate) fn write(mesh: &Mesh, fields: &Fields, w: &mut dyn Write) -> io::Result<()> {
    let faces = surface_faces(mesh);
    let cell: &[Field] = if mesh.tets.is_empty() && !mesh.faces.is_empty() { &fields.cell } else { &[] };
    let large = faces.iter().any(|p| p.len() > 255);
    writeln!(w, "ply\nformat binary_little_endian 1.0\nelement vertex {}", mesh.points.len())?;
    writeln!(w, "property double x\nproperty double y\nproperty double z")?;
    if fields.colors.is_some() {
        writeln!(w, "property uchar red\nproperty uchar green\nproperty uchar blue")?;
    }
    declare(w, &fields.point)?;
    if !faces.is_empty() {
        let count = if large { "uint" } else { "uchar" };
        writeln!(w, "element face {}\nproperty list {count} uint vertex_indices", faces.len())?;
        declare(w, cell)?;
    }
    if !mesh.edges.is_empty() {
        writeln!(w, "element edge {}\nproperty uint vertex1\nproperty uint vertex2", mesh.edges.len())?;
    }
    writeln!(w, "end_header")?;
    let row = |w: &mut dyn Write, arrays: &[Field], i: usize| -> io::Result<()> {
        for f in arrays {
            for x in &f.data[i * f.components..][..f.components] {
                w.write_all(&x.to_le_bytes())?;
            }
        }
        Ok(())
    };
    for (i, p) in mesh.points.iter().enumerate() {
        for c in p {
            w.write_all(&c.to_le_bytes())?;
        }
        if let Some(colors) = &fields.colors {
            w.write_all(&colors[i])?;
        }
        row(w, &fields.point, i)?;
    }
    for (i, face) in faces.iter().enumerate() {
        if large {
            w.write_all(&(face.len() as u32).to_le_bytes())?;
        } else {
            w.write_all(&[face.len() as u8])?;
        }
        for v in face {
            w.write_all(&v.to_le_bytes())?;
        }
        row(w, cell, i)?;
    }
    for v in mesh.edges.as_flattened() {
        w.write_all(&v.to_le_bytes())?;
    }
    Ok(())
}

/// `name` for a scalar, `name_x` ... for a vector, `name_0` ... for more.
fn declare(w: &mut dyn Write, arrays: &[Field]) -> io::Result<()> {
    for f in arrays {
        let name: String = f.name.split_whitespace().collect::<Vec<_>>().join("_");
        for c in 0..f.components {
            match f.components {
                1 => writeln!(w, "property double {name}")?,
                3 => writeln!(w, "property double {name}_{}", ["x", "y", "z"][c])?,
                _ => writeln!(w, "property double {name}_{c}")?,
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "ply\nformat ascii 1.0\ncomment c\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nproperty uchar red\nelement face 2\nproperty list uchar int vertex_indices\n\
        element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n\
        0 0 0 255\n1 0 0 0\n1 1 0 0\n0 1 0 0\n3 0 1 2\n4 0 1 2 3\n0 2\n";

    #[test]
    fn text() {
        let mesh = parse("a.ply", TEXT.as_bytes()).unwrap();
        assert_eq!(mesh.faces.iter().collect::<Vec<_>>(), [&[0, 1, 2][..], &[0, 1, 2, 3]]);
        assert_eq!((mesh.points[2], mesh.edges[0]), ([1.0, 1.0, 0.0], [0, 2]));
    }

    #[test]
    fn big_endian() {
        let mut data = TEXT.split("end_header\n").next().unwrap().replace("ascii", "binary_big_endian").into_bytes();
        data.extend(b"end_header\n");
        for p in [[0f32, 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]] {
            p.iter().for_each(|c| data.extend(c.to_be_bytes()));
            data.push(9);
        }
        for face in [&[0i32, 1, 2][..], &[0, 1, 2, 3]] {
            data.push(face.len() as u8);
            face.iter().for_each(|v| data.extend(v.to_be_bytes()));
        }
        [0i32, 2].iter().for_each(|v| data.extend(v.to_be_bytes()));
        let text = parse("a.ply", TEXT.as_bytes()).unwrap();
        assert_eq!(parse("a.ply", &data).unwrap(), text);
        let e = parse("a.ply", &data[..data.len() - 3]).unwrap_err();
        assert!(matches!(e.kind(), ErrorKind::Truncated | ErrorKind::OversizedClaim), "{e}");
    }

    #[test]
    fn colours_are_bytes_between_coordinates_and_arrays() {
        let mesh = parse("a.ply", TEXT.as_bytes()).unwrap();
        let mut fields = Fields::none();
        fields.colors(vec![[1, 2, 3], [4, 5, 6], [7, 8, 9], [255, 0, 10]]).point("distortion", 1, vec![0.5; 4]);
        let mut data = Vec::new();
        write(&mesh, &fields, &mut data).unwrap();
        assert_eq!(parse("a.ply", &data).unwrap(), mesh);
        let header = data.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        let text = std::str::from_utf8(&data[..header]).unwrap();
        let order = ["double z", "uchar red", "uchar green", "uchar blue", "double distortion"].map(|p| text.find(p));
        assert!(order.is_sorted() && order[0].is_some(), "{text}");
        let last = &data[header + 3 * (24 + 3 + 8)..][24..27];
        assert_eq!(last, [255, 0, 10]);
        fields.colors(vec![[0; 3]; 3]);
        assert!(fields.check(&mesh).unwrap_err().to_string().contains("3 colours for 4 vertices"));
    }

    #[test]
    fn refusals() {
        let message = |from: &str, to: &str| parse("a.ply", TEXT.replace(from, to).as_bytes()).unwrap_err().to_string();
        assert!(message("vertex 4", "vertex 4000000").contains("at most"));
        assert!(message("3 0 1 2\n", "3 0 -1 2\n").contains("line 19: face 0 (0-based): vertex index -1 is negative"));
        assert!(message("float z", "float w").contains("no property `z`"));
        assert!(message("end_header", "").contains("is no line of a header"));
        assert!(message("ply\n", "PLY\n").contains("not `ply`"));
    }
}
