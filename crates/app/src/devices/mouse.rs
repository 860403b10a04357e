//! Mouse and keys as a device: motion in the plane of the picture, the wheel into its depth.
//!
//! A window feeds the one half and the haptic thread asks the other. Pointers jump sixty times a second, so a short lag makes a way
//! of their steps. There is no force.
#![allow(dead_code, reason = "its window is not built yet")]

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec3};
use tools::haptics::{Abilities, Device, DeviceError, Pose, Reading};

use super::clock::Clock;
use super::forceless;
use super::lag::{Lag, Ticks};
use super::mailbox::Mailbox;

/// Time of the lag, s: two pictures at sixty a second hold 95 % of a step.
const LAG: f64 = 0.012;

/// How far what moves the tool.
#[derive(Clone, Copy, Debug)]
pub struct Steps {
    /// Way of a pixel, mm.
    pub pixel: f64,
    /// Way of a notch of the wheel, mm.
    pub notch: f64,
    /// Way of a second of a key, mm.
    pub key: f64,
    /// Half the width of the room, mm.
    pub reach: f64,
}

impl Default for Steps {
    fn default() -> Self {
        Self {
            pixel: 0.1,
            notch: 1.0,
            key: 20.0,
            reach: 100.0,
        }
    }
}

/// Keys that move the tool while they are down, in the axes of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    Left,
    Right,
    Up,
    Down,
    /// Towards the user.
    Near,
    /// Away from the user.
    Far,
}

impl Key {
    /// Right, up, towards the user.
    fn way(self) -> DVec3 {
        match self {
            Self::Left => DVec3::NEG_X,
            Self::Right => DVec3::X,
            Self::Up => DVec3::Y,
            Self::Down => DVec3::NEG_Y,
            Self::Near => DVec3::Z,
            Self::Far => DVec3::NEG_Z,
        }
    }
}

/// The half of the window.
pub struct Mouse {
    steps: Steps,
    /// Right, up and towards the user of the picture, in the room.
    room_from_view: DMat3,
    at: DVec3,
    keys: u32,
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
    buttons: u32,
    goal: DVec3,
}

/// Both halves of a mouse whose tool is in the middle of its room.
pub fn pair(steps: Steps, clock: Clock) -> (Mouse, Pointer) {
    let told = Arc::<Mailbox<4>>::default();
    let abilities = forceless::abilities("mouse", steps.pixel, 1.0 / 60.0, steps.reach);
    let mouse = Mouse {
        steps,
        // A picture seen from the front: up is up, and what is far is ahead.
        room_from_view: DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y),
        at: DVec3::ZERO,
        keys: 0,
        buttons: 0,
        told: told.clone(),
    };
    let pointer = Pointer {
        abilities,
        told,
        clock,
        ticks: Ticks::default(),
        lag: Lag::at(DVec3::ZERO, LAG),
        buttons: 0,
        goal: DVec3::ZERO,
    };
    (mouse, pointer)
}

impl Mouse {
    /// Looks from elsewhere: right, up and towards the user in the room, at right angles and of length 1.
    pub fn look(&mut self, room_from_view: DMat3) {
        self.room_from_view = room_from_view;
    }

    /// The pointer went so many pixels to the right and down.
    pub fn motion(&mut self, right: f64, down: f64) {
        self.go(DVec3::new(right, -down, 0.0) * self.steps.pixel);
    }

    /// The wheel went so many notches away from the user.
    pub fn wheel(&mut self, notches: f64) {
        self.go(DVec3::new(0.0, 0.0, -notches) * self.steps.notch);
    }

    /// A key went down or up.
    pub fn key(&mut self, key: Key, is_down: bool) {
        let bit = 1 << key as u32;
        self.keys = if is_down {
            self.keys | bit
        } else {
            self.keys & !bit
        };
    }

    /// A button went down or up, counted from 0.
    pub fn button(&mut self, button: u32, is_down: bool) {
        let bit = 1_u32.checked_shl(button).unwrap_or(0);
        self.buttons = if is_down {
            self.buttons | bit
        } else {
            self.buttons & !bit
        };
        self.tell();
    }

