//! The surface contact point: a proxy of the tool that the solid keeps out \[Zilles94, Ruspini97; Kim03 §4.2; Sensable99 figs. 13–15\].
//!
//! A tick moves the proxy from where it was as near to the hand as it gets without crossing the solid: free until it
//! meets the surface, then along tangent planes, of which those of a hollow are kept together, and back onto the surface by its
//! gradient. In locally convex free space that is the projection of the hand, so the force never changes faster than the
//! stiffness times the hand. The proxy is never set to the hand but in free space and by [`Renderer::reset`].

mod friction;
mod magnet;
mod march;
mod planes;

use glam::DVec3;

pub use friction::Friction;
pub use magnet::Magnet;

use super::coupling::{Coupling, Stretching, pressing};
use super::{Contact, Felt, Obstacle, Pose, Renderer, Touch};
use march::{March, Place};

/// What a proxy is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProxyOptions {
    /// Radius of the ball that touches, mm; 0 for a point.
    pub radius: f64,
    /// Between hand and proxy.
    pub coupling: Coupling,
    /// How surfaces with friction hold it.
    pub friction: Friction,
    /// Thickness of an additional layer about the solid, mm: thin parts get a depth to press into \[Kim03 §4.4\]. The contact is
    /// shown, and its material read, on the surface itself.
    pub offset: f64,
    /// Draws the tool to the surface.
    pub magnet: Option<Magnet>,
    /// Height of humps, mm, that the proxy gets over though the hand draws it back: its spring may stretch by as much
    /// \[Sensable99\].
    pub stretch: f64,
    /// Speed at which solid that has grown over the tool pushes it out, mm/s.
    pub push_out: f64,
    /// Way that makes no difference, mm.
    pub tolerance: f64,
}

impl Default for ProxyOptions {
    /// A ball of 2 mm on a spring of 500 N/m.
    fn default() -> Self {
        Self {
            radius: 2.0,
            coupling: Coupling::spring(500.0),
            friction: Friction::default(),
            offset: 0.0,
            magnet: None,
            stretch: 0.0,
            push_out: 100.0,
            tolerance: 1e-4,
        }
    }
}

/// Length of the humps that a stretched spring gets over, over its stretch.
const HUMP: f64 = 4.0;
/// Time over which normals of the contact are averaged for that, s.
const LEANING: f64 = 0.05;

/// A ball or a point that touches.
#[derive(Clone, Debug)]
pub struct Proxy {
    options: ProxyOptions,
    /// Where it is; nowhere before the first tick and after a reset.
    at: Option<DVec3>,
    /// Whether it has not been clear of the solid since then.
    is_inside: bool,
    sticks: bool,
    /// Mean normal of the contact.
    leaning: DVec3,
    stretching: Stretching,
}

impl Proxy {
    /// A tool that has not been anywhere yet.
    pub fn new(options: ProxyOptions) -> Self {
        Self {
            options,
            at: None,
            is_inside: false,
            sticks: false,
            leaning: DVec3::ZERO,
            stretching: Stretching::default(),
        }
    }

    /// What it was told.
    pub fn options(&self) -> &ProxyOptions {
        &self.options
    }

    /// Distance that the middle of the ball keeps from the surface.
    fn clearance(&self) -> f64 {
        self.options.radius + self.options.offset
    }

    /// Nothing is felt, and the proxy is where the hand is.
    fn free(&mut self, hand: &Pose, contact: Contact) -> Felt {
        self.sticks = false;
        self.leaning = DVec3::ZERO;
        self.stretching.end();
        self.at = Some(hand.at);
        Felt {
            contact,
            ..Felt::nothing(hand)
        }
    }

    /// Where the proxy goes from `here`, and what the surface is like there; nowhere if the hand is free.
    fn contact(&mut self, march: &March, from: Place, hand: DVec3, dt: f64) -> Option<(Place, Touch)> {
        // Friction counts from where the surface is met.
        let here = march.onward(from, hand)?;
        let law = self.options.friction;
        if let Some(normal) = here.normal() {
            let touch = touch(march.obstacle, &here);
            if law.holds(touch.friction, hand - here.at, normal, self.sticks) {
                self.sticks = true;
                return Some((here, touch));
            }
        }
        let (mut there, is_held) = march.toward(hand, here);
        if !is_held {
            return None;
        }
        if self.options.stretch > 0.0 {
            there = self.over_humps(march, there, hand);
        }
        let normal = there.normal().unwrap_or(DVec3::ZERO);
        self.leaning += dt / (dt + LEANING) * (normal - self.leaning);
        let touch = touch(march.obstacle, &there);
        if touch.friction == 0.0 {
            self.sticks = false;
            return Some((there, touch));
        }
        let depth = there.at.distance(hand);
        let (at, sticks) = law.follow(touch.friction, here.at, there.at, depth, self.sticks);
        self.sticks = sticks;
        let slid = || march.onto(Place::of(march.obstacle, at)).unwrap_or(there);
        Some((if sticks { here } else { slid() }, touch))
    }

