//! Where the points of a tool are, and how clear of the solid.

use glam::{DMat3, DVec3};

use super::super::{Obstacle, Pose};
use super::projection::Twist;
use super::tool::PointTool;

/// Points between the tool's own that can touch at once.
pub(super) const GUESTS: usize = 16;

/// What is known of a point at a pose.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Where it is on the tool, in its axes.
    pub on: DVec3,
    /// Distance from the solid beyond the point's radius, mm; at least that if it was not asked for.
    pub clearance: f64,
    /// Gradient of the distance; of an earlier pose if it was not asked for.
    pub gradient: DVec3,
    pub is_exact: bool,
}

const NOWHERE: Place = Place {
    on: DVec3::ZERO,
    clearance: f64::INFINITY,
    gradient: DVec3::ZERO,
    is_exact: false,
};

/// The tool's points, and behind them room for guests: points between them that touch.
#[derive(Clone, Debug)]
pub(super) struct Places {
    /// At the pose of the proxy.
    pub here: Vec<Place>,
    /// At the pose that is tried.
    pub there: Vec<Place>,
    /// Clearance that a point must keep: 0, or less where the solid has grown over it.
    pub level: Vec<f64>,
    /// Whether the point counts: all of the tool's, and guests that touch.
    pub counts: Vec<bool>,
    /// The tool's own; guests follow.
    pub own: usize,
    /// Turn of the points.
    pub turn: DMat3,
}

impl Places {
    pub fn new(tool: &PointTool) -> Self {
        let own = tool.points.len();
        let guests = if tool.fine.is_empty() { 0 } else { GUESTS };
        let mut here = vec![NOWHERE; own + guests];
        for (place, on) in here.iter_mut().zip(&tool.points) {
            place.on = *on;
        }
        Self {
            there: here.clone(),
            level: vec![0.0; own + guests],
            counts: (0..own + guests).map(|i| i < own).collect(),
            here,
            own,
            turn: DMat3::IDENTITY,
        }
    }

    pub fn len(&self) -> usize {
        self.here.len()
    }

    /// No guest touches.
    pub fn forget(&mut self) {
        self.counts[self.own..].fill(false);
    }

    /// Asks for all points at a pose.
    pub fn look(&mut self, tool: &PointTool, obstacle: &dyn Obstacle, pose: &Pose) {
        for i in 0..self.here.len() {
            if self.counts[i] {
                self.here[i] = ask(tool, obstacle, pose, &self.turn, self.here[i].on);
            }
        }
    }

    /// The least clearance of those that were asked for, and whose.
    pub fn deepest(&self) -> (f64, usize) {
        self.deepest_of(self.len())
    }

    /// That of the tool's own points.
    pub fn deepest_own(&self) -> (f64, usize) {
        self.deepest_of(self.own)
    }

    fn deepest_of(&self, count: usize) -> (f64, usize) {
        let asked = (0..count).filter(|i| self.counts[*i] && self.here[*i].is_exact);
        let all = asked.map(|i| (self.here[i].clearance, i));
        all.fold((f64::INFINITY, 0), |a, b| if b.0 < a.0 { b } else { a })
    }
}

/// Way from the handle point to a point of the tool, in the world's axes.
pub(super) fn arm(tool: &PointTool, turn: &DMat3, on: DVec3) -> DVec3 {
    *turn * (on - tool.handle)
}

/// Asks for a point of the tool.
pub(super) fn ask(tool: &PointTool, obstacle: &dyn Obstacle, pose: &Pose, turn: &DMat3, on: DVec3) -> Place {
    let (distance, gradient) = obstacle.distance(pose.at + arm(tool, turn, on));
    Place {
        on,
        clearance: distance - tool.nose,
        gradient,
        is_exact: true,
    }
}

/// Change of a point's distance by a twist of the tool: `(g, r × g / lever)`.
pub(super) fn row(gradient: DVec3, arm: DVec3, lever: f64) -> Twist {
    let turning = arm.cross(gradient) / lever;
    [
        gradient.x, gradient.y, gradient.z, turning.x, turning.y, turning.z,
    ]
}
