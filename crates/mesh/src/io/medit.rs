//! Medit `.mesh` in text: `Vertices`, `Tetrahedra`, `Triangles`, `Quadrilaterals`, `Edges`, each with
//! a reference per line that becomes the region. Other sections (corners, ridges, normals) are read
//! past. Indices count from 1.

use std::io::{self, Write};

use super::numbers::{parse_f64, show, write_point};
use super::text::Text;
use crate::error::{ErrorKind, Item, Result};
use crate::mesh::{Mesh, Polygons};

pub(crate) fn parse(file: &str, data: &[u8]) -> Result<Mesh> {
    let mut text = Text::new(file, data)?;
    let mut mesh = Mesh { name: file.to_owned(), index_base: 1, ..Mesh::default() };
    let (mut tet_refs, mut face_refs, mut edge_refs) = (Vec::new(), Vec::new(), Vec::new());
    let first = text.expect_word("`MeshVersionFormatted`")?;
    if first != b"MeshVersionFormatted" {
        return Err(text.error(
            ErrorKind::Malformed,
            format!("{} where MeshVersionFormatted is expected", show(first)),
            "check that the file is a Medit file",
        ));
    }
    text.expect_int("the version")?;
    while let Some(keyword) = text.next_word() {
        match keyword {
            b"End" => break,
            b"Dimension" => {
                let dimension = text.expect_int("the dimension")?;
                if dimension != 2 && dimension != 3 {
                    let what = format!("the dimension is {dimension}");
                    return Err(text.error(ErrorKind::Malformed, what, "give 2 or 3"));
                }
                mesh.planar = dimension == 2;
            }
            b"Vertices" => {
                let n = text.expect_count("vertices", 6)?;
                mesh.points.reserve_exact(n);
                for i in mesh.points.len()..mesh.points.len() + n {
                    let (x, y) = (text.expect_coordinate(i)?, text.expect_coordinate(i)?);
                    mesh.points.push([x, y, if mesh.planar { 0.0 } else { text.expect_coordinate(i)? }]);
                    text.expect_f64("a reference")?;
                }
            }
            b"Tetrahedra" => {
                for i in 0..text.expect_count("tetrahedra", 10)? {
                    let (t, r) = element(&mut text, Item::Tetrahedron(i))?;
                    mesh.tets.push(t);
                    tet_refs.push(r);
                }
            }
            b"Triangles" => {
                for _ in 0..text.expect_count("triangles", 8)? {
                    let (t, r) = element::<3>(&mut text, Item::Face(mesh.faces.len()))?;
                    mesh.faces.push(&t);
                    face_refs.push(r);
                }
            }
            b"Quadrilaterals" => {
                for _ in 0..text.expect_count("quadrilaterals", 10)? {
                    let (t, r) = element::<4>(&mut text, Item::Face(mesh.faces.len()))?;
                    mesh.faces.push(&t);
                    face_refs.push(r);
                }
            }
            b"Edges" => {
                for i in 0..text.expect_count("edges", 6)? {
                    let (t, r) = element(&mut text, Item::Edge(i))?;
                    mesh.edges.push(t);
                    edge_refs.push(r);
                }
            }
            b"Hexahedra" | b"Prisms" | b"Pyramids" | b"TetrahedraP2" | b"TrianglesP2" => {
                if text.expect_int("the number of elements")? > 0 {
                    return Err(text.error(
                        ErrorKind::Unsupported,
                        format!("elements of the kind {}", show(keyword)),
                        "split them into first-order tetrahedra",
                    ));
                }
            }
            _ if keyword.first().is_some_and(u8::is_ascii_alphabetic) => {
                // A section that we have no use for: its numbers end at the next keyword.
                while text.peek_word().is_some_and(|w| parse_f64(w).is_some()) {
                    text.next_word();
                }
            }
            _ => {
                return Err(text.error(
                    ErrorKind::Malformed,
                    format!("{} where a keyword is expected", show(keyword)),
                    "correct the count of the section before it",
                ));
            }
        }
    }
    let some = |refs: Vec<i32>| refs.iter().any(|&r| r != 0).then_some(refs);
    (mesh.tet_regions, mesh.face_regions, mesh.edge_regions) = (some(tet_refs), some(face_refs), some(edge_refs));
    Ok(mesh)
}

