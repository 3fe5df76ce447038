//! The discrete Fourier transform of real fields in two dimensions.

use crate::grid::TILE_ROWS;
use proxel_split::Taker;
use rayon::prelude::*;
use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

/// Columns of a spectrum that are handled together: a row's part of them is two cache lines.
const BLOCK: usize = 8;
/// Rows that are handled together: a column's part of them is two cache lines, a block of columns' part of them 1 KiB.
const ROWS: usize = TILE_ROWS;
/// Complex numbers between columns, so that columns of a power of two do not share cache sets.
const PAD: usize = 4;

/// Plans for one size. The spectrum of a real field has `width / 2 + 1` columns of `height` numbers; those left out are
/// conjugates. Neither direction is normalised: back and forth multiplies by the number of pixels.
#[derive(Clone)]
pub struct Fourier {
    width: usize,
    height: usize,
    rows: Arc<dyn RealToComplex<f64>>,
    rows_back: Arc<dyn ComplexToReal<f64>>,
    columns: Arc<dyn Fft<f64>>,
    columns_back: Arc<dyn Fft<f64>>,
}

/// Room for the spectra of some fields: 16 bytes a pixel and field.
///
/// Between rows and columns numbers pass in tiles of `ROWS` by `BLOCK`, each of them contiguous, so that neither side
/// reads or writes memory in pieces.
#[derive(Default)]
pub struct Spectra {
    rows: Vec<Vec<Complex<f64>>>, // a field: a task of rows after another, in each the tiles of all blocks
    blocks: Vec<Vec<Complex<f64>>>, // a block of columns: a field after another, in each row by row
    sums: Vec<f64>,
}

/// Rows of a field that were taken one by one: their transforms, as [`Spectra`] has them.
#[derive(Default)]
pub struct Fed(Vec<Complex<f64>>);

impl Spectra {
    /// The room of the first field, for its rows to be taken one by one; none before the first use.
    pub fn give_rows(&mut self) -> Vec<Fed> {
        self.rows.first_mut().map(|rows| Fed(std::mem::take(rows))).into_iter().collect()
    }
}

/// What the transform of a row needs.
struct RowRoom {
    row: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

/// Takes some rows of all channels.
struct Rows<'a> {
    fourier: &'a Fourier,
    tiles: Vec<&'a mut [Complex<f64>]>, // of each channel
    room: RowRoom,
}

impl Taker for Rows<'_> {
    fn take(&mut self, row: usize, pull: &mut [f64]) {
        let (task, i) = (row / ROWS, row % ROWS);
        let len = self.fourier.task_len();
        for (channel, tiles) in pull.chunks_exact_mut(self.fourier.width).zip(&mut self.tiles) {
            self.fourier.row_forward(channel, i, &mut tiles[task * len..(task + 1) * len], &mut self.room);
        }
    }
}

/// A field within a vector of nodes: its channels alternate row by row.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// First node.
    pub first: usize,
    /// Nodes between successive rows.
    pub stride: usize,
}

/// What is done to one column of the spectra.
pub struct Column<'a, 'b, const K: usize> {
    /// Its index, 0 to width/2.
    pub j: usize,
    /// How often it counts: 2 where its conjugate is left out.
    pub multiplicity: f64,
    /// The numbers of each field, `height` long.
    pub fields: &'a mut [&'b mut [Complex<f64>]; K],
}

impl Fourier {
    /// For fields of this size, of at least one pixel.
    pub fn new(width: usize, height: usize) -> Self {
        let (mut real, mut complex) = (RealFftPlanner::new(), FftPlanner::new());
        Fourier {
            width,
            height,
            rows: real.plan_fft_forward(width),
            rows_back: real.plan_fft_inverse(width),
            columns: complex.plan_fft_forward(height),
            columns_back: complex.plan_fft_inverse(height),
        }
    }

