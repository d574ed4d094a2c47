//! Memory of large arrays: in large pages, and back to the system once it is free.
//!
//! Memory that is written for the first time costs a fault a page. At 4 kB each these took an eighth of
//! the time of local thickness at 256³. Linux has pages of 2 MB, in most distributions for those who ask.

use std::alloc::{GlobalAlloc, Layout, System};

/// Bytes from which on large pages are asked for: two of them at least lie in such a block.
const LARGE: usize = 1 << 22;

/// The system's allocator, which asks for large pages where blocks are large.
pub(crate) struct LargePages;

// SAFETY: All blocks are the system allocator's, whose contract is kept; advice changes no contents.
unsafe impl GlobalAlloc for LargePages {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: The caller keeps the contract of `alloc`, which is the same.
        let block = unsafe { System.alloc(layout) };
        advise(block, layout.size());
        block
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: As above. Zeros of large blocks are those of fresh pages, not touched yet.
        let block = unsafe { System.alloc_zeroed(layout) };
        advise(block, layout.size());
        block
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: As above.
        let block = unsafe { System.realloc(block, layout, size) };
        advise(block, size);
        block
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: As above.
        unsafe { System.dealloc(block, layout) }
    }
}

fn advise(block: *mut u8, size: usize) {
    if size >= LARGE && !block.is_null() {
        ask(block, size);
    }
}

/// Asks for large pages in a block. It is advice: where it is refused, the block is as good.
#[cfg(target_os = "linux")]
fn ask(block: *mut u8, size: usize) {
    /// Where pages are longer, the advice is refused.
    const PAGE: usize = 1 << 12;
    let before = block.align_offset(PAGE);
    let length = (size - before) / PAGE * PAGE;
    // SAFETY: The range lies in the block; the advice does not touch what it holds.
    unsafe {
        libc::madvise(block.wrapping_add(before).cast(), length, libc::MADV_HUGEPAGE);
    }
}

#[cfg(not(target_os = "linux"))]
fn ask(_: *mut u8, _: usize) {}

/// Gives the pages back to the system that the heap keeps of what has been freed.
///
/// For work that needs much memory for long, after a start that needed other arrays: those that do not fit
/// where these were come on top of them. Not for each block that is freed, for to write anew to pages
/// costs faults (a fifth of the time of local thickness).
pub(crate) fn give_back() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: What is in use stays as it is.
    unsafe {
        libc::malloc_trim(0);
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn large_blocks_are_zero_where_asked_and_keep_what_they_hold() {
        for length in [0, 1, super::LARGE / 8 - 1, super::LARGE / 8, super::LARGE] {
            let mut block = vec![0u64; length];
            assert!(block.iter().all(|&value| value == 0));
            for (i, value) in block.iter_mut().enumerate() {
                *value = i as u64;
            }
            block.reserve_exact(super::LARGE);
            block.push(length as u64);
            assert!(block.iter().enumerate().all(|(i, &value)| value == i as u64));
        }
    }
}
