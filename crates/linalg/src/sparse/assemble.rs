//! Assembly of fronts: matrix entries, then what children pass on.

use super::front::FrontMemory;
use super::layout::Front;
use super::symbolic::Entry;
use super::vector::Scalar;

/// Place of (row, column) of the panel.
#[inline(always)]
fn panel_place(front: &Front, row: usize, column: usize) -> usize {
    front.block_start(row / front.lanes) * front.lanes + column * front.lanes + row % front.lanes
}

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
            for r in 0..block {
                let columns = if row == column { r + 1 } else { block };
                let to = memory.panel.add(panel_place(front, row + r, column));
                let scale_of_row = scale(row + r);
                for c in 0..columns {
                    let value = from[if entry.transposed { c * block + r } else { r * block + c }];
                    if !value.is_finite() {
                        return Err((row + r, column + c, value));
                    }
                    // May overflow where the matrix is far from positive definite; its pivot then says so.
                    let value = value * (scale_of_row * scale(column + c));
                    *to.add(c * T::LANES) = T::from_f64(value);
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
/// # Safety
/// Both fronts are whole; `relative` has one entry per row below the child, within the parent.
pub(super) unsafe fn add_child<T: Scalar>(
    child: &Front,
    update: *const T,
    relative: &[u32],
    parent: &FrontMemory<T>,
    part: Part,
) {
    let lanes = T::LANES;
    let front = &parent.front;
    let lead = child.w - child.update_block() * lanes; // unused leading rows of the update matrix
    let split = relative.partition_point(|&r| (r as usize) < front.w);
    let first_row = front.update_block() * lanes;
    let (columns, target, base, shift) = match part {
        Part::Panel => (0..split, parent.panel, 0, 0),
        Part::Update => (split..relative.len(), parent.update, first_row, first_row),
    };
    let start = |row: usize| match part {
        Part::Panel => front.block_start(row / lanes),
        Part::Update => front.update_start((row - base) / lanes),
    };
    if columns.is_empty() {
        return;
    }
    for block in (lead + columns.start) / lanes..child.update_blocks() {
        // Rows of this block, as indices into `relative`.
        let row_of = |l: usize| (block * lanes + l).wrapping_sub(lead);
        let begin = (lead + columns.start).saturating_sub(block * lanes);
        let end = (lead + relative.len() - block * lanes).min(lanes);
        let mut places = [0usize; 16];
        for l in begin..end {
            let row = relative[row_of(l)] as usize;
            places[l] = start(row) * lanes + row % lanes;
        }
        let aligned = begin == 0 && end == lanes && (1..lanes).all(|l| places[l] == places[0] + l);
        // SAFETY: places and columns lie in the parent's trapezoid, since rows >= columns in child and parent.
        unsafe {
            let source = update.add(child.update_start(block) * lanes);
            for j in columns.start..columns.end.min(row_of(end - 1) + 1) {
                let from = source.add((lead + j) * lanes);
                let to = target.add((relative[j] as usize - shift) * lanes);
                let l0 = (lead + j).saturating_sub(block * lanes);
                if aligned && l0 == 0 {
                    let to = to.add(places[0]);
                    for l in 0..lanes {
                        *to.add(l) = T::sum(*to.add(l), *from.add(l));
                    }
                } else {
                    for l in l0..end {
                        let to = to.add(places[l]);
                        *to = T::sum(*to, *from.add(l));
                    }
                }
            }
        }
    }
}
