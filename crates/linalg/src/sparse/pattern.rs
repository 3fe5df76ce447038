//! Patterns of symmetric matrices.

use super::SparseError;
use rayon::prelude::*;

/// The pattern of a symmetric n x n matrix: its lower triangle with the diagonal, by columns, rows sorted.
///
/// The rows of column j are `row_idx()[col_ptr()[j]..col_ptr()[j + 1]]`; the first is j itself. Values
/// that belong to a pattern lie in the same order, one for each row index (a *slot*).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SymPattern {
    col_ptr: Vec<usize>,
    row_idx: Vec<u32>,
}

/// Vertices handled by one task when a pattern is gathered.
const CHUNK: usize = 4096;

impl SymPattern {
    /// A pattern from the lower triangle in compressed columns.
    ///
    /// # Errors
    /// Column pointers that fall or do not match, rows not strictly increasing or out of range,
    /// a missing diagonal entry, or n beyond 32-bit indices.
    pub fn from_lower_csc(n: usize, col_ptr: Vec<usize>, row_idx: Vec<u32>) -> Result<Self, SparseError> {
        check_size(n)?;
        if col_ptr.len() != n + 1 {
            return Err(SparseError::Length { what: "col_ptr", found: col_ptr.len(), expected: n + 1 });
        }
        if col_ptr[0] != 0 {
            return Err(SparseError::ColumnPointers { column: 0 });
        }
        if let Some(column) = (0..n).find(|&j| col_ptr[j + 1] < col_ptr[j] || col_ptr[j + 1] > row_idx.len()) {
            return Err(SparseError::ColumnPointers { column });
        }
        if col_ptr[n] != row_idx.len() {
            return Err(SparseError::Length { what: "row_idx", found: row_idx.len(), expected: col_ptr[n] });
        }
        for column in 0..n {
            let rows = &row_idx[col_ptr[column]..col_ptr[column + 1]];
            match rows.first() {
                None => return Err(SparseError::MissingDiagonal { column }),
                Some(&r) if r as usize > column => return Err(SparseError::MissingDiagonal { column }),
                Some(&r) if (r as usize) < column => return Err(SparseError::Row { column, row: r as usize }),
                Some(_) => {}
            }
            if let Some(w) = rows.windows(2).find(|w| w[1] <= w[0]) {
                return Err(SparseError::Row { column, row: w[1] as usize });
            }
            if let Some(&r) = rows.last().filter(|&&r| r as usize >= n) {
                return Err(SparseError::Row { column, row: r as usize });
            }
        }
        Ok(Self { col_ptr, row_idx })
    }

    /// The pattern of a graph with n vertices: the diagonal, and an entry for each edge (either direction, repeats allowed).
    ///
    /// # Errors
    /// An edge names a vertex `>= n`.
    pub fn from_edges(n: usize, edges: &[[u32; 2]]) -> Result<Self, SparseError> {
        Self::from_cliques(n, edges)
    }

