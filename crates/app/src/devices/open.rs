//! Devices by name.

use std::path::PathBuf;
use std::sync::Arc;

use glam::DVec3;
use tools::haptics::simulated::{Path, Preset, SimulatedDevice, SimulatedHand};
use tools::haptics::{Abilities, Device, DeviceError, Reading};

use super::clock::Clock;
use super::find::{Found, Kind, find};
use super::hid::Hid;
use super::link::{Compose, Counts, Link, Linked, Model, Order, Out, Reader, Writer};
use super::name::{Name, NameError};
use super::pid;
use super::pid::descriptor::Descriptor;
use super::pid::effects::{self, Kind as Effect};
use super::pid::layout::Layout;
use super::pid::{Effects, Scale, Stick};
use super::rawhid::variants::Variant;
use super::rawhid::{self, Arm, Board};
use super::report::Parse;
use super::scripted::{ScriptError, Scripted, Trajectory};
use super::spacemouse::{self, Light, Rate, SpaceMouse};
use super::transport::{Identity, TransportError};

/// Whether a device may push.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Force {
    /// It may.
    Allowed,
    /// It only tells where it is: its motors stay off.
    Withheld,
}

/// Why a device was not opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// No device has this name.
    #[error(transparent)]
    Name(#[from] NameError),
    /// It is not there.
    #[error("no {what} is plugged in{}; plug one in and see `isoclay devices`", besides(.found))]
    Absent {
        /// What was looked for.
        what: &'static str,
        /// What was found.
        found: Vec<String>,
    },
    /// On the way.
    #[error("{device}: {error}")]
    Transport {
        /// Which.
        device: String,
        /// Why.
        error: TransportError,
    },
    /// Its descriptor is of no use.
    #[error("{device} cannot push: {why}; it may be used without force by another program only")]
    Unfit {
        /// Which.
        device: String,
        /// Why.
        why: String,
    },
    /// It made no effect.
    #[error("{device} does not take effects: {why}")]
    Effect {
        /// Which.
        device: String,
        /// Why.
        why: effects::CreateError,
    },
    /// The trajectory is none.
    #[error("{file}: {why}")]
    Script {
        /// Which.
        file: String,
        /// Why.
        why: ScriptError,
    },
    /// The trajectory cannot be read.
    #[error("{file} cannot be read ({why}); check the path")]
    File {
        /// Which.
        file: String,
        /// Why.
        why: std::io::Error,
    },
    /// As the device says.
    #[error(transparent)]
    Device(#[from] DeviceError),
}

fn besides(found: &[String]) -> String {
    match found {
        [] => String::new(),
        some => format!(" (but {})", some.join(", ")),
    }
}

/// A device that is open.
pub enum Opened {
    /// One that is plugged in.
    Linked(Linked),
    /// A trajectory.
    Scripted(Scripted),
    /// A simulated one.
    Simulated(Box<SimulatedDevice>),
}

impl Opened {
    fn device(&self) -> &dyn Device {
        match self {
            Self::Linked(device) => device,
            Self::Scripted(device) => device,
            Self::Simulated(device) => &**device,
        }
    }

    fn device_mut(&mut self) -> &mut dyn Device {
        match self {
            Self::Linked(device) => device,
            Self::Scripted(device) => device,
            Self::Simulated(device) => &mut **device,
        }
    }

    /// Reports so far.
    pub fn counts(&self) -> Counts {
        match self {
            Self::Linked(device) => device.counts(),
            Self::Scripted(_) | Self::Simulated(_) => Counts::default(),
        }
    }
}

impl Device for Opened {
    fn abilities(&self) -> &Abilities {
        self.device().abilities()
    }

    fn read(&mut self) -> Result<Reading, DeviceError> {
        self.device_mut().read()
    }

    fn send(&mut self, force: DVec3, torque: DVec3) -> Result<(), DeviceError> {
        self.device_mut().send(force, torque)
    }
}

fn simulated(preset: Preset) -> SimulatedDevice {
    let hand = SimulatedHand::light(Path::still(DVec3::ZERO));
    SimulatedDevice::new(preset.mechanics(), hand)
        .self_timed()
        .fading()
}

fn script(file: &str) -> Result<Scripted, OpenError> {
    let text = std::fs::read_to_string(PathBuf::from(file)).map_err(|why| OpenError::File {
        file: file.into(),
        why,
    })?;
    let trajectory = Trajectory::parse(&text).map_err(|why| OpenError::Script {
        file: file.into(),
        why,
    })?;
    Ok(Scripted::new(trajectory, Clock::real()))
}

/// Opens a device.
///
/// # Errors
/// [`OpenError`].
pub fn open(name: &Name, force: Force) -> Result<Opened, OpenError> {
    match name {
        Name::SpaceMouse => cap().map(Opened::Linked),
        Name::Board {
            arm,
            holds_its_weight,
        } => board(arm, *holds_its_weight, force).map(Opened::Linked),
        Name::Stick { kind, scale } => stick(*kind, *scale, force).map(Opened::Linked),
        Name::Script { file } => script(file).map(Opened::Scripted),
        Name::Simulated(preset) => Ok(Opened::Simulated(Box::new(simulated(*preset)))),
    }
}

/// The first device of a kind.
fn first(what: &'static str, is_one: impl Fn(&Kind) -> bool) -> Result<Found, OpenError> {
    let all = find().map_err(|error| OpenError::Transport {
        device: what.into(),
        error,
    })?;
    let found = all.devices.iter().map(|d| d.identity.name.clone()).collect();
    let one = all.devices.into_iter().find(|d| is_one(&d.kind));
    one.ok_or(OpenError::Absent { what, found })
}

fn cap() -> Result<Linked, OpenError> {
    let found = first("SpaceMouse", |kind| matches!(kind, Kind::SpaceMouse(_)))?;
    let name = match &found.kind {
        Kind::SpaceMouse(name) => name,
        _ => "SpaceMouse",
    };
    let ends = Ends::open(&found.identity)?;
    let parser = spacemouse::reports::Reports::default();
    ends.link(
        SpaceMouse::new(name, Rate::default()),
        parser,
        Light::default(),
        None,
    )
}

fn board(variant: &'static Variant, holds_its_weight: bool, force: Force) -> Result<Linked, OpenError> {
    let found = first("force board of Haptikfabriken", |kind| *kind == Kind::Board)?;
    let ends = Ends::open(&found.identity)?;
    let arm = Arm::new(variant, holds_its_weight);
    let board = Board::new(variant, force == Force::Allowed);
    ends.link(arm, rawhid::report::Reports::default(), board, None)
}

fn stick(kind: Option<Effect>, scale: Scale, force: Force) -> Result<Linked, OpenError> {
    let found = first("force device", |kind| *kind == Kind::Pid)?;
    let name = match found.identity.name.as_str() {
        "" => "force device",
        name => name,
    };
    let mut ends = Ends::open(&found.identity)?;
    let unfit = |why: String| OpenError::Unfit {
        device: name.into(),
        why,
    };
    let bytes = ends.writing.descriptor().map_err(|error| OpenError::Transport {
        device: name.into(),
        error,
    })?;
    let descriptor = Descriptor::parse(&bytes).map_err(|e| unfit(e.to_string()))?;
    let layout = Layout::of(descriptor).map_err(|e| unfit(e.to_string()))?;
    // A spring is the better one where there is a choice.
    let has_spring = layout.condition.is_some() && layout.effect.spring.is_some();
    let kind = kind.unwrap_or(if has_spring {
        Effect::Spring
    } else {
        Effect::Constant
    });
    let model = Stick::new(name, &layout, kind, scale);
    let parser = pid::input::Reports::new(layout.input.clone());
    let asks = layout.input.axes[0].map(|slot| slot.report);
    match force {
        Force::Withheld => ends.link(model, parser, Silent, asks),
        Force::Allowed => {
            let effects =
                Effects::begin(layout, kind, &mut ends.writing).map_err(|why| OpenError::Effect {
                    device: name.into(),
                    why,
                })?;
            ends.link(model, parser, effects, asks)
        }
    }
}

/// Writes nothing.
struct Silent;

impl Compose for Silent {
    fn write(&mut self, _order: &Order, _now: f64, _out: &mut Out) -> Result<(), TransportError> {
        Ok(())
    }

    fn leave(&mut self, _out: &mut Out) {}
}

/// Two handles of a device: one to read and one to write.
struct Ends {
    reading: Hid,
    writing: Hid,
}

impl Ends {
    fn open(identity: &Identity) -> Result<Self, OpenError> {
        let open = || {
            Hid::open(identity).map_err(|error| OpenError::Transport {
                device: identity.name.clone(),
                error,
            })
        };
        Ok(Self {
            reading: open()?,
            writing: open()?,
        })
    }

    fn link(
        self,
        model: impl Model + 'static,
        parser: impl Parse + 'static,
        composer: impl Compose + 'static,
        asks: Option<u8>,
    ) -> Result<Linked, OpenError> {
        let (clock, link) = (Clock::real(), Arc::<Link>::default());
        let (parser, composer): (Box<dyn Parse>, Box<dyn Compose>) = (Box::new(parser), Box::new(composer));
        let period = model.abilities().period;
        let reader = Reader::new(Box::new(self.reading), parser, link.clone(), clock.clone());
        let reader = match asks {
            Some(report) => reader.asking(report),
            None => reader,
        };
        let writer = Writer::new(
            Box::new(self.writing),
            composer,
            link.clone(),
            clock.clone(),
            period,
        );
        Ok(Linked::new(Box::new(model), link, clock).begin(reader, writer)?)
    }
}
