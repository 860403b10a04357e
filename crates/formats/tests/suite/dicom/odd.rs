//! Series that are not as they should be: each is refused by name, or does what its option says.

use std::path::{Path, PathBuf};

use formats::volumes::{self, DicomOptions, Tilt, Uneven, Volume, VolumeOptions};
use formats::{Choice, Fault, ReadLimits};
use glam::DVec3;
use tempfile::TempDir;

use super::writer::Picture;
use super::{agrees, data, read, read_with};

fn directory(pictures: &[Picture]) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    for (i, p) in pictures.iter().enumerate() {
        p.save(&directory.path().join(format!("{i:03}.dcm")));
    }
    directory
}

fn copy(from: &Path, to: &Path) -> PathBuf {
    std::fs::create_dir_all(to.parent().unwrap()).unwrap();
    std::fs::copy(from, to).unwrap();
    to.into()
}

#[track_caller]
fn refused(result: Result<Volume, String>, words: &[&str]) {
    let e = result.unwrap_err();
    assert!(words.iter().all(|w| e.contains(w)), "{words:?} in: {e}");
}

const RESAMPLE: DicomOptions = DicomOptions {
    series: None,
    uneven: Uneven::Resample,
    tilt: Tilt::Keep,
};

fn place(v: &Volume, x: usize, y: usize, z: usize) -> DVec3 {
    v.header
        .world_from_voxel
        .transform_point3(DVec3::new(x as f64, y as f64, z as f64))
}

fn value(v: &Volume, x: usize, y: usize, z: usize) -> f32 {
    v.values[x + v.header.dims[0] * (y + v.header.dims[1] * z)]
}

#[test]
fn a_tilted_gantry_keeps_every_voxel_where_it_was_measured() {
    let v = agrees(&data().join("tilted"), "tilted");
    assert!(
        v.notes.iter().any(|n| n.contains("18.000 degrees")),
        "{:?}",
        v.notes
    );
}

#[test]
fn a_tilted_gantry_is_resampled_upright_on_request() {
    // A density that is linear in space is the same on any grid.
    let density = |p: DVec3| 3.0 * p.x - 2.0 * p.y + 5.0 * p.z;
    let (sin, cos) = (0.28, 0.96);
    let pictures: Vec<Picture> = (0..5)
        .map(|k| {
            let mut p = Picture::axial(0.0);
            (p.columns, p.rows) = (5, 7);
            p.position = [1.0, 2.0, 2.0 * f64::from(k)];
            p.orientation = [1.0, 0.0, 0.0, 0.0, cos, sin];
            let at = |i: i32| {
                let (x, y) = (f64::from(i % 5), f64::from(i / 5));
                DVec3::from_array(p.position) + DVec3::new(x, y * cos, y * sin)
            };
            // Stored in hundredths, so that the numbers are exact.
            p.pixels = (0..35).map(|i| (100.0 * density(at(i))).round() as i16).collect();
            p.with(0x0028_1053, b"DS", "0.01").with(0x0028_1052, b"DS", "0")
        })
        .collect();
    for reversed in [false, true] {
        let mut pictures = pictures.clone();
        if reversed {
            // The drift the other way: the grid begins before the first slice.
            pictures.iter_mut().enumerate().for_each(|(k, p)| {
                p.orientation[5] = -sin;
                let at = |i: i32| {
                    let (x, y) = (f64::from(i % 5), f64::from(i / 5));
                    DVec3::new(1.0 + x, 2.0 + y * cos, 2.0 * k as f64 - y * sin)
                };
                p.pixels = (0..35).map(|i| (100.0 * density(at(i))).round() as i16).collect();
            });
        }
        let directory = directory(&pictures);
        let options = DicomOptions {
            tilt: Tilt::Resample,
            ..Default::default()
        };
        let v = read_with(directory.path(), options).unwrap();
        let [x, y, z] = v
            .header
            .world_from_voxel
            .matrix3
            .to_cols_array_2d()
            .map(DVec3::from_array);
        assert!(x.dot(z).abs() < 1e-12 && y.dot(z).abs() < 1e-12, "upright");
        // A drift of 2·0.28 pixels a slice over 4 steps: 2.24, so 3 rows more.
        assert_eq!(v.header.dims, [5, 10, 5]);
        let least = v.values.iter().copied().fold(f32::INFINITY, f32::min);
        let mut empty = 0;
        for z in 0..5 {
            for y in 0..10 {
                for x in 0..5 {
                    let p = place(&v, x, y, z);
                    let lps = DVec3::new(-p.x, -p.y, p.z);
                    let got = value(&v, x, y, z);
                    if got == least && (f64::from(got) - density(lps)).abs() > 0.1 {
                        empty += 1;
                    } else {
                        assert!((f64::from(got) - density(lps)).abs() < 0.02, "{x} {y} {z}: {got}");
                    }
                }
            }
        }
        assert!(v.replaced_count >= empty && empty > 0);
        // 3 rows of 10 are outside in each slice, one more where the slice falls between rows.
        assert_eq!(v.replaced_count, 5 * (3 + 4 * 4));
    }
}

