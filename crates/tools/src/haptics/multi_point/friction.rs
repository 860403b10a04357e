//! Friction and softness at the places where the tool presses: a cone for each, with what is painted there.
//!
//! A step goes where `½|u − d|² + Σ μᵢλᵢ|Tᵢu|` is least under the rows, λᵢ the pressure of a contact and Tᵢu its slip: the
//! friction of a rigid body whose pressures are given \[Moreau88\]. Pressures and frictions are found in turn: pressures by the
//! polyhedron, frictions by Newton's method ([`slide`](super::slide)) in what the active rows leave free. So the tool holds if there are forces within
//! the cones that balance its springs; where there are none, it slides, turns or rolls until what is left of the pull is within them. For
//! a single place that is the law of the ball: the pull that is left is μ times the depth.

use glam::DVec3;

use super::super::{Obstacle, Touch};
use super::MultiPoint;
use super::places::row;
use super::projection::{Twist, add, dot};
use super::slide::{self, Rubs};

/// Turns of pressures and frictions at most.
const ROUNDS: usize = 12;
/// Change of a friction that ends them, mm.
const SAME: f64 = 1e-6;
/// A tool that would go no further stays where it is, mm: steps of that size are what friction is softened by.
const RESTS: f64 = 10.0 * slide::SOFT;
/// Slip in a tick that counts as none, mm.
const HELD: f64 = 2e-5;
/// Way in the air, mm, that is gone before friction counts.
const AIR: f64 = 0.01;

/// Where a row comes from.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Meeting {
    /// Which of the tool's points it is.
    pub point: usize,
    /// Place of the solid's surface, mm.
    pub at: DVec3,
    /// From the handle point to it.
    pub arm: DVec3,
    /// Of the distance, there.
    pub gradient: DVec3,
}

/// A place where the tool presses.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pressing {
    /// None of those there are, if it is of an earlier step.
    row: Option<usize>,
    meeting: Meeting,
    touch: Touch,
    /// Over the coupling's stiffness, mm.
    pressure: f64,
    tangents: [DVec3; 2],
    slips: [Twist; 2],
    /// Along the tangents, over the coupling's stiffness, mm.
    friction: [f64; 2],
}

/// All of them, of the step that was solved last.
#[derive(Clone, Debug, Default)]
pub(super) struct Pressings {
    all: [Option<Pressing>; 6],
    /// What slipped most in this tick, mm.
    slip: f64,
}

impl Pressings {
    /// Nothing presses.
    pub fn clear(&mut self) {
        self.all = [None; 6];
    }

    /// A step begins, with other rows.
    pub fn next(&mut self) {
        for p in self.iter_mut() {
            p.row = None;
        }
    }

    /// A tick begins.
    pub fn begin(&mut self) {
        self.slip = 0.0;
    }

    /// The tool was moved.
    pub fn moved(&mut self, twist: &Twist) {
        let slips = self
            .iter()
            .flat_map(|p| p.slips.iter().map(|slip| dot(slip, twist).abs()));
        self.slip = slips.fold(self.slip, f64::max);
    }

    /// Whether friction is at work, and nothing slipped in this tick.
    pub fn sticks(&self) -> bool {
        self.is_rough() && self.slip < HELD
    }

    fn iter(&self) -> impl Iterator<Item = &Pressing> {
        self.all.iter().flatten()
    }

    fn iter_mut(&mut self) -> impl Iterator<Item = &mut Pressing> {
        self.all.iter_mut().flatten()
    }

    fn is_rough(&self) -> bool {
        self.iter().any(|p| p.touch.friction > 0.0)
    }

    /// Force, N, and torque, N mm, by which soft places take less than the springs of a stiffness, N/mm.
    pub fn softness(&self, stiffness: f64) -> (DVec3, DVec3) {
        let mut lost = (DVec3::ZERO, DVec3::ZERO);
        for p in self.iter().filter(|p| p.touch.stiffness.is_finite()) {
            let share = stiffness / (stiffness + 1e-3 * p.touch.stiffness.max(0.0));
            let force = stiffness * share * p.force();
            lost.0 += force;
            lost.1 += p.meeting.arm.cross(force);
        }
        lost
    }
}

impl Pressing {
    /// On the tool, over the coupling's stiffness, mm.
    fn force(&self) -> DVec3 {
        self.pressure * self.meeting.gradient + self.rubbing()
    }

    fn rubbing(&self) -> DVec3 {
        self.friction[0] * self.tangents[0] + self.friction[1] * self.tangents[1]
    }

    /// Largest friction, mm.
    fn most(&self) -> f64 {
        self.touch.friction.max(0.0) * self.pressure * self.meeting.gradient.length()
    }
}

