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
    assert!(save("v.mhd", DIMS, StoreAs::Float32).contains("supported: .nii, .nii.gz, .nrrd"));
    for name in ["v.mha", "v.nrrd", "v.vti"] {
        assert!(save(name, DIMS, integer(VoxelType::I16, 0.5)).contains("slope 0.5"));
        assert!(save(name, DIMS, integer(VoxelType::F64, 1.0)).contains("float64"));
        assert!(save(name, [0, 1, 1], StoreAs::Float32).contains("dimension of 0"));
    }
    assert_eq!(std::fs::read_dir(&directory).unwrap().count(), 0);
}

/// Any map, any unit, floats and integers; what is written in double precision comes back to its last digits.
mod maps {
    use super::*;
    use formats::FormatError;
    use formats::volumes::{Grid, VolumeFormat};
    use proptest::prelude::*;

    fn any_map() -> impl Strategy<Value = DAffine3> {
        let axis = || prop::array::uniform3(-1.0..1.0);
        let spacing = prop::array::uniform3(0.01..10.0);
        (
            axis(),
            -3.0..3.0,
            spacing,
            any::<bool>(),
            prop::array::uniform3(-1e6..1e6),
        )
            .prop_map(|(axis, angle, spacing, is_mirrored, offset)| {
                let axis = DVec3::from_array(axis) + DVec3::new(0.0, 0.0, 1.5);
                let turn = DMat3::from_axis_angle(axis.normalize(), angle);
                let flip = DVec3::new(1.0, 1.0, if is_mirrored { -1.0 } else { 1.0 });
                DAffine3 {
                    matrix3: turn * DMat3::from_diagonal(DVec3::from_array(spacing) * flip),
                    translation: DVec3::from_array(offset),
                }
            })
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..Default::default() })]

        #[test]
        fn double_precision_formats_keep_any_map(map in any_map(), unit in 0u8..5, as_integer in any::<bool>()) {
            let unit = Unit::from_code(unit).unwrap();
            let scale = unit.in_mm().unwrap_or(1.0);
            let directory = tempfile::tempdir().unwrap();
            for (name, format) in [("v.nrrd", VolumeFormat::Nrrd), ("v.mha", VolumeFormat::MetaImage)] {
                let path = directory.path().join(name);
                let grid = Grid { dims: DIMS, world_from_voxel: map, unit };
                let store = if as_integer {
                    StoreAs::Integer { voxel: VoxelType::I16, slope: 1.0, intercept: 0.0 }
                } else {
                    StoreAs::Float32
                };
                let mut asked = Vec::new();
                volumes::save_slices(&path, &grid, store, |z, out| {
                    asked.push(z);
                    out.copy_from_slice(&values()[21 * z..][..21]);
                    Ok::<(), FormatError>(())
                })
                .unwrap();
                prop_assert_eq!(asked, [0, 1]);
                prop_assert_eq!(std::fs::read_dir(&directory).unwrap().count(), 1, "scratch files are gone");
                let v = volumes::read(&path, &Default::default(), &ReadLimits::default()).unwrap();
                let preview = volumes::peek(&path, &Default::default()).unwrap();
                prop_assert_eq!(preview.format, format);
                let stored: Vec<f32> =
                    values().iter().map(|v| if as_integer { v.round() } else { *v }).collect();
                prop_assert_eq!(&v.values, &stored);
                let expected = if unit == Unit::Unknown { unit } else { Unit::Millimetre };
                prop_assert_eq!(v.header.unit, expected);
                // Axes within 4 roundings of theirs; 1e-6 mm at the far corner.
                let corner = DVec3::new(6.0, 2.0, 1.0);
                for p in [DVec3::ZERO, corner] {
                    let there = map.transform_point3(p) * scale;
                    let found = v.header.world_from_voxel.transform_point3(p);
                    prop_assert!((there - found).length() <= 1e-15 * there.length() + 1e-13 * scale, "{} {}", there, found);
                }
                std::fs::remove_file(&path).unwrap();
            }
        }
    }

    #[test]
    fn an_error_of_the_slices_is_handed_on_and_leaves_the_old_file() {
        #[derive(Debug, PartialEq)]
        enum Stop {
            Here(usize),
            Format,
        }
        impl From<FormatError> for Stop {
            fn from(_: FormatError) -> Self {
                Self::Format
            }
        }
        let directory = tempfile::tempdir().unwrap();
        let grid = Grid {
            dims: DIMS,
            world_from_voxel: map(),
            unit: Unit::Millimetre,
        };
        for name in ["v.nii", "v.nii.gz", "v.nrrd", "v.mha", "v.vti"] {
            let path = directory.path().join(name);
            std::fs::write(&path, "old").unwrap();
            let stopped = volumes::save_slices(&path, &grid, StoreAs::Float32, |z, _| match z {
                1 => Err(Stop::Here(z)),
                _ => Ok(()),
            });
            assert_eq!(stopped, Err(Stop::Here(1)), "{name}");
            assert_eq!(std::fs::read(&path).unwrap(), b"old", "{name}");
        }
        let nowhere = volumes::save_slices(
            &directory.path().join("v.txt"),
            &grid,
            StoreAs::Float32,
            |_, _| Ok(()),
        );
        assert_eq!(nowhere, Err(Stop::Format));
        assert_eq!(std::fs::read_dir(&directory).unwrap().count(), 5);
    }
}

/// Numbers of four volumes after each other: volume `t` holds `t·42 + i`.
fn four() -> Vec<f32> {
    (0..4 * 42).map(|i| i as f32).collect()
}