#[test]
fn uneven_slices_are_refused_with_the_distances_and_resampled_on_request() {
    let path = data().join("uneven");
    refused(
        read(&path),
        &[
            "uneven",
            "2.000000 mm between 0.dcm and 1.dcm",
            "5.000000 mm between 3.dcm and 4.dcm",
            "resampling",
        ],
    );
    let e = volumes::read(&path, &VolumeOptions::default(), &ReadLimits::default()).unwrap_err();
    assert_eq!(e.fault.choice(), Some(Choice::Uneven));
    let v = read_with(&path, RESAMPLE).unwrap();
    assert_eq!(v.header.dims, [6, 5, 7]);
    // The densities are linear along z, which linear interpolation keeps.
    for z in 0..7 {
        for y in 0..5 {
            for x in 0..6 {
                let mm = place(&v, x, y, z).z;
                let expected = 0.5 * (100.0 + 40.0 * mm + (3 * x + 7 * y) as f64) - 20.0;
                assert!((f64::from(value(&v, x, y, z)) - expected).abs() < 1e-4);
            }
        }
    }
    assert_eq!(place(&v, 0, 0, 6).z, 12.0);
    assert!(
        v.notes.iter().any(|n| n.contains("interpolated")),
        "{:?}",
        v.notes
    );
}

#[test]
fn a_missing_slice_is_refused_with_its_neighbours_and_filled_on_request() {
    let whole = read(&data().join("ct")).unwrap();
    let directory = tempfile::tempdir().unwrap();
    for k in [0, 1, 3, 4, 5] {
        let name = format!("IM{k:04}.dcm");
        copy(&data().join("ct").join(&name), &directory.path().join(&name));
    }
    refused(
        read(directory.path()),
        &[
            "with 1 missing",
            "between IM0003.dcm and IM0001.dcm",
            "2.750000 mm",
        ],
    );
    let v = read_with(directory.path(), RESAMPLE).unwrap();
    assert_eq!(v.header.dims, whole.header.dims);
    let slice = 80;
    for (i, (a, b)) in v.values.iter().zip(&whole.values).enumerate() {
        // Files run against the normal: IM0002 is slice 3.
        if i / slice == 3 {
            let mean = (whole.values[i - slice] + whole.values[i + slice]) / 2.0;
            assert!((a - mean).abs() < 1e-3);
        } else {
            assert_eq!(a, b, "what is there stays as it is");
        }
    }
}

#[test]
fn a_scout_within_the_series_is_refused_by_its_name() {
    refused(
        read(&data().join("mixed")),
        &["mixed", "scout.dcm", "1 of 4", "a directory of their own"],
    );
}

#[test]
fn mixed_sizes_spacings_and_units_are_refused_by_name() {
    let usual = [Picture::axial(0.0), Picture::axial(1.0)];
    let mut wide = Picture::axial(2.0);
    (wide.columns, wide.rows) = (6, 2);
    let mut coarse = Picture::axial(2.0);
    coarse.spacing = [1.0, 2.0];
    let unit = |u: &str, z| Picture::axial(z).with(0x0028_1054, b"LO", u);
    let negative = Picture::axial(2.0).with(0x0028_0004, b"CS", "MONOCHROME1");
    for (odd, words) in [
        (wide, ["6 x 2", "4 x 3"]),
        (coarse, ["pixels of 2.0000 x 1.0000", "pixels of 1.0000 x 1.0000"]),
        (negative, ["MONOCHROME1", "MONOCHROME2"]),
        (unit("HU", 2.0), ["\"HU\"", "\"\""]),
    ] {
        let directory = directory(&[usual[0].clone(), usual[1].clone(), odd]);
        refused(read(directory.path()), &words);
        refused(read(directory.path()), &["002.dcm"]);
    }
}

