use std::num::NonZeroUsize;
use std::path::PathBuf;

use bspline::{Field, Frame};
use fitting::Cancel;
use formats::FormatError;
use formats::volumes::{Grid, Preview, StoreAs, VolumeOptions, save_slices};

use super::cost::Cost;
use super::failure::Outcome;
use super::field::OpenField;
use super::input::{check_output, reading, remaining, writing};
use super::progress::Bar;
use super::quantity::{Memory, human_bytes};
use super::summary::Summary;
use super::{Failure, interrupt, set_threads};

/// Arguments of `isoclay sample`.
#[derive(clap::Args)]
pub struct Args {
    /// Field (.iclay)
    field: PathBuf,
    /// Volume whose grid is taken (.nii, .nii.gz); its densities are not read
    #[arg(long, value_name = "VOLUME")]
    like: PathBuf,
    /// Volume to write: .nii or .nii.gz, 32-bit floats
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Memory that the process may hold, such as 2GiB
    #[arg(long, value_name = "SIZE")]
    memory: Option<Memory>,
    /// Threads to work with [default: all cores]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

/// Slices that are evaluated at a time: enough to share among threads, few enough to keep out of memory.
const SLAB: usize = 16;

/// Why the volume is not written.
struct Stopped(Failure);

impl From<FormatError> for Stopped {
    fn from(e: FormatError) -> Self {
        Self(writing(e))
    }
}

/// Writes the field at the voxel centres of another volume.
pub fn run(args: &Args) -> Outcome {
    let cost = Cost::start();
    check_output(&args.output, &["nii", "nii.gz"])?;
    set_threads(args.threads)?;
    let cancel = Cancel::new();
    interrupt::cancel_on_interrupt(&cancel)?;
    let Preview { header, notes, .. } =
        formats::volumes::peek(&args.like, &VolumeOptions::default()).map_err(reading)?;
    let open = OpenField::load(&args.field)?;
    let [nx, ny, nz] = header.dims;
    let slice = nx * ny;
    let needed = slice as u64 * (SLAB.min(nz) * size_of::<f64>() + size_of::<f32>()) as u64;
    if args.memory.is_some_and(|m| needed > remaining(m)) {
        return Err(Failure::limit(format!(
            "{}: {SLAB} slices of {nx} × {ny} voxels need {}, more than --memory leaves; raise it",
            args.like.display(),
            human_bytes(needed)
        )));
    }
    let frame = voxel_frame(&header);
    let bar = Bar::new();
    let grid = Grid {
        dims: header.dims,
        world_from_voxel: header.world_from_voxel,
        unit: header.unit,
    };
    let mut slab = vec![0f64; slice * SLAB.min(nz)];
    let written = save_slices(&args.output, &grid, StoreAs::Float32, |z, out| {
        let (z0, thick) = (z / SLAB * SLAB, SLAB.min(nz - z / SLAB * SLAB));
        if z == z0 {
            interrupt::check(&cancel).map_err(Stopped)?;
            bar.show("sampling", z as f64 / nz as f64);
            slab_values(
                open.field(),
                &frame,
                z0,
                [nx, ny, thick],
                &mut slab[..slice * thick],
            );
        }
        for (y, row) in out.chunks_exact_mut(nx).enumerate() {
            for (x, value) in row.iter_mut().enumerate() {
                *value = slab[(x * ny + y) * thick + z - z0] as f32;
            }
        }
        Ok(())
    });
    written.map_err(|Stopped(failure)| failure)?;
    bar.clear();
    Summary {
        input_count: Some(header.voxel_count()),
        field_sha256: Some(open.sha256()),
        output: Some(args.output.display().to_string()),
        notes,
        ..Default::default()
    }
    .with_cost(&cost)
    .print(args.json)
}

/// The grid whose nodes are the voxel centres.
pub fn voxel_frame(header: &formats::volumes::VolumeHeader) -> Frame {
    // The last node of an axis is the last voxel; a frame has at least one cell, a volume may have one voxel.
    Frame {
        world_from_grid: header.world_from_voxel,
        cells: header.dims.map(|n| (n as u32 - 1).max(1)),
    }
}

/// [`Field::frame_values`] of slices from `z0` on, their rows shared among the threads.
fn slab_values(field: &dyn Field, frame: &Frame, z0: usize, count: [usize; 3], out: &mut [f64]) {
    use rayon::prelude::*;
    // Whole sheets of x, so that parts lie together in memory.
    let sheets = count[0].div_ceil(rayon::current_num_threads()).max(1);
    out.par_chunks_mut(sheets * count[1] * count[2])
        .enumerate()
        .for_each(|(part, out)| {
            let first = part * sheets;
            let thick = out.len() / (count[1] * count[2]);
            field.frame_values(
                frame,
                [first as i64, 0, z0 as i64],
                [thick, count[1], count[2]],
                out,
            );
        });
}
