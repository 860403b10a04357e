//! Features of the solid between the tool's points, and which points are looked at.
//!
//! The source notes that a feature can enter the tool between two points, and mends flat contact of spheres alone \[Sensable99 figs. 20–22\].
//! Here every place of the tool's surface belongs to a point and is at most its `cover` away, so only points that are less clear
//! than that can hide a feature: finer points about these are looked at, as many in a tick as are allowed. One in the solid
//! becomes a guest: it joins the tool's points and slides over the tool's surface to where it is deepest, in every tick that
//! it touches. At rest a guest's gradient is across the tool's surface, so a sharp edge of the solid under a face of
//! the tool presses along the face's normal.

use glam::{DMat3, DVec3};

use super::super::{Obstacle, Pose};
use super::MultiPoint;
use super::places::{Place, arm, ask};
use super::projection::Twist;
use super::tool::PointTool;

/// Looks of a guest on its way over the tool, in a look of the tool.
const SLIDES: usize = 6;
/// Way from a place of the surface to the nearest fine point, over the spacing of these, at most.
const HIDES: f64 = 0.75;
/// Tangential part of a gradient that is none.
const LEVEL: f64 = 1e-4;

/// Which points between the tool's own were looked at when, and what follows from it.
#[derive(Clone, Debug)]
pub(super) struct Features {
    /// Clearance of each fine point when it was last asked for; −∞ if never.
    clearance: Vec<f64>,
    /// Where it was then, and growth and turn until then.
    when: Vec<(DVec3, f64, f64)>,
    /// Growth of the solid, mm, and turn of the tool, rad, since it was made.
    grown: f64,
    turned: f64,
    /// Point whose fine points have their turn next.
    next: usize,
    /// Fine points that may still be asked for in this tick.
    left: usize,
    /// Whether they did not suffice.
    pub(super) is_unsure: bool,
    /// Step of each guest over the tool, mm.
    stride: Vec<f64>,
    /// Points that are not looked at in this tick, with `deepest`.
    ignored: Vec<bool>,
    order: Vec<usize>,
}

impl Features {
    pub fn new(tool: &PointTool) -> Self {
        let guests = super::places::GUESTS;
        Self {
            clearance: vec![f64::NEG_INFINITY; tool.fine.len()],
            when: vec![(DVec3::ZERO, 0.0, 0.0); tool.fine.len()],
            grown: 0.0,
            turned: 0.0,
            next: 0,
            left: 0,
            is_unsure: false,
            stride: vec![tool.spacing; guests],
            ignored: vec![false; tool.points.len() + guests],
            order: Vec::with_capacity(tool.points.len()),
        }
    }

    pub fn forget(&mut self) {
        self.clearance.fill(f64::NEG_INFINITY);
        self.next = 0;
    }

    /// The solid grew, mm, or the tool turned, rad.
    pub fn changed(&mut self, grown: f64, turned: f64) {
        self.grown += grown;
        self.turned += turned;
    }

    pub fn is_ignored(&self, point: usize) -> bool {
        self.ignored[point]
    }
}

impl MultiPoint {
    /// Guests at the pose of the proxy: those that no longer touch go, the others slide to where they are deepest.
    pub(super) fn settle_guests(&mut self, obstacle: &dyn Obstacle, dt: f64) {
        self.features.left = self.options.fine_checks;
        self.features.is_unsure = false;
        for i in self.places.own..self.places.len() {
            if !self.places.counts[i] {
                continue;
            }
            self.places.there[i] = self.places.here[i];
            let (pose, turn) = (self.pose, self.places.turn);
            self.slide(obstacle, &pose, &turn, i);
            self.places.here[i] = self.places.there[i];
            let here = self.places.here[i];
            // A point of the tool, or a guest before it, says the same.
            let is_double = (0..i).any(|k| {
                let other = self.places.here[k];
                self.places.counts[k]
                    && other.on.distance(here.on) < 0.1 * self.tool.spacing
                    && other.clearance <= here.clearance
            });
            self.places.counts[i] = here.clearance < self.tool.spacing && !is_double;
            self.places.level[i] = (here.clearance + self.options.push_out * dt).min(0.0);
        }
    }

    /// Moves a guest over the tool's surface to where it is deepest, at the pose that is tried.
    pub(super) fn slide(&mut self, obstacle: &dyn Obstacle, pose: &Pose, turn: &DMat3, i: usize) {
        let stride = self.features.stride[i - self.places.own];
        let (place, stride) = self.slid(obstacle, pose, turn, self.places.there[i], stride);
        self.places.there[i] = place;
        self.features.stride[i - self.places.own] = stride;
    }

    /// Part of a gradient along the tool's surface, in its axes.
    fn slope(&self, turn: &DMat3, place: &Place) -> DVec3 {
        let Some(shape) = &self.tool.shape else {
            return DVec3::ZERO;
        };
        let (g, n) = (turn.transpose() * place.gradient, shape.distance(place.on).1);
        g - g.dot(n) * n
    }

