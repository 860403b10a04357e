//! From raw points and faces to a clean cloud: what is left out is counted, normals get unit length.

use glam::DVec3;

use super::cloud::{NormalSource, PointCloud};
use crate::Fault;
use crate::limits::Budget;
use crate::raw::{NO_NORMAL, RawShape};

/// Length of an angle-weighted sum that counts as zero. Angles around a vertex add up to some radians, their
/// rounding to 1e-15; a corner of a true needle is still far above.
const CANCELLED: f64 = 1e-12;

/// Cleans `raw`.
///
/// Vertex normals from faces are `Σ angle · n_face`, normalized, over the corners at the vertex
/// [Thürmer & Wüthrich 1998]; how a flat polygon is cut does not change the sum.
///
/// # Errors
/// [`Fault::Value`] if no point is left.
pub(super) fn finish(raw: RawShape, budget: &mut Budget) -> Result<PointCloud, Fault> {
    let RawShape {
        mut positions,
        normals,
        triangles,
        corner_normals,
        face_count,
        short_faces,
        unit,
        resolution,
        left_out_attributes,
        notes,
        ..
    } = raw;
    let file_count = positions.len();
    let has_faces = face_count > 0;
    let invalid_dropped = positions.iter().filter(|p| !p.is_finite()).count();
    let mut cloud = PointCloud {
        file_count,
        face_count,
        invalid_dropped,
        unit,
        resolution,
        left_out_attributes,
        notes,
        ..Default::default()
    };

    let mut normals = normals;
    if has_faces {
        budget.reserve("vertex flags", file_count as u64, 1)?;
        let from_faces = normals.is_none();
        let mut sums = Vec::new();
        if from_faces {
            budget.reserve("vertex normals", file_count as u64, size_of::<DVec3>())?;
            sums = vec![DVec3::ZERO; file_count];
        }
        let mut is_used = vec![false; file_count];
        cloud.degenerate_faces = short_faces;
        for (t, tri) in triangles.iter().enumerate() {
            let corners = tri.map(|v| positions[v as usize]);
            if corners.iter().any(|p| !p.is_finite()) {
                continue;
            }
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let length = normal.length();
            if length == 0.0 || !length.is_finite() {
                cloud.degenerate_faces += 1;
                continue;
            }
            for v in tri {
                is_used[*v as usize] = true;
            }
            if from_faces {
                let own = corner_normals.as_ref().map(|(index, list)| (index[t], list));
                add_corners(&mut sums, tri, &corners, normal / length, length, own);
            }
        }
        if from_faces {
            // The sum of a sheet and its back cancels up to rounding; what is left of it points nowhere.
            sums.iter_mut()
                .filter(|n| n.length_squared() < CANCELLED * CANCELLED)
                .for_each(|n| *n = DVec3::ZERO);
            normals = Some(sums);
        }
        cloud.normal_source = match (from_faces, &corner_normals) {
            (true, None) => NormalSource::Faces,
            _ => NormalSource::Stored,
        };
        cloud.unused_vertices = positions
            .iter()
            .zip(&is_used)
            .filter(|(p, used)| p.is_finite() && !**used)
            .count();
        if cloud.unused_vertices + invalid_dropped > 0 {
            keep(&mut positions, normals.as_mut(), |v, p| {
                is_used[v] && p.is_finite()
            });
        }
    } else {
        if normals.is_some() {
            cloud.normal_source = NormalSource::Stored;
        }
        if invalid_dropped > 0 {
            keep(&mut positions, normals.as_mut(), |_, p| p.is_finite());
        }
    }
    if let Some(normals) = &mut normals {
        for n in normals.iter_mut() {
            *n = unit_or_zero(*n);
            cloud.zero_normals += usize::from(*n == DVec3::ZERO);
        }
    }
    cloud.positions = positions;
    cloud.normals = normals;
    if cloud.positions.is_empty() {
        return Err(Fault::Value {
            what: "the number of usable points",
            value: format!(
                "0 of {file_count} ({invalid_dropped} not finite, {} used by no face of any area)",
                cloud.unused_vertices
            ),
            remedy: "check how the file was exported",
        });
    }
    note_repairs(&mut cloud);
    Ok(cloud)
}

