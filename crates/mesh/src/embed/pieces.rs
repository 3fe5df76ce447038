//! From voxels to tetrahedra: a cell is there once for every part of the body within it.

use super::grid::{Grid, SIDE, Voxels, lower, parts, upper};
use crate::mesh::Mesh;

/// A cell of the grid with the voxels that it keeps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    pub key: u64,
    pub touched: Voxels,
    pub inside: Voxels, // by their centres
}

/// A cell cut down to one part: voxels of it that hang together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub key: u64,
    pub voxels: Voxels,
    pub inside: Voxels,
}

/// The pieces of cells (ascending by key), each with 8 corners, and which corners are one node: those of neighbours whose
/// voxels meet at their common face. Nesme, Kry, Jerabkova and Faure 2009.
pub(super) struct Pieces {
    pub pieces: Vec<Piece>,
    corners: Forest, // 8 a piece; corner c stands at (c & 1, c >> 1 & 1, c >> 2)
    bodies: Forest,  // one a piece: what hangs together
}

impl Pieces {
    pub fn new(grid: &Grid, cells: &[Cell]) -> Pieces {
        let mut pieces = Vec::with_capacity(cells.len());
        for c in cells {
            for voxels in parts(c.touched | c.inside) {
                pieces.push(Piece { key: c.key, voxels, inside: c.inside & voxels });
            }
        }
        let mut out = Pieces { corners: Forest::new(8 * pieces.len()), bodies: Forest::new(pieces.len()), pieces };
        for a in 0..out.pieces.len() {
            let piece = out.pieces[a];
            let at = grid.of_key(piece.key);
            for axis in 0..3 {
                let face = upper(piece.voxels, axis);
                if face == 0 || at[axis] + 1 == grid.cells[axis] {
                    continue;
                }
                let mut next = at;
                next[axis] += 1;
                for b in out.of_cell(grid.key(next)) {
                    if face & lower(out.pieces[b].voxels, axis) != 0 {
                        out.join(a, b, axis);
                    }
                }
            }
        }
        out
    }

    /// The pieces of a cell.
    pub fn of_cell(&self, key: u64) -> std::ops::Range<usize> {
        let first = self.pieces.partition_point(|p| p.key < key);
        let count = self.pieces[first..].iter().take_while(|p| p.key == key).count();
        first..first + count
    }

    /// The piece of a cell that has this voxel.
    pub fn with_voxel(&self, key: u64, voxel: Voxels) -> Option<usize> {
        self.of_cell(key).find(|&p| self.pieces[p].voxels & voxel != 0)
    }

    fn join(&mut self, a: usize, b: usize, axis: usize) {
        self.bodies.join(a as u32, b as u32);
        for corner in (0..8usize).filter(|c| c >> axis & 1 == 1) {
            self.corners.join((8 * a + corner) as u32, (8 * b + (corner ^ (1 << axis))) as u32);
        }
    }

    /// Leaves out bodies in which no piece is `used`, and returns the new number of each piece.
    fn numbered(&mut self, used: &[bool]) -> Vec<Option<u32>> {
        let mut keep = vec![false; used.len()];
        for (p, _) in used.iter().enumerate().filter(|u| *u.1) {
            keep[self.bodies.root(p as u32) as usize] = true;
        }
        let mut next = 0;
        (0..used.len())
            .map(|p| {
                keep[self.bodies.root(p as u32) as usize].then(|| {
                    next += 1;
                    next - 1
                })
            })
            .collect()
    }

    /// Six tetrahedra for every piece of a body in which some piece is `used`; and the new number of each piece.
    pub fn lattice(&mut self, grid: &Grid, used: &[bool]) -> (Mesh, Vec<Option<u32>>) {
        const NONE: u32 = u32::MAX;
        let numbers = self.numbered(used);
        let mut node_of = vec![NONE; 8 * self.pieces.len()];
        let (mut points, mut tets) = (Vec::new(), Vec::new());
        for p in (0..self.pieces.len()).filter(|&p| numbers[p].is_some()) {
            let at = grid.of_key(self.pieces[p].key);
            let mut nodes = [0; 8];
            for (corner, node) in nodes.iter_mut().enumerate() {
                let root = self.corners.root((8 * p + corner) as u32) as usize;
                if node_of[root] == NONE {
                    node_of[root] = points.len() as u32;
                    let place = [0, 1, 2].map(|d| (SIDE * (at[d] + (corner >> d & 1))) as f64);
                    points.push(grid.point(place));
                }
                *node = node_of[root];
            }
            tets.extend((0..PATHS.len()).map(|path| tetrahedron(path).map(|corner| nodes[corner])));
        }
        (Mesh::from_tets("lattice", points, tets), numbers)
    }
}

/// The orders of the axes along which a path leads from corner 0 of a cube to corner 7: each is one of the six
/// tetrahedra of Kuhn 1960, those at even places positively oriented along the path.
const PATHS: [[usize; 3]; 6] = [[0, 1, 2], [1, 0, 2], [1, 2, 0], [2, 1, 0], [2, 0, 1], [0, 2, 1]];

/// The corners of the cube that tetrahedron `path` has, positively oriented.
fn tetrahedron(path: usize) -> [usize; 4] {
    let [a, b, _] = PATHS[path];
    oriented(path, [0, 1 << a, 1 << a | 1 << b, 7])
}

/// What stands along the path, in the order of the corners of the tetrahedron.
fn oriented<T>(path: usize, [a, b, c, d]: [T; 4]) -> [T; 4] {
    if path.is_multiple_of(2) { [a, b, c, d] } else { [a, c, b, d] }
}

/// The tetrahedron of the unit cube that holds u, and the barycentric coordinates of u there. With u_a >= u_b >= u_c they
/// are 1 - u_a, u_a - u_b, u_b - u_c, u_c along the path a, b, c: none is negative.
pub(super) fn locate(u: [f64; 3]) -> (usize, [f64; 4]) {
    let descends = |p: &[usize; 3]| u[p[0]] >= u[p[1]] && u[p[1]] >= u[p[2]];
    let path = PATHS.iter().position(descends).unwrap_or(0); // one of the six orders always does
    let [a, b, c] = PATHS[path].map(|d| u[d]);
    (path, oriented(path, [1.0 - a, a - b, b - c, c]))
}

/// Disjoint sets, each named by its smallest member.
struct Forest(Vec<u32>);

impl Forest {
    fn new(n: usize) -> Forest {
        Forest((0..n as u32).collect())
    }

    fn root(&mut self, mut v: u32) -> u32 {
        while self.0[v as usize] != v {
            let up = self.0[self.0[v as usize] as usize];
            self.0[v as usize] = up;
            v = up;
        }
        v
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::volume;

    #[test]
    fn every_point_of_the_cube_lies_in_its_tetrahedron() {
        let corner = |c: usize| [0, 1, 2].map(|d| (c >> d & 1) as f64);
        for n in 0..1000 {
            let u = [n % 10, n / 10 % 10, n / 100].map(|i| i as f64 / 9.0);
            let (path, w) = locate(u);
            let tet = tetrahedron(path).map(corner);
            assert!(volume(tet) > 0.16);
            assert!(w.iter().all(|&w| w >= 0.0) && (w.iter().sum::<f64>() - 1.0).abs() < 1e-15);
            for d in 0..3 {
                let x: f64 = (0..4).map(|k| w[k] * tet[k][d]).sum();
                assert!((x - u[d]).abs() < 1e-15, "{u:?}");
            }
        }
    }
}