#[test]
fn a_picture_aside_of_the_stack_is_refused() {
    let mut pictures: Vec<Picture> = (0..5).map(|k| Picture::axial(f64::from(k))).collect();
    pictures[2].position[0] = 0.3;
    refused(read(directory(&pictures).path()), &["0.3000 mm aside", "002.dcm"]);
}

#[test]
fn equal_copies_are_left_out_and_different_ones_refused() {
    let mut pictures: Vec<Picture> = (0..4).map(|k| Picture::axial(f64::from(k))).collect();
    let plain = read(directory(&pictures).path()).unwrap();
    pictures.push(pictures[1].clone());
    let v = read(directory(&pictures).path()).unwrap();
    assert_eq!((&v.values, &v.header), (&plain.values, &plain.header));
    assert!(v.notes.iter().any(|n| n.contains("004.dcm")), "{:?}", v.notes);
    pictures[4].pixels[7] += 1;
    refused(
        read(directory(&pictures).path()),
        &["different in 001.dcm and 004.dcm"],
    );
    // A whole volume twice is a time series.
    let twice: Vec<Picture> = (0..8).map(|k| Picture::axial(f64::from(k % 4))).collect();
    refused(
        read(directory(&twice).path()),
        &["2 on average (8 at 4)", "time series"],
    );
}

#[test]
fn two_volumes_in_a_directory_are_listed_and_chosen_by_number_or_identifier() {
    let mut pictures = Vec::new();
    for series in [7, 9] {
        for k in 0..3 {
            let mut p = Picture::axial(f64::from(k)).with(0x0008_103E, b"LO", format!("scan {series}"));
            p.series = series;
            p.pixels[0] = series as i16;
            pictures.push(p);
        }
    }
    let directory = directory(&pictures);
    refused(
        read(directory.path()),
        &[
            "2, of which 2",
            "7 CT \"scan 7\", 3 pictures of 4 x 3",
            "1.2.3.9",
            "by its number or identifier",
        ],
    );
    let choose = |name: &str| {
        let options = DicomOptions {
            series: Some(name.into()),
            ..Default::default()
        };
        read_with(directory.path(), options)
    };
    assert_eq!(choose("9").unwrap().values[0], 9.0);
    assert_eq!(choose("1.2.3.7").unwrap().values[0], 7.0);
    refused(choose("8"), &["asked for is \"8\"", "scan 7", "scan 9"]);
    // A file names its series.
    assert_eq!(read(&directory.path().join("004.dcm")).unwrap().values[0], 9.0);
}

#[test]
fn the_only_volume_is_taken_and_what_lies_beside_it_noted() {
    let mut pictures: Vec<Picture> = (0..3).map(|k| Picture::axial(f64::from(k))).collect();
    let mut single = Picture::axial(0.0);
    single.series = 2;
    pictures.push(single);
    let directory = directory(&pictures);
    std::fs::write(directory.path().join("README.txt"), "not DICOM").unwrap();
    std::fs::write(directory.path().join("empty"), "").unwrap();
    let v = read(directory.path()).unwrap();
    assert_eq!(v.header.dims, [4, 3, 3]);
    assert!(
        v.notes.iter().any(|n| n.contains("2 files that are no DICOM")),
        "{:?}",
        v.notes
    );
    assert!(
        v.notes
            .iter()
            .any(|n| n.contains("1 other series") && n.contains("1.2.3.2")),
        "{:?}",
        v.notes
    );
}

#[test]
fn directories_below_are_looked_into_where_the_first_holds_no_picture() {
    let directory = tempfile::tempdir().unwrap();
    for k in 0..3 {
        Picture::axial(f64::from(k)).save(&directory.path().join(format!("DICOM/PA0/SE{k}/IM{k}")));
    }
    assert_eq!(read(directory.path()).unwrap().header.dims, [4, 3, 3]);
}

#[test]
fn a_directory_without_pictures_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    refused(
        read(directory.path()),
        &["a directory without DICOM or TIFF files"],
    );
    std::fs::write(directory.path().join("a.txt"), "hello").unwrap();
    refused(
        read(directory.path()),
        &["a directory without DICOM or TIFF files"],
    );
    // DICOM, but a report.
    let mut report = Picture::axial(0.0).bytes();
    let pixels = report
        .windows(4)
        .rposition(|w| w == [0xE0, 0x7F, 0x10, 0])
        .unwrap();
    report.truncate(pixels);
    std::fs::write(directory.path().join("SR"), report).unwrap();
    refused(
        read(directory.path()),
        &["0 in a directory with 2 other files", "holds the files"],
    );
}

