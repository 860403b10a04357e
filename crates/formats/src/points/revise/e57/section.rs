//! Points of a scan as packets of bits, each attribute a stream of its own [ASTM E2807, §9.3].

use e57::{RecordDataType, RecordValue};

use super::pages::physical;
use crate::Fault;
use crate::points::e57::bits;

/// Bytes of the head of a section, and of that of a packet.
const HEAD: usize = 32;
const PACKET_HEAD: usize = 6;
/// A packet's length is a number of 16 bits, one less than it is, and a multiple of four.
const LONGEST: usize = (1 << 16) - 4;

/// Points that are packed one after the other.
pub struct Section {
    /// Bits and least value of each attribute.
    attributes: Vec<(u32, i64)>,
    streams: Vec<Stream>,
    /// Points of a packet at most, so many that all its streams end with a whole byte.
    most: usize,
    waiting: usize,
    /// Points in all.
    pub count: u64,
    packets: Vec<u8>,
}

impl Section {
    pub fn of(attributes: impl Iterator<Item = RecordDataType>) -> Result<Self, Fault> {
        let attributes: Vec<(u32, i64)> = attributes
            .map(|kind| match kind {
                RecordDataType::ScaledInteger { min, .. } | RecordDataType::Integer { min, .. } => {
                    (bits(&kind) as u32, min)
                }
                _ => (bits(&kind) as u32, 0),
            })
            .collect();
        let row: usize = attributes.iter().map(|a| a.0 as usize).sum();
        let room = LONGEST.saturating_sub(PACKET_HEAD + 2 * attributes.len());
        let most = (8 * room / row.max(1)).min(room) & !7;
        if most == 0 {
            return Err(Fault::Value {
                what: "the attributes of a point",
                value: attributes.len().to_string(),
                remedy: "so many are not written back; convert the scan by isoclay convert and fit that",
            });
        }
        Ok(Self {
            streams: attributes.iter().map(|_| Stream::default()).collect(),
            attributes,
            most,
            waiting: 0,
            count: 0,
            packets: Vec::new(),
        })
    }

    pub fn push(&mut self, values: &[RecordValue]) {
        for ((value, (bits, min)), stream) in values.iter().zip(&self.attributes).zip(&mut self.streams) {
            let word = match value {
                RecordValue::Single(x) => u64::from(x.to_bits()),
                RecordValue::Double(x) => x.to_bits(),
                RecordValue::ScaledInteger(n) | RecordValue::Integer(n) => n.wrapping_sub(*min) as u64,
            };
            stream.push(word, *bits);
        }
        self.count += 1;
        self.waiting += 1;
        if self.waiting == self.most {
            self.pack();
        }
    }

    fn pack(&mut self) {
        let streams: Vec<Vec<u8>> = self.streams.iter_mut().map(Stream::take).collect();
        let bytes: usize = streams.iter().map(Vec::len).sum();
        let length = (PACKET_HEAD + 2 * streams.len() + bytes).next_multiple_of(4);
        let end = self.packets.len() + length;
        self.packets.extend([1, 0]);
        self.packets.extend((length as u16).wrapping_sub(1).to_le_bytes());
        self.packets.extend((streams.len() as u16).to_le_bytes());
        for stream in &streams {
            self.packets.extend((stream.len() as u16).to_le_bytes());
        }
        self.packets.extend(streams.concat());
        self.packets.resize(end, 0);
        self.waiting = 0;
    }

    /// Bytes of the section.
    pub fn length(&mut self) -> usize {
        if self.waiting > 0 {
            self.pack();
        }
        HEAD + self.packets.len()
    }

    /// The section, to stand at a place of the pages' contents; it has no index.
    pub fn bytes(mut self, at: usize) -> Vec<u8> {
        let length = self.length();
        let mut out = vec![0; HEAD];
        out[0] = 1;
        out[8..16].copy_from_slice(&(length as u64).to_le_bytes());
        out[16..24].copy_from_slice(&physical(at + HEAD).to_le_bytes());
        out.extend(self.packets);
        out
    }
}

/// Bits of one attribute, the lowest first.
#[derive(Default)]
struct Stream {
    bytes: Vec<u8>,
    rest: u128,
    count: u32,
}

impl Stream {
    fn push(&mut self, word: u64, bits: u32) {
        self.rest |= (u128::from(word) & ((1 << bits) - 1)) << self.count;
        self.count += bits;
        while self.count >= 8 {
            self.bytes.push(self.rest as u8);
            self.rest >>= 8;
            self.count -= 8;
        }
    }

    /// All of them, the last byte filled up.
    fn take(&mut self) -> Vec<u8> {
        if self.count > 0 {
            self.bytes.push(self.rest as u8);
        }
        (self.rest, self.count) = (0, 0);
        std::mem::take(&mut self.bytes)
    }
}
