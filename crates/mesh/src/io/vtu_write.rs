//! Writing VTU: the XML first, then all arrays as raw little-endian bytes behind 64-bit lengths.

use std::io::{self, Write};

use super::vtk_cells::{REGION, cell_arrays, cell_regions, cells, n_cells};
use crate::fields::Fields;
use crate::mesh::Mesh;

type Fill<'a> = Box<dyn Fn(&mut dyn Write) -> io::Result<()> + 'a>;

/// An array that is declared but still to be written: its length in bytes, and how to write it.
struct Pending<'a> {
    bytes: u64,
    fill: Fill<'a>,
}

#[derive(Default)]
struct Appended<'a> {
    arrays: Vec<Pending<'a>>,
    offset: u64,
}

impl<'a> Appended<'a> {
    fn declare(
        &mut self,
        w: &mut dyn Write,
        (name, kind, components): (&str, &str, usize),
        bytes: usize,
        fill: impl Fn(&mut dyn Write) -> io::Result<()> + 'a,
    ) -> io::Result<()> {
        let name = name.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;");
        let offset = self.offset;
        self.offset += 8 + bytes as u64;
        self.arrays.push(Pending { bytes: bytes as u64, fill: Box::new(fill) });
        writeln!(
            w,
            r#"<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" format="appended" offset="{offset}"/>"#
        )
    }
}

fn reals<'a>(data: impl AsRef<[f64]> + 'a) -> impl Fn(&mut dyn Write) -> io::Result<()> + 'a {
    move |w| data.as_ref().iter().try_for_each(|x| w.write_all(&x.to_le_bytes()))
}

/// Writes the mesh with all arrays.
pub(crate) fn write(mesh: &Mesh, fields: &Fields, w: &mut dyn Write) -> io::Result<()> {
    let n = n_cells(mesh);
    let mut out = Appended::default();
    writeln!(w, r#"<?xml version="1.0"?>"#)?;
    writeln!(w, r#"<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">"#)?;
    writeln!(w, "<UnstructuredGrid>")?;
    writeln!(w, r#"<Piece NumberOfPoints="{}" NumberOfCells="{n}">"#, mesh.points.len())?;
    writeln!(w, "<PointData>")?;
    for f in &fields.point {
        out.declare(w, (&f.name, "Float64", f.components), 8 * f.data.len(), reals(&f.data))?;
    }
    writeln!(w, "</PointData>\n<CellData>")?;
    if let Some(regions) = cell_regions(mesh) {
        out.declare(w, (REGION, "Int32", 1), 4 * n, move |w| {
            regions.iter().try_for_each(|r| w.write_all(&r.to_le_bytes()))
        })?;
    }
    for (name, components, data) in cell_arrays(mesh, fields) {
        out.declare(w, (name, "Float64", components), 8 * data.len(), reals(data))?;
    }
    writeln!(w, "</CellData>\n<Points>")?;
    let points = mesh.points.as_flattened();
    out.declare(w, ("Points", "Float64", 3), 8 * points.len(), reals(points))?;
    writeln!(w, "</Points>\n<Cells>")?;
    let corners: usize = cells(mesh).map(|(_, c)| c.len()).sum();
    out.declare(w, ("connectivity", "Int64", 1), 8 * corners, |w| {
        cells(mesh).flat_map(|(_, c)| c).try_for_each(|&v| w.write_all(&i64::from(v).to_le_bytes()))
    })?;
    out.declare(w, ("offsets", "Int64", 1), 8 * n, |w| {
        let mut end = 0i64;
        cells(mesh).try_for_each(|(_, c)| {
            end += c.len() as i64;
            w.write_all(&end.to_le_bytes())
        })
    })?;
    out.declare(w, ("types", "UInt8", 1), n, |w| cells(mesh).try_for_each(|(kind, _)| w.write_all(&[kind])))?;
    writeln!(w, "</Cells>\n</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">")?;
    w.write_all(b"_")?;
    for array in &out.arrays {
        w.write_all(&array.bytes.to_le_bytes())?;
        (array.fill)(w)?;
    }
    writeln!(w, "\n</AppendedData>\n</VTKFile>")
}
