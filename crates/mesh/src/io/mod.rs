//! Reading and writing by extension.
//!
//! The readers are our own. A message must name the line or the element and a remedy, and no memory may
//! be taken for a count that the file cannot hold; general crates promise neither (and mshio 0.4 reads
//! only version 4.1 of Gmsh's format, vtkio 0.6 links a compressor in C by default).

mod atomic;
#[cfg(test)]
pub(crate) mod fuzz;
pub(crate) mod gltf;
mod gmsh;
mod medit;
mod npy;
pub(crate) mod numbers;
pub(crate) mod obj;
mod off;
pub(crate) mod ply;
mod scalar;
mod series;
mod stl;
mod tetgen;
pub(crate) mod text;
mod vtk;
mod vtk_cells;
mod vtu;
mod vtu_write;

use std::borrow::Cow;
use std::fs;
use std::io;
use std::path::Path;

pub use atomic::{atomic_write, check_writable};
pub use gltf::MOST_GLTF_FRAMES;
pub use series::{Frame, check_series_output, write_series};

use crate::error::{ErrorKind, Item, MeshError, Result};
use crate::fields::Fields;
use crate::mesh::{Mesh, Polygons};
use crate::topology;
use atomic::Staged;

/// The file formats, named by extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// TetGen and Triangle `.node` and `.ele`.
    TetGen,
    /// Wavefront `.obj`.
    Obj,
    /// Medit `.mesh`, text.
    Medit,
    /// Gmsh `.msh`.
    Gmsh,
    /// Legacy `.vtk`.
    Vtk,
    /// ParaView's `.vtu`.
    Vtu,
    /// Stanford `.ply`.
    Ply,
    /// `.stl`, a soup of triangles.
    Stl,
    /// Geomview `.off`.
    Off,
    /// glTF 2.0 as JSON, `.gltf`.
    Gltf,
    /// glTF 2.0 in binary, `.glb`.
    Glb,
    /// NumPy `.npy`: positions only.
    Npy,
}

/// What an unknown extension is answered with.
const KNOWN: &str = "use .node/.ele, .mesh, .msh, .vtk, .vtu, .obj, .ply, .stl, .off, .gltf, .glb or .npy";

impl Format {
    /// The format that the extension of `path` names, in either case.
    ///
    /// # Errors
    /// [`ErrorKind::UnknownFormat`] listing the extensions that there are.
    pub fn from_path(path: &Path) -> Result<Format> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        Ok(match extension.as_deref() {
            Some("node" | "ele") => Format::TetGen,
            Some("mesh") => Format::Medit,
            Some("msh") => Format::Gmsh,
            Some("vtk") => Format::Vtk,
            Some("vtu") => Format::Vtu,
            Some("obj") => Format::Obj,
            Some("ply") => Format::Ply,
            Some("stl") => Format::Stl,
            Some("off") => Format::Off,
            Some("gltf") => Format::Gltf,
            Some("glb") => Format::Glb,
            Some("npy") => Format::Npy,
            Some("meshb") => {
                return Err(MeshError::new(
                    ErrorKind::Unsupported,
                    display(path),
                    "binary Medit files are not read or written",
                    "use the text form, .mesh",
                ));
            }
            _ => {
                let what = match &extension {
                    Some(e) => format!("unknown extension `.{e}`"),
                    None => "a name without extension".to_owned(),
                };
                return Err(MeshError::new(ErrorKind::UnknownFormat, display(path), what, KNOWN));
            }
        })
    }

    /// As [`from_path`](Self::from_path), where a stem without extension (`body` or `body.1`) stands
    /// for the TetGen pair that lies there.
    pub(crate) fn of_input(path: &Path) -> Result<Format> {
        Format::from_path(path).or_else(|e| {
            let (node, _) = tetgen::pair(path);
            if node.is_file() { Ok(Format::TetGen) } else { Err(e) }
        })
    }
}

/// Reads a mesh; the extension names the format. For TetGen either file of the pair or its stem.
///
/// The mesh has at least one vertex and one element, finite coordinates, indices in range and no
/// element that uses a vertex twice. Volumes are not looked at: [`crate::check`] does that.
///
/// # Errors
/// Whatever the file violates, in one line with file, place and remedy.
pub fn read_mesh(path: &Path) -> Result<Mesh> {
    let mesh = read_mesh_lenient(path)?;
    if mesh.tets.is_empty() && mesh.faces.is_empty() && mesh.edges.is_empty() {
        return Err(mesh.error(ErrorKind::Empty, "no elements", "give a mesh with tetrahedra, faces or edges"));
    }
    mesh.check_repeated()?;
    Ok(mesh)
}

