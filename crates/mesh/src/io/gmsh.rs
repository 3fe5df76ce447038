//! Gmsh `.msh`, versions 2.2 and 4.1, text and binary: nodes, edges, triangles, quads, tetrahedra and
//! their physical groups. Written as text of version 2.2, which every reader takes.

use std::collections::HashMap;
use std::io::{self, Write};

use super::numbers::{show, write_point};
use super::scalar::Scalar;
use super::text::Text;
use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::mesh::Mesh;

struct Reader<'a> {
    text: Text<'a>,
    binary: bool,
    big_endian: bool,
    size_t: Scalar,
    /// The number of each node; nodes may be numbered with gaps.
    nodes: HashMap<u64, u32>,
    /// The physical group of each entity (dimension, tag), from version 4 on.
    physical: HashMap<(i64, i64), i32>,
    regions: [Vec<i32>; 3], // of edges, faces, tetrahedra
    mesh: Mesh,
}

pub(crate) fn parse(file: &str, data: &[u8]) -> Result<Mesh> {
    let mut text = Text::embedded(file, data, 0, 1);
    if text.take_line() != b"$MeshFormat" {
        return Err(MeshError::new(
            ErrorKind::Malformed,
            file,
            "the first line is not `$MeshFormat`",
            "check that the file is a Gmsh file of version 2 or 4",
        ));
    }
    let version = text.expect_f64("the version")?;
    let binary = text.expect_int("the file type")? == 1;
    let size_t = if text.expect_int("the data size")? == 4 { Scalar::U32 } else { Scalar::U64 };
    let legacy = (2.0..3.0).contains(&version);
    if !legacy && version != 4.1 {
        return Err(text.error(
            ErrorKind::Unsupported,
            format!("version {version} of the Gmsh format"),
            "save it as version 4.1 or 2.2",
        ));
    }
    text.take_line();
    let mut big_endian = false;
    if binary {
        let one = text.take_bytes(4, "the number that tells the byte order")?;
        big_endian = one[3] == 1;
    }
    let mesh = Mesh { name: file.to_owned(), index_base: 1, ..Mesh::default() };
    let (nodes, physical, regions) = Default::default();
    let mut r = Reader { text, binary, big_endian, size_t, nodes, physical, regions, mesh };
    r.end("MeshFormat")?;
    while let Some(word) = r.text.next_word() {
        let Some(name) = word.strip_prefix(b"$").and_then(|n| std::str::from_utf8(n).ok()) else {
            return Err(r.malformed(format!("{} where a section is expected", show(word))));
        };
        match (name, legacy) {
            ("Nodes", true) => r.nodes_2()?,
            ("Elements", true) => r.elements_2()?,
            ("Nodes", false) => r.nodes_4()?,
            ("Elements", false) => r.elements_4()?,
            ("Entities", false) => r.entities()?,
            _ => {
                if !r.text.skip_past(format!("$End{name}").as_bytes()) {
                    return Err(r.text.truncated(format!("$End{name}")));
                }
                continue;
            }
        }
        r.end(name)?;
    }
    let some = |refs: Vec<i32>| refs.iter().any(|&r| r != 0).then_some(refs);
    let [edges, faces, tets] = r.regions;
    let mut mesh = r.mesh;
    (mesh.edge_regions, mesh.face_regions, mesh.tet_regions) = (some(edges), some(faces), some(tets));
    Ok(mesh)
}

