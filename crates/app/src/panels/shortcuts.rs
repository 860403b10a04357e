//! All that keys do, and which; each can be given others.

use egui::{Event, Key, KeyboardShortcut, Modifiers};

use super::over::over;
use crate::window::Bench;
use crate::window::actions::Action;
use crate::window::keys::written;

/// Which action waits for keys, and those that another one has.
#[derive(Default)]
pub struct Shortcuts {
    waits: Option<Action>,
    taken: Option<(Action, KeyboardShortcut)>,
    text: String,
}

impl Shortcuts {
    /// Whether the next keys are meant for it.
    pub fn listens(&self) -> bool {
        self.waits.is_some()
    }
}

/// In a window of its own.
pub fn shortcuts(context: &egui::Context, bench: &mut Bench) {
    let Some(mut table) = bench.shortcuts.take() else {
        return;
    };
    if let Some(action) = table.waits
        && let Some(keys) = pressed(context)
    {
        table.waits = None;
        // A button that is focused would take all keys from now on.
        context.memory_mut(|memory| memory.stop_text_input());
        match keys {
            Some(keys) if bench.keys.conflict(action, &keys).is_some() => table.taken = Some((action, keys)),
            Some(keys) => set(bench, action, Some(keys)),
            None => {}
        }
    }
    let mut is_open = true;
    over(context, "Shortcuts", 212.0)
        .open(&mut is_open)
        .default_size([420.0, 440.0])
        .show(context, |ui| show(ui, bench, &mut table));
    if is_open {
        bench.shortcuts = Some(table);
    }
}

fn show(ui: &mut egui::Ui, bench: &mut Bench, table: &mut Shortcuts) {
    if let Some((action, keys)) = table.taken {
        let other = bench.keys.conflict(action, &keys);
        let name = other.map_or("nothing", Action::text);
        ui.colored_label(
            ui.visuals().warn_fg_color,
            format!("{} belongs to {name} already", written(&keys)),
        );
        ui.horizontal(|ui| {
            if ui.button(format!("Take it for {}", action.text())).clicked() {
                set(bench, action, Some(keys));
                table.taken = None;
            }
            if ui.button("Leave it").clicked() {
                table.taken = None;
            }
        });
    }
    ui.horizontal(|ui| {
        let label = ui.label("Find");
        ui.add(egui::TextEdit::singleline(&mut table.text).desired_width(180.0))
            .labelled_by(label.id);
        if ui.button("All as usual").clicked()
            && let Err(why) = bench.keys.reset()
        {
            bench.tell(why, true);
        }
    });
    let wanted = table.text.to_lowercase();
    egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        let mut group = "";
        egui::Grid::new("shortcuts")
            .num_columns(3)
            .striped(true)
            .show(ui, |ui| {
                for action in Action::all().filter(|a| a.text().to_lowercase().contains(&wanted)) {
                    if group != action.group() {
                        group = action.group();
                        ui.strong(group);
                        ui.end_row();
                    }
                    ui.label(action.text());
                    let text = match (table.waits == Some(action), bench.keys.text(action)) {
                        (true, _) => "press keys…".into(),
                        (false, text) if text.is_empty() => "none".into(),
                        (false, text) => text,
                    };
                    let button = egui::Button::new(text).min_size(egui::vec2(110.0, 0.0));
                    let button = ui
                        .add(button)
                        .on_hover_text("Click, then press the keys that it is to have; Esc leaves them");
                    if button.clicked() {
                        table.waits = Some(action);
                    }
                    ui.horizontal(|ui| {
                        if bench.keys.of(action).is_some() && ui.small_button("None").clicked() {
                            set(bench, action, None);
                        }
                        if bench.keys.is_changed(action) && ui.small_button("Usual").clicked() {
                            let usual = action.usual();
                            set(bench, action, usual);
                        }
                    });
                    ui.end_row();
                }
            });
    });
}

fn set(bench: &mut Bench, action: Action, keys: Option<KeyboardShortcut>) {
    if let Err(why) = bench.keys.set(action, keys) {
        bench.tell(why, true);
    }
}

/// Keys that are pressed now; nothing inside for Esc.
fn pressed(context: &egui::Context) -> Option<Option<KeyboardShortcut>> {
    let event = context.input_mut(|i| {
        let at = i
            .events
            .iter()
            .position(|e| matches!(e, Event::Key { pressed: true, .. }))?;
        Some(i.events.remove(at))
    });
    let Some(Event::Key { key, modifiers, .. }) = event else {
        return None;
    };
    let plain = Modifiers {
        alt: modifiers.alt,
        shift: modifiers.shift,
        ..if modifiers.command {
            Modifiers::COMMAND
        } else {
            Modifiers::NONE
        }
    };
    Some((key != Key::Escape).then(|| KeyboardShortcut::new(plain, key)))
}
