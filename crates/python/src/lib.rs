//! The Python module `isoclay._isoclay`: what the Python code of the package `isoclay` is laid over.
//!
//! Work runs in threads of its own with the interpreter released ([`run`]), on the caller's own memory where that is large
//! ([`arrays`]). What is wrong becomes an exception of `isoclay.errors` ([`failure`]). Choices, defaults and conversions are
//! made in Python, where users read them.

mod arrays;
mod blocks;
mod csg;
mod document;
mod failure;
mod field;
mod fit;
mod mesh;
mod run;
mod simulation;

use pyo3::prelude::*;

#[pymodule]
mod _isoclay {
    #[pymodule_export]
    use crate::blocks::{block_part, finished_block, near_field, write_blocks};
    #[pymodule_export]
    use crate::csg::{complement, difference, grown, intersection, moved, union};
    #[pymodule_export]
    use crate::document::CoreDocument;
    #[pymodule_export]
    use crate::field::CoreField;
    #[pymodule_export]
    use crate::fit::{fit_file, fit_mesh, fit_points, fit_volume};
    #[pymodule_export]
    use crate::mesh::{mesh_of, write_mesh};
    #[pymodule_export]
    use crate::run::CancelToken;
    #[pymodule_export]
    use crate::simulation::CoreSimulation;

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
