//! Which keys do what: as usual, or as the user has changed it, kept beside the other settings.

use std::collections::BTreeMap;
use std::path::PathBuf;

use egui::{Key, KeyboardShortcut, Modifiers};

use super::actions::Action;

/// Which keys do what.
#[derive(Clone, Debug, Default)]
pub struct Keys {
    file: PathBuf,
    /// By the names of actions: the keys that they have in place of their usual ones; none for no keys.
    changed: BTreeMap<String, Option<String>>,
}

impl Keys {
    /// As a directory has them; as usual where it has none, or none that can be read.
    pub fn read(directory: &std::path::Path) -> Self {
        let file = directory.join("keys.json");
        let text = std::fs::read_to_string(&file).unwrap_or_default();
        Self {
            changed: serde_json::from_str(&text).unwrap_or_default(),
            file,
        }
    }

    /// The keys of an action.
    pub fn of(&self, action: Action) -> Option<KeyboardShortcut> {
        match self.changed.get(&action.id()) {
            Some(keys) => keys.as_deref().and_then(parsed),
            None => action.usual(),
        }
    }

    /// The same as people read it; empty for none.
    pub fn text(&self, action: Action) -> String {
        self.of(action).as_ref().map_or(String::new(), written)
    }

    /// The action that has these keys already, where they cannot serve both.
    pub fn conflict(&self, action: Action, keys: &KeyboardShortcut) -> Option<Action> {
        Action::all().find(|other| action.meets(*other) && self.of(*other).as_ref() == Some(keys))
    }

    /// Whether an action has other keys than usual.
    pub fn is_changed(&self, action: Action) -> bool {
        self.of(action) != action.usual()
    }

    /// Gives an action other keys, or none; keys that belong to another action are taken from that.
    ///
    /// # Errors
    /// Why that cannot be kept for the next window.
    pub fn set(&mut self, action: Action, keys: Option<KeyboardShortcut>) -> Result<(), String> {
        if let Some(before) = keys.as_ref().and_then(|keys| self.conflict(action, keys)) {
            self.changed.insert(before.id(), None);
        }
        self.changed.insert(action.id(), keys.as_ref().map(written));
        self.keep()
    }

    /// Gives all actions their usual keys.
    ///
    /// # Errors
    /// As [`set`](Self::set).
    pub fn reset(&mut self) -> Result<(), String> {
        self.changed.clear();
        self.keep()
    }

    fn keep(&mut self) -> Result<(), String> {
        self.changed.retain(|id, keys| {
            let action = Action::all().find(|action| action.id() == *id);
            action.is_some_and(|action| action.usual().as_ref().map(written) != *keys)
        });
        let text = serde_json::to_vec_pretty(&self.changed).expect("names have a JSON form");
        let directory = self.file.parent().expect("it is in a directory");
        std::fs::create_dir_all(directory).map_err(|e| {
            format!(
                "{}: cannot be made ({e}); check who may write there",
                directory.display()
            )
        })?;
        formats::atomic::replace(&self.file, |out| out.write_all(&text))
            .map_err(|e| format!("{}: {e}", self.file.display()))
    }

    /// What is asked for by the keys pressed now, while objects are arranged or sculpted.
    pub fn pressed(&self, context: &egui::Context, arranging: bool) -> Vec<Action> {
        let with_keys = Action::all()
            .filter(|action| action.while_arranging().is_none_or(|only| only == arranging))
            .filter_map(|action| Some((self.of(action)?, action)));
        let mut all: Vec<_> = with_keys.collect();
        // Ctrl-Shift-Z is no Ctrl-Z.
        all.sort_by_key(|(keys, _)| std::cmp::Reverse(weight(keys.modifiers)));
        context.input_mut(|i| {
            all.into_iter()
                .filter(|(keys, _)| i.consume_shortcut(keys))
                .map(|(_, action)| action)
                .collect()
        })
    }
}

fn weight(keys: Modifiers) -> u8 {
    u8::from(keys.alt) + u8::from(keys.shift) + u8::from(keys.command || keys.ctrl)
}

/// Keys as people read them, and as files have them.
pub fn written(keys: &KeyboardShortcut) -> String {
    let m = keys.modifiers;
    let parts = [
        (m.command || m.ctrl, "Ctrl+"),
        (m.alt, "Alt+"),
        (m.shift, "Shift+"),
    ];
    let mut text: String = parts
        .iter()
        .filter(|(is, _)| *is)
        .map(|(_, name)| *name)
        .collect();
    text.push_str(keys.logical_key.name());
    text
}

fn parsed(text: &str) -> Option<KeyboardShortcut> {
    let mut parts: Vec<&str> = text.split('+').collect();
    let key = Key::from_name(parts.pop()?)?;
    let mut modifiers = Modifiers::NONE;
    for part in parts {
        modifiers |= match part {
            "Ctrl" => Modifiers::COMMAND,
            "Alt" => Modifiers::ALT,
            "Shift" => Modifiers::SHIFT,
            _ => return None,
        };
    }
    Some(KeyboardShortcut::new(modifiers, key))
}

#[cfg(test)]
mod tests {
    use super::super::actions::Name;
    use super::*;

    #[test]
    fn no_two_actions_have_one_key_and_all_keys_can_be_written() {
        let all: Vec<Action> = Action::all().collect();
        for (n, one) in all.iter().enumerate() {
            assert!(
                all[..n].iter().all(|other| other.id() != one.id()),
                "{}",
                one.id()
            );
            let Some(keys) = one.usual() else { continue };
            assert_eq!(parsed(&written(&keys)), Some(keys));
            let twin = all[..n]
                .iter()
                .find(|other| other.meets(*one) && other.usual() == Some(keys));
            assert!(twin.is_none(), "{} and {twin:?}", one.id());
        }
    }

    #[test]
    fn changed_keys_are_there_in_the_next_window_and_taken_from_who_had_them() {
        let home = tempfile::tempdir().unwrap();
        let within = home.path().join("isoclay");
        let (undo, all) = (Action::Do(Name::Undo), Action::Do(Name::All));
        let mut keys = Keys::read(&within);
        let home_key = all.usual();
        keys.set(undo, home_key).unwrap();
        let keys = Keys::read(&within);
        assert_eq!((keys.of(undo), keys.of(all)), (home_key, None));
        let mut keys = keys;
        keys.reset().unwrap();
        assert_eq!(Keys::read(&within).of(undo), undo.usual());
        std::fs::write(within.join("keys.json"), "[").unwrap();
        assert_eq!(Keys::read(&within).of(all), home_key);
    }
}
