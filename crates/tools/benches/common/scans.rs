//! The scans of the repository, fitted as the command line does without options.

use std::path::PathBuf;

use fitting::Control;
use fitting::points::{OrientedPoints, PointOptions, fit_points};
use fitting::volume::{VolumeOptions, VolumeView, fit_volume, otsu_threshold};
use formats::ReadLimits;
use tools::study::Sculpture;

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../data")
        .join(name)
}

pub fn bunny() -> Sculpture {
    let cloud = formats::points::read(&data("bunny.obj.gz"), &ReadLimits::default());
    let cloud = cloud.expect("a scan of the repository");
    let points = OrientedPoints {
        positions: &cloud.positions,
        normals: cloud.normals.as_ref().expect("it has faces"),
        certainty: None,
    };
    let fitted = fit_points(&points, &PointOptions::default(), &mut Control::default());
    Sculpture {
        name: "bunny".into(),
        field: fitted.expect("a clean cloud").0,
        iso: 0.0,
    }
}

pub fn head() -> Sculpture {
    let (as_it_is, limits) = (formats::volumes::VolumeOptions::default(), ReadLimits::default());
    let volume = formats::volumes::read(&data("head.nii.gz"), &as_it_is, &limits);
    let volume = volume.expect("a scan of the repository");
    let view = VolumeView {
        dims: volume.header.dims,
        values: (&volume.values).into(),
        world_from_voxel: volume.header.world_from_voxel,
    };
    let fitted = fit_volume(&view, &VolumeOptions::default(), &mut Control::default());
    Sculpture {
        name: "head".into(),
        field: fitted.expect("a volume").0,
        iso: otsu_threshold(&volume.values).expect("two kinds of matter"),
    }
}
