//! One tick of touch: from what a device tells to what it is to do.

use glam::DVec3;

use super::gates::{Ceiling, GateError, GateOptions, Gates, Granted, Stage, Status, Trip, Wrench};
use super::{
    Abilities, Contact, DeviceError, Felt, Obstacle, Pose, Reading, Renderer, StrokeForce,
    StrokeForceOptions, StrokeStep, TickRecord, Workspace,
};

/// Largest scale of a workspace: beyond, nodes half a millimetre apart could not be numbered in 32 bits.
const MOST_SCALE: f64 = 1e6;

/// What a servo is set to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoOptions {
    /// Stiffness of the coupling at the hand, N/m, as it is wished: what the device holds of it is [`Servo::granted`].
    pub stiffness: f64,
    /// Damping of the coupling at the hand, N s/m; at most half of the damping of device and hand.
    pub damping: f64,
    /// Damping that the hand is counted on for, N s/m. A hand that holds a device loosely has 4, a firm one 8; none lets go of it
    /// while it is pushed.
    pub hand_damping: f64,
    /// Friction of the device, N, where known.
    pub friction: Option<f64>,
    /// Whether the ceiling of stiffness counts. Without it devices tremble; for tests that show it.
    pub is_bound: bool,
    /// Time from tick to tick, s, on the mean.
    pub period: f64,
    /// Where the room of the device lies in the scene.
    pub workspace: Workspace,
    /// The gates.
    pub gates: GateOptions,
}

impl Default for ServoOptions {
    fn default() -> Self {
        Self {
            stiffness: 500.0,
            damping: 0.0,
            hand_damping: 1.0,
            friction: None,
            is_bound: true,
            period: 1e-3,
            workspace: Workspace::default(),
            gates: GateOptions::default(),
        }
    }
}

/// Why there is no servo of these settings.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ServoError {
    /// A setting makes no sense.
    #[error(transparent)]
    Setting(#[from] GateError),
    /// Nothing damps.
    #[error(
        "the device holds no stiffness: it has a damping of {device} N s/m, the hand of {hand}; count on a hand with more"
    )]
    NoStiffness {
        /// N s/m.
        device: f64,
        /// N s/m.
        hand: f64,
    },
}

/// What a tick came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// What the device is to do, in its own axes.
    pub wrench: Wrench,
    /// What the renderer made of it, in the scene.
    pub felt: Felt,
    /// To be kept.
    pub record: TickRecord,
}

/// Workspace, renderer and gates of one device: a state machine that neither waits nor allocates.
pub struct Servo {
    workspace: Workspace,
    renderer: Box<dyn Renderer>,
    stroke: StrokeForce,
    /// Of the stroke that is at work now.
    pulled: Option<StrokeStep>,
    /// Whether that stroke was lost hold of.
    has_slipped: bool,
    gates: Gates,
    granted: Granted,
    last: Felt,
    hand: Pose,
    buttons: u32,
    ticks: u64,
}

impl Servo {
    /// A servo for a device. `make` makes the renderer for stiffness, N/m, and damping, N s/m, of its coupling in the scene, which
    /// are those at the hand over the workspace's scale.
    ///
    /// # Errors
    /// [`ServoError`].
    pub fn new(
        abilities: &Abilities,
        options: ServoOptions,
        make: impl FnOnce(f64, f64) -> Box<dyn Renderer>,
    ) -> Result<Self, ServoError> {
        check(&options)?;
        let granted = granted(abilities, &options);
        if granted.stiffness <= 0.0 {
            return Err(ServoError::NoStiffness {
                device: abilities.damping,
                hand: options.hand_damping,
            });
        }
        let scale = options.workspace.scale;
        let nowhere = Pose::at(options.workspace.shift);
        Ok(Self {
            workspace: options.workspace,
            stroke: StrokeForce::new(StrokeForceOptions {
                stiffness: granted.stiffness / scale,
                ..StrokeForceOptions::of_scale(1.0)
            }),
            pulled: None,
            has_slipped: false,
            renderer: make(granted.stiffness / scale, granted.damping / scale),
            gates: Gates::new(abilities, granted.stiffness, options.gates)?,
            granted,
            last: Felt::nothing(&nowhere),
            hand: nowhere,
            buttons: 0,
            ticks: 0,
        })
    }

    /// One tick, `dt` seconds after the last one. `heartbeat` is the time since the simulation was last alive, s: not since the
    /// obstacle last changed.
    pub fn tick(
        &mut self,
        told: Result<&Reading, &DeviceError>,
        obstacle: &dyn Obstacle,
        heartbeat: f64,
        dt: f64,
    ) -> Tick {
        self.ticks += 1;
        let (felt, wished, wrench) = match self.gates.admit(told, dt) {
            None => {
                self.gates.shut();
                let nothing = Felt {
                    force: DVec3::ZERO,
                    torque: DVec3::ZERO,
                    ..self.last
                };
                (nothing, Wrench::ZERO, Wrench::ZERO)
            }
            Some(reading) => {
                self.buttons = reading.buttons;
                self.hand = self.workspace.scene_from_device(&reading.pose);
                let felt = self.feel(obstacle, dt);
                let wished = self.workspace.device_from_scene(Wrench {
                    force: felt.force,
                    torque: felt.torque,
                });
                let sent = self.gates.pass(wished, felt.contact, heartbeat, dt);
                if self.gates.is_faded() {
                    self.lose_hold();
                }
                (felt, wished, sent)
            }
        };
        self.last = felt;
        Tick {
            wrench,
            felt,
            record: TickRecord {
                tick: self.ticks,
                status: self.gates.status(),
                buttons: self.buttons,
                hand: self.hand.at.as_vec3().to_array(),
                proxy: felt.proxy.at.as_vec3().to_array(),
                force: wrench.force.as_vec3().to_array(),
                wished: felt.force.length() as f32,
                energy: self.gates.energy() as f32,
                dt: dt as f32,
                torque: wished.torque.as_vec3().to_array(),
                torque_sent: wrench.torque.length() as f32,
            },
        }
    }

