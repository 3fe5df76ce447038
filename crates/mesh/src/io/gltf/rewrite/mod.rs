//! A file again with other texture coordinates, and everything else as it was.
//!
//! Only triangles that the scene shows are changed. Their vertices are divided where one has several coordinates, and
//! every other attribute and morph target is carried to the copies, byte for byte; strips and fans become lists of
//! triangles. Tangents, and displacements of the old coordinates, depend on the old map and are left out. A mesh that
//! several nodes show has a map in each, so that each node but the first gets a mesh of its own.

mod fresh;
mod keep;
mod links;

use super::accessor::Buffers;
use super::read::{Piece, assemble, check};
use super::{Parts, malformed, parsed, text_and_chunk};
use crate::error::Result;
use crate::mesh::Polygons;
use fresh::Fresh;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;

/// The attribute that is replaced.
const COORDINATES: &str = "TEXCOORD_0";
/// The attribute that depends on it.
const TANGENT: &str = "TANGENT";
/// Compressed copies of what buffers hold as well; those of divided vertices would be wrong.
const COPIES: [&str; 4] =
    ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression", "MESHOPT_compression"];

/// Primitives of a mesh that share their vertices, as one node shows them.
pub(crate) struct Group {
    /// The first vertex, and how many there are.
    pub first: usize,
    pub verts: usize,
    pub pieces: Vec<Piece>,
}

/// How the vertices of a group are divided.
pub(crate) struct Division {
    /// Of each new vertex: the old one, counted from the first of the group.
    pub origins: Vec<u32>,
    /// Of each new vertex, v downwards.
    pub texcoords: Vec<[f32; 2]>,
    /// Of each piece: the new vertices of its triangles, turned as in the mesh.
    pub indices: Vec<Vec<u32>>,
}

/// A file in memory.
pub(crate) struct Rewritten {
    root: Value,
    entry: Value,
    buffer: Vec<u8>,
}

impl Rewritten {
    /// Makes relative paths of images, which begin in the folder `from`, begin in `to`; says which could not be.
    pub fn relink(&mut self, file: &str, from: Option<&Path>, to: &Path) -> Vec<String> {
        links::relink(file, &mut self.root, from, to)
    }

    pub fn write(self, binary: bool, w: &mut dyn Write) -> io::Result<()> {
        super::write::container(self.root, self.entry, &self.buffer, binary, w)
    }
}

/// Reads a file whose buffers lie in `folder`, asks `accept` about its faces and `divide` for each group.
pub(crate) fn rewrite(
    file: &str,
    data: &[u8],
    folder: Option<&Path>,
    accept: impl FnOnce(&Polygons) -> Result<()>,
    mut divide: impl FnMut(&Group) -> Result<Division>,
) -> Result<Rewritten> {
    let (text, chunk) = text_and_chunk(file, data)?;
    let parts = Parts { root: parsed(file, text)?, chunk };
    check(file, &parts.root)?;
    let mut root: Value = parsed(file, text)?;
    let buffers = Buffers::new(file, &parts, folder)?;
    let scene = assemble(file, &parts.root, &buffers, false)?;
    accept(&scene.mesh.faces)?;
    drop(scene.mesh);
    require_objects(file, &mut root)?;
    remove_copies(&mut root);
    let mut meshes = Meshes::new(&root);
    let mut fresh = Fresh::new(&buffers, &root);
    for group in grouped(scene.pieces) {
        let target = meshes.of(&group, &mut root);
        let division = divide(&group)?;
        let mut carried = BTreeMap::new();
        let mut zeros = None;
        let coordinates = fresh.texcoords(&division)?;
        for (piece, indices) in group.pieces.iter().zip(&division.indices) {
            let bad =
                |what: &str| malformed(file, format!("mesh {}, primitive {}: {what}", piece.mesh, piece.primitive));
            let primitive = meshes.all.get_mut(target).and_then(|m| m.get_mut("primitives")?.get_mut(piece.primitive));
            let primitive = primitive.and_then(Value::as_object_mut).ok_or_else(|| bad("it does not exist"))?;
            let mut carry = |attributes: &Value| -> Result<Map<String, Value>> {
                let attributes = attributes.as_object().ok_or_else(|| bad("its attributes are none"))?;
                let mut out = Map::new();
                for (name, a) in attributes.iter().filter(|(name, _)| ![COORDINATES, TANGENT].contains(&name.as_str()))
                {
                    let a = number(a).ok_or_else(|| bad(&format!("{name} is no accessor")))?;
                    let key = (a, name == "POSITION");
                    let new = match carried.get(&key) {
                        Some(&new) => new,
                        None => fresh.carry(a, key.1, group.verts, &division.origins)?,
                    };
                    carried.insert(key, new);
                    out.insert(name.clone(), json!(new));
                }
                Ok(out)
            };
            let mut attributes = carry(primitive.get("attributes").unwrap_or(&Value::Null))?;
            let targets = match primitive.get("targets") {
                None | Some(Value::Null) => None,
                Some(Value::Array(targets)) => Some(targets.iter().map(&mut carry).collect::<Result<Vec<_>>>()?),
                Some(_) => return Err(bad("its targets are no list")),
            };
            attributes.insert(COORDINATES.into(), json!(coordinates));
            primitive.insert("attributes".into(), Value::Object(attributes));
            if let Some(mut targets) = targets {
                // All primitives of a mesh have as many targets; one that is empty displaces by nothing.
                for target in targets.iter_mut().filter(|t| t.is_empty()) {
                    let nothing = *zeros.get_or_insert_with(|| fresh.zeros(division.origins.len()));
                    target.insert("POSITION".into(), json!(nothing));
                }
                primitive.insert("targets".into(), json!(targets));
            }
            primitive.insert("indices".into(), json!(fresh.indices(indices, piece.turned, division.origins.len())?));
            if matches!(primitive.get("mode").and_then(number), Some(5 | 6)) {
                primitive.insert("mode".into(), json!(4));
            }
        }
    }
    root["meshes"] = Value::Array(meshes.all);
    keep::finish(file, &buffers, root, fresh)
}

