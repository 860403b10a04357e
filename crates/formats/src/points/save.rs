//! Point clouds out.

use std::path::Path;

use super::cloud::PointCloud;
#[cfg(feature = "lidar")]
use super::{e57, las};
use super::{pcd, ply, xyz};
use crate::file_name::{extension, is_gz_name};
use crate::meshes::{needs_double, rounding_to_single};
use crate::{Fault, FormatError, Unit, atomic};

/// Formats of point clouds to be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Ply,
    Xyz,
    Pcd,
    Las,
    Laz,
    E57,
}

const SUPPORTED: &str = ".ply, .pcd, .las, .laz, .e57, .xyz, .xyzn and .txt";

/// Writes a cloud in the format of its name, atomically; normals go with the points where there are any.
///
/// Coordinates are single precision in PLY and PCD, unless that would move points by more than half of the file's own
/// step ([`PointCloud::resolution`]: points of neighbouring steps would become one), or by more than a millionth of
/// the cloud's diagonal (a small thing far from the origin): then they are double, which a note says. LAS and LAZ hold multiples of a decimal step, a
/// thousand-millionth of the cloud's extent or finer. The others keep all digits. E57 is in metres, and so are LAS and
/// LAZ where the unit is known.
/// The returned notes say what the format cannot hold.
///
/// # Errors
/// [`Fault::UnknownKind`] with what is supported, [`Fault::Output`] for what the format has no room for, I/O.
///
/// # Panics
/// If the normals are not one a point.
pub fn save(path: &Path, cloud: &PointCloud) -> Result<Vec<String>, FormatError> {
    let (points, normals) = (&cloud.positions, cloud.normals.as_deref());
    assert!(
        normals.is_none_or(|n| n.len() == points.len()),
        "one normal per point"
    );
    let format = format_of(path).map_err(|fault| fault.at(path))?;
    let rounding = rounding_to_single(points);
    let double = needs_double(points) || cloud.resolution.is_some_and(|r| rounding > 0.5 * r);
    if format != Format::Xyz && points.len() > u32::MAX as usize {
        return Err(Fault::Output {
            what: "a cloud",
            value: format!("{} points", points.len()),
            remedy: "split it, or write text",
        }
        .at(path));
    }
    match format {
        Format::Ply => atomic::replace(path, |out| ply::write_points(out, points, normals, None, double))?,
        Format::Pcd => atomic::replace(path, |out| pcd::write(out, cloud, double))?,
        #[cfg(not(feature = "lidar"))]
        Format::Las | Format::Laz | Format::E57 => {
            return Err(Fault::left_out("a cloud of this format", "lidar").at(path));
        }
        #[cfg(feature = "lidar")]
        Format::Las | Format::Laz => {
            atomic::replace(path, |out| las::write(out, cloud, format == Format::Laz))?
        }
        #[cfg(feature = "lidar")]
        Format::E57 => atomic::replace(path, |out| e57::write(out, cloud))?,
        Format::Xyz => atomic::replace(path, |out| xyz::write(out, cloud))?,
    }
    let mut notes = Vec::new();
    if double && matches!(format, Format::Ply | Format::Pcd) {
        notes.push(format!(
            "written in double precision: single would move points by up to {rounding:.3e} {}",
            cloud.unit
        ));
    }
    if format == Format::E57 && cloud.unit == Unit::Unknown {
        notes.push("the unit of the cloud is not known; the file's numbers mean metres".into());
    }
    Ok(notes)
}

fn format_of(path: &Path) -> Result<Format, Fault> {
    let extension = extension(path);
    match extension.as_str() {
        _ if is_gz_name(path) => {}
        "ply" => return Ok(Format::Ply),
        "pcd" => return Ok(Format::Pcd),
        "las" => return Ok(Format::Las),
        "laz" => return Ok(Format::Laz),
        "e57" => return Ok(Format::E57),
        "xyz" | "xyzn" | "txt" => return Ok(Format::Xyz),
        _ => {}
    }
    let found = path.extension().map(|e| format!(".{}", e.to_string_lossy()));
    Err(Fault::UnknownKind {
        found: found.unwrap_or_else(|| "a name without an extension".into()),
        purpose: "point output",
        supported: SUPPORTED,
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::ReadLimits;
    use crate::points::read;

    fn cloud(offset: DVec3) -> PointCloud {
        PointCloud {
            positions: (0..40)
                .map(|i| offset + DVec3::new(0.001, -0.25, 0.5) * f64::from(i))
                .collect(),
            normals: Some(vec![DVec3::new(0.6, 0.0, -0.8); 40]),
            ..Default::default()
        }
    }

    /// Millimetres in map coordinates, in metres: single precision would round by 0.25 there.
    #[test]
    fn points_come_back_near_and_far_from_the_origin_with_and_without_normals() {
        let directory = tempfile::tempdir().unwrap();
        for name in ["a.ply", "a.pcd", "a.xyz", "a.las", "a.laz", "a.e57"] {
            let path = directory.path().join(name);
            // Metres become millimetres where the format has no other unit.
            let scale = if name.ends_with("e57") { 1000.0 } else { 1.0 };
            for (offset, slack) in [(DVec3::ZERO, 1e-6), (DVec3::new(1e6, 5_400_000.0, 12.0), 2e-9)] {
                for with_normals in [true, false] {
                    let mut written = cloud(offset);
                    written.normals = written.normals.filter(|_| with_normals);
                    let notes = save(&path, &written).unwrap();
                    let is_double = matches!(name, "a.ply" | "a.pcd") && offset != DVec3::ZERO;
                    assert_eq!(notes.len(), usize::from(scale > 1.0 || is_double), "{notes:?}");
                    let back = read(&path, &ReadLimits::default()).unwrap();
                    assert_eq!(back.positions.len(), 40);
                    for (a, b) in back.positions.iter().zip(&written.positions) {
                        assert!(
                            (*a / scale - *b).abs().max_element() <= slack,
                            "{name}: {a} for {b}"
                        );
                    }
                    assert_eq!(back.normals.is_some(), with_normals, "{name}");
                    for n in back.normals.iter().flatten() {
                        assert!((*n - DVec3::new(0.6, 0.0, -0.8)).length() < 1e-7);
                    }
                }
            }
        }
        // A map of 800 km, in steps of a centimetre: rounding is small beside the diagonal, not beside a step.
        let mut map = PointCloud {
            positions: (0..1000)
                .map(|i| DVec3::new(3e5 + 800.0 * f64::from(i), 5_400_000.0 + 0.01 * f64::from(i), 0.0))
                .collect(),
            resolution: Some(0.01),
            ..Default::default()
        };
        for name in ["a.ply", "a.pcd"] {
            let path = directory.path().join(name);
            let notes = save(&path, &map).unwrap();
            assert!(
                notes[0].contains("double precision") && notes[0].contains("e-1 file unit"),
                "{notes:?}"
            );
            assert_eq!(
                read(&path, &ReadLimits::default()).unwrap().positions,
                map.positions
            );
        }
        map.resolution = None;
        assert_eq!(save(&directory.path().join("a.ply"), &map).unwrap(), [""; 0]);
        let e = save(&directory.path().join("a.step"), &cloud(DVec3::ZERO)).unwrap_err();
        assert!(
            e.to_string().contains(".step is not a supported point output"),
            "{e}"
        );
        assert!(save(&directory.path().join("a.ply.gz"), &cloud(DVec3::ZERO)).is_err());
    }
}
