//! Volumes that other programs wrote, against what those programs read from them
//! (`tests/data/volumes/make_fixtures.py`), and parts of them against the whole.

use std::path::PathBuf;

use formats::volumes::{self, Volume, VolumeOptions};
use formats::{Kind, ReadLimits, Unit, detect};
use glam::DVec3;
use proptest::prelude::*;
use serde_json::Value;

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data/volumes")
        .join(name)
}

fn numbers(value: &Value) -> Vec<f64> {
    let all = value.as_array().unwrap().iter();
    all.map(|v| v.as_f64().unwrap()).collect()
}

fn expected() -> Vec<(String, Value)> {
    let text = std::fs::read_to_string(data("expected.json")).unwrap();
    let all: serde_json::Map<_, _> = serde_json::from_str(&text).unwrap();
    assert!(all.len() >= 25);
    all.into_iter().collect()
}

fn read(name: &str, options: &VolumeOptions) -> Volume {
    volumes::read(&data(name), options, &ReadLimits::default()).unwrap()
}

#[test]
fn geometry_and_values_are_those_of_the_other_reader() {
    for (name, expected) in expected() {
        let volume = read(&name, &VolumeOptions::default());
        let dims: Vec<_> = numbers(&expected["dims"]).iter().map(|n| *n as usize).collect();
        assert_eq!(volume.header.dims[..], dims, "{name}");
        let values: Vec<f64> = volume.values.iter().map(|v| f64::from(*v)).collect();
        assert_eq!(values, numbers(&expected["values"]), "{name}");
        // NIfTI has single precision only.
        let slack = if name.ends_with(".hdr") { 1e-5 } else { 1e-9 };
        let map = volume.header.world_from_voxel;
        for (row, rows) in expected["rows"].as_array().unwrap().iter().enumerate() {
            let m = map.matrix3;
            let found = [m.x_axis[row], m.y_axis[row], m.z_axis[row], map.translation[row]];
            for (a, b) in found.iter().zip(numbers(rows)) {
                assert!(
                    (a - b).abs() <= slack,
                    "{name}: row {row} is {found:?}, not {rows}"
                );
            }
        }
    }
}

#[test]
fn what_is_seen_before_reading_is_what_is_read() {
    for (name, _) in expected() {
        let path = data(&name);
        let Kind::Volume(format) = detect(&path).unwrap() else {
            panic!("{name} is no volume");
        };
        let preview = volumes::peek(&path, &VolumeOptions::default()).unwrap();
        let volume = read(&name, &VolumeOptions::default());
        assert_eq!(
            (preview.format, &preview.header),
            (format, &volume.header),
            "{name}"
        );
        let range = volumes::range(&path, &VolumeOptions::default(), &ReadLimits::default()).unwrap();
        let fold = |f: fn(f32, f32) -> f32| volume.values.iter().copied().reduce(f).unwrap();
        assert_eq!((range.min, range.max), (fold(f32::min), fold(f32::max)), "{name}");
        // The need that is told suffices, and less than the voxels does not.
        let limits = |max_bytes| ReadLimits { max_bytes };
        volumes::read(&path, &VolumeOptions::default(), &limits(preview.read_bytes))
            .unwrap_or_else(|e| panic!("{e}"));
        let too_few = preview.header.voxel_count() as u64 * 4 - 1;
        assert!(volumes::read(&path, &VolumeOptions::default(), &limits(too_few)).is_err());
    }
}

#[test]
fn a_unit_is_known_where_the_file_names_one() {
    for (name, unit) in [
        ("uint16_imagej.tif", Unit::Millimetre),
        ("uint16_one_page_imagej.tif", Unit::Millimetre),
        ("float64_strips_deflate.tif", Unit::Unknown),
        ("int16_text_pynrrd.nrrd", Unit::Millimetre),
        ("int8_spacings_pynrrd.nrrd", Unit::Millimetre),
        ("float32_gzip_itk.nrrd", Unit::Unknown),
        ("float64_itk.mha", Unit::Unknown),
        ("int16_itk.hdr", Unit::Millimetre),
    ] {
        let volume = read(name, &VolumeOptions::default());
        assert_eq!(volume.header.unit, unit, "{name}");
        let is_noted = volume
            .notes
            .iter()
            .any(|n| n.contains("unit") || n.contains("in voxels"));
        assert_eq!(is_noted, unit == Unit::Unknown, "{name}: {:?}", volume.notes);
    }
    let stated = VolumeOptions {
        spacing_mm: Some([0.5, 2.0, 3.0]),
        ..Default::default()
    };
    let volume = read("float64_itk.mha", &stated);
    assert_eq!(volume.header.unit, Unit::Millimetre);
    assert!((volume.header.spacing() - DVec3::new(0.5, 2.0, 3.0)).length() < 1e-12);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..Default::default() })]

    /// Voxel (x, y, z) of a part is voxel `from + stride·(x, y, z)` of the whole, at the same place in the world.
    #[test]
    fn a_part_has_the_voxels_of_the_whole_where_they_are(
        which in any::<prop::sample::Index>(),
        corners in [any::<[prop::sample::Index; 2]>(), any::<[prop::sample::Index; 2]>(), any::<[prop::sample::Index; 2]>()],
        stride in [1usize..4, 1usize..4, 1usize..4],
    ) {
        let all = expected();
        let name = &all[which.index(all.len())].0;
        let whole = read(name, &VolumeOptions::default());
        let dims = whole.header.dims;
        let region: [[usize; 2]; 3] = std::array::from_fn(|a| {
            let [i, j] = corners[a].map(|c| c.index(dims[a]));
            [i.min(j), i.max(j) + 1]
        });
        let options = VolumeOptions { region: Some(region), stride, ..Default::default() };
        let part = read(name, &options);
        let preview = volumes::peek(&data(name), &options).unwrap();
        prop_assert_eq!(&preview.header, &part.header);
        prop_assert_eq!(preview.file_dims, dims);
        let limits = ReadLimits { max_bytes: preview.read_bytes };
        prop_assert!(volumes::read(&data(name), &options, &limits).is_ok());
        let [nx, ny, nz] = part.header.dims;
        for z in 0..nz {
            for y in 0..ny {
                for x in 0..nx {
                    let at = [x, y, z];
                    let w: [usize; 3] = std::array::from_fn(|a| region[a][0] + stride[a] * at[a]);
                    prop_assert!((0..3).all(|a| w[a] < region[a][1]));
                    let value = whole.values[w[0] + dims[0] * (w[1] + dims[1] * w[2])];
                    prop_assert_eq!(part.values[x + nx * (y + ny * z)], value);
                    let place = |h: &volumes::VolumeHeader, v: [usize; 3]| {
                        h.world_from_voxel.transform_point3(DVec3::from_array(v.map(|n| n as f64)))
                    };
                    prop_assert!((place(&part.header, at) - place(&whole.header, w)).length() < 1e-12);
                }
            }
        }
    }
}

