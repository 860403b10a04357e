//! A field file that is written without a field: bricks and leaves come in order, and nobody holds all of them.

use std::io::{self, Write};
use std::marker::PhantomData;
use std::path::Path;

use bspline::hierarchical::{BrickKey, Corrections, Lattice};

use super::chunk;
use super::columns::Columns;
use super::encode::{begin, made_wrongly};
use super::kinds::{END, LEAVES, LEVEL};
use super::{FieldMeta, LeafRecord, Stored, beside, valid};
use crate::atomic::{self, directory_of};
use crate::{Fault, FormatError};

/// What a field is before its functions.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Box, map, cells of level 0.
    pub lattice: Lattice,
    /// Fall of the field outside of the box.
    pub slope: f64,
    /// Levels down to the finest with an active function, at least 1.
    pub level_count: usize,
}

/// Writes a field file atomically, to the bit the one that [`super::save`] writes of the same field.
///
/// `fill` gives all bricks and leaves, and returns what stands behind them: of its [`FieldMeta`] report, notes and provenance
/// count, of `marks` the rest but the leaves. Confidences in signs are not for this. Until they are whole, the columns of a
/// level and of the leaf table are in nameless files beside the output, raw and packed.
///
/// # Errors
/// Those of `fill`; as [`super::save`]. The target is whole or untouched.
pub fn save_stream<T: Stored, E: From<FormatError>>(
    path: &Path,
    frame: &Frame,
    marks: &FieldMeta,
    fill: impl FnOnce(&mut FieldSink<T>) -> Result<FieldMeta, E>,
) -> Result<(), E> {
    let mut failed = None;
    let result = atomic::replace(path, |out| {
        let written = FieldSink::new(path, out, *frame, marks)
            .map_err(E::from)
            .and_then(|mut sink| {
                let texts = fill(&mut sink)?;
                sink.finish(&texts).map_err(E::from)
            });
        written.map_err(|e| {
            failed = Some(e);
            io::Error::other("the field cannot be had")
        })
    });
    match failed {
        Some(e) => Err(e),
        None => result.map_err(E::from),
    }
}

/// Takes the bricks and leaves of a field: see [`save_stream`].
pub struct FieldSink<'a, T> {
    path: &'a Path,
    out: &'a mut dyn Write,
    frame: Frame,
    /// Chunks so far.
    chunk_count: u32,
    /// The level that is being written, and its last brick.
    level: usize,
    last: Option<BrickKey>,
    brick_count: u32,
    /// Keys, masks, then each byte of the coefficients.
    bricks: Columns,
    leaf_count: u32,
    /// As the columns of the leaf table.
    leaves: Columns,
    of: PhantomData<T>,
}

const LEAF_COLUMNS: usize = 8;

impl<'a, T: Stored> FieldSink<'a, T> {
    fn new(
        path: &'a Path,
        out: &'a mut dyn Write,
        frame: Frame,
        marks: &FieldMeta,
    ) -> Result<Self, FormatError> {
        let Frame {
            lattice,
            slope,
            level_count,
        } = &frame;
        valid::frame(lattice, *level_count as u64, *slope, marks.iso)
            .and_then(|()| valid::lengths([&marks.density_unit].into_iter(), &FieldMeta::default()))
            .map_err(|wrong| made_wrongly(wrong).at(path))?;
        begin::<T>(out, lattice, *slope, *level_count, marks).map_err(|e| writing(path, e))?;
        let columns = |count| Columns::new(directory_of(path), count).map_err(|e| writing(path, e));
        Ok(Self {
            path,
            out,
            frame,
            chunk_count: 1,
            level: 0,
            last: None,
            brick_count: 0,
            bricks: columns(2 + T::BYTES)?,
            leaf_count: 0,
            leaves: columns(LEAF_COLUMNS)?,
            of: PhantomData,
        })
    }

