//! Strokes that a hand leads.

use bspline::{HierarchicalSpline, Real};
use glam::DVec3;

use super::extent::Extent;
use super::hand::{Hand, Make, Way, dragged};
use super::stroke::{ADVANCE, ForceStroke};
use super::target::Target;
use super::track::{self, CORNER, DENSITY, MOST, OPEN, Place};
use super::{ForceError, How, Solid};

/// Shares of the distance of paths: of the shortest leg of a way whose direction counts, and of the way from a path to one at
/// a corner.
const TREMBLE: f64 = 0.04;
const APART: f64 = 0.2;
/// Radii of the shortest path that a hand drags: it keeps its direction where it comes back to its start.
const LEAST: f64 = 1e-3;

impl<T: Real> ForceStroke<T> {
    /// In the hand of a tool that walks over the surface `iso` from a place; its paths, which `make` gives, end where the
    /// field is `goal`.
    pub(super) fn walking(
        field: &HierarchicalSpline<T>,
        [iso, goal]: [f64; 2],
        make: Make,
        at: DVec3,
        radius: f64,
        how: &How,
    ) -> Result<Self, ForceError> {
        if how.solid() == Solid::Elastic {
            return Err(ForceError::tool(
                "an elastic solid keeps no track; write how = { solid = \"clay\" }, or the whole track in a stroke that is not by hand",
            ));
        }
        let (start, normal) = track::grabbed(field, iso, at, radius)?;
        let first = make(&Place {
            at: start,
            normal,
            weight: 2.0 * OPEN * radius,
            along: 0.0,
        })?;
        let mut stroke = Self::new(field, goal, vec![first], Extent::Track, radius, how)?;
        stroke.hand = Some(Hand::new(Way::Walk {
            make,
            iso,
            at,
            since: 0.0,
            along: 0.0,
            heading: None,
            is_open: false,
        }));
        Ok(stroke)
    }

    /// In a hand that has taken hold at places and will drag them all alike.
    pub(super) fn dragging(
        field: &HierarchicalSpline<T>,
        iso: f64,
        from: Vec<Place>,
        extent: Extent,
        radius: f64,
        how: &How,
    ) -> Result<Self, ForceError> {
        let direction = from.first().map_or(DVec3::Z, |place| place.normal);
        let targets = dragged(&from, LEAST * radius * direction)?;
        let mut stroke = Self::new(field, iso, targets, extent, radius, how)?;
        stroke.hand = Some(Hand::new(Way::Drag {
            from,
            to: DVec3::ZERO,
            reached: DVec3::ZERO,
            direction,
        }));
        Ok(stroke)
    }

    /// Tells where the hand is: the place of a tool that walks, the way from where a tool took hold that drags. Nothing
    /// moves before the next [`step`](Self::step).
    ///
    /// Where there is no surface, and beyond the field, nothing is done ([`missed`](Self::missed)).
    ///
    /// # Errors
    /// [`ForceError::Tool`] for a pose that is not finite, or so far away that it would take too many paths; all is as before.
    pub fn pose(&mut self, pose: DVec3) -> Result<(), ForceError> {
        // Its square as well, or the hand is nowhere to be reached.
        if !pose.length_squared().is_finite() {
            return Err(ForceError::tool(format!(
                "the hand cannot be at {pose}; give coordinates that are finite, and within reason"
            )));
        }
        match self.hand.as_mut().map(|hand| &mut hand.way) {
            Some(Way::Drag { to, .. }) => *to = pose,
            Some(Way::Walk {
                at, since, heading, ..
            }) => {
                let (from, gap) = (*at, self.radius / DENSITY);
                let length = from.distance(pose);
                // A hand that rests trembles.
                let way = (length > TREMBLE * gap).then(|| (pose - from) / length);
                // Corners, and bends, get paths of their own.
                let turns = way
                    .zip(*heading)
                    .is_some_and(|(way, before)| way.dot(before) < CORNER);
                let gone = *since;
                let is_corner = turns && gone >= APART * gap;
                let left = if is_corner { 0.0 } else { gone };
                let first = gap - left;
                let count = ((length - first) / gap).floor() + 1.0;
                if count + self.targets.len() as f64 > MOST {
                    return Err(ForceError::tool(format!(
                        "the tool would have {count:.0} more paths on its way to {pose}; make its radius larger"
                    )));
                }
                (*at, *since) = (pose, left + length - count.max(0.0) * gap);
                if heading.is_none() || is_corner || count >= 1.0 {
                    *heading = way;
                }
                if is_corner {
                    self.begin_path(from, gone);
                }
                for n in 0..count.max(0.0) as usize {
                    let s = first + n as f64 * gap;
                    self.begin_path(from + s / length * (pose - from), gap);
                }
            }
            None => {}
        }
        Ok(())
    }

    /// Refuses a way of a hand that drags, on which paths would end beside the field.
    ///
    /// # Errors
    /// [`ForceError::Outside`].
    pub(crate) fn check_way(&self, to: DVec3) -> Result<(), ForceError> {
        match self.hand.as_ref().map(|hand| &hand.way) {
            Some(Way::Drag { from, .. }) => from
                .iter()
                .try_for_each(|place| track::within(&self.origin, place.at + to)),
            _ => Ok(()),
        }
    }

