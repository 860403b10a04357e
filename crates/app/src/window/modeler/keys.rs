//! What the keys do.

use std::time::Instant;

use egui::{Key, Modifiers};

use super::Modeler;
use crate::window::actions::{Action, Name};
use crate::window::gesture::Gesture;
use crate::window::orders::Order;

impl Modeler {
    pub(super) fn keys(&mut self, ui: &egui::Ui) {
        // What is arranged takes all keys, and so does a shortcut that is being changed.
        let is_taken = self.arrange.is_some() || self.bench.shortcuts.as_ref().is_some_and(|s| s.listens());
        if is_taken || ui.ctx().egui_wants_keyboard_input() {
            return;
        }
        // Menus have it else.
        let is_stroke = matches!(self.gesture, Some(Gesture::Stroke(_)));
        if is_stroke && ui.input_mut(|i| i.consume_key(Modifiers::NONE, Key::Escape)) {
            (self.gesture, self.pace) = (None, None);
            self.bench.order(Order::Drop);
        }
        let mut pressed = self.bench.keys.pressed(ui.ctx(), self.bench.arranging);
        // What is typed in the same slow picture is meant for the palette of commands.
        let palette = Action::Do(Name::Commands);
        if pressed.contains(&palette) {
            pressed = vec![palette];
        }
        if !pressed.is_empty() {
            self.moved = Instant::now();
        }
        for action in pressed {
            action.run(&mut self.bench, ui.ctx());
        }
    }
}