    /// Takes the next brick. Levels come in order, and on each of them keys do. One without functions is left out.
    ///
    /// # Errors
    /// [`Fault::Output`] for functions that the lattice does not have, and coefficients that are no numbers; I/O.
    ///
    /// # Panics
    /// If bricks are out of order, or on a level that the frame does not have.
    pub fn brick(
        &mut self,
        level: usize,
        key: BrickKey,
        functions: &Corrections<T>,
    ) -> Result<(), FormatError> {
        if functions.count() == 0 {
            return Ok(());
        }
        assert!(
            self.level <= level && level < self.frame.level_count,
            "levels come in order"
        );
        while self.level < level {
            self.end_level()?;
        }
        assert!(self.last.is_none_or(|last| last < key), "bricks come in order");
        self.last = Some(key);
        let checked = valid::brick(&self.frame.lattice, level, key, functions);
        checked.map_err(|wrong| made_wrongly(wrong).at(self.path))?;
        self.brick_count = more("bricks of a level", self.brick_count).map_err(|f| f.at(self.path))?;
        self.put_brick(key, functions).map_err(|e| writing(self.path, e))
    }

    fn put_brick(&mut self, key: BrickKey, functions: &Corrections<T>) -> io::Result<()> {
        for k in key.0 {
            self.bricks.put(0, &k.to_le_bytes())?;
        }
        for word in functions.mask() {
            self.bricks.put(1, &word.to_le_bytes())?;
        }
        for value in functions.values() {
            for (i, byte) in value.to_raw().as_ref().iter().enumerate() {
                self.bricks.put(2 + i, &[*byte])?;
            }
        }
        Ok(())
    }

    fn end_level(&mut self) -> Result<(), FormatError> {
        let mut written = || {
            let directory = directory_of(self.path);
            let next = Columns::new(directory, 2 + T::BYTES)?;
            let whole = std::mem::replace(&mut self.bricks, next);
            let mut head = (self.level as u32).to_le_bytes().to_vec();
            head.extend(self.brick_count.to_le_bytes());
            whole.write(self.out, directory, LEVEL, &head)
        };
        written().map_err(|e| writing(self.path, e))?;
        self.chunk_count += 1;
        self.level += 1;
        self.last = None;
        self.brick_count = 0;
        Ok(())
    }

    /// Takes the next leaf, in any order; the file keeps it.
    ///
    /// # Errors
    /// [`Fault::Output`] for errors that are no numbers; I/O.
    pub fn leaf(&mut self, leaf: &LeafRecord) -> Result<(), FormatError> {
        valid::leaves(std::slice::from_ref(leaf), &[]).map_err(|wrong| made_wrongly(wrong).at(self.path))?;
        self.leaf_count = more("leaves", self.leaf_count).map_err(|f| f.at(self.path))?;
        self.put_leaf(leaf).map_err(|e| writing(self.path, e))
    }

    fn put_leaf(&mut self, leaf: &LeafRecord) -> io::Result<()> {
        self.leaves.put(0, &[leaf.level])?;
        self.leaves.put(1, &[leaf.reason])?;
        for (axis, cell) in leaf.cell.iter().enumerate() {
            self.leaves.put(2 + axis, &cell.to_le_bytes())?;
        }
        self.leaves.put(5, &leaf.sample_count.to_le_bytes())?;
        self.leaves.put(6, &leaf.rms.to_le_bytes())?;
        self.leaves.put(7, &leaf.max.to_le_bytes())
    }

    fn finish(mut self, texts: &FieldMeta) -> Result<(), FormatError> {
        valid::lengths(
            [&texts.report, &texts.provenance].into_iter().chain(&texts.notes),
            texts,
        )
        .map_err(|wrong| made_wrongly(wrong).at(self.path))?;
        while self.level < self.frame.level_count {
            self.end_level()?;
        }
        let path = self.path;
        self.put_rest(texts).map_err(|e| writing(path, e))
    }

    fn put_rest(mut self, texts: &FieldMeta) -> io::Result<()> {
        if self.leaf_count > 0 {
            let head = self.leaf_count.to_le_bytes();
            self.leaves
                .write(self.out, directory_of(self.path), LEAVES, &head)?;
            self.chunk_count += 1;
        }
        for (kind, raw) in beside::texts(texts) {
            chunk::write(self.out, kind, &raw)?;
            self.chunk_count += 1;
        }
        chunk::write(self.out, END, &self.chunk_count.to_le_bytes())
    }
}

fn writing(path: &Path, source: io::Error) -> FormatError {
    Fault::Io {
        doing: "writing",
        source,
    }
    .at(path)
}

/// Counts have 32 bits.
fn more(what: &'static str, count: u32) -> Result<u32, Fault> {
    count.checked_add(1).ok_or_else(|| Fault::Output {
        what,
        value: "more than 4294967295".into(),
        remedy: "a field file holds no more; fit a part of the volume",
    })
}
