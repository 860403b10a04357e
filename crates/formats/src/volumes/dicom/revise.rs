//! A series written again with other pixels. What the standard asks of a derived image is set; every other element is as it was.

use std::borrow::Cow;
use std::fs::{self, File as Output};
use std::io::Write;
use std::path::Path;

use dicom_core::value::DataSetSequence;
use dicom_core::{DataElement, PrimitiveValue, Tag, VR};
use dicom_object::{FileDicomObject, InMemDicomObject, OpenFileOptions};
use sha2::{Digest, Sha256};

use super::check::layout_of;
use super::dataset::PixelKind;
use super::decode::Decoder;
use super::pixels::{Layout, Rescale};
use super::plane::Plane;
use super::scan::{self, File};
use super::series::{Pictures, Series};
use super::stream::Location;
use super::syntax::Codec;
use crate::atomic::{PassingDirectory, whole};
use crate::input::io_fault;
use crate::limits::Budget;
use crate::volumes::VolumeOptions;
use crate::volumes::revision::{Change, Revision, Scale};
use crate::{Fault, guard};

const IMAGE_TYPE: Tag = Tag(0x0008, 0x0008);
const SOP_CLASS: Tag = Tag(0x0008, 0x0016);
const SOP_INSTANCE: Tag = Tag(0x0008, 0x0018);
const REFERENCED_CLASS: Tag = Tag(0x0008, 0x1150);
const REFERENCED_INSTANCE: Tag = Tag(0x0008, 0x1155);
const SOURCE_IMAGES: Tag = Tag(0x0008, 0x2112);
const SERIES: Tag = Tag(0x0020, 0x000E);
const PIXELS: Tag = Tag(0x7FE0, 0x0010);
const FLOAT_PIXELS: Tag = Tag(0x7FE0, 0x0008);
const DOUBLE_PIXELS: Tag = Tag(0x7FE0, 0x0009);
const EXPLICIT_LITTLE_ENDIAN: &str = "1.2.840.10008.1.2.1";

type Object = FileDicomObject<InMemDicomObject>;

/// Writes the series that `like` stands for into the new directory `output`.
pub(in crate::volumes) fn revise(
    like: &Path,
    options: &VolumeOptions,
    changes: &[Change],
    identity: &[u8; 32],
    output: &Path,
    budget: &mut Budget,
) -> Result<Revision, Fault> {
    if output.symlink_metadata().is_ok() {
        return Err(Fault::Value {
            what: "the directory of the output",
            value: format!("{}, which is there already", output.display()),
            remedy: "a series is written into a new directory; choose another name",
        });
    }
    let found = scan::find(like, &options.dicom, budget)?;
    let series = Series::new(found, &options.dicom, options.volume, budget)?;
    let Some(pictures) = series.into_pictures() else {
        return Err(Fault::Value {
            what: "the grid of the series",
            value: "resampled: no picture holds a slice of the volume as it is".into(),
            remedy: "edit a series that is read as it lies, without resampling",
        });
    };
    let parent = output.parent().filter(|p| !p.as_os_str().is_empty());
    let hidden = PassingDirectory::new(Some(parent.unwrap_or(Path::new("."))))
        .map_err(io_fault("creating the output"))?;
    // One inside it: it gets the permissions of any new directory.
    let written = hidden.path().join("series");
    let mut told = Revision::default();
    let mut parts = Parts::of(&pictures, changes);
    for (n, file) in pictures.files.iter().enumerate() {
        let inside = |fault: Fault| fault.inside(&file.name);
        let own = parts.take(n);
        let bytes = guard::decode("DICOM writer", || {
            revised(file, &own, identity, budget, &mut told)
        })
        .map_err(inside)?;
        write(&written.join(&file.name), &bytes).map_err(inside)?;
    }
    whole(|| fs::rename(&written, output)).map_err(io_fault("renaming the output"))?;
    Ok(told)
}

