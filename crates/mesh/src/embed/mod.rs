//! A lattice of tetrahedra around any surface, which carries the vertices of the surface.
//!
//! [`embed`] lays cubic cells around the surface, keeps those that it touches or that are inside, cuts each into six
//! tetrahedra and gives every vertex its tetrahedron and barycentric coordinates there. What is inside is decided by the
//! generalised winding number ([`crate::winding`]), so holes, self-intersections and loose triangles do no harm.
//!
//! A cell that holds several parts of the body, such as two fingers side by side, is there once for each: parts are told
//! apart on 4 x 4 x 4 voxels a cell (Nesme et al. 2009, Preserving topology and elasticity for embedded deformable
//! models). What is closer than a voxel or two is joined; [`Embedding::joins`] says where.
//!
//! No vertex can be left without a tetrahedron: the voxel of each is kept, and the six tetrahedra of a cell (Kuhn 1960)
//! cover it, with coordinates that are differences of sorted numbers.

mod grid;
mod inside;
mod joins;
mod pieces;
mod raster;
#[cfg(test)]
mod tests;

pub use inside::closedness;
pub use joins::Join;

use crate::error::{ErrorKind, Result};
use crate::mesh::Mesh;
use crate::topology::vertex_elements;
use crate::vec3::{V3, cross, dot, sub};
use crate::winding::WindingTree;
use grid::{Grid, SIDE, Voxels, bit};
use inside::Inside;
use pieces::{Cell, Pieces, locate};
use raster::{Touch, touches};
use rayon::prelude::*;

/// From this closedness on a surface is taken for that of a body: its holes fill less than a tenth of the view of it.
pub const NEARLY_CLOSED: f64 = 0.4;
/// Below this closedness there is no inside to speak of.
pub const LEAST_CLOSED: f64 = 0.2;
/// The finest lattice, in cells along the longest side.
pub const MOST_RESOLUTION: usize = 256;
/// The largest lattice, in cells: six million tetrahedra.
pub const MOST_CELLS: usize = 1 << 20;
/// A cell counts as filled to this part at least: the stiffness of one that the surface barely enters must not vanish.
pub const LEAST_FILL: f64 = 1.0 / 16.0;

/// A surface in a lattice.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Embedding {
    /// The tetrahedra, six a cell, all of the same volume and positively oriented.
    pub lattice: Mesh,
    /// The part of each tetrahedron's cell that is inside the surface, sampled at the 64 centres of its voxels: from
    /// [`LEAST_FILL`] to 1. Energy and mass are to be scaled by it, or the body is too stiff and too heavy.
    pub fill: Vec<f64>,
    /// The tetrahedron of each vertex of the surface; `None` for those that no face uses.
    pub tet_of: Vec<Option<u32>>,
    /// The barycentric coordinates of each vertex there: none negative, their sum 1.
    pub weights: Vec<[f64; 4]>,
    /// The length of a cell's side.
    pub cell: f64,
    /// See [`closedness`]; its absolute value.
    pub closedness: f64,
    /// Where the lattice joins what the surface parts; one for each cell.
    pub joins: Vec<Join>,
}

