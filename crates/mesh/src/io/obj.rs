//! Wavefront OBJ: vertices, polygons and polylines. Texture coordinates, normals, groups and
//! materials are read past; vertex order is kept and nothing is welded or triangulated.

use std::io::{self, Write};

use super::numbers::{BadIndex, parse_int, show, write_point};
use super::surface_faces;
use super::text::{Line, Text};
use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::mesh::Mesh;

pub(crate) fn parse(file: &str, data: &[u8]) -> Result<Mesh> {
    let mut text = Text::new(file, data)?;
    let mut mesh = Mesh { name: file.to_owned(), index_base: 1, ..Mesh::default() };
    let mut corners = Vec::new();
    while let Some(mut line) = text.next_line() {
        let Some(keyword) = line.next() else { continue };
        match keyword {
            b"v" => {
                let i = mesh.points.len();
                mesh.points.push([line.coordinate(i)?, line.coordinate(i)?, line.coordinate(i)?]);
                line.only_numbers_follow()?; // a weight or a colour
            }
            b"f" => {
                let item = Item::Face(mesh.faces.len());
                read_corners(file, &mut line, mesh.points.len(), item, &mut corners)?;
                if corners.len() < 3 {
                    return Err(line
                        .error(
                            ErrorKind::Malformed,
                            format!("a face of {} vertices", corners.len()),
                            "give a face three vertices or more",
                        )
                        .at_item(item));
                }
                mesh.faces.push(&corners);
            }
            b"l" => {
                let item = Item::Edge(mesh.edges.len());
                read_corners(file, &mut line, mesh.points.len(), item, &mut corners)?;
                mesh.edges.extend(corners.windows(2).map(|w| [w[0], w[1]]));
            }
            _ if keyword.iter().all(|b| b.is_ascii_alphanumeric() || b"_-.".contains(b)) => {}
            _ => {
                return Err(line.error(
                    ErrorKind::Malformed,
                    format!("{} is no keyword of OBJ", show(keyword)),
                    "check that the file is an OBJ file",
                ));
            }
        }
    }
    Ok(mesh)
}

/// `a`, `a/t`, `a/t/n` or `a//n`: a counts from 1, or backwards from -1, the latest vertex.
fn read_corners(file: &str, line: &mut Line<'_>, so_far: usize, item: Item, out: &mut Vec<u32>) -> Result<()> {
    out.clear();
    while let Some(word) = line.next() {
        let word = &word[..word.iter().position(|&b| b == b'/').unwrap_or(word.len())];
        let at = |e: MeshError| e.at_line(line.number).at_item(item);
        let index = parse_int(word).ok_or_else(|| line.not_a_number(word, "a vertex index").at_item(item))?;
        let v = match index {
            1.. => index - 1, // a later vertex is legal: the range is checked at the end
            0 => return Err(at(BadIndex::Small { index, base: 1 }.into_error(file))),
            _ => {
                let v = (so_far as i64).saturating_add(index);
                if v < 0 {
                    return Err(at(MeshError::new(
                        ErrorKind::NegativeIndex,
                        file,
                        format!("relative index {index} reaches before the first of {so_far} vertices so far"),
                        "correct the index",
                    )));
                }
                v
            }
        };
        match u32::try_from(v) {
            Ok(v) if v < u32::MAX => out.push(v),
            _ => return Err(at(BadIndex::Huge { index }.into_error(file))),
        }
    }
    Ok(())
}

/// Writes every vertex, so that numbering is kept, the faces (of a body without faces: its
/// boundary) and the edges.
pub(crate) fn write(mesh: &Mesh, w: &mut dyn Write) -> io::Result<()> {
    for p in &mesh.points {
        write!(w, "v ")?;
        write_point(w, p)?;
        writeln!(w)?;
    }
    for face in surface_faces(mesh).iter() {
        write!(w, "f")?;
        for &v in face {
            write!(w, " {}", u64::from(v) + 1)?;
        }
        writeln!(w)?;
    }
    for e in &mesh.edges {
        writeln!(w, "l {} {}", u64::from(e[0]) + 1, u64::from(e[1]) + 1)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_relative_indices_and_polylines() {
        let mesh = parse(
            "a.obj",
            b"v 0 0 0\nvt 0 0\nv 1 0 0 1 0 0\ng a b\nv 1 1 0\nf -3/1/1 -2//2 -1\nv 0 1 0\nf 1/1 2 3 \\\n 4\nl 1 2 3\n",
        )
        .unwrap();
        assert_eq!(mesh.points.len(), 4);
        assert_eq!(mesh.faces.iter().collect::<Vec<_>>(), [&[0, 1, 2][..], &[0, 1, 2, 3]]);
        assert_eq!(mesh.edges, [[0, 1], [1, 2]]);
    }

    #[test]
    fn refusals() {
        let message = |d: &[u8]| parse("a.obj", d).unwrap_err().to_string();
        assert_eq!(
            message(b"v 0 0 0\nv 0 0 0\n\nf 1 2 -1000000\n"),
            "a.obj: line 4: face 0 (0-based): relative index -1000000 reaches before the first of 2 \
             vertices so far; correct the index"
        );
        assert_eq!(
            message(b"v 0 nan 0\n"),
            "a.obj: line 1: vertex 0 (0-based): coordinate `nan` is not finite; replace it by a \
             finite number"
        );
        assert_eq!(
            message(b"v 0 1.0.0 0\n"),
            "a.obj: line 1: vertex 0 (0-based): `1.0.0` is no number where a coordinate is \
             expected; correct the word"
        );
        assert_eq!(
            message(b"\x89PNG\r\n"),
            "a.obj: line 1: `\\x89PNG` is no keyword of OBJ; check that the file is an OBJ file"
        );
    }
}
