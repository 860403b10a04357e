//! Three planes through the chosen object: its density, and where the surface is.

use crate::cli::quantity::human_number;
use crate::view::{Slice, sides};
use crate::window::Bench;
use crate::window::orders::Thing;

/// Across which axes, by the names of the planes.
const PLANES: [(usize, &str); 3] = [(2, "Axial"), (1, "Coronal"), (0, "Sagittal")];
/// Width of a picture on the screen, points.
const WIDE: f32 = 210.0;

/// What is set of the slices, and what is drawn.
pub struct Slices {
    shares: [f64; 3],
    /// Values that are black and white.
    window: [f64; 2],
    range: [f64; 2],
    /// Whether the patient's right is on the left of the picture.
    is_radiological: bool,
    drawn: Vec<Drawn>,
    /// Of which field that is.
    of: Option<(usize, String)>,
    /// Whether something was set since.
    is_old: bool,
}

struct Drawn {
    slice: Slice,
    texture: egui::TextureHandle,
}

impl Slices {
    /// Through the middle.
    pub fn new() -> Self {
        Self {
            shares: [0.5; 3],
            window: [0.0, 1.0],
            range: [0.0, 1.0],
            is_radiological: true,
            drawn: Vec::new(),
            of: None,
            is_old: true,
        }
    }

    /// Draws what is not as it is wished any more.
    fn draw(&mut self, context: &egui::Context, thing: &Thing, is_patient: bool) {
        // A field that was changed is another one.
        let of = (
            std::sync::Arc::as_ptr(&thing.field).cast::<()>() as usize,
            thing.name.clone(),
        );
        if self.of.as_ref() == Some(&of) && !self.is_old {
            return;
        }
        self.is_old = false;
        let is_new = self.of.as_ref().is_none_or(|(_, name)| *name != of.1);
        self.of = Some(of);
        let turned = |axis: usize| is_patient && self.is_radiological && axis != 0;
        let slices = PLANES.map(|(axis, _)| {
            Slice::new(
                &*thing.field,
                &thing.own_box,
                axis,
                self.shares[axis],
                turned(axis),
            )
        });
        if is_new {
            let low = slices
                .iter()
                .map(|s| s.quantile(0.01))
                .fold(f64::INFINITY, f64::min);
            let high = slices
                .iter()
                .map(|s| s.quantile(0.995))
                .fold(f64::NEG_INFINITY, f64::max);
            let spare = 0.2 * (high - low).max(f64::MIN_POSITIVE);
            (self.window, self.range) = ([low, high], [low - spare, high + spare]);
        }
        let drawn = slices.into_iter().zip(PLANES).map(|(slice, (_, name))| {
            let picture = slice.picture(self.window, thing.iso);
            let texture = context.load_texture(name, picture, egui::TextureOptions::LINEAR);
            Drawn { slice, texture }
        });
        self.drawn = drawn.collect();
    }
}

/// A window over the scene, if it is wished.
pub fn slices(context: &egui::Context, bench: &mut Bench) {
    let (Some(mut slices), Some(sheet)) = (bench.slices.take(), bench.sheet.clone()) else {
        return;
    };
    let Some(thing) = sheet.objects.get(sheet.chosen) else {
        return;
    };
    slices.draw(context, thing, thing.is_volume);
    let mut is_open = true;
    egui::Window::new("Slices")
        .default_pos([210.0, 40.0])
        .open(&mut is_open)
        .resizable(false)
        .show(context, |ui| {
            let mut told = String::new();
            ui.horizontal(|ui| {
                for (n, (axis, name)) in PLANES.into_iter().enumerate() {
                    ui.vertical(|ui| told += &plane(ui, &mut slices, n, axis, name, thing));
                }
            });
            ui.separator();
            ui.horizontal(|ui| {
                let (before, range) = (slices.window, slices.range);
                let [black, white] = &mut slices.window;
                let label = ui.label("Black");
                ui.add(
                    egui::Slider::new(black, range[0]..=range[1]).custom_formatter(|n, _| human_number(n)),
                )
                .labelled_by(label.id);
                let label = ui.label("White");
                ui.add(
                    egui::Slider::new(white, range[0]..=range[1]).custom_formatter(|n, _| human_number(n)),
                )
                .labelled_by(label.id);
                if slices.window != before {
                    slices.is_old = true;
                }
                if thing.is_volume {
                    let hint =
                        "On: the patient's right is on the left, as radiologists see it. Off: on the right";
                    if ui
                        .checkbox(&mut slices.is_radiological, "Radiological")
                        .on_hover_text(hint)
                        .changed()
                    {
                        slices.is_old = true;
                    }
                }
            });
            ui.weak(if told.is_empty() {
                "Value and place are told under the mouse"
            } else {
                &told
            });
        });
    if slices.is_old {
        context.request_repaint();
    }
    if is_open {
        bench.slices = Some(slices);
    }
}

/// One plane with its slider; what is under the mouse.
fn plane(ui: &mut egui::Ui, slices: &mut Slices, n: usize, axis: usize, name: &str, thing: &Thing) -> String {
    ui.label(name);
    let Some(drawn) = slices.drawn.get(n) else {
        return String::new();
    };
    let [w, h] = drawn.slice.size;
    let size = egui::vec2(WIDE, WIDE * h as f32 / w as f32);
    let image = ui.add(egui::Image::new((drawn.texture.id(), size)).sense(egui::Sense::hover()));
    let rect = image.rect;
    if thing.is_volume {
        let turned = slices.is_radiological && axis != 0;
        let [left, right, above, below] = sides(axis, turned);
        let places = [
            (left, rect.left_center(), egui::Align2::LEFT_CENTER),
            (right, rect.right_center(), egui::Align2::RIGHT_CENTER),
            (above, rect.center_top(), egui::Align2::CENTER_TOP),
            (below, rect.center_bottom(), egui::Align2::CENTER_BOTTOM),
        ];
        for (text, at, align) in places {
            let font = egui::FontId::proportional(14.0);
            ui.painter()
                .text(at, align, text, font, egui::Color32::from_rgb(120, 200, 255));
        }
    }
    let told = image.hover_pos().map(|at| {
        let share = [
            (at.x - rect.left()) / rect.width(),
            (at.y - rect.top()) / rect.height(),
        ];
        let (p, value) = drawn.slice.at(share.map(f64::from));
        let [x, y, z, value] = [p.x, p.y, p.z, value].map(human_number);
        format!("{value} at {x}, {y}, {z} {}", thing.unit)
    });
    let share = slices.shares[axis];
    let (low, high) = (thing.own_box.min[axis], thing.own_box.max[axis]);
    let mut place = low + share * (high - low);
    ui.spacing_mut().slider_width = WIDE - 80.0;
    let slider = egui::Slider::new(&mut place, low..=high).custom_formatter(|n, _| human_number(n));
    if ui
        .add(slider)
        .on_hover_text(format!("Where the {} plane lies", name.to_lowercase()))
        .changed()
    {
        slices.shares[axis] = (place - low) / (high - low);
        slices.is_old = true;
    }
    told.unwrap_or_default()
}
