//! Assembly of fronts: matrix entries, then what children pass on.

use super::front::FrontMemory;
use super::layout::Front;
use super::symbolic::Entry;
use super::vector::{Kernel, Route, Scalar, Vector};

/// Place of (row, column) of the panel.
#[inline(always)]
fn panel_place(front: &Front, row: usize, column: usize) -> usize {
    front.block_start(row / front.lanes) * front.lanes + column * front.lanes + row % front.lanes
}

/// Unknowns of a vertex, at most.
pub(super) const MOST: usize = 3;

/// Zeroes the panel and adds the matrix entries, in blocks of `block` x `block` by rows, scaled by `scale(row)`
/// and `scale(column)` of the front; keeps the diagonal for the pivot test. The first entry that is not finite is returned, with its value.
///
/// # Safety
/// Memory of the size of the front; slots within `values`.
pub(super) unsafe fn add_entries<T: Scalar>(
    memory: &FrontMemory<T>,
    entries: &[Entry],
    values: &[f64],
    block: usize,
    scale: impl Fn(usize) -> f64,
) -> Result<(), (usize, usize, f64)> {
    let front = &memory.front;
    let count = front.panel_lines() * T::LANES;
    // SAFETY: the panel has `count` values; entries lie in its trapezoid.
    unsafe {
        std::ptr::write_bytes(memory.panel, 0, count);
        for entry in entries {
            let from = &values[entry.slot * block * block..][..block * block];
            let (row, column) = (entry.row as usize * block, entry.column as usize * block);
            let mut scales = [1.0; MOST];
            for (c, scale_of_column) in scales[..block].iter_mut().enumerate() {
                *scale_of_column = scale(column + c);
            }
            let (down, across) = if entry.transposed { (1, block) } else { (block, 1) };
            for r in 0..block {
                let columns = if row == column { r + 1 } else { block };
                let to = memory.panel.add(panel_place(front, row + r, column));
                let scale_of_row = scale(row + r);
                for c in 0..columns {
                    let value = from[r * down + c * across];
                    if !value.is_finite() {
                        return Err((row + r, column + c, value));
                    }
                    // May overflow where the matrix is far from positive definite; its pivot then says so.
                    *to.add(c * T::LANES) = T::from_f64(value * (scale_of_row * scales[c]));
                }
            }
        }
        for k in 0..front.w {
            *memory.diagonal().add(k) = *memory.panel.add(panel_place(front, k, k));
        }
    }
    Ok(())
}

/// Which part of the parent's front receives.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Panel,
    Update,
}

/// Adds the update matrix of a child to its parent. `relative[i]` is the place of the child's row w + i in
/// the parent's front; it ascends, so the columns that meet the panel are a prefix.
///
/// Both fronts are whole; `relative` has one entry per row below the child, within the parent.
pub(super) struct AddChild<'a, T> {
    pub child: Front,
    pub update: *const T,
    pub relative: &'a [u32],
    pub parent: FrontMemory<T>,
    pub part: Part,
}

/// Rows of a block of the child that meet one block of the parent.
#[derive(Clone, Copy)]
struct Segment<R> {
    /// First lane of the child's block.
    first: usize,
    /// Lanes of the parent's block.
    lanes: u16,
    /// First value of the parent's block.
    start: usize,
    route: R,
}

impl<T: Scalar> Kernel<T> for AddChild<'_, T> {
    type Output = ();
    #[inline(always)]
    unsafe fn run<V: Vector<T>>(self) {
        let AddChild { child, update, relative, parent, part } = self;
        let lanes = T::LANES;
        let front = &parent.front;
        let lead = child.w - child.update_block() * lanes; // unused leading rows of the update matrix
        let split = relative.partition_point(|&r| (r as usize) < front.w);
        let first_row = front.update_block() * lanes;
        let (columns, target, shift) = match part {
            Part::Panel => (0..split, parent.panel, 0),
            Part::Update => (split..relative.len(), parent.update, first_row),
        };
        if columns.is_empty() {
            return;
        }
        // SAFETY: rows and columns lie in the parent's trapezoid, since rows >= columns in child and parent.
        unsafe {
            for block in (lead + columns.start) / lanes..child.update_blocks() {
                let begin = (lead + columns.start).saturating_sub(block * lanes);
                let end = (lead + relative.len() - block * lanes).min(lanes);
                let mut segments = [Segment { first: 0, lanes: 0, start: 0, route: V::routed(&Route::default()) }; 16];
                let mut count = 0;
                let mut l = begin;
                while l < end {
                    let (first, mut mask, mut route) = (l, 0u16, Route::default());
                    let of = relative[block * lanes + l - lead] as usize / lanes;
                    while l < end {
                        let row = relative[block * lanes + l - lead] as usize;
                        if row / lanes != of {
                            break;
                        }
                        mask |= 1 << (row % lanes);
                        route.from[row % lanes] = l as u8;
                        l += 1;
                    }
                    let start = match part {
                        Part::Panel => front.block_start(of),
                        Part::Update => front.update_start(of - first_row / lanes),
                    };
                    segments[count] = Segment { first, lanes: mask, start: start * lanes, route: V::routed(&route) };
                    count += 1;
                }
                let source = update.add(child.update_start(block) * lanes);
                // Columns left of the block's own rows: all its rows are below them.
                let whole = (block * lanes + begin - lead).clamp(columns.start, columns.end);
                for j in columns.start..whole {
                    let from = V::load(source.add((lead + j) * lanes));
                    let to = target.add((relative[j] as usize - shift) * lanes);
                    for segment in &segments[..count] {
                        from.add_routed(segment.route, segment.lanes, to.add(segment.start));
                    }
                }
                // And those of its rows: only what is on the diagonal or below.
                for j in whole..columns.end.min(block * lanes + end - lead) {
                    let from = V::load(source.add((lead + j) * lanes));
                    let to = target.add((relative[j] as usize - shift) * lanes);
                    let above = lead + j - block * lanes; // lanes of the child's block above the diagonal
                    for segment in &segments[..count] {
                        let mut open = segment.lanes;
                        for _ in segment.first..above {
                            open &= open.wrapping_sub(1);
                        }
                        if open != 0 {
                            from.add_routed(segment.route, open, to.add(segment.start));
                        }
                    }
                }
            }
        }
    }
}