/// New densities in one picture.
struct Part<'a> {
    plane: &'a Plane,
    /// Index of the slice's first voxel.
    first: usize,
    changes: &'a [Change],
}

/// The changes by files.
struct Parts<'a>(Vec<Vec<Part<'a>>>);

impl<'a> Parts<'a> {
    fn of(pictures: &'a Pictures, changes: &'a [Change]) -> Self {
        let mut parts: Vec<Vec<Part>> = pictures.files.iter().map(|_| Vec::new()).collect();
        let mut left = changes;
        for (z, planes) in pictures.slices.iter().enumerate() {
            let first = z * pictures.pixels_per_slice;
            let end = left.partition_point(|c| c.voxel < first + pictures.pixels_per_slice);
            let (changes, later) = left.split_at(end);
            left = later;
            for plane in planes {
                parts[plane.file as usize].push(Part {
                    plane,
                    first,
                    changes,
                });
            }
        }
        assert!(left.is_empty(), "voxels beyond the volume");
        Self(parts)
    }

    fn take(&mut self, file: usize) -> Vec<Part<'a>> {
        std::mem::take(&mut self.0[file])
    }
}

/// The bytes of a file with its parts changed.
fn revised(
    file: &File,
    parts: &[Part],
    identity: &[u8; 32],
    budget: &mut Budget,
    told: &mut Revision,
) -> Result<Vec<u8>, Fault> {
    let mut object = open(file)?;
    let layout = layout_of(&file.data);
    let (tag, vr) = match (layout.kind, layout.bytes) {
        (PixelKind::Float32, _) => (FLOAT_PIXELS, VR::OF),
        (PixelKind::Float64, _) => (DOUBLE_PIXELS, VR::OD),
        (PixelKind::Integer, 1) => (PIXELS, VR::OB),
        (PixelKind::Integer, _) => (PIXELS, VR::OW),
    };
    let frame = file.data.rows as usize * file.data.columns as usize;
    let mut pixels = match file.data.syntax.codec {
        Some(Codec::Native) => {
            let element = object
                .get(tag)
                .ok_or_else(|| not_understood("the pixels are missing"))?;
            element.to_bytes().map(Cow::into_owned).map_err(not_understood)?
        }
        _ => decoded(file, &layout, frame, budget)?,
    };
    let layout = Layout {
        big_endian: false,
        swapped_pairs: false,
        ..layout
    };
    for part in parts {
        let Rescale { slope, intercept } = part.plane.rescale;
        let scale = Scale {
            rescale: Some([slope, intercept]),
            range: layout.range(),
            is_integer: layout.kind == PixelKind::Integer,
        };
        for change in part.changes {
            let at = (part.plane.frame as usize * frame + change.voxel - part.first) * layout.bytes;
            let number = scale.number(change.density, told);
            told.changed += usize::from(layout.put(&mut pixels[at..][..layout.bytes], number));
        }
    }
    if pixels.len() % 2 == 1 {
        pixels.push(0);
    }
    object.put(DataElement::new(tag, vr, PrimitiveValue::U8(pixels.into())));
    derive(&mut object, identity)?;
    let mut bytes = Vec::new();
    object.write_all(&mut bytes).map_err(not_understood)?;
    Ok(bytes)
}

fn open(file: &File) -> Result<Object, Fault> {
    match &file.location {
        Location::Path(path) => OpenFileOptions::new().open_file(path),
        Location::Memory(bytes) => OpenFileOptions::new().from_reader(&bytes[..]),
    }
    .map_err(not_understood)
}

