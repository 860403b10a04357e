//! Handles on the chosen object while objects are arranged: arrows, rings and a box that are dragged, in place of the keys G, R and S with
//! X, Y and Z.

use egui::{Align2, Color32, CursorIcon, FontId, Painter, Pos2, Rect, Shape, Stroke, Vec2};
use glam::DVec3;

use super::arrange::{AXES, Arrange, Change, middle};
use super::modeler::Modeler;
use super::orders::Thing;
use crate::view::Ray;

/// Length of an arrow, points of the screen: the handles are as large however far the object is.
const REACH: f32 = 86.0;
/// Radius of a ring, of that.
const RING: f32 = 0.72;
/// Where the box is, of that.
const BOX: Vec2 = Vec2::new(0.8, -0.8);
/// How near to a handle takes it.
const NEAR: f32 = 7.0;
/// Corners of a whole ring.
const CORNERS: usize = 64;
/// Sine of the angle between a plane and the line of sight below which a drag in it says nothing.
const FLAT: f64 = 0.15;

/// Something to be dragged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Handle {
    /// Moves along an axis of the world.
    Arrow(usize),
    /// Turns about one.
    Ring(usize),
    /// Scales.
    Box,
}

impl Handle {
    /// What it does, and on which axis.
    fn does(self) -> (Change, Option<usize>) {
        match self {
            Self::Arrow(axis) => (Change::Shift, Some(axis)),
            Self::Ring(axis) => (Change::Turn, Some(axis)),
            Self::Box => (Change::Scale, None),
        }
    }

    fn color(self) -> Color32 {
        match self {
            Self::Arrow(axis) | Self::Ring(axis) => AXES[axis],
            Self::Box => Color32::from_gray(225),
        }
    }
}

impl Modeler {
    /// The handles of an object, each a line on the screen.
    pub(super) fn handles(&self, rect: Rect, thing: &Thing) -> Vec<(Handle, Vec<Pos2>)> {
        let center = middle(thing);
        let reach = f64::from(REACH) * self.length_of_point(rect, center);
        let mut all = Vec::new();
        for (n, axis) in DVec3::AXES.into_iter().enumerate() {
            let ring = self.ring_about(center, axis, f64::from(RING) * reach);
            let line = ring.into_iter().map(|p| self.on_screen(rect, p));
            all.push((Handle::Ring(n), line.collect()));
        }
        for (n, axis) in DVec3::AXES.into_iter().enumerate() {
            let line = [0.25, 1.0].map(|share| self.on_screen(rect, center + share * reach * axis));
            // One that points at the eye is a dot.
            if line[0].distance(line[1]) > 0.15 * REACH {
                all.push((Handle::Arrow(n), line.to_vec()));
            }
        }
        all.push((Handle::Box, vec![self.on_screen(rect, center) + REACH * BOX]));
        all
    }

    /// A ring as far as the eye is on its side.
    fn ring_about(&self, center: DVec3, axis: DVec3, radius: f64) -> Vec<DVec3> {
        let [right, _, toward_eye] = self.bench.look.camera.axes();
        let across = toward_eye - axis.dot(toward_eye) * axis;
        // It begins where it is farthest, so that what is left of it is one line.
        let far = -across.try_normalize().unwrap_or(right);
        let side = axis.cross(far);
        let corner = |n: usize| {
            let (sine, cosine) = (std::f64::consts::TAU * n as f64 / CORNERS as f64).sin_cos();
            radius * (cosine * far + sine * side)
        };
        let near = (0..=CORNERS).map(corner);
        let near = near.filter(|way| way.dot(toward_eye) > -0.2 * radius);
        near.map(|way| center + way).collect()
    }