#[test]
fn a_file_that_is_cut_is_refused_by_name_before_its_slices_are_read() {
    let pictures: Vec<Picture> = (0..3).map(|k| Picture::axial(f64::from(k))).collect();
    let directory = directory(&pictures);
    let path = directory.path().join("001.dcm");
    let bytes = std::fs::read(&path).unwrap();
    // In the pixels, and in the header behind the name of the series.
    for (keep, word) in [(bytes.len() - 5, "needs 24 bytes, 19"), (300, "ends too early")] {
        std::fs::write(&path, &bytes[..keep]).unwrap();
        let e = volumes::peek(directory.path(), &VolumeOptions::default())
            .unwrap_err()
            .to_string();
        assert!(e.contains("001.dcm") && e.contains(word), "{keep}: {e}");
    }
    // Nobody can tell what series this was: the others are read, and the file is named.
    std::fs::write(&path, &bytes[..150]).unwrap();
    let v = read(directory.path()).unwrap();
    assert_eq!(v.header.dims, [4, 3, 2]);
    let told = "1 DICOM files cannot be understood and were passed over, the first in 001.dcm";
    assert!(v.notes[0].starts_with(told), "{:?}", v.notes);
    // Rows that the pixels do not have.
    Picture::axial(1.0)
        .with(0x0028_0010, b"US", 300u16.to_le_bytes())
        .save(&path);
    for k in [0, 2] {
        let name = directory.path().join(format!("00{k}.dcm"));
        Picture::axial(f64::from(k))
            .with(0x0028_0010, b"US", 300u16.to_le_bytes())
            .save(&name);
    }
    refused(read(directory.path()), &["000.dcm", "needs 2400 bytes, 24"]);
}

#[test]
fn files_that_are_broken_or_of_another_series_do_not_block_a_directory() {
    let mut pictures: Vec<Picture> = (0..3).map(|k| Picture::axial(f64::from(k))).collect();
    let mut other = Picture::axial(7.0).with(0x0028_0030, b"DS", "1\\x");
    other.series = 2;
    pictures.push(other);
    let directory = directory(&pictures);
    let mut headless = Picture::axial(9.0).bytes();
    headless.truncate(132);
    std::fs::write(directory.path().join("zero.dcm"), headless).unwrap();
    let v = read(directory.path()).unwrap();
    assert_eq!(v.header.dims, [4, 3, 3]);
    assert!(
        v.notes[0].starts_with("2 DICOM files cannot be understood"),
        "{:?}",
        v.notes
    );
    // The series of the broken file is known, and it is the one that is asked for.
    let options = DicomOptions {
        series: Some("1.2.3.1".into()),
        ..Default::default()
    };
    assert_eq!(read_with(directory.path(), options).unwrap().values, v.values);
    refused(read(&directory.path().join("003.dcm")), &["(0028,0030)"]);
    pictures[1].more.push((0x0028_0030, *b"DS", b"x\\1".to_vec()));
    pictures[1].save(&directory.path().join("001.dcm"));
    refused(read(directory.path()), &["in 001.dcm", "(0028,0030)"]);
    // Nothing but broken files: the first is the answer.
    for k in [0, 2] {
        std::fs::remove_file(directory.path().join(format!("00{k}.dcm"))).unwrap();
    }
    refused(read(directory.path()), &["in 001.dcm"]);
}

