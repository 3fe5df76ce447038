//! Regular grids: beams of tetrahedra, cloth of triangles.

use super::{invalid, positive};
use crate::error::Result;
use crate::mesh::Mesh;

/// How a cell of the grid becomes tetrahedra.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellSplit {
    /// Five, mirrored from cell to cell: a regular one in the middle and four corners. Conforming.
    Five,
    /// Six around the diagonal (Kuhn 1960), the same in every cell. Conforming.
    Six,
    /// Five, the same in every cell: the diagonals of neighbours cross, so that they share the corners of a face but not the
    /// face. The bars of Overby et al. 2017 are made so.
    FiveAlike,
}

/// More vertices than this are taken for a mistake.
const MOST_VERTS: usize = 200_000_000;

/// A box of `cells` hexahedral cells, each split into tetrahedra, of edge lengths `size` and
/// centred at the origin. Vertices are numbered with x fastest, z slowest.
///
/// # Errors
/// No cells, too many of them, or a size that is not positive.
///
/// ```
/// use proxel_mesh::generate::{CellSplit, beam};
/// let mesh = beam([4, 2, 2], [2.0, 1.0, 1.0], CellSplit::Five)?;
/// assert_eq!((mesh.points.len(), mesh.tets.len()), (45, 80));
/// # Ok::<(), proxel_mesh::MeshError>(())
/// ```
pub fn beam(cells: [usize; 3], size: [f64; 3], split: CellSplit) -> Result<Mesh> {
    for s in size {
        positive("the size of a beam", s)?;
    }
    let [nx, ny, nz] = cells;
    let n = grid_verts(&cells)?;
    let mut points = Vec::with_capacity(n);
    for k in 0..=nz {
        for j in 0..=ny {
            for i in 0..=nx {
                let at = |i: usize, n: usize, s: f64| s * (i as f64 / n as f64 - 0.5);
                points.push([at(i, nx, size[0]), at(j, ny, size[1]), at(k, nz, size[2])]);
            }
        }
    }
    let vertex = |i: usize, j: usize, k: usize| (i + (nx + 1) * (j + (ny + 1) * k)) as u32;
    let mut tets = Vec::with_capacity(nx * ny * nz * if split == CellSplit::Six { 6 } else { 5 });
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                // Corner c of the cell stands at (c & 1, c >> 1 & 1, c >> 2).
                let corner = |c: usize| vertex(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
                match split {
                    CellSplit::Five if (i + j + k) % 2 == 0 => {
                        tets.extend(FIVE.map(|t| t.map(corner)));
                    }
                    CellSplit::Five => {
                        // Mirrored in x: bit 0 flips, and with it the orientation.
                        tets.extend(FIVE.map(|t| [t[0], t[1], t[3], t[2]].map(|c| corner(c ^ 1))));
                    }
                    CellSplit::Six => tets.extend(SIX.map(|t| t.map(corner))),
                    CellSplit::FiveAlike => tets.extend(FIVE_ALIKE.map(|t| t.map(corner))),
                }
            }
        }
    }
    Ok(Mesh::from_tets("beam", points, tets))
}

