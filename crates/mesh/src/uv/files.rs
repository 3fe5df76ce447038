//! Which formats carry texture coordinates, and how they are read and written.

use std::path::Path;

use super::{UvMap, gltf, obj, ply};
use crate::error::{ErrorKind, MeshError, Result};
use crate::io::{Format, atomic_write, display, parse_mesh, read_bytes, read_mesh_lenient};
use crate::mesh::{Mesh, Polygons};

/// The file that a mesh was read from, for what it holds beyond the mesh.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// What format it is in.
    pub format: Format,
    /// Its name, for messages.
    pub file: &'a str,
    /// All of its bytes.
    pub data: &'a [u8],
    /// The folder that it lies in: buffers and images of a glTF may lie beside it.
    pub folder: Option<&'a Path>,
}

/// The texture coordinates of the faces that [`read_mesh`](crate::read_mesh) reads from the same file: `vt` of OBJ,
/// the lists `texcoord` of faces or the properties `s` and `t` (`u` and `v`, `texture_u` and `texture_v`) of vertices
/// in PLY, TEXCOORD_0 of glTF, whose v runs downwards and is turned around. `None` where the file has none, or its
/// format takes none.
///
/// # Errors
/// What is wrong with the file or its coordinates, in one line.
pub fn read_uv(path: &Path) -> Result<Option<UvMap>> {
    match Format::of_input(path)? {
        Format::Gltf | Format::Glb => gltf::read(path),
        format @ (Format::Obj | Format::Ply) => parse_uv(format, &display(path), &read_bytes(path)?),
        _ => {
            read_mesh_lenient(path)?;
            Ok(None)
        }
    }
}

/// As [`read_uv`], from the bytes of a file; a .gltf must have its buffers inside.
///
/// # Errors
/// As [`read_uv`].
pub fn parse_uv(format: Format, file: &str, data: &[u8]) -> Result<Option<UvMap>> {
    match format {
        Format::Gltf | Format::Glb => gltf::parse(file, data),
        _ => {
            let mesh = parse_mesh(format, file, data)?;
            match format {
                Format::Obj => obj::parse(file, data, &mesh.faces),
                Format::Ply => ply::parse(file, data, &mesh.faces),
                _ => Ok(None),
            }
        }
    }
}

/// The format of `path`, if it carries texture coordinates: for use before hours of work.
///
/// # Errors
/// [`ErrorKind::Unsupported`] naming the formats that do.
pub fn require_uv_format(path: &Path) -> Result<Format> {
    match Format::from_path(path)? {
        format @ (Format::Obj | Format::Ply | Format::Gltf | Format::Glb) => Ok(format),
        _ => Err(MeshError::new(
            ErrorKind::Unsupported,
            display(path),
            "its format carries no texture coordinates",
            "write .obj, .ply, .glb or .gltf",
        )),
    }
}

