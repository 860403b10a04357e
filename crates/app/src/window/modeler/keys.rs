//! What the keys do.

use std::time::Instant;

use egui::{Key, Modifiers};
use glam::DVec3;

use super::Modeler;
use crate::panels;
use crate::window::gesture::Gesture;
use crate::window::orders::Order;
use crate::window::tool::Kind;

impl Modeler {
    pub(super) fn keys(&mut self, ui: &egui::Ui) {
        if ui.ctx().egui_wants_keyboard_input() {
            return;
        }
        let pressed = |keys: Modifiers, key| ui.input_mut(|i| i.consume_key(keys, key));
        let redo = Modifiers::COMMAND | Modifiers::SHIFT;
        if pressed(redo, Key::Z) || pressed(Modifiers::COMMAND, Key::Y) {
            self.bench.order(Order::Redo(1));
        } else if pressed(Modifiers::COMMAND, Key::Z) {
            self.bench.order(Order::Undo(1));
        }
        if pressed(Modifiers::COMMAND, Key::O) {
            self.bench.asks = Some(panels::PathBox::open());
        }
        if pressed(Modifiers::COMMAND, Key::S) {
            self.bench.asks = self
                .bench
                .sheet
                .as_ref()
                .map(|sheet| panels::PathBox::save(sheet));
        }
        // Menus have it else.
        if matches!(self.gesture, Some(Gesture::Stroke(_))) && pressed(Modifiers::NONE, Key::Escape) {
            self.gesture = None;
            self.bench.order(Order::Drop);
        }
        if pressed(Modifiers::NONE, Key::OpenBracket) {
            self.bench.tool.radius = (self.bench.tool.radius / 1.15).max(panels::RADII[0]);
        }
        if pressed(Modifiers::NONE, Key::CloseBracket) {
            self.bench.tool.radius = (self.bench.tool.radius * 1.15).min(panels::RADII[1]);
        }
        self.adjust_by_keys(ui);
        if pressed(Modifiers::NONE, Key::V) && self.bench.can_cast {
            self.bench.look.mode = panels::next_mode(self.bench.look.mode);
        }
        if pressed(Modifiers::NONE, Key::N) {
            self.bench.pins ^= true;
        }
        if pressed(Modifiers::NONE, Key::M) {
            self.bench.measure = match self.bench.measure {
                Some(_) => None,
                None => Some(Default::default()),
            };
        }
        for kind in Kind::ALL {
            if pressed(Modifiers::NONE, kind.key()) {
                self.bench.tool.kind = kind;
            }
        }
        let up = self.bench.look.camera.up;
        let front = if up == DVec3::Z { -DVec3::Y } else { DVec3::Z };
        for (key, axis) in [(Key::Num1, front), (Key::Num3, DVec3::X), (Key::Num7, up)] {
            if pressed(Modifiers::NONE, key) {
                self.bench.look.camera.look_from(axis);
                self.moved = Instant::now();
            }
        }
        if pressed(Modifiers::NONE, Key::Home) {
            self.bench.frame_all();
            self.moved = Instant::now();
        }
        if pressed(Modifiers::NONE, Key::Num5) {
            self.bench.look.camera.perspective ^= true;
            self.moved = Instant::now();
        }
    }
}