    /// The handle that a press at a place takes.
    fn handle_at(&self, rect: Rect, at: Pos2) -> Option<Handle> {
        let thing = self.shown_handles()?;
        let far = |line: &[Pos2]| match line {
            [only] => (only.distance(at) - NEAR).max(0.0),
            _ => line
                .windows(2)
                .map(|pair| distance(at, pair))
                .fold(f32::INFINITY, f32::min),
        };
        let all = self.handles(rect, thing);
        let near = all.iter().map(|(handle, line)| (*handle, far(line)));
        let near = near.filter(|(_, far)| *far < NEAR);
        // Of two that cross the one that was drawn last.
        near.rev()
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(handle, _)| handle)
    }

    /// The object that has handles now.
    fn shown_handles(&self) -> Option<&Thing> {
        let bench = &self.bench;
        let are_shown =
            bench.arranging && self.arrange.is_none() && bench.held.is_none() && bench.busy.is_none();
        let thing = bench.chosen().filter(|_| are_shown)?;
        (!bench.hidden.contains(&thing.name)).then_some(thing)
    }

    /// Takes the handle at a place; whether there is one.
    pub(super) fn take_handle(&mut self, rect: Rect, at: Pos2) -> bool {
        let taken = self.handle_at(rect, at);
        if let Some((change, axis)) = taken.map(Handle::does) {
            self.arrange = Some(Arrange::held(change, axis, at));
        }
        taken.is_some()
    }

    /// Draws them, the one under the mouse brighter.
    pub(super) fn draw_handles(&self, ui: &egui::Ui, rect: Rect) {
        let Some(thing) = self.shown_handles() else { return };
        let painter = ui.painter().with_clip_rect(rect);
        let over = ui
            .input(|i| i.pointer.hover_pos())
            .filter(|_| self.gesture().is_none());
        let under = over.and_then(|over| self.handle_at(rect, over));
        if under.is_some() {
            ui.ctx().set_cursor_icon(CursorIcon::Grab);
        }
        for (handle, line) in self.handles(rect, thing) {
            let is_under = under == Some(handle);
            let color = match is_under {
                true => handle.color().lerp_to_gamma(Color32::WHITE, 0.5),
                false => handle.color(),
            };
            let width = if is_under { 3.5 } else { 2.0 };
            draw(
                &painter,
                handle,
                &line,
                Stroke::new(width + 2.0, Color32::from_black_alpha(90)),
            );
            draw(&painter, handle, &line, Stroke::new(width, color));
        }
    }

    /// What a ring is turned by that is dragged from one place of the screen to another, degrees.
    pub(super) fn ring_turn(&self, rect: Rect, [center, axis]: [DVec3; 2], [from, to]: [Pos2; 2]) -> f64 {
        let middle = self.on_screen(rect, center);
        let meet = |at: Pos2| {
            let Ray { from, along } = self.ray(rect, at);
            let way = from + (center - from).dot(axis) / along.dot(axis) * along - center;
            way.is_finite().then_some(way)
        };
        let is_flat = self.ray(rect, middle).along.dot(axis).abs() < FLAT;
        if let (false, Some(from), Some(to)) = (is_flat, meet(from), meet(to)) {
            return axis.dot(from.cross(to)).atan2(from.dot(to)).to_degrees();
        }
        // It is seen from its edge: its nearest place goes along its tangent.
        let ring = self.ring_about(center, axis, 1.0);
        let seen =
            |p: DVec3| self.on_screen(rect, center + self.length_of_point(rect, center) * (p - center));
        let reach = REACH * RING;
        let far = |p: &DVec3| (middle + reach * (seen(*p) - middle)).distance(from);
        let Some(near) = ring.into_iter().min_by(|a, b| far(a).total_cmp(&far(b))) else {
            return 0.0;
        };
        let tangent = reach * (seen(near + axis.cross(near - center)) - seen(near));
        f64::from((to - from).dot(tangent) / tangent.length_sq().max(1.0)).to_degrees()
    }

    /// How long a point of the screen is at a place of the world.
    pub(super) fn length_of_point(&self, rect: Rect, p: DVec3) -> f64 {
        let camera = &self.bench.look.camera;
        let [right, ..] = camera.axes();
        let seen = camera.place(p + camera.height * right) - camera.place(p);
        camera.height / (seen.length() * f64::from(rect.height())).max(1e-9)
    }
}

fn draw(painter: &Painter, handle: Handle, line: &[Pos2], stroke: Stroke) {
    match (handle, line) {
        (Handle::Arrow(axis), [from, to]) => {
            let along = (*to - *from).normalized();
            let (tip, side) = (*to + 12.0 * along, 5.0 * along.rot90());
            painter.line_segment([*from, *to], stroke);
            painter.add(Shape::convex_polygon(
                vec![*to - side, tip, *to + side],
                stroke.color,
                Stroke::NONE,
            ));
            let name = ["X", "Y", "Z"][axis];
            let font = FontId::proportional(13.0);
            painter.text(tip + 9.0 * along, Align2::CENTER_CENTER, name, font, stroke.color);
        }
        (Handle::Box, [at]) => {
            let size = Vec2::splat(8.0 + stroke.width);
            painter.rect_filled(Rect::from_center_size(*at, size), 1.0, stroke.color);
        }
        _ => drop(painter.line(line.to_vec(), stroke)),
    }
}

/// From a place to the line between two others.
fn distance(at: Pos2, pair: &[Pos2]) -> f32 {
    let (from, way) = (pair[0], pair[1] - pair[0]);
    let share = (at - from).dot(way) / way.length_sq().max(1e-6);
    at.distance(from + share.clamp(0.0, 1.0) * way)
}
