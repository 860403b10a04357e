//! A hand that follows a path through a device.

use glam::{DQuat, DVec3};

use super::Path;

/// How a hand holds a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Grip {
    /// It does not: a constant force, N, acts, and no damping hides what the loop does.
    Push(DVec3),
    /// A spring, N/m, and a damper, N s/m, to where the hand wants to be.
    Holds {
        /// N/m.
        stiffness: f64,
        /// N s/m.
        damping: f64,
    },
}

/// Whose force moves the device.
#[derive(Clone, Debug)]
pub struct SimulatedHand {
    /// How it holds.
    pub grip: Grip,
    /// Where it wants to be.
    pub path: Path,
    /// Its largest force, N.
    pub strength: f64,
    turns: Vec<(f64, DQuat)>,
    buttons: Vec<(f64, u32)>,
}

impl SimulatedHand {
    /// No hand: a push, N, that begins at a place.
    pub fn none(start: DVec3, push: DVec3) -> Self {
        Self::of(Grip::Push(push), Path::still(start))
    }

    /// Fingers: 300 N/m, 4 N s/m.
    pub fn light(path: Path) -> Self {
        Self::holding(300.0, 4.0, path)
    }

    /// A fist: 400 N/m, 8 N s/m.
    pub fn firm(path: Path) -> Self {
        Self::holding(400.0, 8.0, path)
    }

    /// A spring, N/m, and a damper, N s/m.
    pub fn holding(stiffness: f64, damping: f64, path: Path) -> Self {
        Self::of(Grip::Holds { stiffness, damping }, path)
    }

    fn of(grip: Grip, path: Path) -> Self {
        Self {
            grip,
            path,
            strength: f64::INFINITY,
            turns: Vec::new(),
            buttons: Vec::new(),
        }
    }

    /// Of at most some force, N.
    #[must_use]
    pub fn of_strength(mut self, strength: f64) -> Self {
        self.strength = strength;
        self
    }

    /// With turns at times, the shorter way between them.
    #[must_use]
    pub fn turning(mut self, turns: impl IntoIterator<Item = (f64, DQuat)>) -> Self {
        self.turns = turns.into_iter().collect();
        self
    }

    /// With buttons that are down from times on.
    #[must_use]
    pub fn pressing(mut self, buttons: impl IntoIterator<Item = (f64, u32)>) -> Self {
        self.buttons = buttons.into_iter().collect();
        self
    }

    /// Turn at a time.
    pub fn turn(&self, time: f64) -> DQuat {
        let next = self.turns.partition_point(|t| t.0 <= time);
        match (next.checked_sub(1).map(|i| self.turns[i]), self.turns.get(next)) {
            (Some((t0, q0)), Some(&(t1, q1))) => q0.lerp(q1, (time - t0) / (t1 - t0)),
            (Some((_, q)), None) | (None, Some(&(_, q))) => q,
            (None, None) => DQuat::IDENTITY,
        }
    }

    /// Buttons that are down at a time.
    pub fn buttons(&self, time: f64) -> u32 {
        let next = self.buttons.partition_point(|b| b.0 <= time);
        next.checked_sub(1).map_or(0, |i| self.buttons[i].1)
    }

    /// Force on the device, N, that does not depend on its speed, and damping, N s/m, that is not in it.
    pub(super) fn force(&self, time: f64, at: DVec3, speed: DVec3) -> (DVec3, f64) {
        match self.grip {
            Grip::Push(push) => (push, 0.0),
            Grip::Holds { stiffness, damping } => {
                let (target, target_speed) = self.path.at(time);
                let drawn = (stiffness * (target - at) + damping * target_speed) * 1e-3;
                let whole = drawn - damping * speed;
                let size = whole.length();
                if size > self.strength {
                    (whole * (self.strength / size), 0.0)
                } else {
                    (drawn, damping)
                }
            }
        }
    }
}
