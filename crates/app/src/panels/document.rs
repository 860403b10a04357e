//! The objects, with what hangs on what, and the history.

use document::Command;
use egui::{Key, Ui};
use serde_json::json;

use crate::cli::quantity::human_count;
use crate::window::Bench;
use crate::window::actions::{Action, Name};
use crate::window::orders::{Order, Sheet, Thing};

/// Height that is left to the history, points.
const HISTORY: f32 = 130.0;

/// Beside the scene.
pub fn document(ui: &mut Ui, bench: &mut Bench) {
    let Some(sheet) = bench.sheet.clone() else { return };
    ui.add_space(6.0);
    ui.heading("Objects");
    // However much is folded out, some of the history stays to be seen.
    egui::ScrollArea::vertical()
        .id_salt("document")
        .max_height(ui.available_height() - HISTORY)
        .show(ui, |ui| {
            for thing in sheet.objects.iter().filter(|thing| thing.parent.is_none()) {
                object(ui, bench, &sheet, thing, 0);
            }
            ui.add_space(10.0);
            super::surface(ui, bench);
            super::show(ui, bench);
            super::matter(ui, bench);
            super::constraints(ui, bench);
        });
    history(ui, bench, &sheet);
}

/// A line of the tree, and those that hang on it.
fn object(ui: &mut Ui, bench: &mut Bench, sheet: &Sheet, thing: &Thing, depth: usize) {
    let is_renamed = bench
        .renames
        .as_ref()
        .is_some_and(|(name, _)| *name == thing.name);
    ui.horizontal(|ui| {
        ui.add_space(12.0 * depth as f32);
        let mut is_seen = !bench.hidden.contains(&thing.name);
        let eye = ui
            .checkbox(&mut is_seen, "")
            .on_hover_text("Whether it is seen; no edit");
        eye.widget_info(|| {
            let text = format!("{} is seen", thing.name);
            egui::WidgetInfo::selected(egui::Role::CheckBox, true, is_seen, text)
        });
        if eye.changed() {
            match is_seen {
                true => drop(bench.hidden.remove(&thing.name)),
                false => drop(bench.hidden.insert(thing.name.clone())),
            }
        }
        match is_renamed {
            true => rename(ui, bench),
            false => line(ui, bench, sheet, thing),
        }
    });
    // Deeper than objects there are nothing hangs.
    if depth < sheet.objects.len() {
        for child in sheet
            .objects
            .iter()
            .filter(|child| child.parent.as_ref() == Some(&thing.name))
        {
            object(ui, bench, sheet, child, depth + 1);
        }
    }
}

