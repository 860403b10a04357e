//! Values of elements: text, numbers written as text, numbers.

use super::element::{Element, Tag, long, short, show};
use super::stream::Stream;
use super::syntax::Encoding;
use crate::Fault;

/// The bytes of a value and how they are written.
#[derive(Clone, Debug)]
pub(super) struct Value {
    bytes: Vec<u8>,
    vr: [u8; 2],
    encoding: Encoding,
}

impl Value {
    /// Reads `length` bytes, of which the caller has seen that they are not too many.
    pub fn read(
        stream: &mut Stream,
        element: &Element,
        length: u32,
        encoding: Encoding,
    ) -> Result<Self, Fault> {
        let mut bytes = vec![0; length as usize];
        stream.fill(&mut bytes, "the value of an element")?;
        Ok(Self {
            bytes,
            vr: element.vr,
            encoding,
        })
    }

    /// As text without padding; letters outside of ASCII that are no UTF-8 are replaced.
    pub fn text(&self) -> String {
        let text = String::from_utf8_lossy(&self.bytes);
        text.trim_matches(|c: char| c == '\0' || c.is_whitespace()).into()
    }

    /// As the name of something: at most 64 letters, which is what the standard allows.
    pub fn label(&self) -> String {
        self.text().chars().take(64).collect()
    }

    /// One of several names, counted from 0; empty if there are fewer.
    pub fn part(&self, index: usize) -> String {
        let text = self.text();
        let part = text.split('\\').nth(index).unwrap_or("");
        part.trim().chars().take(64).collect()
    }

    /// The first number; `None` if the value is empty.
    pub fn real(&self, tag: Tag) -> Result<Option<f64>, Fault> {
        Ok(self.all_reals(tag)?.first().copied())
    }

    /// Exactly `N` finite numbers; `None` if the value is empty.
    pub fn reals<const N: usize>(&self, tag: Tag) -> Result<Option<[f64; N]>, Fault> {
        let all = self.all_reals(tag)?;
        if all.is_empty() {
            return Ok(None);
        }
        let found = all.len();
        all.try_into().map(Some).map_err(|_| Fault::Value {
            what: "the number of values of an element",
            value: format!("{found} in {}, which has {N}", show(tag)),
            remedy: "the header is damaged; export the series again",
        })
    }

    /// All numbers, each finite.
    pub fn all_reals(&self, tag: Tag) -> Result<Vec<f64>, Fault> {
        let numbers: Option<Vec<f64>> = match &self.vr {
            b"FL" => Some(self.chunks(4, |b| f64::from(f32::from_bits(long(b, self.encoding))))),
            b"FD" => Some(self.chunks(8, |b| f64::from_bits(self.wide(b)))),
            _ => {
                let text = self.text();
                let parts = text.split('\\').map(str::trim).filter(|p| !p.is_empty());
                parts.map(|p| p.parse().ok()).collect()
            }
        };
        numbers
            .filter(|n| n.iter().all(|x| x.is_finite()))
            .ok_or_else(|| self.no_number(tag))
    }

    /// The first whole number; `None` if the value is empty.
    pub fn integer(&self, tag: Tag) -> Result<Option<i64>, Fault> {
        // Without a representation a number of 2 or 4 bytes cannot be told from text but by its tag; in group
        // 0028 only the number of frames is text.
        let is_text = match &self.vr {
            b"US" | b"SS" | b"UL" | b"SL" | b"OW" | b"OB" => false,
            b"IS" | b"DS" => true,
            _ => tag >> 16 != 0x0028 || tag == 0x0028_0008,
        };
        if is_text {
            let text = self.text();
            let first = text.split('\\').next().unwrap_or("").trim();
            if first.is_empty() {
                return Ok(None);
            }
            let number = first.parse().ok();
            // Some writers put a decimal point into whole numbers.
            let number = number.or_else(|| {
                first
                    .parse::<f64>()
                    .ok()
                    .filter(|x| x.fract() == 0.0)
                    .map(|x| x as i64)
            });
            return number.map(Some).ok_or_else(|| self.no_number(tag));
        }
        Ok(match (self.bytes.len(), &self.vr) {
            (0 | 1, _) => None,
            (_, b"SL") if self.bytes.len() >= 4 => Some(i64::from(long(&self.bytes, self.encoding) as i32)),
            (_, b"UL") if self.bytes.len() >= 4 => Some(long(&self.bytes, self.encoding).into()),
            (_, b"SS") => Some(i64::from(short(&self.bytes, self.encoding) as i16)),
            _ => Some(short(&self.bytes, self.encoding).into()),
        })
    }

    fn chunks(&self, size: usize, number: impl Fn(&[u8]) -> f64) -> Vec<f64> {
        self.bytes.chunks_exact(size).map(number).collect()
    }

    fn wide(&self, b: &[u8]) -> u64 {
        let (first, second) = (long(&b[..4], self.encoding), long(&b[4..], self.encoding));
        let (low, high) = if self.encoding.big_endian {
            (second, first)
        } else {
            (first, second)
        };
        u64::from(high) << 32 | u64::from(low)
    }

    fn no_number(&self, tag: Tag) -> Fault {
        Fault::Value {
            what: "an element that holds numbers",
            value: format!("{} in {}", crate::error::excerpt(&self.bytes), show(tag)),
            remedy: "the header is damaged; export the series again",
        }
    }
}
