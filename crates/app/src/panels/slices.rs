//! Three planes through the chosen object: its density, and where the surface is; over the scene, or beside it.

use egui::{Align2, Color32, FontId, Pos2, Rect, Stroke, pos2};
use glam::DVec3;

use super::over::over;
use super::profile::{Profile, profile};
use crate::cli::quantity::human_number;
use crate::view::{Slice, sides};
use crate::window::Bench;
use crate::window::orders::Thing;

/// Across which axes, by the names of the planes.
const PLANES: [(usize, &str); 3] = [(2, "Axial"), (1, "Coronal"), (0, "Sagittal")];
/// Width of a picture in the window over the scene, points.
const WIDE: f32 = 210.0;
/// What stands beside them there, and below and above them.
const BESIDE: [f32; 2] = [40.0, 190.0];
/// Width of a picture below which there is no room for the number of its place.
const NARROW: f32 = 170.0;
/// Height that the profile and the line of what is told take below the scene of four views.
const CHART: f32 = 200.0;
/// Of the other planes in a picture, of the names of its sides, and of the line along which densities are shown.
const CURSOR: Color32 = Color32::from_rgba_premultiplied(60, 100, 130, 130);
const NAMES: Color32 = Color32::from_rgb(120, 200, 255);
const LINE: Color32 = Color32::from_rgb(120, 230, 150);

/// What is set of the slices, and what is drawn.
pub struct Slices {
    /// Where the planes lie, and with them the cursor that all of them go through: shares of the box.
    shares: [f64; 3],
    /// Values that are black and white.
    window: [f64; 2],
    range: [f64; 2],
    /// Whether the patient's right is on the left of the picture.
    is_radiological: bool,
    /// Whether they stand beside the scene, each as large as that.
    pub is_four_up: bool,
    /// Whether a drag draws the line of the profile, not the cursor.
    draws_line: bool,
    profile: Option<Profile>,
    drawn: [Option<Drawn>; 3],
    /// Of which field that is.
    of: Option<(usize, String)>,
}

/// A plane as it is drawn.
struct Drawn {
    slice: Slice,
    texture: egui::TextureHandle,
    /// Where it lies, which way round, and with which values black and white, and the surface.
    at: (f64, bool),
    shades: ([f64; 2], f64),
}

impl Slices {
    /// Through the middle.
    pub fn new() -> Self {
        Self {
            shares: [0.5; 3],
            window: [0.0, 1.0],
            range: [0.0, 1.0],
            is_radiological: true,
            is_four_up: false,
            draws_line: false,
            profile: None,
            drawn: [None, None, None],
            of: None,
        }
    }

    /// The place that all planes go through, in the object's own world.
    pub fn cursor(&self, thing: &Thing) -> DVec3 {
        thing.own_box.min + DVec3::from_array(self.shares) * thing.own_box.size()
    }

    /// The line along which densities are shown.
    #[cfg(test)]
    pub fn line(&self) -> Option<&Profile> {
        self.profile.as_ref()
    }

    fn set_cursor(&mut self, thing: &Thing, p: DVec3, except: usize) {
        let share = (p - thing.own_box.min) / thing.own_box.size();
        for axis in (0..3).filter(|axis| *axis != except) {
            self.shares[axis] = share[axis].clamp(0.0, 1.0);
        }
    }

    /// Draws what is not as it is wished any more.
    fn draw(&mut self, context: &egui::Context, thing: &Thing) {
        // A field that was changed is another one.
        let of = (
            std::sync::Arc::as_ptr(&thing.field).cast::<()>() as usize,
            thing.name.clone(),
        );
        let before = self.of.replace(of.clone());
        if before.as_ref() != Some(&of) {
            self.drawn = [None, None, None];
            if let Some(profile) = &mut self.profile {
                profile.read(&*thing.field);
            }
        }
        let is_new = before.is_none_or(|(_, name)| name != of.1);
        if is_new {
            self.profile = None;
            let slices = PLANES.map(|(axis, _)| self.slice(thing, axis));
            let of_all = |share: f64, first: f64, pick: fn(f64, f64) -> f64| {
                slices.iter().map(|s| s.quantile(share)).fold(first, pick)
            };
            let low = of_all(0.01, f64::INFINITY, f64::min);
            let high = of_all(0.995, f64::NEG_INFINITY, f64::max);
            let spare = 0.2 * (high - low).max(f64::MIN_POSITIVE);
            (self.window, self.range) = ([low, high], [low - spare, high + spare]);
        }
        for (n, (axis, name)) in PLANES.into_iter().enumerate() {
            let at = (self.shares[axis], self.is_turned(thing, axis));
            let shades = (self.window, thing.iso);
            let known = self.drawn[n].take();
            if known.as_ref().is_some_and(|d| (d.at, d.shades) == (at, shades)) {
                self.drawn[n] = known;
                continue;
            }
            let known = known.filter(|d| d.at == at).map(|d| d.slice);
            let slice = known.unwrap_or_else(|| self.slice(thing, axis));
            let picture = slice.picture(self.window, thing.iso);
            let texture = context.load_texture(name, picture, egui::TextureOptions::LINEAR);
            self.drawn[n] = Some(Drawn {
                slice,
                texture,
                at,
                shades,
            });
        }
    }

