//! Cutting a chart further.

use super::edges::Edges;
use super::geometry::Metric;
use super::half_edges::{HalfEdges, NONE, sorted};
use super::{Chart, Charts, Place, emit, places, select};
use crate::error::{ErrorKind, Item, Result};
use crate::mesh::{Mesh, Polygons};

/// A part of a chart that was cut.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// The part as a chart.
    pub chart: Chart,
    /// The local vertex of the chart before of each local vertex here.
    pub parent: Vec<u32>,
}

/// Cuts a chart of a mesh along `edges`, pairs of its local vertices. The parts are in the order of their first faces;
/// a cut that parts nothing gives one, with a slit. A single edge that does not touch the boundary opens nothing, and
/// edges on the boundary are open already.
///
/// # Errors
/// A chart that is none or not of this mesh; a pair that is no edge of the chart, or the diagonal of a face.
pub fn split(mesh: &Mesh, chart: &Chart, edges: &[[u32; 2]]) -> Result<Vec<Part>> {
    let Cells { mut surface, face, reversed } = cells(mesh, chart)?;
    let mut wanted: Vec<[u32; 2]> = edges.iter().map(|&[a, b]| sorted(a, b)).collect();
    wanted.sort_unstable();
    wanted.dedup();
    let mut found = vec![false; wanted.len()];
    for h in 0..surface.len() as u32 {
        let ends = sorted(surface.vertex[h as usize], surface.vertex[surface.next(h) as usize]);
        if let Ok(i) = wanted.binary_search(&ends) {
            found[i] = true;
            surface.unglue(h);
        }
    }
    if let Some(i) = found.iter().position(|f| !f) {
        let [a, b] = wanted[i];
        return Err(mesh.error(
            ErrorKind::Malformed,
            format!("local vertices {a} and {b} of a chart are joined by no edge of a face"),
            "cut charts along edges of the mesh",
        ));
    }
    let (fan, _) = surface.fans();
    surface.close_slits(&fan);
    let points: Vec<_> = chart.vertices.iter().map(|&v| mesh.points[v as usize]).collect();
    let metric = Metric::new(&points, 0..points.len() as u32);
    let (charts, _) = emit::charts(&surface, &face, |c| reversed[c as usize], &metric);
    let part = |mut c: Chart| {
        let parent = std::mem::take(&mut c.vertices);
        c.vertices = parent.iter().map(|&v| chart.vertices[v as usize]).collect();
        Part { chart: c, parent }
    };
    Ok(charts.into_iter().map(part).collect())
}

pub(super) fn in_range(mesh: &Mesh, chart: &Chart, vertices: &[u32]) -> Result<()> {
    let n = chart.vertices.len();
    match vertices.iter().find(|&&v| v as usize >= n) {
        None => Ok(()),
        Some(v) => Err(mesh.error(
            ErrorKind::IndexOutOfRange,
            format!("local vertex {v} is out of range, the chart has {n}"),
            "give vertices of the chart",
        )),
    }
}

impl Charts {
    /// Cuts the chart `index` along `edges` as [`split`] does. The first part takes its number, the others follow the
    /// last chart; places and seams are brought up to date. Returns, for each part, its number and the local vertex
    /// before of each local vertex.
    ///
    /// # Errors
    /// As [`split`]; a number that no chart has.
    pub fn split(&mut self, mesh: &Mesh, index: usize, edges: &[[u32; 2]]) -> Result<Vec<(usize, Vec<u32>)>> {
        let Some(chart) = self.charts.get(index) else {
            return Err(mesh.error(
                ErrorKind::IndexOutOfRange,
                format!("there is no chart {index}, there are {}", self.charts.len()),
                "give the number of a chart",
            ));
        };
        let parts = split(mesh, chart, edges)?;
        let (charts, parents): (Vec<Chart>, Vec<_>) = parts.into_iter().map(|p| (p.chart, p.parent)).unzip();
        let numbers = self.replace(mesh, vec![(index, charts)])?;
        Ok(numbers.into_iter().flatten().zip(parents).collect())
    }

