//! The register tile of matrix products on blocks of rows.
//!
//! C[rows x columns] = sum over k of A[rows, k] B[columns, k], where A and B are blocks as they are stored (one line
//! a column): the lines of A are loaded, the values of B are broadcast.

use super::vector::{Scalar, Vector};

/// Columns of the register tile under wide registers.
const NC: usize = 8;
/// And under narrow ones.
const NC_NARROW: usize = 4;
/// Row blocks of the register tile under wide registers.
pub(super) const MR: usize = 3;

/// acc[q][j] = sum over t < k of A_q[t] B[t][j]; a_q and b are lines, `stride` values apart.
#[inline(always)]
unsafe fn product<T: Scalar, V: Vector<T>, const R: usize, const C: usize>(
    k: usize,
    a: [*const T; R],
    b: *const T,
) -> [[V; C]; R] {
    // SAFETY: the caller promises k lines in every operand.
    unsafe {
        let mut acc = [[V::zero(); C]; R];
        for t in 0..k {
            let mut rows = [V::zero(); R];
            for q in 0..R {
                rows[q] = V::load(a[q].add(t * T::LANES));
            }
            for j in 0..C {
                let x = V::splat(*b.add(t * T::LANES + j));
                for q in 0..R {
                    acc[q][j] = acc[q][j].fma(rows[q], x);
                }
            }
        }
        acc
    }
}

/// C_q[j] -= sum over t < k of A_q[t] B[t][j] for the columns of one block; C_q are lines in memory.
/// With `overwrite`, C_q[j] = -(sum).
///
/// # Safety
/// k lines in A and B, `columns` lines in C, at most a line's values.
#[inline(always)]
pub(super) unsafe fn update_block<T: Scalar, V: Vector<T>, const R: usize>(
    k: usize,
    a: [*const T; R],
    b: *const T,
    c: [*mut T; R],
    columns: usize,
    overwrite: bool,
) {
    // SAFETY: the caller promises the operands; columns <= LANES.
    unsafe {
        if V::WIDE {
            columns_of::<T, V, R, NC>(k, a, b, c, columns, overwrite);
        } else {
            columns_of::<T, V, R, NC_NARROW>(k, a, b, c, columns, overwrite);
        }
    }
}

#[inline(always)]
unsafe fn columns_of<T: Scalar, V: Vector<T>, const R: usize, const C: usize>(
    k: usize,
    a: [*const T; R],
    b: *const T,
    c: [*mut T; R],
    columns: usize,
    overwrite: bool,
) {
    // SAFETY: as `update_block`.
    unsafe {
        let mut j0 = 0;
        while j0 < columns {
            let acc = product::<T, V, R, C>(k, a, b.add(j0));
            for q in 0..R {
                for j in 0..C {
                    if j0 + j < columns {
                        let p = c[q].add((j0 + j) * T::LANES);
                        if overwrite {
                            acc[q][j].neg().store(p);
                        } else {
                            V::load(p).add(acc[q][j].neg()).store(p);
                        }
                    }
                }
            }
            j0 += C;
        }
    }
}

/// Calls a function for `MR` row blocks at once where the registers allow it, then one by one.
macro_rules! row_blocks {
    ($v:ident, $rows:expr, $f:ident ( $($arg:expr),* )) => {{
        let rows: std::ops::Range<usize> = $rows;
        let mut i = rows.start;
        if $v::WIDE {
            while i + $crate::sparse::tile::MR <= rows.end {
                $f::<T, $v, { $crate::sparse::tile::MR }>($($arg,)* i);
                i += $crate::sparse::tile::MR;
            }
        }
        while i < rows.end {
            $f::<T, $v, 1>($($arg,)* i);
            i += 1;
        }
    }};
}
pub(super) use row_blocks;
