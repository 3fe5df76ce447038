//! TetGen and Triangle: `.node` with the vertices, `.ele` with the elements.
//!
//! `.node`: `<n> <dimension> <attributes> <marker 0|1>`, then `<index> <x> <y> [<z>] ...`.
//! `.ele`: `<n> <corners> <attributes>`, then `<index> <v1> ... [<attribute> ...]`.
//! The first index of `.node`, 0 or 1, is the base of every index in the pair.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::numbers::{parse_f64, write_point};
use super::text::Text;
use super::{display, read_bytes};
use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::mesh::Mesh;

/// The vertices of a `.node` file.
pub(crate) struct Nodes {
    pub points: Vec<[f64; 3]>,
    pub base: u32,
    pub planar: bool,
}

/// Both paths of a pair, given either of them or their common stem.
pub(crate) fn pair(path: &Path) -> (PathBuf, PathBuf) {
    let known = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("node") || e.eq_ignore_ascii_case("ele"));
    let stem = if known { path.with_extension("") } else { path.to_owned() };
    let with = |extension: &str| {
        let mut name = stem.clone().into_os_string();
        name.push(extension);
        let other = PathBuf::from(name);
        // The path as given keeps its spelling (`A.NODE`).
        let same = path.extension().is_some_and(|e| extension[1..].eq_ignore_ascii_case(&e.to_string_lossy()));
        if same { path.to_owned() } else { other }
    };
    (with(".node"), with(".ele"))
}

/// Reads the pair.
pub(crate) fn read(path: &Path) -> Result<Mesh> {
    let (node, ele) = pair(path);
    let nodes = read_nodes(&node)?;
    let file = display(&ele);
    let data = read_bytes(&ele).map_err(|e| match e.kind() {
        ErrorKind::NotFound => MeshError::new(
            ErrorKind::NotFound,
            &file,
            format!("no such file, though {} needs its elements", display(&node)),
            "put the .ele file beside the .node file",
        ),
        _ => e,
    })?;
    let mut mesh = Mesh {
        name: display(path),
        points: nodes.points,
        index_base: nodes.base,
        planar: nodes.planar,
        ..Mesh::default()
    };
    parse_elements(&file, &data, &mut mesh)?;
    Ok(mesh)
}

/// Reads the `.node` file of a pair.
pub(crate) fn read_nodes(path: &Path) -> Result<Nodes> {
    let (node, _) = pair(path);
    parse_nodes(&display(&node), &read_bytes(&node)?)
}

/// Parses `.node`.
pub(crate) fn parse_nodes(file: &str, data: &[u8]) -> Result<Nodes> {
    let mut text = Text::new(file, data)?;
    let mut header = text.expect_line(|| "the number of vertices".into())?;
    let claimed = header.int("the number of vertices")?;
    let dimension = header.int_or(3, "the dimension")?;
    header.only_numbers_follow()?;
    if dimension != 2 && dimension != 3 {
        return Err(header.error(
            ErrorKind::Malformed,
            format!("the dimension is {dimension}"),
            "the first line must read `<vertices> <2 or 3> <attributes> <markers>`",
        ));
    }
    let planar = dimension == 2;
    let n = text.claim(claimed, "vertices", if planar { 6 } else { 8 }).map_err(|e| e.at_line(header.number))?;
    let mut points = Vec::with_capacity(n);
    let mut base = 0;
    for i in 0..n {
        let mut line = text.expect_line(|| format!("vertex {i} of {n}"))?;
        let index = line.int("a vertex number")?;
        if i == 0 && index == 1 {
            base = 1;
        }
        if index != i as i64 + base {
            return Err(line
                .error(
                    ErrorKind::Malformed,
                    format!("vertex number {index} where {} is expected", i as i64 + base),
                    "number the vertices one by one from 0 or 1",
                )
                .at_item(Item::Vertex(i)));
        }
        let (x, y) = (line.coordinate(i)?, line.coordinate(i)?);
        points.push([x, y, if planar { 0.0 } else { line.coordinate(i)? }]);
        line.only_numbers_follow()?;
    }
    no_more_lines(&mut text, n, "vertices")?;
    Ok(Nodes { points, base: base as u32, planar })
}

/// Parses `.ele` into a mesh that has its vertices.
pub(crate) fn parse_elements(file: &str, data: &[u8], mesh: &mut Mesh) -> Result<()> {
    let mut text = Text::new(file, data)?;
    let mut header = text.expect_line(|| "the number of elements".into())?;
    let claimed = header.int("the number of elements")?;
    let corners = header.int_or(4, "the number of corners")?;
    let attributes = header.int_or(0, "the number of attributes")?;
    if corners != 3 && corners != 4 {
        return Err(header.error(
            ErrorKind::Unsupported,
            format!("elements of {corners} vertices"),
            "give tetrahedra of 4 or triangles of 3 (first-order elements)",
        ));
    }
    let corners = corners as usize;
    let n = text.claim(claimed, "elements", 2 * (corners + 1)).map_err(|e| e.at_line(header.number))?;
    let (base, n_verts) = (mesh.index_base, mesh.points.len());
    let mut regions = Vec::new();
    if corners == 4 {
        mesh.tets.reserve_exact(n);
    }
    let mut first = 0;
    for i in 0..n {
        let mut line = text.expect_line(|| format!("element {i} of {n}"))?;
        let index = line.int("an element number")?;
        if i == 0 && index == 1 {
            first = 1;
        }
        if index != i as i64 + first {
            return Err(line.error(
                ErrorKind::Malformed,
                format!("element number {index} where {} is expected", i as i64 + first),
                "number the elements one by one from 0 or 1",
            ));
        }
        let item = if corners == 4 { Item::Tetrahedron(i) } else { Item::Face(i) };
        let mut v = [0; 4];
        for v in &mut v[..corners] {
            *v = line.vertex(base, n_verts, item)?;
        }
        if corners == 4 {
            mesh.tets.push(v)
        } else {
            mesh.faces.push(&v[..3])
        }
        if attributes > 0 {
            // TetGen puts the region last.
            let word = line.clone().last().ok_or_else(|| line.missing("its attribute"))?;
            let value = parse_f64(word).ok_or_else(|| line.not_a_number(word, "an attribute"))?;
            if value as i32 as f64 == value {
                regions.push(value as i32);
            }
        }
        line.only_numbers_follow()?;
    }
    no_more_lines(&mut text, n, "elements")?;
    // A region is a number of a material: fractional attributes are something else.
    if attributes > 0 && regions.len() == n {
        if corners == 4 { mesh.tet_regions = Some(regions) } else { mesh.face_regions = Some(regions) }
    }
    Ok(())
}