    fn is_turned(&self, thing: &Thing, axis: usize) -> bool {
        thing.is_volume && self.is_radiological && axis != 0
    }

    fn slice(&self, thing: &Thing, axis: usize) -> Slice {
        let turned = self.is_turned(thing, axis);
        Slice::new(&*thing.field, &thing.own_box, axis, self.shares[axis], turned)
    }
}

/// A window over the scene, if it is wished: with the planes, or, where they stand beside the scene, with the profile, if one is drawn.
pub fn slices(context: &egui::Context, bench: &mut Bench) {
    let (Some(mut slices), Some(sheet)) = (bench.slices.take(), bench.sheet.clone()) else {
        return;
    };
    let Some(thing) = sheet.objects.get(sheet.chosen) else {
        return;
    };
    slices.draw(context, thing);
    let mut is_open = true;
    if slices.is_four_up {
        if let Some(line) = &slices.profile {
            let all = context.content_rect();
            egui::Window::new("Profile")
                .default_pos(pos2(all.center().x, all.bottom() - CHART))
                .constrain_to(all)
                .open(&mut is_open)
                .resizable(false)
                .show(context, |ui| profile(ui, line, thing));
        }
        if !is_open {
            slices.profile = None;
        }
        bench.slices = Some(slices);
        return;
    }
    let whole = context.content_rect().size();
    // No larger than the window lets all three be seen with what is set of them.
    let wide = WIDE.min((whole.x - BESIDE[0]) / 3.0);
    let room = [wide, whole.y - BESIDE[1]];
    over(context, "Slices", 212.0)
        .open(&mut is_open)
        .resizable(false)
        .show(context, |ui| {
            let mut told = String::new();
            ui.horizontal(|ui| {
                for n in 0..3 {
                    ui.vertical(|ui| told += &plane(ui, &mut slices, n, thing, room));
                }
            });
            ui.separator();
            ui.horizontal(|ui| shades(ui, &mut slices));
            ui.horizontal(|ui| choices(ui, &mut slices, thing));
            if let Some(line) = &slices.profile {
                profile(ui, line, thing);
            }
            ui.weak(if told.is_empty() {
                "Value and place are told under the mouse"
            } else {
                &told
            });
        });
    if is_open {
        bench.slices = Some(slices);
    }
}

/// What is set of planes that stand beside the scene, above them.
pub fn slice_settings(ui: &mut egui::Ui, bench: &mut Bench) {
    let sheet = bench.sheet.clone();
    let thing = sheet.as_ref().and_then(|sheet| sheet.objects.get(sheet.chosen));
    if let (Some(slices), Some(thing)) = (&mut bench.slices, thing) {
        ui.horizontal_wrapped(|ui| {
            shades(ui, slices);
            choices(ui, slices, thing);
        });
    }
}

/// One of the planes, in a place of its own beside the scene.
pub fn slice_beside(ui: &mut egui::Ui, bench: &mut Bench, n: usize) {
    let (Some(mut slices), Some(sheet)) = (bench.slices.take(), bench.sheet.clone()) else {
        return;
    };
    if let Some(thing) = sheet.objects.get(sheet.chosen) {
        slices.draw(ui.ctx(), thing);
        let room = ui.available_size() - egui::vec2(12.0, 48.0);
        let told = plane(ui, &mut slices, n, thing, room.into());
        ui.weak(told);
    }
    bench.slices = Some(slices);
}

/// The values that are black and white.
fn shades(ui: &mut egui::Ui, slices: &mut Slices) {
    let range = slices.range;
    let [black, white] = &mut slices.window;
    for (name, density) in [("Black", black), ("White", white)] {
        let label = ui.label(name);
        let slider = egui::Slider::new(density, range[0]..=range[1]);
        ui.add(slider.custom_formatter(|n, _| human_number(n)))
            .labelled_by(label.id);
    }
}

