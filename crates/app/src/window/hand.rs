//! How the mouse leads the tool that it holds.

use std::sync::PoisonError;

use egui::{Pos2, Rect};
use glam::DVec3;

use super::gesture::Gesture;
use super::modeler::Modeler;
use super::touch::Held;

impl Modeler {
    /// Leads what the mouse holds: it rests on the surface under the pointer and presses into it; beside the solid it goes on as far from the
    /// eye as it was.
    pub(super) fn lead(&self, rect: Rect, over: Pos2) {
        let Some(held) = &self.bench.held else { return };
        let Some(mouse) = &held.mouse else { return };
        let press = self.bench.touch.as_ref().map_or(0.0, |wish| wish.press);
        let at = match self.under(rect, over) {
            Some((p, outward)) => p + (1.0 - press) * held.radius * outward,
            None => {
                let ray = self.ray(rect, over);
                let before = self.bench.seen.map_or(self.bench.scene.0, |seen| seen.hand);
                ray.from + (before - ray.from).dot(ray.along) * ray.along
            }
        };
        let is_down = matches!(self.gesture(), Some(Gesture::Hand));
        mouse
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .put(in_room(held, at), is_down);
    }

    /// The button of the mouse that leads the tool comes up.
    pub(super) fn release(&self) {
        let mouse = self.bench.held.as_ref().and_then(|held| held.mouse.as_ref());
        if let Some(mouse) = mouse {
            mouse.lock().unwrap_or_else(PoisonError::into_inner).release();
        }
    }
}

/// A place of the world in the room of a device, mm.
fn in_room(held: &Held, at: DVec3) -> DVec3 {
    let room = &held.workspace;
    room.turn.inverse() * (at - room.shift) / room.scale
}
