//! Texture coordinates of PLY: a list with each face (as MeshLab writes), or a pair with each vertex.

use std::io::{self, Write};

use super::UvMap;
use crate::Fields;
use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::io::ply::{Body, Element, header, write as write_plain};
use crate::io::text::is_space;
use crate::mesh::{Mesh, Polygons};

/// u and v of each corner, one after the other.
const LIST: &str = "texcoord";
/// What programs call u and v of a vertex.
const PAIRS: [[&str; 2]; 4] = [["s", "t"], ["u", "v"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];

/// Lists of faces, or else pairs of vertices. `None` where there is neither.
pub(super) fn parse(file: &str, data: &[u8], faces: &Polygons) -> Result<Option<UvMap>> {
    let (elements, mut body) = header(file, data)?;
    let mut of_corners = Vec::with_capacity(faces.indices().len());
    let mut of_vertices: Vec<[f64; 2]> = Vec::new();
    let mut listed = false;
    let mut face = 0;
    for element in &elements {
        let n = body.claim(element)?;
        let pair = pair(element).filter(|_| element.name == "vertex");
        let list = list(element).filter(|_| element.name == "face");
        listed |= list.is_some();
        for _ in 0..n {
            let mut numbers = Vec::new();
            body.row(element, |k, x| {
                if Some(k) == list || pair.is_some_and(|p| p.contains(&k)) {
                    numbers.push((k, x.float));
                }
            })?;
            if let Some([u, _]) = pair {
                let mut uv = [0.0; 2];
                numbers.iter().for_each(|&(k, x)| uv[usize::from(k != u)] = x);
                of_vertices.push(uv);
            }
            if element.name == "face" && face < faces.len() {
                let corners = faces.get(face).len();
                match numbers.len() {
                    0 => of_corners.extend(std::iter::repeat_n(None, corners)),
                    m if m == 2 * corners => of_corners.extend(numbers.chunks_exact(2).map(|p| Some([p[0].1, p[1].1]))),
                    m => {
                        let what = format!("a list of {m} texture coordinates for {corners} corners");
                        let e = MeshError::new(ErrorKind::CountMismatch, file, what, "give u and v of each corner");
                        return Err(body.locate(e.at_item(Item::Face(face))));
                    }
                }
                face += 1;
            }
        }
    }
    let values = match (listed, of_vertices.is_empty()) {
        (true, _) if of_corners.iter().all(Option::is_none) => return Ok(None),
        (true, _) => of_corners,
        (false, false) => faces.indices().iter().map(|&v| of_vertices.get(v as usize).copied()).collect(),
        (false, true) => return Ok(None),
    };
    if let Some(i) = values.iter().flatten().position(|uv| uv.iter().any(|x| !x.is_finite())) {
        let what = format!("texture coordinate {i} (0-based, by corners) is not finite");
        return Err(MeshError::new(ErrorKind::NonFinite, file, what, "replace it by a finite number"));
    }
    UvMap::from_values(faces, &values).map(Some)
}

fn pair(element: &Element) -> Option<[usize; 2]> {
    let place = |name: &str| element.properties.iter().position(|p| p.name == name && p.count.is_none());
    PAIRS.iter().find_map(|[u, v]| Some([place(u)?, place(v)?]))
}

fn list(element: &Element) -> Option<usize> {
    element.properties.iter().position(|p| p.name == LIST && p.count.is_some())
}

/// Writes a mesh with its map, binary.
pub(super) fn write(mesh: &Mesh, uv: &UvMap, w: &mut dyn Write) -> io::Result<()> {
    let mut plain = Vec::new();
    write_plain(mesh, &Fields::none(), &mut plain)?;
    rewrite(&mesh.name, &plain, &mesh.faces, uv, w)
}

/// Writes the file `data` again with the lists of this map in place of those that its faces have; all else stays, in
/// text but for comments and white space between the numbers.
pub(super) fn rewrite(file: &str, data: &[u8], faces: &Polygons, uv: &UvMap, w: &mut dyn Write) -> io::Result<()> {
    let (elements, mut body) = header(file, data).map_err(io::Error::other)?;
    let long = faces.iter().any(|f| 2 * f.len() > 255);
    write_header(&data[..body.position()], long, w)?;
    let (text, big) = match &body {
        Body::Text(_) => (true, false),
        Body::Binary { big_endian, .. } => (false, *big_endian),
    };
    let mut face = 0;
    for element in &elements {
        let n = body.claim(element).map_err(io::Error::other)?;
        let is_face = element.name == "face";
        for _ in 0..n {
            for p in &element.properties {
                let keep = !(is_face && p.name == LIST && p.count.is_some());
                let mut number = |kind| -> io::Result<i64> {
                    let x = body.number(kind, &p.name).map_err(io::Error::other)?;
                    let end = body.position();
                    let start = match text {
                        true => data[..end].iter().rposition(|&b| is_space(b)).map_or(0, |i| i + 1),
                        false => end - kind.size(),
                    };
                    if keep {
                        w.write_all(&data[start..end])?;
                        w.write_all(if text { b" " } else { b"" })?;
                    }
                    Ok(x.int)
                };
                let count = p.count.map_or(Ok(1), &mut number)?;
                for _ in 0..count {
                    number(p.kind)?;
                }
            }
            if is_face {
                let ends = faces.offsets().get(face..face + 2);
                let corners = ends.map_or(0..0, |e| e[0] as usize..e[1] as usize);
                write_list(uv, corners, long, text, big, w)?;
                face += 1;
            }
            w.write_all(if text { b"\n" } else { b"" })?;
        }
    }
    if face != faces.len() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "the map is for other faces than those of the file"));
    }
    if text { Ok(()) } else { w.write_all(&data[body.position()..]) }
}

/// The header, with one list of coordinates at the end of what a face has.
fn write_header(header: &[u8], long: bool, w: &mut dyn Write) -> io::Result<()> {
    let mut in_face = false;
    for line in header.split_inclusive(|&b| b == b'\n') {
        let text = String::from_utf8_lossy(line);
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        if matches!(words[..], ["element" | "end_header", ..]) {
            if in_face {
                let end = if line.ends_with(b"\r\n") { "\r\n" } else { "\n" };
                write!(w, "property list {} double {LIST}{end}", if long { "uint" } else { "uchar" })?;
            }
            in_face = matches!(words[..], ["element", "face", ..]);
        }
        if !(in_face && matches!(words[..], ["property", "list", _, _, LIST])) {
            w.write_all(line)?;
        }
    }
    Ok(())
}

/// The list of one face, empty where it is not mapped.
fn write_list(
    uv: &UvMap,
    corners: std::ops::Range<usize>,
    long: bool,
    text: bool,
    big: bool,
    w: &mut dyn Write,
) -> io::Result<()> {
    let values: Vec<f64> = corners.filter_map(|i| uv.at(i)).flatten().collect();
    if text {
        write!(w, "{}", values.len())?;
        return values.iter().try_for_each(|x| write!(w, " {x:.16e}"));
    }
    let n = values.len() as u32;
    match (long, big) {
        (false, _) => w.write_all(&[n as u8])?,
        (true, true) => w.write_all(&n.to_be_bytes())?,
        (true, false) => w.write_all(&n.to_le_bytes())?,
    }
    values.iter().try_for_each(|x| w.write_all(&if big { x.to_be_bytes() } else { x.to_le_bytes() }))
}
