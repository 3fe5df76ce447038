//! Sweeps of a solve over one group: the hot loops.
//!
//! A supernode stores M = [L11^-1; -L21 L11^-1]. With b_s its right-hand sides and z its rows,
//!   forward   [y_s; z] += M b_s  (from y_s = 0)        backward   x_s = M^T [y_s; x_z],
//! one pass over M each, no dependence inside a supernode. Where it stores L21 in place of the last blocks of M
//! ([`super::Purpose::FewSolves`]), their rows z' follow: forward z' -= L21 y_s; backward they come first, y_s -= L21^T x_z'.

use super::layout::Front;
use super::vector::{Kernel, Scalar, Vector};
use std::ops::Range;

/// Columns that the backward sweep keeps in registers.
const KC: usize = 4;

/// Right-hand sides handled at once; rows of a group's vector are this far apart.
pub(super) const fn stride(nrhs: usize) -> usize {
    match nrhs {
        3 => 4,
        n => n,
    }
}

/// A supernode of a sweep.
#[derive(Clone, Copy)]
pub(super) struct Step<T> {
    pub w: usize,
    pub blocks: usize,
    /// Blocks of M; the others are of L21.
    pub product: usize,
    pub panel: *const T,
    /// Place of each row in the vector, `blocks * LANES` of them, the columns first.
    pub index: *const u32,
}

/// Sweeps over supernodes `range` of a group.
pub(super) struct Sweep<'a, T, F, const NR: usize> {
    /// The s-th supernode.
    pub step: &'a F,
    pub range: Range<usize>,
    /// The group's vector, rows of `stride(NR)` values.
    pub vector: *mut T,
    /// Room for the columns of a supernode (forward), or its rows by lines (backward).
    pub room: *mut T,
    pub forward: bool,
}

impl<T: Scalar, F: Fn(usize) -> Step<T>, const NR: usize> Kernel<T> for Sweep<'_, T, F, NR> {
    type Output = ();
    #[inline(always)]
    unsafe fn run<V: Vector<T>>(self) {
        // SAFETY: steps, vector and room are laid out by the caller.
        unsafe {
            if self.forward {
                for s in self.range {
                    forward::<T, V, NR>(&(self.step)(s), self.vector, self.room);
                }
            } else {
                for s in self.range.rev() {
                    backward::<T, V, NR>(&(self.step)(s), self.vector, self.room);
                }
            }
        }
    }
}

#[inline(always)]
unsafe fn forward<T: Scalar, V: Vector<T>, const NR: usize>(step: &Step<T>, vector: *mut T, room: *mut T) {
    let (lanes, stride) = (T::LANES, stride(NR));
    // SAFETY: as `run`.
    unsafe {
        let own = vector.add(*step.index as usize * stride);
        std::ptr::copy_nonoverlapping(own, room, step.w * stride);
        std::ptr::write_bytes(own, 0, step.w * stride);
        let mut panel = step.panel;
        for b in 0..step.product {
            let columns = (lanes * (b + 1)).min(step.w);
            let sum = block_product::<T, V, NR>(panel, columns, room);
            V::scatter_add::<NR>(sum, step.index.add(b * lanes), vector);
            panel = panel.add(columns * lanes);
        }
        if step.product < step.blocks {
            std::ptr::copy_nonoverlapping(own, room, step.w * stride);
            for b in step.product..step.blocks {
                let sum = block_product::<T, V, NR>(panel, step.w, room);
                let mut less = sum;
                for c in 0..NR {
                    less[c] = sum[c].neg();
                }
                V::scatter_add::<NR>(less, step.index.add(b * lanes), vector);
                panel = panel.add(step.w * lanes);
            }
        }
    }
}

