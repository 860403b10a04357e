//! Touch: from the pose of a hand to a force on it, a thousand times a second.
//!
//! Nothing here allocates, locks, waits or does I/O while it ticks; all of it is a pure function of its state and what it is
//! told, so that every scene is a test. An [`Obstacle`] is what may be touched at one moment, an immutable value; a
//! [`Renderer`] turns the pose of a hand into what is felt.
//!
//! Units: millimetres, seconds, newtons, newton-millimetres. Stiffness is given in newtons per metre and damping in newton-seconds per
//! metre, as data sheets give them. Distances are positive in the air and negative in the solid; forces and torques act on the hand.

pub mod controls;
mod coupling;
mod device;
mod feel;
pub mod gates;
mod multi_point;
mod obstacle;
mod probe;
mod proxy;
mod record;
mod servo;
pub mod simulated;
mod snapshot;
mod stroke_force;
mod vcp;
mod work;
mod workspace;

pub use coupling::Coupling;
pub use device::{Abilities, Device, DeviceError, Reading};
pub use feel::{Contact, Felt, Pose, Renderer};
pub use multi_point::{
    MultiPoint, MultiPointError, MultiPointOptions, PointTool, Sampling, Scaled, ToolError,
};
pub use obstacle::{Blend, Obstacle, Together, Touch};
pub use probe::{MatterMap, Probe, ProbeOptions, Probed};
pub use proxy::{Friction, Magnet, Proxy, ProxyOptions};
pub use record::TickRecord;
pub use servo::{Servo, ServoError, ServoOptions, Tick};
pub use snapshot::{
    BrickOptions, Demand, DistanceBrick, FieldObstacle, Interpolation, Moving, Part, Snapshot, SnapshotMaker,
    Surface, TouchMap, TouchedObject, Unresolved,
};
pub use stroke_force::{StrokeForce, StrokeForceOptions, StrokeStep, newtons_per_unit};
pub use vcp::{Vcp, VcpOptions};
pub use work::{Embedding, Viscous};
pub use workspace::Workspace;
