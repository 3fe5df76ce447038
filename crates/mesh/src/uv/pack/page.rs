//! The page as a bitmap, and where a mask fits on it.

use super::bitmap::{Bitmap, next_bit};
use super::raster::Mask;

/// A square of cells with a margin around it that stays empty.
///
/// `levels[k]` has a bit wherever any of the 2^k cells from there on is covered, so that a run of any length is
/// compared with a row by two shifted words: one from its start, one up to its end.
pub(super) struct Page {
    side: usize,
    margin: usize,
    stride: usize,
    levels: Vec<Vec<u64>>, // each of side + 2 margin rows of as many bits and some that stay clear
    widest: Vec<u32>,      // the longest run of free cells of each row
    blocked: Vec<u64>,
}

impl Page {
    /// An empty page for masks whose runs are at most `longest`.
    pub fn new(side: usize, margin: usize, longest: usize) -> Self {
        let rows = side + 2 * margin;
        // Shifted reads go at most three words beyond the last bit.
        let stride = rows / 64 + 4;
        let levels = longest.max(1).ilog2() as usize + 1;
        Page {
            side,
            margin,
            stride,
            levels: vec![vec![0; stride * rows]; levels],
            widest: vec![rows as u32; rows],
            blocked: Vec::new(),
        }
    }

    /// The lowest place for a mask, of these the leftmost, whose top is below `below` (in rows).
    pub fn find(&mut self, mask: &Mask, below: usize) -> Option<[usize; 2]> {
        if mask.width > self.side || mask.height > self.side {
            return None;
        }
        let last = self.side.min(below.saturating_sub(1)).checked_sub(mask.height)?;
        // What blocks one row tends to block the next one: it is tried first.
        let mut order = tried_in_order(mask.grown.len());
        for y in 0..=last {
            let first = order.first().map(|&i| mask.grown[i as usize]);
            if first.is_some_and(|run| self.widest[y + run.row as usize] < run.len) {
                continue; // most rows of a page that is nearly full
            }
            if let Some(x) = self.find_in_row(mask, y, &mut order) {
                return Some([x, y]);
            }
        }
        None
    }

    /// The leftmost place in a row. All places are tried at once, 64 in a word: those are blocked from which some run
    /// of the mask meets a covered cell.
    fn find_in_row(&mut self, mask: &Mask, y: usize, order: &mut [u32]) -> Option<usize> {
        let places = self.side - mask.width + 1;
        let mut free = 0..places.div_ceil(64); // words where some bits may be free
        self.blocked.clear();
        self.blocked.resize(free.end, 0);
        if !places.is_multiple_of(64) {
            self.blocked[free.end - 1] = u64::MAX << (places % 64);
        }
        for i in 0..order.len() {
            let run = mask.grown[order[i] as usize];
            let (row, len) = (y + run.row as usize, run.len as usize);
            if self.widest[row] as usize >= len {
                if self.widest[row] as usize == self.side + 2 * self.margin {
                    continue; // nothing is there
                }
                let level = len.ilog2() as usize;
                let words = &self.levels[level][row * self.stride..][..self.stride];
                let start = run.start as usize;
                block(&mut self.blocked[free.clone()], words, 64 * free.start + start);
                if len > 1 << level {
                    block(&mut self.blocked[free.clone()], words, 64 * free.start + start + len - (1 << level));
                }
                while free.start < free.end && self.blocked[free.start] == u64::MAX {
                    free.start += 1;
                }
                while free.start < free.end && self.blocked[free.end - 1] == u64::MAX {
                    free.end -= 1;
                }
                if !free.is_empty() {
                    continue;
                }
            }
            order[..=i].rotate_right(1);
            return None;
        }
        next_bit(&self.blocked, 64 * free.start, false)
    }

    /// Covers the cells of a mask.
    pub fn put(&mut self, solid: &Bitmap, [x, y]: [usize; 2]) {
        let x = x + self.margin;
        for j in 0..solid.height {
            let row = y + self.margin + j;
            let range = row * self.stride..(row + 1) * self.stride;
            let words = &mut self.levels[0][range.clone()];
            for (w, &bits) in solid.row(j).iter().enumerate() {
                words[w + x / 64] |= bits << (x % 64);
                if !x.is_multiple_of(64) {
                    words[w + x / 64 + 1] |= bits >> (64 - x % 64);
                }
            }
            self.widest[row] = widest_gap(words, self.side + 2 * self.margin);
            for k in 1..self.levels.len() {
                let (lower, upper) = self.levels.split_at_mut(k);
                let (from, to) = (&lower[k - 1][range.clone()], &mut upper[0][range.clone()]);
                to.copy_from_slice(from);
                block(to, from, 1 << (k - 1));
            }
        }
    }
}

/// Sets the bits of `to` for which the bits of `from`, `shift` further on, are set.
fn block(to: &mut [u64], from: &[u64], shift: usize) {
    let (words, shift) = (shift / 64, shift % 64);
    let from = from.get(words..).unwrap_or(&[]);
    if shift == 0 {
        to.iter_mut().zip(from).for_each(|(t, f)| *t |= f);
        return;
    }
    let n = to.len().min(from.len().saturating_sub(1));
    for (t, f) in to[..n].iter_mut().zip(from.windows(2)) {
        *t |= f[0] >> shift | f[1] << (64 - shift);
    }
    if let (Some(t), Some(f)) = (to.get_mut(n), from.get(n)) {
        *t |= f >> shift;
    }
}

/// 0 to n - 1 such that the first few are spread over all: in the order of their bits read backward.
fn tried_in_order(n: usize) -> Vec<u32> {
    let bits = n.next_power_of_two().ilog2();
    let reversed = |i: u32| if bits == 0 { 0 } else { i.reverse_bits() >> (32 - bits) };
    (0..1 << bits).map(reversed).filter(|&i| (i as usize) < n).collect()
}

fn widest_gap(row: &[u64], width: usize) -> u32 {
    let (mut widest, mut x) = (0, 0);
    while let Some(start) = next_bit(row, x, false).filter(|&s| s < width) {
        x = next_bit(row, start, true).unwrap_or(width).min(width);
        widest = widest.max(x - start);
    }
    widest as u32
}
