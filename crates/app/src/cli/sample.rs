use std::num::NonZeroUsize;
use std::path::PathBuf;

use bspline::{Field, Frame};
use clap::builder::PossibleValuesParser;
use fitting::Cancel;
use formats::FormatError;
use formats::field::SourceKind;
use formats::volumes::{Grid, Preview, StoreAs, VolumeHeader, VoxelType, save_slices};
use glam::{DAffine3, DVec3};

use super::convert::VOLUMES;
use super::cost::Cost;
use super::failure::Outcome;
use super::field::FieldArgs;
use super::input::{self, limits, remaining};
use super::output::Output;
use super::progress::Bar;
use super::quantity::{Memory, human_bytes, human_number, threads};
use super::source::{self, Source};
use super::store::{self, Clipped};
use super::summary::Summary;
use super::volume_choice::VolumeChoice;
use super::{Failure, interrupt, set_threads};

/// Arguments of `isoclay sample`.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    field: FieldArgs,
    /// Volume whose grid is taken, or with --spacing its box; its densities are not read; - reads standard input
    #[arg(long, value_name = "VOLUME")]
    like: PathBuf,
    /// Volume to write (.nii, .nii.gz, .nrrd, .mha, .vti); - writes to standard output
    #[arg(short, long, value_name = "OUT")]
    pub output: PathBuf,
    /// Format of the output where its name does not tell it [default for -: nii]
    #[arg(long, value_name = "FORMAT", value_parser = PossibleValuesParser::new(VOLUMES))]
    format: Option<String>,
    /// Type of the voxels to write: float32, or whole numbers (uint8, int16, ...), to which densities are rounded and by
    /// whose range they are held [default: the type of VOLUME if the field was fitted to a volume and the values fit, else
    /// float32]
    #[arg(long, value_name = "TYPE")]
    store: Option<VoxelType>,
    /// Memory that the process may hold, such as 2GiB
    #[arg(long, value_name = "SIZE")]
    memory: Option<Memory>,
    /// Threads to work with [default: all cores]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<NonZeroUsize>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    volume: VolumeChoice,
}

/// Slices that are evaluated at a time: enough for the threads to share, few enough to hold.
const SLAB: usize = 16;

/// Writes the field at the voxel centres of another volume and holds no more than a few slices of it.
pub fn run(args: &Args) -> Outcome {
    let cost = Cost::start();
    let cancel = interrupt::cancel();
    let like = Source::open(&args.like, None, source::VOLUMES, &cancel)?.under("--like");
    let field = args.field.source(&cancel)?;
    let output = Output::check(
        "-o",
        &args.output,
        &VOLUMES,
        args.format.as_deref(),
        &[&field, &like],
    )?;
    let asked = args.store.map(store::asked).transpose()?;
    set_threads(args.threads)?;
    let mut choice = args.volume.clone();
    let spacing = choice.take_spacing_of_other();
    let part = choice.options(None)?;
    input::kind(&like, &choice, &part)?;
    let Preview {
        mut header,
        mut notes,
        ..
    } = formats::volumes::peek(like.path(), &part).map_err(|e| like.reading(e))?;
    if let Some(spacing) = spacing {
        notes.extend(resample(&mut header, spacing)?);
    }
    let open = args.field.load_placed(&field)?;
    let [nx, ny, nz] = header.dims;
    let depth = SLAB.min(nz);
    let needed = (nx as u64 * ny as u64)
        .saturating_mul(depth as u64)
        .saturating_mul(size_of::<f64>() as u64);
    if needed > args.memory.map_or(limits(None).max_bytes, remaining) {
        return Err(Failure::limit(format!(
            "{}: {depth} slices of {nx} × {ny} voxels need {}, more than the memory ceiling leaves; raise --memory",
            like.name(),
            human_bytes(needed)
        )));
    }
    let bar = Bar::new();
    let mut slabs = Slabs {
        field: open.field(),
        frame: voxel_frame(&header),
        dims: header.dims,
        depth,
        values: vec![0f64; nx * ny * depth],
        cancel: &cancel,
        bar: &bar,
    };
    let store = match asked {
        Some(store) => store,
        None if open.source() != SourceKind::Volume || !header.stored.is_integer() => StoreAs::Float32,
        None => {
            let keeps_scale = output
                .path()
                .to_string_lossy()
                .trim_end_matches(".gz")
                .ends_with(".nii");
            let (store, note) = store::like(&header, slabs.range()?, keeps_scale);
            notes.extend(note);
            store
        }
    };
    let grid = Grid {
        dims: header.dims,
        world_from_voxel: header.world_from_voxel,
        unit: header.unit,
    };
    let mut clipped = Clipped::new(store);
    let fill = |z: usize, slice: &mut [f32]| {
        slabs.slice(z, slice)?;
        clipped.count(slice);
        Ok::<(), Stopped>(())
    };
    save_slices(output.path(), &grid, store, fill).map_err(|e| match e {
        Stopped::Format(e) => output.writing(e),
        Stopped::Work(f) => f,
    })?;
    notes.extend(asked.and_then(|_| clipped.note(header.voxel_count())));
    bar.clear();
    Summary {
        input_count: Some(header.voxel_count()),
        field_sha256: Some(open.sha256()),
        notes,
        ..Default::default()
    }
    .with_cost(&cost)
    .print_after(&output, args.json)
}

