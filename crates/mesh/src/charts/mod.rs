//! From any surface mesh to charts that can be mapped to the plane.
//!
//! A chart is a connected oriented manifold of genus 0 with a boundary. A mesh that is one is left as it is. What is
//! none is cut: closed parts, and parts with several boundary loops, along a short tree of edges that reaches their
//! limbs, handles along a short cut graph, non-orientable parts where directions meet, non-manifold edges between the faces that go on best, and wherever the
//! user wants. Vertices are doubled along cuts; none is ever moved or merged, and coordinates decide nothing about
//! what is connected.

mod check;
mod cut;
mod doubles;
mod edges;
mod emit;
mod geometry;
mod glue;
mod graph;
mod half_edges;
mod handles;
mod limbs;
mod places;
mod relief;
mod select;
mod split;

#[cfg(test)]
mod tests;

pub use check::disk_defect;
pub use relief::{halving_cut, relief_cut};
pub use split::{Part, split};

use edges::Edges;
use geometry::Metric;
use glue::{Gluing, Oriented};
use select::{Role, counted};

use crate::error::{ErrorKind, Item, Result};
use crate::mesh::Mesh;

/// How a surface is cut. The default has no seams of the user's.
#[derive(Clone, Debug, PartialEq)]
pub struct ChartOptions {
    /// Edges of the mesh, as pairs of vertices in any order, along which the surface is cut open.
    pub seams: Vec<[u32; 2]>,
    /// Parts that are no disks are cut into each limb whose isoperimetric ratio 4 pi A / P^2 (area A beyond a rim of length P)
    /// passes this. No flat region has more than 1, so that what has more must be stretched; a hemisphere has 2, a
    /// tube of length L and radius r 2 L / r, and 1 more with a flat end. Lower means longer seams and less stretch.
    pub limb_ratio: f64,
    /// Parts with several boundary loops are cut only if some limb passes this: what could stay as it is, should.
    pub least_need: f64,
    /// Limbs of less than this part of the area of their surface are not cut.
    pub least_limb: f64,
}

impl Default for ChartOptions {
    fn default() -> Self {
        ChartOptions { seams: Vec::new(), limb_ratio: 1.15, least_need: 2.0, least_limb: 0.005 }
    }
}

/// Where a corner of a face is: a local vertex of a chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Place {
    /// The chart.
    pub chart: u32,
    /// The local vertex in it.
    pub vertex: u32,
}

/// A connected, oriented triangulated manifold of genus 0 with at least one boundary loop.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Chart {
    /// Triangles over local vertices, all in one direction; those of a face follow each other as in
    /// [`Polygons::fan_triangles`](crate::Polygons::fan_triangles).
    pub triangles: Vec<[u32; 3]>,
    /// The mesh face of each triangle, ascending.
    pub faces: Vec<u32>,
    /// The mesh vertex of each local vertex, ascending; more than once where the surface is cut.
    pub vertices: Vec<u32>,
    /// The boundary loops, local vertices in the direction of the triangles from the smallest, the longest in 3D first.
    pub loops: Vec<Vec<u32>>,
}

/// The charts of a mesh and how they were come by.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Charts {
    /// The charts, in the order of their first faces.
    pub charts: Vec<Chart>,
    /// The place of each corner of the mesh's faces, parallel to [`Polygons::indices`](crate::Polygons::indices).
    /// Corners of repeated faces share those of the first. Corners of faces that are left out take a place of their
    /// vertex in another face; `None` where there is none.
    pub places: Vec<Option<Place>>,
    /// Edges of the mesh (smaller vertex first, ascending) along which the surface was cut, by the user or here: edges
    /// of two faces or more whose corners there have different places. Not the boundary of the surface itself.
    pub seams: Vec<[u32; 2]>,
    /// Faces whose listed order is against the direction of their chart, ascending.
    pub reversed_faces: Vec<u32>,
    /// What was done about defects of the mesh, a sentence each, with the first face or vertex (0-based).
    pub repairs: Vec<String>,
    /// What the user may want to know, a sentence each.
    pub warnings: Vec<String>,
}

