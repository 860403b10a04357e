//! What workers keep of their blocks, and where.

use std::fs::File;
use std::io::{Cursor, Read, Seek};
use std::path::{Path, PathBuf};

use bspline::hierarchical::Lattice;
use formats::Fault;
use formats::field::PartIndex;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;

use super::{Levels, add};
use crate::failure::Failure;

/// Bytes that are here, or in a file.
#[derive(FromPyObject)]
pub enum Ticket {
    /// Here.
    #[pyo3(transparent)]
    Bytes(PyBackedBytes),
    /// In a file.
    #[pyo3(transparent)]
    File(PathBuf),
}

/// What can be read at any place.
pub trait Source: Read + Seek {}

impl<S: Read + Seek> Source for S {}

impl Ticket {
    /// Opens it.
    ///
    /// # Errors
    /// Those of the system.
    pub fn open(&self) -> Result<Box<dyn Source + '_>, Failure> {
        Ok(match self {
            Self::Bytes(bytes) => Box::new(Cursor::new(&bytes[..])),
            Self::File(path) => Box::new(File::open(path).map_err(|source| {
                let doing = "opening a part";
                self.failed(Fault::Io { doing, source })
            })?),
        })
    }

    /// A fault with the file that it is of.
    pub fn failed(&self, fault: Fault) -> Failure {
        let path = match self {
            Self::Bytes(_) => Path::new("a part in memory"),
            Self::File(path) => path,
        };
        fault.at(path).into()
    }

    /// The index of a part.
    ///
    /// # Errors
    /// [`PartIndex::read`].
    pub fn index(&self) -> Result<PartIndex, Failure> {
        PartIndex::read(&mut self.open()?).map_err(|fault| self.failed(fault))
    }
}

/// The sums of the bricks of parts, in their order, as far as they are `wanted`; and the slope of the first part.
pub fn summed(
    tickets: &[Ticket],
    lattice: &Lattice,
    wanted: impl Fn(usize, [u32; 3]) -> bool,
) -> Result<(Levels, f64), Failure> {
    let mut sums = Levels::default();
    let mut slope = None;
    for ticket in tickets {
        let index = ticket.index()?;
        slope = slope.or(Some(index.slope()));
        let mut part = ticket.open()?;
        for (level, x) in index.pages() {
            let Some(sum) = sums.get_mut(level) else {
                return Err(Failure::value(format!("a part of a block has level {level}")));
            };
            let page = index.page(&mut part, lattice, (level, x));
            for (key, functions) in page.map_err(|fault| ticket.failed(fault))? {
                if wanted(level, key.0) {
                    add(sum, key, &functions);
                }
            }
        }
    }
    Ok((sums, slope.unwrap_or(1.0)))
}
