//! The sample lattice of a dynamic patch: which coefficients may move, where the mass-points sit, and the
//! operators between the two.

mod axis;
mod banded;
mod dense;
mod grid;
mod sample_box;
mod tensor;

pub use axis::{Axis, LatticeError, Rim};
pub use banded::Banded;
pub(crate) use dense::{DenseAxis, PAD, multiply, multiply_last, transposed_product};
pub use grid::Lattice;
pub use sample_box::{OnBox, SampleBox};
pub(crate) use tensor::TensorProduct;
pub use tensor::TensorWorkspace;