fn choices(ui: &mut egui::Ui, slices: &mut Slices, thing: &Thing) {
    ui.checkbox(&mut slices.is_four_up, "Four views")
        .on_hover_text("The planes beside the scene, each in a quarter of the window");
    if thing.is_volume {
        let hint = "On: the patient's right is on the left, as radiologists see it. Off: on the right";
        ui.checkbox(&mut slices.is_radiological, "Radiological")
            .on_hover_text(hint);
    }
    ui.checkbox(&mut slices.draws_line, "Profile")
        .on_hover_text("A drag in a plane draws a line, along which the densities are shown");
    if slices.profile.is_some() && ui.button("Clear").clicked() {
        slices.profile = None;
    }
}

/// One plane with its slider, no larger than there is room; what is under the mouse.
fn plane(ui: &mut egui::Ui, slices: &mut Slices, n: usize, thing: &Thing, room: [f32; 2]) -> String {
    let (axis, name) = PLANES[n];
    let Some(drawn) = &slices.drawn[n] else {
        return String::new();
    };
    let [w, h] = drawn.slice.size.map(|n| n as f32);
    let scale = (room[0] / w).min(room[1] / h).max(0.05);
    let picture = egui::Image::new((drawn.texture.id(), egui::vec2(scale * w, scale * h)));
    ui.horizontal(|ui| {
        ui.label(name);
        let share = slices.shares[axis];
        let (low, high) = (thing.own_box.min[axis], thing.own_box.max[axis]);
        let mut place = low + share * (high - low);
        let has_room = room[0] >= NARROW;
        let others = if has_room { 140.0 } else { 70.0 };
        ui.spacing_mut().slider_width = (scale * w - others).max(40.0);
        let slider = egui::Slider::new(&mut place, low..=high)
            .show_value(has_room)
            .custom_formatter(|n, _| human_number(n));
        let slider = ui.add(slider);
        if slider
            .on_hover_text(format!("Where the {} plane lies", name.to_lowercase()))
            .changed()
        {
            slices.shares[axis] = (place - low) / (high - low);
        }
    });
    let image = ui.add(picture.sense(egui::Sense::click_and_drag()));
    let rect = image.rect;
    let share = |at: Pos2| {
        let way = (at - rect.min) / rect.size();
        [way.x, way.y].map(|s| f64::from(s.clamp(0.0, 1.0)))
    };
    let told = image.hover_pos().map(|at| {
        let (p, value) = drawn.slice.at(share(at));
        let [x, y, z, value] = [p.x, p.y, p.z, value].map(human_number);
        format!("{value} at {x}, {y}, {z} {}", thing.unit)
    });
    if let Some(at) = image.interact_pointer_pos() {
        let p = drawn.slice.place_at(share(at));
        if !slices.draws_line {
            slices.set_cursor(thing, p, axis);
        } else if let Some(profile) = slices.profile.as_mut().filter(|p| p.axis == axis)
            && !image.drag_started()
        {
            profile.ends[1] = p;
            profile.read(&*thing.field);
        } else {
            slices.profile = Some(Profile::new(axis, p, &*thing.field));
        }
    }
    marks(ui, slices, n, thing, rect);
    told.unwrap_or_default()
}

/// Over a plane: the sides of the patient, where the other planes are, and the line of the profile.
fn marks(ui: &egui::Ui, slices: &Slices, n: usize, thing: &Thing, rect: Rect) {
    let axis = PLANES[n].0;
    let Some(drawn) = &slices.drawn[n] else { return };
    let painter = ui.painter().with_clip_rect(rect);
    let place = |p: DVec3| {
        let [x, y] = drawn.slice.share_of(p).map(|s| s as f32);
        pos2(rect.left() + x * rect.width(), rect.top() + y * rect.height())
    };
    let cursor = place(slices.cursor(thing));
    painter.vline(cursor.x, rect.y_range(), Stroke::new(1.0, CURSOR));
    painter.hline(rect.x_range(), cursor.y, Stroke::new(1.0, CURSOR));
    if let Some(profile) = slices.profile.as_ref().filter(|profile| profile.axis == axis) {
        let ends = profile.ends.map(place);
        painter.line_segment(ends, Stroke::new(2.0, LINE));
        painter.circle_filled(ends[0], 3.0, LINE);
    }
    if thing.is_volume {
        let [left, right, above, below] = sides(axis, slices.is_turned(thing, axis));
        let places = [
            (left, rect.left_center(), Align2::LEFT_CENTER),
            (right, rect.right_center(), Align2::RIGHT_CENTER),
            (above, rect.center_top(), Align2::CENTER_TOP),
            (below, rect.center_bottom(), Align2::CENTER_BOTTOM),
        ];
        for (text, at, align) in places {
            painter.text(at, align, text, FontId::proportional(14.0), NAMES);
        }
    }
}