/// Embeds the faces of a mesh (polygons as fans) in a lattice of `resolution` cells along the longest side of their
/// bounding box. Edges and tetrahedra of the mesh are not looked at. Deterministic on any number of threads.
///
/// # Errors
/// A mesh without faces, faces of no extent, a surface with no inside (closedness below [`LEAST_CLOSED`]), a resolution of
/// 0 or above [`MOST_RESOLUTION`], a lattice of more than [`MOST_CELLS`].
///
/// ```
/// use proxel_mesh::{embed::embed, generate::octopus, Mesh, topology::surface};
/// let body = octopus(&Default::default())?.mesh;
/// let faces = surface(&body);
/// let skin = Mesh { faces, tets: Vec::new(), ..body };
/// let embedding = embed(&skin, 12)?;
/// let back = embedding.carry(&embedding.lattice.points, &skin.points);
/// for (p, q) in skin.points.iter().zip(&back) {
///     assert!((0..3).all(|d| (p[d] - q[d]).abs() < 1e-12));
/// }
/// # Ok::<(), proxel_mesh::MeshError>(())
/// ```
pub fn embed(mesh: &Mesh, resolution: usize) -> Result<Embedding> {
    mesh.check_indices()?;
    if !(1..=MOST_RESOLUTION).contains(&resolution) {
        let what = format!("a lattice of {resolution} cells along the longest side");
        return Err(mesh.error(
            ErrorKind::InvalidParameter,
            what,
            format!("give a resolution from 1 to {MOST_RESOLUTION}"),
        ));
    }
    let triangles = mesh.faces.fan_triangles();
    let ends = extent(&mesh.points, &triangles).ok_or_else(|| {
        let (what, remedy) = ("it has no faces, so there is nothing to embed", "give a mesh with faces");
        mesh.error(ErrorKind::Empty, what, remedy)
    })?;
    let side = (0..3).map(|d| ends[1][d] - ends[0][d]).fold(0.0, f64::max);
    if !(side > 0.0 && side.is_finite()) {
        let what = format!("its faces have extent {side}");
        return Err(mesh.error(ErrorKind::ZeroVolume, what, "give a surface with vertices in different places"));
    }
    let inside = Inside::new(&mesh.points, &triangles);
    if inside.closedness.is_nan() || inside.closedness < LEAST_CLOSED {
        return Err(no_inside(mesh, inside.closedness));
    }
    let grid = Grid::new(ends, resolution);
    // Before anything is made of them.
    check_count(mesh, (volume(&mesh.points, &triangles, ends[0]) / grid.cell.powi(3)) as usize)?;
    let local: Vec<V3> = mesh.points.iter().map(|&p| grid.local(p)).collect();
    let touched = touches(&grid, &local, &triangles);
    let at_vertex = vertex_elements(mesh.n_verts(), triangles.iter().map(|t| &t[..]));
    let homes = homes(&grid, &local, |v| !at_vertex.row(v).is_empty());
    let cells = cells(&grid, &inside, &touched, &homes);
    check_count(mesh, cells.len())?;
    let mut pieces = Pieces::new(&grid, &cells);
    let mut joins = joins::find(&grid, &pieces, &touched, &mesh.points, &triangles, &at_vertex);
    let face_of: Vec<u32> = mesh
        .faces
        .iter()
        .enumerate()
        .flat_map(|(i, f)| std::iter::repeat_n(i as u32, f.len().saturating_sub(2)))
        .collect();
    for join in &mut joins {
        (join.a, join.b) = (face_of[join.a as usize], face_of[join.b as usize]);
    }

    let piece_of: Vec<Option<usize>> =
        homes.iter().map(|h| h.and_then(|(cell, voxel)| pieces.with_voxel(cell, voxel))).collect();
    let mut used = vec![false; pieces.pieces.len()];
    piece_of.iter().flatten().for_each(|&p| used[p] = true);
    let (lattice, numbers) = pieces.lattice(&grid, &used);

    let mut out = Embedding {
        lattice,
        fill: Vec::new(),
        tet_of: vec![None; mesh.n_verts()],
        weights: vec![[0.0; 4]; mesh.n_verts()],
        cell: grid.cell,
        closedness: inside.closedness,
        joins,
    };
    for (piece, _) in pieces.pieces.iter().zip(&numbers).filter(|(_, n)| n.is_some()) {
        let part = f64::from(piece.inside.count_ones()) / f64::from(Voxels::BITS);
        out.fill.extend([part.max(LEAST_FILL); 6]);
    }
    for (v, piece) in piece_of.iter().enumerate() {
        let Some((piece, number)) = piece.and_then(|p| Some((&pieces.pieces[p], numbers[p]?))) else { continue };
        let corner = grid.of_key(piece.key);
        let u = [0, 1, 2].map(|d| (local[v][d] / SIDE as f64 - corner[d] as f64).clamp(0.0, 1.0));
        let (path, weights) = locate(u);
        out.tet_of[v] = Some(6 * number + path as u32);
        out.weights[v] = weights;
    }
    Ok(out)
}

impl Embedding {
    /// The nodes that carry a vertex of the surface, and their parts in it.
    pub fn at(&self, vertex: usize) -> Option<([u32; 4], [f64; 4])> {
        let tet = (*self.tet_of.get(vertex)?)?;
        Some((*self.lattice.tets.get(tet as usize)?, self.weights[vertex]))
    }

    /// The vertices of the surface when the lattice is at these positions; vertices that no face uses stay where `rest`
    /// has them. Affine maps of the lattice are affine maps of the surface.
    pub fn carry(&self, lattice: &[[f64; 3]], rest: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let at = |v: usize| {
            let (nodes, w) = self.at(v)?;
            // Around the first node, so that far from the origin nothing is lost.
            let x = nodes.map(|n| lattice[n as usize]);
            Some([0, 1, 2].map(|d| x[0][d] + (1..4).map(|k| w[k] * (x[k][d] - x[0][d])).sum::<f64>()))
        };
        rest.iter().enumerate().map(|(v, &p)| at(v).unwrap_or(p)).collect()
    }
}

