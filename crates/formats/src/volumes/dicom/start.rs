//! How a file starts: with a preamble, or with its elements at once.

use super::element::{self, Tag};
use super::syntax::Encoding;

/// Whether a file starts like DICOM. [`LOOK`] bytes suffice.
pub(crate) fn looks_like_dicom(head: &[u8]) -> bool {
    Start::of(head).is_some()
}

/// How a file starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Start {
    /// With 128 bytes of anything and the mark, as the standard says.
    Preamble,
    /// With group 2.
    Group2,
    /// With the data set itself, in the syntax of that identifier: networks send them so.
    Elements(&'static str),
}

/// Bytes that tell how a file starts.
pub(super) const LOOK: usize = 400;

impl Start {
    pub fn of(head: &[u8]) -> Option<Self> {
        if head.get(128..132) == Some(b"DICM") {
            return Some(Self::Preamble);
        }
        // Two short elements, the first of them in group 2 or 8: there are always several in these groups.
        if starts_with_elements(head, Encoding::EXPLICIT, 0x0002) {
            return Some(Self::Group2);
        }
        let big = Encoding {
            explicit: true,
            big_endian: true,
        };
        let ways = [
            (Encoding::EXPLICIT, "1.2.840.10008.1.2.1"),
            (big, "1.2.840.10008.1.2.2"),
            (Encoding::IMPLICIT, "1.2.840.10008.1.2"),
        ];
        ways.into_iter()
            .find(|(encoding, _)| starts_with_elements(head, *encoding, 0x0008))
            .map(|(_, uid)| Self::Elements(uid))
    }
}

/// Whether two elements stand at the start, in order and both of `group`.
fn starts_with_elements(head: &[u8], encoding: Encoding, group: Tag) -> bool {
    let first = element::short_head(head, encoding).filter(|(e, _)| e.tag >> 16 == group);
    let second = first.and_then(|(e, at)| {
        let next = at + e.length? as usize;
        let (second, _) = element::short_head(head.get(next..)?, encoding)?;
        Some((e.tag, second.tag))
    });
    second.is_some_and(|(a, b)| a < b && b >> 16 == group)
}