/// Adds a triangle's share to the sums of its three vertices.
fn add_corners(
    sums: &mut [DVec3],
    tri: &[u32; 3],
    corners: &[DVec3; 3],
    normal: DVec3,
    double_area: f64,
    own: Option<([u32; 3], &Vec<DVec3>)>,
) {
    for i in 0..3 {
        let (u, w) = (
            corners[(i + 1) % 3] - corners[i],
            corners[(i + 2) % 3] - corners[i],
        );
        // |u × w| is twice the area at every corner; the arctangent keeps its digits for thin triangles, the
        // arccosine does not.
        let angle = double_area.atan2(u.dot(w));
        let direction = match own {
            Some((index, list)) if index[i] != NO_NORMAL => unit_or_zero(list[index[i] as usize]),
            _ => normal,
        };
        sums[tri[i] as usize] += direction * angle;
    }
}

/// `n/|n|`, or zero where that is not defined. Lengths under- or overflow nowhere.
fn unit_or_zero(n: DVec3) -> DVec3 {
    let largest = n.abs().max_element();
    if !n.is_finite() || largest == 0.0 {
        return DVec3::ZERO;
    }
    let squared = n.length_squared();
    if squared > 1e-200 && squared < 1e200 {
        return n / squared.sqrt();
    }
    // A power of two is exact; this one brings every double to where its square is a normal number.
    let scale = 2f64.powi(if largest < 1.0 { 600 } else { -600 });
    (n * scale).normalize()
}

fn keep(positions: &mut Vec<DVec3>, normals: Option<&mut Vec<DVec3>>, wanted: impl Fn(usize, DVec3) -> bool) {
    let mut kept = 0;
    let mut normals = normals;
    for v in 0..positions.len() {
        if wanted(v, positions[v]) {
            positions[kept] = positions[v];
            if let Some(n) = normals.as_deref_mut() {
                n[kept] = n[v];
            }
            kept += 1;
        }
    }
    positions.truncate(kept);
    if let Some(n) = normals {
        n.truncate(kept);
    }
}