/// As [`read_mesh`], but lets through what can be held in memory and examined: no elements,
/// elements that use a vertex twice.
///
/// # Errors
/// As [`read_mesh`], less those two.
pub fn read_mesh_lenient(path: &Path) -> Result<Mesh> {
    let format = Format::of_input(path)?;
    let file = display(path);
    if format == Format::Npy {
        return Err(MeshError::new(
            ErrorKind::Unsupported,
            file,
            "a .npy file holds positions without elements",
            "give a mesh file here",
        ));
    }
    let mesh = match format {
        Format::TetGen => tetgen::read(path)?,
        Format::Gltf | Format::Glb => gltf::read(path)?,
        _ => parse_mesh(format, &file, &read_bytes(path)?)?,
    };
    mesh.check_indices()?;
    Ok(mesh)
}

/// Parses the bytes of a mesh file; `file` is the name that messages start with. A TetGen pair is two
/// files and an array holds no elements: those two formats are refused here, and so is a .gltf whose
/// buffers lie in other files.
///
/// # Errors
/// As [`read_mesh_lenient`].
pub fn parse_mesh(format: Format, file: &str, data: &[u8]) -> Result<Mesh> {
    let mesh = match format {
        Format::Medit => medit::parse(file, data),
        Format::Gmsh => gmsh::parse(file, data),
        Format::Vtk => vtk::parse(file, data),
        Format::Vtu => vtu::parse(file, data),
        Format::Obj => obj::parse(file, data),
        Format::Ply => ply::parse(file, data),
        Format::Stl => stl::parse(file, data),
        Format::Off => off::parse(file, data),
        Format::Gltf | Format::Glb => gltf::parse(file, data),
        Format::TetGen | Format::Npy => Err(MeshError::new(
            ErrorKind::Unsupported,
            file,
            "its format is no single mesh file",
            "read it by its path",
        )),
    }?;
    mesh.check_indices()?;
    Ok(mesh)
}

/// Reads positions only, from a mesh file of any format (of a TetGen pair only `.node` is needed)
/// or an (n, 3) `.npy` array.
///
/// # Errors
/// As [`read_mesh`]; elements, where the format has them, must still be well-formed.
pub fn read_points(path: &Path) -> Result<Vec<[f64; 3]>> {
    let points = match Format::of_input(path)? {
        Format::TetGen => tetgen::read_nodes(path)?.points,
        Format::Npy => npy::parse_points(&display(path), &read_bytes(path)?)?,
        _ => return read_mesh_lenient(path).map(|m| m.points),
    };
    if points.is_empty() {
        let (what, remedy) = ("no vertices", "give a file with vertices");
        return Err(MeshError::new(ErrorKind::Empty, display(path), what, remedy));
    }
    Ok(points)
}

/// Writes a mesh, whole or not at all; the extension names the format.
///
/// Vertices keep their order and number in every format but STL, text has 17 significant digits, glTF
/// has 32-bit numbers,
/// a TetGen pair (both files, whichever was named) keeps the index base. Surface formats get the
/// faces, of a body without faces its boundary. `fields` go where the format takes them; what a
/// format cannot carry is listed by [`not_carried`].
///
/// # Errors
/// Elements that the format cannot hold at all, or a path that cannot be written.
pub fn write_mesh(path: &Path, mesh: &Mesh, fields: &Fields) -> Result<()> {
    write_body(path, mesh, fields)?.into_iter().try_for_each(Staged::publish)
}

