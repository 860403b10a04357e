//! How a hand moves, from where it was told to be.

use glam::DVec3;

use super::super::Reading;

/// Places that are kept.
const KEPT: usize = 16;
/// Time over which a velocity is taken, s. One count of 55 µm in 1 ms is 55 mm/s; over 4 ms it is 14.
const WINDOW: f64 = 4e-3;
/// Two times nearer than this, s, are one.
const SAME: f64 = 1e-6;

/// How a hand moves.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    /// When, s, and where, mm, the newest last.
    places: [(f64, DVec3); KEPT],
    count: usize,
    now: f64,
    /// mm since the last look.
    way: DVec3,
    /// m/s.
    velocity: DVec3,
}

impl Motion {
    /// Takes what was told, `dt` seconds after the last look.
    pub fn told(&mut self, reading: &Reading, dt: f64) {
        self.now += dt;
        let (time, at) = (self.now - reading.age, reading.pose.at);
        self.way = DVec3::ZERO;
        if self.count > 0 {
            let (last, was) = self.places[KEPT - 1];
            self.way = at - was;
            if time - last < SAME {
                // The same pose once more, unless it is another that says that it is as old.
                self.places[KEPT - 1].1 = at;
                return;
            }
        }
        self.places.rotate_left(1);
        self.places[KEPT - 1] = (time, at);
        self.count = (self.count + 1).min(KEPT);
        let known = &self.places[KEPT - self.count..KEPT - 1];
        let before = |&&(t, _): &&(f64, DVec3)| time - t >= WINDOW - SAME;
        self.velocity = match known.iter().rev().find(before).or(known.first()) {
            Some(&(t, p)) => (at - p) * 1e-3 / (time - t),
            None => DVec3::ZERO,
        };
    }

    /// Way since the last look, mm.
    pub fn way(&self) -> DVec3 {
        self.way
    }

    /// m/s over the last milliseconds.
    pub fn velocity(&self) -> DVec3 {
        self.velocity
    }

    /// m/s.
    pub fn speed(&self) -> f64 {
        self.velocity.length()
    }
}