impl MultiPoint {
    /// The twist that leads nearest to a wish by the rows and by friction; nothing if the rows leave no room.
    pub(super) fn nearest(&mut self, obstacle: &dyn Obstacle, wish: &Twist) -> Option<Twist> {
        let Some(mut twist) = self.rows.nearest_again(wish) else {
            self.pressings.clear();
            return None;
        };
        self.find_pressings(obstacle);
        if !self.pressings.is_rough() {
            return Some(twist);
        }
        for _ in 0..ROUNDS {
            let change = self.rub(wish, &twist);
            twist = self.rows.nearest_again(&self.held(wish))?;
            self.find_pressings(obstacle);
            if change < SAME {
                break;
            }
        }
        let rests = dot(&twist, &twist).sqrt() < RESTS;
        Some(if rests { [0.0; 6] } else { twist })
    }

    /// Share of a wish up to where the first row is met, and what it is if there is a way in the air.
    pub(super) fn in_the_air(&self, wish: &Twist) -> Option<Twist> {
        if !self.pressings.is_rough() {
            return None;
        }
        let share = self.rows.meets(wish);
        (share * dot(wish, wish).sqrt() > AIR).then(|| wish.map(|u| share * u))
    }

    /// A wish with what friction takes of it.
    fn held(&self, wish: &Twist) -> Twist {
        let mut held = *wish;
        for p in self.pressings.iter() {
            for (slip, friction) in p.slips.iter().zip(p.friction) {
                add(&mut held, friction, slip);
            }
        }
        held
    }

    /// The active rows as places that press, with what was known of them.
    fn find_pressings(&mut self, obstacle: &dyn Obstacle) {
        let mut all = [None; 6];
        for (place, (row, pressure)) in all.iter_mut().zip(self.rows.active()) {
            let meeting = self.meetings[row];
            let known = self.pressings.iter().find(|p| p.row == Some(row));
            let mut pressing = known.copied().unwrap_or_else(|| {
                // What held the point before is a good guess.
                let same = |p: &&Pressing| p.meeting.point == meeting.point;
                let before = self
                    .pressings
                    .iter()
                    .find(same)
                    .map_or(DVec3::ZERO, Pressing::rubbing);
                let normal = meeting.gradient.normalize_or(DVec3::Z);
                let (a, b) = normal.any_orthonormal_pair();
                Pressing {
                    row: Some(row),
                    meeting,
                    touch: obstacle.touch(meeting.at),
                    pressure,
                    tangents: [a, b],
                    slips: [a, b].map(|t| self.row_of(t, meeting.arm)),
                    friction: [a, b].map(|t| t.dot(before)),
                }
            });
            pressing.pressure = pressure;
            *place = Some(pressing);
        }
        self.pressings.all = all;
    }

    /// Frictions for the pressures that are known, where `twist` is on the active rows. The largest change, mm.
    fn rub(&mut self, wish: &Twist, twist: &Twist) -> f64 {
        let Self { pressings, rows, .. } = self;
        // Without friction, on the same rows.
        let (mut free, mut way) = (*twist, *wish);
        add(&mut way, -1.0, twist);
        add(&mut free, 1.0, &rows.across(&way));
        let (mut expected, mut rubs) = (free, [Rubs::default(); 6]);
        for (rub, p) in rubs.iter_mut().zip(pressings.iter()) {
            *rub = Rubs {
                most: p.most(),
                slips: p.slips,
                yields: p.slips.map(|slip| rows.across(&slip)),
            };
            for (yields, friction) in rub.yields.iter().zip(p.friction) {
                add(&mut expected, friction, yields);
            }
        }
        slide::slide(
            &free,
            &expected,
            &rubs,
            pressings.iter_mut().map(|p| &mut p.friction),
        )
    }

    /// Begins the next solution with the points that pressed in the last one.
    pub(super) fn expect_the_same(&mut self) {
        for p in self.pressings.iter() {
            if let Some(row) = self.meetings.iter().position(|m| m.point == p.meeting.point) {
                self.rows.expect(row);
            }
        }
        self.pressings.next();
    }

    /// A row and where it comes from. Whether there was room.
    pub(super) fn meet(&mut self, row: Twist, least: f64, meeting: Meeting) -> bool {
        let has_room = self.rows.push(row, least);
        if has_room {
            self.meetings.push(meeting);
        }
        has_room
    }

    pub(super) fn row_of(&self, gradient: DVec3, arm: DVec3) -> Twist {
        match self.options.turn_every {
            0 => row(gradient, arm, self.lever),
            // The turn is the hand's.
            _ => [gradient.x, gradient.y, gradient.z, 0.0, 0.0, 0.0],
        }
    }
}