    /// The pattern of `sum_e S_e^T K_e S_e`: the vertices of an element are all coupled with each other.
    ///
    /// ```
    /// use proxel_linalg::sparse::SymPattern;
    /// let two_triangles = SymPattern::from_cliques(4, &[[0u32, 1, 2], [2, 1, 3]])?;
    /// assert_eq!(two_triangles.nnz(), 4 + 5);
    /// assert_eq!(two_triangles.slot(3, 0), None);
    /// # Ok::<(), proxel_linalg::sparse::SparseError>(())
    /// ```
    ///
    /// # Errors
    /// An element names a vertex `>= n`. (An element with pinned vertices lists its free ones only.)
    pub fn from_cliques<E>(n: usize, elements: &[E]) -> Result<Self, SparseError>
    where
        E: AsRef<[u32]> + Sync,
    {
        check_size(n)?;
        // Elements around each vertex, then each column gathers from its own: columns are independent.
        let mut start = vec![0usize; n + 1];
        for (element, vertices) in elements.iter().enumerate() {
            for &v in vertices.as_ref() {
                if v as usize >= n {
                    return Err(SparseError::Vertex { element, vertex: v as usize, n });
                }
                start[v as usize + 1] += 1;
            }
        }
        for v in 0..n {
            start[v + 1] += start[v];
        }
        let mut next = start.clone();
        let mut around = vec![0usize; start[n]];
        for (element, vertices) in elements.iter().enumerate() {
            for &v in vertices.as_ref() {
                around[next[v as usize]] = element;
                next[v as usize] += 1;
            }
        }
        let chunks: Vec<(Vec<usize>, Vec<u32>)> = (0..n.div_ceil(CHUNK))
            .into_par_iter()
            .map(|chunk| {
                let vertices = chunk * CHUNK..((chunk + 1) * CHUNK).min(n);
                let (mut counts, mut rows) = (Vec::with_capacity(CHUNK), Vec::new());
                let mut column = Vec::new();
                for v in vertices {
                    column.clear();
                    column.push(v as u32);
                    for &e in &around[start[v]..start[v + 1]] {
                        column.extend(elements[e].as_ref().iter().filter(|&&u| u as usize > v));
                    }
                    column.sort_unstable();
                    column.dedup();
                    counts.push(column.len());
                    rows.extend_from_slice(&column);
                }
                (counts, rows)
            })
            .collect();
        let mut col_ptr = Vec::with_capacity(n + 1);
        col_ptr.push(0);
        let mut row_idx = Vec::with_capacity(chunks.iter().map(|(_, rows)| rows.len()).sum());
        for (counts, rows) in chunks {
            for count in counts {
                col_ptr.push(col_ptr[col_ptr.len() - 1] + count);
            }
            row_idx.extend_from_slice(&rows);
        }
        Ok(Self { col_ptr, row_idx })
    }

    /// Number of rows and columns.
    pub fn n(&self) -> usize {
        self.col_ptr.len() - 1
    }

    /// Number of entries of the lower triangle with the diagonal; values have this length.
    pub fn nnz(&self) -> usize {
        self.row_idx.len()
    }

    /// Where each column starts; n + 1 entries.
    pub fn col_ptr(&self) -> &[usize] {
        &self.col_ptr
    }

    /// Row indices by column.
    pub fn row_idx(&self) -> &[u32] {
        &self.row_idx
    }

    /// The rows of column j, starting with j. An empty slice if there is no such column.
    pub fn column(&self, j: usize) -> &[u32] {
        if j < self.n() { &self.row_idx[self.col_ptr[j]..self.col_ptr[j + 1]] } else { &[] }
    }

    /// The slot of entry (i, j), which is also that of (j, i); None if the pattern lacks it.
    pub fn slot(&self, i: usize, j: usize) -> Option<usize> {
        let (row, column) = (i.max(j), i.min(j));
        let found = self.column(column).binary_search(&u32::try_from(row).ok()?).ok()?;
        Some(self.col_ptr[column] + found)
    }

    /// The slot of the diagonal entry of column j, for j < n.
    pub fn diagonal_slot(&self, j: usize) -> usize {
        self.col_ptr[j]
    }

    /// y = A x for the matrix with these values: x and y are n x nrhs, row by row.
    ///
    /// # Errors
    /// A slice of the wrong length.
    pub fn multiply(&self, values: &[f64], x: &[f64], nrhs: usize, y: &mut [f64]) -> Result<(), SparseError> {
        let expected = self.n().saturating_mul(nrhs);
        check_length("values", values.len(), self.nnz())?;
        check_length("x", x.len(), expected)?;
        check_length("y", y.len(), expected)?;
        y.fill(0.0);
        for j in 0..self.n() {
            for slot in self.col_ptr[j]..self.col_ptr[j + 1] {
                let (i, a) = (self.row_idx[slot] as usize, values[slot]);
                for c in 0..nrhs {
                    y[i * nrhs + c] += a * x[j * nrhs + c];
                    if i != j {
                        y[j * nrhs + c] += a * x[i * nrhs + c];
                    }
                }
            }
        }
        Ok(())
    }
}

/// Errors unless `found == expected`.
pub(super) fn check_length(what: &'static str, found: usize, expected: usize) -> Result<(), SparseError> {
    if found == expected { Ok(()) } else { Err(SparseError::Length { what, found, expected }) }
}

fn check_size(n: usize) -> Result<(), SparseError> {
    // One index below u32::MAX is kept free, and 32-bit orders count vertices in i32.
    let limit = i32::MAX as usize - 1;
    if n <= limit { Ok(()) } else { Err(SparseError::TooLarge { what: "the number of unknowns", size: n, limit }) }
}
