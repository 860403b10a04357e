//! Volumes written and read again; repairs of their voxels.

use formats::volumes::{self, StoreAs, VoxelType};
use formats::{Fault, ReadLimits, Unit};
use glam::{DAffine3, DMat3, DVec3};

const DIMS: [usize; 3] = [7, 3, 2];

fn map() -> DAffine3 {
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.4);
    DAffine3 {
        matrix3: turn * DMat3::from_diagonal(DVec3::new(0.5, -0.75, 2.0)),
        translation: DVec3::new(-90.5, 12.25, 7.0),
    }
}

fn values() -> Vec<f32> {
    (0..42).map(|i| i as f32 * 1.37 - 20.0).collect()
}

#[test]
fn float32_comes_back_to_the_bit_plain_and_gzipped() {
    let directory = tempfile::tempdir().unwrap();
    for name in ["v.nii", "v.nii.gz"] {
        let path = directory.path().join(name);
        volumes::save(&path, DIMS, &values(), &map(), Unit::Millimetre, StoreAs::Float32).unwrap();
        let v = volumes::read(&path, &Default::default(), &ReadLimits::default()).unwrap();
        assert_eq!(
            (v.values, v.header.dims, v.header.unit),
            (values(), DIMS, Unit::Millimetre)
        );
        let error = (v.header.world_from_voxel.matrix3 - map().matrix3).to_cols_array();
        assert!(
            error.iter().all(|e| e.abs() < 2e-7),
            "single precision: {error:?}"
        );
        assert_eq!(v.header.world_from_voxel.translation, map().translation);
        let gzipped = std::fs::read(&path).unwrap().starts_with(&[0x1f, 0x8b]);
        assert_eq!(gzipped, name.ends_with("gz"));
    }
}

#[test]
fn integers_come_back_within_half_a_step_and_are_held_to_their_range() {
    for voxel in [
        VoxelType::U8,
        VoxelType::I8,
        VoxelType::U16,
        VoxelType::I16,
        VoxelType::U32,
        VoxelType::I64,
    ] {
        let mut out = Vec::new();
        let store = StoreAs::Integer {
            voxel,
            slope: 0.5,
            intercept: -24.0,
        };
        volumes::write_nifti(&mut out, DIMS, &values(), &map(), Unit::Unknown, store).unwrap();
        let v = volumes::parse_nifti(&out, &ReadLimits::default()).unwrap();
        assert_eq!((v.header.stored, v.header.unit), (voxel, Unit::Unknown));
        let top = if voxel == VoxelType::I8 {
            -24.0 + 0.5 * 127.0
        } else {
            f32::MAX
        };
        for (a, b) in v.values.iter().zip(values()) {
            assert!((a - b.min(top)).abs() <= 0.25, "{voxel}: {a} for {b}");
        }
    }
}

#[test]
fn other_units_are_written_as_millimetres_and_metres_are_read_so() {
    let mut out = Vec::new();
    let cm = |v: f64| DAffine3::from_scale(DVec3::splat(v));
    volumes::write_nifti(
        &mut out,
        DIMS,
        &values(),
        &cm(0.25),
        Unit::Centimetre,
        StoreAs::Float32,
    )
    .unwrap();
    let v = volumes::parse_nifti(&out, &ReadLimits::default()).unwrap();
    assert_eq!(
        (v.header.spacing(), v.header.unit),
        (DVec3::splat(2.5), Unit::Millimetre)
    );
    out[123] = 1;
    let v = volumes::parse_nifti(&out, &ReadLimits::default()).unwrap();
    assert_eq!(
        (v.header.spacing(), v.header.unit),
        (DVec3::splat(2500.0), Unit::Millimetre)
    );
}

#[test]
fn nan_voxels_become_the_smallest_density_and_are_counted() {
    let mut bad = values();
    bad[5] = f32::NAN;
    bad[6] = f32::INFINITY;
    let mut out = Vec::new();
    volumes::write_nifti(&mut out, DIMS, &bad, &map(), Unit::Millimetre, StoreAs::Float32).unwrap();
    let v = volumes::parse_nifti(&out, &ReadLimits::default()).unwrap();
    assert_eq!((v.replaced_count, v.values[5], v.values[6]), (2, -20.0, -20.0));
    assert!(v.notes[0].contains("2 of 42 voxels"), "{:?}", v.notes);

    let mut out = Vec::new();
    let nothing = vec![f32::NAN; 42];
    volumes::write_nifti(
        &mut out,
        DIMS,
        &nothing,
        &map(),
        Unit::Millimetre,
        StoreAs::Float32,
    )
    .unwrap();
    let e = volumes::parse_nifti(&out, &ReadLimits::default())
        .unwrap_err()
        .to_string();
    assert!(e.contains("0 of 42"), "{e}");
}

#[test]
fn the_memory_need_is_known_before_and_the_ceiling_holds() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("v.nii.gz");
    volumes::save(&path, DIMS, &values(), &map(), Unit::Millimetre, StoreAs::Float32).unwrap();
    let needed = volumes::peek(&path, &Default::default()).unwrap().read_bytes;
    assert!(volumes::read(&path, &Default::default(), &ReadLimits { max_bytes: needed }).is_ok());
    let e = volumes::read(
        &path,
        &Default::default(),
        &ReadLimits {
            max_bytes: needed - 1,
        },
    )
    .unwrap_err();
    assert!(matches!(e.fault, Fault::Limit { .. }), "{e}");
}

#[test]
fn what_nifti_cannot_hold_is_refused_and_no_file_is_left() {
    let directory = tempfile::tempdir().unwrap();
    let save = |name: &str, dims: [usize; 3], store| {
        let path = directory.path().join(name);
        let values = vec![0.0; dims.iter().product()];
        volumes::save(&path, dims, &values, &map(), Unit::Millimetre, store)
            .unwrap_err()
            .to_string()
    };
    let integer = |voxel, slope| StoreAs::Integer {
        voxel,
        slope,
        intercept: 0.0,
    };
    assert!(save("v.nii", [40_000, 1, 1], StoreAs::Float32).contains("dimension of 40000"));
    assert!(save("v.nii", DIMS, integer(VoxelType::U8, 0.0)).contains("slope 0"));
    assert!(save("v.nii", DIMS, integer(VoxelType::F64, 1.0)).contains("float64"));
    assert!(save("v.mha", DIMS, StoreAs::Float32).contains("supported: .nii and .nii.gz"));
    assert_eq!(std::fs::read_dir(&directory).unwrap().count(), 0);
}
