use std::sync::Arc;

use bspline::csg::Csg;
use bspline::primitives::{Cuboid, Gyroid, HalfSpace, PiercedTetrahedron, Sphere, Torus};
use bspline::{Aabb, Field};
use glam::DVec3;

/// Test solids with a formula, about 2 across, round the origin. Each asks something else of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solid {
    /// A ball of radius 1: nothing to hide behind.
    Sphere,
    /// A ring of radius 1, its tube of radius 0.4: genus 1.
    Torus,
    /// A gyroid of period 1 cut by a ball of radius 1: both sides of the surface are one labyrinth.
    Gyroid,
    /// A square plate, 2 × 2, one coarse cell thick: opposite sides in one cell.
    Sheet,
    /// The lower half of a hollow ball of radius 1, its wall half a coarse cell thick: what looks like a bowl's
    /// inside is outside.
    Cup,
    /// A hollow tetrahedron with a hole in each face: genus 3.
    Tetrahedron,
}

/// Width of a coarse cell: 1/32 of a box 1.15 times as wide as the solids are.
pub const COARSE_CELL: f64 = 1.15 * 2.0 / 32.0;

impl Solid {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Sphere,
        Self::Torus,
        Self::Gyroid,
        Self::Sheet,
        Self::Cup,
        Self::Tetrahedron,
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Torus => "torus",
            Self::Gyroid => "gyroid",
            Self::Sheet => "sheet",
            Self::Cup => "cup",
            Self::Tetrahedron => "tetrahedron",
        }
    }

    /// The solid, positive inside.
    pub fn field(self) -> Arc<dyn Field> {
        let o = DVec3::ZERO;
        let sound = "the constants below are in range";
        let ball = |radius| -> Arc<dyn Field> { Arc::new(Sphere::new(o, radius).expect(sound)) };
        match self {
            Self::Sphere => ball(1.0),
            Self::Torus => Arc::new(Torus::new(o, DVec3::Z, 1.0, 0.4).expect(sound)),
            Self::Gyroid => {
                let gyroid: Arc<dyn Field> = Arc::new(Gyroid::new(o, 1.0, 0.0).expect(sound));
                Arc::new(Csg::intersection(vec![gyroid, ball(1.0)]).expect(sound))
            }
            Self::Sheet => Arc::new(Cuboid::new(o, DVec3::new(1.0, 1.0, 0.5 * COARSE_CELL)).expect(sound)),
            Self::Cup => {
                let above: Arc<dyn Field> = Arc::new(HalfSpace::new(o, -DVec3::Z).expect(sound));
                let hollow = ball(1.0 - 0.5 * COARSE_CELL);
                Arc::new(Csg::difference(ball(1.0), vec![hollow, above], 0.0).expect(sound))
            }
            Self::Tetrahedron => Arc::new(PiercedTetrahedron::new(o, 1.0 / 3.0, 5.0).expect(sound)),
        }
    }

    /// A box that holds the surface with a little room on all sides.
    pub fn within(self) -> Aabb {
        let half = match self {
            Self::Torus => DVec3::new(1.5, 1.5, 0.5),
            Self::Sheet => DVec3::new(1.1, 1.1, 0.1),
            Self::Tetrahedron => DVec3::splat(1.4),
            _ => DVec3::splat(1.1),
        };
        Aabb {
            min: -half,
            max: half,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantoms::{CloudOptions, sample_cloud};

    /// Sides of the sampled clouds: the surfaces lie where the table says, whole, and inside their boxes.
    #[test]
    fn surfaces_have_the_extent_they_should() {
        for (solid, size, slack) in [
            (Solid::Sphere, DVec3::splat(2.0), 0.02),
            (Solid::Torus, DVec3::new(2.8, 2.8, 0.8), 0.02),
            (Solid::Gyroid, DVec3::splat(2.0), 0.05),
            (Solid::Sheet, DVec3::new(2.0, 2.0, COARSE_CELL), 0.02),
            (Solid::Cup, DVec3::new(2.0, 2.0, 1.0), 0.02),
            (Solid::Tetrahedron, DVec3::splat(2.1), 0.3),
        ] {
            let options = CloudOptions {
                count: 4000,
                ..Default::default()
            };
            let cloud = sample_cloud(&*solid.field(), &solid.within(), &options).unwrap();
            let (lo, hi) = cloud
                .positions
                .iter()
                .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), &p| {
                    (l.min(p), h.max(p))
                });
            let off = (hi - lo - size).abs().max_element();
            assert!(off <= slack, "{}: {} instead of {size}", solid.name(), hi - lo);
            let room = (solid.within().max - hi)
                .min(lo - solid.within().min)
                .min_element();
            assert!(room > 0.01, "{}: {room} of room", solid.name());
        }
    }

    #[test]
    fn outward_normals_lead_out() {
        for solid in Solid::ALL {
            let field = solid.field();
            let options = CloudOptions {
                count: 500,
                ..Default::default()
            };
            let cloud = sample_cloud(&*field, &solid.within(), &options).unwrap();
            for (p, n) in cloud.positions.iter().zip(&cloud.normals) {
                // Shorter than the way to the next crease.
                let step = *n * 1e-7;
                assert!(
                    field.value(*p + step) < 0.0 && field.value(*p - step) > 0.0,
                    "{} at {p}",
                    solid.name()
                );
            }
        }
    }
}
