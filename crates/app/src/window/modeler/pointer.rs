//! What the mouse does in the scene.

use std::time::Instant;

use egui::{PointerButton, Pos2, Rect};
use glam::DVec2;

use super::Modeler;
use super::viewport::{Ring, at};
use crate::view::Ray;
use crate::window::gesture::{Gesture, Way};
use crate::window::lasso;
use crate::window::orders::Order;
use crate::window::tool::{Kind, Tool, Use};

impl Modeler {
    pub(super) fn end_gesture(&mut self) {
        self.drawn.clear();
        let (lasso, keeps) = std::mem::take(&mut self.lassoed);
        if let Some(formula) = lasso::formula(&lasso) {
            self.bench.limits.lasso = Some(formula);
            self.bench.limits.keeps = keeps;
        }
        match self.gesture.take() {
            Some(Gesture::Stroke(_)) => self.bench.order(Order::End),
            // The button may come up where no scene is, and nothing leads the tool.
            Some(Gesture::Hand) => self.release(),
            _ => {}
        }
    }

    /// Does what the mouse wants; where the tool would act then.
    pub(super) fn pointer(
        &mut self,
        ui: &egui::Ui,
        rect: Rect,
        response: &egui::Response,
        over: Pos2,
    ) -> Option<Ring> {
        if self.adjust(ui, rect, over) || self.arrange(ui, rect, over) {
            return None;
        }
        let (keys, scroll, pressed) = ui.input(|i| {
            let pressed = [
                PointerButton::Primary,
                PointerButton::Secondary,
                PointerButton::Middle,
            ]
            .into_iter()
            .find(|b| i.pointer.button_pressed(*b));
            (i.modifiers, i.smooth_scroll_delta().y, pressed)
        });
        if response.hovered() && scroll != 0.0 {
            let factor = (-0.003 * f64::from(scroll)).exp();
            self.bench.look.camera.zoom(factor, at(rect, over));
            self.moved = Instant::now();
        }
        let tool = self.bench.tool_in_hand(keys);
        // While a scan is read or a file is written strokes would have to wait.
        let is_free = self.bench.busy.is_none() && self.gesture.is_none();
        // A slow picture may hold a press, its way and even the release.
        let (start, moves) = ui.input(|i| since_press(&i.events));
        let start = start.unwrap_or(over);
        let under = is_free.then(|| self.under(rect, start)).flatten();
        if let Some(button) = pressed.filter(|_| response.hovered() && self.gesture.is_none()) {
            if button == PointerButton::Primary && self.take_handle(rect, start) {
                self.arrange(ui, rect, over);
                return None;
            }
            if let (PointerButton::Primary, Some((p, normal))) = (button, under) {
                if self.bench.arranging {
                    self.choose(rect, start);
                    return None;
                }
                if self.bench.measure.is_some() {
                    self.bench.mark(p, normal);
                    return None;
                }
                if self.bench.pins {
                    self.bench.pin(p);
                    return None;
                }
            }
            self.gesture = Some(match (button, keys.shift, keys.alt) {
                (PointerButton::Primary, _, false) if self.leads_by_mouse() && under.is_some() => {
                    Gesture::Hand
                }
                (PointerButton::Primary, _, false)
                    if (under.is_some() || tool.kind == Kind::Lasso) && self.bench.held.is_none() =>
                {
                    let reach = self.pixels_of(rect, tool.radius);
                    let step = (tool.settings.spacing as f32 * reach).clamp(2.0, 24.0);
                    self.drawn = under
                        .iter()
                        .filter(|_| tool.acts_at_once())
                        .map(|(p, _)| *p)
                        .collect();
                    let counts = !self.bench.ignores_pens && tool.kind.has_press();
                    let press = self.pen.down.filter(|_| counts);
                    self.bench.order(Order::Begin {
                        tool,
                        ray: self.ray(rect, start),
                        press,
                    });
                    Gesture::Stroke(Way::new(start, step, press))
                }
                (PointerButton::Middle, true, _) | (PointerButton::Secondary, ..) => Gesture::Pan,
                _ => Gesture::Orbit,
            });
            if !matches!(self.gesture, Some(Gesture::Stroke(_))) {
                return None;
            }
        }
        let way = ui.input(|i| i.pointer.delta());
        let way = DVec2::new(f64::from(way.x), -f64::from(way.y)) / f64::from(rect.height());
        match &mut self.gesture {
            Some(Gesture::Stroke(path)) => {
                let presses = self.pen.presses(moves.len(), path.press().unwrap_or(1.0));
                let steps = moves.into_iter().zip(presses);
                let steps: Vec<_> = steps.flat_map(|(to, press)| path.to(to, press)).collect();
                for (step, press) in &steps {
                    self.bench.order(Order::Along {
                        ray: self.ray(rect, *step),
                        press: *press,
                    });
                }
                if tool.acts_at_once() {
                    let steps: Vec<Pos2> = steps.into_iter().map(|(at, _)| at).collect();
                    self.draw_line(rect, &tool, &steps);
                } else if !steps.is_empty() {
                    self.meet_desk();
                }
            }
            Some(Gesture::Orbit) => self.bench.look.camera.orbit(way),
            Some(Gesture::Pan) => self.bench.look.camera.pan(way),
            _ => {}
        }
        self.lead(rect, over);
        let is_sculpting = !self.bench.arranging && self.bench.held.is_none();
        let over_solid = under.filter(|_| is_sculpting && self.gesture.is_none());
        self.try_out(rect, over_solid.is_some().then_some(over), &tool);
        over_solid.map(|(p, normal)| (p, normal, tool))
    }

