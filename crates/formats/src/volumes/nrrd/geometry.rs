//! Axes of a NRRD header and their place in the world.

use glam::{DAffine3, DMat3, DVec3};

use super::fields::Fields;
use crate::volumes::geometry::{RAS_FROM_LPS, in_world, usable};
use crate::volumes::several::Several;
use crate::volumes::volume::Orientation;
use crate::{Fault, Unit};

/// The three axes of space among those of the file.
pub(super) struct Axes {
    /// Their places among the axes of the file.
    places: [usize; 3],
    /// Number of axes of the file.
    count: usize,
    pub sizes: [i64; 3],
    /// Which volume is read, if a fourth axis counts several.
    pub several: Option<Several>,
}

/// A map and what is known of it.
pub(super) struct Placed {
    pub world_from_voxel: DAffine3,
    pub unit: Unit,
    pub orientation: Orientation,
}

impl Axes {
    /// Three axes of space, and maybe one of volumes, of which number `volume` is wanted.
    pub fn of(fields: &Fields, volume: Option<usize>) -> Result<Self, Fault> {
        let remedy = "a volume has three axes of space, and at most one of time steps or channels before or after them";
        let sizes: Vec<i64> = fields.numbers("sizes")?.unwrap_or_default();
        let dimension = fields.numbers::<usize>("dimension")?.unwrap_or_default();
        if dimension != [sizes.len()] {
            return Err(fields.bad("dimension", "it is the number of the sizes; is the header whole?"));
        }
        let kinds: Vec<&str> = fields
            .get("kinds")
            .unwrap_or_default()
            .split_whitespace()
            .collect();
        if !kinds.is_empty() && kinds.len() != sizes.len() {
            return Err(fields.bad("kinds", "one for each axis is needed"));
        }
        let directions = fields.get("spacedirections").map(vectors);
        let is_space = |axis: usize| {
            let kind = kinds
                .get(axis)
                .is_none_or(|k| matches!(*k, "domain" | "space" | "???" | "none"));
            let direction = directions
                .as_ref()
                .is_none_or(|d| d.get(axis).is_none_or(Option::is_some));
            kind && direction
        };
        let mut places: Vec<usize> = (0..sizes.len()).filter(|a| is_space(*a)).collect();
        // Where nothing tells them apart, the slowest counts volumes.
        if places.len() == 4 && sizes.len() == 4 {
            places.pop();
        }
        let other = (0..sizes.len()).find(|a| !places.contains(a));
        let is_single = other.is_none_or(|a| sizes[a] == 1);
        match <[usize; 3]>::try_from(places) {
            Ok(places) if sizes.len() <= 4 && (is_single || matches!(other, Some(0 | 3))) => Ok(Self {
                places,
                count: sizes.len(),
                sizes: places.map(|a| sizes[a]),
                several: match other.map(|a| u64::try_from(sizes[a])) {
                    None => Several::choose(1, volume)?,
                    Some(Ok(count @ 1..)) => Several::choose(count, volume)?.map(|s| Several {
                        is_interleaved: other == Some(0),
                        ..s
                    }),
                    Some(_) => return Err(fields.bad("sizes", "every axis has at least one sample")),
                },
            }),
            _ if kinds.is_empty() => Err(fields.bad("sizes", remedy)),
            _ => Err(fields.bad("kinds", remedy)),
        }
    }

    /// The values of the three axes of space among one for each axis.
    fn pick<T: Clone>(&self, all: &[T]) -> Option<[T; 3]> {
        (all.len() == self.count).then(|| self.places.map(|a| all[a].clone()))
    }
}

/// Vectors `(x,y,z)` with blanks between; `none` and what is no vector are `None`.
fn vectors(text: &str) -> Vec<Option<Vec<f64>>> {
    let mut all = Vec::new();
    let mut rest = text.trim_start();
    while !rest.is_empty() {
        let end = match rest.strip_prefix('(') {
            Some(_) => rest.find(')').map_or(rest.len(), |i| i + 1),
            None => rest.find(char::is_whitespace).unwrap_or(rest.len()),
        };
        let (word, later) = rest.split_at(end);
        let inner = word.strip_prefix('(').and_then(|w| w.strip_suffix(')'));
        let numbers = inner.map(|w| {
            w.split(',')
                .map(|n| n.trim().parse().ok())
                .collect::<Option<Vec<f64>>>()
        });
        all.push(numbers.flatten());
        rest = later.trim_start();
    }
    all
}

/// Directions if the file has them, else spacings, else one voxel as unit of length.
pub(super) fn place(fields: &Fields, axes: &Axes, notes: &mut Vec<String>) -> Result<Placed, Fault> {
    match fields.get("spacedirections") {
        Some(text) => by_directions(fields, axes, text, notes),
        None => by_spacings(fields, axes, notes),
    }
}

