//! Which voxels a surface touches.

use super::grid::{Grid, SIDE, Voxels, bit};
use crate::vec3::{V3, cross, dot, sub};
use rayon::prelude::*;

/// Triangles a task; fixed, so that the order of what comes out is too.
const CHUNK: usize = 512;
/// How much larger than itself a box is taken, in voxels: more than the rounding of coordinates in the largest grid, so
/// that no touch is missed.
const SLACK: f64 = 1e-9;

/// A triangle in a cell, and the voxels there that it touches.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touch {
    pub cell: u64,
    pub triangle: u32,
    pub voxels: Voxels,
}

/// All touches, by cell and then by triangle. `local` are the points in voxels.
pub(super) fn touches(grid: &Grid, local: &[V3], triangles: &[[u32; 3]]) -> Vec<Touch> {
    let chunks: Vec<Vec<Touch>> = triangles
        .par_chunks(CHUNK)
        .enumerate()
        .map(|(chunk, triangles)| {
            let mut out = Vec::new();
            for (i, t) in triangles.iter().enumerate() {
                let number = (chunk * CHUNK + i) as u32;
                touch(grid, t.map(|v| local[v as usize]), |cell, voxels| {
                    out.push(Touch { cell, triangle: number, voxels });
                });
            }
            out
        })
        .collect();
    let mut all = chunks.concat();
    all.par_sort_unstable_by_key(|t| (t.cell, t.triangle));
    all
}

/// Calls `found` with the cells that a triangle touches: cell by cell, then voxel by voxel inside.
fn touch(grid: &Grid, t: [V3; 3], mut found: impl FnMut(u64, Voxels)) {
    let (mut first, mut last) = ([0; 3], [0; 3]);
    for d in 0..3 {
        let low = t[0][d].min(t[1][d]).min(t[2][d]);
        let high = t[0][d].max(t[1][d]).max(t[2][d]);
        first[d] = grid.voxel(low - SLACK, d);
        last[d] = grid.voxel(high + SLACK, d);
    }
    let cell = |voxel: [usize; 3]| voxel.map(|v| v / SIDE);
    if first == last {
        return found(grid.key(cell(first)), bit(first.map(|v| v % SIDE)));
    }
    let ([i0, j0, k0], [i1, j1, k1]) = (cell(first), cell(last));
    for k in k0..=k1 {
        for j in j0..=j1 {
            for i in i0..=i1 {
                let corner = [SIDE * i, SIDE * j, SIDE * k];
                if !overlaps(t, corner.map(|v| (v + SIDE / 2) as f64), (SIDE / 2) as f64) {
                    continue;
                }
                let from = [0, 1, 2].map(|d| first[d].max(corner[d]));
                let to = [0, 1, 2].map(|d| last[d].min(corner[d] + SIDE - 1));
                let mut voxels = 0;
                for z in from[2]..=to[2] {
                    for y in from[1]..=to[1] {
                        for x in from[0]..=to[0] {
                            let at = [x, y, z];
                            if overlaps(t, at.map(|v| v as f64 + 0.5), 0.5) {
                                voxels |= bit(at.map(|v| v % SIDE));
                            }
                        }
                    }
                }
                if voxels != 0 {
                    found(grid.key([i, j, k]), voxels);
                }
            }
        }
    }
}

/// Whether a triangle and a cube of half side `half` have a point in common, up to `SLACK`: no axis of the 13 that
/// matter separates them. Akenine-Moller 2001.
fn overlaps(t: [V3; 3], center: V3, half: f64) -> bool {
    let half = half + SLACK;
    let v = t.map(|p| sub(p, center));
    for d in 0..3 {
        if v.iter().all(|p| p[d] > half) || v.iter().all(|p| p[d] < -half) {
            return false;
        }
    }
    let edges = [sub(v[1], v[0]), sub(v[2], v[1]), sub(v[0], v[2])];
    let separates = |axis: V3| {
        let at = v.map(|p| dot(p, axis));
        let reach = half * (axis[0].abs() + axis[1].abs() + axis[2].abs());
        at.iter().all(|&x| x > reach) || at.iter().all(|&x| x < -reach)
    };
    if separates(cross(edges[0], edges[1])) {
        return false;
    }
    !edges.iter().any(|&[x, y, z]| separates([0.0, -z, y]) || separates([z, 0.0, -x]) || separates([-y, x, 0.0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlap_against_sampling() {
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            2.4 * ((state >> 11) as f64 / (1u64 << 52) as f64 - 1.0)
        };
        let mut seen = [0, 0];
        for _ in 0..2000 {
            let t = [0; 3].map(|_| [0; 3].map(|_| next()));
            let n = 40;
            let hit = (0..=n).flat_map(|i| (0..=n - i).map(move |j| (i, j))).any(|(i, j)| {
                let (a, b) = (i as f64 / n as f64, j as f64 / n as f64);
                (0..3).all(|d| (t[0][d] + a * (t[1][d] - t[0][d]) + b * (t[2][d] - t[0][d])).abs() <= 0.5)
            });
            let says = overlaps(t, [0.0; 3], 0.5);
            assert!(says || !hit, "{t:?} is missed");
            // What sampling misses is near: within a sample's distance of the box.
            seen[usize::from(hit)] += usize::from(says == hit);
        }
        assert!(seen[0] + seen[1] > 1940 && seen[1] > 200, "{seen:?}");
    }

    #[test]
    fn a_large_triangle_touches_a_sheet_of_voxels() {
        let grid = Grid::new([[0.0; 3], [1.0; 3]], 8);
        let points = [[0.0, 0.0, 0.52], [1.0, 0.0, 0.52], [0.0, 1.0, 0.52]];
        let local = points.map(|p| grid.local(p));
        let all = touches(&grid, &local, &[[0, 1, 2]]);
        let count: u32 = all.iter().map(|t| t.voxels.count_ones()).sum();
        // Half of 32 x 32 voxels and the diagonal.
        assert!((512..=512 + 2 * 32).contains(&count), "{count}");
        assert!(all.windows(2).all(|w| w[0].cell < w[1].cell));
    }
}
