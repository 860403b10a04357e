//! What the desk writes.

use std::ffi::OsString;
use std::path::Path;

use document::{Command, CommandError};

use super::Desk;
use crate::cli::desk_files;
use crate::window::orders::News;

impl Desk {
    /// Goes on in a copy under another name.
    pub(super) fn save(&mut self, path: &Path) -> Result<(), String> {
        self.end();
        let Some(open) = &mut self.open else { return Ok(()) };
        let (from, was_untitled) = (open.path.clone(), open.is_untitled);
        if from == path {
            return Ok(());
        }
        // Every edit is in its file already.
        open.document = None;
        let copied = formats::atomic::replace(path, |out| {
            std::io::copy(&mut std::fs::File::open(&from)?, out).map(drop)
        });
        if copied.is_ok() {
            (open.path, open.is_untitled) = (path.to_path_buf(), false);
        }
        self.reopen()?;
        if was_untitled && copied.is_ok() {
            // It has a name now. What cannot be removed is only in the way.
            let _ = std::fs::remove_file(&from);
        }
        copied.map_err(|e| e.to_string())
    }

    /// Opens the file anew whose document was closed; what is seen of it stays.
    pub(super) fn reopen(&mut self) -> Result<(), String> {
        let Some(open) = &mut self.open else { return Ok(()) };
        match desk_files::open(&open.path, &mut Vec::new()) {
            Ok(document) => self.take_back(document),
            Err(why) => {
                self.open = None;
                self.tell(News::Empty);
                return Err(why);
            }
        }
        Ok(())
    }

    /// Writes the chosen object: a mesh by options of `mesh`, a field, or a scan with its edits.
    pub(super) fn export(
        &mut self,
        out: &Path,
        scan: Option<&Path>,
        of_mesh: &[OsString],
    ) -> Result<(), String> {
        self.end();
        let Some(open) = &mut self.open else { return Ok(()) };
        // The command opens it for itself alone.
        open.document = None;
        let (path, chosen) = (open.path.clone(), open.chosen.clone());
        let file = out.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let show = |stage: &str, share: f64| self.tell(News::Busy(Some((format!("{file}: {stage}"), share))));
        show("writing", 0.0);
        let written = desk_files::export(&path, &chosen, out, scan, of_mesh, &self.begin_long(), &show);
        self.tell(News::Busy(None));
        self.reopen()?;
        let told = written?;
        self.tell(News::Note(format!("{} is written", out.display())));
        self.tell(News::Written(out.to_path_buf(), told));
        Ok(())
    }

    /// Writes the edits that are done as a script.
    pub(super) fn save_script(&mut self, path: &Path) -> Result<(), String> {
        self.end();
        let document = self.open.as_mut().and_then(|open| open.document.as_mut());
        let Some(document) = document else { return Ok(()) };
        let text = document.script().map_err(|e| e.to_string())?;
        formats::atomic::replace(path, |out| out.write_all(text.as_bytes())).map_err(|e| e.to_string())?;
        let count = text.lines().count();
        self.tell(News::Note(format!(
            "{} has {count} edits; isoclay sculpt does them again",
            path.display()
        )));
        Ok(())
    }

    /// Does a script on the chosen object, where it names no other.
    pub(super) fn run_script(&mut self, path: &Path) -> Result<(), String> {
        self.end();
        let Some(open) = &self.open else { return Ok(()) };
        let about = |why: String| format!("{}: {why}", path.display());
        let text = std::fs::read_to_string(path).map_err(|e| about(format!("cannot be read ({e})")))?;
        let named = |own: Option<&str>| -> Result<String, CommandError> {
            let name = own.unwrap_or(&open.chosen);
            Ok(open.state().object(name).map(|_| name.to_string())?)
        };
        let commands = Command::of_script(&text, named).map_err(|e| about(e.to_string()))?;
        self.apply_all(commands).map_err(about)
    }
}
