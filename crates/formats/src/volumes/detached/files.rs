//! Data files that a header names: only such as lie beside it or below.

use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::{Content, Encoding, Layout, decoded};
use crate::Fault;
use crate::input::{self, SkipRead};
use crate::neighbour::beside;
use crate::volumes::stream::stored_bytes;
use crate::volumes::volume::VolumeHeader;

/// Names made of a pattern as of C's printf and numbers: `slice%03d.raw 1 100 1`.
pub(in crate::volumes) fn numbered(
    header: Option<&Path>,
    pattern: &str,
    [first, last, step]: [i64; 3],
    most: usize,
) -> Result<Vec<PathBuf>, Fault> {
    let bad = |value: String| Fault::Value {
        what: "the pattern of the data files",
        value,
        remedy: "it has one %d or %03d, then a first number, a last one and a step towards it",
    };
    let (head, tail) = pattern.split_once('%').ok_or_else(|| bad(pattern.into()))?;
    let (width, tail) = tail.split_once('d').ok_or_else(|| bad(pattern.into()))?;
    let (zeros, digits) = (width.starts_with('0'), width.trim_start_matches('0'));
    let width: usize = if digits.is_empty() {
        0
    } else {
        digits.parse().unwrap_or(usize::MAX)
    };
    if width > 20 || head.contains('%') || tail.contains('%') {
        return Err(bad(pattern.into()));
    }
    let (from, to, by) = (i128::from(first), i128::from(last), i128::from(step));
    let count = if by == 0 { 0 } else { (to - from) / by + 1 };
    if by == 0 || count < 1 || count > most as i128 {
        return Err(bad(format!(
            "{first} to {last} by {step}, for at most {most} files"
        )));
    }
    let paths = (0..count).map(|k| {
        let n = from + k * by;
        let number = if zeros {
            format!("{n:0width$}")
        } else {
            format!("{n:width$}")
        };
        beside(header, &format!("{head}{number}{tail}"))
    });
    paths.collect()
}

/// Files with equal shares of the voxels, one after the other.
pub(super) fn chain(
    header: &VolumeHeader,
    layout: Layout,
    paths: Vec<PathBuf>,
) -> Result<Content<'static>, Fault> {
    if layout.encoding == Encoding::Text {
        return Err(Fault::Value {
            what: "the encoding",
            value: "text in several files".into(),
            remedy: "convert the volume to raw or gzip encoding",
        });
    }
    let share = stored_bytes(header) / paths.len() as u64;
    // A first look at each: what is missing or too short is known before memory is taken.
    for path in &paths {
        open_share(header, layout, path, share)?;
    }
    Ok(Content {
        source: Box::new(Chain {
            header: header.clone(),
            layout,
            share,
            paths,
            next: 0,
            current: None,
            left: 0,
        }),
        bound: Some(stored_bytes(header)),
        is_exact: true,
    })
}

/// Opens a file with `share` bytes of voxels, where these start.
pub(super) fn open_share(
    header: &VolumeHeader,
    layout: Layout,
    path: &Path,
    share: u64,
) -> Result<Content<'static>, Fault> {
    let open = || decoded(header, layout, input::open_as_it_is(path)?.into(), share);
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    open().map_err(|fault| fault.inside(&name))
}

struct Chain {
    header: VolumeHeader,
    layout: Layout,
    share: u64,
    paths: Vec<PathBuf>,
    next: usize,
    current: Option<Box<dyn SkipRead>>,
    /// Bytes of voxels that the current file still has.
    left: u64,
}

impl Chain {
    /// Opens the file that has the next voxel; `None` after the last.
    fn file(&mut self) -> io::Result<Option<Box<dyn SkipRead>>> {
        if self.left > 0 {
            return Ok(self.current.take());
        }
        if let Some(mut done) = self.current.take() {
            // Up to its end, where a checksum is.
            io::copy(&mut done, &mut io::sink())?;
        }
        let Some(path) = self.paths.get(self.next) else {
            return Ok(None);
        };
        let content = open_share(&self.header, self.layout, path, self.share).map_err(io::Error::other)?;
        self.next += 1;
        self.left = self.share;
        Ok(Some(content.source))
    }

    fn cut(&self) -> io::Error {
        let path = self.paths[self.next - 1].display();
        io::Error::other(format!("{path} ends too early, {} bytes are missing", self.left))
    }
}

impl Read for Chain {
    fn read(&mut self, buf: &mut [u8]) -> io::Result<usize> {
        let Some(mut file) = self.file()? else {
            return Ok(0);
        };
        let want = (buf.len() as u64).min(self.left) as usize;
        let n = file.read(&mut buf[..want])?;
        if n == 0 && want > 0 {
            return Err(self.cut());
        }
        self.current = Some(file);
        self.left -= n as u64;
        Ok(n)
    }
}

impl SkipRead for Chain {
    fn skip(&mut self, count: u64) -> io::Result<u64> {
        let mut skipped = 0;
        while skipped < count {
            let Some(mut file) = self.file()? else {
                break;
            };
            let want = (count - skipped).min(self.left);
            if file.skip(want)? < want {
                return Err(self.cut());
            }
            self.current = Some(file);
            self.left -= want;
            skipped += want;
        }
        Ok(skipped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_count_up_and_down_and_never_beyond_what_is_needed() {
        let names = |pattern, range, most| {
            numbered(Some(Path::new("d/h")), pattern, range, most)
                .map(|n| n.iter().map(|p| p.display().to_string()).collect::<Vec<_>>())
        };
        assert_eq!(
            names("a%03d.raw", [9, 11, 1], 3).unwrap(),
            ["d/a009.raw", "d/a010.raw", "d/a011.raw"]
        );
        assert_eq!(names("%d", [5, 1, -2], 9).unwrap(), ["d/5", "d/3", "d/1"]);
        for (pattern, range, most) in [
            ("a", [1, 2, 1], 9),
            ("%s", [1, 2, 1], 9),
            ("%d%d", [1, 2, 1], 9),
            ("%099d", [1, 2, 1], 9),
            ("%d", [1, 2, 0], 9),
            ("%d", [2, 1, 1], 9),
            ("%d", [1, 4, 1], 3),
            ("%d", [i64::MIN, i64::MAX, 1], usize::MAX),
            ("../%d", [1, 2, 1], 9),
        ] {
            assert!(names(pattern, range, most).is_err(), "{pattern} {range:?} {most}");
        }
    }
}
