//! What devices are called on the command line.

use std::str::FromStr;

use tools::haptics::simulated::Preset;

use super::pid::Scale;
use super::pid::effects::Kind as Effect;
use super::rawhid::variants::{VARIANTS, Variant};

/// Forms of names, and what they name.
pub const FORMS: &[(&str, &str)] = &[
    ("spacemouse", "cap of 3Dconnexion: six axes, no force"),
    (
        "haptikfabriken:ARM[,gravity]",
        "force board, with the arm that is on it",
    ),
    (
        "pid[:spring|:constant][,force=N][,travel=MM]",
        "force device by the HID class for it, with its largest force and half its way",
    ),
    ("script:FILE", "poses over time from a text file"),
    ("sim:DEVICE", "simulated device in a light hand that holds still"),
];

/// A device by name.
#[derive(Clone, Debug, PartialEq)]
pub enum Name {
    /// A cap of 3Dconnexion.
    SpaceMouse,
    /// A force board.
    Board {
        /// The arm on it.
        arm: &'static Variant,
        /// Whether it holds the arm's own weight.
        holds_its_weight: bool,
    },
    /// A force device by the class for it.
    Stick {
        /// How it is to push; None leaves that to what it can.
        kind: Option<Effect>,
        /// Its force and way.
        scale: Scale,
    },
    /// A simulated device.
    Simulated(Preset),
    /// A trajectory.
    Script {
        /// The file.
        file: String,
    },
}

/// Why a text names no device.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NameError {
    /// No device has this name.
    #[error("{name:?} names no device; there are {}", FORMS.iter().map(|(form, _)| *form).collect::<Vec<_>>().join(", "))]
    Unknown {
        /// What was asked for.
        name: String,
    },
    /// The board cannot say which arm it drives.
    #[error("{arm:?} is no arm of a force board; write haptikfabriken: and {}", VARIANTS.map(|v| v.name).join(", "))]
    Arm {
        /// What was asked for.
        arm: String,
    },
    /// No device is simulated under this name.
    #[error("{device:?} is no simulated device; write one of {}", Preset::ALL.map(|p| format!("sim:{}", p.name())).join(", "))]
    Simulated {
        /// What was asked for.
        device: String,
    },
    /// An option that the device has not.
    #[error("{option:?} is no option of {device}; {remedy}")]
    Option {
        /// The device.
        device: &'static str,
        /// What was asked for.
        option: String,
        /// What would be right.
        remedy: &'static str,
    },
}

impl Name {
    /// The largest force of the device, N; None of one that cannot push.
    pub fn force(&self) -> Option<f64> {
        match self {
            Self::Board { arm, .. } => Some(arm.force),
            Self::Stick { scale, .. } => Some(scale.force),
            // What is simulated pushes nobody.
            Self::SpaceMouse | Self::Script { .. } | Self::Simulated(_) => None,
        }
    }
}

impl FromStr for Name {
    type Err = NameError;

    fn from_str(name: &str) -> Result<Self, NameError> {
        let (device, rest) = name.split_once(':').unwrap_or((name, ""));
        match device {
            "spacemouse" if rest.is_empty() => Ok(Self::SpaceMouse),
            "script" if !rest.is_empty() => Ok(Self::Script { file: rest.into() }),
            "haptikfabriken" => board(rest),
            "sim" => Preset::named(rest)
                .map(Self::Simulated)
                .ok_or(NameError::Simulated { device: rest.into() }),
            "pid" => stick(rest),
            _ => Err(NameError::Unknown { name: name.into() }),
        }
    }
}

fn board(rest: &str) -> Result<Name, NameError> {
    let (arm, option) = rest.split_once(',').unwrap_or((rest, ""));
    let arm = Variant::named(arm).ok_or(NameError::Arm { arm: arm.into() })?;
    match option {
        "" | "gravity" => Ok(Name::Board {
            arm,
            holds_its_weight: option == "gravity",
        }),
        _ => Err(NameError::Option {
            device: "haptikfabriken",
            option: option.into(),
            remedy: "write gravity, which holds the arm's own weight, or nothing",
        }),
    }
}

fn stick(rest: &str) -> Result<Name, NameError> {
    let (mut kind, mut scale) = (None, Scale::default());
    for option in rest.split(',').filter(|o| !o.is_empty()) {
        let wrong = || NameError::Option {
            device: "pid",
            option: option.into(),
            remedy: "write spring or constant, force=N up to 100 and travel=MM up to 1000, with commas between",
        };
        let number = |text: &str, most: f64| {
            let value: Option<f64> = text.parse().ok();
            value.filter(|v| *v > 0.0 && *v <= most).ok_or_else(wrong)
        };
        match option.split_once('=') {
            None if option == "constant" => kind = Some(Effect::Constant),
            None if option == "spring" => kind = Some(Effect::Spring),
            Some(("force", text)) => scale.force = number(text, 100.0)?,
            Some(("travel", text)) => scale.travel = number(text, 1000.0)?,
            _ => return Err(wrong()),
        }
    }
    Ok(Name::Stick { kind, scale })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_are_none_say_which_are() {
        for (name, said) in [
            ("", "spacemouse"),
            ("joystick", "pid[:spring|:constant]"),
            ("spacemouse:pro", "spacemouse"),
            ("script:", "script:FILE"),
            ("sim:touch", "sim:omni, sim:phantom"),
            ("haptikfabriken", "woodenhaptics-2019"),
            ("haptikfabriken:polhem-2", "polhem-1"),
            ("haptikfabriken:polhem-1,fast", "write gravity"),
            ("pid:strong", "force=N"),
            ("pid:force=0", "force=N"),
            ("pid:force=1000", "up to 100"),
            ("pid:travel=nan", "travel=MM"),
        ] {
            let why = name.parse::<Name>().unwrap_err().to_string();
            assert!(why.contains(said), "{name}: {why}");
        }
    }

    #[test]
    fn options_are_read() {
        let scale = Scale {
            force: 12.5,
            travel: 80.0,
        };
        let kind = Some(Effect::Constant);
        assert_eq!(
            "pid:constant,force=12.5,travel=80".parse(),
            Ok(Name::Stick { kind, scale })
        );
        let scale = Scale::default();
        assert_eq!("pid".parse(), Ok(Name::Stick { kind: None, scale }));
        let arm: Name = "haptikfabriken:polhem-1,gravity".parse().unwrap();
        assert_eq!(arm.force(), Some(5.0));
        assert_eq!("spacemouse".parse::<Name>().unwrap().force(), None);
        assert_eq!("sim:falcon".parse(), Ok(Name::Simulated(Preset::Falcon)));
        assert_eq!("script:a:b".parse(), Ok(Name::Script { file: "a:b".into() }));
    }
}
