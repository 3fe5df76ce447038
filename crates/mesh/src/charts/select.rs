//! Which faces of a mesh take part, and whose place the others share.

use crate::error::{ErrorKind, Item, Result};
use crate::mesh::{Mesh, repeated};

/// What becomes of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// It is in a chart.
    Taken,
    /// It has the vertices of an earlier face, which is.
    CopyOf(u32),
    /// It names a vertex twice, or has fewer than three.
    LeftOut,
}

/// The role of each face.
pub(super) fn roles(mesh: &Mesh) -> Vec<Role> {
    let mut roles: Vec<Role> = mesh
        .faces
        .iter()
        .map(|p| if p.len() < 3 || repeated(p).is_some() { Role::LeftOut } else { Role::Taken })
        .collect();
    // Copies agree in their smallest vertex, their size and the sum of their vertices; few others do.
    let key = |p: &[u32]| {
        let sum: u64 = p
            .iter()
            .map(|&v| u64::from(v).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(23))
            .fold(0, u64::wrapping_add);
        sum.wrapping_add(p.len() as u64)
    };
    let mut keys: Vec<(u64, u32)> = (0..mesh.faces.len())
        .filter(|&f| roles[f] == Role::Taken)
        .map(|f| (key(mesh.faces.get(f)), f as u32))
        .collect();
    keys.sort_unstable();
    let set = |f: u32| {
        let mut s = mesh.faces.get(f as usize).to_vec();
        s.sort_unstable();
        s
    };
    for group in keys.chunk_by(|a, b| a.0 == b.0).filter(|g| g.len() > 1) {
        let mut sets: Vec<(Vec<u32>, u32)> = group.iter().map(|&(_, f)| (set(f), f)).collect();
        sets.sort_unstable();
        for same in sets.chunk_by(|a, b| a.0 == b.0) {
            for copy in &same[1..] {
                roles[copy.1 as usize] = Role::CopyOf(same[0].1);
            }
        }
    }
    roles
}

/// Says what was left out and what was taken once, one sentence each.
pub(super) fn describe(mesh: &Mesh, roles: &[Role], repairs: &mut Vec<String>) {
    let few = |f: &usize| mesh.faces.get(*f).len() < 3;
    let left = |small: bool| {
        let mut all = (0..roles.len()).filter(move |f| roles[*f] == Role::LeftOut && few(f) == small);
        all.next().map(|first| (1 + all.count(), first))
    };
    if let Some((n, first)) = left(true) {
        repairs.push(counted(
            n,
            first,
            "has fewer than three corners",
            "have fewer than three corners",
            "left out of the map",
        ));
    }
    if let Some((n, first)) = left(false) {
        repairs.push(counted(n, first, "uses a vertex twice", "use a vertex twice", "left out of the map"));
    }
    let mut copies = (0..roles.len()).filter(|&f| matches!(roles[f], Role::CopyOf(_)));
    if let Some(first) = copies.next() {
        let n = 1 + copies.count();
        repairs.push(counted(
            n,
            first,
            "repeats an earlier face",
            "repeat earlier faces",
            "mapped with the first of their kind",
        ));
    }
}

/// "3 faces use a vertex twice, the first is 17: they were left out of the map".
pub(super) fn counted(n: usize, first: usize, does: &str, they_do: &str, done: &str) -> String {
    match n {
        1 => format!("1 face {does}, face {first}: it was {}", done.replace("their", "its")),
        _ => format!("{n} faces {they_do}, the first is {first}: they were {done}"),
    }
}

/// Refuses meshes of more corners than 32 bits count, whose last number is kept for "none".
pub(super) fn require_size(mesh: &Mesh) -> Result<()> {
    let corners = mesh.faces.indices().len();
    if corners >= u32::MAX as usize || mesh.n_verts() >= u32::MAX as usize {
        return Err(mesh
            .error(
                ErrorKind::Unsupported,
                format!("{corners} corners of faces are more than 32 bits count"),
                "split the mesh into parts",
            )
            .at_item(Item::Face(0)));
    }
    Ok(())
}
