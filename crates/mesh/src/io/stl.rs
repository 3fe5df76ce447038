//! STL, text and binary: a soup of triangles. Corners with the same bits (-0 counts as 0) become one
//! vertex, in order of first appearance; nothing is welded by distance.

use std::collections::HashMap;
use std::io::{self, Write};

use super::numbers::{show, write_point};
use super::scalar::Scalar;
use super::surface_faces;
use super::text::Text;
use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::mesh::Mesh;
use crate::vec3::{V3, cross, norm, sub};

/// Bytes before the triangles of a binary file, and of each triangle.
const HEADER: usize = 84;
const TRIANGLE: usize = 50;

#[derive(Default)]
struct Welder {
    mesh: Mesh,
    numbers: HashMap<[u64; 3], u32>,
}

impl Welder {
    fn vertex(&mut self, p: V3) -> u32 {
        // Adding zero turns -0 into 0 and changes nothing else.
        let key = p.map(|c| (c + 0.0).to_bits());
        *self.numbers.entry(key).or_insert_with(|| {
            self.mesh.points.push(p);
            self.mesh.points.len() as u32 - 1
        })
    }
}

pub(crate) fn parse(file: &str, data: &[u8]) -> Result<Mesh> {
    let claimed = data.get(80..HEADER).map(|b| Scalar::U32.i64(b, false) as usize);
    let binary_size = claimed.and_then(|n| n.checked_mul(TRIANGLE)?.checked_add(HEADER));
    // Binary files may begin with "solid" too: their size decides.
    if binary_size == Some(data.len()) {
        return parse_binary(file, &data[HEADER..]);
    }
    let start = data.trim_ascii_start();
    if start.get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid")) {
        return parse_text(file, data);
    }
    Err(match claimed {
        Some(n) => MeshError::new(
            ErrorKind::Truncated,
            file,
            format!("{n} triangles are announced, but its size of {} bytes does not fit them", data.len()),
            "it is truncated or no STL file",
        ),
        None => MeshError::new(
            ErrorKind::Malformed,
            file,
            "it is neither text nor binary STL",
            "check that the file is an STL file",
        ),
    })
}

fn parse_binary(file: &str, data: &[u8]) -> Result<Mesh> {
    let mut welder = Welder::default();
    for (i, triangle) in data.chunks_exact(TRIANGLE).enumerate() {
        let at = |k: usize, c: usize| Scalar::F32.f64(&triangle[12 + 12 * k + 4 * c..], false);
        let mut corners = [0; 3];
        for (k, corner) in corners.iter_mut().enumerate() {
            let p = [at(k, 0), at(k, 1), at(k, 2)];
            if let Some(c) = p.iter().find(|c| !c.is_finite()) {
                let what = format!("a coordinate is {c}");
                return Err(MeshError::new(ErrorKind::NonFinite, file, what, "replace it by a finite number")
                    .at_item(Item::Face(i)));
            }
            *corner = welder.vertex(p);
        }
        welder.mesh.faces.push(&corners);
    }
    Ok(Mesh { name: file.to_owned(), ..welder.mesh })
}

fn parse_text(file: &str, data: &[u8]) -> Result<Mesh> {
    let mut text = Text::new(file, data)?;
    let mut welder = Welder::default();
    let mut corners = Vec::new();
    let mut soup = 0; // corners so far
    let mut open = false; // inside solid ... endsolid
    while let Some(mut line) = text.next_line() {
        let keyword = line.next().unwrap_or_default();
        match keyword.to_ascii_lowercase().as_slice() {
            b"vertex" => {
                let p = [line.coordinate(soup)?, line.coordinate(soup)?, line.coordinate(soup)?];
                corners.push(welder.vertex(p));
                soup += 1;
            }
            b"endfacet" => {
                if corners.len() != 3 {
                    let what = format!("a facet of {} vertices", corners.len());
                    return Err(line
                        .error(ErrorKind::Malformed, what, "give every facet three vertices")
                        .at_item(Item::Face(welder.mesh.faces.len())));
                }
                welder.mesh.faces.push(&corners);
                corners.clear();
            }
            b"solid" => open = true,
            b"endsolid" => open = false,
            b"facet" | b"outer" | b"endloop" | b"color" => {}
            _ => {
                return Err(line.error(
                    ErrorKind::Malformed,
                    format!("{} is no keyword of STL", show(keyword)),
                    "check that the file is an STL file",
                ));
            }
        }
    }
    if open || !corners.is_empty() {
        return Err(text.truncated("`endsolid`"));
    }
    Ok(Mesh { name: file.to_owned(), ..welder.mesh })
}

/// Writes text: binary STL has single precision only. Polygons are written as fans.
pub(crate) fn write(mesh: &Mesh, w: &mut dyn Write) -> io::Result<()> {
    writeln!(w, "solid proxel")?;
    for t in surface_faces(mesh).fan_triangles() {
        let x = t.map(|v| mesh.points[v as usize]);
        let n = cross(sub(x[1], x[0]), sub(x[2], x[0]));
        let length = norm(n);
        let n = if length > 0.0 && length.is_finite() { n.map(|c| c / length) } else { [0.0; 3] };
        writeln!(w, "facet normal {:e} {:e} {:e}\n outer loop", n[0], n[1], n[2])?;
        for p in &x {
            write!(w, "  vertex ")?;
            write_point(w, p)?;
            writeln!(w)?;
        }
        writeln!(w, " endloop\nendfacet")?;
    }
    writeln!(w, "endsolid proxel")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn welds_equal_bits_only() {
        let next = 1f64.next_up();
        let text = format!(
            "solid a # b\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n\
             facet normal 0 0 1\nouter loop\nvertex -0 0 -0\nvertex {next:.17} 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n"
        );
        let mesh = parse("a.stl", text.as_bytes()).unwrap();
        assert_eq!(mesh.faces.indices(), [0, 1, 2, 0, 3, 2]);
    }

    #[test]
    fn binary_and_its_refusals() {
        let mut data = vec![b's'; HEADER];
        data[..5].copy_from_slice(b"solid");
        data[80..84].copy_from_slice(&1u32.to_le_bytes());
        for x in [0f32, 0., 1., 0., 0., 0., 1., 0., 0., 0., 1., 0.] {
            data.extend(x.to_le_bytes());
        }
        data.extend([0; 2]);
        let mesh = parse("a.stl", &data).unwrap();
        assert_eq!((mesh.points.len(), mesh.faces.indices()), (3, &[0, 1, 2][..]));
        data[0] = b'x';
        data[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(parse("a.stl", &data).unwrap_err().kind(), ErrorKind::Truncated);
        assert_eq!(parse("a.stl", b"what").unwrap_err().kind(), ErrorKind::Malformed);
        let cut = b"solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n";
        assert_eq!(parse("a.stl", cut).unwrap_err().kind(), ErrorKind::Truncated);
    }
}
