//! Stages of a stroke: what acts, when it has arrived, and how the tool goes on from there.

use std::collections::BTreeSet;

use bspline::{Aabb, Real};
use glam::DVec3;

use super::ground::ROOM;
use super::hand::Hand;
use super::row::Functions;
use super::stroke::{Acting, ForceStroke, STAGE};
use super::target::Target;
use super::{Extent, ForceError, Solid};

/// Radii about the paths of a stage in which those of earlier ones go on acting.
const TRAIL: f64 = 5.0;
/// Radii from the rim of a region within which a path of before is let go all the same.
const HELD: f64 = 1.0;
/// Share of its length that a path that has arrived may be off; after some steps with goals that stand still more is
/// allowed, `Extent::arrived_late`, between neighbours it may not become less.
const ARRIVED: f64 = 0.002;
const LATE: usize = 8;
/// Share that an elastic path at rest moves in a step.
const AT_REST: f64 = 1e-5;
/// Steps with goals that stand still after which the next stage begins in any case.
const PATIENCE: usize = 60;

impl<T: Real> ForceStroke<T> {
    /// Share of the work that is done, about.
    pub fn progress(&self) -> f64 {
        let stage = (self.settled as f64 / LATE as f64).min(0.9);
        (self.begun as f64 - (1.0 - stage) * self.acting.len() as f64).max(0.0) / self.targets.len() as f64
    }

    /// Whether all paths have arrived, or have had their time. A tool in a hand has to be let go before.
    pub fn is_over(&self) -> bool {
        let is_led = self.hand.as_ref().is_some_and(Hand::leads);
        !is_led && self.begun == self.targets.len() && self.is_stage_over()
    }

    /// A path that begins to act.
    fn acting(&self, index: usize, age: usize) -> Acting {
        let target = &self.targets[index];
        let (place, start) = (target.path.at(0.0), self.start(target));
        // Nearer to what may not change a stage leaves paths short, and the next ones would push them on and on.
        let beside = match self.extent {
            Extent::Whole => {
                let level = self.region.cells().level;
                self.field.lattice().spacing(level).max_element()
            }
            _ => 0.0,
        };
        let about = Aabb::new(place - beside, place + beside);
        Acting {
            index,
            age,
            force: 0.0,
            start,
            crossing: None,
            before: None,
            stiffness: 0.0,
            worth: 1.0,
            is_free: self.holding.limits.is_free(&about) && !self.is_at_face(target, start),
        }
    }

    fn is_stage_over(&self) -> bool {
        if self.settled == 0 {
            return self.acting.is_empty() && self.report.steps > 0;
        }
        let is_late = self.settled >= LATE && self.acting.len() > 1;
        let off = if is_late {
            self.extent.arrived_late()
        } else {
            ARRIVED
        };
        let is_there = |a: &Acting| {
            let Some(crossing) = a.crossing else { return true };
            let target = &self.targets[a.index];
            let length = target.path.length();
            let ahead = self.ahead(target, crossing);
            if target.ends_early && ahead > 0.0 || !a.is_free || a.stiffness == 0.0 {
                return true;
            }
            match (self.how.solid(), a.before) {
                (Solid::Clay, _) => ahead.abs() <= off,
                (Solid::Elastic, Some(before)) => (crossing - before).abs() <= AT_REST * length,
                (Solid::Elastic, None) => false,
            }
        };
        self.settled >= PATIENCE || (self.settled > 1 && self.acting.iter().all(is_there))
    }

    /// Lets the tool go on along its track where it is done so far: its shape becomes the one at rest, the oldest paths end
    /// and the next begin.
    pub(super) fn advance(&mut self) -> Result<(), ForceError> {
        let next = self.targets.get(self.begun);
        let is_beyond = next.is_some_and(|t| !(t.begins <= self.gone && self.is_in_reach(t)));
        // A path that the stage at hand has room for joins it: each cut leaves what was not quite done.
        if self.report.steps > 0 && is_beyond && self.is_stage_over() {
            self.field = self.region.release_clay(&self.field)?;
            let from = match self.hand {
                Some(_) => self.targets[self.begun].begins,
                None => self.gone,
            };
            self.gone = from + STAGE * self.radius;
            let targets = &self.targets;
            let next = targets[self.begun..].partition_point(|t| t.begins <= self.gone);
            let next = &targets[self.begun..][..next];
            let far = (TRAIL * self.radius).powi(2);
            let is_near = |t: &Target| {
                next.iter()
                    .any(|n| n.path.at(0.0).distance_squared(t.path.at(0.0)) <= far)
            };
            let kept = (0..self.begun).filter(|i| is_near(&targets[*i]));
            // What they had to hold is at rest now.
            self.acting = kept.map(|i| self.acting(i, usize::MAX / 2)).collect();
            let paths: Vec<&Target> = self
                .acting
                .iter()
                .map(|a| &targets[a.index])
                .chain(next)
                .collect();
            self.region = self.ground().cut(&paths)?;
            self.remember();
            self.hold()?;
            self.count_cut();
        }
        self.report.steps += 1;
        self.scales = std::mem::take(&mut self.is_repainted);
        while self
            .targets
            .get(self.begun)
            .is_some_and(|t| t.begins <= self.gone && self.is_in_reach(t))
        {
            let next = self.acting(self.begun, 0);
            self.acting.push(next);
            self.begun += 1;
            self.scales = true;
        }
        if self.scales && self.hand.is_some() {
            self.settled = 0;
            self.remember();
        }
        if self.scales {
            self.look_up();
        }
        Ok(())
    }

    /// Begins to count the steps of a region anew.
    pub(super) fn count_cut(&mut self) {
        self.settled = 0;
        self.report.cuts += 1;
        let samples = self.region.patch().lattice().sample_count();
        self.report.samples = self.report.samples.max(samples);
    }

    /// Whether the region at hand will do for a path.
    pub(super) fn is_in_reach(&self, target: &Target) -> bool {
        self.hand.is_none() || self.ground().has_room(&self.region, target, ROOM)
    }

    /// Lets earlier paths act that the region reaches, beside those near by. What is let go is lifted by what acts five radii
    /// away: by 2 % of the depth in a stage, and more where a hand dawdles.
    fn remember(&mut self) {
        let acting: BTreeSet<usize> = self.acting.iter().map(|a| a.index).collect();
        let (ground, region) = (self.ground(), &self.region);
        let is_held = |i: &usize| !acting.contains(i) && ground.has_room(region, &self.targets[*i], HELD);
        let back = (0..self.begun).filter(is_held);
        let back: Vec<Acting> = back.map(|i| self.acting(i, usize::MAX / 2)).collect();
        self.acting.extend(back);
    }

    /// Looks where the surface is now.
    pub(super) fn look_up(&mut self) {
        let functions = Functions::of(&self.field, &self.region);
        let p = &self.region.patch().state().p;
        let value = |at: DVec3| functions.value(p, at);
        let look = |a: &Acting| self.surface(&self.targets[a.index], a.start, &value);
        let now: Vec<Option<f64>> = self.acting.iter().map(look).collect();
        for (acting, now) in self.acting.iter_mut().zip(now) {
            acting.before = std::mem::replace(&mut acting.crossing, now);
        }
    }
}
