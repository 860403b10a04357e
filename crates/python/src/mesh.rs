//! Triangles.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;

use bspline::Frame;
use bspline::polygonize::{PolygonizeOptions, polygonize_with};
use document::{Fineness, Surface};
use fitting::{Control, Progress};
use formats::meshes::Mesh as Written;
use glam::{DAffine3, DVec3};
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::arrays::{corners, points, rows, vectors};
use crate::field::{CoreField, unit_of};
use crate::run::{Wishes, brief, run};

/// How fine the triangles are to be; one of them, or as fine as the fit.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Fine {
    tolerance: Option<f64>,
    is_share: bool,
    triangles: Option<usize>,
    resolution: Option<u32>,
}

/// Vertices, triangles, what is to be told of them.
type Meshed<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u32>>, Vec<String>);

/// The triangles of a surface.
#[pyfunction]
pub fn mesh_of<'py>(
    py: Python<'py>,
    core: PyRef<'py, CoreField>,
    iso: f64,
    open: bool,
    fine: Fine,
    wishes: Wishes,
) -> PyResult<Meshed<'py>> {
    let field = Arc::clone(&core.solid);
    let grids = core.grids;
    let (meta, report) = (core.meta.clone(), core.report.clone());
    let (mesh, notes) = run(py, &wishes, move |control| {
        let mut notes = Vec::new();
        if let Some(n) = fine.resolution {
            let options = PolygonizeOptions {
                iso,
                open,
                ..Default::default()
            };
            let frame = frame_of_resolution(&grids.lattice, n);
            let (mesh, _) = polygonize_with(&*field, &frame, &options, &mut watch(control))?;
            return Ok((mesh, notes));
        }
        let fineness = match (fine.tolerance, fine.triangles) {
            (Some(share), _) if fine.is_share => Fineness::Share(share),
            (Some(error), _) => Fineness::Error(error),
            (_, Some(most)) => Fineness::Triangles(most),
            _ => Fineness::OfTheFit,
        };
        let surface = Surface {
            field: &*field,
            lattice: &grids.lattice,
            levels: grids.levels,
            slope: grids.slope,
            meta: &meta,
            report: &report,
            iso,
            open,
        };
        let made = surface.mesh(fineness, &mut notes, &mut watch(control))?;
        Ok((made.mesh, notes))
    })?;
    Ok((
        points(py, &mesh.positions)?,
        rows(py, mesh.triangles.concat(), 3)?,
        notes,
    ))
}

fn watch(control: &mut Control) -> impl FnMut(f64) -> ControlFlow<()> {
    |fraction| {
        (control.on_progress)(Progress {
            stage: "meshing",
            fraction,
        });
        match control.cancel.is_cancelled() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}

/// The grid with `n` cells along the longest side of the box, and as many on the others as their lengths ask.
fn frame_of_resolution(lattice: &bspline::hierarchical::Lattice, n: u32) -> Frame {
    let sides = lattice.spacing(0) * lattice.extent();
    let cell = sides.max_element() / f64::from(n.max(1));
    let cells = (sides / cell).to_array().map(|c| (c.round() as u32).max(1));
    let step = lattice.extent() / DVec3::from_array(cells.map(f64::from));
    Frame {
        world_from_grid: lattice.world_from_lattice * DAffine3::from_scale(step),
        cells,
    }
}

/// Writes triangles into a file of the format that its name tells.
#[pyfunction]
pub fn write_mesh(
    py: Python<'_>,
    path: PathBuf,
    vertices: &Bound<'_, PyArray2<f64>>,
    faces: &Bound<'_, PyArray2<u32>>,
    unit: Option<&str>,
) -> PyResult<Vec<String>> {
    let (vertices, unit) = (vectors(vertices)?, unit_of(unit)?);
    let triangles = corners(faces, vertices.len())?;
    let mesh = Written {
        vertices: &vertices,
        triangles: &triangles,
        colors: None,
        unit,
    };
    brief(py, || Ok(formats::meshes::save(&path, &mesh)?))
}