fn line(ui: &mut Ui, bench: &mut Bench, sheet: &Sheet, thing: &Thing) {
    let is_chosen = sheet
        .objects
        .get(sheet.chosen)
        .is_some_and(|chosen| chosen.name == thing.name);
    let size = thing.own_box.size();
    let about = format!(
        "{:.3} × {:.3} × {:.3} {}, {} coefficients\nDouble click: another name. Right: what can be done with it",
        size.x,
        size.y,
        size.z,
        thing.unit,
        human_count(thing.coefficients)
    );
    let label = ui.selectable_label(is_chosen, &thing.name).on_hover_text(about);
    if label.double_clicked() {
        bench.renames = Some((thing.name.clone(), thing.name.clone()));
    } else if label.clicked() {
        bench.order(Order::Choose(thing.name.clone()));
    }
    label.context_menu(|ui| {
        let button = |ui: &mut Ui, text: &str| ui.button(text).clicked();
        if button(ui, "Rename") {
            bench.renames = Some((thing.name.clone(), thing.name.clone()));
        }
        for name in [
            Name::Duplicate,
            Name::Remove,
            Name::Shift,
            Name::Turn,
            Name::Scale,
        ] {
            let action = Action::Do(name);
            if ui
                .add_enabled(action.is_possible(bench), egui::Button::new(action.text()))
                .clicked()
            {
                bench.order(Order::Choose(thing.name.clone()));
                match name {
                    Name::Remove => bench.order(Order::Command(Box::new(Command::Remove {
                        object: thing.name.clone(),
                    }))),
                    _ => action.run(bench, ui.ctx()),
                }
            }
        }
        ui.separator();
        for (title, tool) in [("Add", "add"), ("Take out", "carve")] {
            ui.menu_button(format!("{title} another object"), |ui| {
                for other in sheet.objects.iter().filter(|other| other.name != thing.name) {
                    if button(ui, &other.name) {
                        bench.order(Order::Choose(thing.name.clone()));
                        bench.stroke(json!({ tool: joined(thing, other) }));
                    }
                }
            });
        }
        ui.menu_button("Moves with", |ui| {
            if ui
                .add_enabled(thing.parent.is_some(), egui::Button::new("nothing"))
                .clicked()
            {
                bench.order(Order::Choose(thing.name.clone()));
                bench.stroke(json!({ "place": { "parent": "" } }));
            }
            for other in sheet
                .objects
                .iter()
                .filter(|other| !hangs_on(sheet, other, &thing.name))
            {
                if button(ui, &other.name) {
                    bench.order(Order::Choose(thing.name.clone()));
                    bench.stroke(json!({ "place": { "parent": other.name } }));
                }
            }
        });
    });
}

/// Another object where it lies, as a solid that is put on or taken out.
fn joined(thing: &Thing, other: &Thing) -> serde_json::Value {
    let own = thing.world_from_object.inverse() * other.world_from_object;
    let middle = own.transform_point3(other.own_box.center());
    json!({ "shape": { "object": { "name": other.name } }, "along": [middle.to_array()] })
}

/// Whether an object is the one of a name, or hangs on it.
fn hangs_on(sheet: &Sheet, thing: &Thing, name: &str) -> bool {
    let mut now = Some(thing);
    for _ in 0..=sheet.objects.len() {
        match now {
            Some(above) if above.name == name => return true,
            Some(above) => {
                now = sheet
                    .objects
                    .iter()
                    .find(|o| Some(&o.name) == above.parent.as_ref())
            }
            None => return false,
        }
    }
    true
}

fn rename(ui: &mut Ui, bench: &mut Bench) {
    let Some((name, mut to)) = bench.renames.take() else {
        return;
    };
    let label = ui.label("Name");
    let field = ui
        .add(egui::TextEdit::singleline(&mut to).desired_width(110.0))
        .labelled_by(label.id);
    if field.lost_focus() {
        if !ui.input(|i| i.key_pressed(Key::Escape)) && to.trim() != name && !to.trim().is_empty() {
            bench.order(Order::Command(Box::new(Command::Rename {
                object: name,
                to: to.trim().into(),
            })));
        }
        return;
    }
    if !field.has_focus() {
        field.request_focus();
    }
    bench.renames = Some((name, to));
}

fn history(ui: &mut Ui, bench: &Bench, sheet: &Sheet) {
    ui.heading("History");
    egui::ScrollArea::vertical()
        .auto_shrink(false)
        .stick_to_bottom(true)
        .show(ui, |ui| {
            let go_to = |done: usize| match done.cmp(&sheet.done) {
                std::cmp::Ordering::Less => bench.order(Order::Undo(sheet.done - done)),
                std::cmp::Ordering::Greater => bench.order(Order::Redo(done - sheet.done)),
                std::cmp::Ordering::Equal => {}
            };
            if ui.selectable_label(sheet.done == 0, "as it was").clicked() {
                go_to(0);
            }
            for (n, title) in sheet.history.iter().enumerate() {
                let text = egui::RichText::new(format!("{}  {title}", n + 1));
                let text = if n < sheet.done { text } else { text.weak() };
                if ui.selectable_label(n + 1 == sheet.done, text).clicked() {
                    go_to(n + 1);
                }
            }
        });
}
