//! The `isoclay` program: scans in, solids out.

mod allocator;
mod charts;
mod check;
mod cli;
mod devices;
mod fans;
#[cfg(feature = "window")]
mod panels;
mod picture;
mod pieces;
mod threads;
#[cfg(feature = "window")]
mod view;
#[cfg(feature = "window")]
mod window;

use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: allocator::OrEnd = allocator::OrEnd;

fn main() -> ExitCode {
    allocator::keep_freed_pages();
    cli::main()
}