    /// Columns of a spectrum.
    pub fn n_columns(&self) -> usize {
        self.width / 2 + 1
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Columns of a field.
    pub fn width(&self) -> usize {
        self.width
    }

    /// How often a column of the spectrum counts in a sum over all frequencies.
    pub fn multiplicity(&self, j: usize) -> f64 {
        if j == 0 || 2 * j == self.width { 1.0 } else { 2.0 }
    }

    /// The spectrum of a field, column by column.
    pub fn forward(&self, field: &[f64]) -> Vec<Complex<f64>> {
        let mut out = vec![Complex::default(); self.n_columns() * self.height];
        self.forward_to(&mut field.to_vec(), &mut Spectra::default(), &mut out);
        out
    }

    /// The same into room that there is; the field is used up.
    pub fn forward_to(&self, field: &mut [f64], work: &mut Spectra, out: &mut [Complex<f64>]) {
        self.rows_forward(field, &[Layout { first: 0, stride: self.width }], 0, work);
        let rows = &work.rows[0];
        let room = || (self.columns_room(1), self.columns_scratch());
        let blocks = out.par_chunks_mut(BLOCK * self.height).enumerate();
        blocks.for_each_init(room, |(columns, scratch), (block, out)| {
            self.to_columns(rows, block, columns);
            let room = columns.chunks_exact(self.height + PAD);
            for (column, out) in room.zip(out.chunks_exact_mut(self.height)) {
                out.copy_from_slice(&column[..self.height]);
                self.columns.process_with_scratch(out, scratch);
            }
        });
    }

    /// A field, times its number of pixels, from its spectrum.
    pub fn backward_to(&self, spectrum: &[Complex<f64>], work: &mut Spectra, to: &mut [f64]) {
        let (h, stride) = (self.height, self.height + PAD);
        work.blocks.resize_with(self.n_columns().div_ceil(BLOCK), Vec::new);
        let room = || (self.columns_room(1), self.columns_scratch());
        let blocks = work.blocks.par_iter_mut().zip(spectrum.par_chunks(BLOCK * h));
        blocks.for_each_init(room, |(columns, scratch), (out, spectrum)| {
            for (column, from) in columns.chunks_exact_mut(stride).zip(spectrum.chunks_exact(h)) {
                column[..h].copy_from_slice(from);
                self.columns_back.process_with_scratch(&mut column[..h], scratch);
            }
            out.resize(BLOCK * h, Complex::default());
            self.to_rows(columns, out);
        });
        self.rows_back(to, &[Layout { first: 0, stride: self.width }], work);
    }

    /// Numbers of a task of rows: columns are filled up to whole blocks.
    fn task_len(&self) -> usize {
        ROWS * BLOCK * self.n_columns().div_ceil(BLOCK)
    }

    /// Numbers from the first to the last of a field, between whose rows those of other channels stand.
    fn reach(&self, layout: &Layout) -> usize {
        (self.height - 1) * layout.stride + self.width
    }

    fn columns_room(&self, fields: usize) -> Vec<Complex<f64>> {
        vec![Complex::default(); fields * BLOCK * (self.height + PAD)]
    }

    fn columns_scratch(&self) -> Vec<Complex<f64>> {
        let length = self.columns.get_inplace_scratch_len().max(self.columns_back.get_inplace_scratch_len());
        vec![Complex::default(); length]
    }

    /// Rows of the fields but for the first few to tiles of their spectra. The fields are used up.
    fn rows_forward(&self, from: &mut [f64], layouts: &[Layout], skipped: usize, work: &mut Spectra) {
        work.rows.resize_with(layouts.len(), Vec::new);
        for (layout, rows) in layouts.iter().zip(&mut work.rows).skip(skipped) {
            rows.resize(self.task_len() * self.height.div_ceil(ROWS), Complex::default());
            let from = &mut from[layout.first..][..self.reach(layout)];
            let tasks = from.par_chunks_mut(ROWS * layout.stride).zip(rows.par_chunks_exact_mut(self.task_len()));
            tasks.for_each_init(
                || self.row_room(),
                |room, (from, tiles)| {
                    for (i, from) in from.chunks_mut(layout.stride).enumerate() {
                        self.row_forward(&mut from[..self.width], i, tiles, room);
                    }
                },
            );
        }
    }

    fn row_room(&self) -> RowRoom {
        RowRoom {
            row: vec![Complex::default(); self.n_columns()],
            scratch: vec![Complex::default(); self.rows.get_scratch_len()],
        }
    }

    /// The i-th row of a task to its tiles. The row is used up.
    fn row_forward(&self, from: &mut [f64], i: usize, tiles: &mut [Complex<f64>], room: &mut RowRoom) {
        // The lengths are those of the plan, which is all that can go wrong.
        let _ = self.rows.process_with_scratch(from, &mut room.row, &mut room.scratch);
        let (parts, rest) = room.row.as_chunks::<BLOCK>();
        let mut tiles = tiles.chunks_exact_mut(ROWS * BLOCK);
        for (part, tile) in parts.iter().zip(&mut tiles) {
            tile.as_chunks_mut::<BLOCK>().0[i] = *part;
        }
        if let Some(tile) = tiles.next() {
            tile[i * BLOCK..i * BLOCK + rest.len()].copy_from_slice(rest);
        }
    }

    /// Takers of `rows` rows each of the fields whose channels alternate row by row, for [`Fourier::filter_fed`]. None where
    /// that is no whole number of tiles.
    pub fn takers<'a>(&'a self, rows: usize, fields: &'a mut [Fed]) -> Option<Vec<Box<dyn Taker + 'a>>> {
        if rows == 0 || !rows.is_multiple_of(ROWS) && rows < self.height {
            return None;
        }
        let len = self.task_len() * rows.div_ceil(ROWS);
        let mut takers: Vec<Rows<'a>> = Vec::new();
        takers.resize_with(self.height.div_ceil(rows), || Rows {
            fourier: self,
            tiles: Vec::new(),
            room: self.row_room(),
        });
        for Fed(field) in fields {
            field.resize(self.task_len() * self.height.div_ceil(ROWS), Complex::default());
            takers.iter_mut().zip(field.chunks_mut(len)).for_each(|(taker, tiles)| taker.tiles.push(tiles));
        }
        Some(takers.into_iter().map(|taker| Box::new(taker) as Box<dyn Taker + 'a>).collect())
    }

    /// A block of columns out of tiles.
    fn to_columns(&self, rows: &[Complex<f64>], block: usize, columns: &mut [Complex<f64>]) {
        let stride = self.height + PAD;
        for (task, tiles) in rows.chunks_exact(self.task_len()).enumerate() {
            let (tile, first) = (&tiles[block * ROWS * BLOCK..(block + 1) * ROWS * BLOCK], task * ROWS);
            let tall = ROWS.min(self.height - first);
            for b in 0..BLOCK {
                let to = &mut columns[b * stride + first..b * stride + first + tall];
                for (i, to) in to.iter_mut().enumerate() {
                    *to = tile[i * BLOCK + b];
                }
            }
        }
    }

    /// A block of columns to rows of it.
    fn to_rows(&self, columns: &[Complex<f64>], out: &mut [Complex<f64>]) {
        let stride = self.height + PAD;
        for (task, out) in out.chunks_mut(ROWS * BLOCK).enumerate() {
            for (i, out) in out.as_chunks_mut::<BLOCK>().0.iter_mut().enumerate() {
                for b in 0..BLOCK {
                    out[b] = columns[b * stride + task * ROWS + i];
                }
            }
        }
    }

    /// Fields to spectra, `of` on every column, and back: one pass over columns that leaves none of them before it is done.
    /// `from` is used up; what `of` returns is summed up in the order of columns.
    pub fn filter<const K: usize>(
        &self,
        from: &mut [f64],
        to: &mut [f64],
        layouts: &[Layout; K],
        work: &mut Spectra,
        of: impl Fn(Column<'_, '_, K>) -> f64 + Sync,
    ) -> f64 {
        self.rows_forward(from, layouts, 0, work);
        self.filter_rows(to, layouts, work, of)
    }

    /// The same for fields of which the first is not in `from`: its rows were taken.
    pub fn filter_fed<const K: usize>(
        &self,
        first: &mut Fed,
        from: &mut [f64],
        to: &mut [f64],
        layouts: &[Layout; K],
        work: &mut Spectra,
        of: impl Fn(Column<'_, '_, K>) -> f64 + Sync,
    ) -> f64 {
        self.rows_forward(from, layouts, 1, work);
        let Some(rows) = work.rows.first_mut() else { return 0.0 };
        std::mem::swap(rows, &mut first.0);
        let sum = self.filter_rows(to, layouts, work, of);
        std::mem::swap(&mut work.rows[0], &mut first.0);
        sum
    }

    /// What follows the transforms of rows.
    fn filter_rows<const K: usize>(
        &self,
        to: &mut [f64],
        layouts: &[Layout; K],
        work: &mut Spectra,
        of: impl Fn(Column<'_, '_, K>) -> f64 + Sync,
    ) -> f64 {
        let (n, h) = (self.n_columns(), self.height);
        let blocks = n.div_ceil(BLOCK);
        let stride = h + PAD;
        work.blocks.resize_with(blocks, Vec::new);
        work.sums.resize(blocks, 0.0);
        let rows = &work.rows;
        let tasks = work.blocks.par_iter_mut().zip(work.sums.par_iter_mut());
        let room = || (self.columns_room(K), self.columns_scratch());
        tasks.enumerate().for_each_init(room, |(columns, scratch), (block, (out, sum))| {
            for (columns, rows) in columns.chunks_exact_mut(BLOCK * stride).zip(rows) {
                self.to_columns(rows, block, columns);
            }
            *sum = 0.0;
            for b in 0..BLOCK.min(n - block * BLOCK) {
                let mut parts = columns.chunks_exact_mut(BLOCK * stride);
                let mut column: [&mut [Complex<f64>]; K] = std::array::from_fn(|_| match parts.next() {
                    Some(part) => &mut part[b * stride..b * stride + h],
                    None => &mut [],
                });
                for values in &mut column {
                    self.columns.process_with_scratch(values, scratch);
                }
                let j = block * BLOCK + b;
                *sum += of(Column { j, multiplicity: self.multiplicity(j), fields: &mut column });
                for values in &mut column {
                    self.columns_back.process_with_scratch(values, scratch);
                }
            }
            out.resize(K * BLOCK * h, Complex::default());
            for (columns, out) in columns.chunks_exact(BLOCK * stride).zip(out.chunks_exact_mut(BLOCK * h)) {
                self.to_rows(columns, out);
            }
        });
        self.rows_back(to, layouts, work);
        work.sums.iter().sum()
    }

    /// Blocks of columns to rows of fields.
    fn rows_back(&self, to: &mut [f64], layouts: &[Layout], work: &mut Spectra) {
        let (n, h) = (self.n_columns(), self.height);
        let blocks = &work.blocks;
        for (field, layout) in layouts.iter().enumerate() {
            let to = &mut to[layout.first..][..self.reach(layout)];
            let tasks = to.par_chunks_mut(layout.stride * ROWS).enumerate();
            let scratch_len = self.rows_back.get_scratch_len();
            let room = || (vec![Complex::default(); n], vec![Complex::default(); scratch_len]);
            tasks.for_each_init(room, |(row, scratch), (task, to)| {
                for (i, to) in to.chunks_mut(layout.stride).enumerate() {
                    let at = (field * h + task * ROWS + i) * BLOCK;
                    let (parts, rest) = row.as_chunks_mut::<BLOCK>();
                    for (part, block) in parts.iter_mut().zip(blocks) {
                        *part = block.as_chunks::<BLOCK>().0[at / BLOCK];
                    }
                    if let (Some(block), false) = (blocks.last(), rest.is_empty()) {
                        rest.copy_from_slice(&block[at..at + rest.len()]);
                    }
                    // Real but for rounding.
                    row[0].im = 0.0;
                    if self.width.is_multiple_of(2) {
                        row[n - 1].im = 0.0;
                    }
                    let _ = self.rows_back.process_with_scratch(row, &mut to[..self.width], scratch);
                }
            });
        }
    }
}
