//! Solids with exact distances, and a hand that follows a script.

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;

use super::super::super::{Contact, Felt, Obstacle, Pose, Renderer};
use super::super::turn::{exponential, logarithm};
use super::super::{MultiPoint, PointTool};

pub const DT: f64 = 1e-3;

/// A distance with a gradient, and the finest part of the solid; counts what it is asked.
pub struct Solid<F> {
    distance: F,
    finest: f64,
    asked: AtomicUsize,
}

impl<F: Fn(DVec3) -> (f64, DVec3) + Send + Sync> Solid<F> {
    pub fn new(finest: f64, distance: F) -> Self {
        Self {
            distance,
            finest,
            asked: AtomicUsize::new(0),
        }
    }

    pub fn asked(&self) -> usize {
        self.asked.swap(0, Ordering::Relaxed)
    }
}

impl<F: Fn(DVec3) -> (f64, DVec3) + Send + Sync> Obstacle for Solid<F> {
    fn distance(&self, p: DVec3) -> (f64, DVec3) {
        self.asked.fetch_add(1, Ordering::Relaxed);
        (self.distance)(p)
    }

    fn finest(&self) -> f64 {
        self.finest
    }
}

/// Solid behind a plane through a place, with its normal in the air.
pub fn plane(p: DVec3, at: DVec3, n: DVec3) -> (f64, DVec3) {
    ((p - at).dot(n), n)
}

pub fn ball(p: DVec3, at: DVec3, radius: f64) -> (f64, DVec3) {
    let d = p - at;
    (d.length() - radius, d.normalize_or(DVec3::Z))
}

/// Of two solids together.
pub fn or(a: (f64, DVec3), b: (f64, DVec3)) -> (f64, DVec3) {
    if a.0 <= b.0 { a } else { b }
}

/// A block about a place.
pub fn block(p: DVec3, at: DVec3, half: DVec3) -> (f64, DVec3) {
    let d = p - at;
    let q = d.abs() - half;
    let out = q.max(DVec3::ZERO);
    let sign = DVec3::new(1f64.copysign(d.x), 1f64.copysign(d.y), 1f64.copysign(d.z));
    if out != DVec3::ZERO {
        return (out.length(), sign * out / out.length());
    }
    let axis = if q.x >= q.y && q.x >= q.z {
        DVec3::X
    } else if q.y >= q.z {
        DVec3::Y
    } else {
        DVec3::Z
    };
    (q.max_element(), sign * axis)
}

/// A segment with a radius.
pub fn rod(p: DVec3, from: DVec3, to: DVec3, radius: f64) -> (f64, DVec3) {
    let along = ((p - from).dot(to - from) / (to - from).length_squared()).clamp(0.0, 1.0);
    ball(p, from + along * (to - from), radius)
}

pub fn turned(at: DVec3, turn: DVec3) -> Pose {
    Pose {
        at,
        turn: exponential(turn),
    }
}

/// A tick: what the hand did and felt.
#[derive(Clone, Copy)]
pub struct Tick {
    pub hand: Pose,
    pub felt: Felt,
}

/// A row of ticks and what must be known of it.
pub struct Trace(pub Vec<Tick>);

/// Follows a script for some ticks.
pub fn follow(
    tool: &mut MultiPoint,
    solid: &dyn Obstacle,
    ticks: usize,
    hand: impl Fn(f64) -> Pose,
) -> Trace {
    let ticks = (0..ticks).map(|k| {
        let hand = hand(k as f64 * DT);
        Tick {
            hand,
            felt: tool.tick(solid, &hand, DT),
        }
    });
    Trace(ticks.collect())
}

impl Trace {
    pub fn last(&self) -> Tick {
        *self.0.last().expect("ticks")
    }

    /// Largest change of the force.
    pub fn step(&self) -> f64 {
        self.0
            .windows(2)
            .map(|w| (w[1].felt.force - w[0].felt.force).length())
            .fold(0.0, f64::max)
    }

    pub fn torque_step(&self) -> f64 {
        self.0
            .windows(2)
            .map(|w| (w[1].felt.torque - w[0].felt.torque).length())
            .fold(0.0, f64::max)
    }

    /// Depth of the deepest point of the tool in the solid, mm, and when.
    pub fn depth(&self, tool: &PointTool, solid: &dyn Obstacle) -> (f64, usize) {
        let of = |pose: &Pose, q: &DVec3| tool.nose() - solid.distance(place(tool, pose, *q)).0;
        let depth = |t: &Tick| {
            tool.points()
                .iter()
                .map(|q| of(&t.felt.proxy, q))
                .fold(f64::NEG_INFINITY, f64::max)
        };
        let felt = self
            .0
            .iter()
            .enumerate()
            .filter(|(_, t)| t.felt.contact != Contact::Inside);
        let all = felt.map(|(k, t)| (depth(t), k));
        all.fold((f64::NEG_INFINITY, 0), |a, b| if b.0 > a.0 { b } else { a })
    }

    /// Work that the hand has put in, J.
    pub fn work(&self) -> f64 {
        self.works().last().unwrap_or(0.0)
    }

    /// Work that the hand has put in, least over all times, J: below 0 the tool gave more than it got.
    pub fn least_work(&self) -> f64 {
        self.works().fold(0.0, f64::min)
    }

    fn works(&self) -> impl Iterator<Item = f64> {
        let mut sum = 0.0;
        self.0.windows(2).map(move |w| {
            let way = w[1].hand.at - w[0].hand.at;
            let turn = logarithm(w[1].hand.turn * w[0].hand.turn.inverse());
            // Means over the tick: a force that is held for it gives K(vT)²/2 more, whatever renders it.
            let force = 0.5 * (w[0].felt.force + w[1].felt.force);
            let torque = 0.5 * (w[0].felt.torque + w[1].felt.torque);
            sum -= 1e-3 * (force.dot(way) + torque.dot(turn));
            sum
        })
    }
}

/// Where a point of a tool is in the world.
pub fn place(tool: &PointTool, pose: &Pose, q: DVec3) -> DVec3 {
    pose.at + pose.turn * (q - tool.handle)
}

/// Deepest place of a dense set on the tool's surface.
pub fn dense_depth(tool: &PointTool, solid: &dyn Obstacle, pose: &Pose, spacing: f64) -> f64 {
    let shape = tool.shape.as_ref().expect("a shape");
    let depth = |q: &DVec3| tool.nose() - solid.distance(place(tool, pose, *q)).0;
    shape
        .points(spacing)
        .iter()
        .map(depth)
        .fold(f64::NEG_INFINITY, f64::max)
}