/// A block times the rows of `room`.
#[inline(always)]
unsafe fn block_product<T: Scalar, V: Vector<T>, const NR: usize>(
    panel: *const T,
    columns: usize,
    room: *const T,
) -> [V; NR] {
    let (lanes, stride) = (T::LANES, stride(NR));
    // SAFETY: as `run`.
    unsafe {
        // Two sums, so that additions need not wait for each other.
        let mut even = [V::zero(); NR];
        let mut odd = [V::zero(); NR];
        let mut k = 0;
        while k + 2 <= columns {
            let (p, q) = (V::load(panel.add(k * lanes)), V::load(panel.add((k + 1) * lanes)));
            for c in 0..NR {
                even[c] = even[c].fma(p, V::splat(*room.add(k * stride + c)));
                odd[c] = odd[c].fma(q, V::splat(*room.add((k + 1) * stride + c)));
            }
            k += 2;
        }
        if k < columns {
            let p = V::load(panel.add(k * lanes));
            for c in 0..NR {
                even[c] = even[c].fma(p, V::splat(*room.add(k * stride + c)));
            }
        }
        for c in 0..NR {
            even[c] = even[c].add(odd[c]);
        }
        even
    }
}

#[inline(always)]
unsafe fn backward<T: Scalar, V: Vector<T>, const NR: usize>(step: &Step<T>, vector: *mut T, room: *mut T) {
    let lanes = T::LANES;
    // SAFETY: as `run`.
    unsafe {
        let own = vector.add(*step.index as usize * stride(NR));
        if step.product < step.blocks {
            let front = Front { w: step.w, m: step.blocks * lanes, lanes };
            let rest = step.panel.add(front.block_start(step.product) * lanes);
            gather_rows::<T, V, NR>(step, step.product..step.blocks, vector, room);
            let mut k = 0;
            while k < step.w {
                if k + KC <= step.w {
                    columns::<T, V, NR, KC, true>(step, k, step.product..step.blocks, rest, room, own);
                    k += KC;
                } else {
                    columns::<T, V, NR, 1, true>(step, k, step.product..step.blocks, rest, room, own);
                    k += 1;
                }
            }
        }
        gather_rows::<T, V, NR>(step, 0..step.product, vector, room);
        let mut k = 0;
        // Start of the block that holds row k.
        let mut first = 0;
        let mut start = step.panel;
        while k < step.w {
            while k >= (first + 1) * lanes {
                start = start.add((lanes * (first + 1)).min(step.w) * lanes);
                first += 1;
            }
            if k + KC <= step.w {
                columns::<T, V, NR, KC, false>(step, k, first..step.product, start, room, own);
                k += KC;
            } else {
                columns::<T, V, NR, 1, false>(step, k, first..step.product, start, room, own);
                k += 1;
            }
        }
    }
}

/// The rows of these blocks, line by line.
#[inline(always)]
unsafe fn gather_rows<T: Scalar, V: Vector<T>, const NR: usize>(
    step: &Step<T>,
    blocks: Range<usize>,
    vector: *const T,
    room: *mut T,
) {
    let lanes = T::LANES;
    // SAFETY: as `run`.
    unsafe {
        for b in blocks {
            let rows = V::gather::<NR>(vector, step.index.add(b * lanes));
            for c in 0..NR {
                rows[c].store(room.add((b * NR + c) * lanes));
            }
        }
    }
}

/// Columns k..k + C of the backward sweep, over these blocks: own = sum, or own -= sum where `LESS`.
#[inline(always)]
unsafe fn columns<T: Scalar, V: Vector<T>, const NR: usize, const C: usize, const LESS: bool>(
    step: &Step<T>,
    k: usize,
    blocks: Range<usize>,
    start: *const T,
    room: *const T,
    own: *mut T,
) {
    let lanes = T::LANES;
    // SAFETY: as `run`.
    unsafe {
        let mut acc = [[V::zero(); NR]; C];
        let mut panel = start;
        for b in blocks {
            let rows: [V; NR] = std::array::from_fn(|c| V::load(room.add((b * NR + c) * lanes)));
            for t in 0..C {
                let p = V::load(panel.add((k + t) * lanes));
                for c in 0..NR {
                    acc[t][c] = acc[t][c].fma(p, rows[c]);
                }
            }
            panel = panel.add((lanes * (b + 1)).min(step.w) * lanes);
        }
        for t in 0..C {
            for c in 0..NR {
                let to = own.add((k + t) * stride(NR) + c);
                *to = if LESS { T::sum(*to, acc[t][c].neg().sum()) } else { acc[t][c].sum() };
            }
        }
    }
}
