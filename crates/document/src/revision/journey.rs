use bspline::Aabb;
use glam::{DAffine3, DVec3};
use tools::geometric::{Origin, reflection};
use tools::limits::Limits;
use tools::others::Others;

use crate::Command;

/// Where what is now at a place came from, through all moves of an object.
#[derive(Default)]
pub struct Journey(Vec<Leg>);

/// One move.
#[derive(Clone)]
struct Leg {
    origin: Origin,
    limits: Limits,
    /// A reflection in which all of it lies: the other side of a symmetric stroke.
    mirror: Option<DAffine3>,
}

impl Journey {
    /// The moves among commands in their order, of the object `name`, which lies in a box.
    pub fn new(commands: &[Command], name: &str, within: &Aabb) -> Self {
        // What its name was when each was done.
        let mut name = name;
        let mut names: Vec<&str> = Vec::with_capacity(commands.len());
        for command in commands.iter().rev() {
            if let Command::Rename { object, to } = command
                && to == name
            {
                name = object;
            }
            names.push(name);
        }
        let mut legs = Vec::new();
        for (command, name) in commands.iter().zip(names.into_iter().rev()) {
            let Command::Stroke { object, stroke } = command else {
                continue;
            };
            // What moves below a wall takes nothing of the scan's surface along, and the wall is known no more.
            let is_ours = object == name && stroke.wall.is_none();
            let motion = stroke.motion.as_ref().filter(|_| is_ours);
            let Some(origin) = motion.and_then(|m| m.motion.origin(within).ok()) else {
                continue;
            };
            // Masks by other objects are left out: these may have changed since.
            let limits = Limits::new(
                stroke.within.as_ref(),
                stroke.mask.as_ref(),
                &Others::default(),
                within,
            );
            let leg = Leg {
                origin,
                limits: limits.unwrap_or_default(),
                mirror: None,
            };
            let plane = stroke.symmetry.as_ref();
            let mirror = plane.and_then(|plane| reflection(plane.at.0, plane.normal.0).ok());
            let other = mirror.map(|_| Leg {
                mirror,
                ..leg.clone()
            });
            legs.push(leg);
            legs.extend(other);
        }
        Self(legs)
    }

    /// Boxes in `within` outside which nothing was moved.
    pub(super) fn reaches(&self, within: &Aabb) -> impl Iterator<Item = Aabb> {
        let cut = |leg: &Leg| {
            let reach = leg.reach();
            Aabb {
                min: reach.min.max(within.min),
                max: reach.max.min(within.max),
            }
        };
        self.0.iter().map(cut).filter(|b| b.min.cmple(b.max).all())
    }

    pub(super) fn back(&self, place: DVec3) -> DVec3 {
        let legs = self.0.iter().rev();
        legs.fold(place, |p, leg| leg.moved(p, Origin::back))
    }

    /// Where what was at a place is now.
    pub(super) fn forth(&self, place: DVec3) -> DVec3 {
        let legs = self.0.iter();
        legs.fold(place, |p, leg| leg.moved(p, Origin::forth))
    }
}

impl Leg {
    fn reach(&self) -> Aabb {
        let own = self.limits.cut(&self.origin.reach());
        match &self.mirror {
            None => own,
            // What has no end has none on the other side.
            Some(_) if !(own.min.is_finite() && own.max.is_finite()) => Aabb {
                min: DVec3::NEG_INFINITY,
                max: DVec3::INFINITY,
            },
            Some(mirror) => own.transformed(mirror),
        }
    }

    /// A place before or after the move; the very same where nothing moved.
    fn moved(&self, p: DVec3, way: impl Fn(&Origin, DVec3) -> DVec3) -> DVec3 {
        let mirrored = |p: DVec3| self.mirror.map_or(p, |mirror| mirror.transform_point3(p));
        let here = mirrored(p);
        if !self.limits.is_free(&Aabb { min: here, max: here }) {
            return p;
        }
        match way(&self.origin, here) {
            there if there == here => p,
            there => mirrored(there),
        }
    }
}
