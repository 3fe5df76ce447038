//! Geomview OFF: vertices and polygons in text. Colours, normals and texture coordinates are read
//! past.

use std::io::{self, Write};

use super::numbers::{parse_f64, parse_int, show, write_point};
use super::surface_faces;
use super::text::Text;
use crate::error::{ErrorKind, Item, Result};
use crate::mesh::Mesh;

pub(crate) fn parse(file: &str, data: &[u8]) -> Result<Mesh> {
    let mut text = Text::new(file, data)?;
    let mut line = text.expect_line(|| "the word OFF".into())?;
    let keyword = line.clone().next().unwrap_or_default();
    if keyword.ends_with(b"OFF") {
        line.next();
        if !matches!(keyword, b"OFF" | b"COFF" | b"NOFF" | b"CNOFF" | b"STOFF") {
            return Err(line.error(
                ErrorKind::Unsupported,
                format!("{} is another kind of OFF", show(keyword)),
                "write it as plain OFF with three coordinates",
            ));
        }
    } else if parse_int(keyword).is_none() {
        return Err(line.error(
            ErrorKind::Malformed,
            format!("{} where OFF is expected", show(keyword)),
            "check that the file is an OFF file",
        ));
    }
    let rest = line.clone().next();
    if rest == Some(b"BINARY") {
        return Err(line.error(ErrorKind::Unsupported, "binary OFF", "write it as text"));
    }
    if rest.is_none() {
        line = text.expect_line(|| "the counts".into())?;
    }
    let claimed = [line.int("the number of vertices")?, line.int("the number of faces")?];
    line.only_numbers_follow()?;
    let counts = line.number;
    let n = text.claim(claimed[0], "vertices", 6).map_err(|e| e.at_line(counts))?;
    let mut mesh = Mesh { name: file.to_owned(), ..Mesh::default() };
    mesh.points.reserve_exact(n);
    for i in 0..n {
        let mut line = text.expect_line(|| format!("vertex {i} of {n}"))?;
        mesh.points.push([line.coordinate(i)?, line.coordinate(i)?, line.coordinate(i)?]);
        line.only_numbers_follow()?;
    }
    let n_faces = text.claim(claimed[1], "faces", 6).map_err(|e| e.at_line(counts))?;
    let mut corners = Vec::new();
    for i in 0..n_faces {
        let mut line = text.expect_line(|| format!("face {i} of {n_faces}"))?;
        let size = line.int("the number of corners")?;
        if size < 3 {
            return Err(line
                .error(ErrorKind::Malformed, format!("a face of {size} vertices"), "give a face three vertices or more")
                .at_item(Item::Face(i)));
        }
        corners.clear();
        for _ in 0..size {
            corners.push(line.vertex(0, n, Item::Face(i))?);
        }
        for word in &mut line {
            if parse_f64(word).is_none() {
                break; // the name of a colour
            }
        }
        mesh.faces.push(&corners);
    }
    if let Some(line) = text.next_line() {
        return Err(line.error(
            ErrorKind::CountMismatch,
            format!("more lines than the {n} vertices and {n_faces} faces announced"),
            "correct the counts",
        ));
    }
    Ok(mesh)
}

pub(crate) fn write(mesh: &Mesh, w: &mut dyn Write) -> io::Result<()> {
    let faces = surface_faces(mesh);
    writeln!(w, "OFF\n{} {} 0", mesh.points.len(), faces.len())?;
    for p in &mesh.points {
        write_point(w, p)?;
        writeln!(w)?;
    }
    for face in faces.iter() {
        write!(w, "{}", face.len())?;
        for v in face {
            write!(w, " {v}")?;
        }
        writeln!(w)?;
    }
    Ok(())
}
