//! The way of the proxy to the hand in a tick.

use glam::{DMat3, DVec3};

use super::super::{Obstacle, Pose};
use super::MultiPoint;
use super::friction::Meeting;
use super::places::{Place, arm, ask};
use super::projection::{Twist, dot};
use super::turn::{exponential, logarithm};

/// Looks of a step at most: each adds what the one before found violated.
pub(super) const CUTS: usize = 8;
/// Way that is none, mm.
const STILL: f64 = 1e-7;
/// Longest step once there are no looks left for finer points, mm.
const UNSURE: f64 = 0.03;
/// Depth at which a place between the points counts as found late, mm.
const LATE: f64 = 0.01;
/// Depth up to which a place between the points may have been in the solid unseen, mm: it slides to where it is deepest.
const GUESSED: f64 = 0.1;
/// Shortest step, mm.
const SHORTEST: f64 = 1e-4;

/// What became of a pose that was tried.
enum Tried {
    Clear,
    /// Points are in the solid; their planes have joined the rows.
    Violated,
    /// A plane says that the proxy itself is in the solid: the step was too long for it.
    TooFar,
}

impl MultiPoint {
    /// Moves the proxy as near to the hand as it gets.
    pub(super) fn march(&mut self, obstacle: &dyn Obstacle, hand: &Pose, dt: f64) {
        self.look_again(obstacle, hand, dt);
        self.pressings.begin();
        let depth = -self.places.deepest_own().0;
        if self.is_buried {
            self.pressings.clear();
            self.surface(obstacle, depth);
            return;
        }
        let most = self.options.step.min(0.5 * obstacle.finest().max(2.0 * SHORTEST));
        // What one tick could not do is no reason for the next to crawl.
        self.reach = most.max(SHORTEST);
        for _ in 0..self.options.iterations {
            let wish = self.wish(hand);
            if dot(&wish, &wish).sqrt() < STILL {
                self.pressings.clear();
                break;
            }
            if !self.step(obstacle, &wish) {
                break;
            }
            self.reach = (2.0 * self.reach).min(most);
        }
        // Only in growing and closing solids.
        if depth > 10.0 * self.options.tolerance {
            self.extract(obstacle, depth);
        }
    }

    /// All points where the proxy is, in what the solid is now.
    fn look_again(&mut self, obstacle: &dyn Obstacle, hand: &Pose, dt: f64) {
        if self.options.turn_every > 0 {
            self.hold_turn(hand);
        } else {
            self.places.turn = DMat3::from_quat(self.pose.turn);
        }
        let mut grown = 0.0f64;
        for i in 0..self.places.len() {
            if !self.places.counts[i] {
                continue;
            }
            let before = self.places.here[i];
            let now = ask(&self.tool, obstacle, &self.pose, &self.places.turn, before.on);
            let change = before.clearance - now.clearance;
            grown = grown.max(if before.is_exact { change.abs() } else { change });
            self.places.here[i] = now;
            // Out of the solid at the speed that is allowed, and never deeper in.
            self.places.level[i] = (now.clearance + self.options.push_out * dt).min(0.0);
        }
        self.features.changed(grown, 0.0);
        self.push_left = self.options.push_out * dt;
        self.settle_guests(obstacle, dt);
        if let Some(count) = self.options.deepest {
            self.choose_deepest(count);
        }
    }

    /// Way and turn from the proxy to the hand.
    fn wish(&self, hand: &Pose) -> Twist {
        let v = hand.at - self.pose.at;
        let w = self.lever * logarithm(hand.turn * self.pose.turn.inverse());
        [v.x, v.y, v.z, w.x, w.y, w.z]
    }

