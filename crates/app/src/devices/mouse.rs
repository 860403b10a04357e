//! The mouse as a device: the window says where the tool is to be, and which button is down.
//!
//! A window feeds the one half and the haptic thread asks the other. Pointers jump sixty times a second, so a short lag makes a way
//! of their steps. There is no force: what would be felt is seen.

use std::sync::Arc;

use glam::{DQuat, DVec3};
use tools::haptics::{Abilities, Device, DeviceError, Pose, Reading};

use super::clock::Clock;
use super::forceless;
use super::lag::{Lag, Ticks};
use super::mailbox::Mailbox;

/// Time of the lag, s: two pictures at sixty a second hold 95 % of a step.
const LAG: f64 = 0.012;
/// Way of a pixel, mm, about.
const PIXEL: f64 = 0.1;
/// Half the width of its room, mm.
const REACH: f64 = 100.0;

/// The half of the window.
#[derive(Debug)]
pub struct Mouse {
    at: DVec3,
    buttons: u32,
    told: Arc<Mailbox<4>>,
}

/// The half of the haptic thread.
pub struct Pointer {
    abilities: Abilities,
    told: Arc<Mailbox<4>>,
    clock: Clock,
    ticks: Ticks,
    lag: Lag,
    reading: Option<(DVec3, u32)>,
}

/// Both halves of a mouse. It tells nothing before it is first somewhere.
pub fn mouse() -> (Mouse, Pointer) {
    pair(Clock::real())
}

fn pair(clock: Clock) -> (Mouse, Pointer) {
    let told = Arc::<Mailbox<4>>::default();
    let mouse = Mouse {
        at: DVec3::ZERO,
        buttons: 0,
        told: told.clone(),
    };
    let pointer = Pointer {
        abilities: forceless::abilities("mouse", PIXEL, 1.0 / 60.0, REACH),
        told,
        clock,
        ticks: Ticks::default(),
        lag: Lag::at(DVec3::ZERO, LAG),
        reading: None,
    };
    (mouse, pointer)
}

impl Mouse {
    /// The tool is to be at a place of its room, mm, and its button is down or not. Places beyond the room are at its side.
    pub fn put(&mut self, at: DVec3, is_down: bool) {
        if at.is_finite() {
            self.at = at.clamp(DVec3::splat(-REACH), DVec3::splat(REACH));
        }
        self.buttons = is_down.into();
        let at = self.at.to_array().map(f64::to_bits);
        self.told.put([at[0], at[1], at[2], self.buttons.into()]);
    }

    /// The button is up, wherever the mouse is now.
    pub fn release(&mut self) {
        self.put(self.at, false);
    }
}

impl Device for Pointer {
    fn abilities(&self) -> &Abilities {
        &self.abilities
    }

    fn read(&mut self) -> Result<Reading, DeviceError> {
        let dt = self.ticks.since(self.clock.now());
        if let Some((_, words)) = self.told.get() {
            let at = DVec3::from_array([0, 1, 2].map(|n| f64::from_bits(words[n])));
            if self.reading.is_none() {
                self.lag = Lag::at(at, LAG);
            }
            self.reading = Some((at, words[3] as u32));
        }
        let Some((goal, buttons)) = self.reading else {
            return Err(DeviceError::Silent(self.abilities.name.clone()));
        };
        Ok(Reading {
            pose: Pose {
                at: self.lag.towards(goal, dt),
                turn: DQuat::IDENTITY,
            },
            buttons,
            // A mouse that rests says nothing, and is where it is.
            age: 0.0,
        })
    }

    fn send(&mut self, _force: DVec3, _torque: DVec3) -> Result<(), DeviceError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jump_of_the_pointer_is_a_way_and_the_room_has_walls() {
        let clock = Clock::standing();
        let (mut mouse, mut pointer) = pair(clock.clone());
        assert!(pointer.read().is_err());
        mouse.put(DVec3::Y, false);
        assert_eq!(pointer.read().unwrap().pose.at, DVec3::Y);
        mouse.put(DVec3::new(10.0, 1.0, 0.0), true);
        let mut last = 0.0;
        for ms in 1..=60 {
            clock.set(f64::from(ms) * 1e-3);
            let reading = pointer.read().unwrap();
            let x = reading.pose.at.x;
            // The lag's largest step: 10 mm (1 - exp(-1/12)).
            assert!(x >= last && x - last < 0.81, "{}", x - last);
            assert_eq!((reading.buttons, reading.age), (1, 0.0));
            last = x;
        }
        assert!(last > 9.9 && last <= 10.0);
        mouse.put(DVec3::new(f64::NAN, 0.0, 0.0), false);
        assert_eq!(pointer.read().unwrap().buttons, 0);
        mouse.put(DVec3::splat(1e9), false);
        for ms in 61..=400 {
            clock.set(f64::from(ms) * 1e-3);
            pointer.read().unwrap();
        }
        assert_eq!(pointer.read().unwrap().pose.at.round(), DVec3::splat(100.0));
    }
}