/// Three time steps at four positions, the files in an order of their own.
#[test]
fn a_time_series_is_read_one_volume_at_a_time() {
    let picture = |t: i16, z: i16| {
        let mut p = Picture::axial(f64::from(z)).with(0x0020_0013, b"IS", format!("{}", 100 - 10 * t + z));
        p.pixels.iter_mut().for_each(|v| *v = 100 * t + z);
        p
    };
    let at = |t: i16, z: i16, tag: u32, value: i16| picture(t, z).with(tag, b"IS", value.to_string());
    let read_number = |path: &Path, volume| {
        let options = VolumeOptions {
            volume,
            ..Default::default()
        };
        volumes::read(path, &options, &ReadLimits::default())
    };
    // The instance number alone, which counts down, or a temporal position that counts up.
    for (tag, falls) in [(0x0020_0013, true), (0x0020_0100, false)] {
        let pictures: Vec<Picture> = [1, 0, 2]
            .into_iter()
            .flat_map(|t| (0..4).map(move |z| (t, z)))
            .map(|(t, z)| if falls { picture(t, z) } else { at(t, z, tag, t) })
            .collect();
        let directory = directory(&pictures);
        let e = read_number(directory.path(), None).unwrap_err();
        assert_eq!(e.fault.choice(), Some(Choice::Volume), "{e}");
        for n in 0..3i16 {
            let v = read_number(directory.path(), Some(n as usize)).unwrap();
            let t = if falls { 2 - n } else { n };
            assert_eq!(v.header.dims, [4, 3, 4]);
            assert_eq!(
                [0, 3].map(|z| value(&v, 1, 1, z)),
                [0, 3].map(|z| f32::from(100 * t + z))
            );
            assert!(
                v.notes
                    .iter()
                    .any(|note| note.starts_with(&format!("volume {n} of 3")))
            );
        }
        let e = read_number(directory.path(), Some(3)).unwrap_err().to_string();
        assert!(e.contains("3 of 3") && e.contains("counted from 0"), "{e}");
        // Without one picture the steps cannot be told apart.
        std::fs::remove_file(directory.path().join("005.dcm")).unwrap();
        let e = read_number(directory.path(), Some(0)).unwrap_err().to_string();
        assert!(e.contains("2 to 3"), "{e}");
    }
    let single = directory(&[Picture::axial(0.0), Picture::axial(1.0)]);
    assert!(read_number(single.path(), Some(0)).is_ok());
    assert!(read_number(single.path(), Some(1)).is_err());
}

#[test]
fn a_mosaic_is_refused_by_name() {
    let mosaic = Picture::axial(0.0)
        .with(0x0008_0008, b"CS", "ORIGINAL\\PRIMARY\\M\\ND\\MOSAIC ")
        .with(0x0018_0050, b"DS", "3");
    refused(
        read(directory(&[mosaic]).path()),
        &["mosaic", "Siemens", "dcm2niix"],
    );
}

/// As networks send them: no preamble, and maybe no first group either.
#[test]
fn files_without_a_preamble_are_read() {
    let plain = Picture::axial(0.0)
        .with(0x0008_0005, b"CS", "ISO_IR 100")
        .with(0x0018_0050, b"DS", "2");
    let bytes = plain.bytes();
    let expected = volumes::parse_dicom(&bytes, &DicomOptions::default(), &ReadLimits::default()).unwrap();
    // 8 bytes and the identifier of the syntax, of 20.
    let meta = [&[2, 0, 0, 0, b'U', b'L', 4, 0, 28, 0, 0, 0][..], &bytes[132..160]].concat();
    let group2 = [&meta, &bytes[160..]].concat();
    for (name, start) in [("group 2", &group2[..]), ("elements", &bytes[160..])] {
        let v = volumes::parse_dicom(start, &DicomOptions::default(), &ReadLimits::default())
            .unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(
            (&v.values, &v.header),
            (&expected.values, &expected.header),
            "{name}"
        );
        assert!(
            v.notes.iter().any(|n| n.contains("no DICOM preamble")),
            "{:?}",
            v.notes
        );
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("a"), start).unwrap();
        assert!(matches!(
            formats::detect(directory.path()).unwrap(),
            formats::Kind::Volume(_)
        ));
        assert_eq!(read(&directory.path().join("a")).unwrap().values, expected.values);
    }
    // Implicit, and with the high byte first.
    for (tag, uid) in [("implicit-s16", "implicit"), ("big-s16", "big")] {
        let bytes = std::fs::read(data().join(format!("syntax/{tag}.dcm"))).unwrap();
        let length = u32::from_le_bytes(bytes[140..144].try_into().unwrap()) as usize;
        let bare = &bytes[144 + length..];
        let whole = volumes::parse_dicom(&bytes, &DicomOptions::default(), &ReadLimits::default()).unwrap();
        let v = volumes::parse_dicom(bare, &DicomOptions::default(), &ReadLimits::default())
            .unwrap_or_else(|e| panic!("{uid}: {e}"));
        assert_eq!(v.values, whole.values, "{uid}");
    }
    let e = volumes::parse_dicom(&[8; 500], &DicomOptions::default(), &ReadLimits::default()).unwrap_err();
    assert!(e.to_string().contains("is it a DICOM file"), "{e}");
}