    /// Tells what a force tool in the hand did in the last step of the simulation, in newtons and millimetres of the scene; none when
    /// it has let go. While it pulls, that is felt in place of contact: the hand is where it pulls to, in the solid or out of it.
    pub fn pull(&mut self, step: Option<StrokeStep>) {
        self.has_slipped &= step.is_some();
        self.pulled = step.filter(|_| !self.has_slipped);
    }

    /// Forgets the contact and the stroke. Where the hand went while it felt nothing cost it no work: a spring from where the contact was
    /// would give it energy.
    fn lose_hold(&mut self) {
        self.has_slipped = self.pulled.take().is_some() || self.has_slipped;
        self.stroke.reset();
        self.renderer.reset();
    }

    /// What the hand feels: the stroke that pulls, or else contact, which begins anew after one.
    fn feel(&mut self, obstacle: &dyn Obstacle, dt: f64) -> Felt {
        if self.pulled.is_none() && self.stroke.is_at_rest() {
            return self.renderer.tick(obstacle, &self.hand, dt);
        }
        self.renderer.reset();
        Felt {
            force: self.stroke.tick(self.pulled.as_ref(), self.hand.at, dt),
            contact: Contact::Pulls,
            ..Felt::nothing(&self.hand)
        }
    }

    /// The user wants force, see [`Gates::arm`]. A contact that there was is forgotten.
    pub fn arm(&mut self) {
        self.gates.arm();
        self.renderer.reset();
        self.stroke.reset();
    }

    /// The user wants no force.
    pub fn disarm(&mut self) {
        self.gates.disarm();
    }

    /// Takes all force away until [`arm`](Self::arm): for a device that does not take what is sent.
    pub fn trip(&mut self, why: Trip) {
        self.gates.trip(why);
    }

    /// How far on its way to giving force it is.
    pub fn stage(&self) -> Stage {
        self.gates.stage()
    }

    /// What happened in the last tick.
    pub fn status(&self) -> Status {
        self.gates.status()
    }

    /// What the device holds of the stiffness that was wished.
    pub fn granted(&self) -> Granted {
        self.granted
    }

    /// Its gates.
    pub fn gates(&self) -> &Gates {
        &self.gates
    }

    /// Where the hand was last, in the scene.
    pub fn hand(&self) -> Pose {
        self.hand
    }

    /// Where the room of the device lies.
    pub fn workspace(&self) -> &Workspace {
        &self.workspace
    }
}

/// Refuses what makes no sense; the gates look at their own.
fn check(options: &ServoOptions) -> Result<(), GateError> {
    let above = [
        ("the stiffness of the coupling", options.stiffness),
        ("the period of the servo", options.period),
        ("the scale of the workspace", options.workspace.scale),
    ];
    let not_below = [
        ("the damping of the coupling", options.damping),
        ("the damping of the hand", options.hand_damping),
        ("the friction of the device", options.friction.unwrap_or(0.0)),
    ];
    for (what, value) in above {
        if !value.is_finite() || value <= 0.0 {
            let must = "above 0";
            return Err(GateError { what, value, must });
        }
    }
    if options.workspace.scale > MOST_SCALE {
        return Err(GateError {
            what: "the scale of the workspace",
            value: options.workspace.scale,
            must: "1e6 at most",
        });
    }
    for (what, value) in not_below {
        if !value.is_finite() || value < 0.0 {
            let must = "0 or above";
            return Err(GateError { what, value, must });
        }
    }
    Ok(())
}

/// What the device holds of what is wished.
fn granted(abilities: &Abilities, options: &ServoOptions) -> Granted {
    // The coupling's own damping comes late too; what is left of the others' holds its stiffness.
    let damping = match options.is_bound {
        true => options
            .damping
            .min(0.5 * (abilities.damping + options.hand_damping)),
        false => options.damping,
    };
    let ceiling = Ceiling::new(
        abilities,
        options.period,
        options.hand_damping,
        damping,
        options.friction,
    );
    // Who gives no force cannot tremble.
    let stiffness = match options.is_bound && abilities.force > 0.0 {
        true => options.stiffness.min(ceiling.stiffness()),
        false => options.stiffness,
    };
    Granted {
        wished: options.stiffness,
        stiffness,
        damping,
        ceiling,
    }
}

#[cfg(test)]
mod tests;