/// By the mesh as a node shows it and by its vertices, as they first occur.
fn grouped(pieces: Vec<Piece>) -> Vec<Group> {
    let mut known = BTreeMap::new();
    let mut groups: Vec<Group> = Vec::new();
    for piece in pieces {
        let next = groups.len();
        let g = *known.entry((piece.showing, piece.first)).or_insert(next);
        match groups.get_mut(g) {
            Some(group) => group.pieces.push(piece),
            None => groups.push(Group { first: piece.first, verts: piece.verts, pieces: vec![piece] }),
        }
    }
    groups
}

/// The meshes of the file, and those of further nodes behind them.
struct Meshes {
    original: Vec<Value>,
    all: Vec<Value>,
    shown: Vec<bool>,
    of_showing: BTreeMap<usize, usize>,
}

impl Meshes {
    fn new(root: &Value) -> Self {
        let original = root.get("meshes").and_then(Value::as_array).cloned().unwrap_or_default();
        Meshes { all: original.clone(), shown: vec![false; original.len()], original, of_showing: BTreeMap::new() }
    }

    /// The mesh that the node of a group is to show, and does from now on.
    fn of(&mut self, group: &Group, root: &mut Value) -> usize {
        let Some(Piece { showing, node, mesh, .. }) = group.pieces.first() else {
            return 0; // no group is empty
        };
        if let Some(&target) = self.of_showing.get(showing) {
            return target;
        }
        let seen = self.shown.get_mut(*mesh).map(|s| std::mem::replace(s, true));
        let mut target = *mesh;
        if seen == Some(true)
            && let Some(copy) = self.original.get(*mesh)
        {
            target = self.all.len();
            self.all.push(copy.clone());
            if let Some(node) = node.and_then(|n| root.get_mut("nodes")?.get_mut(n)) {
                node["mesh"] = json!(target);
            }
        }
        self.of_showing.insert(*showing, target);
        target
    }
}

/// Checks the form of what will be changed.
fn require_objects(file: &str, root: &mut Value) -> Result<()> {
    let bad = |what: &str| malformed(file, format!("its {what} are no objects"));
    if !root.is_object() {
        return Err(malformed(file, "its JSON is no object"));
    }
    for list in ["nodes", "meshes", "accessors", "bufferViews", "buffers"] {
        if !each(root, list).all(|thing| thing.is_object()) {
            return Err(bad(list));
        }
    }
    match each(root, "meshes").flat_map(|m| each(m, "primitives")).all(|p| p.is_object()) {
        true => Ok(()),
        false => Err(bad("primitives")),
    }
}

/// Takes away what is there in buffers as well.
fn remove_copies(root: &mut Value) {
    let compressed = |e: &Value| e.as_str().is_some_and(|e| COPIES.contains(&e));
    if let Some(used) = root.get_mut("extensionsUsed").and_then(Value::as_array_mut) {
        used.retain(|e| !compressed(e));
        if used.is_empty() {
            root.as_object_mut().map(|r| r.remove("extensionsUsed"));
        }
    }
    let clean = |thing: &mut Value| {
        let Some(extensions) = thing.get_mut("extensions").and_then(Value::as_object_mut) else { return };
        COPIES.iter().for_each(|c| drop(extensions.remove(*c)));
        if extensions.is_empty() {
            thing.as_object_mut().map(|t| t.remove("extensions"));
        }
    };
    for list in ["buffers", "bufferViews"] {
        each(root, list).for_each(clean);
    }
    each(root, "meshes").flat_map(|m| each(m, "primitives")).for_each(clean);
}

/// The entries of a list; none where there is no list.
fn each<'a>(of: &'a mut Value, list: &str) -> impl Iterator<Item = &'a mut Value> + use<'a> {
    of.get_mut(list).and_then(Value::as_array_mut).into_iter().flatten()
}

fn number(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|n| usize::try_from(n).ok())
}
