//! Tools that work in the solid: where they work, and how that feels.

use glam::DVec3;

use super::coupling::Coupling;
use super::{Contact, Felt, Obstacle, Pose, Renderer};

/// Halvings by which the touch is found: they leave 10⁻¹² of the way.
const HALVINGS: usize = 40;

/// How a tool goes into the solid: it is put on the surface, goes in by what the rate allows, and what it takes up there
/// is composed with the solid \[Sensable99 fig. 19\]. So a cut does not depend on how fast the hand pressed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Embedding {
    /// Way into the solid per second, mm/s.
    pub rate: f64,
}

impl Embedding {
    /// Where a tool works next: from its touch with the surface towards the hand, for `dt` seconds. `is_clear` says
    /// whether a tool there would be clear of the solid; it is where the proxy is, and the hand is beyond the surface.
    pub fn step(&self, is_clear: impl Fn(DVec3) -> bool, proxy: DVec3, hand: DVec3, dt: f64) -> DVec3 {
        self.beyond(touching(is_clear, proxy, hand), hand, dt)
    }

    /// The same of a tool that touches where it is.
    pub fn beyond(&self, touch: DVec3, hand: DVec3, dt: f64) -> DVec3 {
        touch + (hand - touch).clamp_length_max(self.rate * dt)
    }
}

/// The last place, from one where a tool is clear towards a hand, where it still is.
fn touching(is_clear: impl Fn(DVec3) -> bool, clear: DVec3, hand: DVec3) -> DVec3 {
    if !is_clear(clear) {
        return clear;
    }
    let (mut outside, mut inside) = (clear, hand);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (outside + inside);
        *(if is_clear(middle) {
            &mut outside
        } else {
            &mut inside
        }) = middle;
    }
    outside
}

/// The feel of a tool that takes solid away, or lays it on, wherever it is: a thick liquid \[Sensable99\].
///
/// A point follows the hand, at once where there is nothing to work on, else by what the rate allows; a spring draws the hand
/// to it. Out of the solid the point catches up at a bounded rate, so that the force does not break off.
#[derive(Clone, Debug)]
pub struct Viscous {
    /// Radius of the tool, mm.
    pub radius: f64,
    /// Between hand and point.
    pub coupling: Coupling,
    /// Speed of the point in the solid, mm/s.
    pub rate: f64,
    /// Speed of the point out of it, mm/s.
    pub catch_up: f64,
    at: Option<DVec3>,
}

impl Viscous {
    /// A tool that has not been anywhere yet; out of the solid its point goes 0.5 m/s.
    pub fn new(radius: f64, coupling: Coupling, rate: f64) -> Self {
        Self {
            radius,
            coupling,
            rate,
            catch_up: 500.0,
            at: None,
        }
    }
}

impl Renderer for Viscous {
    fn tick(&mut self, obstacle: &dyn Obstacle, hand: &Pose, dt: f64) -> Felt {
        let at = self.at.unwrap_or(hand.at);
        let meets = |p: DVec3| obstacle.distance(p).0 < self.radius;
        let works = meets(at) || meets(hand.at);
        let speed = if works { self.rate } else { self.catch_up };
        let next = at + (hand.at - at).clamp_length_max(speed * dt);
        self.at = Some(next);
        let stiffness = self.coupling.in_series(obstacle.touch(next).stiffness);
        Felt {
            force: stiffness * (next - hand.at),
            torque: DVec3::ZERO,
            proxy: Pose { at: next, ..*hand },
            contact: if works { Contact::Slides } else { Contact::Free },
        }
    }

    fn reset(&mut self) {
        self.at = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Solid below `z = 0`.
    struct Floor;

    impl Obstacle for Floor {
        fn distance(&self, p: DVec3) -> (f64, DVec3) {
            (p.z, DVec3::Z)
        }

        fn finest(&self) -> f64 {
            10.0
        }
    }

    #[test]
    fn a_ball_touches_a_plane_to_a_micrometre_before_the_rate_acts() {
        for (proxy, hand) in [(2.0, 1.0), (9.0, -20.0), (2.0000001, 1.9)] {
            let is_clear = |p: DVec3| Floor.distance(p).0 >= 2.0;
            let aside = DVec3::new(0.3, 0.0, 0.0);
            let [proxy, hand] = [proxy * DVec3::Z, hand * DVec3::Z + aside];
            let touch = Embedding { rate: 0.0 }.step(is_clear, proxy, hand, 0.03);
            assert!((touch.z - 2.0).abs() < 1e-3, "{touch}");
            let at = Embedding { rate: 2.0 }.step(is_clear, proxy, hand, 0.03);
            let way = (at - touch).length();
            assert!((way - 0.06).abs() < 1e-9, "{way}");
        }
    }

    #[test]
    fn a_hand_that_is_clear_works_where_it_is() {
        let is_clear = |p: DVec3| p.z >= 2.0;
        let at = Embedding { rate: 1.0 }.step(is_clear, DVec3::Z * 9.0, DVec3::Z * 3.0, 1.0);
        assert!(at.distance(DVec3::Z * 3.0) < 1e-9);
    }

    #[test]
    fn the_drag_in_the_solid_is_what_the_rate_leaves_behind() {
        let mut tool = Viscous::new(2.0, Coupling::spring(500.0), 20.0);
        let mut last = DVec3::ZERO;
        for n in 0..1500 {
            // 50 mm/s along the inside, for 0.1 s, then still; then out at 100 mm/s, and still there.
            let x = 0.05 * f64::from(n.min(100));
            let z = if n < 200 {
                -5.0
            } else {
                -5.0 + 0.1 * f64::from(n.min(300) - 200)
            };
            let felt = tool.tick(&Floor, &Pose::at(DVec3::new(x, 0.0, z)), 1e-3);
            assert!((felt.force - last).length() < 0.26, "{n}");
            if n == 100 {
                // 0.1 s at 30 mm/s less than the hand.
                assert!((felt.force.x + 0.5 * 3.0).abs() < 0.03, "{felt:?}");
            }
            last = felt.force;
        }
        assert_eq!(last, DVec3::ZERO);
    }
}
