//! A device, a hand and a world in virtual time: every scene of touch is a computation that gives the same bits each time.
//!
//! A [`SimulatedDevice`] is a mass with damping, dry friction, an encoder and an amplifier, and a [`SimulatedHand`] holds it. A
//! [`Rig`] ticks a [`Drive`] against it while a [`World`] changes at the rate of a simulation, and records a [`Trace`];
//! [`Measures`] are what criteria of stability are stated in.

mod device;
mod drive;
mod fault;
mod hand;
mod led;
mod measures;
mod mechanics;
mod path;
mod rig;
mod solids;
mod trace;
mod world;

pub use device::SimulatedDevice;
pub use drive::{Bare, Drive};
pub use fault::{Fault, FaultKind};
pub use hand::{Grip, SimulatedHand};
pub use led::led;
pub use measures::{Limits, Measures};
pub use mechanics::{Mechanics, Preset};
pub use path::Path;
pub use rig::{Rig, Timing};
pub use solids::{Ball, Bumps, Channel, Edge, Groove, HalfSpace, Passage, Rod, Rubbing, Sheet};
pub use trace::{Tick, Trace};
pub use world::{Change, World};