/// Writes a mesh with its map, whole or not at all; the extension names the format.
///
/// - .obj from a `source` in OBJ: every byte of it stays (colours, normals, objects, groups, materials, comments) but
///   the `vt` lines, and the second number of face corners; the texture numbers of `l` lines go with what they named.
/// - .obj from anything else: vertices, faces and edges of the mesh.
/// - .ply: a list `texcoord` (u and v of each corner) with each face, empty where it is not mapped. From a `source`
///   in PLY all other properties and elements, the form (text, byte order) and the numbers stay as they stand.
/// - .glb and .gltf from a `source` in either: everything stays (nodes, materials, textures, skins, animations, all other
///   attributes to the bit, extras) but TEXCOORD_0 of the triangles of the scene. A vertex with several coordinates keeps its
///   number for the first of them, copies with the same attributes and morph targets follow behind the vertices of its
///   primitive. Strips and fans become lists of triangles, a mesh that several nodes show is copied for all but the first,
///   tangents (and displacements of the old coordinates) are left out, optional compressed copies of buffers too. The
///   buffers become one, inside the file; paths of images are made relative to the new folder.
/// - .glb and .gltf from anything else, in 32-bit numbers: faces as fans of triangles; a vertex with several coordinates keeps its
///   number for the first of them, copies for the others follow at the end of the list. Unmapped faces get (0, 0).
///
/// Text has 17 significant digits. Read back, OBJ gives the same map, PLY the same values at each corner, glTF those
/// values rounded to 32 bits (v as 1 - v).
///
/// Returns warnings, a line each: images of a glTF to which no relative path leads from the new folder.
///
/// # Errors
/// A format without texture coordinates, a map or a source that is not of this mesh, or a path that cannot
/// be written.
pub fn write_with_uv(path: &Path, mesh: &Mesh, source: Option<Source<'_>>, uv: &UvMap) -> Result<Vec<String>> {
    let format = require_uv_format(path)?;
    mesh.check_indices()?;
    uv.check(&mesh.faces)?;
    if mesh.faces.is_empty() {
        return Err(mesh.error(ErrorKind::Empty, "no faces", "give a mesh with faces"));
    }
    let mut warnings = Vec::new();
    let written = match (format, source) {
        (Format::Obj, Some(Source { format: Format::Obj, file, data, .. })) => {
            require_same_faces(mesh, &parse_mesh(Format::Obj, file, data)?.faces)?;
            atomic_write(path, |w| obj::rewrite(file, data, uv, w))
        }
        (Format::Obj, _) => atomic_write(path, |w| obj::write(mesh, uv, w)),
        (Format::Ply, Some(Source { format: Format::Ply, file, data, .. })) => {
            require_same_faces(mesh, &parse_mesh(Format::Ply, file, data)?.faces)?;
            atomic_write(path, |w| ply::rewrite(file, data, &mesh.faces, uv, w))
        }
        (Format::Ply, _) => atomic_write(path, |w| ply::write(mesh, uv, w)),
        (_, Some(source @ Source { format: Format::Gltf | Format::Glb, .. })) => {
            let mut file = gltf::rewrite(&display(path), mesh, source, uv)?;
            warnings = file.relink(source.file, source.folder, path.parent().unwrap_or(Path::new("")));
            atomic_write(path, |w| file.write(format == Format::Glb, w))
        }
        _ => {
            let split = gltf::Split::new(&display(path), mesh, uv)?;
            atomic_write(path, |w| split.write(format == Format::Glb, w))
        }
    };
    written.map(|()| warnings)
}

/// Checks that the attributes of a `source` can be kept in a file of format `to`, for use before hours of work: what
/// [`read_mesh`](crate::read_mesh) reads past may be broken.
///
/// # Errors
/// What [`write_with_uv`] would report about the source.
pub fn check_source(to: Format, mesh: &Mesh, source: Source<'_>) -> Result<()> {
    let gltf = |format| matches!(format, Format::Gltf | Format::Glb);
    if gltf(to) && gltf(source.format) {
        let unmapped = UvMap { coordinates: Vec::new(), corners: vec![UvMap::NONE; mesh.faces.indices().len()] };
        gltf::rewrite(source.file, mesh, source, &unmapped)?;
    }
    Ok(())
}

/// The map of a file with the triangles of `mesh` in the same order, where a vertex may have become several: the
/// coordinates at each corner of the faces of `mesh`. So reads what [`write_with_uv`] made of a `source` in glTF.
///
/// # Errors
/// As [`read_uv`]; [`ErrorKind::CountMismatch`] if the faces of the file are others or some corner of them lies elsewhere.
pub fn read_uv_onto(path: &Path, mesh: &Mesh) -> Result<Option<UvMap>> {
    let back = read_mesh_lenient(path)?;
    let Some(map) = read_uv(path)? else { return Ok(None) };
    let place = |mesh: &Mesh, v: u32| mesh.points.get(v as usize).copied();
    let corners = || back.faces.indices().iter().zip(mesh.faces.indices());
    if back.faces.offsets() != mesh.faces.offsets() || !corners().all(|(&v, &w)| place(&back, v) == place(mesh, w)) {
        let what = format!("its {} faces are not the {} of the mesh", back.faces.len(), mesh.faces.len());
        return Err(back.error(ErrorKind::CountMismatch, what, "give the mesh that the map was made for"));
    }
    let values: Vec<_> = (0..map.corners.len()).map(|i| map.at(i)).collect();
    UvMap::from_values(&mesh.faces, &values).map(Some)
}

/// The map as a file of this format gives it back: glTF rounds to 32 bits, the others keep every bit.
#[must_use]
pub fn as_stored(uv: &UvMap, format: Format) -> UvMap {
    match format {
        Format::Gltf | Format::Glb => {
            let coordinates = uv.coordinates.iter().map(|&x| gltf::rounded(x)).collect();
            UvMap { coordinates, corners: uv.corners.clone() }
        }
        _ => uv.clone(),
    }
}

pub(super) fn require_same_faces(mesh: &Mesh, faces: &Polygons) -> Result<()> {
    if mesh.faces == *faces {
        return Ok(());
    }
    let what = format!("its {} faces are not the {} of the original file", mesh.faces.len(), faces.len());
    Err(mesh.error(ErrorKind::CountMismatch, what, "give the file that the mesh was read from"))
}
