//! Aligned storage of lines.

use super::vector::{Line, Scalar};

/// A growable store of zero-initialised lines, aligned to a cache line.
#[derive(Default)]
pub(super) struct Lines(Vec<Line>);

impl Lines {
    pub fn new(lines: usize) -> Self {
        Self(vec![Line::ZERO; lines])
    }

    /// Grows to at least this many lines.
    pub fn reserve(&mut self, lines: usize) {
        if self.0.len() < lines {
            self.0 = vec![Line::ZERO; lines];
        }
    }

    pub fn len(&self) -> usize {
        self.0.len()
    }

    pub fn as_ptr<T: Scalar>(&self) -> *const T {
        self.0.as_ptr().cast()
    }

    pub fn as_mut_ptr<T: Scalar>(&mut self) -> *mut T {
        self.0.as_mut_ptr().cast()
    }
}

/// A pointer that tasks may share; each says at its use why they do not collide.
#[derive(Clone, Copy)]
pub(super) struct Shared<T>(*mut T);

// SAFETY: see the type.
unsafe impl<T: Send> Send for Shared<T> {}
// SAFETY: see the type.
unsafe impl<T: Send> Sync for Shared<T> {}

impl<T> Shared<T> {
    pub fn new(p: *mut T) -> Self {
        Self(p)
    }

    /// The pointer `offset` values on.
    ///
    /// # Safety
    /// Within the allocation.
    #[inline(always)]
    pub unsafe fn at(self, offset: usize) -> *mut T {
        // SAFETY: the caller's promise.
        unsafe { self.0.add(offset) }
    }
}
