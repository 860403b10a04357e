//! How strong a stroke without a pen is: the slower the mouse goes, the stronger.
//!
//! Pointer events have no time. A mouse tells its moves at even times, so those of a picture are spread evenly over it: a gesture is the
//! same in few pictures as in many.

use egui::Pos2;

use super::gesture::Way;
use super::tool::Tool;
use crate::view::Ray;

/// Speeds of the pointer that leave the most and the least of the strength, points a second.
const SLOW: f64 = 60.0;
const FAST: f64 = 2400.0;
/// What is left of it at the highest.
const LEAST: f64 = 0.1;
/// Way over which another speed shows, points.
const REACH: f64 = 24.0;
/// Longest time from one move to the next, seconds: who rests before going on is not slow on all of the way to there.
const REST: f64 = 0.1;
/// Presses are rounded to parts of 1: journals would tell pictures apart by the rounding of their times else.
const PARTS: f64 = 1000.0;

/// The speed of a stroke that is under way, over its arc length.
#[derive(Clone, Debug)]
pub struct Pace {
    /// What has not begun yet, as its first step tells how fast it begins.
    pub waits: Option<(Tool, Ray)>,
    step: f64,
    /// When the last move was, and the time of the stroke since it began without its rests.
    told: f64,
    clock: f64,
    /// When the last step was, by that clock.
    stepped: f64,
    /// How fast it is, 0 to 1.
    fast: Option<f64>,
}

impl Pace {
    /// Of a stroke in steps of so many points that begins at a time.
    pub fn new(step: f32, time: f64, waits: (Tool, Ray)) -> Self {
        Self {
            waits: Some(waits),
            step: f64::from(step),
            told: time,
            clock: 0.0,
            stepped: 0.0,
            fast: None,
        }
    }

    /// The way of a stroke that has one: what changes evenly along it is the clock.
    pub fn way(from: Pos2, step: f32) -> Way {
        Way::new(from, step, Some(0.0))
    }

    /// The steps of a way to where the pointer is told to be at a time, and how hard a pen would be pressed there.
    pub fn steps(&mut self, way: &mut Way, to: Pos2, time: f64) -> Vec<(Pos2, Option<f64>)> {
        self.clock += (time - self.told).clamp(0.0, REST);
        self.told = time;
        let steps = way.to(to, self.clock);
        let pressed = steps
            .into_iter()
            .map(|(at, clock)| (at, Some(self.press(clock.unwrap_or(self.clock)))));
        pressed.collect()
    }

    /// At the next step, which is reached at a time of the clock.
    fn press(&mut self, clock: f64) -> f64 {
        let speed = self.step / (clock - self.stepped).max(1e-9);
        self.stepped = clock;
        let now = libm::log(speed.clamp(SLOW, FAST) / SLOW) / libm::log(FAST / SLOW);
        let share = 1.0 - libm::exp(-self.step / REACH);
        let fast = self.fast.map_or(now, |before| before + share * (now - before));
        self.fast = Some(fast);
        (PARTS * (1.0 - (1.0 - LEAST) * fast)).round() / PARTS
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::window::tool::{Kind, Settings};

    /// Presses on a straight way at a steady speed, points a second, of which so many moves a second tell.
    fn presses(speed: f64, rate: f64, rest: f64) -> Vec<f64> {
        let tool = Tool {
            kind: Kind::Carve,
            radius: 1.0,
            strength: 0.5,
            inverted: false,
            settings: Settings::default(),
        };
        let ray = Ray {
            from: DVec3::ZERO,
            along: DVec3::Z,
        };
        let mut pace = Pace::new(4.0, 3.0, (tool, ray));
        let mut way = Pace::way(Pos2::ZERO, 4.0);
        let moves = (240.0 / speed * rate).round() as usize;
        let steps = (1..=moves).flat_map(|n| {
            let time = n as f64 / rate;
            pace.steps(&mut way, Pos2::new((speed * time) as f32, 0.0), 3.0 + rest + time)
        });
        steps.map(|(_, press)| press.unwrap()).collect()
    }

    #[test]
    fn the_slower_the_harder_at_any_rate() {
        let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
        let mut before = 1.1;
        for speed in [30.0, 120.0, 400.0, 1200.0, 4800.0] {
            let often = presses(speed, 120.0, 0.0);
            assert!(mean(&often) < before, "{speed}: {often:?}");
            before = mean(&often);
            for rate in [20.0, 40.0, 60.0] {
                // So few moves tell nothing of so short a way.
                if speed / rate > 120.0 {
                    continue;
                }
                let seldom = presses(speed, rate, 0.0);
                assert!(seldom.len().abs_diff(often.len()) <= 1, "{speed} {rate}");
                for (a, b) in seldom.iter().zip(&often) {
                    assert!((a - b).abs() < 2e-3, "{speed} {rate}: {seldom:?} {often:?}");
                }
            }
        }
        assert_eq!(presses(30.0, 60.0, 0.0)[0], 1.0);
        assert!((before - LEAST).abs() < 1e-9);
    }

    /// Who waits with the button held down and then goes fast does not leave a deep hole on all of the way.
    #[test]
    fn a_rest_counts_as_a_short_one() {
        let (at_once, rested) = (presses(1200.0, 60.0, 0.0), presses(1200.0, 60.0, 5.0));
        let last = at_once.len() - 1;
        assert!(rested[0] > at_once[0] && rested[0] < 0.9, "{rested:?}");
        assert!((rested[last] - at_once[last]).abs() < 0.01, "{rested:?}");
    }
}
