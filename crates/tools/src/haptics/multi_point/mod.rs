//! Tools that touch with many points and turn: a god-object of six degrees of freedom \[Sensable99; Zilles94, Ortega07\].
//!
//! The proxy is a pose of the tool. It goes where `½K|x − x_h|² + ½K_θ|θ|²` is least, θ the turn from hand to proxy, among
//! the poses that keep all points out of the solid: `φ(x + R qᵢ) ≥ ρ`, ρ the radius of a point's ball. A step linearises
//! these conditions and goes to the nearest point of the polyhedron they make ([`projection`]); what a step finds violated
//! joins the polyhedron, and no point near the surface goes further between two looks than the solid is thin ([`march`]). At
//! rest the springs balance the contacts, so the torque is `Σ rᵢ × fᵢ`.
//!
//! The source tells four cases apart (free; plane; edge; hole) and gives each its rule: cross products of the two deepest
//! normals at edges, averages at convex ones, pushes along normals in holes. A polyhedron of all points has the cases as its
//! numbers of active rows, 0 to 6, and no rule to choose wrongly.

mod carved;
mod extraction;
mod features;
mod friction;
mod march;
mod options;
mod places;
mod projection;
mod random;
mod scaled;
mod shape;
mod slide;
#[cfg(test)]
mod tests;
mod tool;
mod turn;

use glam::{DMat3, DVec3};

pub use options::{MultiPointError, MultiPointOptions};
pub use scaled::Scaled;
pub use tool::{PointTool, Sampling, ToolError};

use super::coupling::{Coupling, Stretching, pressing};
use super::{Contact, Felt, Obstacle, Pose, Renderer};
use features::Features;
use friction::{Meeting, Pressings};
use places::Places;
use projection::Polyhedron;
use random::Random;
use turn::logarithm;

/// Longest time of a tick that counts, s.
const LONGEST: f64 = 0.1;

/// A tool of many points that the solid keeps out.
#[derive(Clone, Debug)]
pub struct MultiPoint {
    tool: PointTool,
    options: MultiPointOptions,
    /// Turns times this are ways: √(K_θ/K), mm.
    lever: f64,
    /// Where the tool is; where the hand is while that is inside and before the first tick.
    pose: Pose,
    /// Whether the tool was clear of the solid since it began.
    is_clear: bool,
    /// Whether solid has grown over it so that no point of it knows the way out.
    is_buried: bool,
    /// Its points, and those between them that touch.
    places: Places,
    features: Features,
    rows: Polyhedron,
    /// Where each row comes from.
    meetings: Vec<Meeting>,
    pressings: Pressings,
    /// Step that this tick can take near the surface, mm.
    reach: f64,
    /// Way by which the tool may still be pushed out in this tick, mm.
    push_left: f64,
    /// Share of the way to the goal that is tried.
    share: f64,
    random: Random,
    /// Ticks since the points were turned, with `turn_every`.
    held_for: u32,
    stretching: Stretching,
    turning: Stretching,
    /// What was told last.
    force: DVec3,
    torque: DVec3,
}

impl MultiPoint {
    /// A tool that has not been anywhere yet. All memory is taken here.
    ///
    /// # Errors
    /// [`MultiPointError`] of an option that makes no sense.
    pub fn new(tool: PointTool, options: MultiPointOptions) -> Result<Self, MultiPointError> {
        options.check()?;
        let places = Places::new(&tool);
        let most_rows = places.len() * (2 + march::CUTS);
        Ok(Self {
            lever: (options.angular_stiffness / (1e-3 * options.coupling.stiffness)).sqrt(),
            pose: Pose::at(DVec3::ZERO),
            is_clear: false,
            is_buried: false,
            rows: Polyhedron::with_capacity(most_rows),
            meetings: Vec::with_capacity(most_rows),
            pressings: Pressings::default(),
            features: Features::new(&tool),
            places,
            reach: options.step,
            push_left: 0.0,
            share: 1.0,
            random: Random::new(options.seed),
            held_for: 0,
            stretching: Stretching::default(),
            turning: Stretching::default(),
            force: DVec3::ZERO,
            torque: DVec3::ZERO,
            tool,
            options,
        })
    }

    /// What touches.
    pub fn tool(&self) -> &PointTool {
        &self.tool
    }

    /// Moves the handle point in the tool; the tool stays where it is. The hand's next pose is that of the new handle point.
    pub fn set_handle(&mut self, handle: DVec3) {
        self.pose.at += self.pose.turn * (handle - self.tool.handle);
        self.tool.handle = handle;
    }

    /// Whether a hand at a pose has the tool clear of the solid; sets the tool there if so.
    fn begin(&mut self, obstacle: &dyn Obstacle, hand: &Pose) -> bool {
        self.pose = *hand;
        self.places.turn = DMat3::from_quat(hand.turn);
        self.held_for = 0;
        self.places.look(&self.tool, obstacle, hand);
        self.is_clear = self.places.deepest().0 >= -self.options.tolerance && self.is_clear_between(obstacle);
        self.is_clear
    }

    /// What the springs from hand to proxy press with.
    fn springs(&mut self, hand: &Pose, dt: f64) -> (DVec3, DVec3) {
        let stretch = self.pose.at - hand.at;
        let turn = logarithm(self.pose.turn * hand.turn.inverse());
        let (speed, spin) = (self.stretching.of(stretch, dt), self.turning.of(turn, dt));
        let Coupling { stiffness, damping } = self.options.coupling;
        let force = pressing(stretch, 1e-3 * stiffness, damping, speed);
        // `pressing` takes N s/m.
        let damping = 1e3 * self.options.angular_damping;
        let torque = pressing(turn, self.options.angular_stiffness, damping, spin);
        let (soft, slack) = self.pressings.softness(1e-3 * stiffness);
        (force - soft, torque - slack)
    }
}

/// From one vector towards another, no further than a length.
fn towards(from: DVec3, to: DVec3, most: f64) -> DVec3 {
    let way = to - from;
    let length = way.length();
    if length > most {
        from + way * (most / length)
    } else {
        to
    }
}

impl Renderer for MultiPoint {
    fn tick(&mut self, obstacle: &dyn Obstacle, hand: &Pose, dt: f64) -> Felt {
        let dt = if dt > 0.0 { dt.min(LONGEST) } else { 1e-3 };
        if !self.is_clear {
            let contact = if self.begin(obstacle, hand) {
                Contact::Free
            } else {
                Contact::Inside
            };
            return Felt {
                contact,
                ..Felt::nothing(hand)
            };
        }
        self.march(obstacle, hand, dt);
        let (force, torque) = self.springs(hand, dt);
        self.force = towards(self.force, force, self.options.slew);
        self.torque = towards(self.torque, torque, self.options.torque_slew);
        let is_touching = self.places.deepest().0 <= 2.0 * self.options.tolerance;
        if !is_touching {
            self.stretching.end();
            self.turning.end();
        }
        Felt {
            force: self.force,
            torque: self.torque,
            proxy: self.pose,
            contact: match is_touching {
                true if self.pressings.sticks() => Contact::Sticks,
                true => Contact::Slides,
                false => Contact::Free,
            },
        }
    }

    fn reset(&mut self) {
        self.is_clear = false;
        self.is_buried = false;
        self.reach = self.options.step;
        self.places.forget();
        self.pressings.clear();
        self.features.forget();
        self.stretching.end();
        self.turning.end();
        self.force = DVec3::ZERO;
        self.torque = DVec3::ZERO;
    }
}