/// K vertex indices and a reference.
fn element<const K: usize>(text: &mut Text<'_>, item: Item) -> Result<([u32; K], i32)> {
    let mut corners = [0; K];
    for c in &mut corners {
        *c = text.expect_vertex(1, item)?; // held against the number of vertices at the end
    }
    let reference = text.expect_int("a reference")?;
    let reference = i32::try_from(reference).map_err(|_| {
        text.error(ErrorKind::IndexOutOfRange, format!("reference {reference}"), "keep references below 2^31")
            .at_item(item)
    })?;
    Ok((corners, reference))
}

/// Writes text of version 2 (double precision). The faces must be triangles and quads; all triangles
/// come before all quads.
pub(crate) fn write(mesh: &Mesh, w: &mut dyn Write) -> io::Result<()> {
    let dimension = if mesh.planar { 2 } else { 3 };
    writeln!(w, "MeshVersionFormatted 2\nDimension {dimension}\nVertices\n{}", mesh.points.len())?;
    for p in &mesh.points {
        if mesh.planar {
            write!(w, "{:.16e} {:.16e}", p[0], p[1])?;
        } else {
            write_point(w, p)?;
        }
        writeln!(w, " 0")?;
    }
    let tets = mesh.tets.iter().map(|t| &t[..]);
    section(w, "Tetrahedra", tets, mesh.tet_regions.as_deref(), |_| true)?;
    let faces: &Polygons = &mesh.faces;
    section(w, "Triangles", faces.iter(), mesh.face_regions.as_deref(), |c| c.len() == 3)?;
    section(w, "Quadrilaterals", faces.iter(), mesh.face_regions.as_deref(), |c| c.len() == 4)?;
    let edges = mesh.edges.iter().map(|e| &e[..]);
    section(w, "Edges", edges, mesh.edge_regions.as_deref(), |_| true)?;
    writeln!(w, "End")
}

fn section<'a>(
    w: &mut dyn Write,
    name: &str,
    elements: impl Iterator<Item = &'a [u32]> + Clone,
    regions: Option<&[i32]>,
    belongs: impl Fn(&[u32]) -> bool,
) -> io::Result<()> {
    let n = elements.clone().filter(|e| belongs(e)).count();
    if n == 0 {
        return Ok(());
    }
    writeln!(w, "{name}\n{n}")?;
    for (i, element) in elements.enumerate().filter(|(_, e)| belongs(e)) {
        for &v in element {
            write!(w, "{} ", u64::from(v) + 1)?;
        }
        writeln!(w, "{}", regions.map_or(0, |r| r[i]))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const BODY: &str = "MeshVersionFormatted 1\nDimension\n3 # c\nVertices 4\n0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 0\n\
        Corners 2 1 2\nTetrahedra 1\n1 2 3 4 7\nTriangles 1 1 2 3 0\nEnd\n";

    #[test]
    fn sections_in_any_layout() {
        let mesh = parse("a.mesh", BODY.as_bytes()).unwrap();
        assert_eq!((mesh.points.len(), mesh.tets[0]), (4, [0, 1, 2, 3]));
        assert_eq!((mesh.tet_regions, mesh.face_regions), (Some(vec![7]), None));
    }

    #[test]
    fn refusals() {
        let message =
            |from: &str, to: &str| parse("a.mesh", BODY.replace(from, to).as_bytes()).unwrap_err().to_string();
        assert_eq!(
            message("1 2 3 4 7", "0 2 3 4 7"),
            "a.mesh: line 8: tetrahedron 0 (0-based): vertex index 0 is out of range, vertices are \
             numbered from 1; correct the index"
        );
        assert!(message("Vertices 4", "Vertices 400").contains("at most"));
        assert!(message("Tetrahedra 1", "Hexahedra 1").contains("split them"));
        assert!(message("Tetrahedra 1\n", "Tetrahedra 1\n 9 ").contains("where a keyword is expected"));
    }
}