    /// The hand in the band of the magnet, if it is.
    fn drawn(&mut self, obstacle: &dyn Obstacle, hand: &Pose) -> Felt {
        let felt = self.free(hand, Contact::Free);
        let Some(magnet) = self.options.magnet else {
            return felt;
        };
        let place = Place::of(obstacle, hand.at);
        let Some(normal) = place.normal() else {
            return felt;
        };
        let height = place.distance - self.clearance();
        if !(0.0..magnet.range).contains(&height) {
            return felt;
        }
        Felt {
            force: -magnet.force(height) * normal,
            proxy: Pose {
                at: hand.at - (height + self.options.offset) * normal,
                ..*hand
            },
            contact: Contact::Attracted,
            ..felt
        }
    }

    /// Looks over a hump in front of a place that is as near to the hand as marching gets: up by the stretch along the mean
    /// normal, across, and down again.
    fn over_humps(&self, march: &March, here: Place, hand: DVec3) -> Place {
        let (stretch, up) = (self.options.stretch, self.leaning.normalize_or_zero());
        let lag = hand - here.at;
        let across = (lag - lag.dot(up) * up).normalize_or_zero();
        let lifted = here.at + stretch * up;
        let beyond = lifted + HUMP * stretch * across;
        let there = march
            .free(here, lifted)
            .and_then(|lifted| march.free(lifted, beyond));
        let Some(there) = there.map(|place| march.toward(hand, place).0) else {
            return here;
        };
        let is_nearer = there.at.distance(hand) < here.at.distance(hand) - march.tolerance;
        if is_nearer { there } else { here }
    }
}

/// What the surface is like where a place rests on it.
fn touch(obstacle: &dyn Obstacle, place: &Place) -> Touch {
    let normal = place.normal().unwrap_or(DVec3::ZERO);
    obstacle.touch(place.at - place.distance * normal)
}

impl Renderer for Proxy {
    fn tick(&mut self, obstacle: &dyn Obstacle, hand: &Pose, dt: f64) -> Felt {
        let clearance = self.clearance();
        let ProxyOptions {
            tolerance, push_out, ..
        } = self.options;
        let begins = self.at.is_none();
        let mut here = Place::of(obstacle, self.at.unwrap_or(hand.at));
        if begins || self.is_inside {
            let at_hand = Place::of(obstacle, hand.at);
            self.is_inside = at_hand.distance < clearance;
            if self.is_inside {
                return self.free(hand, Contact::Inside);
            }
            here = at_hand;
        }
        // Solid that grew over the tool moves it out no faster than told.
        let buried = clearance - here.distance;
        let mut march = March {
            obstacle,
            clearance,
            tolerance,
        };
        if buried > tolerance {
            march.clearance = clearance.min(here.distance + push_out * dt);
            here = march.onto(here).unwrap_or(here);
            march.clearance = march.clearance.min(here.distance);
        }
        let Some((place, touch)) = self.contact(&march, here, hand.at, dt) else {
            return self.drawn(obstacle, hand);
        };
        self.at = Some(place.at);
        let stretch = place.at - hand.at;
        let speed = self.stretching.of(stretch, dt);
        let stiffness = self.options.coupling.in_series(touch.stiffness);
        let shown = place.normal().unwrap_or(DVec3::ZERO) * self.options.offset;
        Felt {
            force: pressing(stretch, stiffness, self.options.coupling.damping, speed),
            torque: DVec3::ZERO,
            proxy: Pose {
                at: place.at - shown,
                ..*hand
            },
            contact: if self.sticks {
                Contact::Sticks
            } else {
                Contact::Slides
            },
        }
    }

    fn reset(&mut self) {
        *self = Self::new(self.options);
    }
}

#[cfg(test)]
mod tests;