impl Reader<'_> {
    fn malformed(&self, what: impl Into<String>) -> MeshError {
        self.text.error(ErrorKind::Malformed, what, "save the file again as version 4.1 or 2.2")
    }

    fn end(&mut self, name: &str) -> Result<()> {
        let word = self.text.expect_word(&format!("$End{name}"))?;
        if word == format!("$End{name}").as_bytes() {
            return Ok(());
        }
        Err(self.malformed(format!("{} where $End{name} is expected: a count is wrong", show(word))))
    }

    fn number(&mut self, kind: Scalar) -> Result<i64> {
        if !self.binary {
            return self.text.expect_int("an integer");
        }
        Ok(kind.i64(self.text.take_bytes(kind.size(), "the end of its section")?, self.big_endian))
    }

    fn int(&mut self) -> Result<i64> {
        self.number(Scalar::I32)
    }

    fn size(&mut self) -> Result<i64> {
        self.number(self.size_t)
    }

    fn real(&mut self) -> Result<f64> {
        if !self.binary {
            return self.text.expect_f64("a number");
        }
        Ok(Scalar::F64.f64(self.text.take_bytes(8, "the end of its section")?, self.big_endian))
    }

    /// In binary files a section starts on the line after its name.
    fn begin(&mut self) {
        if self.binary {
            self.text.take_line();
        }
    }

    fn add_node(&mut self, tag: i64) -> Result<()> {
        let i = self.nodes.len();
        let fresh = u64::try_from(tag).is_ok_and(|tag| self.nodes.insert(tag, i as u32).is_none());
        if fresh { Ok(()) } else { Err(self.malformed(format!("node number {tag} is negative or occurs twice"))) }
    }

    fn point(&mut self) -> Result<()> {
        let i = self.mesh.points.len();
        let mut p = [0.0; 3];
        for c in &mut p {
            *c = if self.binary { self.real()? } else { self.text.expect_coordinate(i)? };
        }
        self.mesh.points.push(p);
        Ok(())
    }

    fn nodes_2(&mut self) -> Result<()> {
        let n = self.text.expect_count("nodes", 8)?;
        self.begin();
        for _ in 0..n {
            let tag = self.int()?;
            self.add_node(tag)?;
            self.point()?;
        }
        Ok(())
    }

    fn nodes_4(&mut self) -> Result<()> {
        self.begin();
        let blocks = self.size()?;
        for _ in 0..3 {
            self.size()?; // the number of nodes, the least and the greatest tag
        }
        for _ in 0..self.text.claim(blocks, "blocks of nodes", 8)? {
            let (dimension, _entity, parametric) = (self.int()?, self.int()?, self.int()?);
            let n = self.size()?;
            let n = self.text.claim(n, "nodes", 8)?;
            for _ in 0..n {
                let tag = self.size()?;
                self.add_node(tag)?;
            }
            for _ in 0..n {
                self.point()?;
                for _ in 0..if parametric == 1 { dimension.clamp(0, 3) } else { 0 } {
                    self.real()?;
                }
            }
        }
        Ok(())
    }

    /// Entities name the physical groups of their elements. Version 4.1 only.
    fn entities(&mut self) -> Result<()> {
        self.begin();
        let counts = [self.size()?, self.size()?, self.size()?, self.size()?];
        for (dimension, count) in (0..).zip(counts) {
            for _ in 0..self.text.claim(count, "entities", 8)? {
                let tag = self.int()?;
                for _ in 0..if dimension == 0 { 3 } else { 6 } {
                    self.real()?;
                }
                let groups = self.size()?;
                for k in 0..self.text.claim(groups, "physical groups", 2)? {
                    let group = self.int()?;
                    if k == 0 {
                        self.physical.insert((dimension, tag), group as i32);
                    }
                }
                if dimension > 0 {
                    let bounding = self.size()?;
                    for _ in 0..self.text.claim(bounding, "bounding entities", 2)? {
                        self.int()?;
                    }
                }
            }
        }
        Ok(())
    }

    fn elements_2(&mut self) -> Result<()> {
        let n = self.text.expect_count("elements", 8)?;
        self.begin();
        let mut done = 0;
        while done < n {
            // Text: number, type, tags, nodes. Binary: type, how many, tags; then each of them.
            let (kind, many) = if self.binary {
                (self.int()?, self.int()?)
            } else {
                self.int()?;
                (self.int()?, 1)
            };
            let tags = self.int()?;
            let shape = Shape::of(kind).map_err(|what| self.unsupported(what))?;
            let many = self.text.claim(many, "elements", 8)?.min(n - done);
            for _ in 0..many {
                if self.binary {
                    self.int()?;
                }
                let mut region = 0;
                for k in 0..tags {
                    let tag = self.int()?;
                    if k == 0 {
                        region = tag as i32;
                    }
                }
                self.element(shape, region, Scalar::I32)?;
            }
            if many == 0 {
                return Err(self.malformed("a block of no elements"));
            }
            done += many;
        }
        Ok(())
    }

    fn elements_4(&mut self) -> Result<()> {
        self.begin();
        let blocks = self.size()?;
        for _ in 0..3 {
            self.size()?;
        }
        for _ in 0..self.text.claim(blocks, "blocks of elements", 8)? {
            let (dimension, entity, kind) = (self.int()?, self.int()?, self.int()?);
            let n = self.size()?;
            let shape = Shape::of(kind).map_err(|what| self.unsupported(what))?;
            let region = self.physical.get(&(dimension, entity)).copied().unwrap_or(0);
            for _ in 0..self.text.claim(n, "elements", 4)? {
                self.size()?;
                self.element(shape, region, self.size_t)?;
            }
        }
        Ok(())
    }

    fn unsupported(&self, what: String) -> MeshError {
        self.text.error(ErrorKind::Unsupported, what, "save first-order tetrahedra, triangles or quads only")
    }

    fn element(&mut self, shape: Shape, region: i32, kind: Scalar) -> Result<()> {
        let item = match shape {
            Shape::Tet => Item::Tetrahedron(self.mesh.tets.len()),
            Shape::Triangle | Shape::Quad => Item::Face(self.mesh.faces.len()),
            Shape::Edge | Shape::Point => Item::Edge(self.mesh.edges.len()),
        };
        let mut v = [0; 4];
        for k in 0..shape.corners() {
            let tag = self.number(kind)?;
            let found = u64::try_from(tag).ok().and_then(|t| self.nodes.get(&t));
            v[k] = *found.ok_or_else(|| {
                let kind = if tag < 0 { ErrorKind::NegativeIndex } else { ErrorKind::IndexOutOfRange };
                let what = format!("vertex index {tag} is out of range, no node has that number");
                self.text.error(kind, what, "correct the index or add the node").at_item(item)
            })?;
        }
        let list = match shape {
            Shape::Point => return Ok(()),
            Shape::Edge => {
                self.mesh.edges.push([v[0], v[1]]);
                0
            }
            Shape::Triangle | Shape::Quad => {
                self.mesh.faces.push(&v[..shape.corners()]);
                1
            }
            Shape::Tet => {
                self.mesh.tets.push(v);
                2
            }
        };
        self.regions[list].push(region);
        Ok(())
    }
}

