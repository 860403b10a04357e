//! What is drawn over the scene: the ring of the tool, what is held, and a tool in the hand.

use bspline::Aabb;
use egui::{Color32, Pos2, Rect, Shape, Stroke};
use glam::DVec3;
use tools::number::Point;

use super::modeler::Modeler;
use super::tool::{Kind, Tool, Use};
use crate::check::EDGES;
use crate::cli::quantity::human_number;

/// Sides of the ring that shows the tool.
const RING: usize = 48;
/// Points of a constraint that are marked as pins are.
const FEW: usize = 20;
/// Length of the arrow of the largest force of a stroke, in radii of the scene.
const LARGEST: f64 = 0.3;
/// Length of the arrow of a newton, in radii of the scene.
const ARROW: f64 = 0.12;

/// Of what is held.
const HELD: Color32 = Color32::from_rgb(120, 220, 255);

/// A corner of a box, number `4x + 2y + z`.
fn corner_of(b: &Aabb, n: usize) -> DVec3 {
    b.min + DVec3::new((n >> 2) as f64, (n >> 1 & 1) as f64, (n & 1) as f64) * b.size()
}

impl Modeler {
    /// Draws what is held on the chosen object.
    pub(super) fn draw_holds(&self, ui: &egui::Ui, rect: Rect) {
        let sheet = self.bench.sheet.as_ref();
        let Some(thing) = sheet.and_then(|sheet| sheet.objects.get(sheet.chosen)) else {
            return;
        };
        let painter = ui.painter().with_clip_rect(rect);
        let color = HELD;
        for (count, line) in thing.holds.iter().flat_map(|held| {
            let count = held.lines.len();
            held.lines.iter().map(move |line| (count, line))
        }) {
            let place = |p: &Point| self.on_screen(rect, thing.world_from_object.transform_point3(p.0));
            let places: Vec<Pos2> = line.iter().map(place).collect();
            if let [only] = places[..] {
                // Those of a box are many.
                match count > FEW {
                    true => painter.circle_filled(only, 1.5, color),
                    false => painter.circle(only, 4.0, color, Stroke::new(1.5, Color32::BLACK)),
                };
            } else {
                painter.line(places, Stroke::new(2.0, color));
            }
        }
    }

    /// Draws the line of a tool that acts when the button comes up.
    pub(super) fn draw_line_so_far(&self, ui: &egui::Ui, rect: Rect) {
        let painter = ui.painter().with_clip_rect(rect);
        let color = Color32::from_rgb(255, 210, 150);
        let lasso = self.lasso_so_far().iter().map(|(at, _)| *at);
        let line = self.line_so_far().iter().map(|p| self.on_screen(rect, *p));
        let mut places: Vec<Pos2> = match self.lasso_so_far() {
            [] => line.collect(),
            _ => lasso.collect(),
        };
        if places.len() < 2 {
            return;
        }
        match self.bench.tool.kind.by() {
            Use::Arrow => {
                painter.arrow(
                    places[0],
                    places[1] - places[0],
                    Stroke::new(4.0, Color32::from_black_alpha(90)),
                );
                painter.arrow(places[0], places[1] - places[0], Stroke::new(2.0, color));
            }
            by => {
                if by == Use::Outline {
                    places.push(places[0]);
                }
                painter.line(places.clone(), Stroke::new(4.0, Color32::from_black_alpha(90)));
                painter.line(places, Stroke::new(2.0, color));
            }
        }
    }

