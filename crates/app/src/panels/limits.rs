//! Where strokes act: on both sides of a plane, in boxes or a lasso, below a skin, above fine detail.

use bspline::Aabb;
use egui::{CollapsingHeader, DragValue, Ui};
use glam::DVec3;

use crate::window::Bench;
use crate::window::orders::Thing;

/// Where strokes act.
pub fn limits(ui: &mut Ui, bench: &mut Bench) {
    let Some(thing) = bench.chosen().cloned() else {
        return;
    };
    CollapsingHeader::new("Where it acts").show_unindented(ui, |ui| {
        let limits = &mut bench.limits;
        ui.horizontal(|ui| {
            ui.label("Both sides of")
                .on_hover_text("Strokes happen on both sides of a plane across this axis");
            for (n, name) in ["X", "Y", "Z"].into_iter().enumerate() {
                let axis = DVec3::AXES[n];
                let is_on = limits.symmetry.is_some_and(|(_, normal)| normal == axis);
                if ui.selectable_label(is_on, name).clicked() {
                    limits.symmetry = (!is_on).then(|| (thing.own_box.center(), axis));
                }
            }
        });
        if let Some((at, normal)) = &mut limits.symmetry {
            let n = usize::from(normal.y != 0.0) + 2 * usize::from(normal.z != 0.0);
            let size = thing.own_box.size()[n];
            let range = thing.own_box.min[n]..=thing.own_box.max[n];
            ui.horizontal(|ui| {
                let label = ui.label("Plane at");
                let field = DragValue::new(&mut at[n])
                    .range(range)
                    .speed(size / 500.0)
                    .suffix(format!(" {}", thing.unit));
                ui.add(field).labelled_by(label.id);
            });
        }
        let wide = thing.own_box.size().max_element();
        optional(
            ui,
            "Keep the skin",
            &mut limits.wall,
            0.02 * wide,
            wide,
            thing.unit,
            "Only what lies deeper than this below the outer surface changes",
        );
        let mut is_coarse = limits.coarse.is_some();
        if ui
            .checkbox(&mut is_coarse, "Keep fine detail")
            .on_hover_text(
                "Only levels of the field up to this one are changed; what finer ones add stays where it is",
            )
            .changed()
        {
            limits.coarse = is_coarse.then_some(1);
        }
        if let Some(level) = &mut limits.coarse {
            ui.horizontal(|ui| {
                let label = ui.label("Coarse to level");
                ui.add(DragValue::new(level).range(0..=20)).labelled_by(label.id);
            });
        }
        masks(ui, bench, &thing);
    });
}

/// A length that may be missing.
fn optional(ui: &mut Ui, name: &str, value: &mut Option<f64>, usual: f64, most: f64, unit: &str, hint: &str) {
    ui.horizontal(|ui| {
        let mut is_on = value.is_some();
        if ui.checkbox(&mut is_on, name).on_hover_text(hint).changed() {
            *value = is_on.then_some(usual);
        }
        if let Some(length) = value {
            let field = DragValue::new(length)
                .range(1e-6 * most..=most)
                .speed(most / 1000.0)
                .max_decimals(3);
            ui.add(field.suffix(format!(" {unit}")));
        }
    });
}

/// The boxes that strokes keep to, and what they mean.
fn masks(ui: &mut Ui, bench: &mut Bench, thing: &Thing) {
    let limits = &mut bench.limits;
    ui.horizontal(|ui| {
        if ui
            .button("Add a box")
            .on_hover_text("Strokes change what lies in boxes alone, or spare it")
            .clicked()
        {
            let (center, half) = (thing.own_box.center(), 0.25 * thing.own_box.size());
            limits.boxes.push(Aabb::new(center - half, center + half));
        }
        if (limits.lasso.is_some() || !limits.boxes.is_empty()) && ui.button("None").clicked() {
            limits.boxes.clear();
            limits.lasso = None;
        }
    });
    if limits.lasso.is_some() {
        ui.label("Within the lasso");
    }
    let (mut gone, mut pinned) = (None, None);
    for (n, b) in limits.boxes.iter_mut().enumerate() {
        ui.push_id(n, |ui| {
            ui.horizontal(|ui| {
                ui.label(format!("Box {}", n + 1));
                if ui.small_button("Remove").clicked() {
                    gone = Some(n);
                }
                let pin = ui.small_button("Pin");
                if pin
                    .on_hover_text("Force tools leave the surface in it where it is, as it is now")
                    .clicked()
                {
                    pinned = Some((n, *b));
                }
            });
            let step = thing.own_box.size().max_element() / 500.0;
            corner(ui, "from", &mut b.min, step);
            corner(ui, "to", &mut b.max, step);
            b.max = b.max.max(b.min + 1e-3 * step);
        });
    }
    if let Some(n) = gone {
        limits.boxes.remove(n);
    }
    if limits.lasso.is_some() || !limits.boxes.is_empty() {
        ui.checkbox(&mut limits.keeps, "Spare what is inside");
        optional(
            ui,
            "Soft border",
            &mut limits.soft,
            0.02 * thing.own_box.size().max_element(),
            thing.own_box.size().max_element(),
            thing.unit,
            "Length inwards over which strokes grow to their whole",
        );
    }
    // A box that is held bounds strokes no more.
    if let Some((n, b)) = pinned
        && bench.pin_box(&b)
    {
        bench.limits.boxes.remove(n);
    }
}

fn corner(ui: &mut Ui, name: &str, p: &mut DVec3, step: f64) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        ui.spacing_mut().interact_size.x = 42.0;
        let label = ui.label(name);
        for n in 0..3 {
            ui.add(DragValue::new(&mut p[n]).speed(step).max_decimals(2))
                .labelled_by(label.id);
        }
    });
}
