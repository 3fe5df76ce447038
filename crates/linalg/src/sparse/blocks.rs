//! Symmetric matrices of small dense blocks.

use super::pattern::check_length;
use super::{SparseError, SymPattern};
use rayon::prelude::*;

/// A symmetric matrix with a `dim` x `dim` block for each entry of a pattern: the Hessian of something that has `dim`
/// unknowns at each vertex of a graph.
///
/// The block of slot (i, j), i >= j, has rows of vertex i and columns of vertex j and is stored by rows; slots are those of
/// the [`SymPattern`]. Blocks of the diagonal are whole, and symmetric.
pub struct BlockMatrix {
    dim: usize,
    values: Vec<f64>,
    diagonal: Vec<usize>, // slot of each diagonal block
    row_ptr: Vec<usize>,  // rows of both triangles
    columns: Vec<u32>,
    slots: Vec<u32>, // 2 slot, + 1 where the block is to be transposed
}

/// Rows that one task multiplies at a time.
const CHUNK: usize = 512;

impl BlockMatrix {
    /// The zero matrix over a pattern.
    ///
    /// # Errors
    /// More than 2^31 entries of the pattern, or blocks that are not 1 x 1, 2 x 2 or 3 x 3.
    pub fn new(pattern: &SymPattern, dim: usize) -> Result<Self, SparseError> {
        let (n, limit) = (pattern.n(), (u32::MAX / 2) as usize);
        if pattern.nnz() > limit || !(1..=3).contains(&dim) {
            return Err(SparseError::TooLarge { what: "the number of matrix blocks", size: pattern.nnz(), limit });
        }
        let mut row_ptr = vec![0usize; n + 1];
        for j in 0..n {
            for &i in pattern.column(j) {
                row_ptr[i as usize + 1] += 1;
                row_ptr[j + 1] += usize::from(i as usize != j);
            }
        }
        for i in 0..n {
            row_ptr[i + 1] += row_ptr[i];
        }
        let mut next = row_ptr.clone();
        let (mut columns, mut slots) = (vec![0u32; row_ptr[n]], vec![0u32; row_ptr[n]]);
        let mut put = |row: usize, column: usize, slot: usize| {
            columns[next[row]] = column as u32;
            slots[next[row]] = slot as u32;
            next[row] += 1;
        };
        for j in 0..n {
            for slot in pattern.col_ptr()[j]..pattern.col_ptr()[j + 1] {
                let i = pattern.row_idx()[slot] as usize;
                put(i, j, 2 * slot);
                if i != j {
                    put(j, i, 2 * slot + 1);
                }
            }
        }
        let diagonal = (0..n).map(|j| pattern.diagonal_slot(j)).collect();
        Ok(BlockMatrix { dim, values: vec![0.0; pattern.nnz() * dim * dim], diagonal, row_ptr, columns, slots })
    }

    /// Numbers a block has rows.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Number of unknowns.
    pub fn n(&self) -> usize {
        self.diagonal.len() * self.dim
    }

    /// The blocks, slot by slot.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The blocks, to write.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Adds `value` to the diagonal entries of vertex i.
    pub fn add_to_diagonal(&mut self, i: usize, value: f64) {
        if let Some(slot) = self.diagonal.get(i) {
            for r in 0..self.dim {
                self.values[slot * self.dim * self.dim + r * (self.dim + 1)] += value;
            }
        }
    }

    /// Calls `visit` with every entry of the diagonal, vertex by vertex.
    pub fn for_each_diagonal(&mut self, mut visit: impl FnMut(&mut f64)) {
        for slot in &self.diagonal {
            for r in 0..self.dim {
                visit(&mut self.values[slot * self.dim * self.dim + r * (self.dim + 1)]);
            }
        }
    }

    /// Adds `values[slot]` times the identity to each block.
    ///
    /// # Errors
    /// A number of values that is not the number of blocks.
    pub fn add_identities(&mut self, values: &[f64]) -> Result<(), SparseError> {
        let (dim, size) = (self.dim, self.dim * self.dim);
        check_length("values", values.len(), self.values.len() / size)?;
        for (block, value) in self.values.chunks_exact_mut(size).zip(values) {
            for r in 0..dim {
                block[r * (dim + 1)] += value;
            }
        }
        Ok(())
    }

    /// y = A x.
    ///
    /// # Errors
    /// A vector of another length.
    pub fn multiply(&self, x: &[f64], y: &mut [f64]) -> Result<(), SparseError> {
        check_length("x", x.len(), self.n())?;
        check_length("y", y.len(), self.n())?;
        match self.dim {
            1 => self.multiply_by::<1>(x, y),
            2 => self.multiply_by::<2>(x, y),
            _ => self.multiply_by::<3>(x, y),
        }
        Ok(())
    }

    fn multiply_by<const N: usize>(&self, x: &[f64], y: &mut [f64]) {
        let (x, y) = (x.as_chunks::<N>().0, y.as_chunks_mut::<N>().0);
        y.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, y)| {
            for (k, y) in y.iter_mut().enumerate() {
                let row = chunk * CHUNK + k;
                let mut sum = [0.0; N];
                for at in self.row_ptr[row]..self.row_ptr[row + 1] {
                    let slot = self.slots[at];
                    let block = &self.values[(slot / 2) as usize * N * N..][..N * N];
                    let x = &x[self.columns[at] as usize];
                    if slot.is_multiple_of(2) {
                        for r in 0..N {
                            for c in 0..N {
                                sum[r] += block[r * N + c] * x[c];
                            }
                        }
                    } else {
                        for r in 0..N {
                            for c in 0..N {
                                sum[r] += block[c * N + r] * x[c];
                            }
                        }
                    }
                }
                *y = sum;
            }
        });
    }
}