#[test]
fn regions_and_strides_that_cannot_be_are_refused() {
    let path = data("uint16_imagej.tif");
    for (region, stride) in [
        (Some([[0, 6], [0, 4], [0, 3]]), [1; 3]),
        (Some([[2, 2], [0, 4], [0, 3]]), [1; 3]),
        (Some([[3, 2], [0, 4], [0, 3]]), [1; 3]),
        (None, [1, 0, 1]),
    ] {
        let options = VolumeOptions {
            region,
            stride,
            ..Default::default()
        };
        assert!(volumes::peek(&path, &options).is_err(), "{region:?} {stride:?}");
    }
    let options = VolumeOptions {
        stride: [usize::MAX; 3],
        ..Default::default()
    };
    assert_eq!(volumes::peek(&path, &options).unwrap().header.dims, [1; 3]);
}

#[test]
fn revised_volumes_keep_every_byte_but_those_of_the_voxels_changed() {
    let scratch = tempfile::tempdir().unwrap();
    let limits = ReadLimits::default();
    let mut seen = 0;
    let of_nibabel = data("..").read_dir().unwrap().map(|e| e.unwrap().path());
    let of_others = expected().into_iter().map(|(name, _)| data(&name));
    for like in of_nibabel
        .filter(|p| p.to_string_lossy().contains(".nii"))
        .chain(of_others)
    {
        let name = like.display().to_string();
        if !matches!(detect(&like), Ok(Kind::Volume(volumes::VolumeFormat::Nifti))) {
            let options = VolumeOptions::default();
            let e = volumes::save_revised(
                &like,
                &options,
                &[],
                &[0; 32],
                &scratch.path().join("x.nii"),
                &limits,
            );
            assert!(
                e.unwrap_err().to_string().contains("convert the scan to .nii"),
                "{name}"
            );
            continue;
        }
        let Ok(before) = volumes::read(&like, &VolumeOptions::default(), &limits) else {
            continue;
        };
        let size = before.header.stored.size();
        let changes: Vec<_> = (0..before.values.len())
            .step_by(5)
            .map(|voxel| volumes::Change {
                voxel,
                density: f64::from(before.values[(voxel + 1) % before.values.len()]),
            })
            .collect();
        for output in ["out.nii", "out.nii.gz"].map(|n| scratch.path().join(n)) {
            let options = VolumeOptions::default();
            let told = volumes::save_revised(&like, &options, &changes, &[0; 32], &output, &limits).unwrap();
            let after = volumes::read(&output, &options, &limits).unwrap();
            assert_eq!(after.header, before.header);
            for (voxel, value) in after.values.iter().enumerate() {
                let expected = match voxel % 5 {
                    0 => before.values[(voxel + 1) % before.values.len()],
                    _ => before.values[voxel],
                };
                assert_eq!(value.to_bits(), expected.to_bits(), "{name}: voxel {voxel}");
            }
            assert_eq!(
                (told.clamped, told.rounding < 1e-3),
                (0, true),
                "{name}: {told:?}"
            );
        }
        let plain = |path: &std::path::Path| {
            let bytes = std::fs::read(path).unwrap();
            let mut out = Vec::new();
            match bytes.starts_with(&[0x1f, 0x8b]) {
                true => drop(std::io::Read::read_to_end(
                    &mut flate2::read::MultiGzDecoder::new(&bytes[..]),
                    &mut out,
                )),
                false => out = bytes,
            }
            out
        };
        let (old, new) = (plain(&like), plain(&scratch.path().join("out.nii")));
        assert_eq!(old.len(), new.len(), "{name}");
        let differ: Vec<usize> = (0..old.len()).filter(|i| old[*i] != new[*i]).collect();
        let first = old.len() - before.values.len() * size;
        let is_touched = |byte: usize| byte >= first && ((byte - first) / size).is_multiple_of(5);
        assert!(differ.iter().all(|byte| is_touched(*byte)), "{name}");
        seen += 1;
    }
    assert!(seen >= 4, "{seen} files");
}