fn note_repairs(cloud: &mut PointCloud) {
    let total = cloud.file_count;
    if cloud.invalid_dropped > 0 {
        cloud.notes.push(format!(
            "{} of {total} points have a coordinate that is NaN or infinite; left out",
            cloud.invalid_dropped
        ));
    }
    if cloud.unused_vertices > 0 {
        cloud.notes.push(format!(
            "{} of {total} vertices are used by no face; left out",
            cloud.unused_vertices
        ));
    }
    if cloud.degenerate_faces > 0 {
        cloud.notes.push(format!(
            "{} of {} faces have no area; left out",
            cloud.degenerate_faces, cloud.face_count
        ));
    }
    if cloud.zero_normals > 0 {
        cloud.notes.push(format!(
            "{} of {} normals are zero or not finite",
            cloud.zero_normals,
            cloud.positions.len()
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReadLimits;

    fn clean(raw: RawShape) -> PointCloud {
        finish(raw, &mut Budget::new(&ReadLimits::default())).unwrap()
    }

    /// Octahedron: by symmetry the normal of each vertex points away from the centre.
    fn octahedron() -> RawShape {
        let positions = vec![
            DVec3::X,
            DVec3::NEG_X,
            DVec3::Y,
            DVec3::NEG_Y,
            DVec3::Z,
            DVec3::NEG_Z,
        ];
        let mut triangles = Vec::new();
        for x in 0..2u32 {
            for y in 0..2 {
                for z in 0..2 {
                    let [a, b, c] = [x, 2 + y, 4 + z];
                    triangles.push(if (x + y + z) % 2 == 0 {
                        [a, b, c]
                    } else {
                        [a, c, b]
                    });
                }
            }
        }
        RawShape {
            positions,
            face_count: triangles.len(),
            triangles,
            ..Default::default()
        }
    }

    #[test]
    fn normals_of_an_octahedron_point_from_its_centre() {
        let cloud = clean(octahedron());
        assert_eq!(cloud.normal_source, NormalSource::Faces);
        for (p, n) in cloud.positions.iter().zip(cloud.normals.as_ref().unwrap()) {
            assert!((*p - *n).length() < 1e-15);
        }
    }

    #[test]
    fn the_weight_is_the_angle_so_a_split_face_changes_nothing() {
        let corner = |split: bool| {
            let mut positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
            let mut triangles = vec![[0, 1, 2], [0, 2, 3], [0, 3, 1]];
            if split {
                positions.push(DVec3::new(0.2, 0.8, 0.0));
                triangles = vec![[0, 1, 4], [0, 4, 2], [0, 2, 3], [0, 3, 1]];
            }
            let face_count = triangles.len();
            clean(RawShape {
                positions,
                triangles,
                face_count,
                ..Default::default()
            })
            .normals
            .unwrap()[0]
        };
        assert!((corner(false) - corner(true)).length() < 1e-15);
        assert!((corner(false) - DVec3::ONE.normalize()).length() < 1e-15);
    }

    #[test]
    fn what_is_left_out_is_counted() {
        let mut raw = octahedron();
        raw.positions.push(DVec3::splat(9.0));
        raw.positions.push(DVec3::new(f64::NAN, 0.0, 0.0));
        raw.triangles.push([0, 0, 1]);
        raw.triangles.push([0, 1, 7]);
        raw.face_count += 2;
        let cloud = clean(raw);
        assert_eq!(cloud.positions.len(), 6);
        assert_eq!(
            (
                cloud.unused_vertices,
                cloud.invalid_dropped,
                cloud.degenerate_faces
            ),
            (1, 1, 1)
        );
        assert_eq!(cloud.notes.len(), 3);
        assert_eq!(cloud.file_count, 8);
    }

    #[test]
    fn faces_back_to_back_give_a_zero_normal_and_no_rounding_noise() {
        let positions = vec![
            DVec3::ZERO,
            DVec3::new(0.3, 0.1, 0.7),
            DVec3::new(0.9, 0.2, 0.1),
            DVec3::new(0.11, 1.7, 0.3),
        ];
        let triangles = vec![[0, 1, 2], [2, 1, 0], [0, 2, 3], [3, 2, 0], [1, 0, 3], [0, 1, 3]];
        let cloud = clean(RawShape {
            positions,
            triangles,
            face_count: 6,
            ..Default::default()
        });
        assert_eq!(cloud.zero_normals, 4);
    }

    #[test]
    fn zero_and_nan_normals_become_zero_and_are_counted() {
        let cloud = clean(RawShape {
            positions: vec![DVec3::ZERO; 4],
            normals: Some(vec![
                DVec3::ZERO,
                DVec3::NAN,
                DVec3::splat(1e-320),
                DVec3::new(0.0, 3.0, 4.0),
            ]),
            ..Default::default()
        });
        assert_eq!(cloud.zero_normals, 2);
        let n = cloud.normals.unwrap();
        assert!(
            (n[2].length() - 1.0).abs() < 1e-3,
            "a subnormal direction is still one: {}",
            n[2]
        );
        assert!((n[3] - DVec3::new(0.0, 0.6, 0.8)).length() < 1e-15);
    }

    #[test]
    fn a_cloud_of_nan_alone_is_an_error() {
        let raw = RawShape {
            positions: vec![DVec3::NAN; 3],
            ..Default::default()
        };
        let e = finish(raw, &mut Budget::new(&ReadLimits::default()))
            .unwrap_err()
            .to_string();
        assert!(e.contains("0 of 3"), "{e}");
    }
}
