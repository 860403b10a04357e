use std::collections::BTreeMap;

use bspline::Aabb;
use glam::{DAffine3, DVec3};
use tools::geometric::{Origin, reflection};
use tools::limits::Limits;
use tools::others::Others;
use tools::session::Stroke;
use tools::tool::Tool;

use crate::Command;

/// Where what is now at a place came from, through all moves of an object.
#[derive(Default)]
pub struct Journey {
    legs: Vec<Leg>,
    mixes: Vec<Mix>,
    /// Whether forces have acted: they reach anywhere.
    is_forced: bool,
}

/// A brush that carries densities along or mixes them.
#[derive(Clone, Copy)]
pub(super) struct Mix {
    /// It changes nothing outside, and takes nothing from there.
    pub reach: Aabb,
    /// Where what it brings comes from, if it does not lie there already.
    pub brought: Option<Brought>,
}

/// Where a brush brings matter from.
#[derive(Clone, Copy)]
pub(super) enum Brought {
    /// From a box of the object itself.
    Here(Aabb),
    /// From another object, with the densities that it has there.
    Elsewhere,
}

impl Mix {
    /// Whether it may have changed a place.
    pub(super) fn holds(&self, place: DVec3) -> bool {
        place.cmpge(self.reach.min).all() && place.cmple(self.reach.max).all()
    }
}

/// One move.
#[derive(Clone)]
struct Leg {
    way: Way,
    limits: Limits,
    /// Whether there are any: at their border what came mixes with what was there.
    is_limited: bool,
    /// A reflection in which all of it lies: the other side of a symmetric stroke.
    mirror: Option<DAffine3>,
}

/// How matter came to a place.
#[derive(Clone)]
enum Way {
    Moved(Origin),
    /// From a box, by a map, as it was after the first `since` legs. What was there is gone.
    Pasted {
        from: Aabb,
        map: DAffine3,
        since: usize,
    },
}

impl Journey {
    /// The moves among commands in their order, of the object `name`, which lies in a box. `others` tells the objects that there
    /// were when a command was done, of its place among them; only masks by objects ask for them.
    pub fn new(
        commands: &[Command],
        name: &str,
        within: &Aabb,
        mut others: impl FnMut(usize) -> Option<Others>,
    ) -> Self {
        let mut journey = Self::default();
        // Copies of the object that are as they were made, and after how many legs.
        let mut twins: BTreeMap<&str, usize> = BTreeMap::new();
        for (n, (command, name)) in commands.iter().zip(names(commands, name)).enumerate() {
            twins.remove(command.object());
            if command.object() != name {
                continue;
            }
            let Command::Stroke { object, stroke } = command else {
                journey.is_forced |= matches!(command, Command::Scene { .. });
                continue;
            };
            let tool = stroke.tool();
            journey.is_forced |= matches!(tool, Ok(Tool::Force(_) | Tool::Extrude(_) | Tool::Bend(_)));
            let done = journey.legs.len();
            let cut = stroke.cut.as_ref().and_then(|cut| cut.to.as_deref());
            let copy = stroke.copy.as_ref().map(|copy| copy.to.as_str()).or(cut);
            twins.extend(copy.map(|to| (to, done)));
            let plane = stroke.symmetry.as_ref();
            let mirror = plane.and_then(|plane| reflection(plane.at.0, plane.normal.0).ok());
            let twins = &twins;
            for mix in mixes(stroke, |from| from == object || twins.contains_key(from)) {
                journey.mixes.push(mix);
                journey.mixes.extend(mirror.map(|mirror| Mix {
                    reach: mix.reach.transformed(&mirror),
                    ..mix
                }));
            }
            let pasted = stroke.paste.as_ref().and_then(|paste| {
                let since = match paste.from == *object {
                    true => done,
                    false => *twins.get(paste.from.as_str())?,
                };
                let (from, map) = paste.carried().ok()?;
                Some(Way::Pasted { from, map, since })
            });
            let moved = (stroke.motion.as_ref()).and_then(|m| m.motion.origin(within).ok());
            // What moves below a wall takes nothing of the scan's surface along, and the wall is known no more.
            let way = moved.map(Way::Moved).or(pasted);
            let Some(way) = way.filter(|_| stroke.wall.is_none()) else {
                continue;
            };
            let mask = stroke.mask.as_ref();
            let beside = mask.filter(|mask| mask.object.is_some()).and_then(|_| others(n));
            let limits = Limits::new(stroke.within.as_ref(), mask, &beside.unwrap_or_default(), within);
            let leg = Leg {
                way,
                limits: limits.unwrap_or_default(),
                is_limited: stroke.within.is_some() || mask.is_some(),
                mirror: None,
            };
            let other = mirror.map(|_| Leg {
                mirror,
                ..leg.clone()
            });
            journey.legs.push(leg);
            journey.legs.extend(other);
        }
        journey
    }

