//! Radius and strength by the mouse, as in Blender: F or Shift-F, a way to the side, a click.

use egui::{Color32, Key, Modifiers, PointerButton, Pos2, Rect, Stroke};

use super::modeler::Modeler;
use crate::panels::RADII;

/// Way of the mouse, points, for a factor of e on the radius.
const FACTOR: f32 = 160.0;
/// Way of the mouse for all strengths.
const ALL: f32 = 240.0;

/// What is being set, from where the mouse was, and what it was before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adjust {
    what: What,
    from: Pos2,
    before: f64,
}

/// What the mouse sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// Of the tool.
    Radius,
    /// Of the tool.
    Strength,
}

impl Modeler {
    /// Begins what was asked for.
    pub(super) fn begin_adjust(&mut self, ui: &egui::Ui) {
        let Some(from) = ui.input(|i| i.pointer.hover_pos()) else {
            return;
        };
        if let Some(what) = self.bench.adjusts.take() {
            let tool = &self.bench.tool;
            let before = match what {
                What::Radius => tool.radius,
                What::Strength => tool.strength,
            };
            self.adjust = Some(Adjust { what, from, before });
        }
    }

    /// Goes on, and shows it; whether the mouse is taken by it.
    pub(super) fn adjust(&mut self, ui: &egui::Ui, rect: Rect, over: Pos2) -> bool {
        let Some(Adjust { what, from, before }) = self.adjust else {
            return false;
        };
        let way = over.x - from.x;
        let (is_done, is_left) = ui.input_mut(|i| {
            let is_left = i.pointer.button_pressed(PointerButton::Secondary)
                || i.consume_key(Modifiers::NONE, Key::Escape);
            (i.pointer.button_pressed(PointerButton::Primary), is_left)
        });
        let tool = &mut self.bench.tool;
        match what {
            What::Radius if is_left => tool.radius = before,
            What::Radius => {
                tool.radius = (before * f64::from((way / FACTOR).exp())).clamp(RADII[0], RADII[1]);
            }
            What::Strength if is_left => tool.strength = before,
            What::Strength => tool.strength = (before + f64::from(way / ALL)).clamp(0.0, 1.0),
        }
        if is_done || is_left {
            self.adjust = None;
        }
        let (radius, strength) = (tool.radius * self.bench.scene.1, tool.strength);
        let painter = ui.painter().with_clip_rect(rect);
        let color = Color32::from_rgb(255, 210, 150);
        let reach = self.pixels_of(rect, radius);
        painter.circle_stroke(from, reach, Stroke::new(3.0, Color32::from_black_alpha(90)));
        painter.circle_stroke(from, reach, Stroke::new(1.5, color));
        if what == What::Strength {
            painter.circle_filled(from, reach * strength as f32, color.gamma_multiply(0.25));
        }
        let told = match what {
            What::Radius => format!("{radius:.3}"),
            What::Strength => format!("{strength:.2}"),
        };
        painter.text(
            from,
            egui::Align2::CENTER_CENTER,
            told,
            egui::FontId::proportional(14.0),
            color,
        );
        true
    }
}
