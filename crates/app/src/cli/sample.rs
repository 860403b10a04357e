use std::num::NonZeroUsize;
use std::path::PathBuf;

use bspline::{Field, Frame};
use fitting::Cancel;
use formats::volumes::{Preview, StoreAs, VolumeOptions};

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

/// Voxels along x that are evaluated at a time.
const SLAB: usize = 16;

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
    let dims = header.dims;
    let needed = header.voxel_count() as u64 * 4;
    if args.memory.is_some_and(|m| needed > remaining(m)) {
        return Err(Failure::limit(format!(
            "{}: {} × {} × {} voxels need {}, more than --memory leaves; raise it",
            args.like.display(),
            dims[0],
            dims[1],
            dims[2],
            human_bytes(needed)
        )));
    }
    let frame = voxel_frame(&header);
    let bar = Bar::new();
    let mut values = vec![0f32; header.voxel_count()];
    let mut slab = vec![0f64; SLAB.min(dims[0]) * dims[1] * dims[2]];
    for x0 in (0..dims[0]).step_by(SLAB) {
        interrupt::check(&cancel)?;
        bar.show("sampling", x0 as f64 / dims[0] as f64);
        let thick = SLAB.min(dims[0] - x0);
        let slab = &mut slab[..thick * dims[1] * dims[2]];
        slab_values(open.field(), &frame, x0, [thick, dims[1], dims[2]], slab);
        for (row, line) in values.chunks_exact_mut(dims[0]).enumerate() {
            let (y, z) = (row % dims[1], row / dims[1]);
            for x in 0..thick {
                line[x0 + x] = slab[(x * dims[1] + y) * dims[2] + z] as f32;
            }
        }
    }
    bar.show("writing", 0.99);
    let map = header.world_from_voxel;
    formats::volumes::save(&args.output, dims, &values, &map, header.unit, StoreAs::Float32)
        .map_err(writing)?;
    bar.clear();
    Summary {
        input_count: Some(values.len()),
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

/// [`Field::frame_values`] of one slab, its rows shared among the threads.
fn slab_values(field: &dyn Field, frame: &Frame, x0: usize, count: [usize; 3], out: &mut [f64]) {
    use rayon::prelude::*;
    // Whole sheets of x, so that parts lie together in memory.
    let sheets = count[0].div_ceil(rayon::current_num_threads()).max(1);
    out.par_chunks_mut(sheets * count[1] * count[2])
        .enumerate()
        .for_each(|(part, out)| {
            let first = x0 + part * sheets;
            let thick = out.len() / (count[1] * count[2]);
            field.frame_values(frame, [first as i64, 0, 0], [thick, count[1], count[2]], out);
        });
}
