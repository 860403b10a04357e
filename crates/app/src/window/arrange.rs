//! The chosen object moved, turned and scaled by the mouse, as in Blender: a key, a way of the mouse or a number, a click. X, Y and Z take
//! one axis. Or a handle is dragged. It becomes one stroke, `place`.

use egui::{Color32, Event, Key, Modifiers, PointerButton, Pos2, Rect, Stroke};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use serde_json::{Value, json};

use super::modeler::Modeler;
use super::orders::Thing;
use super::tool::turned;
use crate::check::EDGES;

/// What happens to the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// It goes elsewhere.
    Shift,
    /// It is turned about its middle.
    Turn,
    /// It becomes larger or smaller.
    Scale,
}

/// An object that is being arranged.
#[derive(Clone, Debug)]
pub struct Arrange {
    change: Change,
    from: Pos2,
    axis: Option<usize>,
    typed: String,
    /// Whether a handle is dragged: it ends when the button comes up.
    is_held: bool,
}

impl Arrange {
    /// By a handle that was taken at a place.
    pub(super) fn held(change: Change, axis: Option<usize>, from: Pos2) -> Self {
        Self {
            change,
            from,
            axis,
            typed: String::new(),
            is_held: true,
        }
    }
}

/// Red, green and blue for the axes.
pub const AXES: [Color32; 3] = [
    Color32::from_rgb(230, 90, 80),
    Color32::from_rgb(130, 200, 90),
    Color32::from_rgb(90, 150, 240),
];

/// What an object gets.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Gets {
    /// A way in the world.
    Way(DVec3),
    /// A turn about an axis of the world, degrees.
    Turn(DVec3, f64),
    /// A factor, on all axes or on one.
    Factor(Option<usize>, f64),
}

impl Gets {
    /// Where it brings places of the world, about a middle.
    fn map(self, middle: DVec3) -> DAffine3 {
        let about = |m: DMat3| DAffine3::from_mat3_translation(m, middle - m * middle);
        match self {
            Self::Way(way) => DAffine3::from_translation(way),
            Self::Turn(axis, angle) => {
                about(DMat3::from_quat(DQuat::from_axis_angle(axis, angle.to_radians())))
            }
            Self::Factor(axis, by) => {
                let mut scale = DVec3::splat(by);
                if let Some(axis) = axis {
                    scale = DVec3::ONE;
                    scale[axis] = by;
                }
                about(DMat3::from_diagonal(scale))
            }
        }
    }

    /// The stroke that does it; lengths and places of a `place` are those of the parent.
    fn stroke(self, thing: &Thing) -> Value {
        let parent_from_world = thing.world_from_parent.inverse();
        match self {
            Self::Way(way) => {
                json!({ "place": { "by": parent_from_world.transform_vector3(way).to_array() } })
            }
            Self::Turn(axis, angle) => {
                let axis = parent_from_world.transform_vector3(axis).normalize_or_zero();
                let turn = turned(DQuat::from_axis_angle(axis, angle.to_radians()));
                json!({ "place": { "turn": turn } })
            }
            Self::Factor(None, by) => json!({ "place": { "scale": by } }),
            Self::Factor(Some(_), _) => {
                let to = self.map(middle(thing)) * thing.world_from_object;
                let own = parent_from_world * to;
                let [x, y, z] = [0, 1, 2].map(|axis| own.matrix3.col(axis).to_array());
                json!({ "place": { "map": [x, y, z, own.translation.to_array()] } })
            }
        }
    }
}

/// What an object is turned and scaled about.
pub(super) fn middle(thing: &Thing) -> DVec3 {
    thing.world_from_object.transform_point3(thing.own_box.center())
}

impl Modeler {
    /// Begins what was asked for.
    pub(super) fn begin_arranging(&mut self, ui: &egui::Ui) {
        let Some(from) = ui.input(|i| i.pointer.hover_pos()) else {
            return;
        };
        if let Some(change) = self.bench.arranges.take() {
            self.arrange = Some(Arrange {
                change,
                from,
                axis: None,
                typed: String::new(),
                is_held: false,
            });
        }
    }

    /// Goes on, and shows it; whether the mouse is taken by it.
    pub(super) fn arrange(&mut self, ui: &egui::Ui, rect: Rect, over: Pos2) -> bool {
        let Some(mut arrange) = self.arrange.take() else {
            return false;
        };
        let Some(thing) = self.bench.chosen().cloned() else {
            return false;
        };
        let (is_done, is_left) = ui.input_mut(|i| {
            for (n, key) in [Key::X, Key::Y, Key::Z].into_iter().enumerate() {
                if i.consume_key(Modifiers::NONE, key) {
                    arrange.axis = Some(n).filter(|axis| arrange.axis != Some(*axis));
                }
            }
            for event in &i.events {
                if let Event::Text(text) = event {
                    arrange
                        .typed
                        .extend(text.chars().filter(|c| c.is_ascii_digit() || "-.".contains(*c)));
                }
            }
            if i.consume_key(Modifiers::NONE, Key::Backspace) {
                arrange.typed.pop();
            }
            let is_left = i.pointer.button_pressed(PointerButton::Secondary)
                || i.consume_key(Modifiers::NONE, Key::Escape);
            let is_clicked = match arrange.is_held {
                true => !i.pointer.primary_down(),
                false => i.pointer.button_pressed(PointerButton::Primary),
            };
            let is_done = is_clicked || i.consume_key(Modifiers::NONE, Key::Enter);
            (is_done, is_left)
        });
        let gets = self.gets(&arrange, &thing, rect, over);
        self.draw_arranged(ui, rect, &arrange, &thing, gets);
        if is_done && !is_left {
            if gets.is_some_and(|gets| gets.map(DVec3::ONE) != DAffine3::IDENTITY) {
                let stroke = gets.map(|gets| gets.stroke(&thing));
                stroke.into_iter().for_each(|stroke| self.bench.stroke(stroke));
            }
        } else if !is_left {
            self.arrange = Some(arrange);
        }
        true
    }