fn number(path: &std::path::Path, volume: Option<usize>) -> Result<volumes::Volume, formats::FormatError> {
    let options = volumes::VolumeOptions {
        volume,
        ..Default::default()
    };
    volumes::read(path, &options, &ReadLimits::default())
}

/// Each of the four volumes of `path`, the refusal without a choice, and that of a fifth.
fn holds_four(path: &std::path::Path) {
    let name = path.display();
    let e = number(path, None).unwrap_err();
    assert_eq!(e.fault.choice(), Some(formats::Choice::Volume), "{name}: {e}");
    assert!(e.to_string().contains("volumes in the file is 4"), "{name}: {e}");
    for t in 0..4 {
        let v = number(path, Some(t)).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(v.header.dims, DIMS, "{name}");
        assert_eq!(v.values, four()[42 * t..42 * (t + 1)], "{name}");
        assert!(
            v.notes
                .iter()
                .any(|n| *n == format!("volume {t} of 4, counted from 0")),
            "{name}: {:?}",
            v.notes
        );
        let options = volumes::VolumeOptions {
            volume: Some(t),
            region: Some([[1, 6], [0, 3], [1, 2]]),
            stride: [2, 1, 1],
            ..Default::default()
        };
        let part = volumes::read(path, &options, &ReadLimits::default()).unwrap();
        assert_eq!(
            part.values[..3],
            [22.0, 24.0, 26.0].map(|i| i + 42.0 * t as f32),
            "{name}"
        );
    }
    let e = number(path, Some(4)).unwrap_err().to_string();
    assert!(e.contains("4 of 4"), "{name}: {e}");
}

#[test]
fn one_volume_of_several_is_chosen_by_its_number() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let bytes = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();

    // NIfTI of four axes, and of two and two beyond the third.
    let mut nifti = Vec::new();
    let long = [7, 3, 8];
    volumes::write_nifti(
        &mut nifti,
        long,
        &four(),
        &map(),
        Unit::Millimetre,
        StoreAs::Float32,
    )
    .unwrap();
    for dim in [[4i16, 7, 3, 2, 4, 1, 1, 1], [5, 7, 3, 2, 2, 2, 1, 1]] {
        for (i, n) in dim.into_iter().enumerate() {
            nifti[40 + 2 * i..42 + 2 * i].copy_from_slice(&n.to_le_bytes());
        }
        std::fs::write(at("a.nii"), &nifti).unwrap();
        holds_four(&at("a.nii"));
    }
    let mut gz = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut gz, &nifti).unwrap();
    std::fs::write(at("a.nii.gz"), gz.finish().unwrap()).unwrap();
    holds_four(&at("a.nii.gz"));
    // Counts whose product is beyond all bounds, and voxels that are not there.
    for (dim, part) in [
        ([32767i16; 4], "number of voxels"),
        ([4, 1, 1, 2], "needs 1344 bytes, 672"),
    ] {
        let mut forged = nifti.clone();
        forged[40..42].copy_from_slice(&7i16.to_le_bytes());
        for (i, n) in dim.into_iter().enumerate() {
            forged[48 + 2 * i..50 + 2 * i].copy_from_slice(&n.to_le_bytes());
        }
        std::fs::write(at("b.nii"), &forged).unwrap();
        let e = number(&at("b.nii"), Some(0)).unwrap_err().to_string();
        assert!(e.contains(part), "{e}");
    }

    // NRRD: the axis of time last, first, and without a word about any axis.
    let interleaved: Vec<f32> = (0..4 * 42).map(|i| four()[42 * (i % 4) + i / 4]).collect();
    let head = |sizes: &str, kinds: &str| {
        format!("NRRD0004\ntype: float\ndimension: 4\nsizes: {sizes}\n{kinds}endian: little\nencoding: raw\n")
    };
    for (name, sizes, kinds, values) in [
        ("t.nrrd", "7 3 2 4", "kinds: domain domain domain time\n", four()),
        ("n.nrrd", "7 3 2 4", "", four()),
        (
            "l.nrrd",
            "4 7 3 2",
            "kinds: list domain domain domain\n",
            interleaved.clone(),
        ),
        (
            "d.nrrd",
            "4 7 3 2",
            "space: RAS\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\n",
            interleaved.clone(),
        ),
    ] {
        let whole = [head(sizes, kinds).as_bytes(), b"\n", &bytes(&values)].concat();
        std::fs::write(at(name), whole).unwrap();
        holds_four(&at(name));
    }
    // In files of their own, a volume each.
    for (t, part) in four().chunks_exact(42).enumerate() {
        std::fs::write(at(&format!("p{t}.raw")), bytes(part)).unwrap();
    }
    let listed = format!("{}data file: p%d.raw 0 3 1\n", head("7 3 2 4", ""));
    std::fs::write(at("p.nhdr"), listed).unwrap();
    holds_four(&at("p.nhdr"));
    let middle = [
        head("7 3 4 2", "kinds: domain domain time domain\n").as_bytes(),
        b"\n",
        &bytes(&four()),
    ]
    .concat();
    std::fs::write(at("m.nrrd"), middle).unwrap();
    let e = number(&at("m.nrrd"), Some(0)).unwrap_err().to_string();
    assert!(e.contains("before or after"), "{e}");

    // The channels of MetaImage stand together.
    let header = "NDims = 3\nDimSize = 7 3 2\nElementNumberOfChannels = 4\nElementType = MET_FLOAT\n\
                  BinaryDataByteOrderMSB = False\nElementSpacing = 1 1 1\nElementDataFile = LOCAL\n";
    std::fs::write(at("c.mha"), [header.as_bytes(), &bytes(&interleaved)].concat()).unwrap();
    holds_four(&at("c.mha"));
}