/// All files of a mesh, complete but without their names.
fn write_body(path: &Path, mesh: &Mesh, fields: &Fields) -> Result<Vec<Staged>> {
    let format = Format::from_path(path)?;
    mesh.check_indices()?;
    fields.check(mesh)?;
    if format == Format::TetGen {
        let (node, ele) = tetgen::pair(path);
        if mesh.tets.is_empty() && !mesh.faces.is_empty() {
            require_corners(path, mesh, 3)?;
        }
        let mut staged = vec![Staged::write(&node, |w| tetgen::write_nodes(mesh, w))?];
        if !mesh.tets.is_empty() || !mesh.faces.is_empty() {
            staged.push(Staged::write(&ele, |w| tetgen::write_elements(mesh, w))?);
        }
        return Ok(staged);
    }
    match format {
        Format::Medit | Format::Gmsh => require_corners(path, mesh, 4)?,
        Format::Gltf | Format::Glb => gltf::require_range(&display(path), &mesh.points)?,
        _ => {}
    }
    let staged = Staged::write(path, |w| match format {
        Format::Medit => medit::write(mesh, w),
        Format::Gmsh => gmsh::write(mesh, w),
        Format::Vtk => vtk::write(mesh, fields, w),
        Format::Vtu => vtu_write::write(mesh, fields, w),
        Format::Obj => obj::write(mesh, w),
        Format::Ply => ply::write(mesh, fields, w),
        Format::Stl => stl::write(mesh, w),
        Format::Off => off::write(mesh, w),
        Format::Gltf | Format::Glb => gltf::write(mesh, format == Format::Glb, w),
        Format::Npy | Format::TetGen => npy::write_points(&mesh.points, w), // a pair was written above
    })?;
    Ok(vec![staged])
}

/// Whether a mesh could be written to `path`, for use before hours of work: the extension names a
/// format and the file (of a TetGen pair both) can be made or replaced.
///
/// # Errors
/// What [`write_mesh`] would report about the path.
pub fn check_output(path: &Path) -> Result<()> {
    if Format::from_path(path)? == Format::TetGen {
        let (node, ele) = tetgen::pair(path);
        check_writable(&node)?;
        return check_writable(&ele);
    }
    check_writable(path)
}

/// What of this mesh and its arrays the format of `path` does not carry, in words; empty if the
/// file holds everything.
///
/// # Errors
/// An unknown extension.
pub fn not_carried(path: &Path, mesh: &Mesh, fields: &Fields) -> Result<Vec<&'static str>> {
    use Format::{Glb, Gltf, Medit, Npy, Obj, Off, Ply, Stl, TetGen, Vtk, Vtu};
    let format = Format::from_path(path)?;
    let single = matches!(format, Gltf | Glb);
    let surface = single || matches!(format, Obj | Ply | Stl | Off);
    let triangles = surface_faces(mesh).iter().all(|f| f.len() == 3);
    let volume = !mesh.tets.is_empty();
    let regions = mesh.tet_regions.is_some() || mesh.face_regions.is_some();
    let cell_arrays = matches!(format, Vtk | Vtu) || (format == Ply && !volume);
    let lost = [
        (volume && (surface || format == Npy), "tetrahedra"),
        (!mesh.faces.is_empty() && (format == Npy || format == TetGen && volume), "faces"),
        (!mesh.edges.is_empty() && matches!(format, TetGen | Npy | Stl | Off), "edges"),
        (regions && (surface || format == Npy), "regions"),
        (!fields.point.is_empty() && !matches!(format, Vtk | Vtu | Ply), "point arrays"),
        (!fields.cell.is_empty() && !cell_arrays, "cell arrays"),
        (fields.colors.is_some() && format != Ply, "colours of vertices"),
        (format == Stl, "vertex numbers"),
        (single && !triangles, "polygons other than triangles"),
        (single, "positions beyond 32 bits"),
        (mesh.planar && !matches!(format, TetGen | Medit), "that the mesh is planar"),
    ];
    Ok(lost.into_iter().filter(|l| l.0).map(|(_, what)| what).collect())
}

/// Checks that no face has more corners than the format can hold.
fn require_corners(path: &Path, mesh: &Mesh, most: usize) -> Result<()> {
    match mesh.faces.iter().position(|p| p.len() > most) {
        None => Ok(()),
        Some(i) => Err(MeshError::new(
            ErrorKind::Unsupported,
            display(path),
            format!("its format takes faces of at most {most} vertices, and this one has {}", mesh.faces.get(i).len()),
            "write .obj, .ply, .off, .vtk or .vtu",
        )
        .at_item(Item::Face(i))),
    }
}

/// The faces that a surface format gets.
pub(crate) fn surface_faces(mesh: &Mesh) -> Cow<'_, Polygons> {
    if mesh.faces.is_empty() && !mesh.tets.is_empty() {
        Cow::Owned(topology::surface(mesh))
    } else {
        Cow::Borrowed(&mesh.faces)
    }
}

pub(crate) fn display(path: &Path) -> String {
    path.display().to_string()
}

pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    let io_error = |e: io::Error| MeshError::io(path, "read", &e);
    if fs::metadata(path).map_err(io_error)?.is_dir() {
        return Err(MeshError::new(ErrorKind::Io, display(path), "it is a folder", "name a file"));
    }
    fs::read(path).map_err(io_error)
}
