//! A spline elsewhere, and its name.

use glam::DAffine3;
use sha2::{Digest, Sha256};

use super::spline::TensorSpline;
use crate::Real;

impl<T: Real> TensorSpline<T> {
    /// The spline with another map from its parameters to the world: the very same coefficients elsewhere, turned or
    /// mirrored.
    ///
    /// # Panics
    /// If the map cannot be inverted.
    pub fn placed(&self, world_from_parameter: DAffine3) -> Self {
        let parameter_from_world = world_from_parameter.inverse();
        assert!(
            parameter_from_world.is_finite(),
            "the map from parameters to the world can be inverted"
        );
        let mut spline = self.clone();
        spline.place.world_from_local = world_from_parameter;
        spline.place.local_from_world = parameter_from_world;
        spline
    }

    /// Names the spline: SHA-256 over precision, place, slope, degrees, knots and coefficients (`docs/format.md`).
    pub fn sha256(&self) -> [u8; 32] {
        let mut hash = Sha256::new();
        hash.update(b"isoclay-knots-1");
        hash.update(T::NAME);
        let map = self.place.world_from_local.to_cols_array();
        for number in map.into_iter().chain([self.place.slope]) {
            hash.update(number.to_le_bytes());
        }
        for knots in &self.knots {
            hash.update((knots.degree() as u64).to_le_bytes());
            hash.update((knots.knots().len() as u64).to_le_bytes());
            knots.knots().iter().for_each(|u| hash.update(u.to_le_bytes()));
        }
        let mut bytes = Vec::with_capacity(size_of_val(&*self.coefficients));
        self.coefficients
            .iter()
            .for_each(|c| c.extend_le_bytes(&mut bytes));
        hash.update(&bytes);
        hash.finalize().into()
    }
}
