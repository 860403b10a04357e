//! The system's allocator, with an end of its own where the system gives no more memory.
//!
//! The standard library would abort with a message that says neither what was asked for nor what helps.
#![allow(
    unsafe_code,
    reason = "the trait of allocators is unsafe, every call is handed on as it came; settings of the C library are foreign"
)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The allocator of the program.
pub struct OrEnd;

// SAFETY: each call is the system allocator's own with the same arguments, so its promises are those of `System`.
// `granted` returns what it is given, does not unwind, and allocates only after it has seen to it that a second
// refusal on the same thread comes back as a null pointer.
unsafe impl GlobalAlloc for OrEnd {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        granted(unsafe { System.alloc(layout) }, layout.size())
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        granted(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }
    unsafe fn realloc(&self, old: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        granted(unsafe { System.realloc(old, layout, size) }, size)
    }
    unsafe fn dealloc(&self, p: *mut u8, layout: Layout) {
        unsafe { System.dealloc(p, layout) }
    }
}

/// Keeps up to 64 MiB of what was freed, and gives arrays below 16 MiB no pages of their own. So glibc does by itself, but
/// only after it has handed many pages back and asked for them anew.
pub fn keep_freed_pages() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: two settings of the allocator, made while there is one thread.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, 16 << 20);
        libc::mallopt(libc::M_TRIM_THRESHOLD, 64 << 20);
    }
}

/// Asks for addresses 64 MiB at a time: the heaps of threads grow by a page and a call each otherwise, and go back whole when
/// they are empty. Not under a ceiling, which counts addresses; memory is only what has been written.
pub fn take_large_steps() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: a setting of the allocator, made while there is one thread.
    unsafe {
        libc::mallopt(libc::M_TOP_PAD, 64 << 20);
    }
}

fn granted(p: *mut u8, size: usize) -> *mut u8 {
    if p.is_null() {
        refused(size);
    }
    p
}

thread_local! {
    static ENDS_HERE: Cell<bool> = const { Cell::new(false) };
}

/// Ends the program, on the first thread that comes here; comes back on that one alone, if the end itself finds no
/// memory.
#[cold]
fn refused(size: usize) {
    static ENDS: AtomicBool = AtomicBool::new(false);
    if ENDS_HERE.get() {
        return;
    }
    if ENDS.swap(true, Ordering::Relaxed) {
        loop {
            std::thread::sleep(Duration::from_secs(1));
        }
    }
    ENDS_HERE.set(true);
    crate::cli::out_of_memory(size);
}
