//! The `isoclay` program: scans in, solids out.

mod allocator;
mod charts;
mod check;
mod cli;
mod fans;
mod picture;
mod pieces;
#[allow(dead_code, reason = "not all of it is used yet")]
mod threads;

use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: allocator::OrEnd = allocator::OrEnd;

fn main() -> ExitCode {
    allocator::keep_freed_pages();
    cli::main()
}
