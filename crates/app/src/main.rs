//! The `isoclay` program: scans in, solids out.

mod allocator;
mod charts;
mod check;
mod cli;
mod devices;
mod fans;
mod picture;
mod pieces;
mod threads;

use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: allocator::OrEnd = allocator::OrEnd;

fn main() -> ExitCode {
    allocator::keep_freed_pages();
    cli::main()
}
