//! What a first look at a scan is fitted to.

use formats::points::PointCloud;
use formats::{Kind, Unit};

use super::failure::Outcome;
use super::fit_choice::Choice;
use super::input::{self, Input};
use super::source::Source;
use super::volume_choice::VolumeChoice;

/// Voxels along an axis of which no more than every second is left out.
const VOXELS: usize = 128;
/// Points of a cloud that are looked at.
const POINTS: usize = 30_000;
/// Finest level of clouds and meshes: 64 cells along the box. Of volumes: a knot every second voxel.
const DEPTHS: [u8; 2] = [6, 1];

/// Has every so many voxels of a volume read, unless the user chose how many.
pub fn volume(source: &Source, choice: &mut VolumeChoice, unit: Option<Unit>) -> Outcome {
    let part = choice.options(unit)?;
    if matches!(input::kind(source, choice, &part)?, Kind::Volume(_)) {
        let preview = formats::volumes::peek(source.path(), &part).map_err(|e| source.reading(e))?;
        choice.stride_by_default(preview.header.dims.map(|n| (n / VOXELS).max(1)));
    }
    Ok(())
}

/// Keeps every so many points of a cloud, and leaves fine levels out unless the user asked for them.
pub fn input(input: &mut Input, choice: &mut Choice) {
    let is_volume = matches!(input, Input::Volume(_));
    choice.max_depth.get_or_insert(DEPTHS[usize::from(is_volume)]);
    if let Input::Cloud(cloud) = input {
        thin_out(cloud, cloud.positions.len().div_ceil(POINTS));
    }
}

fn thin_out(cloud: &mut PointCloud, step: usize) {
    if step > 1 {
        let every = |all: &mut Vec<glam::DVec3>| *all = all.iter().copied().step_by(step).collect();
        every(&mut cloud.positions);
        cloud.normals.as_mut().map(every);
        cloud
            .notes
            .push(format!("--coarse: one of {step} points was looked at"));
    }
}
