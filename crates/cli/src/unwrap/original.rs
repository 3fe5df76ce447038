//! The map goes to a file that keeps what the one of the mesh holds beside it, and is examined as it is read back.

use std::path::Path;

use proxel::unwrap::Unwrapped;
use proxel_mesh::uv::{
    Certificate, CertificateOptions, Source, UvMap, as_stored, certify, check_source, read_uv, read_uv_onto,
    write_with_uv,
};
use proxel_mesh::{Format, Mesh, read_mesh_lenient};

use crate::refusal::Refusal;

/// Writes the map of the mesh of the file `source`, reads it back and examines it; warnings go to the report.
pub fn write_map(
    source: Option<&Path>,
    out: &Path,
    mesh: &Mesh,
    result: &mut Unwrapped,
) -> Result<Certificate, Refusal> {
    let original = source.map_or(Ok(None), |path| Original::read(path, out))?;
    let source = original.as_ref().map(Original::source);
    result.report.warnings.extend(write_with_uv(out, mesh, source, &result.uv)?);
    let options = CertificateOptions { reversed_faces: result.charts.reversed_faces.clone() };
    let written = Format::from_path(out)?;
    if is_gltf(written) {
        // Its vertices are not the user's, and without a source of the same kind its triangles neither: what it
        // stores of the map is.
        let map = match source {
            Some(_) => on_mapped(read_uv_onto(out, mesh)?.unwrap_or_default(), &result.uv),
            None => as_stored(&result.uv, written),
        };
        return Ok(certify(&mesh.points, &mesh.faces, &map, &options)?);
    }
    let back = read_mesh_lenient(out)?;
    let map = read_uv(out)?.unwrap_or_default();
    Ok(certify(&back.points, &back.faces, &map, &options)?)
}

/// The file that a mesh was read from, where its attributes go to the output.
struct Original<'a> {
    format: Format,
    path: &'a Path,
    name: String,
    data: Vec<u8>,
}

impl<'a> Original<'a> {
    /// None where the output is of another kind.
    fn read(path: &'a Path, out: &Path) -> Result<Option<Self>, Refusal> {
        let (Ok(format), to) = (Format::from_path(path), Format::from_path(out)?) else { return Ok(None) };
        let keeps = format == to && matches!(format, Format::Obj | Format::Ply) || is_gltf(format) && is_gltf(to);
        if !keeps {
            return Ok(None);
        }
        let name = path.display().to_string();
        let data = std::fs::read(path).map_err(|e| {
            Refusal::new(format!("{name}: cannot be read again: {e}; leave it there until the map is written"))
        })?;
        Ok(Some(Original { format, path, name, data }))
    }

    fn source(&self) -> Source<'_> {
        Source { format: self.format, file: &self.name, data: &self.data, folder: self.path.parent() }
    }
}

/// Checks before the solve that what is read past can be kept; the bytes are read again then.
pub fn check(path: &Path, out: &Path, mesh: &Mesh) -> Result<(), Refusal> {
    let to = Format::from_path(out)?;
    match Original::read(path, out)?.filter(|_| is_gltf(to)) {
        Some(original) => Ok(check_source(to, mesh, original.source())?),
        None => Ok(()),
    }
}

fn is_gltf(format: Format) -> bool {
    matches!(format, Format::Gltf | Format::Glb)
}

/// A map as it was read, less the faces that are not mapped: glTF has no other way to leave one out than (0, 0).
fn on_mapped(mut read: UvMap, uv: &UvMap) -> UvMap {
    for (corner, &wanted) in read.corners.iter_mut().zip(&uv.corners) {
        if wanted == UvMap::NONE {
            *corner = UvMap::NONE;
        }
    }
    read
}