    /// Draws the boxes and the plane that strokes keep to.
    pub(super) fn draw_boxes(&self, ui: &egui::Ui, rect: Rect) {
        let Some(thing) = self.bench.chosen() else { return };
        let painter = ui.painter().with_clip_rect(rect);
        let limits = &self.bench.limits;
        let color = match limits.keeps {
            true => Color32::from_rgb(230, 120, 110),
            false => Color32::from_rgb(120, 220, 160),
        };
        let world = |p: DVec3| self.on_screen(rect, thing.world_from_object.transform_point3(p));
        for b in &limits.boxes {
            let corner = |n: usize| world(corner_of(b, n));
            for [from, to] in EDGES {
                painter.line_segment([corner(from), corner(to)], Stroke::new(1.5, color));
            }
        }
        if let Some((at, normal)) = limits.symmetry {
            let (u, v) = normal.any_orthonormal_pair();
            let reach = 0.5 * thing.own_box.size().max_element();
            let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (1.0, 1.0)];
            let corners = corners.map(|(x, y): (f64, f64)| world(at + reach * (x * u + y * v)));
            painter.line(
                corners.to_vec(),
                Stroke::new(1.0, Color32::from_rgb(170, 150, 230)),
            );
        }
    }

    /// Draws the places that are measured from, with their numbers.
    pub(super) fn draw_marks(&self, ui: &egui::Ui, rect: Rect) {
        let Some(measure) = &self.bench.measure else {
            return;
        };
        let painter = ui.painter().with_clip_rect(rect);
        let color = Color32::from_rgb(255, 235, 120);
        let places: Vec<Pos2> = measure.marks.iter().map(|m| self.on_screen(rect, m.at)).collect();
        painter.line(places.clone(), Stroke::new(3.0, Color32::from_black_alpha(90)));
        painter.line(places.clone(), Stroke::new(1.5, color));
        for (n, place) in places.into_iter().enumerate() {
            painter.circle(place, 3.5, color, Stroke::new(1.0, Color32::BLACK));
            painter.text(
                place + egui::vec2(7.0, -7.0),
                egui::Align2::LEFT_BOTTOM,
                n + 1,
                egui::FontId::proportional(13.0),
                color,
            );
        }
    }

    /// The box about a place of the chosen object that a click with the tool would hold.
    pub(super) fn box_under(&self, ui: &egui::Ui, rect: Rect, p: DVec3, tool: &Tool) {
        let Some(thing) = self.bench.chosen().filter(|_| tool.kind == Kind::PinBox) else {
            return;
        };
        let placed = thing.world_from_object;
        let own = Tool {
            radius: tool.radius / placed.matrix3.determinant().abs().cbrt(),
            ..*tool
        };
        let b = own.region(placed.inverse().transform_point3(p));
        let corner = |n: usize| self.on_screen(rect, placed.transform_point3(corner_of(&b, n)));
        let painter = ui.painter().with_clip_rect(rect);
        for [from, to] in EDGES {
            painter.line_segment([corner(from), corner(to)], Stroke::new(1.5, HELD));
        }
    }

    /// A circle on the surface as large as the tool.
    pub(super) fn ring(&self, ui: &egui::Ui, rect: Rect, p: DVec3, normal: DVec3, tool: &Tool) {
        let right = normal.any_orthonormal_vector();
        let up = normal.cross(right);
        let corner = |n: usize| {
            let (sine, cosine) = (std::f64::consts::TAU * n as f64 / RING as f64).sin_cos();
            self.on_screen(rect, p + tool.radius * (cosine * right + sine * up))
        };
        let color = match (tool.kind, tool.inverted) {
            (Kind::Smooth, _) => Color32::from_rgb(150, 200, 255),
            (_, true) => Color32::from_rgb(120, 220, 160),
            (_, false) => Color32::from_rgb(255, 210, 150),
        };
        let ring: Vec<Pos2> = (0..=RING).map(corner).collect();
        let painter = ui.painter().with_clip_rect(rect);
        painter.add(Shape::line(
            ring.clone(),
            Stroke::new(3.0, Color32::from_black_alpha(90)),
        ));
        painter.add(Shape::line(ring, Stroke::new(1.5, color)));
        painter.circle_filled(self.on_screen(rect, p), 2.0, color);
    }

    /// Draws the force of a stroke and the box that moves. The first arrow is as long as the largest of the stroke so far.
    pub(super) fn draw_acting(&self, ui: &egui::Ui, rect: Rect) {
        let Some((acting, most)) = self.bench.shown.acting.filter(|_| self.bench.look.show.forces) else {
            return;
        };
        let painter = ui.painter().with_clip_rect(rect);
        let corners = acting.region.map(|p| self.on_screen(rect, p));
        let side = Stroke::new(1.0, Color32::from_rgba_unmultiplied(120, 200, 255, 110));
        for [a, b] in EDGES {
            painter.line_segment([corners[a], corners[b]], side);
        }
        let size = acting.force.length();
        if size > 0.0 && most > 0.0 {
            let way = LARGEST * self.bench.scene.1 / most * acting.force;
            let from = self.on_screen(rect, acting.at);
            let told = format!("force {} (of density)", human_number(size));
            self.arrow(&painter, from, self.on_screen(rect, acting.at + way), told);
        }
    }

    fn arrow(&self, painter: &egui::Painter, from: Pos2, tip: Pos2, told: String) {
        let color = Color32::from_rgb(230, 90, 80);
        painter.arrow(from, tip - from, Stroke::new(4.5, Color32::from_black_alpha(90)));
        painter.arrow(from, tip - from, Stroke::new(2.5, color));
        let font = egui::FontId::proportional(13.0);
        for (aside, color) in [(1.0, Color32::from_black_alpha(170)), (0.0, color)] {
            let at = tip + egui::vec2(8.0 + aside, aside);
            painter.text(at, egui::Align2::LEFT_CENTER, &told, font.clone(), color);
        }
    }

    /// Draws the tool, the hand that draws at it, and the force.
    pub(super) fn draw_hand(&self, ui: &egui::Ui, rect: Rect) {
        let (Some(held), Some(seen)) = (&self.bench.held, &self.bench.seen) else {
            return;
        };
        let painter = ui.painter().with_clip_rect(rect);
        let (tool, hand) = (self.on_screen(rect, seen.proxy), self.on_screen(rect, seen.hand));
        let color = Color32::from_rgb(255, 210, 150);
        let radius = self.pixels_of(rect, held.radius);
        painter.circle_stroke(tool, radius, Stroke::new(3.0, Color32::from_black_alpha(90)));
        painter.circle_stroke(tool, radius, Stroke::new(1.5, color));
        painter.line_segment([tool, hand], Stroke::new(1.0, Color32::from_white_alpha(120)));
        painter.circle_filled(hand, 3.0, Color32::from_white_alpha(160));
        let way = (seen.proxy - seen.hand).normalize_or_zero();
        if self.bench.look.show.forces && seen.force > 0.01 && way != DVec3::ZERO {
            let tip = seen.proxy + ARROW * self.bench.scene.1 * seen.force * way;
            self.arrow(
                &painter,
                tool,
                self.on_screen(rect, tip),
                format!("{:.2} N", seen.force),
            );
        }
    }
}