#[derive(Clone, Copy)]
enum Shape {
    Point,
    Edge,
    Triangle,
    Quad,
    Tet,
}

impl Shape {
    /// The shape of Gmsh's element type, or what it is instead.
    fn of(kind: i64) -> std::result::Result<Shape, String> {
        Ok(match kind {
            15 => Shape::Point,
            1 => Shape::Edge,
            2 => Shape::Triangle,
            3 => Shape::Quad,
            4 => Shape::Tet,
            5..=7 => return Err(format!("elements of type {kind} (hexahedra, prisms or pyramids)")),
            _ => return Err(format!("elements of type {kind} (of higher order or unknown)")),
        })
    }

    fn corners(self) -> usize {
        match self {
            Shape::Point => 1,
            Shape::Edge => 2,
            Shape::Triangle => 3,
            Shape::Quad | Shape::Tet => 4,
        }
    }
}

/// Writes edges, faces and tetrahedra with their regions as physical groups. The faces must be
/// triangles and quads.
pub(crate) fn write(mesh: &Mesh, w: &mut dyn Write) -> io::Result<()> {
    writeln!(w, "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}", mesh.points.len())?;
    for (i, p) in mesh.points.iter().enumerate() {
        write!(w, "{} ", i + 1)?;
        write_point(w, p)?;
        writeln!(w)?;
    }
    let n = mesh.tets.len() + mesh.faces.len() + mesh.edges.len();
    writeln!(w, "$EndNodes\n$Elements\n{n}")?;
    let mut number = 0;
    let mut element = |kind: u8, corners: &[u32], regions: &Option<Vec<i32>>, i: usize| {
        number += 1;
        let region = regions.as_ref().map_or(0, |r| r[i]);
        // Two tags: the physical group and the entity, which must not be 0.
        write!(w, "{number} {kind} 2 {region} {}", if region > 0 { region } else { 1 })?;
        for &v in corners {
            write!(w, " {}", u64::from(v) + 1)?;
        }
        writeln!(w)
    };
    for (i, e) in mesh.edges.iter().enumerate() {
        element(1, e, &mesh.edge_regions, i)?;
    }
    for (i, p) in mesh.faces.iter().enumerate() {
        element(if p.len() == 3 { 2 } else { 3 }, p, &mesh.face_regions, i)?;
    }
    for (i, t) in mesh.tets.iter().enumerate() {
        element(4, t, &mesh.tet_regions, i)?;
    }
    writeln!(w, "$EndElements")
}
