//! Aligned storage of lines.

use super::vector::{Line, Scalar};
use std::alloc::{Layout, alloc, dealloc, handle_alloc_error};
use std::ptr::NonNull;

/// Large stores are aligned to pages of this size.
const HUGE_PAGE: usize = 2 << 20;

/// The pages that a large store is asked to lie in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Pages {
    /// Those of the system: what is written a few times only. On virtual machines whose free memory goes back to the host the
    /// first touch of a huge page was measured at 0.4 GB/s, of small ones at 2.7.
    #[default]
    Small,
    /// Huge ones: what is streamed through again and again, since small pages cost a table walk every 64 lines.
    Huge,
}

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
    pub fn new(lines: usize, pages: Pages) -> Self {
        if lines == 0 {
            return Self::default();
        }
        #[cfg(target_os = "linux")]
        if let Some(start) = mapped::take(lines.saturating_mul(size_of::<Line>()), pages) {
            return Self { start: start.cast(), lines };
        }
        let layout = Self::layout(lines);
        // SAFETY: the layout is not empty; the memory is written before it is used.
        unsafe {
            let Some(start) = NonNull::new(alloc(layout).cast::<Line>()) else { handle_alloc_error(layout) };
            start.as_ptr().write_bytes(0, lines);
            Self { start, lines }
        }
    }

    fn layout(lines: usize) -> Layout {
        let size = lines.saturating_mul(size_of::<Line>());
        let Ok(layout) = Layout::from_size_align(size, align_of::<Line>()) else {
            // More than the address space: the same end as memory that ran out.
            handle_alloc_error(Layout::new::<Line>())
        };
        layout
    }

    /// Grows to at least this many lines; what they held is lost.
    pub fn reserve(&mut self, lines: usize) {
        if self.lines < lines {
            *self = Self::default(); // frees before it takes
            *self = Self::new(lines, Pages::Small);
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
        if self.lines == 0 {
            return;
        }
        #[cfg(target_os = "linux")]
        // SAFETY: taken in `new` with this size, and by `mapped::take` if that takes stores of this size.
        if unsafe { mapped::give_back(self.start.cast(), self.lines * size_of::<Line>()) } {
            return;
        }
        // SAFETY: taken in `new` with this layout.
        unsafe { dealloc(self.start.as_ptr().cast(), Self::layout(self.lines)) }
    }
}

/// Large stores come from the system as pages that are zero and not there until they are touched: the threads that use them
/// fetch them side by side, and what a task never needs is never fetched.
#[cfg(target_os = "linux")]
mod mapped {
    use super::{HUGE_PAGE, NonNull, Pages};

    /// Whether a store of this size is taken here.
    fn is_large(size: usize) -> bool {
        (2 * HUGE_PAGE..=isize::MAX as usize - 2 * HUGE_PAGE).contains(&size)
    }

    fn rounded(size: usize) -> usize {
        size.next_multiple_of(HUGE_PAGE)
    }

    /// Zeroed memory at the start of a huge page; none for small stores.
    pub fn take(size: usize, pages: Pages) -> Option<NonNull<u8>> {
        if !is_large(size) {
            return None;
        }
        let (size, whole) = (rounded(size), rounded(size) + HUGE_PAGE);
        let (rights, kind) = (libc::PROT_READ | libc::PROT_WRITE, libc::MAP_PRIVATE | libc::MAP_ANONYMOUS);
        // SAFETY: a new mapping, of which the ends around the aligned part are given back.
        unsafe {
            let map = libc::mmap(std::ptr::null_mut(), whole, rights, kind, -1, 0);
            if map == libc::MAP_FAILED {
                std::alloc::handle_alloc_error(std::alloc::Layout::new::<super::Line>());
            }
            let map = map.cast::<u8>();
            let before = map.align_offset(HUGE_PAGE);
            if before > 0 {
                libc::munmap(map.cast(), before);
            }
            let after = whole - before - size;
            if after > 0 {
                libc::munmap(map.add(before + size).cast(), after);
            }
            let start = map.add(before);
            if pages == Pages::Huge {
                // Advice only: without it all is as before.
                libc::madvise(start.cast(), size, libc::MADV_HUGEPAGE);
            }
            NonNull::new(start)
        }
    }

    /// Gives back what `take` took; false where the size is none of its.
    ///
    /// # Safety
    /// If the size is large, `start` comes from `take` with it, and is not used any more.
    pub unsafe fn give_back(start: NonNull<u8>, size: usize) -> bool {
        if is_large(size) {
            // SAFETY: the mapping of `take`.
            unsafe { libc::munmap(start.as_ptr().cast(), rounded(size)) };
        }
        is_large(size)
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
