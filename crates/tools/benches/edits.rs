//! Geometric edits, from the change of a tool to the coefficients, on one core: the rows of [Hua04 Table 1], and one on 512³ samples.
//!
//! `cargo bench -p tools --bench edits`. The table prints 0.4, 3.0 and 23.5 ms for tools of 10³, 20³ and 40³ samples on 64³
//! coefficients, 8.3 and 59.8 ms for those of 20³ and 40³ on 128³, in a working space of 128³ samples; the name of a row says
//! so. A tool is a ball carved from the surface, as many samples across as it says. One level and no look, as in the paper: new values
//! at the samples, then coefficients. The mesh beside it is that of the carved field on cells of the size of samples.

use std::hint::black_box;
use std::sync::Arc;

use bspline::hierarchical::Lattice;
use bspline::polygonize::{BlockMesh, PolygonizeOptions};
use bspline::primitives::Sphere;
use bspline::{Aabb, Csg, Field, Frame, HierarchicalSpline};
use criterion::{BenchmarkId, Criterion};
use fitting::Control;
use fitting::field::{Aim, FieldFitOptions, fit_field};
use fitting::phantoms::Solid;
use glam::{DAffine3, DVec3};

#[path = "common/cpu_time.rs"]
mod cpu_time;

use cpu_time::{CpuTime, on_one_core};

/// A phantom on one level of `cells³` cells, in a working space of `samples³`.
struct Workpiece {
    field: HierarchicalSpline<f32>,
    shared: Arc<dyn Field>,
    /// Distance of the samples.
    spacing: f64,
    /// A place of the surface.
    at: DVec3,
}

impl Workpiece {
    fn new(cells: u32, samples: u32) -> Self {
        let solid = Solid::Torus;
        let (phantom, within) = (solid.field(), solid.within());
        let size = within.size().max_element();
        let map = DAffine3::from_scale_rotation_translation(
            DVec3::splat(size / f64::from(cells)),
            glam::DQuat::IDENTITY,
            0.5 * (within.min + within.max) - 0.5 * size,
        );
        let lattice = Lattice {
            world_from_lattice: map,
            cells: [cells; 3],
        };
        let field = HierarchicalSpline::schoenberg(lattice, 1.0, |p| phantom.value(p));
        let field: HierarchicalSpline<f32> = field.expect("a field on a lattice");
        let middle = 0.5 * (within.min + within.max);
        let out = (0..1000).map(|i| middle + f64::from(i) / 1000.0 * 0.5 * size * DVec3::X);
        // From the outside on: the middle of a torus is empty.
        let at = { out }.rev().find(|p| field.value(*p) > 0.0).expect("a solid");
        Self {
            shared: Arc::new(field.clone()),
            field,
            spacing: size / f64::from(samples),
            at,
        }
    }

    /// The field with a ball carved from it, `across` samples wide.
    fn carved(&self, across: f64) -> HierarchicalSpline<f32> {
        let radius = 0.5 * across * self.spacing;
        let ball = Sphere::new(self.at, radius).expect("a ball of some size");
        let target = Csg::difference(self.shared.clone(), vec![Arc::new(ball)], 0.0).expect("finite");
        let within = Aabb::new(self.at - radius, self.at + radius);
        let options = FieldFitOptions {
            aim: Aim::Surface {
                iso: 0.0,
                tolerance: 0.02 * self.spacing,
            },
            finest: 0,
            look: false,
        };
        let fitted = fit_field(&target, &self.field, &within, &options, &mut Control::default());
        fitted.expect("a tool beside nothing else").0
    }

    /// The mesh of what lies within the tool and half as much beside it.
    fn mesh(&self, across: f64) -> BlockMesh {
        let reach = 0.75 * across;
        let part = Aabb::new(self.at - reach * self.spacing, self.at + reach * self.spacing);
        let frame = Frame::over(&part, [(2.0 * reach) as u32; 3]);
        let made = BlockMesh::new(&self.field, &frame, &PolygonizeOptions::default());
        made.expect("few blocks").0
    }
}

fn edits(c: &mut Criterion<CpuTime>) {
    let rows: [(&str, u32, u32, &[(u32, Option<f64>)]); 3] = [
        (
            "Hua04 Table 1, 64³ coefficients",
            61,
            128,
            &[(10, Some(0.4)), (20, Some(3.0)), (40, Some(23.5))],
        ),
        (
            "Hua04 Table 1, 128³ coefficients",
            125,
            128,
            &[(20, Some(8.3)), (40, Some(59.8))],
        ),
        (
            "512³ samples, 256³ coefficients",
            253,
            512,
            &[(20, None), (40, None), (80, None)],
        ),
    ];
    for (name, cells, samples, sizes) in rows {
        let piece = Workpiece::new(cells, samples);
        let mut group = c.benchmark_group(name);
        group.sample_size(20);
        for (across, printed) in sizes {
            let printed = printed.map_or_else(|| "not printed".into(), |ms| format!("printed {ms} ms"));
            let across = f64::from(*across);
            let row = |what| BenchmarkId::new(format!("{across}³ samples, {printed}"), what);
            group.bench_function(row("coefficients"), |b| {
                b.iter(|| black_box(piece.carved(across)));
            });
            let whole = piece.field.lattice().world_box();
            let (carved, mesh) = (piece.carved(across), piece.mesh(across));
            group.bench_function(row("mesh beside it"), |b| {
                b.iter_batched_ref(
                    || mesh.clone(),
                    |mesh| mesh.update(&carved, &carved.changed_boxes(&piece.field, &whole)),
                    criterion::BatchSize::LargeInput,
                );
            });
        }
        group.finish();
    }
}

fn main() {
    on_one_core(edits);
}
