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
use crate::window::pace::Pace;
use crate::window::tool::{Kind, Tool, Use};

/// Way of the clipping plane for a point of the wheel, over the radius of the scene.
const PLANE: f64 = 4e-4;

impl Modeler {
    pub(super) fn end_gesture(&mut self) {
        self.drawn.clear();
        let (lasso, keeps) = std::mem::take(&mut self.lassoed);
        if let Some(formula) = lasso::formula(&lasso) {
            self.bench.limits.lasso = Some(formula);
            self.bench.limits.keeps = keeps;
        }
        let waits = self.pace.take().and_then(|pace| pace.waits);
        match self.gesture.take() {
            Some(Gesture::Stroke(_)) => {
                // It went nowhere: nothing is slower.
                self.begin_waiting(waits, Some(1.0));
                self.bench.order(Order::End);
                // What the desk still shows of it comes first.
                self.moved = Instant::now();
            }
            // The button may come up where no scene is, and nothing leads the tool.
            Some(Gesture::Hand) => self.release(),
            _ => {}
        }
    }

    /// Begins a stroke that waited for how fast it is.
    fn begin_waiting(&self, waits: Option<(Tool, Ray)>, press: Option<f64>) {
        if let Some((tool, ray)) = waits {
            self.bench.order(Order::Begin { tool, ray, press });
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
            // It goes on a while after its last notch, and means the same.
            let notch = ui.input(|i| {
                i.events.iter().rev().find_map(|e| match e {
                    egui::Event::MouseWheel { modifiers, .. } => Some(modifiers.alt),
                    _ => None,
                })
            });
            self.moves_plane = notch.unwrap_or(self.moves_plane);
            if let (true, Some(height)) = (self.moves_plane, self.bench.plane_height()) {
                let by = PLANE * f64::from(scroll) * self.bench.scene.1;
                self.bench.set_plane_height(height + by);
            } else {
                let factor = (-0.003 * f64::from(scroll)).exp();
                self.bench.look.camera.zoom(factor, at(rect, over));
            }
            self.moved = Instant::now();
        }
        let tool = self.bench.tool_in_hand(keys);
        // While a scan is read or a file is written strokes would have to wait.
        let is_free = self.bench.busy.is_none() && self.gesture.is_none();
        // A slow picture may hold a press, its way and even the release.
        let (start, moves) = ui.input(|i| since_press(&i.events));
        let (start, begun) = start.unwrap_or((over, 1.0));
        let time = {
            let [before, now] = self.times;
            move |share: f64| before + share * (now - before)
        };
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
                    let counts = tool.kind.has_press();
                    let press = self.pen.down.filter(|_| counts && !self.bench.ignores_pens);
                    let ray = self.ray(rect, start);
                    if counts && press.is_none() && self.bench.by_speed {
                        self.pace = Some(Pace::new(step, time(begun), (tool, ray)));
                        Gesture::Stroke(Pace::way(start, step))
                    } else {
                        self.bench.order(Order::Begin { tool, ray, press });
                        Gesture::Stroke(Way::new(start, step, press))
                    }
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
                let steps: Vec<_> = match &mut self.pace {
                    Some(pace) => {
                        let moves = moves.into_iter();
                        moves
                            .flat_map(|(to, share)| pace.steps(path, to, time(share)))
                            .collect()
                    }
                    None => {
                        let presses = self.pen.presses(moves.len(), path.press().unwrap_or(1.0));
                        let moves = moves.into_iter().zip(presses);
                        moves.flat_map(|((to, _), press)| path.to(to, press)).collect()
                    }
                };
                if let Some((_, press)) = steps.first() {
                    let waits = self.pace.as_mut().and_then(|pace| pace.waits.take());
                    self.begin_waiting(waits, *press);
                }
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
/// came up; each with its share of the time of the picture.
fn since_press(events: &[egui::Event]) -> (Option<(Pos2, f64)>, Vec<(Pos2, f64)>) {
    let is_told = |event: &&egui::Event| {
        matches!(
            event,
            egui::Event::PointerMoved(_) | egui::Event::PointerButton { .. }
        )
    };
    let told: Vec<&egui::Event> = events.iter().filter(is_told).collect();
    let share = |n: usize| (n + 1) as f64 / told.len() as f64;
    let pressed = told.iter().enumerate().rev().find_map(|(n, event)| match event {
        egui::Event::PointerButton {
            pos, pressed: true, ..
        } => Some((n, *pos)),
        _ => None,
    });
    let from = pressed.map_or(0, |(n, _)| n + 1);
    let moves = told
        .iter()
        .enumerate()
        .skip(from)
        .map_while(|(n, event)| match event {
            egui::Event::PointerMoved(to) => Some(Some((*to, share(n)))),
            egui::Event::PointerButton { pressed: false, .. } => None,
            _ => Some(None),
        });
    let moves = moves.flatten().collect();
    (pressed.map(|(n, at)| (at, share(n))), moves)
}
