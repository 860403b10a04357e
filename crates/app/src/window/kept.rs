//! How things are looked at, from one window to the next: beside the documents, and no part of them.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::view::{Mode, Show};

/// What is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Kept {
    /// How solids become pixels.
    pub mode: Mode,
    /// What is shown beside them.
    pub show: Show,
    /// Where the panels are.
    pub sides: Sides,
    /// Whether it does not matter how hard pens are pressed.
    pub ignores_pens: bool,
}

/// Where the panels beside the scene are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Sides {
    /// Whether they are there at all.
    pub are_shown: bool,
    /// Whether the tools are on the right, and the objects on the left.
    pub are_swapped: bool,
}

impl Default for Sides {
    fn default() -> Self {
        Self {
            are_shown: true,
            are_swapped: false,
        }
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
        let text = serde_json::to_vec(&now).expect("names have a JSON form");
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
            ..kept
        };
        kept.keep(now, &within).unwrap();
        assert_eq!(kept, now);
        assert_eq!(Kept::read(&within), kept);
        std::fs::write(file(&within), "{").unwrap();
        assert_eq!(Kept::read(&within), Kept::default());
        // What older windows kept says nothing of what is shown.
        std::fs::write(file(&within), "{\"mode\":\"rays\"}").unwrap();
        assert_eq!(Kept::read(&within).show, Show::default());
    }
}