    /// Whether a tool may have passed a place that pushes the surface along, instead of putting another one in its place.
    pub(super) fn pushes(&self, place: DVec3) -> bool {
        let mut brushes = self.mixes.iter().filter(|mix| mix.brought.is_none());
        self.is_forced || brushes.any(|mix| mix.holds(place))
    }

    pub(super) fn mixes(&self) -> &[Mix] {
        &self.mixes
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
        self.legs.iter().map(cut).filter(|b| b.min.cmple(b.max).all())
    }

    /// Where what is at a place was at first, and whether it may have come only in part.
    pub(super) fn back(&self, place: DVec3) -> (DVec3, bool) {
        let (mut place, mut left, mut in_part) = (place, self.legs.len(), false);
        while let Some(n) = left.checked_sub(1) {
            let leg = &self.legs[n];
            let there = leg.moved(place, Way::back);
            in_part |= leg.is_limited && there != place;
            left = match leg.way {
                Way::Pasted { since, .. } if there != place => since.min(n),
                _ => n,
            };
            place = there;
        }
        (place, in_part)
    }

    /// Where what was at a place is now.
    pub(super) fn forth(&self, place: DVec3) -> DVec3 {
        let legs = self.legs.iter();
        legs.fold(place, |p, leg| leg.moved(p, Way::forth))
    }
}

/// The name of an object when each of the commands was done that led to `name`.
pub(super) fn names<'a>(commands: &'a [Command], name: &'a str) -> Vec<&'a str> {
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
    names.reverse();
    names
}

impl Way {
    fn reach(&self) -> Aabb {
        match self {
            Self::Moved(origin) => origin.reach(),
            Self::Pasted { from, map, .. } => from.transformed(map),
        }
    }

    fn back(&self, p: DVec3) -> DVec3 {
        match self {
            Self::Moved(origin) => origin.back(p),
            Self::Pasted { from, map, .. } => {
                let there = map.inverse().transform_point3(p);
                let is_pasted = there.cmpge(from.min).all() && there.cmple(from.max).all();
                if is_pasted { there } else { p }
            }
        }
    }

    /// What was pasted is where it was, too.
    fn forth(&self, p: DVec3) -> DVec3 {
        match self {
            Self::Moved(origin) => origin.forth(p),
            Self::Pasted { .. } => p,
        }
    }
}

/// The brushes of a stroke that carry densities along or mix them; `is_own` tells objects that hold what this one held.
fn mixes(stroke: &Stroke, is_own: impl Fn(&str) -> bool) -> impl Iterator<Item = Mix> {
    let smooth = stroke.smooth.as_ref().map(|tool| (&tool.along, tool.radius.0));
    let inflate = stroke.inflate.as_ref().map(|tool| (&tool.along, tool.radius.0));
    // Along its axis it reaches two radii far.
    let push = stroke
        .push
        .as_ref()
        .map(|tool| (&tool.along, 2.0 * tool.radius.0));
    let brushes = [smooth, inflate, push].into_iter().flatten();
    let passed = brushes.filter_map(|(along, radius)| {
        Some(Mix {
            reach: Aabb::about(along.iter().map(|p| p.0))?.widened(radius),
            brought: None,
        })
    });
    let pasted = stroke.paste.as_ref().and_then(|paste| {
        let (from, map) = paste.carried().ok()?;
        Some(Mix {
            reach: from.transformed(&map),
            brought: Some(match is_own(&paste.from) {
                true => Brought::Here(from),
                false => Brought::Elsewhere,
            }),
        })
    });
    passed.chain(pasted)
}

impl Leg {
    fn reach(&self) -> Aabb {
        let own = self.limits.cut(&self.way.reach());
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
    fn moved(&self, p: DVec3, way: impl Fn(&Way, DVec3) -> DVec3) -> DVec3 {
        let mirrored = |p: DVec3| self.mirror.map_or(p, |mirror| mirror.transform_point3(p));
        let here = mirrored(p);
        if !self.limits.is_free(&Aabb { min: here, max: here }) {
            return p;
        }
        match way(&self.way, here) {
            there if there == here => p,
            there => mirrored(there),
        }
    }
}