    /// What the mouse, or the number that is typed, says; nothing for a number that makes no sense.
    fn gets(&self, arrange: &Arrange, thing: &Thing, rect: Rect, over: Pos2) -> Option<Gets> {
        let typed = match arrange.typed.as_str() {
            "" => None,
            text => Some(text.parse::<f64>().ok()?),
        };
        let center = middle(thing);
        let [right, up, toward_eye] = self.bench.look.camera.axes();
        let axis = arrange.axis.map(|n| DVec3::AXES[n]);
        let on_screen = self.on_screen(rect, center);
        let (before, now) = (arrange.from - on_screen, over - on_screen);
        Some(match arrange.change {
            Change::Shift => {
                let length = self.length_of_point(rect, center);
                let way = over - arrange.from;
                let way = length * (f64::from(way.x) * right - f64::from(way.y) * up);
                Gets::Way(match (axis, typed) {
                    (axis, Some(by)) => by * axis.unwrap_or(DVec3::X),
                    (None, None) => way,
                    (Some(axis), None) => {
                        // As far along the axis as the mouse is along its picture.
                        let seen = axis - axis.dot(toward_eye) * toward_eye;
                        way.dot(seen) / seen.length_squared().max(0.05) * axis
                    }
                })
            }
            Change::Turn => {
                let turn = f64::from(before.angle() - now.angle()).to_degrees();
                let toward = axis.map_or(1.0, |axis| axis.dot(toward_eye).signum());
                let turn = toward * ((turn + 540.0).rem_euclid(360.0) - 180.0);
                let turn = match axis.filter(|_| arrange.is_held) {
                    Some(axis) => self.ring_turn(rect, [center, axis], [arrange.from, over]),
                    None => turn,
                };
                Gets::Turn(axis.unwrap_or(toward_eye), typed.unwrap_or(turn))
            }
            Change::Scale => {
                let factor = f64::from(now.length() / before.length().max(8.0));
                let factor = typed.unwrap_or(factor.max(1e-3));
                return (factor > 0.0).then_some(Gets::Factor(arrange.axis, factor));
            }
        })
    }

    /// Draws where the box of the object would be, the axis, and the number.
    fn draw_arranged(&self, ui: &egui::Ui, rect: Rect, arrange: &Arrange, thing: &Thing, gets: Option<Gets>) {
        let painter = ui.painter().with_clip_rect(rect);
        let color = Color32::from_rgb(255, 210, 150);
        let center = middle(thing);
        let map = gets.map_or(DAffine3::IDENTITY, |gets| gets.map(center)) * thing.world_from_object;
        let (min, size) = (thing.own_box.min, thing.own_box.size());
        let corner = |n: usize| {
            let share = DVec3::new((n >> 2) as f64, (n >> 1 & 1) as f64, (n & 1) as f64);
            self.on_screen(rect, map.transform_point3(min + share * size))
        };
        for [from, to] in EDGES {
            painter.line_segment([corner(from), corner(to)], Stroke::new(1.5, color));
        }
        if let Some(axis) = arrange.axis {
            let way = self.bench.scene.1 * DVec3::AXES[axis];
            let ends = [center - way, center + way].map(|p| self.on_screen(rect, p));
            painter.line_segment(ends, Stroke::new(1.5, AXES[axis]));
        }
        let along = arrange
            .axis
            .map_or("", |n| [" along X", " along Y", " along Z"][n]);
        let text = match gets {
            None => format!("{}?", arrange.typed),
            Some(Gets::Way(way)) => format!("{:.3} {}{along}", way.length(), thing.unit),
            Some(Gets::Turn(_, angle)) => format!("{angle:.1}°{along}"),
            Some(Gets::Factor(_, by)) => format!("× {by:.3}{along}"),
        };
        let place = rect.center_bottom() - egui::vec2(0.0, 40.0);
        let font = egui::FontId::proportional(16.0);
        painter.text(
            place + egui::vec2(1.0, 1.0),
            egui::Align2::CENTER_CENTER,
            &text,
            font.clone(),
            Color32::BLACK,
        );
        painter.text(place, egui::Align2::CENTER_CENTER, &text, font, color);
    }
}