    /// Lets the tool go: what it has still to do is done in the steps to come.
    pub fn let_go(&mut self) {
        if let Some(hand) = &self.hand
            && let Way::Walk { at, since, .. } = hand.way
            && since > 0.1 * self.radius / DENSITY
        {
            self.begin_path(at, since);
        }
        if let Some(hand) = &mut self.hand {
            hand.is_let_go = true;
        }
    }

    /// Places of the way on which there was nothing to work on, and why at the first of them.
    pub fn missed(&self) -> Option<&(usize, ForceError)> {
        self.hand.as_ref()?.missed.as_ref()
    }

    /// What the tool does to the solid: the sum of its forces, each along its path.
    pub fn force(&self) -> DVec3 {
        let each = self.acting.iter().map(|acting| {
            let target = &self.targets[acting.index];
            let push = if target.grows { acting.force } else { -acting.force };
            push * target.path.direction(acting.crossing.unwrap_or(0.0))
        });
        each.sum()
    }

    /// Corners of the box of cells that move now, number `4x + 2y + z`, in the world.
    pub fn moving(&self) -> [DVec3; 8] {
        let cells = self.region.cells();
        let scale = (-(cells.level as f64)).exp2();
        std::array::from_fn(|n| {
            let at = DVec3::from_array(std::array::from_fn(|a| {
                let corner = (n >> (2 - a) & 1) as u32;
                f64::from(cells.first[a] + corner * cells.count[a])
            }));
            self.field
                .lattice()
                .world_from_lattice
                .transform_point3(scale * at)
        })
    }

    /// How much more force all paths together ask for when their ends go on by one world length, to first order, and how much they would in
    /// unpainted matter; 0 before the first step.
    ///
    /// A path whose end goes on by `δ` is short of `½|∇f|δ` more in the mean; forces in proportion to what the paths stand for bring it
    /// so far (`Acting::stiffness`) by each unit.
    pub fn rigidity(&self) -> [f64; 2] {
        let acting = self.acting.iter().filter(|a| a.is_free && a.stiffness > 0.0);
        acting.fold([0.0; 2], |[own, plain], acting| {
            let each = 0.5 * self.field.slope() / acting.stiffness;
            let weight = self.targets[acting.index].weight;
            [own + each * acting.worth, plain + each * weight]
        })
    }

    /// The field as it is now.
    ///
    /// # Errors
    /// [`ForceError::Region`].
    pub fn field(&self) -> Result<HierarchicalSpline<T>, ForceError> {
        self.baked()
    }

    /// Begins a path at a place of the way, `gap` behind the last.
    fn begin_path(&mut self, p: DVec3, gap: f64) {
        let Some(Hand {
            way:
                Way::Walk {
                    make,
                    iso,
                    along,
                    is_open,
                    ..
                },
            missed,
            ..
        }) = &mut self.hand
        else {
            return;
        };
        *along += gap;
        let open = OPEN * self.radius;
        let weight = if *is_open { 2.0 * open } else { 0.5 * gap + open };
        let target = track::grabbed(&self.origin, *iso, p, self.radius).and_then(|(at, normal)| {
            let target = make(&Place {
                at,
                normal,
                weight,
                along: *along,
            })?;
            track::within(&self.origin, target.path.at(target.path.length()))?;
            Ok(target)
        });
        match target {
            Ok(target) => {
                if let Some(last) = self.targets.last_mut().filter(|_| !*is_open) {
                    last.weight += 0.5 * gap - open;
                }
                *is_open = false;
                self.targets.push(target);
                self.report.paths += 1;
            }
            Err(why) => {
                *is_open = true;
                count_missed(missed, why);
            }
        }
    }

    /// Lets the paths of a hand that drags grow towards it, and the region follow them.
    pub(super) fn chase(&mut self) -> Result<(), ForceError> {
        let Some(Hand {
            way:
                Way::Drag {
                    from,
                    to,
                    reached,
                    direction,
                },
            missed,
            ..
        }) = &mut self.hand
        else {
            return Ok(());
        };
        if to == reached {
            return Ok(());
        }
        let (left, advance) = (*to - *reached, ADVANCE * self.radius);
        let next = match left.length() <= advance {
            true => *to,
            false => *reached + advance * left.normalize(),
        };
        let way = match next.length() > LEAST * self.radius {
            true => next,
            false => LEAST * self.radius * *direction,
        };
        let targets = dragged(from, way)?;
        let outside = targets
            .iter()
            .find_map(|t| track::within(&self.origin, t.path.at(t.path.length())).err());
        if let Some(why) = outside {
            count_missed(missed, why);
            *to = *reached;
            return Ok(());
        }
        (*reached, *direction) = (next, way.normalize());
        self.targets = targets;
        self.settled = 0;
        if !self.targets.iter().all(|target| self.is_in_reach(target)) {
            let targets: Vec<&Target> = self.targets.iter().collect();
            (self.field, self.region) = self.ground().follow(&self.region, &targets)?;
            self.hold()?;
            self.count_cut();
        }
        Ok(())
    }
}

fn count_missed(missed: &mut Option<(usize, ForceError)>, why: ForceError) {
    match missed {
        Some((count, _)) => *count += 1,
        None => *missed = Some((1, why)),
    }
}
