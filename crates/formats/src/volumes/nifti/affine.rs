//! Which of the transforms of a NIfTI header maps voxels to the world.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use crate::Fault;
use crate::volumes::geometry::is_usable;
use crate::volumes::volume::Orientation;

/// The fields of a header that bear on the transform, widened to f64.
#[derive(Debug)]
pub(super) struct Transforms {
    pub qform_code: i32,
    pub sform_code: i32,
    /// `pixdim[0]`: −1 mirrors the third axis of the qform.
    pub qfac: f64,
    pub spacing: [f64; 3],
    pub quaternion: [f64; 3],
    pub offset: [f64; 3],
    /// The three rows of the sform.
    pub rows: [[f64; 4]; 3],
}

/// Chooses the sform, then the qform, then the spacings, as the standard advises; what cannot be used is passed
/// over with a note.
pub(super) fn choose(t: &Transforms, notes: &mut Vec<String>) -> Result<(DAffine3, Orientation), Fault> {
    if t.sform_code > 0 {
        let sform = sform(t);
        if is_usable(&sform) {
            return Ok((sform, Orientation::Sform));
        }
        notes.push("the sform is singular or not finite; passed over".into());
    }
    if t.qform_code > 0 {
        match qform(t) {
            Some(a) if is_usable(&a) => return Ok((a, Orientation::Qform)),
            _ => notes.push("the qform is singular or not finite; passed over".into()),
        }
    }
    let spacings = DAffine3 {
        matrix3: DMat3::from_diagonal(DVec3::from_array(t.spacing.map(f64::abs))),
        translation: DVec3::ZERO,
    };
    if !is_usable(&spacings) {
        return Err(Fault::Value {
            what: "the voxel spacing",
            value: format!("{:?} and there is no usable sform or qform", t.spacing),
            remedy: "set the affine of the volume, in nibabel img.set_sform(...), and save it again",
        });
    }
    notes.push("the file gives no orientation; axes are taken as stored, the first voxel as origin".into());
    Ok((spacings, Orientation::Spacings))
}

fn sform(t: &Transforms) -> DAffine3 {
    let r = t.rows.map(|row| DVec3::new(row[0], row[1], row[2]));
    let offset = DVec3::new(t.rows[0][3], t.rows[1][3], t.rows[2][3]);
    DAffine3 {
        matrix3: DMat3::from_cols(r[0], r[1], r[2]).transpose(),
        translation: offset,
    }
}

fn qform(t: &Transforms) -> Option<DAffine3> {
    let [b, c, d] = t.quaternion;
    let squared = b * b + c * c + d * d;
    // Single precision leaves up to a few 1e-7 beyond 1 for a half turn.
    if squared.is_nan() || squared > 1.0 + 1e-5 {
        return None;
    }
    let a = (1.0 - squared).max(0.0).sqrt();
    let rotation = DMat3::from_quat(DQuat::from_xyzw(b, c, d, a).normalize());
    let [dx, dy, dz] = t.spacing.map(f64::abs);
    let flip = if t.qfac < 0.0 { -1.0 } else { 1.0 };
    let matrix3 = rotation * DMat3::from_diagonal(DVec3::new(dx, dy, dz * flip));
    Some(DAffine3 {
        matrix3,
        translation: DVec3::from_array(t.offset),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain() -> Transforms {
        Transforms {
            qform_code: 1,
            sform_code: 1,
            qfac: -1.0,
            spacing: [2.0, 3.0, 4.0],
            quaternion: [0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2],
            offset: [1.0, 2.0, 3.0],
            rows: [[0.0, -2.0, 0.0, 5.0], [3.0, 0.0, 0.0, 6.0], [0.0, 0.0, 4.0, 7.0]],
        }
    }

    #[test]
    fn the_sform_is_preferred_then_the_qform_then_the_spacings() {
        let mut notes = Vec::new();
        let mut t = plain();
        let p = DVec3::new(1.0, 10.0, 100.0);
        let at = |t: &Transforms, notes: &mut Vec<String>| {
            let (a, o) = choose(t, notes).unwrap();
            (a.transform_point3(p), o)
        };
        assert_eq!(
            at(&t, &mut notes),
            (DVec3::new(-15.0, 9.0, 407.0), Orientation::Sform)
        );
        t.sform_code = 0;
        // A quarter turn about z, third axis mirrored: (x, y, z) -> (-3y, 2x, -4z) + offset.
        let (q, o) = at(&t, &mut notes);
        assert!(
            (q - DVec3::new(-29.0, 4.0, -397.0)).length() < 1e-12 && o == Orientation::Qform,
            "{q}"
        );
        assert!(notes.is_empty());
        t.qform_code = 0;
        assert_eq!(
            at(&t, &mut notes),
            (DVec3::new(2.0, 30.0, 400.0), Orientation::Spacings)
        );
        assert_eq!(notes.len(), 1);
    }

    #[test]
    fn what_cannot_be_used_is_passed_over_with_a_note_and_nothing_left_is_an_error() {
        let mut notes = Vec::new();
        let mut t = plain();
        t.rows[2] = t.rows[1];
        t.quaternion = [f64::NAN, 0.0, 0.0];
        assert_eq!(choose(&t, &mut notes).unwrap().1, Orientation::Spacings);
        assert_eq!(notes.len(), 3);
        t.spacing[1] = 0.0;
        assert!(
            choose(&t, &mut notes)
                .unwrap_err()
                .to_string()
                .contains("spacing")
        );
    }
}
