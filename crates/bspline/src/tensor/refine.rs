//! The same field on more knots, and a part of it on its own.

use super::spline::TensorSpline;
use crate::insertion::{InsertionError, boehm, oslo, restriction};
use crate::{BandedRows, KnotVector, Real};

impl<T: Real> TensorSpline<T> {
    /// Inserts the knot `u` once along `axis` (0, 1, 2 for x, y, z). The field stays as it is, up to rounding.
    ///
    /// # Errors
    /// [`InsertionError::Outside`]; [`InsertionError::Multiplicity`] if `u` occurs as often as the degree says already.
    ///
    /// # Panics
    /// If there is no such axis.
    pub fn insert_knot(&self, axis: usize, u: f64) -> Result<Self, InsertionError> {
        boehm(&self.knots[axis], u).map(|finer| self.on(axis, finer))
    }

    /// Inserts all of `new` along `axis`, in any order, repeated ones as often as they occur.
    ///
    /// # Errors
    /// As [`Self::insert_knot`], and [`InsertionError::TooMany`].
    ///
    /// # Panics
    /// If there is no such axis.
    pub fn insert_knots(&self, axis: usize, new: &[f64]) -> Result<Self, InsertionError> {
        oslo(&self.knots[axis], new).map(|finer| self.on(axis, finer))
    }

    /// Splits every span along `axis` into `parts` equal ones.
    ///
    /// # Errors
    /// [`InsertionError::NoParts`], [`InsertionError::SpanTooShort`], [`InsertionError::TooMany`].
    ///
    /// # Panics
    /// If there is no such axis.
    pub fn refined(&self, axis: usize, parts: usize) -> Result<Self, InsertionError> {
        self.insert_knots(axis, &self.knots[axis].splits(parts)?)
    }

    /// The part of the spline between the parameters `from` and `to` along `axis`, with clamped ends. Outside the part
    /// it falls off as the whole did outside its box.
    ///
    /// # Errors
    /// [`InsertionError::Interval`].
    ///
    /// # Panics
    /// If there is no such axis.
    pub fn restricted(&self, axis: usize, from: f64, to: f64) -> Result<Self, InsertionError> {
        restriction(&self.knots[axis], from, to).map(|part| self.on(axis, part))
    }

    fn on(&self, axis: usize, (knots, rows): (KnotVector, BandedRows<T>)) -> Self {
        let mut finer = self.clone();
        finer.coefficients = rows.apply_along(axis, self.shape(), &self.coefficients).into();
        [finer.place.min[axis], finer.place.max[axis]] = knots.domain();
        finer.knots[axis] = knots;
        finer
    }
}
