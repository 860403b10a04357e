use crate::hierarchical::EditError;
use crate::{Field, HierarchicalSpline};

/// A fitted field of either precision.
#[derive(Clone, Debug)]
pub enum AnyField {
    /// Single precision.
    F32(HierarchicalSpline<f32>),
    /// Double precision.
    F64(HierarchicalSpline<f64>),
}

impl AnyField {
    /// The field, to be asked.
    pub fn as_field(&self) -> &dyn Field {
        match self {
            Self::F32(f) => f,
            Self::F64(f) => f,
        }
    }

    /// In single precision; coefficients of double precision are rounded to the nearest. A single one is shared.
    ///
    /// # Errors
    /// [`EditError::NotFinite`] for a coefficient beyond single precision.
    pub fn to_single(&self) -> Result<HierarchicalSpline<f32>, EditError> {
        match self {
            Self::F32(f) => Ok(f.clone()),
            Self::F64(f) => f.to_single(),
        }
    }
}