/// How closed the faces of a mesh are, by [`closedness`]; 0 without faces. Indices must be in range.
pub fn mesh_closedness(mesh: &Mesh) -> f64 {
    let triangles = mesh.faces.fan_triangles();
    closedness(&mesh.points, &triangles, &WindingTree::new(&mesh.points, &triangles))
}

/// The volume inside of nearly closed triangles, without sign.
fn volume(points: &[V3], triangles: &[[u32; 3]], origin: V3) -> f64 {
    let of = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| sub(points[v as usize], origin));
        dot(a, cross(b, c)) / 6.0
    };
    triangles.iter().map(of).sum::<f64>().abs()
}

fn check_count(mesh: &Mesh, cells: usize) -> Result<()> {
    if cells <= MOST_CELLS {
        return Ok(());
    }
    let what = format!("its lattice would have {cells} cells, which are more than {MOST_CELLS}");
    Err(mesh.error(ErrorKind::InvalidParameter, what, "give a lower resolution"))
}

fn no_inside(mesh: &Mesh, closedness: f64) -> crate::error::MeshError {
    let what = format!(
        "the surface has no inside: the winding number at it is {closedness:.2} on average, 0.50 where it is closed and \
         all faces turn the same way"
    );
    mesh.error(
        ErrorKind::ZeroVolume,
        what,
        "close it, turn its faces to one side, or deform it as a thin sheet (--shell)",
    )
}

/// The box around the corners of all triangles.
fn extent(points: &[V3], triangles: &[[u32; 3]]) -> Option<[V3; 2]> {
    let first = points[triangles.first()?[0] as usize];
    Some(triangles.as_flattened().iter().fold([first, first], |[low, high], &v| {
        let p = points[v as usize];
        [[0, 1, 2].map(|d| low[d].min(p[d])), [0, 1, 2].map(|d| high[d].max(p[d]))]
    }))
}

/// The cell and the voxel of each vertex that is used.
fn homes(grid: &Grid, local: &[V3], is_used: impl Fn(usize) -> bool) -> Vec<Option<(u64, Voxels)>> {
    let home = |(v, q): (usize, &V3)| {
        let voxel = [0, 1, 2].map(|d| grid.voxel(q[d], d));
        is_used(v).then(|| (grid.key(voxel.map(|i| i / SIDE)), bit(voxel.map(|i| i % SIDE))))
    };
    local.iter().enumerate().map(home).collect()
}

/// The cells to keep, by key: touched ones with what of them is inside, and untouched ones that are inside as a whole.
fn cells(grid: &Grid, inside: &Inside, touches: &[Touch], homes: &[Option<(u64, Voxels)>]) -> Vec<Cell> {
    /// Cells a task; fixed.
    const CHUNK: usize = 256;
    let mut voxels: Vec<(u64, Voxels)> = touches.iter().map(|t| (t.cell, t.voxels)).collect();
    voxels.extend(homes.iter().flatten());
    voxels.par_sort_unstable();
    let touched: Vec<(u64, Voxels)> =
        voxels.chunk_by(|a, b| a.0 == b.0).map(|g| (g[0].0, g.iter().fold(0, |all, v| all | v.1))).collect();
    let keys: Vec<u64> = (0..grid.len() as u64).collect();
    let of_chunk = |keys: &[u64]| {
        let mut out = Vec::new();
        let first = touched.partition_point(|t| t.0 < keys[0]);
        let mut next = touched[first..].iter().peekable();
        for &key in keys {
            let corner = grid.of_key(key).map(|i| (SIDE * i) as f64);
            match next.next_if(|t| t.0 == key) {
                Some(&(_, touched)) => out.push(Cell { key, touched, inside: sampled(grid, inside, corner) }),
                None if inside.contains(grid.point(corner.map(|c| c + SIDE as f64 / 2.0))) => {
                    out.push(Cell { key, touched: 0, inside: Voxels::MAX });
                }
                None => {}
            }
        }
        out
    };
    keys.par_chunks(CHUNK).map(of_chunk).collect::<Vec<_>>().concat()
}

/// The voxels of the cell at `corner` whose centres are inside.
fn sampled(grid: &Grid, inside: &Inside, corner: V3) -> Voxels {
    let mut out = 0;
    for z in 0..SIDE {
        for y in 0..SIDE {
            for x in 0..SIDE {
                let at = [x, y, z];
                if inside.contains(grid.point([0, 1, 2].map(|d| corner[d] + at[d] as f64 + 0.5))) {
                    out |= bit(at);
                }
            }
        }
    }
    out
}
