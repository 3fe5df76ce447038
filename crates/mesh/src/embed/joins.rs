//! Where a lattice joins what the surface parts: sheets that face each other across a gap too narrow for the voxels.

use super::grid::{Grid, Voxels, middle};
use super::pieces::Pieces;
use super::raster::Touch;
use crate::topology::Csr;
use crate::vec3::{V3, add, cross, dot, norm, scale, sub};
use std::collections::{BTreeMap, BTreeSet};

/// Two sheets of the surface, in front of each other, in one piece of a cell, though far apart along the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Join {
    /// A face of one sheet.
    pub a: u32,
    /// A face of the other.
    pub b: u32,
    /// Where: the middle of the cell.
    pub place: [f64; 3],
}

/// A sheet in a piece: triangles that hang together within the cell.
struct Sheet {
    triangle: u32,
    normal: V3, // sum of unit normals over voxels
    middle: V3, // of its voxels
}

/// One join for each piece that has any, in the order of cells; `a` and `b` are still triangles.
pub(super) fn find(
    grid: &Grid,
    pieces: &Pieces,
    touches: &[Touch],
    points: &[V3],
    triangles: &[[u32; 3]],
    at_vertex: &Csr,
) -> Vec<Join> {
    let mut out = Vec::new();
    for group in touches.chunk_by(|a, b| a.cell == b.cell) {
        let key = group[0].cell;
        for p in pieces.of_cell(key) {
            let sheets = sheets(group, pieces.pieces[p].voxels, points, triangles);
            let pairs = (1..sheets.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
            for (a, b) in pairs {
                let (a, b) = (&sheets[a], &sheets[b]);
                if face_each_other(a, b) && !near(grid, key, a.triangle, b.triangle, points, triangles, at_vertex) {
                    let place = grid.point(grid.of_key(key).map(|i| (i * super::grid::SIDE + 2) as f64));
                    out.push(Join { a: a.triangle, b: b.triangle, place });
                    break;
                }
            }
        }
    }
    out
}

fn sheets(group: &[Touch], voxels: Voxels, points: &[V3], triangles: &[[u32; 3]]) -> Vec<Sheet> {
    let here: Vec<&Touch> = group.iter().filter(|t| t.voxels & voxels != 0).collect();
    // Triangles that share a vertex are one sheet: the smallest number names it.
    let mut sheet: Vec<usize> = (0..here.len()).collect();
    let mut first_at: BTreeMap<u32, usize> = BTreeMap::new();
    fn root(sheet: &[usize], mut i: usize) -> usize {
        while sheet[i] != i {
            i = sheet[i];
        }
        i
    }
    for i in 0..here.len() {
        for v in triangles[here[i].triangle as usize] {
            let j = *first_at.entry(v).or_insert(i);
            let (a, b) = (root(&sheet, i), root(&sheet, j));
            sheet[a.max(b)] = a.min(b);
        }
    }
    let mut out: BTreeMap<usize, (Sheet, Voxels)> = BTreeMap::new();
    for (i, t) in here.iter().enumerate() {
        let [a, b, c] = triangles[t.triangle as usize].map(|v| points[v as usize]);
        let n = cross(sub(b, a), sub(c, a));
        let length = norm(n);
        let weight = if length > 0.0 { f64::from(t.voxels.count_ones()) / length } else { 0.0 };
        let new = || (Sheet { triangle: t.triangle, normal: [0.0; 3], middle: [0.0; 3] }, 0);
        let (s, v) = out.entry(root(&sheet, i)).or_insert_with(new);
        s.normal = add(s.normal, scale(weight, n));
        *v |= t.voxels & voxels;
    }
    out.into_values().map(|(s, v)| Sheet { middle: middle(v), ..s }).collect()
}

/// Whether each lies in front of the other: what is between them is outside. Behind each other they bound a thin part.
fn face_each_other(a: &Sheet, b: &Sheet) -> bool {
    let way = sub(b.middle, a.middle);
    dot(way, a.normal) > 0.0 && dot(way, b.normal) < 0.0
}

/// Whether a path along the surface leads from one triangle to the other within the cells around this one: then they
/// are two sides of a crease, and belong together.
fn near(grid: &Grid, key: u64, from: u32, to: u32, points: &[V3], triangles: &[[u32; 3]], at_vertex: &Csr) -> bool {
    let at = grid.of_key(key);
    let side = super::grid::SIDE as f64;
    let low = grid.point(at.map(|i| (i as f64 - 1.0) * side));
    let high = grid.point(at.map(|i| (i as f64 + 2.0) * side));
    let meets = |t: u32| {
        let t = triangles[t as usize].map(|v| points[v as usize]);
        (0..3).all(|d| t.iter().any(|p| p[d] >= low[d]) && t.iter().any(|p| p[d] <= high[d]))
    };
    let mut seen = BTreeSet::from([from]);
    let mut open = vec![from];
    while let Some(t) = open.pop() {
        if t == to {
            return true;
        }
        for v in triangles[t as usize] {
            for &next in at_vertex.row(v as usize) {
                if meets(next) && seen.insert(next) {
                    open.push(next);
                }
            }
        }
    }
    false
}
