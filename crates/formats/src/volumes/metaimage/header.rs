//! Fields of a MetaImage header, read as ITK reads them: LPS, rows of `TransformMatrix` are the directions of the
//! axes, `CenterOfRotation` and `AnatomicalOrientation` say nothing more (checked with ITK 5.4).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DMat3, DVec3};

use crate::error::excerpt;
use crate::limits::Budget;
use crate::neighbour::beside;
use crate::volumes::detached::{Content, Encoding, Layout, Lines, Parsed, Start, numbered};
use crate::volumes::geometry::{RAS_FROM_LPS, checked_dims, in_world, usable};
use crate::volumes::several::Several;
use crate::volumes::volume::{Orientation, VolumeHeader};
use crate::volumes::voxel::VoxelType;
use crate::{Fault, Unit};

/// Values by the names of their fields, in small letters.
#[derive(Debug, Default)]
struct Fields {
    values: BTreeMap<String, (u64, String)>,
}

impl Fields {
    /// The first of several names of the same thing that is there.
    fn get(&self, names: &[&'static str]) -> Option<(&'static str, &str)> {
        names.iter().find_map(|name| {
            let (_, value) = self.values.get(&name.to_ascii_lowercase())?;
            Some((*name, value.as_str()))
        })
    }

    fn bad(&self, name: &str, remedy: &'static str) -> Fault {
        let (line, value) = self
            .values
            .get(&name.to_ascii_lowercase())
            .cloned()
            .unwrap_or_default();
        if line == 0 {
            return Fault::Value {
                what: "a field of the header",
                value: format!("{name}, and missing"),
                remedy,
            };
        }
        Fault::line(line, format!("{name} is {}", excerpt(value.as_bytes())), remedy)
    }

    fn numbers<const N: usize, T: std::str::FromStr>(
        &self,
        names: &[&'static str],
        remedy: &'static str,
    ) -> Result<Option<[T; N]>, Fault> {
        let Some((name, value)) = self.get(names) else {
            return Ok(None);
        };
        let all: Option<Vec<T>> = value.split_whitespace().map(|v| v.parse().ok()).collect();
        all.and_then(|all| all.try_into().ok())
            .map(Some)
            .ok_or_else(|| self.bad(name, remedy))
    }

    fn is_true(&self, names: &[&'static str]) -> bool {
        self.get(names)
            .is_some_and(|(_, v)| matches!(v.as_bytes().first(), Some(b'T' | b't' | b'1')))
    }
}

/// Reads a header from the start of `content`, up to the line that says where the voxels are.
pub(super) fn read(
    content: &mut Content,
    path: Option<&Path>,
    volume: Option<usize>,
    budget: &mut Budget,
) -> Result<Parsed, Fault> {
    let mut lines = Lines::new(content, budget);
    let mut fields = Fields::default();
    let is_list = loop {
        let Some(line) = lines.next()? else {
            if lines.number == 0 {
                return Err(Fault::Empty);
            }
            return Err(fields.bad("ElementDataFile", "it ends the header; was the file cut off?"));
        };
        if line.trim().is_empty() {
            continue;
        }
        let Some((name, value)) = line.split_once('=') else {
            return Err(Fault::line(
                lines.number,
                format!("{} has no =", excerpt(line.as_bytes())),
                "a line of the header is `Field = value`; is this a MetaImage file?",
            ));
        };
        let (name, value) = (name.trim().to_ascii_lowercase(), value.trim().to_owned());
        let is_last = name == "elementdatafile";
        let is_list = value.split_whitespace().next() == Some("LIST");
        if fields
            .values
            .insert(name.clone(), (lines.number, value))
            .is_some()
        {
            return Err(Fault::line(
                lines.number,
                format!("{name} stands there for the second time"),
                "which one counts is not said; take one out",
            ));
        }
        if is_last {
            break is_list;
        }
    };
    let mut listed = Vec::new();
    while is_list && let Some(line) = lines.next()? {
        if !line.trim().is_empty() {
            listed.push(beside(path, line.trim())?);
        }
    }
    interpret(&fields, is_list.then_some(listed), path, volume)
}

fn interpret(
    fields: &Fields,
    listed: Option<Vec<PathBuf>>,
    path: Option<&Path>,
    volume: Option<usize>,
) -> Result<Parsed, Fault> {
    let dims = dims(fields)?;
    const CHANNELS: &str = "ElementNumberOfChannels";
    let several = match fields.numbers::<1, u64>(&[CHANNELS], "a whole number is needed")? {
        Some([0]) => return Err(fields.bad(CHANNELS, "a voxel has at least one number")),
        channels => Several::choose(channels.map_or(1, |c| c[0]), volume)?,
    };
    // The channels of a voxel stand together.
    let several = several.map(|s| Several {
        is_interleaved: true,
        ..s
    });
    let mut notes = Vec::from_iter(several.map(|s| s.note()));
    let (world_from_voxel, orientation, unit) = place(fields, &mut notes)?;
    if let Some((name, value)) = fields.get(&[
        "ElementToIntensityFunctionSlope",
        "ElementToIntensityFunctionOffset",
    ]) {
        notes.push(format!("{name} = {value} is passed over, as ITK does"));
    }
    let header = VolumeHeader {
        dims,
        world_from_voxel,
        unit,
        orientation,
        stored: voxel_type(fields)?,
        rescale: None,
    };
    let is_text = fields.get(&["BinaryData"]).is_some() && !fields.is_true(&["BinaryData"]);
    let encoding = match (is_text, fields.is_true(&["CompressedData"])) {
        (false, false) => Encoding::Raw,
        (false, true) => Encoding::Zlib,
        (true, false) => Encoding::Text,
        (true, true) => {
            return Err(fields.bad("CompressedData", "compressed text is not read; save as binary"));
        }
    };
    let start = match fields.numbers::<1, i64>(&["HeaderSize"], "a whole number is needed")? {
        None => Start::After(0),
        Some([-1]) => Start::AtTheEnd,
        Some([n]) => {
            Start::After(u64::try_from(n).map_err(|_| fields.bad("HeaderSize", "it is -1, 0 or more"))?)
        }
    };
    Ok(Parsed {
        files: match listed {
            Some(paths) => Some(paths),
            None => data_files(fields, path, dims)?,
        },
        several,
        header,
        notes,
        layout: Layout {
            encoding,
            big_endian: fields.is_true(&["BinaryDataByteOrderMSB", "ElementByteOrderMSB"]),
            skip_lines: 0,
            start,
        },
    })
}

/// Exactly three.
fn dims(fields: &Fields) -> Result<[usize; 3], Fault> {
    let remedy = "a volume has three dimensions; take one time step out";
    let [count] = fields
        .numbers::<1, usize>(&["NDims"], "it is a number")?
        .ok_or_else(|| fields.bad("NDims", "is this a MetaImage file?"))?;
    let sizes = match count {
        3 => fields.numbers::<3, i64>(&["DimSize"], "as many whole numbers as NDims says are needed")?,
        _ => return Err(fields.bad("NDims", remedy)),
    };
    checked_dims(sizes.ok_or_else(|| fields.bad("DimSize", "is the header whole?"))?)
}

fn voxel_type(fields: &Fields) -> Result<VoxelType, Fault> {
    let (name, value) = fields
        .get(&["ElementType"])
        .ok_or_else(|| fields.bad("ElementType", "is the header whole?"))?;
    Ok(match value {
        "MET_CHAR" => VoxelType::I8,
        "MET_UCHAR" => VoxelType::U8,
        "MET_SHORT" => VoxelType::I16,
        "MET_USHORT" => VoxelType::U16,
        // A long has four bytes in this format, on every machine.
        "MET_INT" | "MET_LONG" => VoxelType::I32,
        "MET_UINT" | "MET_ULONG" => VoxelType::U32,
        "MET_LONG_LONG" => VoxelType::I64,
        "MET_ULONG_LONG" => VoxelType::U64,
        "MET_FLOAT" => VoxelType::F32,
        "MET_DOUBLE" => VoxelType::F64,
        _ => {
            return Err(fields.bad(
                name,
                "read are the integers of 8 to 64 bits, MET_FLOAT and MET_DOUBLE",
            ));
        }
    })
}

fn place(fields: &Fields, notes: &mut Vec<String>) -> Result<(DAffine3, Orientation, Unit), Fault> {
    let three = "three numbers are needed";
    let spacing = fields.numbers::<3, f64>(&["ElementSpacing", "ElementSize"], three)?;
    if spacing.is_none() {
        notes.push("the file gives no distances between voxels; lengths are in voxels".into());
    }
    let spacing = spacing.unwrap_or([1.0; 3]);
    if spacing.iter().any(|s| *s <= 0.0) {
        let name = fields
            .get(&["ElementSpacing", "ElementSize"])
            .map_or("", |(n, _)| n);
        return Err(fields.bad(
            name,
            "distances are above 0; mirrored axes belong into TransformMatrix",
        ));
    }
    let rows = fields.numbers::<9, f64>(
        &["TransformMatrix", "Rotation", "Orientation"],
        "nine numbers are needed",
    )?;
    let origin = fields.numbers::<3, f64>(&["Offset", "Position", "Origin"], three)?;
    if rows.is_none() {
        notes
            .push("the file gives no orientation; its axes are taken as left, posterior and superior".into());
    }
    if origin.is_none() {
        notes.push("the file gives no origin; it is the first voxel".into());
    }
    let unit = match fields.get(&["DistanceUnits"]).map(|(_, v)| v) {
        Some("um") => Unit::Micrometre,
        Some("mm") => Unit::Millimetre,
        Some("cm") => Unit::Centimetre,
        _ => {
            notes.push("the file names no unit of length".into());
            Unit::Unknown
        }
    };
    let scale = unit.in_mm().unwrap_or(1.0);
    let directions = rows.map_or(DMat3::IDENTITY, |r| DMat3::from_cols_array(&r));
    let map = DAffine3 {
        matrix3: directions * DMat3::from_diagonal(DVec3::from_array(spacing) * scale),
        translation: DVec3::from_array(origin.unwrap_or_default()) * scale,
    };
    let orientation = if rows.is_some() {
        Orientation::Directions
    } else {
        Orientation::Spacings
    };
    let unit = if unit == Unit::Unknown {
        unit
    } else {
        Unit::Millimetre
    };
    Ok((usable(in_world(&map, RAS_FROM_LPS))?, orientation, unit))
}

/// One file or a pattern with numbers; `None` if the voxels follow the header.
fn data_files(fields: &Fields, path: Option<&Path>, dims: [usize; 3]) -> Result<Option<Vec<PathBuf>>, Fault> {
    let (name, value) = fields.get(&["ElementDataFile"]).expect("it ended the header");
    if matches!(value, "LOCAL" | "Local" | "local") {
        return Ok(None);
    }
    let words: Vec<&str> = value.split_whitespace().collect();
    let [pattern, numbers @ ..] = &words[..] else {
        return Err(fields.bad(name, "it names a file, or says LOCAL"));
    };
    if pattern.contains('%') && numbers.len() == 3 {
        let numbers: Result<Vec<i64>, _> = numbers.iter().map(|n| n.parse()).collect();
        let numbers =
            numbers.map_err(|_| fields.bad(name, "a pattern is followed by three whole numbers"))?;
        let names = numbered(path, pattern, [numbers[0], numbers[1], numbers[2]], dims[2])?;
        return Ok(Some(names));
    }
    Ok(Some(vec![beside(path, value)?]))
}