/// Puts voxels of another size into the box of a volume; tells the size if it had to change for that.
fn resample(header: &mut VolumeHeader, wanted: [f64; 3]) -> Outcome<Option<String>> {
    const MOST: f64 = (1 << 24) as f64;
    let old = header.dims.map(|n| n as f64);
    let lengths = header.spacing().to_array();
    let counts: [f64; 3] = std::array::from_fn(|a| (old[a] * lengths[a] / wanted[a]).round().max(1.0));
    if let Some(a) = (0..3).find(|&a| counts[a] > MOST) {
        return Err(Failure::usage(format!(
            "--spacing {}: makes {} voxels along an axis of length {}; give a larger spacing",
            wanted[a],
            counts[a],
            human_number(old[a] * lengths[a])
        )));
    }
    // The box reaches half a voxel beyond the centres of the outer voxels.
    let step = DVec3::from_array(old) / DVec3::from_array(counts);
    header.world_from_voxel =
        header.world_from_voxel * DAffine3::from_translation(0.5 * step - 0.5) * DAffine3::from_scale(step);
    header.dims = counts.map(|n| n as usize);
    let found = header.spacing();
    let is_off = (0..3).any(|a| (found[a] - wanted[a]).abs() > 1e-4 * wanted[a]);
    Ok(is_off.then(|| {
        format!(
            "voxels of {} {}, so that the box holds a whole number of them",
            found.to_array().map(human_number).join(" × "),
            header.unit
        )
    }))
}

/// What ended the writing.
enum Stopped {
    Format(FormatError),
    Work(Failure),
}

impl From<Failure> for Stopped {
    fn from(f: Failure) -> Self {
        Self::Work(f)
    }
}

impl From<FormatError> for Stopped {
    fn from(e: FormatError) -> Self {
        Self::Format(e)
    }
}

/// The grid whose nodes are the voxel centres.
pub fn voxel_frame(header: &VolumeHeader) -> Frame {
    // The last node of an axis is the last voxel; a frame has at least one cell, a volume may have one voxel.
    Frame {
        world_from_grid: header.world_from_voxel,
        cells: header.dims.map(|n| (n as u32 - 1).max(1)),
    }
}

/// A field at the nodes of a frame, some slices at a time.
struct Slabs<'a> {
    field: &'a dyn Field,
    frame: Frame,
    dims: [usize; 3],
    depth: usize,
    /// The slab of the last slice asked for; z fastest.
    values: Vec<f64>,
    cancel: &'a Cancel,
    bar: &'a Bar,
}

impl Slabs<'_> {
    /// Evaluates the slab that starts at slice `first`; returns how many slices it has.
    fn evaluate(&mut self, first: usize) -> Outcome<usize> {
        interrupt::check(self.cancel)?;
        let [nx, ny, nz] = self.dims;
        self.bar.show("sampling", first as f64 / nz as f64);
        let thick = self.depth.min(nz - first);
        let values = &mut self.values[..nx * ny * thick];
        slab_values(self.field, &self.frame, first, [nx, ny, thick], values);
        Ok(thick)
    }

    /// Smallest and largest value. Bounds of the field would not tell: its splines overshoot.
    fn range(&mut self) -> Outcome<[f64; 2]> {
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for first in (0..self.dims[2]).step_by(self.depth) {
            let thick = self.evaluate(first)?;
            let values = &self.values[..self.dims[0] * self.dims[1] * thick];
            range = values
                .iter()
                .fold(range, |[low, high], v| [low.min(*v), high.max(*v)]);
        }
        Ok(range)
    }

    /// Gives slice `z`, x fastest; slices are asked for in order.
    fn slice(&mut self, z: usize, slice: &mut [f32]) -> Outcome {
        let [nx, ny, nz] = self.dims;
        let first = z - z % self.depth;
        let thick = self.depth.min(nz - first);
        if z == first {
            self.evaluate(first)?;
        }
        for (y, row) in slice.chunks_exact_mut(nx).enumerate() {
            for (x, value) in row.iter_mut().enumerate() {
                *value = self.values[(x * ny + y) * thick + (z - first)] as f32;
            }
        }
        Ok(())
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

#[cfg(test)]
mod tests {
    use formats::Unit;
    use formats::volumes::Orientation;

    use super::*;

    #[test]
    fn resampling_keeps_the_box() {
        let map = DAffine3 {
            matrix3: glam::DMat3::from_cols(DVec3::new(0.0, 2.0, 0.0), DVec3::new(-3.0, 0.0, 0.0), DVec3::Z),
            translation: DVec3::new(10.0, 20.0, 30.0),
        };
        let before = VolumeHeader {
            dims: [10, 20, 1],
            world_from_voxel: map,
            unit: Unit::Millimetre,
            orientation: Orientation::Sform,
            stored: VoxelType::I16,
            rescale: None,
        };
        for (wanted, dims, is_exact) in [
            ([1.0, 1.0, 0.5], [20, 60, 2], true),
            ([4.0; 3], [5, 15, 1], false),
            ([0.7; 3], [29, 86, 1], false),
        ] {
            let mut header = before.clone();
            assert_eq!(
                resample(&mut header, wanted).unwrap().is_none(),
                is_exact,
                "{wanted:?}"
            );
            assert_eq!(header.dims, dims);
            let ends = |h: &VolumeHeader| {
                let last = DVec3::from_array(h.dims.map(|n| n as f64)) - 0.5;
                [DVec3::splat(-0.5), last].map(|p| h.world_from_voxel.transform_point3(p))
            };
            for (a, b) in ends(&before).into_iter().zip(ends(&header)) {
                assert!((a - b).length() < 1e-12, "{a} became {b}");
            }
        }
        assert!(resample(&mut before.clone(), [1e-9; 3]).is_err());
    }
}
