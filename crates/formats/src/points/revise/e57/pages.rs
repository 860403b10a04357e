//! Pages of a file, each with its checksum, and what stands in them [ASTM E2807, §7].

use std::ops::Range;

use crate::Fault;

/// Bytes of a page, and those before its checksum.
const PAGE: usize = 1024;
const PAYLOAD: usize = 1020;
/// Places in the header: length of the file, place of the description, its length.
const LENGTH: usize = 16;
const XML_AT: usize = 24;
const XML_BYTES: usize = 32;

/// What stands in the pages of a file.
pub struct Paged {
    /// Without checksums.
    pub bytes: Vec<u8>,
    /// Where the description stands.
    xml: Range<usize>,
}

impl Paged {
    /// Of a file whose checksums were found to hold.
    pub fn of(file: &[u8]) -> Result<Self, Fault> {
        let bytes: Vec<u8> = (file.chunks(PAGE))
            .flat_map(|page| &page[..page.len().min(PAYLOAD)])
            .copied()
            .collect();
        let word = |at: usize| {
            let word = bytes.get(at..at + 8).map(|b| b.try_into().expect("eight bytes"));
            word.map_or(0, u64::from_le_bytes)
        };
        let from = logical(word(XML_AT));
        let xml = from..from.saturating_add(word(XML_BYTES) as usize);
        match xml.end <= bytes.len() && !xml.is_empty() {
            true => Ok(Self { bytes, xml }),
            false => Err(Fault::Damaged {
                what: "the description of the scans lies beyond the file".into(),
            }),
        }
    }

    /// The description of what the file holds.
    pub fn description(&self) -> Result<String, Fault> {
        String::from_utf8(self.bytes[self.xml.clone()].to_vec()).map_err(|e| Fault::Damaged {
            what: format!("the description of the scans is no UTF-8: {e}"),
        })
    }

    /// Takes the description out, with what may be missing at the end of its page, if nothing follows it.
    pub fn take_description(&mut self) {
        if self.bytes.len() - self.xml.end < PAYLOAD {
            self.bytes.truncate(self.xml.start);
        } else {
            self.bytes[self.xml.clone()].fill(0);
        }
    }

    /// Puts something at the end; where it stands now.
    pub fn append(&mut self, new: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.bytes.extend_from_slice(new);
        self.bytes.len() - new.len()
    }

    /// The file with this description behind all else.
    pub fn file(mut self, description: &str) -> Vec<u8> {
        let at = self.append(description.as_bytes());
        self.bytes.resize(self.bytes.len().next_multiple_of(PAYLOAD), 0);
        let length = self.bytes.len() / PAYLOAD * PAGE;
        for (place, value) in [
            (LENGTH, length as u64),
            (XML_AT, physical(at)),
            (XML_BYTES, description.len() as u64),
        ] {
            self.bytes[place..place + 8].copy_from_slice(&value.to_le_bytes());
        }
        let table = table();
        let mut out = Vec::with_capacity(length);
        for page in self.bytes.chunks(PAYLOAD) {
            out.extend_from_slice(page);
            out.extend_from_slice(&checksum(&table, page).to_be_bytes());
        }
        out
    }
}

/// Place in the pages' contents of a place in the file.
pub fn logical(physical: u64) -> usize {
    let (page, within) = (physical / PAGE as u64, physical % PAGE as u64);
    page as usize * PAYLOAD + (within as usize).min(PAYLOAD)
}

/// The other way round.
pub fn physical(logical: usize) -> u64 {
    (logical / PAYLOAD * PAGE + logical % PAYLOAD) as u64
}

/// Remainders of single bytes by Castagnoli's polynomial, CRC-32C.
fn table() -> [u32; 256] {
    std::array::from_fn(|byte| {
        (0..8).fold(byte as u32, |rest, _| {
            rest >> 1 ^ if rest & 1 == 1 { 0x82f6_3b78 } else { 0 }
        })
    })
}

fn checksum(table: &[u32; 256], bytes: &[u8]) -> u32 {
    !bytes
        .iter()
        .fold(!0, |sum: u32, b| table[usize::from(sum as u8 ^ b)] ^ sum >> 8)
}