    /// Time went on by `dt` seconds: keys that are down move the tool.
    pub fn advance(&mut self, dt: f64) {
        let all = [Key::Left, Key::Right, Key::Up, Key::Down, Key::Near, Key::Far];
        let is_down = |key: &Key| self.keys & 1 << *key as u32 != 0;
        let way: DVec3 = all.into_iter().filter(is_down).map(Key::way).sum();
        if way != DVec3::ZERO {
            self.go(way * self.steps.key * dt);
        }
    }

    /// Goes a way of the picture.
    fn go(&mut self, way: DVec3) {
        let reach = DVec3::splat(self.steps.reach);
        if way.is_finite() {
            self.at = (self.at + self.room_from_view * way).clamp(-reach, reach);
        }
        self.tell();
    }

    fn tell(&self) {
        let at = self.at.to_array().map(f64::to_bits);
        self.told.put([at[0], at[1], at[2], self.buttons.into()]);
    }
}

impl Device for Pointer {
    fn abilities(&self) -> &Abilities {
        &self.abilities
    }

    fn read(&mut self) -> Result<Reading, DeviceError> {
        if let Some((_, words)) = self.told.get() {
            self.goal = DVec3::new(
                f64::from_bits(words[0]),
                f64::from_bits(words[1]),
                f64::from_bits(words[2]),
            );
            self.buttons = words[3] as u32;
        }
        let dt = self.ticks.since(self.clock.now());
        Ok(Reading {
            pose: Pose {
                at: self.lag.towards(self.goal, dt),
                turn: DQuat::IDENTITY,
            },
            buttons: self.buttons,
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

    fn rest(pointer: &mut Pointer, clock: &Clock) -> Reading {
        let from = clock.now();
        for ms in 1..=400 {
            clock.set(from + f64::from(ms) * 1e-3);
            pointer.read().unwrap();
        }
        pointer.read().unwrap()
    }

    #[test]
    fn pixels_notches_and_keys_are_ways_in_the_room() {
        let clock = Clock::standing();
        let (mut mouse, mut pointer) = pair(Steps::default(), clock.clone());
        mouse.motion(30.0, -20.0);
        mouse.wheel(4.0);
        mouse.key(Key::Left, true);
        mouse.advance(0.1);
        mouse.key(Key::Left, false);
        mouse.advance(0.1);
        mouse.button(2, true);
        let reading = rest(&mut pointer, &clock);
        assert!(
            reading.pose.at.distance(DVec3::new(3.0 - 2.0, 4.0, 2.0)) < 1e-6,
            "{}",
            reading.pose.at
        );
        assert_eq!((reading.buttons, reading.age), (4, 0.0));
        mouse.button(2, false);
        // From the right side: right of the picture is away from the user of before.
        mouse.look(DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X));
        mouse.motion(10.0, 0.0);
        let reading = rest(&mut pointer, &clock);
        assert!(reading.pose.at.distance(DVec3::new(1.0, 5.0, 2.0)) < 1e-6);
        assert_eq!(reading.buttons, 0);
    }

    #[test]
    fn a_jump_of_the_pointer_is_a_way_and_the_room_has_walls() {
        let clock = Clock::standing();
        let (mut mouse, mut pointer) = pair(Steps::default(), clock.clone());
        pointer.read().unwrap();
        mouse.motion(100.0, 0.0);
        let mut last = 0.0;
        for ms in 1..=60 {
            clock.set(f64::from(ms) * 1e-3);
            let x = pointer.read().unwrap().pose.at.x;
            // The lag's largest step: 10 mm (1 - exp(-1/12)).
            assert!(x >= last && x - last < 0.81, "{}", x - last);
            last = x;
        }
        assert!(last > 9.9 && last <= 10.0);
        mouse.motion(f64::NAN, 0.0);
        mouse.motion(1e9, 1e9);
        assert_eq!(
            rest(&mut pointer, &clock).pose.at.round(),
            DVec3::new(100.0, 0.0, -100.0)
        );
    }
}
