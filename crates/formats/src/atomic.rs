//! Output that is either the old file or the whole new one.
//!
//! The bytes go to a temporary file in the directory of the target, are brought to the disk, and take the
//! target's name in one step. Whatever fails before that step (a full disk at any byte, an error of the writer, a
//! panic) leaves the old file as it was and removes the temporary one, and so does [`abandon`]. Only a kill or a power
//! cut can leave a temporary file `.NAME.*.tmp` behind; the old file survives these too.

use std::fs::{self, File, OpenOptions, Permissions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Duration;

use tempfile::{TempDir, TempPath};

use crate::{Fault, FormatError};

/// Bytes gathered before they go to the system.
const BUFFER: usize = 1 << 17;

/// What goes away with the program, in the order in which it was made.
static UNDER_WAY: Mutex<Vec<Passing>> = Mutex::new(Vec::new());

/// A path that stays only if its work ends well.
#[derive(PartialEq)]
enum Passing {
    /// A temporary file that has not taken its target's name yet.
    File(PathBuf),
    /// A directory for what is not whole yet, with all that is in it.
    Directory(PathBuf),
    /// A directory made for files to come, as long as none is in it.
    Empty(PathBuf),
}

impl Passing {
    /// Whoever ends can do no more about a path that stays.
    fn remove(&self) {
        let _ = match self {
            Self::File(path) => fs::remove_file(path),
            Self::Directory(path) => fs::remove_dir_all(path),
            Self::Empty(path) => fs::remove_dir(path),
        };
    }
}

fn under_way() -> MutexGuard<'static, Vec<Passing>> {
    UNDER_WAY.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the temporary files and directories of all work under way, on any thread, and lets no write begin or end any
/// more: for a program that is about to exit. A write that has ended stays whole; one that meets this call waits for
/// ever. Does nothing if a write is about to begin or end for longer than a tenth of a second, as it is where the calling
/// thread does so itself.
pub fn abandon() {
    for _ in 0..100 {
        let passing = match UNDER_WAY.try_lock() {
            Ok(passing) => passing,
            Err(TryLockError::Poisoned(e)) => e.into_inner(),
            Err(TryLockError::WouldBlock) => {
                std::thread::sleep(Duration::from_millis(1));
                continue;
            }
        };
        passing.iter().rev().for_each(Passing::remove);
        std::mem::forget(passing);
        return;
    }
}

/// Does what must not be cut off by [`abandon`]: some renames. Nothing in it may write through [`replace`].
pub fn whole<T>(work: impl FnOnce() -> T) -> T {
    let _held = under_way();
    work()
}

/// A directory that goes away when dropped, with all that is in it, and by [`abandon`].
pub struct PassingDirectory(TempDir);

impl PassingDirectory {
    /// A new directory with a name of its own: hidden in `parent`, or where the system keeps temporary files.
    ///
    /// # Errors
    /// Those of the system.
    pub fn new(parent: Option<&Path>) -> io::Result<Self> {
        let mut list = under_way();
        let directory = match parent {
            Some(parent) => tempfile::Builder::new()
                .prefix(".isoclay.")
                .suffix(".tmp")
                .tempdir_in(parent),
            None => tempfile::tempdir(),
        }?;
        list.push(Passing::Directory(directory.path().to_path_buf()));
        Ok(Self(directory))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

impl Drop for PassingDirectory {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(self.path());
        let own = Passing::Directory(self.path().to_path_buf());
        under_way().retain(|p| *p != own);
    }
}

/// A directory for files to come, made with those above it that are missing. Those made go away when this is dropped,
/// and by [`abandon`], as long as they are empty.
pub struct MadeDirectory(Vec<PathBuf>);

impl MadeDirectory {
    /// Makes `path`, if it is missing.
    ///
    /// # Errors
    /// Those of the system.
    pub fn new(path: &Path) -> io::Result<Self> {
        let missing = (path.ancestors()).take_while(|d| !d.as_os_str().is_empty() && !d.exists());
        let mut made = Self(Vec::new());
        let mut list = under_way();
        for directory in missing.collect::<Vec<_>>().into_iter().rev() {
            match fs::create_dir(directory) {
                // Another program was faster; it is not ours to remove.
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => continue,
                other => other?,
            }
            made.0.push(directory.to_path_buf());
            list.push(Passing::Empty(directory.to_path_buf()));
        }
        Ok(made)
    }
}

impl Drop for MadeDirectory {
    fn drop(&mut self) {
        for directory in self.0.drain(..).rev() {
            let own = Passing::Empty(directory);
            own.remove();
            under_way().retain(|p| *p != own);
        }
    }
}

/// A temporary file on the list, off it and gone when dropped.
struct Temporary {
    /// `None` once it has its target's name.
    path: Option<TempPath>,
}

impl Temporary {
    fn new(target: &Path, old: Option<Permissions>) -> io::Result<(File, Self)> {
        let mut list = under_way();
        let (file, path) = temporary_in(target, old)?.into_parts();
        list.push(Passing::File(path.to_path_buf()));
        Ok((file, Self { path: Some(path) }))
    }

    fn persist(mut self, target: &Path) -> io::Result<()> {
        let Some(path) = self.path.take() else {
            return Ok(());
        };
        let own = Passing::File(path.to_path_buf());
        let mut list = under_way();
        list.retain(|p| *p != own);
        path.persist(target).map_err(|e| e.error)
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if let Some(path) = self.path.take() {
            let own = Passing::File(path.to_path_buf());
            under_way().retain(|p| *p != own);
        }
    }
}

/// Writes `path` through `body`.
///
/// A symbolic link is followed. The permissions of an old file are kept; a new one gets those of any new file.
/// A target that is no regular file (`/dev/stdout`, a pipe) is written directly: there is no old content to keep.
///
/// # Errors
/// I/O, with the path; [`Fault::Directory`].
pub fn replace(path: &Path, body: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), FormatError> {
    replace_through(path, |file| file, body).map_err(|fault| fault.at(path))
}

/// [`replace`] with something between `body` and the file, such as a disk that fills up.
pub(crate) fn replace_through<W: Write>(
    path: &Path,
    through: impl FnOnce(File) -> W,
    body: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), Fault> {
    let fail = |doing| move |source| Fault::Io { doing, source };
    // A dangling link cannot be resolved; it is replaced itself.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let old = fs::metadata(&target).ok();
    match &old {
        Some(m) if m.is_dir() => return Err(Fault::Directory),
        Some(m) if !m.is_file() => {
            let file = OpenOptions::new()
                .write(true)
                .open(&target)
                .map_err(fail("opening the output"))?;
            return write_all(through(file), body).map_err(fail("writing"));
        }
        _ => {}
    }
    let (file, temporary) =
        Temporary::new(&target, old.map(|m| m.permissions())).map_err(fail("creating the output"))?;
    let sync = file.try_clone().map_err(fail("creating the output"))?;
    write_all(through(file), body).map_err(fail("writing"))?;
    sync.sync_all().map_err(fail("writing"))?;
    temporary.persist(&target).map_err(fail("renaming the output"))?;
    // The rename itself reaches the disk with its directory; where that cannot be asked for, it comes later.
    if let Ok(directory) = File::open(directory_of(&target)) {
        let _ = directory.sync_all();
    }
    Ok(())
}

fn write_all<W: Write>(out: W, body: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut buffered = BufWriter::with_capacity(BUFFER, out);
    let result = body(&mut buffered).and_then(|()| buffered.flush());
    // A buffer that is dropped tries to write once more; after an error there is no use in that.
    let _ = buffered.into_parts();
    result
}

/// The directory that a file is in, or is to be in.
pub(crate) fn directory_of(target: &Path) -> &Path {
    match target.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    }
}

/// How the names of temporary files of a target begin.
fn prefix(target: &Path) -> std::ffi::OsString {
    let mut prefix = std::ffi::OsString::from(".");
    prefix.push(target.file_name().unwrap_or_default());
    prefix.push(".");
    prefix
}

/// How they end.
const SUFFIX: &str = ".tmp";

/// Removes temporary files that killed writers of a target have left. Only for who knows that nobody is writing it.
///
/// # Errors
/// Those of the system.
pub fn clear_left(target: &Path) -> io::Result<()> {
    let prefix = prefix(target);
    for entry in fs::read_dir(directory_of(target))? {
        let entry = entry?;
        let name = entry.file_name();
        let bytes = name.as_encoded_bytes();
        if bytes.starts_with(prefix.as_encoded_bytes()) && bytes.ends_with(SUFFIX.as_bytes()) {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

fn temporary_in(target: &Path, old: Option<Permissions>) -> io::Result<tempfile::NamedTempFile> {
    let prefix = prefix(target);
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(SUFFIX);
    #[cfg(unix)]
    {
        // The system takes the umask off, as for any new file.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(Permissions::from_mode(0o666));
    }
    let temporary = builder.tempfile_in(directory_of(target))?;
    if let Some(permissions) = old {
        temporary.as_file().set_permissions(permissions)?;
    }
    Ok(temporary)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A disk with room for so many bytes.
    pub(crate) struct Fills<W> {
        pub inner: W,
        pub room: usize,
    }

    impl<W: Write> Write for Fills<W> {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.room == 0 && !bytes.is_empty() {
                return Err(io::ErrorKind::StorageFull.into());
            }
            let n = self.inner.write(&bytes[..bytes.len().min(self.room)])?;
            self.room -= n;
            Ok(n)
        }
        fn flush(&mut self) -> io::Result<()> {
            self.inner.flush()
        }
    }

    /// Runs `body` against a disk that is full after 0, 1, 2, ... bytes, over an old file; returns the length
    /// that went through.
    pub(crate) fn survives_a_full_disk(body: impl Fn(&mut dyn Write) -> io::Result<()>) -> usize {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("out");
        fs::write(&path, "the old file").unwrap();
        for room in 0.. {
            let result = replace_through(&path, |file| Fills { inner: file, room }, &body);
            assert_eq!(
                fs::read_dir(&directory).unwrap().count(),
                1,
                "a temporary file is left"
            );
            match result {
                Ok(()) => {
                    assert_eq!(fs::metadata(&path).unwrap().len(), room as u64);
                    return room;
                }
                Err(fault) => {
                    assert!(fault.to_string().contains("free some space"), "{fault}");
                    assert_eq!(fs::read(&path).unwrap(), b"the old file");
                }
            }
        }
        unreachable!()
    }

    #[test]
    fn a_disk_that_fills_at_any_offset_leaves_the_old_file() {
        let length = survives_a_full_disk(|w| {
            for part in [&b"first "[..], b"second ", b"third"] {
                w.write_all(part)?;
            }
            Ok(())
        });
        assert_eq!(length, 18);
    }

    #[test]
    fn what_killed_writers_left_is_cleared() {
        let directory = tempfile::tempdir().unwrap();
        let path = |name: &str| directory.path().join(name);
        for name in [
            "a.html",
            ".a.html.x1Y2z3.tmp",
            ".a.htm.x1Y2z3.tmp",
            ".b.html.x1Y2z3.tmp",
        ] {
            fs::write(path(name), "text").unwrap();
        }
        clear_left(&path("a.html")).unwrap();
        assert!(path("a.html").exists() && !path(".a.html.x1Y2z3.tmp").exists());
        assert!(path(".a.htm.x1Y2z3.tmp").exists() && path(".b.html.x1Y2z3.tmp").exists());
    }

    #[test]
    fn an_error_or_a_panic_of_the_writer_leaves_the_old_file() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("out");
        fs::write(&path, "old").unwrap();
        let e = replace(&path, |w| {
            w.write_all(b"new")?;
            Err(io::Error::other("no more"))
        });
        assert!(
            e.unwrap_err()
                .to_string()
                .contains("out: writing failed: no more")
        );
        let caught = std::panic::catch_unwind(|| replace(&path, |_| panic!("writer broke")));
        assert!(caught.is_err());
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(&directory).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn links_permissions_and_devices_are_respected() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let directory = tempfile::tempdir().unwrap();
        let (path, link) = (directory.path().join("out"), directory.path().join("link"));
        fs::write(&path, "old").unwrap();
        fs::set_permissions(&path, Permissions::from_mode(0o640)).unwrap();
        symlink(&path, &link).unwrap();
        replace(&link, |w| w.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);

        // A file made in the ordinary way has the permissions that a new one must get.
        let (ordinary, fresh) = (directory.path().join("ordinary"), directory.path().join("fresh"));
        File::create(&ordinary).unwrap();
        replace(&fresh, |w| w.write_all(b"new")).unwrap();
        let mode = |p: &Path| fs::metadata(p).unwrap().permissions().mode();
        assert_eq!(mode(&fresh), mode(&ordinary));

        replace(Path::new("/dev/null"), |w| w.write_all(b"gone")).unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
        let e = replace(directory.path(), |w| w.write_all(b"x")).unwrap_err();
        assert!(matches!(e.fault, Fault::Directory));
        let e = replace(&directory.path().join("no/such/place"), |w| w.write_all(b"x")).unwrap_err();
        assert!(e.to_string().contains("creating the output failed"), "{e}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_device_without_room_is_an_error() {
        let e = replace(Path::new("/dev/full"), |w| w.write_all(&[0; 1000])).unwrap_err();
        assert!(e.to_string().starts_with("/dev/full: writing failed"), "{e}");
    }
}
