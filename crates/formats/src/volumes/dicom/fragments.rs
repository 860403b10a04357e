//! Where the compressed bytes of each frame lie: fragments, and the table of their offsets (DICOM PS3.5, A.4).

use super::dataset::{DataSet, PixelElement, reopen};
use super::element::{self, ITEM, SEQUENCE_END};
use super::stream::{Location, Stream};
use super::syntax::{Codec, Encoding};
use crate::Fault;
use crate::limits::{Budget, Counted};

/// Start and length of a fragment's bytes in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Fragment {
    at: u64,
    length: u32,
}

/// The fragments of a file and which of them make up each frame.
#[derive(Debug)]
pub(super) struct Fragments {
    all: Vec<Fragment>,
    /// First fragment of each frame, and their number at the end.
    first: Vec<u32>,
}

impl Fragments {
    /// Walks over the fragments of a file.
    ///
    /// # Errors
    /// [`Fault::Truncated`]; [`Fault::Damaged`] if it cannot be told which fragment belongs to which frame.
    pub fn find(
        location: &Location,
        data: &DataSet,
        pixels: &PixelElement,
        frame_count: u32,
        budget: &mut Budget,
    ) -> Result<Self, Fault> {
        let mut stream = reopen(location, data)?;
        stream.skip(pixels.at, "the header")?;
        let table = item(&mut stream)?.ok_or_else(|| unmatched(0, frame_count))?;
        let offsets = if frame_count > 1 && table.length as usize == 4 * frame_count as usize {
            budget.reserve("the table of frames", u64::from(frame_count), 8)?;
            let mut bytes = vec![0; table.length as usize];
            stream.fill(&mut bytes, "the table of frames")?;
            let offset = |b: &[u8]| element::long(b, Encoding::EXPLICIT);
            bytes.chunks_exact(4).map(offset).collect()
        } else {
            stream.skip(table.length.into(), "the table of frames")?;
            Vec::new()
        };
        let start = stream.position();
        let mut all = Counted::new("the table of fragments");
        let mut begins = Counted::new("the table of fragments");
        while let Some(fragment) = item(&mut stream)? {
            let mut mark = [0; 2];
            let look = fragment.length.min(2) as usize;
            stream.fill(&mut mark[..look], "a fragment of the pixels")?;
            stream.skip(
                u64::from(fragment.length) - look as u64,
                "a fragment of the pixels",
            )?;
            if begins_a_picture(data.syntax.codec, mark) {
                begins.push(all.items.len() as u32, budget)?;
            }
            all.push(fragment, budget)?;
        }
        let all = all.items;
        let count = all.len();
        let mut first: Vec<u32> = if frame_count == 1 {
            vec![0]
        } else if count == frame_count as usize {
            (0..frame_count).collect()
        } else if !offsets.is_empty() {
            let head = |offset: u32| start + u64::from(offset) + 8;
            let index = |offset: &u32| all.binary_search_by_key(&head(*offset), |f| f.at).ok();
            let found: Option<Vec<usize>> = offsets.iter().map(index).collect();
            let found = found.filter(|f| f.is_sorted_by(|a, b| a < b));
            let found = found.ok_or_else(|| unmatched(count, frame_count))?;
            found.into_iter().map(|i| i as u32).collect()
        } else {
            begins.items
        };
        if count == 0 || first.len() != frame_count as usize || first[0] != 0 {
            return Err(unmatched(count, frame_count));
        }
        first.push(count as u32);
        Ok(Self { all, first })
    }

    /// Compressed bytes of a frame.
    pub fn length(&self, frame: u32) -> u64 {
        self.of(frame).iter().map(|f| u64::from(f.length)).sum()
    }

    /// Compressed bytes of the largest frame.
    pub fn longest(&self) -> u64 {
        (0..self.first.len() as u32 - 1)
            .map(|f| self.length(f))
            .max()
            .unwrap_or(0)
    }

    /// Reads a frame's compressed bytes.
    pub fn read(&self, stream: &mut Stream, frame: u32, out: &mut Vec<u8>) -> Result<(), Fault> {
        out.clear();
        out.reserve_exact(self.length(frame) as usize);
        for fragment in self.of(frame) {
            if stream.position() > fragment.at {
                stream.back_to(fragment.at)?;
            } else {
                stream.skip(fragment.at - stream.position(), "the pixels")?;
            }
            let from = out.len();
            out.resize(from + fragment.length as usize, 0);
            stream.fill(&mut out[from..], "a fragment of the pixels")?;
        }
        Ok(())
    }

    fn of(&self, frame: u32) -> &[Fragment] {
        let frame = frame as usize;
        &self.all[self.first[frame] as usize..self.first[frame + 1] as usize]
    }
}

/// The next item of the sequence of fragments; `None` at its end.
fn item(stream: &mut Stream) -> Result<Option<Fragment>, Fault> {
    let Some(e) = element::read(stream, Encoding::EXPLICIT)? else {
        return Err(Fault::Truncated {
            what: "the sequence of fragments".into(),
            needed: 8,
            found: 0,
        });
    };
    match (e.tag, e.length) {
        (ITEM, Some(length)) => {
            let at = stream.position();
            if let Some(left) = stream.left().filter(|left| *left < length.into()) {
                return Err(Fault::Truncated {
                    what: "a fragment of the pixels".into(),
                    needed: length.into(),
                    found: left,
                });
            }
            Ok(Some(Fragment { at, length }))
        }
        (SEQUENCE_END, _) => Ok(None),
        _ => Err(element::misplaced(&e, stream)),
    }
}

fn begins_a_picture(codec: Option<Codec>, mark: [u8; 2]) -> bool {
    match codec {
        Some(Codec::Jpeg | Codec::JpegLs) => mark == [0xFF, 0xD8],
        Some(Codec::Jpeg2000) => mark == [0xFF, 0x4F],
        // A frame of run lengths is one fragment.
        _ => true,
    }
}

fn unmatched(fragments: usize, frames: u32) -> Fault {
    Fault::Damaged {
        what: format!("its {fragments} fragments of pixels cannot be shared out to {frames} frames"),
    }
}
