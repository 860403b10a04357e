//! The type of the voxels that a volume is written with.

use formats::volumes::{StoreAs, VolumeHeader, VoxelType};

use super::failure::{Failure, Outcome};
use super::quantity::human_number;

/// Whole numbers are too coarse for densities whose range has fewer steps than this.
const FEWEST_STEPS: f64 = 64.0;

/// Densities as whole numbers of this type.
pub fn whole(voxel: VoxelType) -> StoreAs {
    StoreAs::Integer {
        voxel,
        slope: 1.0,
        intercept: 0.0,
    }
}

/// What the user asked for.
///
/// # Errors
/// Wrong usage for a type that no volume is written with.
pub fn asked(voxel: VoxelType) -> Outcome<StoreAs> {
    match voxel {
        VoxelType::F32 => Ok(StoreAs::Float32),
        VoxelType::F64 => Err(Failure::usage(
            "--store float64: densities have single precision; take float32",
        )),
        voxel => Ok(whole(voxel)),
    }
}

/// The type of the volume `like`, if it holds densities from `low` to `high` in steps that are fine enough, else floats;
/// and a note that says what that does to them. `keeps_scale` tells whether the format has a scale for its voxels.
pub fn like(like: &VolumeHeader, [low, high]: [f64; 2], keeps_scale: bool) -> (StoreAs, Option<String>) {
    if !like.stored.is_integer() {
        return (StoreAs::Float32, None);
    }
    let [slope, intercept] = like.rescale.unwrap_or([1.0, 0.0]);
    let scaled = keeps_scale.then_some((like.stored, slope, intercept));
    let plain = [like.stored, VoxelType::I16, VoxelType::I32].map(|voxel| (voxel, 1.0, 0.0));
    // A fractional scale has fractional densities.
    let is_whole = slope.fract() == 0.0 && intercept.fract() == 0.0;
    let candidates = scaled.into_iter().chain(plain.into_iter().filter(|_| is_whole));
    let holds = |&(voxel, slope, intercept): &(VoxelType, f64, f64)| {
        let (least, most) = voxel.range();
        let ends = [low, high].map(|v| ((v - intercept) / slope).round());
        ends.iter().all(|e| (least..=most).contains(e)) && (high - low) / slope.abs() >= FEWEST_STEPS
    };
    match candidates.into_iter().find(holds) {
        Some((voxel, slope, intercept)) => {
            let note = format!(
                "densities are stored as {voxel}, rounded by up to {}; --store float32 keeps them",
                human_number(0.5 * slope.abs())
            );
            let store = StoreAs::Integer {
                voxel,
                slope,
                intercept,
            };
            (store, Some(note))
        }
        None => {
            let stored = like.stored;
            let note = if is_whole || keeps_scale {
                let (low, high) = (human_number(low), human_number(high));
                format!(
                    "densities are stored as float32: those from {low} to {high} are beyond the range of {stored}, or it is too \
                     coarse for them"
                )
            } else {
                format!(
                    "densities are stored as float32: those of the volume are {stored} in steps of {}, which this format \
                     cannot state (.nii can)",
                    human_number(slope.abs())
                )
            };
            (StoreAs::Float32, Some(note))
        }
    }
}

/// Counts what the range of an integer type cuts off.
pub struct Clipped {
    range: Option<(VoxelType, f64, f64)>,
    count: usize,
}

impl Clipped {
    /// Nothing so far.
    pub fn new(store: StoreAs) -> Self {
        let range = match store {
            StoreAs::Integer {
                voxel,
                slope: 1.0,
                intercept: 0.0,
            } => Some((voxel, voxel.range().0 - 0.5, voxel.range().1 + 0.5)),
            _ => None,
        };
        Self { range, count: 0 }
    }

    /// Looks at densities that are about to be written.
    pub fn count(&mut self, values: &[f32]) {
        if let Some((_, low, high)) = self.range {
            let is_out = |v: &&f32| !(low..=high).contains(&f64::from(**v));
            self.count += values.iter().filter(is_out).count();
        }
    }

    /// What an explicit choice of the type did to `total` densities.
    pub fn note(&self, total: usize) -> Option<String> {
        let (voxel, ..) = self.range?;
        let (least, most) = voxel.range();
        Some(if self.count > 0 {
            format!(
                "densities are rounded to whole numbers; {} of {total} lie outside of {voxel} and were held to {least} or \
                 {most}",
                self.count
            )
        } else {
            format!("densities are rounded to whole numbers; all lie in the range of {voxel}")
        })
    }
}

#[cfg(test)]
mod tests {
    use formats::Unit;
    use formats::volumes::Orientation;
    use glam::DAffine3;

    use super::*;

    fn header(stored: VoxelType, rescale: Option<[f64; 2]>) -> VolumeHeader {
        VolumeHeader {
            dims: [4; 3],
            world_from_voxel: DAffine3::IDENTITY,
            unit: Unit::Millimetre,
            orientation: Orientation::Spacings,
            stored,
            rescale,
        }
    }

    #[test]
    fn the_type_of_the_other_volume_is_taken_where_it_serves() {
        use VoxelType::*;
        let found = |stored, rescale, range, keeps| match like(&header(stored, rescale), range, keeps).0 {
            StoreAs::Float32 => None,
            StoreAs::Integer { voxel, slope, .. } => Some((voxel, slope)),
        };
        assert_eq!(found(U8, None, [-0.4, 255.4], false), Some((U8, 1.0)));
        assert_eq!(
            found(U8, None, [-3.0, 255.0], false),
            Some((I16, 1.0)),
            "an overshoot"
        );
        assert_eq!(
            found(U8, None, [0.0, 1.0], false),
            None,
            "a mask would be all steps"
        );
        assert_eq!(found(F32, None, [0.0, 1000.0], false), None);
        assert_eq!(
            found(U16, Some([1.0, -1024.0]), [-1000.0, 3000.0], false),
            Some((I16, 1.0))
        );
        assert_eq!(
            found(U16, Some([1.0, -1024.0]), [-1000.0, 3000.0], true),
            Some((U16, 1.0))
        );
        assert_eq!(found(I16, Some([0.01, 0.0]), [0.0, 2.0], true), Some((I16, 0.01)));
        assert_eq!(
            found(I16, Some([0.01, 0.0]), [0.0, 200.0], false),
            None,
            "no scale to keep"
        );
        let why = like(&header(I16, Some([0.01, 0.0])), [0.0, 200.0], false)
            .1
            .unwrap();
        assert!(why.contains("steps of 0.01") && !why.contains("beyond"), "{why}");
        assert_eq!(found(I16, None, [0.0, 1e9], false), Some((I32, 1.0)));
        assert_eq!(found(I16, None, [0.0, 1e12], false), None);
    }

    #[test]
    fn what_is_cut_off_is_counted() {
        let mut clipped = Clipped::new(whole(VoxelType::U8));
        clipped.count(&[-0.4, -0.6, 255.4, 256.0, 7.0, f32::NAN]);
        assert!(
            clipped
                .note(6)
                .unwrap()
                .contains("3 of 6 lie outside of uint8 and were held to 0 or 255")
        );
        assert_eq!(Clipped::new(StoreAs::Float32).note(6), None);
    }
}
