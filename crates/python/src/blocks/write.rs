//! The field file of a volume from the parts of its blocks. Of bricks those of one first key are held at a time, of leaves
//! those of one layer.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{Read, SeekFrom};
use std::path::PathBuf;

use bspline::HierarchicalSpline;
use bspline::hierarchical::{BrickKey, Corrections};
use document::with_report;
use fitting::{Control, FitReport, StopReason};
use formats::field::{FieldMeta, FieldSink, Frame, LeafRecord, SourceKind, save_stream};
use formats::{Fault, Unit};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;

use super::rank::Rank;
use super::ticket::Ticket;
use super::{LEAF, lattice};
use crate::arrays::affine;
use crate::failure::Failure;
use crate::field::unit_of;
use crate::run::{Wishes, run};

/// All blocks, z fastest, and what the field of the volume is besides.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Blocks {
    path: PathBuf,
    /// The part of each block.
    parts: Vec<Ticket>,
    /// Of each block the rms residuals of its leaves, f32, x fastest, then the largest.
    leaves: Vec<Ticket>,
    /// Of each block, see `finished_block`.
    digests: Vec<PyBackedBytes>,
    /// First voxel of the blocks, and that behind their last, on each axis.
    cuts: [Vec<[u32; 2]>; 3],
    shape: [u32; 3],
    affine: [[f64; 4]; 3],
    level_count: usize,
    slope: f64,
    iso: Option<f64>,
    unit: Option<String>,
    tolerance: f64,
    notes: Vec<String>,
    provenance: String,
}

/// Writes the field file; returns the field's hash.
#[pyfunction]
pub fn write_blocks(py: Python<'_>, blocks: Blocks, wishes: Wishes) -> PyResult<String> {
    let unit = unit_of(blocks.unit.as_deref())?;
    let frame = Frame {
        lattice: lattice(blocks.shape, affine(blocks.affine)),
        slope: blocks.slope,
        level_count: blocks.level_count,
    };
    run(py, &wishes, move |control| blocks.write(frame, unit, control))
}

impl Blocks {
    fn write(&self, frame: Frame, unit: Unit, control: &mut Control) -> Result<String, Failure> {
        let marks = FieldMeta {
            source: SourceKind::Volume,
            unit,
            iso: self.iso,
            provenance: self.provenance.clone(),
            ..FieldMeta::default()
        };
        save_stream(&self.path, &frame, &marks, |sink| {
            for level in 0..frame.level_count {
                self.put_level(level, &frame, sink, control)?;
            }
            let report = self.put_leaves(&frame, sink, control)?;
            Ok::<_, Failure>(with_report(marks.clone(), &report))
        })?;
        let digest = HierarchicalSpline::<f32>::sha256_of_bricks(&frame.lattice, frame.slope, self.bricks()?);
        Ok(digest.iter().map(|byte| format!("{byte:02x}")).collect())
    }

    fn bricks(&self) -> Result<BTreeMap<BrickKey, [u8; 32]>, Failure> {
        let mut all = BTreeMap::new();
        for (key, digest) in (self.digests.iter()).flat_map(|d| d.chunks_exact(44).map(|d| d.split_at(12))) {
            let word = |i: usize| u32::from_le_bytes(std::array::from_fn(|b| key[4 * i + b]));
            let digest = digest.try_into().expect("44 bytes less 12");
            if all
                .insert(BrickKey([word(0), word(1), word(2)]), digest)
                .is_some()
            {
                return Err(Failure::value("two blocks have one brick; give each block once"));
            }
        }
        Ok(all)
    }

    fn put_level(
        &self,
        level: usize,
        frame: &Frame,
        sink: &mut FieldSink<f32>,
        control: &mut Control,
    ) -> Result<(), Failure> {
        let in_slab = self.cuts[1].len() * self.cuts[2].len();
        let slab_count = self.cuts[0].len();
        for (slab, parts) in self.parts.chunks(in_slab).enumerate() {
            let share = (level as f64 + slab as f64 / slab_count as f64) / (frame.level_count + 1) as f64;
            control.step("writing the field", share)?;
            let indices: Vec<_> = parts.iter().map(Ticket::index).collect::<Result<_, _>>()?;
            let pages = indices.iter().flat_map(|index| index.pages());
            let planes: BTreeSet<u32> = pages.filter(|page| page.0 == level).map(|page| page.1).collect();
            for x in planes {
                let mut plane: Vec<(BrickKey, _)> = Vec::new();
                for (part, index) in parts.iter().zip(&indices) {
                    let page = index.page(&mut part.open()?, &frame.lattice, (level, x));
                    plane.extend(page.map_err(|fault| part.failed(fault))?);
                }
                plane.sort_unstable_by_key(|(key, _)| *key);
                for (key, functions) in plane {
                    let functions: &Corrections<f32> = &functions;
                    sink.brick(level, key, functions)?;
                }
            }
        }
        Ok(())
    }

