//! The discrete Fourier transform of real fields in two dimensions.

use rayon::prelude::*;
use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

/// Columns of a spectrum that are handled together: a row's part of them is two cache lines.
const BLOCK: usize = 8;
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
#[derive(Default)]
pub struct Spectra {
    rows: Vec<Vec<Complex<f64>>>,    // a field: row by row
    columns: Vec<Vec<Complex<f64>>>, // a block of columns: field by field, column by column
    scratch: Vec<Vec<Complex<f64>>>, // a block of rows, and of columns
    sums: Vec<f64>,
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
        let (mut work, mut from) = (Spectra::default(), field.to_vec());
        self.rows_forward(&mut from, &[Layout { first: 0, stride: self.width }], &mut work);
        let mut out = vec![Complex::default(); self.n_columns() * self.height];
        let mut scratch = vec![Complex::default(); self.columns.get_inplace_scratch_len()];
        for (j, column) in out.chunks_exact_mut(self.height).enumerate() {
            for (i, value) in column.iter_mut().enumerate() {
                *value = work.rows[0][i * self.n_columns() + j];
            }
            self.columns.process_with_scratch(column, &mut scratch);
        }
        out
    }

    /// Rows of the fields to rows of their spectra. The fields are used up.
    fn rows_forward(&self, from: &mut [f64], layouts: &[Layout], work: &mut Spectra) {
        let n = self.n_columns();
        work.rows.resize_with(layouts.len(), Vec::new);
        for (layout, rows) in layouts.iter().zip(&mut work.rows) {
            rows.resize(n * self.height, Complex::default());
            let from = &mut from[layout.first..];
            let pairs = from.par_chunks_mut(layout.stride).zip(rows.par_chunks_mut(n));
            let scratch = || vec![Complex::default(); self.rows.get_scratch_len()];
            pairs.with_min_len(BLOCK).for_each_init(scratch, |scratch, (from, to)| {
                // The lengths are those of the plan, which is all that can go wrong.
                let _ = self.rows.process_with_scratch(&mut from[..self.width], to, scratch);
            });
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
        self.rows_forward(from, layouts, work);
        let (n, h) = (self.n_columns(), self.height);
        let blocks = n.div_ceil(BLOCK);
        let stride = h + PAD;
        work.columns.resize_with(blocks, Vec::new);
        work.sums.resize(blocks, 0.0);
        work.scratch.resize_with(blocks, Vec::new);
        let (rows, length) = (&work.rows, self.columns.get_inplace_scratch_len());
        let length = length.max(self.columns_back.get_inplace_scratch_len());
        let tasks = work.columns.par_iter_mut().zip(work.scratch.par_iter_mut()).zip(work.sums.par_iter_mut());
        tasks.enumerate().for_each(|(block, ((columns, scratch), sum))| {
            let first = block * BLOCK;
            let wide = BLOCK.min(n - first);
            columns.resize(K * BLOCK * stride, Complex::default());
            scratch.resize(length, Complex::default());
            for (field, rows) in rows.iter().enumerate() {
                let to = &mut columns[field * BLOCK * stride..(field + 1) * BLOCK * stride];
                for (i, row) in rows.chunks_exact(n).enumerate() {
                    for (b, value) in row[first..first + wide].iter().enumerate() {
                        to[b * stride + i] = *value;
                    }
                }
            }
            *sum = 0.0;
            for b in 0..wide {
                let mut parts = columns.chunks_exact_mut(BLOCK * stride);
                let mut column: [&mut [Complex<f64>]; K] = std::array::from_fn(|_| match parts.next() {
                    Some(part) => &mut part[b * stride..b * stride + h],
                    None => &mut [],
                });
                for values in &mut column {
                    self.columns.process_with_scratch(values, scratch);
                }
                let j = first + b;
                *sum += of(Column { j, multiplicity: self.multiplicity(j), fields: &mut column });
                for values in &mut column {
                    self.columns_back.process_with_scratch(values, scratch);
                }
            }
        });
        self.rows_back(to, layouts, work);
        work.sums.iter().sum()
    }

    /// Columns of spectra to rows of fields.
    fn rows_back(&self, to: &mut [f64], layouts: &[Layout], work: &mut Spectra) {
        let (n, stride) = (self.n_columns(), self.height + PAD);
        let columns = &work.columns;
        for (field, (layout, rows)) in layouts.iter().zip(&mut work.rows).enumerate() {
            let to = &mut to[layout.first..];
            let tasks = to.par_chunks_mut(layout.stride * BLOCK).zip(rows.par_chunks_mut(n * BLOCK)).enumerate();
            let scratch = || vec![Complex::default(); self.rows_back.get_scratch_len()];
            tasks.for_each_init(scratch, |scratch, (task, (to, rows))| {
                let first = task * BLOCK;
                let tall = rows.len() / n;
                for (block, columns) in columns.iter().enumerate() {
                    for b in 0..BLOCK.min(n - block * BLOCK) {
                        let at = (field * BLOCK + b) * stride + first;
                        for (i, value) in columns[at..at + tall].iter().enumerate() {
                            rows[i * n + block * BLOCK + b] = *value;
                        }
                    }
                }
                for (row, to) in rows.chunks_exact_mut(n).zip(to.chunks_mut(layout.stride)) {
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