/// Cuts the faces of a mesh into charts. O(n log n) in the number of faces, and the same result on every run.
///
/// # Errors
/// No vertices or faces, indices out of range, coordinates that are not finite; a seam that is no edge of a face;
/// no face that could be mapped.
pub fn charts(mesh: &Mesh, options: &ChartOptions) -> Result<Charts> {
    mesh.check_indices()?;
    select::require_size(mesh)?;
    let roles = select::roles(mesh);
    if !roles.contains(&Role::Taken) {
        return Err(mesh.error(ErrorKind::Empty, "no face has three different vertices", "give a surface mesh"));
    }
    let edges = Edges::new(mesh.n_verts(), &mesh.faces);
    let seams = user_seams(mesh, options, &edges)?;
    let metric = Metric::new(&mesh.points, mesh.faces.indices().iter().copied());

    let mut out = Charts::default();
    select::describe(mesh, &roles, &mut out.repairs);
    let (mut gluing, branching) = Gluing::new(mesh, &roles, &edges, &seams, &metric);
    if let Some(e) = branching.first() {
        out.repairs.push(format!(
            "{} joined by three faces or more, the first is {} {}: the surface goes on between the pairs of faces that \
             fit best and is cut there otherwise",
            plural(branching.len(), "edge is", "edges are"),
            e[0],
            e[1]
        ));
    }
    let surface = orient(&mut gluing, &roles, &edges, &branching, &mut out);
    let Oriented { mut half_edges, corner, face } = surface;
    cut::open_parts(&mut half_edges, &metric, options, &mut out.repairs);

    let reversed = std::mem::take(&mut out.reversed_faces);
    let (charts, places) =
        emit::charts(&half_edges, &face, |c| reversed.binary_search(&face[c as usize]).is_ok(), &metric);
    out.reversed_faces = reversed;
    out.charts = charts;
    drop(half_edges);
    out.places = places::of_corners(mesh, &roles, &corner, &places);
    out.seams = places::seams(mesh, &edges, &roles, &out.places);
    report(mesh, &roles, &seams, &mut out);
    verify(mesh, &out)?;
    Ok(out)
}

/// The user's seams, smaller vertex first, ascending, each once.
fn user_seams(mesh: &Mesh, options: &ChartOptions, edges: &Edges) -> Result<Vec<[u32; 2]>> {
    if let Some(i) = options.seams.iter().position(|&[a, b]| edges.sides(a, b).next().is_none()) {
        let [a, b] = options.seams[i];
        return Err(mesh.error(
            ErrorKind::Malformed,
            format!("seam {i}, from vertex {a} to {b} (0-based), is no edge of a face"),
            "give seams along edges of the mesh",
        ));
    }
    let mut seams: Vec<_> = options.seams.iter().map(|&[a, b]| half_edges::sorted(a, b)).collect();
    seams.sort_unstable();
    seams.dedup();
    Ok(seams)
}

/// Brings the faces into one direction wherever they are glued, and opens what cannot be: the edges between
/// conflicting directions, and edges doubled between the same two vertices.
fn orient(
    gluing: &mut Gluing<'_>,
    roles: &[Role],
    edges: &Edges,
    branching: &[[u32; 2]],
    out: &mut Charts,
) -> Oriented {
    let mut isolated = Vec::new();
    loop {
        let orientation = gluing.orient(roles);
        if let Some(&first) = orientation.conflicts.first() {
            let f = gluing.face[first as usize];
            out.repairs.push(format!(
                "the surface is one-sided at face {f}: it was cut along {}",
                plural(orientation.conflicts.len(), "edge", "edges")
            ));
            orientation.conflicts.iter().for_each(|&c| gluing.unglue(c));
        }
        let mut surface = Oriented::new(gluing, roles, &orientation);
        let (fan, _) = surface.half_edges.fans();
        surface.half_edges.close_slits(&fan);
        let doubled = doubles::doubled_faces(&surface, &fan, edges, branching);
        if doubled.is_empty() {
            out.reversed_faces = (0..roles.len() as u32).filter(|&f| orientation.reversed[f as usize]).collect();
            if let Some(&first) = isolated.first() {
                out.repairs.push(counted(
                    isolated.len(),
                    first as usize,
                    "shares a line between two vertices with other faces that it does not touch there",
                    "share a line between two vertices with other faces that they do not touch there",
                    "given charts of their own",
                ));
            }
            return surface;
        }
        // Each round takes faces out of their surroundings for good, so there is a last one.
        doubled.iter().for_each(|&f| gluing.isolate(f));
        isolated.extend(doubled);
        isolated.sort_unstable();
        isolated.dedup();
    }
}

/// Sentences about what the finished charts show.
fn report(mesh: &Mesh, roles: &[Role], seams: &[[u32; 2]], out: &mut Charts) {
    if let Some(&first) = out.reversed_faces.first() {
        out.repairs.push(counted(
            out.reversed_faces.len(),
            first as usize,
            "is listed against the direction of its neighbours",
            "are listed against the direction of their neighbours",
            "turned around inside",
        ));
    }
    places::report_vertices(mesh, roles, out);
    let closed = seams.iter().filter(|&s| out.seams.binary_search(s).is_err());
    let boundary_or_slit = closed.count();
    if boundary_or_slit > 0 {
        out.warnings.push(format!(
            "{} nothing open: a seam of one edge inside the surface, or on its boundary",
            plural(boundary_or_slit, "seam edge cuts", "seam edges cut")
        ));
    }
}

/// "1 edge", "2 edges".
fn plural(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

/// The check of every chart: a wrong chart is an error here and not a wrong map later.
fn verify(mesh: &Mesh, charts: &Charts) -> Result<()> {
    for (i, chart) in charts.charts.iter().enumerate() {
        if let Some(defect) = chart.defect() {
            let face = chart.faces.first().map_or(0, |&f| f as usize);
            return Err(mesh
                .error(
                    ErrorKind::Unsupported,
                    format!("chart {i} could not be cut to a disk with holes: {defect}"),
                    "repair the surface around this face, or give seams there",
                )
                .at_item(Item::Face(face)));
        }
    }
    Ok(())
}
