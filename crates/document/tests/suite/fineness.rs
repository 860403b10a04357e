//! Meshes as fine as asked for.

use std::ops::ControlFlow;

use bspline::HierarchicalSpline;
use bspline::hierarchical::Lattice;
use document::{Fineness, Surface};
use fitting::FitReport;
use formats::field::FieldMeta;
use glam::{DAffine3, DVec3};

/// The search ends with a mesh, however close the errors that keep what is asked for and that do not come to each other.
#[test]
fn every_chord_error_has_a_mesh() {
    let lattice = Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [16; 3],
    };
    let wavy =
        |p: DVec3| 5.0 + 0.6 * libm::sin(1.3 * p.x) * libm::cos(0.9 * p.y) - p.distance(DVec3::splat(8.0));
    let field = HierarchicalSpline::<f32>::schoenberg(lattice, 1.0, wavy).unwrap();
    let surface = Surface {
        field: &field,
        lattice: field.lattice(),
        levels: field.level_count(),
        slope: field.slope(),
        meta: &FieldMeta::default(),
        report: &FitReport::default(),
        iso: 0.0,
        open: false,
    };
    for n in 0..120 {
        let wanted = 0.3 * 0.96_f64.powi(n);
        let mut notes = Vec::new();
        let mesh = surface.mesh(Fineness::Error(wanted), &mut notes, &mut |_| {
            ControlFlow::Continue(())
        });
        let mesh = mesh.unwrap_or_else(|e| panic!("{wanted}: {e}"));
        assert!(
            mesh.error <= wanted || notes.iter().any(|n| n.contains("coarser than asked")),
            "{wanted}: {notes:?}"
        );
    }
}