fn no_more_lines(text: &mut Text<'_>, n: usize, what: &str) -> Result<()> {
    match text.next_line() {
        None => Ok(()),
        Some(line) => Err(line.error(
            ErrorKind::CountMismatch,
            format!("more lines than the {n} {what} that the first line announces"),
            "correct the count on the first line",
        )),
    }
}

/// Writes `.node`, numbered from the base of the mesh.
pub(crate) fn write_nodes(mesh: &Mesh, w: &mut dyn Write) -> io::Result<()> {
    let dimension = if mesh.planar { 2 } else { 3 };
    writeln!(w, "{} {dimension} 0 0", mesh.points.len())?;
    for (i, p) in mesh.points.iter().enumerate() {
        write!(w, "{} ", i as u64 + u64::from(mesh.index_base))?;
        if mesh.planar {
            writeln!(w, "{:.16e} {:.16e}", p[0], p[1])?;
        } else {
            write_point(w, p)?;
            writeln!(w)?;
        }
    }
    Ok(())
}

/// Writes `.ele`: the tetrahedra, or the triangles where there are none.
pub(crate) fn write_elements(mesh: &Mesh, w: &mut dyn Write) -> io::Result<()> {
    let (regions, corners) = match mesh.tets.is_empty() {
        false => (&mesh.tet_regions, 4),
        true => (&mesh.face_regions, 3),
    };
    let n = if corners == 4 { mesh.tets.len() } else { mesh.faces.len() };
    writeln!(w, "{n} {corners} {}", u8::from(regions.is_some()))?;
    let base = u64::from(mesh.index_base);
    for i in 0..n {
        write!(w, "{}", i as u64 + base)?;
        let element = if corners == 4 { &mesh.tets[i][..] } else { mesh.faces.get(i) };
        for &v in element {
            write!(w, " {}", u64::from(v) + base)?;
        }
        if let Some(r) = regions {
            write!(w, " {}", r[i])?;
        }
        writeln!(w)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const NODE: &[u8] = b"# c\n4 3 1 1\n1 0 0 0 .5 1\n2 1 0 0 .5 1\n3 0 1 0 .5 1\n4 0 0 1 .5 1\n# end\n";

    fn elements(ele: &[u8]) -> Result<Mesh> {
        let nodes = parse_nodes("a.node", NODE)?;
        let mut mesh = Mesh { points: nodes.points, index_base: nodes.base, ..Mesh::default() };
        parse_elements("a.ele", ele, &mut mesh)?;
        Ok(mesh)
    }

    #[test]
    fn base_attributes_and_regions() {
        let mesh = elements(b"1 4 2\n1 1 2 3 4 0.5 7\n").unwrap();
        assert_eq!((mesh.index_base, mesh.tets[0]), (1, [0, 1, 2, 3]));
        assert_eq!(mesh.tet_regions, Some(vec![7]));
        assert_eq!(elements(b"1 4 1\n1 1 2 3 4 0.5\n").unwrap().tet_regions, None);
    }

    #[test]
    fn messages_name_line_item_and_remedy() {
        let message = |ele: &[u8]| elements(ele).unwrap_err().to_string();
        assert_eq!(
            message(b"1 4 0\n1 1 2 3 5\n"),
            "a.ele: line 2: tetrahedron 0 (0-based): vertex index 5 is out of range, the 4 vertices \
             are numbered 1 to 4; correct the index or add the missing vertices"
        );
        assert_eq!(
            message(b"1 4 0\n1 1 2 3 -1\n"),
            "a.ele: line 2: tetrahedron 0 (0-based): vertex index -1 is negative; correct the index"
        );
        assert_eq!(
            message(b"2 4 0\n1 1 2 3 4\n"),
            "a.ele: line 1: 2 elements are announced, but the rest of the file holds at most 1; \
             the count is wrong or the file is truncated"
        );
        assert_eq!(
            message(b"1 4 0\n1 1 2 3 4\n2 1 2 3 4\n"),
            "a.ele: line 3: more lines than the 1 elements that the first line announces; correct \
             the count on the first line"
        );
        assert_eq!(
            message(b"1 10 0\n1 1 2 3 4 1 1 1 1 1 1\n"),
            "a.ele: line 1: elements of 10 vertices; give tetrahedra of 4 or triangles of 3 \
             (first-order elements)"
        );
    }

    #[test]
    fn a_huge_claim_is_refused_before_allocating() {
        let e = parse_nodes("a.node", b"4000000000000 3 0 0\n0 0 0 0\n").err().unwrap();
        assert_eq!(e.kind(), ErrorKind::OversizedClaim);
        let e = parse_nodes("a.node", b"-4 3 0 0\n0 0 0 0\n").err().unwrap();
        assert_eq!(e.kind(), ErrorKind::CountMismatch);
    }
}