const FIVE: [[usize; 4]; 5] = [[0, 3, 6, 5], [1, 0, 5, 3], [2, 0, 3, 6], [4, 0, 6, 5], [7, 3, 5, 6]];
const FIVE_ALIKE: [[usize; 4]; 5] = [[7, 4, 1, 5], [4, 1, 2, 7], [4, 7, 2, 6], [1, 2, 7, 3], [4, 2, 1, 0]];
const SIX: [[usize; 4]; 6] = [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

/// A unit cube of n x n x n cells of five tetrahedra, centred at the origin.
///
/// # Errors
/// As [`beam`].
pub fn cube(n: usize) -> Result<Mesh> {
    Ok(Mesh { name: "cube".into(), ..beam([n; 3], [1.0; 3], CellSplit::Five)? })
}

/// A rectangle of `cells` squares in the plane z = 0, each split into two triangles along
/// alternating diagonals, of edge lengths `size` and centred at the origin; x fastest.
///
/// # Errors
/// As [`beam`].
pub fn cloth(cells: [usize; 2], size: [f64; 2]) -> Result<Mesh> {
    for s in size {
        positive("the size of a cloth", s)?;
    }
    let [nx, ny] = cells;
    let n = grid_verts(&cells)?;
    let mut points = Vec::with_capacity(n);
    for j in 0..=ny {
        for i in 0..=nx {
            let at = |i: usize, n: usize, s: f64| s * (i as f64 / n as f64 - 0.5);
            points.push([at(i, nx, size[0]), at(j, ny, size[1]), 0.0]);
        }
    }
    let mut triangles = Vec::with_capacity(2 * nx * ny);
    for j in 0..ny {
        for i in 0..nx {
            let a = (i + (nx + 1) * j) as u32;
            let (b, c, d) = (a + 1, a + nx as u32 + 1, a + nx as u32 + 2);
            if (i + j) % 2 == 0 {
                triangles.extend([[a, b, d], [a, d, c]]);
            } else {
                triangles.extend([[a, b, c], [b, d, c]]);
            }
        }
    }
    Ok(Mesh::from_triangles("cloth", points, &triangles))
}

fn grid_verts(cells: &[usize]) -> Result<usize> {
    let n = cells.iter().try_fold(1usize, |n, &c| n.checked_mul(c.checked_add(1)?));
    match n {
        Some(n) if n <= MOST_VERTS && cells.iter().all(|&c| c > 0) => Ok(n),
        _ => Err(invalid(
            format!("a grid of {cells:?} cells"),
            "give each direction at least one cell, 200 million vertices at most",
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::require_volumes;
    use crate::topology::tet_faces;

    #[test]
    fn beams_fill_their_box_and_conform() {
        for (split, per_cell) in [(CellSplit::Five, 5), (CellSplit::Six, 6)] {
            let mesh = beam([3, 4, 2], [3.0, 2.0, 1.0], split).unwrap();
            assert_eq!((mesh.points.len(), mesh.tets.len()), (60, 24 * per_cell));
            let check = require_volumes(&mesh).unwrap();
            assert!((check.total - 6.0).abs() < 1e-13);
            let faces = tet_faces(&mesh.tets);
            // Two triangles for every square on the outside: anything more is a crack.
            assert_eq!(faces.boundary.len(), 2 * 2 * (12 + 8 + 6));
            assert_eq!(faces.non_manifold.len(), 0);
        }
    }

    #[test]
    fn cells_that_are_alike_share_corners_but_no_faces() {
        let mesh = beam([12, 3, 3], [4.0, 1.0, 1.0], CellSplit::FiveAlike).unwrap();
        assert_eq!((mesh.points.len(), mesh.tets.len()), (208, 540));
        let check = require_volumes(&mesh).unwrap();
        assert!((check.total - 4.0).abs() < 1e-13);
        // All faces of all cells are on a boundary: 12 triangles a cell.
        assert_eq!(tet_faces(&mesh.tets).boundary.len(), 12 * 108);
    }

    #[test]
    fn cloth_counts() {
        let mesh = cloth([3, 2], [1.0, 1.0]).unwrap();
        assert_eq!((mesh.points.len(), mesh.faces.len()), (12, 12));
        let c = crate::check::check_triangles(&mesh.points, &mesh.faces.as_triangles().unwrap(), true);
        assert!(c.negative.is_empty() && (c.total - 1.0).abs() < 1e-14);
    }

    #[test]
    fn nonsense_is_refused() {
        assert!(beam([0, 1, 1], [1.0; 3], CellSplit::Six).is_err());
        assert!(beam([usize::MAX, 2, 2], [1.0; 3], CellSplit::Six).is_err());
        assert!(beam([1, 1, 1], [1.0, f64::NAN, 1.0], CellSplit::Six).is_err());
        assert!(cloth([2, 2], [1.0, -1.0]).is_err());
    }
}