    /// Where a place of the tool's surface gets by steepest descent of the distance, and the next stride, mm.
    fn slid(
        &self,
        obstacle: &dyn Obstacle,
        pose: &Pose,
        turn: &DMat3,
        from: Place,
        stride: f64,
    ) -> (Place, f64) {
        let Some(shape) = &self.tool.shape else {
            return (from, stride);
        };
        let (least, most) = (1e-3 * self.tool.spacing, 1e3 * self.tool.spacing);
        let (mut place, mut stride) = (from, stride);
        let mut slope = self.slope(turn, &place);
        for _ in 0..SLIDES {
            if slope.length() < LEVEL {
                break;
            }
            let Some(on) = shape.project(place.on - stride * slope) else {
                // There the tool ends.
                stride = (0.5 * stride).max(least);
                continue;
            };
            let next = ask(&self.tool, obstacle, pose, turn, on);
            let (way, change) = (on - place.on, self.slope(turn, &next) - slope);
            // Step of Barzilai and Borwein: the way to where the slope is none if it changes on as it did.
            let curved = way.dot(change);
            let straight = if curved > 1e-12 {
                way.length_squared() / curved
            } else {
                2.0 * stride
            };
            if next.clearance < place.clearance {
                (place, slope) = (next, slope + change);
                stride = straight;
            } else {
                stride = straight.min(0.5 * stride);
            }
            stride = stride.clamp(least, most);
        }
        (place, stride)
    }

    /// Whether no place between the points is in the solid where the proxy is: all finer points near it are asked for.
    pub(super) fn is_clear_between(&self, obstacle: &dyn Obstacle) -> bool {
        (0..self.places.own).all(|i| {
            let fine = &self.tool.fine[self.tool.first[i]..self.tool.first[i + 1]];
            self.places.here[i].clearance > self.tool.cover[i]
                || fine.iter().all(|on| {
                    ask(&self.tool, obstacle, &self.pose, &self.places.turn, *on).clearance
                        >= -self.options.tolerance
                })
        })
    }

    /// Looks for the solid between the points at the pose that is tried; what is found becomes a guest.
    pub(super) fn find_features(
        &mut self,
        obstacle: &dyn Obstacle,
        twist: &Twist,
        pose: &Pose,
        turn: &DMat3,
        is_violated: &mut bool,
        is_too_far: &mut bool,
    ) {
        let own = self.places.own;
        if self.tool.fine.is_empty() {
            return;
        }
        let turned = self.features.turned + super::march::halves(twist, self.lever).1.length();
        let hides = HIDES * self.tool.spacing;
        for k in 0..own {
            let parent = (self.features.next + k) % own;
            if self.places.there[parent].clearance > self.tool.cover[parent] {
                continue;
            }
            for f in self.tool.first[parent]..self.tool.first[parent + 1] {
                let on = self.tool.fine[f];
                let at = pose.at + arm(&self.tool, turn, on);
                let (then, grown, turned_then) = self.features.when[f];
                let moved =
                    at.distance(then) + self.features.grown - grown + hides * (turned - turned_then).abs();
                if self.features.clearance[f] - moved >= -self.options.tolerance {
                    continue;
                }
                if self.features.left == 0 {
                    // The rest has its turn in the next tick, and the march goes on in small steps.
                    self.features.next = parent;
                    self.features.is_unsure = true;
                    return;
                }
                self.features.left -= 1;
                let mut found = ask(&self.tool, obstacle, pose, turn, on);
                // Nothing within `hides` of the point is less clear: the distance of a convex solid lies above its tangents.
                let mut bound = found.clearance - hides * self.slope(turn, &found).length().min(1.0);
                let mut stride = self.tool.spacing;
                if found.clearance > hides {
                    bound = found.clearance - hides;
                } else if bound < -self.options.tolerance {
                    self.features.left = self.features.left.saturating_sub(SLIDES);
                    (found, stride) = self.slid(obstacle, pose, turn, found, stride);
                    // Where it has not come to rest, there is more to find.
                    bound = found.clearance - 0.5 * hides * self.slope(turn, &found).length().min(1.0);
                }
                self.features.clearance[f] = bound;
                self.features.when[f] = (at, self.features.grown, turned);
                if found.clearance < -self.options.tolerance {
                    self.welcome(obstacle, found, stride, twist, turn, is_violated, is_too_far);
                }
            }
        }
    }

    /// Makes a place between the points that is in the solid a guest.
    fn welcome(
        &mut self,
        obstacle: &dyn Obstacle,
        found: Place,
        stride: f64,
        twist: &Twist,
        turn: &DMat3,
        is_violated: &mut bool,
        is_too_far: &mut bool,
    ) {
        let guests = self.places.own..self.places.len();
        // Those that slide to the same place are one.
        let near = |i: &usize| {
            self.places.counts[*i] && self.places.there[*i].on.distance(found.on) < 0.25 * self.tool.spacing
        };
        let same = guests.clone().find(near);
        if same.is_some_and(|i| self.places.there[i].clearance <= found.clearance + self.options.tolerance) {
            return;
        }
        let free = guests.clone().find(|i| !self.places.counts[*i]);
        let clearest = guests.max_by(|a, b| {
            let clearance = |i: usize| self.places.there[i].clearance;
            clearance(*a).total_cmp(&clearance(*b))
        });
        let Some(i) = same.or(free).or(clearest) else {
            return;
        };
        self.places.counts[i] = true;
        self.places.there[i] = found;
        self.features.stride[i - self.places.own] = stride;
        // If it was in the solid before it was found, it leaves that as if the solid had grown.
        let here = ask(&self.tool, obstacle, &self.pose, &self.places.turn, found.on);
        self.places.here[i] = here;
        self.places.level[i] = here.clearance.min(0.0);
        self.judge(i, twist, turn, is_violated, is_too_far);
    }

    /// Leaves all points but the deepest out of the steps of this tick.
    pub(super) fn choose_deepest(&mut self, count: usize) {
        let Self { places, features, .. } = self;
        features.order.clear();
        features.order.extend(0..places.own);
        let clearance = |i: &usize| places.here[*i].clearance;
        features
            .order
            .sort_unstable_by(|a, b| clearance(a).total_cmp(&clearance(b)).then(a.cmp(b)));
        features.ignored.fill(true);
        for i in features.order.iter().take(count) {
            features.ignored[*i] = false;
        }
    }
}