#[test]
fn a_series_without_geometry_is_refused() {
    let blind = |k| Picture::axial(f64::from(k)).with(0x0020_0032, b"DS", "");
    refused(
        read(directory(&[blind(0), blind(1)]).path()),
        &["(0020,0032)", "000.dcm"],
    );
    let skew = |k| Picture::axial(f64::from(k)).with(0x0020_0037, b"DS", "1\\0\\0\\0.5\\0.5\\0");
    refused(read(directory(&[skew(0), skew(1)]).path()), &["right angle"]);
    let broken = |k| Picture::axial(f64::from(k)).with(0x0028_0030, b"DS", "1\\x");
    refused(
        read(directory(&[broken(0), broken(1)]).path()),
        &["\"1\\\\x ", "(0028,0030)"],
    );
    let flat = |k| Picture::axial(f64::from(k)).with(0x0028_1053, b"DS", "0");
    refused(read(directory(&[flat(0), flat(1)]).path()), &["slope", "0, 0"]);
}

#[test]
fn thickness_slice_location_and_number_do_not_move_a_slice() {
    let pictures: Vec<Picture> = [2.5, 0.0, 5.0]
        .iter()
        .map(|z| {
            Picture::axial(*z)
                .with(0x0018_0050, b"DS", "1")
                .with(0x0020_1041, b"DS", format!("{}", -z))
                .with(0x0020_0013, b"IS", format!("{}", 9.0 - z))
        })
        .collect();
    let v = read(directory(&pictures).path()).unwrap();
    assert_eq!(v.header.spacing(), DVec3::new(1.0, 1.0, 2.5));
    assert_eq!([0, 1, 2].map(|z| value(&v, 0, 0, z)), [0.0, 20.0, 50.0]);
}

#[test]
fn padding_is_kept_and_counted() {
    let picture = |k: i16| {
        let mut p = Picture::axial(k.into()).with(0x0028_0120, b"SS", (-2000i16).to_le_bytes());
        p.pixels[0] = -2000;
        p
    };
    let v = read(directory(&[picture(0), picture(1)]).path()).unwrap();
    assert_eq!(v.values[0], -2000.0);
    assert!(
        v.notes.iter().any(|n| n.starts_with("2 pixels hold the padding")),
        "{:?}",
        v.notes
    );
}

#[test]
fn a_region_and_a_stride_decode_what_they_need() {
    let path = data().join("ct");
    let whole = read(&path).unwrap();
    let options = VolumeOptions {
        region: Some([[2, 9], [1, 8], [1, 6]]),
        stride: [3, 2, 2],
        ..Default::default()
    };
    let part = volumes::read(&path, &options, &ReadLimits::default()).unwrap();
    assert_eq!(part.header.dims, [3, 4, 3]);
    for z in 0..3 {
        for y in 0..4 {
            for x in 0..3 {
                let [fx, fy, fz] = [2 + 3 * x, 1 + 2 * y, 1 + 2 * z];
                assert_eq!(value(&part, x, y, z), value(&whole, fx, fy, fz));
                assert!((place(&part, x, y, z) - place(&whole, fx, fy, fz)).length() < 1e-9);
            }
        }
    }
}

#[test]
fn headers_that_claim_gigabytes_need_none() {
    let huge = |p: Picture| p.bytes();
    let limits = ReadLimits { max_bytes: 1 << 20 };
    let claims = [
        huge(Picture::axial(0.0).with(0x0028_0008, b"IS", "2147483647")),
        huge(
            Picture::axial(0.0)
                .with(0x0028_0010, b"US", [255, 255])
                .with(0x0028_0011, b"US", [255, 255]),
        ),
        // 65 535² doubles in 2³¹ frames: 2⁶⁶ bytes.
        huge(
            Picture::axial(0.0)
                .with(0x0028_0008, b"IS", "2147483648")
                .with(0x0028_0010, b"US", [255, 255])
                .with(0x0028_0011, b"US", [255, 255])
                .with(0x7FE0_0009, b"OD", [0; 96]),
        ),
    ];
    for bytes in claims {
        let mut result = None;
        let used = allocation_counter::measure(|| {
            result = Some(volumes::parse_dicom(&bytes, &DicomOptions::default(), &limits));
        });
        assert!(
            matches!(result, Some(Err(Fault::Truncated { .. } | Fault::Inside { .. }))),
            "{result:?}"
        );
        assert!(used.bytes_max < 1 << 16, "{used:?}");
    }
}
