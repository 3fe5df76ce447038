//! Bits in rows of 64-bit words.

/// A bit for each cell of a grid.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Bitmap {
    pub width: usize,
    pub height: usize,
    stride: usize, // words in a row
    words: Vec<u64>,
}

/// Set bits `start .. start + len` of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    pub row: u32,
    pub start: u32,
    pub len: u32,
}

impl Bitmap {
    /// All bits clear.
    pub fn new(width: usize, height: usize) -> Self {
        let stride = width.div_ceil(64);
        Bitmap { width, height, stride, words: vec![0; stride * height] }
    }

    pub fn row(&self, y: usize) -> &[u64] {
        &self.words[y * self.stride..][..self.stride]
    }

    /// Sets the bits lo ..= hi of a row, as far as they are in it.
    pub fn set(&mut self, y: i64, lo: i64, hi: i64) {
        let (lo, hi) = (lo.max(0), hi.min(self.width as i64 - 1));
        if lo > hi || y < 0 || y >= self.height as i64 {
            return;
        }
        let (first, last) = (lo as usize / 64, hi as usize / 64);
        let row = &mut self.words[y as usize * self.stride..][..self.stride];
        for (w, word) in row.iter_mut().enumerate().take(last + 1).skip(first) {
            let from = if w == first { lo as usize % 64 } else { 0 };
            let to = if w == last { hi as usize % 64 } else { 63 };
            *word |= (u64::MAX << from) & (u64::MAX >> (63 - to));
        }
    }

    /// The runs of set bits, by rows and from left to right.
    pub fn runs(&self) -> Vec<Run> {
        let mut runs = Vec::new();
        for y in 0..self.height {
            let row = self.row(y);
            let mut x = 0;
            while let Some(start) = next_bit(row, x, true) {
                let end = next_bit(row, start, false).unwrap_or(64 * self.stride).min(self.width);
                runs.push(Run { row: y as u32, start: start as u32, len: (end - start) as u32 });
                x = end;
            }
        }
        runs
    }

    /// Turned by 90 degrees counter-clockwise, y upward: (x, y) goes to (height - 1 - y, x).
    pub fn turned(&self) -> Bitmap {
        let mut out = Bitmap::new(self.height, self.width);
        for run in self.runs() {
            let x = self.height - 1 - run.row as usize;
            for y in run.start as usize..(run.start + run.len) as usize {
                out.words[y * out.stride + x / 64] |= 1 << (x % 64);
            }
        }
        out
    }
}

/// The first bit from `from` on that is set (or clear).
pub(super) fn next_bit(row: &[u64], from: usize, set: bool) -> Option<usize> {
    let mut mask = u64::MAX << (from % 64);
    for (w, &word) in row.iter().enumerate().skip(from / 64) {
        let found = if set { word } else { !word } & mask;
        if found != 0 {
            return Some(64 * w + found.trailing_zeros() as usize);
        }
        mask = u64::MAX;
    }
    None
}
