//! Series of others written again with a few voxels changed.

use std::collections::BTreeSet;
use std::path::Path;

use dicom_object::{Tag, open_file};
use formats::volumes::{self, Change, DicomOptions, Revision, Volume, VolumeOptions};
use formats::{FormatError, ReadLimits};

use super::writer::Picture;
use super::{data, read, read_with};

const PIXELS: u16 = 0x7FE0;

fn revise(like: &Path, changes: &[Change], output: &Path) -> Result<Revision, FormatError> {
    let limits = ReadLimits::default();
    volumes::save_revised(
        like,
        &VolumeOptions::default(),
        changes,
        &[7; 32],
        output,
        &limits,
    )
}

/// Every seventh voxel, one up.
fn changes(volume: &Volume) -> Vec<Change> {
    let few = volume.values.iter().enumerate().step_by(7);
    few.map(|(voxel, v)| Change {
        voxel,
        density: f64::from(*v) + 1.0,
    })
    .collect()
}

fn files(directory: &Path) -> Vec<std::path::PathBuf> {
    let entries = directory.read_dir().unwrap().map(|e| e.unwrap().path());
    let mut files: Vec<_> = entries.filter(|p| p.is_file()).collect();
    files.sort();
    files
}

/// All elements of a file but its pixels, as text.
fn elements(path: &Path) -> Vec<(Tag, String)> {
    let object = open_file(path).unwrap();
    let all = object.iter().filter(|e| e.header().tag.0 != PIXELS);
    all.map(|e| (e.header().tag, format!("{:?}", e.value())))
        .collect()
}

#[test]
fn series_of_others_keep_all_that_was_not_changed() {
    let scratch = tempfile::tempdir().unwrap();
    let mut seen = 0;
    let mut kinds = vec![
        data().join("ct"),
        data().join("signed"),
        data().join("pet"),
        data().join("enhanced"),
    ];
    kinds.extend(files(&data().join("syntax")));
    kinds.extend(files(&data().join("compressed")));
    for like in data()
        .join("syntax")
        .read_dir()
        .unwrap()
        .chain(data().join("compressed").read_dir().unwrap())
    {
        kinds.extend(Some(like.unwrap().path()).filter(|p| p.is_dir()));
    }
    for (n, like) in kinds.iter().enumerate() {
        let Ok(before) = read(like) else { continue };
        let name = like.display();
        let output = scratch.path().join(n.to_string());
        let changes = changes(&before);
        let told = revise(like, &changes, &output).unwrap_or_else(|e| panic!("{name}: {e}"));
        let after = read(&output).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(after.header, before.header, "{name}");
        let mut expected: Vec<f64> = before.values.iter().map(|v| f64::from(*v)).collect();
        changes.iter().for_each(|c| expected[c.voxel] = c.density);
        for (voxel, (found, expected)) in after.values.iter().zip(&expected).enumerate() {
            let slack = if voxel % 7 == 0 { told.rounding + 1e-3 } else { 0.0 };
            assert!(
                (f64::from(*found) - expected).abs() <= slack || told.clamped > 0 && voxel % 7 == 0,
                "{name}: voxel {voxel} is {found}, not {expected}"
            );
        }
        seen += 1;
    }
    assert!(seen >= 12, "{seen} series");
}

#[test]
fn a_revised_series_is_one_of_its_own_that_names_its_source() {
    let scratch = tempfile::tempdir().unwrap();
    let output = scratch.path().join("out");
    let like = data().join("ct");
    let before = read(&like).unwrap();
    revise(&like, &changes(&before), &output).unwrap();
    let own = |tag: Tag| [(8, 8), (8, 0x18), (8, 0x2112), (0x20, 0xE)].contains(&(tag.0, tag.1));
    let mut series = BTreeSet::new();
    let mut instances = BTreeSet::new();
    assert_eq!(files(&output).len(), files(&like).len());
    for path in files(&output) {
        let source = like.join(path.file_name().unwrap());
        let others = |p: &Path| {
            elements(p)
                .into_iter()
                .filter(|(t, _)| !own(*t))
                .collect::<Vec<_>>()
        };
        assert_eq!(others(&path), others(&source), "{}", path.display());
        let [new, old] = [&path, &source].map(|p| open_file(p).unwrap());
        let text =
            |o: &dicom_object::DefaultDicomObject, t| o.element(t).unwrap().to_str().unwrap().into_owned();
        let instance = text(&new, Tag(8, 0x18));
        assert_eq!(instance, new.meta().media_storage_sop_instance_uid());
        assert_eq!(new.meta().transfer_syntax(), "1.2.840.10008.1.2.1");
        assert!(instance.len() <= 64 && instance.starts_with("2.25."));
        assert!(text(&new, Tag(8, 8)).starts_with("DERIVED"));
        let reference = &new.element(Tag(8, 0x2112)).unwrap().items().unwrap()[0];
        let named = reference
            .element(Tag(8, 0x1155))
            .unwrap()
            .to_str()
            .unwrap()
            .into_owned();
        assert_eq!(
            named.trim_end_matches('\0'),
            text(&old, Tag(8, 0x18)).trim_end_matches('\0')
        );
        series.insert(text(&new, Tag(0x20, 0xE)));
        instances.insert(instance);
    }
    assert_eq!(series.len(), 1);
    assert_eq!(instances.len(), files(&like).len());
}

#[test]
fn what_cannot_be_written_back_is_refused_and_leaves_nothing() {
    let scratch = tempfile::tempdir().unwrap();
    let output = scratch.path().join("out");
    let told = |like: &Path, options: &VolumeOptions| {
        let limits = ReadLimits::default();
        let result = volumes::save_revised(like, options, &[], &[0; 32], &output, &limits);
        assert!(!output.exists());
        result.unwrap_err().to_string()
    };
    let resampled = VolumeOptions {
        dicom: DicomOptions {
            uneven: volumes::Uneven::Resample,
            ..Default::default()
        },
        ..Default::default()
    };
    assert!(read_with(&data().join("uneven"), resampled.dicom.clone()).is_ok());
    assert!(told(&data().join("uneven"), &resampled).contains("resampled"));
    let part = VolumeOptions {
        stride: [2, 1, 1],
        ..Default::default()
    };
    assert!(told(&data().join("ct"), &part).contains("as a whole"));
    // Without the identifier that a reference needs.
    let bare = scratch.path().join("bare");
    for z in 0..3 {
        Picture::axial(f64::from(z)).save(&bare.join(z.to_string()));
    }
    assert!(told(&bare, &VolumeOptions::default()).contains("in 0"));
    std::fs::create_dir(&output).unwrap();
    let e = revise(&data().join("ct"), &[], &output).unwrap_err();
    assert!(e.to_string().contains("there already"), "{e}");
    assert_eq!(scratch.path().read_dir().unwrap().count(), 2);
}
