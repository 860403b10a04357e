//! How the solver's effort grows with depth.

use super::{PointOptions, cascade, coarse};
use crate::Control;
use crate::phantoms::{CloudOptions, Solid, sample_cloud};
use crate::points::OrientedPoints;
use crate::points::plan::Plan;
use crate::points::samples::Samples;

/// Iterations to a residual of 1e-3 on the last of the levels down to each of `depths`, every occupied cell refined.
fn iterations(samples: &Samples, depths: [usize; 4]) -> [usize; 4] {
    depths.map(|depth| {
        let options = PointOptions {
            max_depth: Some(depth),
            ..Default::default()
        };
        let plan = Plan {
            uniform: true,
            residual: 1e-3,
            iterations: 300,
            ..Plan::new(samples, &options, 1e-4, None)
        };
        let (base, _) = coarse::solve(samples, plan.beta, false);
        let cascade =
            cascade::run::<f32>(samples, &base, &plan, 0.0..1.0, &mut Control::default()).expect("no limits");
        let last = cascade.solves.last().expect("levels below the base");
        assert!(
            last.residual <= 1e-3,
            "depth {depth} stopped at {}",
            last.residual
        );
        last.iterations
    })
}

#[test]
fn iterations_hardly_grow_with_depth() {
    // Dense enough that the cells of depth 8 hold two points each, so that depth 9 is refined nearly everywhere.
    let options = CloudOptions {
        count: 120_000,
        ..Default::default()
    };
    let cloud =
        sample_cloud(&*Solid::Torus.field(), &Solid::Torus.within(), &options).expect("a torus in a box");
    let samples = Samples::prepare(OrientedPoints {
        positions: &cloud.positions,
        normals: &cloud.normals,
        certainty: None,
    })
    .expect("a clean cloud");
    let counts = iterations(&samples, [6, 7, 8, 9]);
    println!("iterations to 1e-3 at depths 6 to 9: {counts:?}");
    for count in counts {
        assert!(count as f64 <= 1.5 * counts[0] as f64, "{counts:?}");
    }
}
