//! `isoclay fit --coarse`: a first look.

use crate::common::{Bench, number};

/// Every so many voxels and points are looked at, of a box as large; what the user chose stays.
#[test]
fn a_first_look_takes_a_part_of_the_samples() {
    let bench = Bench::new();
    bench.json("phantom head -o head.nii --size 132");
    bench.json("phantom torus -o cloud.ply --count 31000");
    let used = |command: &str| number(&bench.json(command), "used_count");
    let (voxels, points) = (132f64.powi(3), 31_000f64);
    // Of 132 voxels none may be left out: 128 have to remain along each axis.
    assert_eq!(used("fit head.nii -o head.iclay --coarse"), voxels);
    assert_eq!(
        used("fit head.nii -o head.iclay --coarse --stride 2"),
        voxels / 8.0
    );
    let coarse = bench.json("fit cloud.ply -o cloud.iclay --coarse");
    assert_eq!(number(&coarse, "used_count"), points / 2.0);
    assert!(number(&coarse, "depth") <= 6.0);
    // The surface is where it is, though other points speak for it.
    let check = bench.json("check cloud.iclay cloud.ply -o report --anyway");
    assert!(number(&check, "rms") < 0.01, "{check}");
}
