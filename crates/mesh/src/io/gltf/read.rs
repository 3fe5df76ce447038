//! The meshes of a scene, each where its nodes put it, as one.

use super::accessor::Buffers;
use super::json::{Node, Primitive, Root};
use super::{malformed, take_apart, unsupported};
use crate::error::{ErrorKind, MeshError, Result};
use crate::io::{display, read_bytes};
use crate::mesh::Mesh;
use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

/// An affine map: rows of three factors and a shift.
type Transform = [[f64; 4]; 3];

const IDENTITY: Transform = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
/// More vertices than this are taken for a mistake: nodes can show a mesh any number of times.
const MOST_VERTS: usize = 200_000_000;

/// Of each corner of the faces: its texture coordinates, as they stand in the file, where it has some.
pub(crate) type Texcoords = Vec<Option<[f64; 2]>>;

/// Triangles of the mesh that come from one primitive.
pub(crate) struct Piece {
    /// Counts the meshes as nodes show them.
    pub showing: usize,
    /// The node that shows it; none in a library without nodes.
    pub node: Option<usize>,
    pub mesh: usize,
    pub primitive: usize,
    /// Its vertices, which primitives with the same positions share: `verts` of them from `first` on.
    pub first: usize,
    pub verts: usize,
    /// Its triangles among the faces of the mesh.
    pub faces: Range<usize>,
    /// Whether a mirror turned them around.
    pub turned: bool,
}

/// What a scene is read as.
#[derive(Default)]
pub(super) struct Scene {
    pub mesh: Mesh,
    /// Texture coordinates, where they were asked for.
    pub texcoords: Option<Texcoords>,
    /// Where its faces come from, in their order; none is empty.
    pub pieces: Vec<Piece>,
}

/// Reads a file and the buffers beside it.
pub(crate) fn read(path: &Path) -> Result<Mesh> {
    let folder = path.parent().unwrap_or(Path::new(""));
    Ok(read_parts(&display(path), &read_bytes(path)?, Some(folder), false)?.0)
}

/// As [`read`], with texture coordinates.
pub(crate) fn read_uv(path: &Path) -> Result<(Mesh, Texcoords)> {
    let folder = path.parent().unwrap_or(Path::new(""));
    read_parts(&display(path), &read_bytes(path)?, Some(folder), true)
}

/// Parses a file that stands for itself.
pub(crate) fn parse(file: &str, data: &[u8]) -> Result<Mesh> {
    Ok(read_parts(file, data, None, false)?.0)
}

/// As [`parse`], with texture coordinates.
pub(crate) fn parse_uv(file: &str, data: &[u8]) -> Result<(Mesh, Texcoords)> {
    read_parts(file, data, None, true)
}

fn read_parts(file: &str, data: &[u8], folder: Option<&Path>, uv: bool) -> Result<(Mesh, Texcoords)> {
    let parts = take_apart(file, data)?;
    check(file, &parts.root)?;
    let buffers = Buffers::new(file, &parts, folder)?;
    let scene = assemble(file, &parts.root, &buffers, uv)?;
    Ok((scene.mesh, scene.texcoords.unwrap_or_default()))
}

/// The meshes of the scene as one, with texture coordinates if `uv`.
pub(super) fn assemble(file: &str, root: &Root, buffers: &Buffers<'_>, uv: bool) -> Result<Scene> {
    let mesh = Mesh { name: file.to_owned(), ..Mesh::default() };
    let scene = Scene { mesh, texcoords: uv.then(Vec::new), pieces: Vec::new() };
    let mut reader = Reader { file, root, buffers, scene, showing: 0, shared: HashMap::new() };
    if root.nodes.is_empty() {
        // A library of meshes without a scene: all of them, as they are.
        for m in 0..root.meshes.len() {
            reader.add_mesh(m, &IDENTITY, None)?;
        }
    } else {
        reader.add_nodes()?;
    }
    Ok(reader.scene)
}