    /// The nearest object under the mouse is chosen.
    fn choose(&mut self, rect: Rect, over: Pos2) {
        let Some(sheet) = self.bench.sheet.clone() else {
            return;
        };
        let ray = self.ray(rect, over);
        let seen = sheet
            .objects
            .iter()
            .filter(|thing| !self.bench.hidden.contains(&thing.name));
        let met = seen.filter_map(|thing| Some((thing.under(&ray)?.0.distance(ray.from), &thing.name)));
        if let Some((_, name)) = met.min_by(|a, b| a.0.total_cmp(&b.0)) {
            self.bench.order(Order::Choose(name.clone()));
        }
    }

    /// Has the desk show what a click would leave.
    fn try_out(&mut self, rect: Rect, over: Option<Pos2>, tool: &Tool) {
        let now = over
            .filter(|_| tool.kind.by() == Use::Click)
            .map(|over| (over, *tool));
        if now == self.tried {
            return;
        }
        self.bench.order(match now {
            Some((over, tool)) => Order::Try(tool, self.ray(rect, over)),
            None => Order::Untry,
        });
        self.tried = now;
    }

    /// The line of a tool that acts at once goes on.
    fn draw_line(&mut self, rect: Rect, tool: &Tool, steps: &[Pos2]) {
        let own = self.bench.chosen().map(|thing| thing.world_from_object.inverse());
        for step in steps {
            if let (Kind::Lasso, Some(own)) = (tool.kind, own) {
                let ray = self.ray(rect, *step);
                let ray = Ray {
                    from: own.transform_point3(ray.from),
                    along: own.transform_vector3(ray.along).normalize_or_zero(),
                };
                self.lassoed.0.push((*step, ray));
                self.lassoed.1 = tool.inverted;
            }
            let under = self.under(rect, *step).map(|(p, _)| p);
            match tool.kind.by() {
                Use::Arrow => {
                    let Some(from) = self.drawn.first().copied() else {
                        return;
                    };
                    let ray = self.ray(rect, *step);
                    // As far from the eye as where it began.
                    let across = ray.from + (from - ray.from).dot(ray.along) * ray.along;
                    self.drawn = vec![from, under.unwrap_or(across)];
                }
                Use::Click => {}
                _ => self.drawn.extend(under),
            }
        }
    }

    fn leads_by_mouse(&self) -> bool {
        self.bench.held.as_ref().is_some_and(|held| held.mouse.is_some())
    }

    /// What a button that is down does.
    pub(in crate::window) fn gesture(&self) -> Option<Gesture> {
        self.gesture
    }
}

/// Where a button went down last among the events of a picture, if one did, and the way from there, or from the beginning, until one
/// came up.
fn since_press(events: &[egui::Event]) -> (Option<Pos2>, Vec<Pos2>) {
    let pressed = events
        .iter()
        .enumerate()
        .rev()
        .find_map(|(n, event)| match event {
            egui::Event::PointerButton {
                pos, pressed: true, ..
            } => Some((n + 1, *pos)),
            _ => None,
        });
    let way = &events[pressed.map_or(0, |(n, _)| n)..];
    let is_release = |event: &egui::Event| matches!(event, egui::Event::PointerButton { pressed: false, .. });
    let until = way.iter().position(is_release).unwrap_or(way.len());
    let moves = way[..until].iter().filter_map(|event| match event {
        egui::Event::PointerMoved(to) => Some(*to),
        _ => None,
    });
    (pressed.map(|(_, at)| at), moves.collect())
}
