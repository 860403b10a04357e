//! Elements of a data set: tag, value representation, length (DICOM PS3.5, section 7).
//!
//! The structure is read here and not by the crate dicom-parser, because that one allocates and clears what the
//! length of an element claims, up to 4 GiB, before it reads a byte, cannot tell where pixels start, and does not
//! know that a value of unknown representation and undefined length is written implicitly (PS3.5, 6.2.2).

use super::stream::Stream;
use super::syntax::Encoding;
use crate::Fault;

/// Group and element number.
pub(super) type Tag = u32;

pub(super) const ITEM: Tag = 0xFFFE_E000;
pub(super) const ITEM_END: Tag = 0xFFFE_E00D;
pub(super) const SEQUENCE_END: Tag = 0xFFFE_E0DD;

/// The head of an element; its value follows in the stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Element {
    pub tag: Tag,
    /// Value representation; blank where it is not written.
    pub vr: [u8; 2],
    /// Bytes of the value; `None` if it is a sequence that ends with a delimiter.
    pub length: Option<u32>,
}

/// Reads the head of an element; `None` where the file ends before it.
pub(super) fn read(stream: &mut Stream, encoding: Encoding) -> Result<Option<Element>, Fault> {
    let mut head = [0; 8];
    match stream.fill_or_end(&mut head)? {
        0 => Ok(None),
        8 => parse(&head, stream, encoding).map(Some),
        found => Err(Fault::Truncated {
            what: "the head of an element".into(),
            needed: 8,
            found: found as u64,
        }),
    }
}

/// The element whose first 8 bytes were read.
pub(super) fn parse(head: &[u8; 8], stream: &mut Stream, encoding: Encoding) -> Result<Element, Fault> {
    let tag = u32::from(short(&head[..2], encoding)) << 16 | u32::from(short(&head[2..4], encoding));
    // Items and delimiters have no representation in any encoding.
    if !encoding.explicit || tag >> 16 == 0xFFFE {
        let length = long(&head[4..], encoding);
        return Ok(Element {
            tag,
            vr: *b"  ",
            length: defined(length),
        });
    }
    let vr = [head[4], head[5]];
    if !vr.iter().all(u8::is_ascii_uppercase) {
        return Err(Fault::Damaged {
            what: format!(
                "element {} before byte {} has the representation {}, which is none",
                show(tag),
                stream.position(),
                crate::error::excerpt(&vr)
            ),
        });
    }
    let length = if has_short_length(vr) {
        u32::from(short(&head[6..], encoding))
    } else {
        let mut length = [0; 4];
        stream.fill(&mut length, "the head of an element")?;
        long(&length, encoding)
    };
    Ok(Element {
        tag,
        vr,
        length: defined(length),
    })
}

/// The head of an element whose value has at most 255 bytes, and where that starts; `None` for all else.
pub(super) fn short_head(head: &[u8], encoding: Encoding) -> Option<(Element, usize)> {
    let first: &[u8; 8] = head.first_chunk()?;
    let tag = u32::from(short(&first[..2], encoding)) << 16 | u32::from(short(&first[2..4], encoding));
    let vr = [first[4], first[5]];
    let (length, at) = match encoding.explicit {
        false => (long(&first[4..], encoding), 8),
        true if has_short_length(vr) => (u32::from(short(&first[6..], encoding)), 8),
        true if matches!(&vr, b"OB" | b"UN") => (long(head.get(8..12)?, encoding), 12),
        true => return None,
    };
    let element = Element {
        tag,
        vr,
        length: Some(length),
    };
    (length < 256).then_some((element, at))
}

fn defined(length: u32) -> Option<u32> {
    (length != u32::MAX).then_some(length)
}

/// Representations with a length of 16 bits; all others, those of later editions included, have one of 32.
fn has_short_length(vr: [u8; 2]) -> bool {
    const SHORT: [&[u8; 2]; 21] = [
        b"AE", b"AS", b"AT", b"CS", b"DA", b"DS", b"DT", b"FD", b"FL", b"IS", b"LO", b"LT", b"PN", b"SH",
        b"SL", b"SS", b"ST", b"TM", b"UI", b"UL", b"US",
    ];
    SHORT.contains(&&vr)
}

pub(super) fn short(bytes: &[u8], encoding: Encoding) -> u16 {
    let bytes = [bytes[0], bytes[1]];
    if encoding.big_endian {
        u16::from_be_bytes(bytes)
    } else {
        u16::from_le_bytes(bytes)
    }
}

pub(super) fn long(bytes: &[u8], encoding: Encoding) -> u32 {
    let bytes = [bytes[0], bytes[1], bytes[2], bytes[3]];
    if encoding.big_endian {
        u32::from_be_bytes(bytes)
    } else {
        u32::from_le_bytes(bytes)
    }
}

/// A tag as it is printed everywhere.
pub(super) fn show(tag: Tag) -> String {
    format!("({:04x},{:04x})", tag >> 16, tag & 0xFFFF)
}

/// Nesting of undefined lengths that is followed; files have 2 to 6.
const DEEPEST: usize = 64;

/// Passes over the value of an element, whatever it holds.
pub(super) fn skip(stream: &mut Stream, element: &Element, encoding: Encoding) -> Result<(), Fault> {
    if let Some(length) = element.length {
        return skip_value(stream, element.tag, length);
    }
    // Without recursion: whether an item is open at each level, and how its elements are written.
    let mut open = vec![(false, inside(element, encoding))];
    while let Some((in_item, encoding)) = open.last_mut() {
        let Some(next) = read(stream, *encoding)? else {
            return Err(Fault::Truncated {
                what: format!("the sequence {}", show(element.tag)),
                needed: 8,
                found: 0,
            });
        };
        match (next.tag, next.length) {
            (SEQUENCE_END, _) if !*in_item => {
                open.pop();
            }
            (ITEM, Some(length)) if !*in_item => skip_value(stream, next.tag, length)?,
            (ITEM, None) if !*in_item => *in_item = true,
            (ITEM_END, _) if *in_item => *in_item = false,
            (ITEM | ITEM_END | SEQUENCE_END, _) => return Err(misplaced(&next, stream)),
            _ if !*in_item => return Err(misplaced(&next, stream)),
            (_, Some(length)) => skip_value(stream, next.tag, length)?,
            (_, None) => {
                let below = inside(&next, *encoding);
                open.push((false, below));
                if open.len() > DEEPEST {
                    return Err(Fault::Damaged {
                        what: format!("sequences are nested more than {DEEPEST} deep"),
                    });
                }
            }
        }
    }
    Ok(())
}

fn skip_value(stream: &mut Stream, tag: Tag, length: u32) -> Result<(), Fault> {
    let left = stream.left().unwrap_or(u64::MAX);
    if u64::from(length) <= left {
        return stream.skip(length.into(), "an element");
    }
    Err(Fault::Truncated {
        what: format!("element {}", show(tag)),
        needed: length.into(),
        found: left,
    })
}

/// How the items of a sequence are written: those of an unknown one implicitly.
pub(super) fn inside(sequence: &Element, encoding: Encoding) -> Encoding {
    if sequence.vr == *b"UN" {
        Encoding::IMPLICIT
    } else {
        encoding
    }
}

pub(super) fn misplaced(element: &Element, stream: &Stream) -> Fault {
    Fault::Damaged {
        what: format!(
            "element {} before byte {} has no place there",
            show(element.tag),
            stream.position()
        ),
    }
}
