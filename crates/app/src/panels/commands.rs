//! The command palette: a few letters, and what is meant is done.

use egui::{Event, Key, Modifiers};

use crate::window::Bench;
use crate::window::actions::Action;

/// Lines that are shown at once.
const LINES: usize = 12;

/// What was typed, and the line that Enter does.
#[derive(Default)]
pub struct Commands {
    text: String,
    line: usize,
    is_old: bool,
}

/// Actions that have all the words typed in their names, those first that begin with them.
fn found(text: &str) -> Vec<Action> {
    let text = text.to_lowercase();
    let name = |action: &Action| format!("{} {}", action.text(), action.group()).to_lowercase();
    let has_all = |action: &Action| text.split_whitespace().all(|word| name(action).contains(word));
    let mut found: Vec<Action> = Action::all().filter(has_all).collect();
    found.sort_by_key(|action| !name(action).starts_with(text.trim()));
    found
}

/// Over all else, while it is asked for.
pub fn commands(context: &egui::Context, bench: &mut Bench) {
    let Some(mut asked) = bench.commands.take() else {
        return;
    };
    let mut chosen = None;
    let modal = egui::Modal::new(egui::Id::unique("commands")).show(context, |ui| {
        ui.set_width(380.0);
        ui.input_mut(|i| {
            if i.consume_key(Modifiers::NONE, Key::ArrowDown) {
                asked.line += 1;
            }
            if i.consume_key(Modifiers::NONE, Key::ArrowUp) {
                asked.line = asked.line.saturating_sub(1);
            }
        });
        let is_done = ui.input_mut(|i| i.consume_key(Modifiers::NONE, Key::Enter));
        let label = ui.label("What is to be done?");
        let is_new = !std::mem::replace(&mut asked.is_old, true);
        if is_new {
            // What a slow picture brings together with the key that asked for the palette.
            let typed = |event: &Event| match event {
                Event::Text(text) => Some(text.clone()),
                _ => None,
            };
            asked.text = ui.input(|i| i.events.iter().filter_map(typed).collect());
        }
        let edit = egui::TextEdit::singleline(&mut asked.text).desired_width(f32::INFINITY);
        let edit = ui.add(edit).labelled_by(label.id);
        if is_new {
            edit.request_focus();
        }
        if edit.changed() {
            asked.line = 0;
        }
        let all = found(&asked.text);
        asked.line = asked.line.min(all.len().saturating_sub(1));
        if is_done {
            chosen = all.get(asked.line).copied();
        }
        ui.add_space(4.0);
        let first = asked.line.saturating_sub(LINES - 1);
        for (n, action) in all.iter().enumerate().skip(first).take(LINES) {
            let keys = bench.keys.text(*action);
            let is_possible = action.is_possible(bench);
            let button = egui::Button::selectable(n == asked.line, action.text())
                .shortcut_text(keys)
                .min_size(egui::vec2(ui.available_width(), 0.0));
            if ui.add_enabled(is_possible, button).clicked() {
                chosen = Some(*action);
            }
        }
        if all.is_empty() {
            ui.weak("Nothing has these words in its name");
        }
    });
    match chosen {
        Some(action) => action.run(bench, context),
        None if modal.should_close() => {}
        None => bench.commands = Some(asked),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_letters_find_what_is_meant() {
        let first = |text: &str| found(text).first().map(|action| action.text());
        assert_eq!(first("und"), Some("Undo"));
        assert_eq!(first("edit red"), Some("Redo"));
        assert_eq!(first("chis"), Some("Chisel"));
        assert_eq!(first("no such thing"), None);
        assert_eq!(found("").len(), Action::all().count());
    }
}
