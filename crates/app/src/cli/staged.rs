use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use formats::FormatError;
use formats::atomic::{MadeDirectory, PassingDirectory};

use super::failure::{Failure, OrFail, Outcome};
use super::input::writing;

/// Files of one directory that appear together or not at all: they are written into a hidden directory inside it and
/// take their names when all are whole.
pub struct StagedFiles {
    directory: PathBuf,
    // In this order they go: the hidden directory before the one that it is in.
    hidden: PassingDirectory,
    _made: MadeDirectory,
    names: Vec<String>,
}

impl StagedFiles {
    /// Makes the directory that `option` names, if it is missing.
    pub fn new(option: &str, directory: &Path) -> Outcome<Self> {
        let fail = |e: io::Error| {
            Failure::limit(format!(
                "{option} {}: no file can be made there ({e}); name another directory",
                directory.display()
            ))
        };
        if directory.exists() && !directory.is_dir() {
            return Err(Failure::usage(format!(
                "{option} {}: is no directory; name another",
                directory.display()
            )));
        }
        let made = MadeDirectory::new(directory).map_err(fail)?;
        Ok(Self {
            directory: directory.to_path_buf(),
            hidden: PassingDirectory::new(Some(directory)).map_err(fail)?,
            _made: made,
            names: Vec::new(),
        })
    }

    /// Writes a file, which nobody sees yet, at the path that `write` is given.
    pub fn write<T>(
        &mut self,
        name: &str,
        write: impl FnOnce(&Path) -> Result<T, FormatError>,
    ) -> Outcome<T> {
        let target = self.directory.join(name);
        let done = write(&self.hidden(name)).map_err(|e| writing(e.fault.at(&target)))?;
        if !self.names.iter().any(|n| n == name) {
            self.names.push(name.into());
        }
        Ok(done)
    }

    /// Writes a chart.
    pub fn write_text(&mut self, name: &str, text: &str) -> Outcome {
        self.write(name, |path| {
            formats::atomic::replace(path, |out| out.write_all(text.as_bytes()))
        })
    }

    /// Gives all files their names; returns their paths.
    pub fn publish(self) -> Outcome<Vec<PathBuf>> {
        let targets: Vec<PathBuf> = self.names.iter().map(|n| self.directory.join(n)).collect();
        // What can fail comes first: targets that are no plain files have to be written through.
        for (name, target) in self.names.iter().zip(&targets) {
            if target.metadata().is_ok_and(|m| !m.is_file()) {
                self.copy(name, target)?;
            }
        }
        let elsewhere = formats::atomic::whole(|| self.rename(&targets))?;
        for (name, target) in elsewhere {
            self.copy(name, target)?;
        }
        Ok(targets)
    }

    /// Gives the hidden files the names of `targets`; returns those that have to be copied, to another disk.
    fn rename<'a>(&'a self, targets: &'a [PathBuf]) -> Outcome<Vec<(&'a str, &'a Path)>> {
        let mut elsewhere = Vec::new();
        for (name, target) in self.names.iter().zip(targets) {
            let old = target.metadata().ok();
            if old.as_ref().is_some_and(|m| !m.is_file()) {
                continue;
            }
            let hidden = self.hidden(name);
            if let Some(old) = old {
                fs::set_permissions(&hidden, old.permissions()).or_limit()?;
            }
            // A link is followed; it may lead to another disk.
            let real = target.canonicalize().unwrap_or_else(|_| target.clone());
            if fs::rename(&hidden, real).is_err() {
                elsewhere.push((name.as_str(), target.as_path()));
            }
        }
        Ok(elsewhere)
    }

    fn hidden(&self, name: &str) -> PathBuf {
        self.hidden.path().join(name)
    }

    fn copy(&self, name: &str, target: &Path) -> Outcome {
        let mut whole = fs::File::open(self.hidden(name)).or_limit()?;
        formats::atomic::replace(target, |out| io::copy(&mut whole, out).map(drop)).map_err(writing)
    }
}

/// Gives charts their names and tells them.
pub fn publish(staged: StagedFiles, quiet: bool) -> Outcome {
    for path in staged.publish()? {
        if !quiet {
            writeln!(io::stdout().lock(), "written  {}", path.display()).or_limit()?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_appear_together_or_not_at_all() {
        let scratch = tempfile::tempdir().unwrap();
        let names = |d: &Path| {
            let mut names: Vec<_> = d.read_dir().unwrap().map(|e| e.unwrap().file_name()).collect();
            names.sort();
            names
        };
        let directory = scratch.path().join("a/b");
        let mut staged = StagedFiles::new("-o", &directory).unwrap();
        staged.write_text("x", "1").unwrap();
        drop(staged);
        assert!(names(scratch.path()).is_empty(), "made for nothing and left");

        fs::create_dir_all(&directory).unwrap();
        fs::write(directory.join("x"), "old").unwrap();
        std::os::unix::fs::symlink("/dev/full", directory.join("y")).unwrap();
        let mut staged = StagedFiles::new("-o", &directory).unwrap();
        staged.write_text("x", "1").unwrap();
        staged.write_text("y", "2").unwrap();
        let e = staged.publish().unwrap_err();
        assert_eq!(e.code(), 4);
        assert!(e.to_string().contains("b/y"), "{e}");
        assert_eq!(fs::read(directory.join("x")).unwrap(), b"old");
        assert_eq!(names(&directory), ["x", "y"]);

        let mut staged = StagedFiles::new("-o", &directory).unwrap();
        staged.write_text("x", "1").unwrap();
        staged.write_text("z", "2").unwrap();
        assert_eq!(names(&directory).len(), 3, "nothing but the hidden directory");
        staged.publish().unwrap();
        assert_eq!(fs::read(directory.join("x")).unwrap(), b"1");
        assert_eq!(names(&directory), ["x", "y", "z"]);
    }
}