    /// One step towards a wish. Whether the proxy moved.
    fn step(&mut self, obstacle: &dyn Obstacle, wish: &Twist) -> bool {
        self.gather(obstacle, wish);
        for _ in 0..CUTS {
            let Some((mut whole, mut push)) = self.goal(obstacle, wish) else {
                return false;
            };
            if let Some(air) = self.in_the_air(wish) {
                (whole, push) = (air, 0.0);
            }
            let size = dot(&whole, &whole).sqrt();
            if size < STILL {
                return false;
            }
            let mut share = self.allowed(&whole);
            if self.features.is_unsure {
                share = share.min(UNSURE / size);
            }
            let twist = whole.map(|u| share * u);
            self.share = share;
            match self.try_out(obstacle, &twist) {
                Tried::Clear => {
                    self.pressings.moved(&twist);
                    self.accept(&twist);
                    self.push_left -= share * push;
                    return true;
                }
                Tried::Violated => {}
                Tried::TooFar if self.reach <= SHORTEST => return false,
                Tried::TooFar => self.reach = (0.5 * self.reach).max(SHORTEST),
            }
        }
        self.reach = (0.5 * self.reach).max(SHORTEST);
        false
    }

    /// The twist that leads nearest to a wish by the rows, and how much of it pushes the tool out of the solid: no more than is left
    /// for this tick.
    fn goal(&mut self, obstacle: &dyn Obstacle, wish: &Twist) -> Option<(Twist, f64)> {
        let whole = self.nearest(obstacle, wish);
        if whole.is_some() && !self.rows.lacks(self.options.tolerance) {
            return whole.map(|whole| (whole, 0.0));
        }
        // As far as the tool would go if it only had to get no deeper.
        self.rows.relax();
        let free = self.nearest(obstacle, wish)?;
        let out: Twist = whole.map_or([0.0; 6], |whole| std::array::from_fn(|k| whole[k] - free[k]));
        let push = dot(&out, &out).sqrt();
        let share = if whole.is_none() {
            0.0
        } else {
            (self.push_left / push.max(STILL)).clamp(0.0, 1.0)
        };
        for (level, here) in self.places.level.iter_mut().zip(&self.places.here) {
            // What that share of the push lifts a point to.
            *level -= (1.0 - share) * (*level - here.clearance).max(0.0);
        }
        Some((std::array::from_fn(|k| free[k] + share * out[k]), share * push))
    }

    /// Rows of the points that can meet the solid on the way to a wish.
    fn gather(&mut self, obstacle: &dyn Obstacle, wish: &Twist) {
        let way = dot(wish, wish).sqrt();
        self.rows.clear();
        self.meetings.clear();
        for i in 0..self.places.len() {
            if !self.places.counts[i] {
                continue;
            }
            let arm = arm(&self.tool, &self.places.turn, self.places.here[i].on);
            // No twist of that size moves the point further.
            let most = way * (1.0 + arm.length_squared() / (self.lever * self.lever)).sqrt();
            if self.places.here[i].clearance > most {
                continue;
            }
            if !self.places.here[i].is_exact {
                self.places.here[i] = ask(
                    &self.tool,
                    obstacle,
                    &self.pose,
                    &self.places.turn,
                    self.places.here[i].on,
                );
            }
            let place = self.places.here[i];
            if place.clearance <= most {
                let a = self.row_of(place.gradient, arm);
                let meeting = self.meeting(i, &place, self.pose.at, arm);
                self.meet(a, self.places.level[i] - place.clearance, meeting);
            }
        }
        self.expect_the_same();
    }

    /// Where a point's row comes from.
    fn meeting(&self, point: usize, place: &Place, handle: DVec3, arm: DVec3) -> Meeting {
        let down = (place.clearance + self.tool.nose) * place.gradient;
        Meeting {
            point,
            at: handle + arm - down,
            arm: arm - self.tool.nose * place.gradient,
            gradient: place.gradient,
        }
    }

    /// Share of a twist that no point misses solid on: what a point is clear by it may go, and near the surface a step.
    fn allowed(&self, twist: &Twist) -> f64 {
        let (v, w) = halves(twist, self.lever);
        let mut share = 1.0f64;
        for i in 0..self.places.len() {
            if !self.places.counts[i] {
                continue;
            }
            let way = self.way(v, w, self.places.here[i].on);
            let cover = self.tool.cover.get(i).copied().unwrap_or(0.0);
            let most = self.reach.max(self.places.here[i].clearance - cover);
            if way * share > most {
                share = most / way;
            }
        }
        share
    }

    /// Way of a point, mm, at most.
    fn way(&self, v: DVec3, w: DVec3, on: DVec3) -> f64 {
        let turned = if self.options.turn_every > 0 {
            DVec3::ZERO
        } else {
            w
        };
        v.length() + turned.cross(arm(&self.tool, &self.places.turn, on)).length()
    }

