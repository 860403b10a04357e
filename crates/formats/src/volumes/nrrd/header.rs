//! Fields of a NRRD header, <https://teem.sourceforge.net/nrrd/format.html>.

use std::path::{Path, PathBuf};

use super::fields::Fields;
use super::geometry::{self, Axes};
use crate::Fault;
use crate::error::excerpt;
use crate::limits::Budget;
use crate::neighbour::beside;
use crate::volumes::detached::{Content, Encoding, Layout, Lines, Parsed, Start, numbered};
use crate::volumes::geometry::checked_dims;
use crate::volumes::volume::VolumeHeader;
use crate::volumes::voxel::VoxelType;

/// Reads a header from the start of `content`, up to the blank line that ends it.
pub(super) fn read(
    content: &mut Content,
    path: Option<&Path>,
    volume: Option<usize>,
    budget: &mut Budget,
) -> Result<Parsed, Fault> {
    let mut lines = Lines::new(content, budget);
    let magic = lines.next()?.ok_or(Fault::Empty)?;
    if !matches!(
        magic.strip_prefix("NRRD000"),
        Some("1" | "2" | "3" | "4" | "5" | "6")
    ) {
        return Err(Fault::line(
            1,
            format!("{} is not NRRD0001 to NRRD0006", excerpt(magic.as_bytes())),
            "is this a NRRD file?",
        ));
    }
    let mut fields = Fields::default();
    let mut listed: Option<Vec<String>> = None;
    while let Some(line) = lines.next()? {
        if let Some(names) = &mut listed {
            if !line.trim().is_empty() {
                names.push(line.trim().to_owned());
            }
            continue;
        }
        if line.is_empty() {
            break;
        }
        if line.starts_with('#') || line.contains(":=") {
            continue;
        }
        let Some((name, value)) = line.split_once(": ").or_else(|| line.split_once(':')) else {
            return Err(Fault::line(
                lines.number,
                format!("{} has no colon", excerpt(line.as_bytes())),
                "a line of the header is `field: value`; is the file damaged?",
            ));
        };
        let name = name.trim().to_ascii_lowercase().replace(' ', "");
        let value = value.trim().to_owned();
        if name == "datafile" && value.split_whitespace().next() == Some("LIST") {
            listed = Some(Vec::new());
        }
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
    }
    interpret(&fields, listed, path, volume)
}

fn interpret(
    fields: &Fields,
    listed: Option<Vec<String>>,
    path: Option<&Path>,
    volume: Option<usize>,
) -> Result<Parsed, Fault> {
    let stored = voxel_type(fields)?;
    let axes = Axes::of(fields, volume)?;
    let dims = checked_dims(axes.sizes)?;
    let mut notes = Vec::from_iter(axes.several.map(|s| s.note()));
    let placed = geometry::place(fields, &axes, &mut notes)?;
    let header = VolumeHeader {
        dims,
        world_from_voxel: placed.world_from_voxel,
        unit: placed.unit,
        orientation: placed.orientation,
        stored,
        rescale: None,
    };
    let encoding = match fields.required("encoding")?.to_ascii_lowercase().as_str() {
        "raw" => Encoding::Raw,
        "gz" | "gzip" => Encoding::Gzip,
        "txt" | "text" | "ascii" => Encoding::Text,
        "hex" => Encoding::Hex,
        "bz2" | "bzip2" => return Err(fields.bad("encoding", "bzip2 is not read; save with gzip instead")),
        _ => return Err(fields.bad("encoding", "read are raw, gzip, text and hex")),
    };
    let big_endian = match fields.get("endian").map(str::to_ascii_lowercase).as_deref() {
        Some("little") => false,
        Some("big") => true,
        None if stored.size() == 1 || encoding == Encoding::Text => false,
        _ => {
            return Err(fields.bad(
                "endian",
                "voxels of several bytes need `endian: little` or `endian: big`",
            ));
        }
    };
    let skip = |name: &'static str| match fields.get(name) {
        None => Ok(0),
        Some(v) => v
            .parse::<i64>()
            .map_err(|_| fields.bad(name, "a whole number is needed")),
    };
    let start = match skip("byteskip")? {
        -1 => Start::AtTheEnd,
        n => Start::After(u64::try_from(n).map_err(|_| fields.bad("byteskip", "it is -1, 0 or more"))?),
    };
    let skip_lines = skip("lineskip")?;
    let skip_lines = u64::try_from(skip_lines).map_err(|_| fields.bad("lineskip", "it is 0 or more"))?;
    Ok(Parsed {
        files: data_files(
            fields,
            listed,
            path,
            axes.several.map_or(Ok(dims), |s| s.file_dims(dims))?,
        )?,
        several: axes.several,
        header,
        notes,
        layout: Layout {
            encoding,
            big_endian,
            skip_lines,
            start,
        },
    })
}

fn voxel_type(fields: &Fields) -> Result<VoxelType, Fault> {
    Ok(match fields.required("type")?.to_ascii_lowercase().as_str() {
        "signed char" | "int8" | "int8_t" => VoxelType::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => VoxelType::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => VoxelType::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => VoxelType::U16,
        "int" | "signed int" | "int32" | "int32_t" => VoxelType::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => VoxelType::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => VoxelType::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
            VoxelType::U64
        }
        "float" => VoxelType::F32,
        "double" => VoxelType::F64,
        "block" => return Err(fields.bad("type", "blocks of bytes are no densities; save as numbers")),
        _ => return Err(fields.bad("type", "read are the integers of 8 to 64 bits, float and double")),
    })
}

/// Files with the voxels: one name, a pattern with numbers, or a list.
fn data_files(
    fields: &Fields,
    listed: Option<Vec<String>>,
    path: Option<&Path>,
    dims: [usize; 3],
) -> Result<Option<Vec<PathBuf>>, Fault> {
    let Some(value) = fields.get("datafile") else {
        return Ok(None);
    };
    if let Some(names) = listed {
        let paths = names.iter().map(|name| beside(path, name));
        return paths.collect::<Result<_, _>>().map(Some);
    }
    let words: Vec<&str> = value.split_whitespace().collect();
    if let [pattern, numbers @ ..] = &words[..]
        && pattern.contains('%')
        && (3..=4).contains(&numbers.len())
    {
        let numbers: Result<Vec<i64>, _> = numbers.iter().map(|n| n.parse()).collect();
        let numbers =
            numbers.map_err(|_| fields.bad("datafile", "a pattern is followed by whole numbers"))?;
        // More files than rows of voxels cannot be.
        let most = dims[1].saturating_mul(dims[2]);
        let names = numbered(path, pattern, [numbers[0], numbers[1], numbers[2]], most)?;
        return Ok(Some(names));
    }
    Ok(Some(vec![beside(path, value)?]))
}
