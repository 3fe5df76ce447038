//! Aligned storage of lines.

use super::vector::{Line, Scalar};
use std::alloc::{Layout, alloc, dealloc, handle_alloc_error};
use std::ptr::NonNull;

/// Stores above this size are aligned to, and asked to lie in, pages of this size: a factor is streamed through,
/// and small pages cost a table walk every 64 lines.
const HUGE_PAGE: usize = 2 << 20;

/// A store of zero-initialised lines, aligned to a cache line.
pub(super) struct Lines {
    start: NonNull<Line>,
    lines: usize,
}

// SAFETY: plain owned memory.
unsafe impl Send for Lines {}
// SAFETY: shared access only reads.
unsafe impl Sync for Lines {}

impl Default for Lines {
    fn default() -> Self {
        Self { start: NonNull::dangling(), lines: 0 }
    }
}

impl Lines {
    pub fn new(lines: usize) -> Self {
        if lines == 0 {
            return Self::default();
        }
        let layout = Self::layout(lines);
        // SAFETY: the layout is not empty; the memory is written before it is used.
        unsafe {
            let Some(start) = NonNull::new(alloc(layout).cast::<Line>()) else { handle_alloc_error(layout) };
            #[cfg(target_os = "linux")]
            if layout.align() == HUGE_PAGE {
                // Advice only: without it all is as before.
                libc::madvise(start.as_ptr().cast(), layout.size(), libc::MADV_HUGEPAGE);
            }
            start.as_ptr().write_bytes(0, lines);
            Self { start, lines }
        }
    }

    fn layout(lines: usize) -> Layout {
        let size = lines.saturating_mul(size_of::<Line>());
        let align = if size >= 2 * HUGE_PAGE { HUGE_PAGE } else { align_of::<Line>() };
        let Ok(layout) = Layout::from_size_align(size, align) else {
            // More than the address space: the same end as memory that ran out.
            handle_alloc_error(Layout::new::<Line>())
        };
        layout
    }

    /// Grows to at least this many lines; what they held is lost.
    pub fn reserve(&mut self, lines: usize) {
        if self.lines < lines {
            *self = Self::default(); // frees before it takes
            *self = Self::new(lines);
        }
    }

    pub fn len(&self) -> usize {
        self.lines
    }

    pub fn as_ptr<T: Scalar>(&self) -> *const T {
        self.start.as_ptr().cast()
    }

    pub fn as_mut_ptr<T: Scalar>(&mut self) -> *mut T {
        self.start.as_ptr().cast()
    }
}

impl Drop for Lines {
    fn drop(&mut self) {
        if self.lines > 0 {
            // SAFETY: taken in `new` with this layout.
            unsafe { dealloc(self.start.as_ptr().cast(), Self::layout(self.lines)) }
        }
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
