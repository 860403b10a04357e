//! Maps from voxels to the world: which are usable, and where the world of a file turns into RAS.

use glam::{DAffine3, DMat3, DVec3};

use crate::Fault;

/// Smallest |det| of the unit axes that counts as three directions: 1e-6 is 0.2 arc seconds out of a plane.
const LEAST_VOLUME: f64 = 1e-6;

/// Lengths and offsets between 1 / this and this: products of three and their inverses stay finite.
const LARGEST: f64 = 1e60;

/// Largest number of voxels: 2^50, beyond any memory, below any overflow.
const MOST_VOXELS: u64 = 1 << 50;

/// Finite, with axes of some length that do not lie in one plane: the inverse exists and is finite.
pub(crate) fn is_usable(a: &DAffine3) -> bool {
    let m = a.matrix3;
    let lengths = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::length);
    let is_sane = |l: &f64| (1.0 / LARGEST..=LARGEST).contains(l);
    if !a.is_finite() || !lengths.iter().all(is_sane) || a.translation.abs().max_element() > LARGEST {
        return false;
    }
    let unit = DMat3::from_cols(
        m.x_axis / lengths[0],
        m.y_axis / lengths[1],
        m.z_axis / lengths[2],
    );
    unit.determinant().abs() >= LEAST_VOLUME
}

/// The map of a file, if it can be inverted.
pub(super) fn usable(map: DAffine3) -> Result<DAffine3, Fault> {
    if is_usable(&map) {
        return Ok(map);
    }
    let m = map.matrix3;
    Err(Fault::Value {
        what: "the map from voxels to the world",
        value: format!(
            "axes {:?} from {:?}",
            m.to_cols_array_2d(),
            map.translation.to_array()
        ),
        remedy: "the axes are finite, not 0 and not in one plane; correct the header",
    })
}

/// A map with its world mirrored: LPS into RAS and back, with the factors of x, y and z.
pub(super) fn in_world(map: &DAffine3, factors: DVec3) -> DAffine3 {
    DAffine3 {
        matrix3: DMat3::from_diagonal(factors) * map.matrix3,
        translation: factors * map.translation,
    }
}

/// Left, posterior, superior to right, anterior, superior.
pub(super) const RAS_FROM_LPS: DVec3 = DVec3::new(-1.0, -1.0, 1.0);

/// Dimensions of a file, each at least 1 and not too many voxels in all.
pub(super) fn checked_dims(dims: [i64; 3]) -> Result<[usize; 3], Fault> {
    if let Some(n) = dims.iter().find(|n| **n < 1) {
        return Err(Fault::Value {
            what: "a dimension",
            value: n.to_string(),
            remedy: "an empty volume cannot be fitted; every dimension is at least 1",
        });
    }
    let count = dims.iter().try_fold(1u64, |n, d| n.checked_mul(*d as u64));
    if count.is_none_or(|n| n > MOST_VOXELS) {
        let [x, y, z] = dims;
        return Err(Fault::Value {
            what: "the number of voxels",
            value: format!("{x} x {y} x {z}"),
            remedy: "at most 2^50 can be read; is the header damaged?",
        });
    }
    Ok(dims.map(|n| n as usize))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_usable_map_has_a_finite_inverse() {
        for (scale, offset, expected) in [
            (1e59, 1e59, true),
            (1e-59, 1e59, true),
            (1e61, 0.0, false),
            (1e-61, 0.0, false),
            (1.0, 1e61, false),
            (f64::NAN, 0.0, false),
            (0.0, 0.0, false),
        ] {
            let a = DAffine3 {
                matrix3: DMat3::from_diagonal(DVec3::splat(scale)),
                translation: DVec3::splat(offset),
            };
            assert_eq!(is_usable(&a), expected, "{scale} {offset}");
            assert!(!expected || a.inverse().is_finite(), "{scale} {offset}");
            assert_eq!(usable(a).is_ok(), expected);
        }
    }

    #[test]
    fn dimensions_are_positive_and_their_product_bounded() {
        assert_eq!(checked_dims([1, 2, 3]).unwrap(), [1, 2, 3]);
        for bad in [[0, 1, 1], [5, -1, 2], [1 << 20, 1 << 20, 1 << 20], [i64::MAX; 3]] {
            assert!(checked_dims(bad).is_err(), "{bad:?}");
        }
    }
}