    /// Looks at the pose after a twist.
    fn try_out(&mut self, obstacle: &dyn Obstacle, twist: &Twist) -> Tried {
        let (v, w) = halves(twist, self.lever);
        let pose = self.after(v, w);
        let turn = if self.options.turn_every > 0 {
            self.places.turn
        } else {
            DMat3::from_quat(pose.turn)
        };
        let (mut is_violated, mut is_too_far) = (false, false);
        for i in 0..self.places.len() {
            if !self.places.counts[i] {
                continue;
            }
            let here = self.places.here[i];
            let bound = here.clearance - self.way(v, w, here.on);
            if bound > 0.0 || self.features.is_ignored(i) {
                self.places.there[i] = Place {
                    clearance: bound,
                    is_exact: false,
                    ..here
                };
                continue;
            }
            let there = ask(&self.tool, obstacle, &pose, &turn, here.on);
            self.places.there[i] = there;
            if i >= self.places.own {
                self.slide(obstacle, &pose, &turn, i);
            }
            self.judge(i, twist, &turn, &mut is_violated, &mut is_too_far);
        }
        if !is_violated && !is_too_far {
            self.find_features(obstacle, twist, &pose, &turn, &mut is_violated, &mut is_too_far);
        }
        match (is_violated, is_too_far) {
            (_, true) => Tried::TooFar,
            (true, _) => Tried::Violated,
            _ => Tried::Clear,
        }
    }

    /// Takes the plane of a point that is in the solid after a twist.
    pub(super) fn judge(
        &mut self,
        i: usize,
        twist: &Twist,
        turn: &DMat3,
        is_violated: &mut bool,
        is_too_far: &mut bool,
    ) {
        let (there, level) = (self.places.there[i], self.places.level[i]);
        // A part of a push lifts by that part.
        let here = self.places.here[i].clearance;
        let lack = (level - here).max(0.0);
        if there.clearance >= level - (1.0 - self.share) * lack - self.options.tolerance {
            return;
        }
        // In the solid the nearest surface is soon another one: what was found there late is pushed out by the rows, and holds nothing.
        let was_late = i >= self.places.own && here < -LATE;
        if was_late && there.clearance > here - LATE {
            return;
        }
        let arm = arm(&self.tool, turn, there.on);
        let a = self.row_of(there.gradient, arm);
        let b = level - there.clearance + dot(&a, twist);
        // Where the proxy is now must not be in the solid by it, but for what it already is.
        let slack = if i < self.places.own { LATE } else { GUESSED };
        let meeting = self.meeting(i, &there, self.pose.at + halves(twist, self.lever).0, arm);
        if b > lack + slack || !self.meet(a, b, meeting) {
            *is_too_far |= !was_late;
        } else {
            *is_violated = true;
        }
    }

    /// The proxy's pose after a twist.
    fn after(&self, v: DVec3, w: DVec3) -> Pose {
        Pose {
            at: self.pose.at + v,
            turn: (exponential(w) * self.pose.turn).normalize(),
        }
    }

    /// The pose that was tried becomes the proxy's.
    pub(super) fn accept(&mut self, twist: &Twist) {
        let (v, w) = halves(twist, self.lever);
        self.pose = self.after(v, w);
        if self.options.turn_every == 0 {
            self.places.turn = DMat3::from_quat(self.pose.turn);
        }
        std::mem::swap(&mut self.places.here, &mut self.places.there);
        self.features.changed(0.0, w.length());
    }

    /// Keeps the points turned as they are for some ticks.
    fn hold_turn(&mut self, hand: &Pose) {
        self.pose.turn = hand.turn;
        self.held_for += 1;
        if self.held_for >= self.options.turn_every {
            self.held_for = 0;
            self.places.turn = DMat3::from_quat(hand.turn);
        }
    }
}

/// Way, mm, and turn, rad.
pub(super) fn halves(twist: &Twist, lever: f64) -> (DVec3, DVec3) {
    let v = DVec3::new(twist[0], twist[1], twist[2]);
    (v, DVec3::new(twist[3], twist[4], twist[5]) / lever)
}