    /// Writes the leaves, layer by layer, and says what they say of the whole. The 95th percentile is that of their rms
    /// residuals.
    fn put_leaves(
        &self,
        frame: &Frame,
        sink: &mut FieldSink<f32>,
        control: &mut Control,
    ) -> Result<FitReport, Failure> {
        let cells = frame.lattice.cells;
        let [nx, ny, nz] = cells.map(|n| n as usize);
        let (mut count, mut squares, mut largest) = (0.0, 0.0, 0.0_f64);
        let mut rank = Rank::new();
        let (mut rms, mut max) = (vec![0.0_f32; nx * ny], vec![0.0_f32; nx * ny]);
        for z in 0..nz {
            if z % 8 == 0 {
                let share =
                    (frame.level_count as f64 + z as f64 / nz as f64) / (frame.level_count + 1) as f64;
                control.step("writing the leaves", share)?;
            }
            self.layer(z as u32, cells, &mut rms, &mut max)?;
            for (i, (&rms, &max)) in rms.iter().zip(&max).enumerate() {
                let cell = [i % nx, i / nx, z].map(|c| c as u32);
                let leaf = LeafRecord {
                    level: 0,
                    cell,
                    sample_count: self.sample_count(cell, cells),
                    rms,
                    max,
                    reason: match f64::from(rms) > self.tolerance && self.tolerance > 0.0 {
                        true => StopReason::Depth,
                        false => StopReason::Tolerance,
                    } as u8,
                };
                sink.leaf(&leaf)?;
                let samples = f64::from(leaf.sample_count);
                count += samples;
                squares += samples * f64::from(rms).powi(2);
                largest = largest.max(f64::from(max));
                rank.see(rms);
            }
        }
        rank.settle(nx * ny * nz * 95 / 100);
        for ((bx, by, bz), leaves) in self.places().zip(&self.leaves) {
            let length: usize = [(0, bx), (1, by), (2, bz)]
                .map(|(a, b)| self.cells_of(a, b, cells).len())
                .iter()
                .product();
            for rms in numbers(leaves, 0, length)? {
                rank.look_closer(rms);
            }
        }
        Ok(FitReport {
            input_count: count as usize,
            used_count: count as usize,
            depth: frame.level_count - 1,
            rms: (squares / f64::max(count, 1.0)).sqrt(),
            p95: rank.value(),
            max: largest,
            bound: largest,
            tolerance: self.tolerance,
            notes: self.notes.clone(),
            ..FitReport::default()
        })
    }

    /// Places of the blocks, in their order.
    fn places(&self) -> impl Iterator<Item = (usize, usize, usize)> {
        let [nx, ny, nz] = self.cuts.each_ref().map(Vec::len);
        (0..nx).flat_map(move |x| (0..ny).flat_map(move |y| (0..nz).map(move |z| (x, y, z))))
    }

    /// Leaves of a block along an axis.
    fn cells_of(&self, axis: usize, block: usize, cells: [u32; 3]) -> std::ops::Range<u32> {
        let [low, high] = self.cuts[axis][block];
        let end = if high >= self.shape[axis] {
            cells[axis]
        } else {
            high / LEAF
        };
        low / LEAF..end
    }

    /// Voxels of a leaf; the very last one of an axis belongs to the last cell.
    fn sample_count(&self, cell: [u32; 3], cells: [u32; 3]) -> u32 {
        let along = |a: usize| match cell[a] + 1 == cells[a] {
            true => self.shape[a] - LEAF * cell[a],
            false => LEAF,
        };
        (0..3).map(along).product()
    }

    /// The errors of the leaves with a cell `z`, x fastest.
    fn layer(&self, z: u32, cells: [u32; 3], rms: &mut [f32], max: &mut [f32]) -> Result<(), Failure> {
        for ((bx, by, bz), leaves) in self.places().zip(&self.leaves) {
            let deep = self.cells_of(2, bz, cells);
            if !deep.contains(&z) {
                continue;
            }
            let (wide, high) = (self.cells_of(0, bx, cells), self.cells_of(1, by, cells));
            let area = wide.len() * high.len();
            let before = (z - deep.start) as usize * area;
            for (start, to) in [(before, &mut *rms), (before + area * deep.len(), &mut *max)] {
                let from = numbers(leaves, start, area)?;
                for (y, row) in high.clone().zip(from.chunks(wide.len())) {
                    to[(y * cells[0] + wide.start) as usize..][..wide.len()].copy_from_slice(row);
                }
            }
        }
        Ok(())
    }
}

/// So many floats of a table, from one of them on.
fn numbers(ticket: &Ticket, start: usize, count: usize) -> Result<Vec<f32>, Failure> {
    let mut source = ticket.open()?;
    let mut bytes = vec![0; 4 * count];
    (source.seek(SeekFrom::Start(4 * start as u64)))
        .and_then(|_| source.read_exact(&mut bytes))
        .map_err(|source| {
            let doing = "reading the errors of a block";
            ticket.failed(Fault::Io { doing, source })
        })?;
    Ok((bytes.as_chunks().0.iter())
        .map(|b| f32::from_le_bytes(*b))
        .collect())
}
