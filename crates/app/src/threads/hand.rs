//! What the haptic thread tells the simulation.

use glam::DVec3;
use tools::haptics::Pose;

/// The button that begins a stroke when it goes down and ends it when it comes up.
pub const STROKE: u32 = 1;

/// Where a hand is, and what it does, in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hand {
    /// Where it is; nothing where the device has not told yet.
    pub pose: Option<Pose>,
    /// Where the tool would be if it could not be pushed into the solid.
    pub proxy: Pose,
    /// Force on it, N.
    pub force: DVec3,
    /// Buttons that are down.
    pub buttons: u32,
    /// How often the button of strokes went down: who looks seldom misses none.
    pub presses: u32,
}

impl Hand {
    /// Nobody there.
    pub fn nobody() -> Self {
        Self {
            pose: None,
            proxy: Pose::at(DVec3::ZERO),
            force: DVec3::ZERO,
            buttons: 0,
            presses: 0,
        }
    }

    /// Takes the buttons that are down now.
    pub fn press(&mut self, buttons: u32) {
        if buttons & !self.buttons & STROKE != 0 {
            self.presses += 1;
        }
        self.buttons = buttons;
    }

    /// Whether the button of strokes is down.
    pub fn is_pressing(&self) -> bool {
        self.buttons & STROKE != 0
    }
}
