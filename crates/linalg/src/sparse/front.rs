//! A front in memory.

use super::layout::Front;
use super::vector::Scalar;

/// A front in memory: panel, update matrix and workspace.
pub(super) struct FrontMemory<T> {
    pub front: Front,
    pub panel: *mut T,
    pub update: *mut T,
    /// `Front::work_lines` lines: the copy of L11 by column blocks, then reciprocal pivots.
    pub work: *mut T,
}

impl<T> Clone for FrontMemory<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for FrontMemory<T> {}
// SAFETY: a front is handed from task to task; tasks that share one write disjoint row blocks.
unsafe impl<T: Send> Send for FrontMemory<T> {}
// SAFETY: as above.
unsafe impl<T: Sync> Sync for FrontMemory<T> {}

impl<T: Scalar> FrontMemory<T> {
    /// Block b of the panel.
    ///
    /// # Safety
    /// b is a block, or one past.
    #[inline(always)]
    pub unsafe fn block(&self, b: usize) -> *mut T {
        // SAFETY: b is a block of the panel, or one past.
        unsafe { self.panel.add(self.front.block_start(b) * T::LANES) }
    }

    /// Reciprocal pivots.
    #[inline(always)]
    pub fn reciprocals(&self) -> *mut T {
        let lines = self.front.work_lines() - self.front.w.div_ceil(T::LANES);
        // SAFETY: within the workspace.
        unsafe { self.work.add(lines * T::LANES) }
    }

    /// Diagonal of the matrix before the elimination, `w` values.
    #[inline(always)]
    pub fn diagonal(&self) -> *mut T {
        let lines = self.front.work_lines() - 2 * self.front.w.div_ceil(T::LANES);
        // SAFETY: within the workspace.
        unsafe { self.work.add(lines * T::LANES) }
    }

    /// Row j of column block b of the copy of L11: the line of its columns in that block.
    ///
    /// # Safety
    /// j >= b lanes, within the triangle.
    #[inline(always)]
    pub unsafe fn copy_row(&self, b: usize, j: usize) -> *mut T {
        let lanes = T::LANES;
        // Column block b holds rows b lanes .. w.
        let start = b * self.front.w - lanes * (b * b.saturating_sub(1) / 2);
        // SAFETY: within the workspace.
        unsafe { self.work.add((start + j - b * lanes) * lanes) }
    }
}
