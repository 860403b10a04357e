//! The scene in the middle, and where things are in it.

use std::time::Duration;

use egui::layers::ShapeIdx;
use egui::{Pos2, Rect, Sense};
use glam::{DVec2, DVec3};

use super::Modeler;
use crate::view::{Legend, Ray, SCALE_BAR, scale_bar};
use crate::window::tool::Tool;

/// Time after which a picture in which nothing moves is drawn whole.
const STILL: Duration = Duration::from_millis(45);

/// Where the tool would act: a place, the normal there, and the tool.
pub(super) type Ring = (DVec3, DVec3, Tool);

impl Modeler {
    /// The scene, and what the mouse does in it.
    pub(in crate::window) fn viewport(&mut self, ui: &mut egui::Ui) {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        #[cfg(test)]
        (self.drawn_in = rect);
        // What the mouse does now shows in this picture, which is painted below what is drawn over it.
        let below = [(); 2].map(|()| ui.painter().add(egui::Shape::Noop));
        let over = response.hover_pos().or(response.interact_pointer_pos());
        let ring = over.and_then(|over| {
            // A drag stays with the eye that it began with.
            let from = ui.input(|i| i.pointer.press_origin()).unwrap_or(over);
            let (view, aside) = self.bench.look.show.stereo.view_at(rect, from);
            self.bench.look.camera.aside = aside;
            let ring = self.pointer(ui, view, &response, over);
            self.bench.look.camera.aside = 0.0;
            ring
        });
        if response.drag_stopped() || !ui.input(|i| i.pointer.any_down()) {
            self.end_gesture();
        }
        let is_still = self.moved.elapsed() > STILL && self.gesture.is_none();
        self.bench.know_density();
        self.bench.look.line = 1.25 / rect.height();
        self.beside(ui.ctx());
        let pixels = (rect.size() * ui.ctx().pixels_per_point()).round();
        // The card draws one whole picture at a time.
        let is_shot = self.shoot([pixels.x as u32, pixels.y as u32]);
        let is_done = self.draw(ui, below, rect, is_still && !is_shot) && !is_shot;
        if !is_done {
            ui.ctx().request_repaint();
        }
        if !is_still {
            ui.ctx().request_repaint_after(STILL);
        }
        let legends = self.bench.legends();
        if let Some(thing) = self.bench.sheet.as_ref().and_then(|s| s.objects.get(s.chosen))
            && self.bench.look.show.scale_bar
        {
            let length_of_point = self.bench.look.camera.height / f64::from(rect.height());
            let beside = Legend::beside(legends.len(), rect, SCALE_BAR);
            scale_bar(ui.painter(), beside, length_of_point, thing.unit);
        }
        Legend::draw(&legends, ui.painter(), rect);
        for (view, aside) in self.bench.look.show.stereo.views(rect) {
            self.bench.look.camera.aside = aside;
            self.draw_over(ui, view, ring);
            self.bench.look.camera.aside = 0.0;
        }
    }

    /// Draws over the scene what is no part of it, with a ring on the surface under the mouse.
    fn draw_over(&self, ui: &egui::Ui, rect: Rect, ring: Option<Ring>) {
        if let Some((p, normal, tool)) = ring {
            self.ring(ui, rect, p, normal, &tool);
            self.box_under(ui, rect, p, &tool);
        }
        self.draw_cursor(ui, rect);
        self.draw_holds(ui, rect);
        self.draw_line_so_far(ui, rect);
        self.draw_boxes(ui, rect);
        self.draw_marks(ui, rect);
        self.draw_handles(ui, rect);
        self.draw_hand(ui, rect);
        self.draw_acting(ui, rect);
    }

    /// Draws the scene in place of two shapes, or as much of it as there is time for; whether that is all.
    fn draw(&mut self, ui: &egui::Ui, below: [ShapeIdx; 2], rect: Rect, is_still: bool) -> bool {
        let Some(screen) = &mut self.screen else {
            return true;
        };
        let look = &self.bench.look;
        let pixels = rect.size() * ui.ctx().pixels_per_point();
        let rough = screen.canvas.rough_share(
            look.mode,
            look.show.stereo.load() * f64::from(pixels.x * pixels.y),
        );
        let mut draw = |is_rough: bool| {
            let pixels = if is_rough { pixels * rough } else { pixels }.round();
            screen.draw(look, [pixels.x as u32, pixels.y as u32], is_rough)
        };
        let whole = is_still.then(|| draw(false));
        // Until all rows are drawn the rough picture shows below them.
        let shown = match &whole {
            Some(whole) if whole.rows >= 1.0 => None,
            _ => Some(draw(true)),
        };
        let is_done = whole
            .as_ref()
            .or(shown.as_ref())
            .is_none_or(|drawn| drawn.is_done);
        let shown = shown.map(|drawn| (drawn.picture, 1.0));
        let whole = whole.map(|drawn| (drawn.picture, drawn.rows));
        for (shape, (picture, rows)) in below.into_iter().zip(shown.into_iter().chain(whole)) {
            let part = rect.with_max_y(rect.min.y + rows * rect.height());
            ui.painter().with_clip_rect(part).set(shape, picture.over(rect));
        }
        is_done
    }

    pub(in crate::window) fn ray(&self, rect: Rect, over: Pos2) -> Ray {
        self.bench.look.camera.ray(at(rect, over))
    }

    pub(in crate::window) fn on_screen(&self, rect: Rect, p: DVec3) -> Pos2 {
        let place = self.bench.look.camera.place(p) * f64::from(rect.height());
        rect.center() + egui::vec2(place.x as f32, -place.y as f32)
    }

    pub(in crate::window) fn pixels_of(&self, rect: Rect, length: f64) -> f32 {
        (length / self.bench.look.camera.height) as f32 * rect.height()
    }

    /// Where the mouse is over the chosen object, and the normal there, in the world.
    pub(in crate::window) fn under(&self, rect: Rect, over: Pos2) -> Option<(DVec3, DVec3)> {
        let thing = self
            .bench
            .chosen()
            .filter(|thing| !self.bench.hidden.contains(&thing.name))?;
        thing.under(&self.ray(rect, over))
    }
}

/// Where a point of the screen is in the picture, in heights of it.
pub(super) fn at(rect: Rect, p: Pos2) -> DVec2 {
    let way = p - rect.center();
    DVec2::new(f64::from(way.x), -f64::from(way.y)) / f64::from(rect.height())
}
