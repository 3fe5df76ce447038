//! The grid of cells around a surface, each of 4 x 4 x 4 voxels: a set of voxels of a cell is one 64-bit word.

use crate::vec3::V3;

/// Voxels along the side of a cell.
pub(super) const SIDE: usize = 4;

/// Sets of voxels of one cell; bit x + 4 y + 16 z stands for the voxel (x, y, z).
pub(super) type Voxels = u64;

/// The voxels at the lower end of x, y and z.
const LOW: [Voxels; 3] = [0x1111_1111_1111_1111, 0x000f_000f_000f_000f, 0x0000_0000_0000_ffff];
/// From a voxel to the next along x, y and z, in bits.
const STEP: [u32; 3] = [1, 4, 16];

/// The bit of a voxel.
pub(super) fn bit([x, y, z]: [usize; 3]) -> Voxels {
    1 << (x + SIDE * (y + SIDE * z))
}

/// The voxels of `set` at the upper end of an axis, as voxels at the lower end of the next cell.
pub(super) fn upper(set: Voxels, axis: usize) -> Voxels {
    (set >> (3 * STEP[axis])) & LOW[axis]
}

/// The voxels of `set` at the lower end of an axis.
pub(super) fn lower(set: Voxels, axis: usize) -> Voxels {
    set & LOW[axis]
}

/// The voxels of `set` that hang together by faces with those of `seed`.
fn flood(seed: Voxels, set: Voxels) -> Voxels {
    let mut reached = seed & set;
    loop {
        let mut next = reached;
        for axis in 0..3 {
            let high = LOW[axis] << (3 * STEP[axis]);
            next |= (reached & !high) << STEP[axis];
            next |= (reached & !LOW[axis]) >> STEP[axis];
        }
        next &= set;
        if next == reached {
            return reached;
        }
        reached = next;
    }
}

/// The parts of `set` that hang together, in the order of their first voxels.
pub(super) fn parts(mut set: Voxels) -> impl Iterator<Item = Voxels> {
    let whole = set;
    std::iter::from_fn(move || {
        (set != 0).then(|| {
            let part = flood(set & set.wrapping_neg(), whole);
            set &= !part;
            part
        })
    })
}

/// The mean of the centres of some voxels, in voxels from the corner of the cell.
pub(super) fn middle(set: Voxels) -> V3 {
    let (mut sum, mut rest) = ([0.0; 3], set);
    while rest != 0 {
        let at = rest.trailing_zeros() as usize;
        for (d, s) in sum.iter_mut().enumerate() {
            *s += (at >> (2 * d) & 3) as f64 + 0.5;
        }
        rest &= rest - 1;
    }
    sum.map(|s| s / f64::from(set.count_ones().max(1)))
}

/// Cubic cells along the axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    origin: V3,
    /// The length of a cell's side.
    pub cell: f64,
    /// How many there are along x, y, z.
    pub cells: [usize; 3],
}

impl Grid {
    /// Around a box, with `resolution` cells along its longest side, which must not be 0. The grid is larger than the box
    /// by `MARGIN` of that side, so that rounding leaves nothing outside.
    pub fn new([low, high]: [V3; 2], resolution: usize) -> Grid {
        const MARGIN: f64 = 1e-6;
        let side = |d: usize| high[d] - low[d];
        let longest = side(0).max(side(1)).max(side(2));
        let cell = longest * (1.0 + MARGIN) / resolution as f64;
        let cells = [0, 1, 2].map(|d| (((side(d) + longest * MARGIN) / cell).ceil() as usize).clamp(1, resolution));
        let origin = [0, 1, 2].map(|d| low[d] + (side(d) - cell * cells[d] as f64) / 2.0);
        Grid { origin, cell, cells }
    }

    /// In voxels from the corner of the grid.
    pub fn local(&self, p: V3) -> V3 {
        [0, 1, 2].map(|d| (p[d] - self.origin[d]) / self.cell * SIDE as f64)
    }

    /// The point at these many voxels from the corner of the grid.
    pub fn point(&self, voxels: V3) -> V3 {
        [0, 1, 2].map(|d| self.origin[d] + voxels[d] / SIDE as f64 * self.cell)
    }

    /// The voxel of a local coordinate along an axis, the nearest one outside the grid.
    pub fn voxel(&self, local: f64, axis: usize) -> usize {
        (local.max(0.0) as usize).min(SIDE * self.cells[axis] - 1)
    }

    /// The number of a cell.
    pub fn key(&self, [i, j, k]: [usize; 3]) -> u64 {
        (i + self.cells[0] * (j + self.cells[1] * k)) as u64
    }

    /// The cell of a number.
    pub fn of_key(&self, key: u64) -> [usize; 3] {
        let (key, [nx, ny, _]) = (key as usize, self.cells);
        [key % nx, key / nx % ny, key / nx / ny]
    }

    /// The number of cells.
    pub fn len(&self) -> usize {
        self.cells.iter().product()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_hang_together_by_faces() {
        let two = bit([0, 0, 0]) | bit([1, 0, 0]) | bit([3, 3, 3]) | bit([3, 3, 2]) | bit([2, 2, 2]);
        assert_eq!(parts(two).collect::<Vec<_>>().len(), 3);
        assert_eq!(parts(two).fold(0, |a, b| a | b), two);
        // No neighbours around the corner of a row.
        assert_eq!(parts(bit([3, 0, 0]) | bit([0, 1, 0])).count(), 2);
        assert_eq!(parts(u64::MAX).collect::<Vec<_>>(), [u64::MAX]);
    }

    #[test]
    fn ends_of_cells_meet() {
        for axis in 0..3 {
            let mut at = [1, 2, 1];
            at[axis] = 3;
            let mut next = at;
            next[axis] = 0;
            assert_eq!(upper(bit(at), axis), bit(next));
            assert_eq!(lower(bit(next) | bit(at), axis), bit(next));
            assert_eq!(upper(bit(next), axis), 0);
        }
        assert_eq!(middle(bit([1, 2, 3]) | bit([1, 2, 1])), [1.5, 2.5, 2.5]);
    }

    #[test]
    fn the_box_lies_inside_at_any_place_and_scale() {
        for (offset, scale) in [(0.0, 1.0), (1e6, 1.0), (0.0, 1e-150), (-3.0, 1e150)] {
            let (low, high) = ([offset * scale; 3], [(offset + 1.0) * scale, (offset + 0.3) * scale, offset * scale]);
            let grid = Grid::new([low, high], 10);
            assert_eq!(grid.cells, [10, 4, 1]);
            for p in [low, high] {
                let q = grid.local(p);
                for d in 0..3 {
                    assert!(q[d] > 0.0 && q[d] < (SIDE * grid.cells[d]) as f64, "{q:?}");
                }
            }
            assert_eq!(grid.of_key(grid.key([7, 3, 0])), [7, 3, 0]);
        }
    }
}
