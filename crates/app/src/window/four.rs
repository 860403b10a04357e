//! The scene, alone or beside three planes through the chosen object.

use egui::{Color32, Rect, UiBuilder, pos2, vec2};

use super::modeler::Modeler;
use crate::panels;

/// Between the views, points.
const GAP: f32 = 2.0;

impl Modeler {
    /// All that is seen of the document.
    pub(super) fn views(&mut self, ui: &mut egui::Ui) {
        if !self.bench.slices.as_ref().is_some_and(|slices| slices.is_four_up) {
            return self.viewport(ui);
        }
        let all = ui.available_rect_before_wrap();
        // Names and numbers stand beside the planes.
        ui.painter().rect_filled(all, 0.0, ui.visuals().panel_fill);
        let mut above = ui.new_child(UiBuilder::new().max_rect(all.shrink(4.0)).id_salt("above"));
        panels::slice_settings(&mut above, &mut self.bench);
        let whole = all.with_min_y(above.min_rect().bottom());
        let half = 0.5 * (whole.size() - vec2(GAP, GAP));
        let quarter = |column: f32, row: f32| {
            let corner = whole.min + vec2(column * (half.x + GAP), row * (half.y + GAP));
            Rect::from_min_size(pos2(corner.x.round(), corner.y.round()), half)
        };
        for (n, rect) in [quarter(0.0, 0.0), quarter(1.0, 0.0), quarter(0.0, 1.0)]
            .into_iter()
            .enumerate()
        {
            let mut view = ui.new_child(UiBuilder::new().max_rect(rect.shrink(4.0)).id_salt(n));
            view.set_clip_rect(rect);
            panels::slice_beside(&mut view, &mut self.bench, n);
        }
        let mut scene = ui.new_child(UiBuilder::new().max_rect(quarter(1.0, 1.0)).id_salt("scene"));
        self.viewport(&mut scene);
        ui.allocate_rect(all, egui::Sense::hover());
    }

    /// Where the planes meet, in the scene.
    pub(super) fn draw_cursor(&self, ui: &egui::Ui, rect: Rect) {
        let sheet = self.bench.sheet.as_ref();
        let (Some(slices), Some(thing)) = (&self.bench.slices, sheet.and_then(|s| s.objects.get(s.chosen)))
        else {
            return;
        };
        let at = self.on_screen(
            rect,
            thing.world_from_object.transform_point3(slices.cursor(thing)),
        );
        let painter = ui.painter().with_clip_rect(rect);
        for (width, color) in [
            (3.0, Color32::from_black_alpha(120)),
            (1.0, Color32::from_rgb(120, 200, 255)),
        ] {
            let stroke = egui::Stroke::new(width, color);
            painter.line_segment([at - vec2(8.0, 0.0), at + vec2(8.0, 0.0)], stroke);
            painter.line_segment([at - vec2(0.0, 8.0), at + vec2(0.0, 8.0)], stroke);
        }
    }
}
