use bspline::Aabb;
use glam::DVec3;
use tools::geometric::Origin;
use tools::limits::Limits;
use tools::others::Others;

use crate::Command;

/// Where what is now at a place came from, through all moves of an object.
#[derive(Default)]
pub struct Journey(Vec<(Origin, Limits)>);

impl Journey {
    /// The moves among commands in their order, of the object `name`, which lies in a box.
    pub fn new(commands: &[Command], name: &str, within: &Aabb) -> Self {
        let moves = commands.iter().filter_map(|command| match command {
            Command::Stroke { object, stroke } if object == name => {
                let origin = stroke.motion.as_ref()?.motion.origin(within).ok()?;
                // Masks by other objects are left out: these may have changed since.
                let limits = Limits::new(
                    stroke.within.as_ref(),
                    stroke.mask.as_ref(),
                    &Others::default(),
                    within,
                );
                Some((origin, limits.unwrap_or_default()))
            }
            _ => None,
        });
        Self(moves.collect())
    }

    /// Boxes in `within` outside which nothing was moved.
    pub(super) fn reaches(&self, within: &Aabb) -> impl Iterator<Item = Aabb> {
        let cut = |(origin, limits): &(Origin, Limits)| {
            let reach = limits.cut(&origin.reach());
            Aabb {
                min: reach.min.max(within.min),
                max: reach.max.min(within.max),
            }
        };
        self.0.iter().map(cut).filter(|b| b.min.cmple(b.max).all())
    }

    pub(super) fn back(&self, place: DVec3) -> DVec3 {
        self.0.iter().rev().fold(place, |p, (origin, limits)| {
            match limits.is_free(&Aabb { min: p, max: p }) {
                true => origin.back(p),
                false => p,
            }
        })
    }

    /// Where what was at a place is now.
    pub(super) fn forth(&self, place: DVec3) -> DVec3 {
        self.0.iter().fold(place, |p, (origin, limits)| {
            match limits.is_free(&Aabb { min: p, max: p }) {
                true => origin.forth(p),
                false => p,
            }
        })
    }
}
