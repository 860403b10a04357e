//! How things are looked at, from one window to the next: beside the documents, and no part of them.

use std::path::{Path, PathBuf};

use egui::{Context, ThemePreference};
use serde::{Deserialize, Serialize};

use super::layout::Layout;
use crate::view::{Mode, Show};

/// What is kept.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Kept {
    /// How solids become pixels.
    pub mode: Mode,
    /// What is shown beside them.
    pub show: Show,
    /// Which of the panels beside the scene are there.
    pub sides: Sides,
    /// Whether it does not matter how hard pens are pressed.
    pub ignores_pens: bool,
    /// Whether strokes without a pen are the stronger the slower they are.
    pub by_speed: bool,
    /// Where the panels are, unless that is as at first.
    pub layout: Option<Layout>,
    /// Whether the window is light or dark.
    pub theme: Theme,
}

/// Whether a window is light or dark.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Theme {
    /// As the others on the screen.
    #[default]
    System,
    /// Dark.
    Dark,
    /// Light.
    Light,
}

impl Theme {
    /// That of a window.
    pub fn of(context: &Context) -> Self {
        match context.options(|o| o.theme_preference) {
            ThemePreference::System => Self::System,
            ThemePreference::Dark => Self::Dark,
            ThemePreference::Light => Self::Light,
        }
    }

    /// Gives it to a window.
    pub fn give(self, context: &Context) {
        context.set_theme(match self {
            Self::System => ThemePreference::System,
            Self::Dark => ThemePreference::Dark,
            Self::Light => ThemePreference::Light,
        });
    }
}

/// Which of the panels beside the scene are there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Sides {
    /// Whether they are there at all.
    pub are_shown: bool,
    /// Whether the tools are.
    pub has_tools: bool,
    /// Whether the objects are.
    pub has_objects: bool,
}

impl Default for Sides {
    fn default() -> Self {
        Self {
            are_shown: true,
            has_tools: true,
            has_objects: true,
        }
    }
}

impl Sides {
    /// One of them is opened or closed; opened it is there even if all were hidden.
    pub fn toggled(mut self, one: impl Fn(&mut Self) -> &mut bool) -> Self {
        let is_there = self.are_shown && *one(&mut self);
        if !self.are_shown {
            (self.has_tools, self.has_objects) = (false, false);
        }
        self.are_shown = true;
        *one(&mut self) = !is_there;
        self
    }
}

fn file(home: &Path) -> PathBuf {
    home.join("view.json")
}

impl Kept {
    /// What was kept in a directory; as usual where nothing was, or nothing that can be read.
    pub fn read(home: &Path) -> Self {
        let text = std::fs::read_to_string(file(home)).unwrap_or_default();
        serde_json::from_str(&text).unwrap_or_default()
    }

    /// Keeps this from now on, if it is another.
    ///
    /// # Errors
    /// Why it cannot be written.
    pub fn keep(&mut self, now: Self, home: &Path) -> Result<(), String> {
        if now == *self {
            return Ok(());
        }
        // What cannot be written is told once.
        *self = now;
        let text = serde_json::to_vec(self).expect("names have a JSON form");
        let file = file(home);
        std::fs::create_dir_all(home).map_err(|e| {
            format!(
                "{}: cannot be made ({e}); check who may write there",
                home.display()
            )
        })?;
        formats::atomic::replace(&file, |out| out.write_all(&text))
            .map_err(|e| format!("{}: {e}", file.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_kept_is_there_in_the_next_window() {
        let home = tempfile::tempdir().unwrap();
        let within = home.path().join("isoclay");
        let mut kept = Kept::read(&within);
        assert_eq!(kept.mode, Mode::Mesh);
        let now = Kept {
            mode: Mode::Volume,
            show: Show {
                wireframe: true,
                scale_bar: false,
                ..Show::default()
            },
            ..kept.clone()
        };
        kept.keep(now.clone(), &within).unwrap();
        assert_eq!(kept, now);
        assert_eq!(Kept::read(&within), kept);
        std::fs::write(file(&within), "{").unwrap();
        assert_eq!(Kept::read(&within), Kept::default());
        // What older windows kept says nothing of what is shown.
        std::fs::write(file(&within), "{\"mode\":\"rays\"}").unwrap();
        assert_eq!(Kept::read(&within).show, Show::default());
    }
}