/// Version, and extensions without which positions would be wrong.
pub(super) fn check(file: &str, root: &Root) -> Result<()> {
    let asset = root.asset.as_ref().ok_or_else(|| malformed(file, "it has no `asset`, so it is no glTF"))?;
    if !asset.version.starts_with("2.") {
        return Err(unsupported(file, format!("glTF of version {}", asset.version), "export it as glTF 2.0"));
    }
    let harmless = ["KHR_mesh_quantization", "KHR_lights_punctual"];
    let of_looks = ["KHR_materials_", "KHR_texture_", "EXT_texture_"];
    let foreign = |e: &&String| !harmless.contains(&e.as_str()) && !of_looks.iter().any(|l| e.starts_with(l));
    match root.extensions_required.iter().find(foreign) {
        Some(e) => Err(unsupported(file, format!("the extension {e}"), "export it without compression and extensions")),
        None => Ok(()),
    }
}

struct Reader<'a> {
    file: &'a str,
    root: &'a Root,
    buffers: &'a Buffers<'a>,
    scene: Scene,
    showing: usize,
    shared: HashMap<usize, usize>, // first vertex of each accessor of positions, within a node
}

impl Reader<'_> {
    /// Walks the tree of nodes, parents first, in the order of the file.
    fn add_nodes(&mut self) -> Result<()> {
        let root = self.root;
        let mut is_child = vec![false; root.nodes.len()];
        for n in root.nodes.iter().flat_map(|n| &n.children) {
            let child = is_child.get_mut(*n).ok_or_else(|| self.missing("node", *n))?;
            if std::mem::replace(child, true) {
                return Err(malformed(self.file, format!("node {n} has two parents")));
            }
        }
        let scene = root.scene.or((!root.scenes.is_empty()).then_some(0));
        let mut open: Vec<(usize, Transform)> = match scene {
            Some(s) => root.scenes.get(s).ok_or_else(|| self.missing("scene", s))?.nodes.clone(),
            None => (0..root.nodes.len()).filter(|&n| !is_child[n]).collect(),
        }
        .into_iter()
        .map(|n| (n, IDENTITY))
        .collect();
        open.reverse();
        let mut seen = vec![false; root.nodes.len()];
        while let Some((n, above)) = open.pop() {
            let node = root.nodes.get(n).ok_or_else(|| self.missing("node", n))?;
            if std::mem::replace(&mut seen[n], true) {
                return Err(malformed(self.file, format!("node {n} is in the scene twice")));
            }
            let here = after(&above, &local(node));
            if here.as_flattened().iter().any(|x| !x.is_finite()) {
                return Err(MeshError::new(
                    ErrorKind::NonFinite,
                    self.file,
                    format!("node {n}: its transform is not finite"),
                    "give it finite numbers",
                ));
            }
            if let Some(m) = node.mesh {
                // Where a skin says how a mesh moves, the place of its node is to be ignored: it is taken unposed.
                self.add_mesh(m, if node.skin.is_some() { &IDENTITY } else { &here }, Some(n))?;
            }
            open.extend(node.children.iter().rev().map(|&c| (c, here)));
        }
        Ok(())
    }

    fn missing(&self, what: &str, i: usize) -> MeshError {
        malformed(self.file, format!("{what} {i} does not exist"))
    }

    fn add_mesh(&mut self, m: usize, place: &Transform, node: Option<usize>) -> Result<()> {
        let entry = self.root.meshes.get(m).ok_or_else(|| self.missing("mesh", m))?;
        self.shared.clear();
        for (i, p) in entry.primitives.iter().enumerate() {
            let before = self.scene.mesh.faces.len();
            let (first, verts) = self.add_primitive(p, place, &format!("mesh {m}, primitive {i}"))?;
            let faces = before..self.scene.mesh.faces.len();
            if !faces.is_empty() {
                let (showing, turned) = (self.showing, mirrors(place));
                self.scene.pieces.push(Piece { showing, node, mesh: m, primitive: i, first, verts, faces, turned });
            }
        }
        self.showing += 1;
        Ok(())
    }

    /// The first of its vertices, and how many there are.
    fn add_primitive(&mut self, p: &Primitive, place: &Transform, name: &str) -> Result<(usize, usize)> {
        let Scene { mesh, texcoords, .. } = &mut self.scene;
        let bad = |what: &str| malformed(self.file, format!("{name}: {what}"));
        let positions = p.attributes.position.ok_or_else(|| bad("it has no POSITION"))?;
        let first = match self.shared.get(&positions) {
            Some(&first) => first,
            None => {
                let first = mesh.points.len();
                let points = self.buffers.points(positions, first)?;
                if first + points.len() > MOST_VERTS {
                    return Err(bad("with it there are more than 200 million vertices"));
                }
                mesh.points.extend(points.iter().map(|p| apply(place, *p)));
                self.shared.insert(positions, first);
                first
            }
        };
        let n = self.root.accessors.get(positions).map_or(0, |a| a.count);
        let indices = match p.indices {
            Some(a) => self.buffers.indices(a, n)?,
            None => (0..n as u32).collect(),
        };
        let at: Vec<u32> = indices.into_iter().map(|i| first as u32 + i).collect();
        let uneven = |k: usize| bad(&format!("{} indices do not make groups of {k}", at.len()));
        // A mirror turns faces around.
        let turn = mirrors(place);
        let face = |[a, b, c]: [u32; 3]| if turn { [a, c, b] } else { [a, b, c] };
        match p.mode.unwrap_or(4) {
            0 => {}
            1 if !at.len().is_multiple_of(2) => return Err(uneven(2)),
            1 => mesh.edges.extend(at.chunks_exact(2).map(|e| [e[0], e[1]])),
            mode @ (2 | 3) => {
                mesh.edges.extend(at.windows(2).map(|e| [e[0], e[1]]));
                if let (2, [first, .., last]) = (mode, &at[..]) {
                    mesh.edges.push([*last, *first]);
                }
            }
            4 if !at.len().is_multiple_of(3) => return Err(uneven(3)),
            4 => at.chunks_exact(3).for_each(|t| mesh.faces.push(&face([t[0], t[1], t[2]]))),
            5 => {
                for (i, t) in at.windows(3).enumerate() {
                    let t = if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] };
                    // Strips are joined by triangles that have a vertex twice.
                    if t[0] != t[1] && t[1] != t[2] && t[2] != t[0] {
                        mesh.faces.push(&face(t));
                    }
                }
            }
            6 => (2..at.len()).for_each(|i| mesh.faces.push(&face([at[0], at[i - 1], at[i]]))),
            other => return Err(bad(&format!("mode {other} is none of glTF"))),
        }
        let Some(texcoords) = texcoords else {
            return Ok((first, n));
        };
        let Some(a) = p.attributes.texcoord else {
            texcoords.resize(mesh.faces.indices().len(), None);
            return Ok((first, n));
        };
        let values = self.buffers.texcoords(a, first)?;
        if values.len() < n {
            return Err(bad(&format!("{} texture coordinates for {n} vertices", values.len())));
        }
        let new = &mesh.faces.indices()[texcoords.len()..];
        texcoords.extend(new.iter().map(|&v| values.get(v as usize - first).copied()));
        Ok((first, n))
    }
}

