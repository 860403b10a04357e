use std::num::NonZeroUsize;
use std::path::PathBuf;

use bspline::{Field, Frame};
use formats::FormatError;
use formats::volumes::{Grid, Preview, StoreAs, save_slices};

use super::convert::VOLUMES;
use super::cost::Cost;
use super::failure::Outcome;
use super::field::OpenField;
use super::input::{check_output, reading, remaining, writing};
use super::progress::Bar;
use super::quantity::{Memory, human_bytes};
use super::summary::Summary;
use super::volume_choice::VolumeChoice;
use super::{Failure, interrupt, set_threads};

/// Arguments of `isoclay sample`.
#[derive(clap::Args)]
pub struct Args {
    /// Field (.iclay)
    field: PathBuf,
    /// Volume whose grid is taken; its densities are not read
    #[arg(long, value_name = "VOLUME")]
    like: PathBuf,
    /// Volume to write, 32-bit floats (.nii, .nii.gz, .nrrd, .mha, .vti)
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
    #[command(flatten)]
    volume: VolumeChoice,
}

/// Slices that are evaluated at a time: enough for the threads to share, few enough to hold.
const SLAB: usize = 16;

/// Writes the field at the voxel centres of another volume and holds no more than a few slices of it.
pub fn run(args: &Args) -> Outcome {
    let cost = Cost::start();
    check_output(&args.output, &VOLUMES)?;
    set_threads(args.threads)?;
    let cancel = interrupt::cancel();
    let Preview { header, notes, .. } =
        formats::volumes::peek(&args.like, &args.volume.options(None)?).map_err(reading)?;
    let open = OpenField::load(&args.field)?;
    let [nx, ny, nz] = header.dims;
    let depth = SLAB.min(nz);
    let needed = (nx * ny * depth) as u64 * size_of::<f64>() as u64;
    if args.memory.is_some_and(|m| needed > remaining(m)) {
        return Err(Failure::limit(format!(
            "{}: {depth} slices of {nx} × {ny} voxels need {}, more than --memory leaves; raise it",
            args.like.display(),
            human_bytes(needed)
        )));
    }
    let frame = voxel_frame(&header);
    let grid = Grid {
        dims: header.dims,
        world_from_voxel: header.world_from_voxel,
        unit: header.unit,
    };
    let bar = Bar::new();
    let mut slab = vec![0f64; nx * ny * depth];
    let fill = |z: usize, slice: &mut [f32]| {
        let first = z - z % depth;
        let thick = depth.min(nz - first);
        let slab = &mut slab[..nx * ny * thick];
        if z == first {
            interrupt::check(&cancel)?;
            bar.show("sampling", z as f64 / nz as f64);
            slab_values(open.field(), &frame, first, [nx, ny, thick], slab);
        }
        for (y, row) in slice.chunks_exact_mut(nx).enumerate() {
            for (x, value) in row.iter_mut().enumerate() {
                *value = slab[(x * ny + y) * thick + (z - first)] as f32;
            }
        }
        Ok::<(), Stopped>(())
    };
    save_slices(&args.output, &grid, StoreAs::Float32, fill).map_err(|e| e.0)?;
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

/// What ended the writing.
struct Stopped(Failure);

impl From<Failure> for Stopped {
    fn from(f: Failure) -> Self {
        Self(f)
    }
}

impl From<FormatError> for Stopped {
    fn from(e: FormatError) -> Self {
        Self(writing(e))
    }
}

/// The grid whose nodes are the voxel centres.
pub fn voxel_frame(header: &formats::volumes::VolumeHeader) -> Frame {
    // The last node of an axis is the last voxel; a frame has at least one cell, a volume may have one voxel.
    Frame {
        world_from_grid: header.world_from_voxel,
        cells: header.dims.map(|n| (n as u32 - 1).max(1)),
    }
}

/// [`Field::frame_values`] of the slices from `z0` on, their sheets of x shared among the threads.
fn slab_values(field: &dyn Field, frame: &Frame, z0: usize, count: [usize; 3], out: &mut [f64]) {
    use rayon::prelude::*;
    // Whole sheets of x, so that parts lie together in memory.
    let sheets = count[0].div_ceil(rayon::current_num_threads()).max(1);
    out.par_chunks_mut(sheets * count[1] * count[2])
        .enumerate()
        .for_each(|(part, out)| {
            let first = [(part * sheets) as i64, 0, z0 as i64];
            let thick = out.len() / (count[1] * count[2]);
            field.frame_values(frame, first, [thick, count[1], count[2]], out);
        });
}