/// Pixels of a compressed file, little endian, all frames.
fn decoded(file: &File, layout: &Layout, frame: usize, budget: &mut Budget) -> Result<Vec<u8>, Fault> {
    // Numbers of more bits would be rounded on their way through single precision.
    if layout.bits_stored > 24 {
        return Err(Fault::Value {
            what: "the bits of a compressed pixel",
            value: layout.bits_stored.to_string(),
            remedy: "at most 24 are written back; decompress the series first",
        });
    }
    let count = file.data.frame_count.unwrap_or(1);
    let files = std::slice::from_ref(file);
    let mut decoder = Decoder::new(files, 0, budget)?;
    let mut densities = vec![0.0; frame];
    let mut pixels = vec![0; frame * count as usize * layout.bytes];
    let places = pixels.chunks_exact_mut(frame * layout.bytes);
    for (number, place) in (0..count).zip(places) {
        let plane = Plane::bare(number);
        decoder.read(files, &plane, &mut densities)?;
        let pixels = place.chunks_exact_mut(layout.bytes);
        for (pixel, density) in pixels.zip(&densities) {
            layout.put(pixel, f64::from(*density));
        }
    }
    Ok(pixels)
}

/// Makes it an image of its own that says what it comes from [DICOM PS3.3 C.7.6.1].
fn derive(object: &mut Object, identity: &[u8; 32]) -> Result<(), Fault> {
    let text = |object: &Object, tag| {
        let element: Option<_> = object.get(tag);
        let text = element.and_then(|e| e.to_str().ok());
        text.map(|t| t.trim_end_matches(['\0', ' ']).to_string())
    };
    let class = text(object, SOP_CLASS).unwrap_or_default();
    let source = text(object, SOP_INSTANCE).ok_or_else(|| not_understood("(0008,0018) is missing"))?;
    let series = text(object, SERIES).unwrap_or_default();
    let mut image_type: Vec<String> =
        text(object, IMAGE_TYPE).map_or_else(Vec::new, |t| t.split('\\').map(String::from).collect());
    match image_type.first_mut() {
        Some(first) => *first = "DERIVED".into(),
        None => image_type = vec!["DERIVED".into(), "SECONDARY".into()],
    }
    let strings = PrimitiveValue::Strs(image_type.into());
    object.put(DataElement::new(IMAGE_TYPE, VR::CS, strings));
    let reference = InMemDicomObject::from_element_iter([
        DataElement::new(REFERENCED_CLASS, VR::UI, class.as_str()),
        DataElement::new(REFERENCED_INSTANCE, VR::UI, source.as_str()),
    ]);
    let sequence = DataSetSequence::from(vec![reference]);
    object.put(DataElement::new(SOURCE_IMAGES, VR::SQ, sequence));
    let instance = uid(identity, &source);
    object.put(DataElement::new(SERIES, VR::UI, uid(identity, &series).as_str()));
    object.put(DataElement::new(SOP_INSTANCE, VR::UI, instance.as_str()));
    let meta = object.meta_mut();
    meta.media_storage_sop_instance_uid = instance;
    meta.transfer_syntax = EXPLICIT_LITTLE_ENDIAN.into();
    meta.update_information_group_length();
    Ok(())
}

/// An identifier for what was made of `source` [DICOM PS3.5 B.2]: the same for the same edits.
fn uid(identity: &[u8; 32], source: &str) -> String {
    let mut hash = Sha256::new();
    hash.update(b"isoclay DICOM UID 1");
    hash.update(identity);
    hash.update(source);
    let digest: [u8; 32] = hash.finalize().into();
    let number = u128::from_be_bytes(digest[..16].try_into().expect("half of a digest"));
    // As a UUID of version 8, which is what the root 2.25 stands for.
    let version = number & !(0xF << 76) | 0x8 << 76;
    format!("2.25.{}", version & !(0b11 << 62) | 0b10 << 62)
}

fn not_understood(why: impl ToString) -> Fault {
    Fault::Damaged {
        what: format!("it cannot be written again ({})", why.to_string()),
    }
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), Fault> {
    let written = || {
        fs::create_dir_all(path.parent().expect("it is in a directory"))?;
        let mut file = Output::create(path)?;
        file.write_all(bytes)?;
        file.sync_all()
    };
    written().map_err(io_fault("writing"))
}