/// The transform of a node against its parent's.
fn local(node: &Node) -> Transform {
    if let Some(m) = node.matrix {
        return [0, 1, 2].map(|r| [0, 1, 2, 3].map(|c| m[4 * c + r]));
    }
    let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let [sx, sy, sz] = node.scale.unwrap_or([1.0; 3]);
    let [tx, ty, tz] = node.translation.unwrap_or([0.0; 3]);
    [
        [(1.0 - 2.0 * (y * y + z * z)) * sx, 2.0 * (x * y - z * w) * sy, 2.0 * (x * z + y * w) * sz, tx],
        [2.0 * (x * y + z * w) * sx, (1.0 - 2.0 * (x * x + z * z)) * sy, 2.0 * (y * z - x * w) * sz, ty],
        [2.0 * (x * z - y * w) * sx, 2.0 * (y * z + x * w) * sy, (1.0 - 2.0 * (x * x + y * y)) * sz, tz],
    ]
}

/// First `b`, then `a`.
fn after(a: &Transform, b: &Transform) -> Transform {
    let mut out = [[0.0; 4]; 3];
    for r in 0..3 {
        for c in 0..4 {
            out[r][c] = (0..3).map(|k| a[r][k] * b[k][c]).sum::<f64>() + if c == 3 { a[r][3] } else { 0.0 };
        }
    }
    out
}

fn apply(t: &Transform, p: [f64; 3]) -> [f64; 3] {
    if *t == IDENTITY {
        return p;
    }
    [0, 1, 2].map(|r| (0..3).map(|c| t[r][c] * p[c]).sum::<f64>() + t[r][3])
}

fn mirrors(t: &Transform) -> bool {
    let [a, b, c] = t;
    let determinant =
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
    determinant < 0.0
}
