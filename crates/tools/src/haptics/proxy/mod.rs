//! The surface contact point: a proxy of the tool that the solid keeps out [Zilles94, Ruspini97; Kim03 §4.2; Chen00 figs. 13–15].
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
use super::{Contact, Felt, Obstacle, Pose, Renderer};
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
    /// Thickness of an additional layer about the solid, mm: thin parts get a depth to press into [Kim03 §4.4]. The contact is
    /// shown, and its material read, on the surface itself.
    pub offset: f64,
    /// Draws the tool to the surface.
    pub magnet: Option<Magnet>,
    /// Height of humps, mm, that the proxy gets over though the hand draws it back: its spring may stretch by as much
    /// [Chen00].
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

/// A ball or a point that touches.
#[derive(Clone, Debug)]
pub struct Proxy {
    options: ProxyOptions,
    /// Where it is; nowhere before the first tick and after a reset.
    at: Option<DVec3>,
    /// Whether it has not been clear of the solid since then.
    is_inside: bool,
    sticks: bool,
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
        self.stretching.end();
        self.at = Some(hand.at);
        Felt {
            contact,
            ..Felt::nothing(hand)
        }
    }

    /// The hand in the band of the magnet.
    fn drawn(&mut self, place: &Place, hand: &Pose) -> Felt {
        let felt = self.free(hand, Contact::Free);
        let Some((magnet, normal)) = self.options.magnet.zip(place.normal()) else {
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

    /// Looks over the humps about a place that is as near to the hand as marching gets.
    fn over_humps(&self, march: &March, here: Place, hand: DVec3) -> Place {
        let lifted = March {
            clearance: march.clearance + self.options.stretch,
            ..*march
        };
        let Some(above) = lifted.onto(here) else {
            return here;
        };
        let (beyond, _) = lifted.toward(hand, above);
        let (there, _) = march.toward(hand, beyond);
        let is_nearer = there.at.distance(hand) < here.at.distance(hand) - march.tolerance;
        if is_nearer { there } else { here }
    }

    /// Lets friction hold the proxy back on its way from `from` to `to`.
    fn held(&mut self, march: &March, from: Place, to: Place, hand: DVec3, coefficient: f64) -> Place {
        let depth = to.at.distance(hand);
        let law = self.options.friction;
        let (at, sticks) = law.follow(coefficient, from.at, to.at, depth, self.sticks);
        self.sticks = sticks;
        match sticks {
            true => from,
            false => march.onto(Place::of(march.obstacle, at)).unwrap_or(to),
        }
    }
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
        let (mut there, is_held) = march.toward(hand.at, here);
        if is_held && self.options.stretch > 0.0 {
            there = self.over_humps(&march, there, hand.at);
        }
        if !is_held {
            return self.drawn(&there, hand);
        }
        let normal = there.normal().unwrap_or(DVec3::ZERO);
        let touch = obstacle.touch(there.at - there.distance * normal);
        let rests = here.distance - march.clearance <= 2.0 * tolerance;
        let place = match touch.friction > 0.0 && rests {
            true => self.held(&march, here, there, hand.at, touch.friction),
            false => {
                self.sticks = false;
                there
            }
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
