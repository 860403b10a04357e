//! What devices are made of.

use super::super::Abilities;

/// A device as a body: a mass that slides in three directions.
#[derive(Clone, Debug, PartialEq)]
pub struct Mechanics {
    /// Name for people.
    pub name: String,
    /// Mass that the hand feels, kg.
    pub mass: f64,
    /// Viscous damping, N s/m.
    pub damping: f64,
    /// Dry friction, N.
    pub friction: f64,
    /// One count of the encoder, mm; 0 for one that tells exactly.
    pub quantum: f64,
    /// Largest force, N.
    pub force: f64,
    /// Force that it holds for ever, N; 0 if unknown.
    pub continuous_force: f64,
    /// Largest torque, N mm. Turns are scripted: torque is told, not felt.
    pub torque: f64,
    /// Largest stiffness that its makers allow, N/m; infinite if unknown.
    pub stiffness: f64,
    /// Half the width of the room in which it moves, mm.
    pub reach: f64,
    /// Time from sending a force to its acting, s.
    pub delay: f64,
    /// Time between two readings, s.
    pub period: f64,
    /// Time without a force sent after which it lets go, s.
    pub watchdog: f64,
}

/// Devices that scenes are told on.
///
/// Forces, counts and stiffnesses are those of data sheets and drivers; damping and friction are assumed where no sheet gives
/// them, on the low side: a device with less loses stability earlier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// Neither friction nor counts, for formulas.
    Ideal,
    /// A light pen-shaped arm of 3.3 N.
    Omni,
    /// An arm of 8.5 N with next to no damping.
    Phantom,
    /// Three parallel legs, 8.9 N.
    Falcon,
    /// A capstan arm of 5 N.
    Wooden,
}

impl Preset {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Ideal, Self::Omni, Self::Phantom, Self::Falcon, Self::Wooden];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ideal => "ideal",
            Self::Omni => "omni",
            Self::Phantom => "phantom",
            Self::Falcon => "falcon",
            Self::Wooden => "wooden",
        }
    }

    /// The one of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|p| p.name() == name)
    }

    /// What it is made of, ticking at 1 kHz without delay.
    pub fn mechanics(self) -> Mechanics {
        let of = |mass, damping, friction, quantum, force, continuous_force, stiffness, reach| Mechanics {
            name: self.name().into(),
            mass,
            damping,
            friction,
            quantum,
            force,
            continuous_force,
            torque: 0.0,
            stiffness,
            reach,
            delay: 0.0,
            period: 1e-3,
            watchdog: 0.5,
        };
        match self {
            Self::Ideal => of(0.045, 0.8, 0.0, 0.0, 10.0, 0.0, f64::INFINITY, 100.0),
            Self::Omni => of(0.045, 0.5, 0.1, 0.055, 3.3, 0.88, 700.0, 60.0),
            Self::Phantom => of(0.072, 0.005, 0.038, 0.03, 8.5, 0.0, 800.0, 130.0),
            Self::Falcon => of(0.25, 1.0, 0.5, 0.06, 8.9, 0.0, 3000.0, 50.0),
            Self::Wooden => of(0.15, 0.5, 0.3, 0.054, 5.0, 0.0, 1000.0, 100.0),
        }
    }
}

impl Mechanics {
    /// What the device says that it can do.
    pub fn abilities(&self) -> Abilities {
        Abilities {
            name: format!("simulated {}", self.name),
            force: self.force,
            continuous_force: self.continuous_force,
            torque: self.torque,
            damping: self.damping,
            stiffness: self.stiffness,
            resolution: self.quantum,
            period: self.period,
            delay: self.delay,
            reach: self.reach,
        }
    }

    /// Stiffness, N/m, above which a wall feeds an oscillation when a hand of some damping, N s/m, holds the device: a spring
    /// that is felt T/2 + t_d late is a damper of −K (T/2 + t_d) \[Colgate97\].
    pub fn stable_stiffness(&self, hand_damping: f64) -> f64 {
        (self.damping + hand_damping) / (0.5 * self.period + self.delay)
    }
}
