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
}