    /// Puts the parts that [`split`] made of charts in their places: the first of each takes the number of the chart
    /// that it is of, the others follow the last chart, in this order. Places and seams are brought up to date once.
    /// Returns the numbers of the parts.
    ///
    /// # Errors
    /// A number that no chart has, or no parts of a chart; then nothing is changed.
    pub fn replace(&mut self, mesh: &Mesh, parts: Vec<(usize, Vec<Chart>)>) -> Result<Vec<Vec<usize>>> {
        let bad = |(index, of): &&(usize, Vec<Chart>)| *index >= self.charts.len() || of.is_empty();
        if let Some((index, of)) = parts.iter().find(bad) {
            return Err(mesh.error(
                ErrorKind::IndexOutOfRange,
                format!("chart {index} of {} cannot become {} parts", self.charts.len(), of.len()),
                "give the number of a chart, and its parts",
            ));
        }
        let mut numbers = Vec::new();
        for (index, of) in parts {
            let rest = self.charts.len()..self.charts.len() + of.len() - 1;
            numbers.push(std::iter::once(index).chain(rest).collect());
            let mut of = of.into_iter();
            if let Some(first) = of.next() {
                self.charts[index] = first;
            }
            self.charts.extend(of);
        }
        let roles = select::roles(mesh);
        let (corner, of) = self.corners(mesh);
        self.places = places::of_corners(mesh, &roles, &corner, &of);
        self.seams = places::seams(mesh, &Edges::new(mesh.n_verts(), &mesh.faces), &roles, &self.places);
        Ok(numbers)
    }

    /// The corners of the mesh that are in charts, and their places.
    fn corners(&self, mesh: &Mesh) -> (Vec<u32>, Vec<Place>) {
        let (mut corner, mut place) = (Vec::new(), Vec::new());
        for (c, chart) in self.charts.iter().enumerate() {
            let mut k = 0;
            for run in chart.faces.chunk_by(|a, b| a == b) {
                let start = mesh.faces.offsets()[run[0] as usize];
                let reversed = self.reversed_faces.binary_search(&run[0]).is_ok();
                for (j, t) in chart.triangles[k..k + run.len()].iter().enumerate() {
                    let j = j as u32;
                    let at = if reversed { [0, j + 2, j + 1] } else { [0, j + 1, j + 2] };
                    for (v, i) in t.iter().zip(at) {
                        corner.push(start + i);
                        place.push(Place { chart: c as u32, vertex: *v });
                    }
                }
                k += run.len();
            }
        }
        (corner, place)
    }
}

/// The faces of a chart as cells over its local vertices.
pub(super) struct Cells {
    pub surface: HalfEdges,
    pub face: Vec<u32>,
    pub reversed: Vec<bool>,
}

pub(super) fn cells(mesh: &Mesh, chart: &Chart) -> Result<Cells> {
    let foreign = |what: &str| mesh.error(ErrorKind::Malformed, what, "give a chart of this mesh as it was returned");
    if let Some(defect) = chart.defect() {
        return Err(foreign(&format!("this is no chart: {defect}")));
    }
    if chart.vertices.iter().any(|&v| v as usize >= mesh.n_verts()) {
        return Err(foreign("a vertex of the chart is not in the mesh"));
    }
    let mut polygons = Polygons::new();
    let (mut face, mut reversed) = (Vec::new(), Vec::new());
    let mut k = 0;
    let mut corners = Vec::new();
    for run in chart.faces.chunk_by(|a, b| a == b) {
        let fan = &chart.triangles[k..k + run.len()];
        k += run.len();
        // The fan (0 1 2) (0 2 3) of a face, or (0 2 1) (0 3 2) of a reversed one.
        let backwards = fan.len() > 1 && fan[1][2] == fan[0][1];
        let joined =
            |w: &[[u32; 3]]| w[0][0] == w[1][0] && if backwards { w[1][2] == w[0][1] } else { w[1][1] == w[0][2] };
        if mesh.faces.len() <= run[0] as usize || !fan.windows(2).all(joined) {
            return Err(mesh
                .error(ErrorKind::Malformed, "its triangles are no fan", "give a chart of this mesh as it was returned")
                .at_item(Item::Face(run[0] as usize)));
        }
        corners.clear();
        corners.push(fan[0][0]);
        if backwards {
            corners.extend(fan.iter().rev().map(|t| t[1]));
            corners.push(fan[0][2]);
        } else {
            corners.push(fan[0][1]);
            corners.extend(fan.iter().map(|t| t[2]));
        }
        polygons.push(&corners);
        face.push(run[0]);
        reversed.push(backwards);
    }
    let n = polygons.indices().len();
    let mut cell = Vec::with_capacity(n);
    polygons.iter().enumerate().for_each(|(c, p)| cell.extend(std::iter::repeat_n(c as u32, p.len())));
    let mut mate = vec![NONE; n];
    for (_, sides) in Edges::new(chart.vertices.len(), &polygons).iter() {
        if let &[a, b] = sides {
            mate[a as u32 as usize] = b as u32;
            mate[b as u32 as usize] = a as u32;
        }
    }
    let surface = HalfEdges { offsets: polygons.offsets().to_vec(), cell, vertex: polygons.indices().to_vec(), mate };
    Ok(Cells { surface, face, reversed })
}