fn by_directions(fields: &Fields, axes: &Axes, text: &str, notes: &mut Vec<String>) -> Result<Placed, Fault> {
    let three = |v: &Option<Vec<f64>>| match v.as_deref() {
        Some([x, y, z]) => Some(DVec3::new(*x, *y, *z)),
        _ => None,
    };
    let bad = || {
        fields.bad(
            "spacedirections",
            "a vector (x,y,z) for each axis is needed, and none for those not of space",
        )
    };
    let columns = axes.pick(&vectors(text)).ok_or_else(bad)?;
    let [Some(x), Some(y), Some(z)] = columns.each_ref().map(three) else {
        return Err(bad());
    };
    let factors = ras_factors(fields, notes)?;
    let origin = match fields.get("spaceorigin") {
        Some(text) => match vectors(text).as_slice() {
            [v] => three(v),
            _ => None,
        }
        .ok_or_else(|| fields.bad("spaceorigin", "one vector (x,y,z) is needed"))?,
        None => {
            notes.push("the file gives no origin; it is the first voxel".into());
            DVec3::ZERO
        }
    };
    let unit = unit(
        fields,
        "spaceunits",
        |all| <[String; 3]>::try_from(all).ok(),
        notes,
    )?;
    let scale = unit.in_mm().unwrap_or(1.0);
    let map = DAffine3 {
        matrix3: DMat3::from_cols(x, y, z) * scale,
        translation: origin * scale,
    };
    Ok(Placed {
        world_from_voxel: usable(in_world(&map, factors))?,
        unit: if unit == Unit::Unknown {
            unit
        } else {
            Unit::Millimetre
        },
        orientation: Orientation::Directions,
    })
}

/// What x, y and z of the file's space are multiplied with to be right, anterior and superior.
fn ras_factors(fields: &Fields, notes: &mut Vec<String>) -> Result<DVec3, Fault> {
    let space = fields.get("space").map(str::to_ascii_lowercase);
    Ok(match space.as_deref() {
        Some("right-anterior-superior" | "ras") => DVec3::ONE,
        Some("left-anterior-superior" | "las") => DVec3::new(-1.0, 1.0, 1.0),
        Some("left-posterior-superior" | "lps") => RAS_FROM_LPS,
        Some("scanner-xyz" | "3d-right-handed" | "3d-left-handed") | None => {
            let named = space.as_deref().unwrap_or("none");
            notes.push(format!(
                "space {named} names no axes of a body; x, y and z are taken as stored"
            ));
            DVec3::ONE
        }
        Some(_) => {
            return Err(fields.bad(
                "space",
                "read are RAS, LAS, LPS, scanner-xyz and 3D-right- or left-handed",
            ));
        }
    })
}

fn by_spacings(fields: &Fields, axes: &Axes, notes: &mut Vec<String>) -> Result<Placed, Fault> {
    notes.push("the file gives no orientation; axes are taken as stored, the first voxel as origin".into());
    let Some(all) = fields.numbers::<f64>("spacings")? else {
        notes.push("the file gives no distances between voxels; lengths are in voxels".into());
        return Ok(Placed {
            world_from_voxel: DAffine3::IDENTITY,
            unit: Unit::Unknown,
            orientation: Orientation::Spacings,
        });
    };
    let spacing = axes
        .pick(&all)
        .filter(|s| s.iter().all(|v| *v > 0.0))
        .ok_or_else(|| fields.bad("spacings", "a number above 0 for each axis is needed"))?;
    let unit = unit(fields, "units", |all| axes.pick(&all), notes)?;
    let scale = unit.in_mm().unwrap_or(1.0);
    Ok(Placed {
        world_from_voxel: usable(DAffine3::from_scale(DVec3::from_array(spacing) * scale))?,
        unit: if unit == Unit::Unknown {
            unit
        } else {
            Unit::Millimetre
        },
        orientation: Orientation::Spacings,
    })
}

/// The unit that all three axes share, from quoted names.
fn unit(
    fields: &Fields,
    name: &'static str,
    pick: impl FnOnce(Vec<String>) -> Option<[String; 3]>,
    notes: &mut Vec<String>,
) -> Result<Unit, Fault> {
    let Some(text) = fields.get(name) else {
        notes.push("the file names no unit of length".into());
        return Ok(Unit::Unknown);
    };
    // Names stand between quotes; between those are blanks.
    let quoted: Vec<String> = text
        .split('"')
        .skip(1)
        .step_by(2)
        .map(|n| n.trim().to_owned())
        .collect();
    let [x, y, z] = pick(quoted).ok_or_else(|| fields.bad(name, "a quoted name for each axis is needed"))?;
    if x != y || y != z {
        return Err(fields.bad(name, "all three axes need the same unit"));
    }
    let unit = match x.to_ascii_lowercase().as_str() {
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => Unit::Millimetre,
        "um" | "µm" | "μm" | "micron" | "microns" | "micrometer" | "micrometers" | "micrometre" => {
            Unit::Micrometre
        }
        "cm" | "centimeter" | "centimeters" | "centimetre" => Unit::Centimetre,
        "m" | "meter" | "meters" | "metre" => Unit::Metre,
        other => {
            notes.push(format!(
                "the unit {} is not known",
                crate::error::excerpt(other.as_bytes())
            ));
            Unit::Unknown
        }
    };
    Ok(unit)
}
