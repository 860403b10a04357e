//! Numbers out of text, with the line they stand on.

use std::borrow::Cow;

use crate::Fault;
use crate::error::excerpt;
use crate::limits::Budget;

/// Whitespace-separated words of a text, counting lines.
pub(crate) struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Line of the last word, from 1.
    pub line: u64,
}

impl<'a> Words<'a> {
    pub fn new(bytes: &'a [u8], first_line: u64) -> Self {
        Self {
            bytes,
            at: 0,
            line: first_line,
        }
    }

    /// Bytes not yet read.
    pub fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    pub fn next(&mut self) -> Option<&'a [u8]> {
        let bytes = self.bytes;
        let mut start = self.at;
        while start < bytes.len() && bytes[start].is_ascii_whitespace() {
            self.line += u64::from(bytes[start] == b'\n');
            start += 1;
        }
        let mut end = start;
        while end < bytes.len() && !bytes[end].is_ascii_whitespace() {
            end += 1;
        }
        self.at = end;
        (end > start).then(|| &bytes[start..end])
    }
}

/// Lines of a text without their ends (`\n`, `\r\n`, or `\r` alone).
pub(crate) struct Lines<'a> {
    rest: &'a [u8],
    /// Number of the last line, from 1.
    pub line: u64,
}

impl<'a> Lines<'a> {
    /// Bytes after the last line read.
    pub fn left(&self) -> usize {
        self.rest.len()
    }

    pub fn new(bytes: &'a [u8]) -> Self {
        // Some exporters on Windows put a byte order mark in front.
        Self {
            rest: bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes),
            line: 0,
        }
    }

    pub fn next(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.line += 1;
        let end = memchr::memchr2(b'\n', b'\r', self.rest).unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(end);
        self.rest = match rest {
            [b'\r', b'\n', rest @ ..] | [_, rest @ ..] => rest,
            [] => rest,
        };
        Some(line)
    }
}

/// Text that says by its mark that it is UTF-16 (Windows calls it Unicode), as UTF-8; all else as it is.
pub(crate) fn utf8<'a>(bytes: &'a [u8], budget: &mut Budget) -> Result<Cow<'a, [u8]>, Fault> {
    let unit: fn([u8; 2]) -> u16 = match bytes {
        [0xff, 0xfe, ..] => u16::from_le_bytes,
        [0xfe, 0xff, ..] => u16::from_be_bytes,
        _ => return Ok(Cow::Borrowed(bytes)),
    };
    let (units, []) = bytes[2..].as_chunks::<2>() else {
        return Ok(Cow::Borrowed(bytes));
    };
    // A unit becomes three bytes at most, and the text is kept until it is read.
    budget.reserve("the text as UTF-8", units.len() as u64, 3)?;
    let mut text = String::with_capacity(3 * units.len());
    for c in char::decode_utf16(units.iter().map(|u| unit(*u))) {
        match c {
            Ok(c) => text.push(c),
            Err(_) => return Ok(Cow::Borrowed(bytes)),
        }
    }
    Ok(Cow::Owned(text.into_bytes()))
}

/// A number; `nan` and `inf` in any case are numbers too.
pub(crate) fn number(word: &[u8], line: u64) -> Result<f64, Fault> {
    fast_float2::parse(word).map_err(|_| {
        Fault::line(
            line,
            format!("{} is not a number", excerpt(word)),
            "numbers are written like 1.5 or -2e-3, with a decimal point",
        )
    })
}

/// A whole number.
pub(crate) fn integer(word: &[u8]) -> Option<i64> {
    let (negative, digits) = match word {
        [b'-', d @ ..] => (true, d),
        [b'+', d @ ..] => (false, d),
        d => (false, d),
    };
    if digits.is_empty() || digits.len() > 18 {
        return None;
    }
    let mut value = 0i64;
    for d in digits {
        if !d.is_ascii_digit() {
            return None;
        }
        value = value * 10 + i64::from(d - b'0');
    }
    Some(if negative { -value } else { value })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_know_their_lines() {
        let mut w = Words::new(b"  a b\r\n\n c", 1);
        assert_eq!((w.next(), w.line), (Some(&b"a"[..]), 1));
        assert_eq!((w.next(), w.line), (Some(&b"b"[..]), 1));
        assert_eq!((w.next(), w.line), (Some(&b"c"[..]), 3));
        assert_eq!(w.next(), None);
    }

    #[test]
    fn lines_end_in_either_way_and_the_last_needs_no_end() {
        let mut l = Lines::new(b"\xef\xbb\xbfa\r\nb\n\nc");
        let all: Vec<_> = std::iter::from_fn(|| l.next()).collect();
        assert_eq!(all, [&b"a"[..], b"b", b"", b"c"]);
        assert_eq!(l.line, 4);
    }

    #[test]
    fn lines_of_old_apples_end_in_a_carriage_return() {
        let mut l = Lines::new(b"a\r\rb\r\nc\r");
        let all: Vec<_> = std::iter::from_fn(|| l.next()).collect();
        assert_eq!(all, [&b"a"[..], b"", b"b", b"c"]);
        assert_eq!((l.line, l.left()), (4, 0));
    }

    #[test]
    fn text_of_two_bytes_a_letter_becomes_utf8_and_nothing_else_is_touched() {
        let mut budget = Budget::new(&crate::ReadLimits { max_bytes: 1 << 10 });
        let text = "v 1 2 3 # größer 𝄞\n";
        for big in [false, true] {
            let mut bytes = if big { vec![0xfe, 0xff] } else { vec![0xff, 0xfe] };
            for unit in text.encode_utf16() {
                bytes.extend(if big {
                    unit.to_be_bytes()
                } else {
                    unit.to_le_bytes()
                });
            }
            assert_eq!(&*utf8(&bytes, &mut budget).unwrap(), text.as_bytes());
        }
        for bytes in [&b"v 1 2 3"[..], b"\xff\xfe\x00", b"\xff\xfe\x00\xd8a\x00", b""] {
            assert_eq!(&*utf8(bytes, &mut budget).unwrap(), bytes);
        }
        let long = [&[0xff, 0xfe][..], &b"a\0".repeat(1000)].concat();
        assert!(utf8(&long, &mut budget).is_err());
    }

    #[test]
    fn whole_numbers_and_what_is_none() {
        assert_eq!(integer(b"-12"), Some(-12));
        assert_eq!(integer(b"+7"), Some(7));
        for bad in [&b""[..], b"-", b"1.0", b"1e3", b"99999999999999999999", b"0x1"] {
            assert_eq!(integer(bad), None);
        }
    }
}
