//! Reports of the 3Dconnexion family.
//!
//! | number | bytes | says |
//! | --- | --- | --- |
//! | 0x01 | 7 | X, Y, Z, each 16 bits signed |
//! | 0x01 | 13 | X, Y, Z, Rx, Ry, Rz |
//! | 0x02 | 7 | Rx, Ry, Rz |
//! | 0x03 | 2 to 9 | buttons, a bit each |
//! | 0x17 | 2 or 3 | charge of the battery in per cent |
//! | 0x1c | odd | numbers of the buttons that are down, 16 bits each, from 1; 0 is none |
//! | 0x1d | odd | those that are down for long |

use crate::devices::report::{Parse, Rejected, Sample, i16_at};

/// Flags of a sample: bit 8 says that the charge of the battery is known, the lower ones are that charge.
pub const HAS_CHARGE: u32 = 0x100;

/// Most buttons of a list that count: as many as fit into the longest report.
const LISTED: usize = 31;

/// What the reports told so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reports {
    axes: [i16; 6],
    /// Buttons by bits, by the list of those that are down, and by the list of those that are down for long.
    bits: u32,
    listed: u32,
    long: u32,
    charge: Option<u8>,
}

/// Buttons of a list, by bits. A button beyond the 32nd has none.
fn listed(numbers: &[u8]) -> u32 {
    numbers
        .chunks_exact(2)
        .map(|two| u16::from_le_bytes([two[0], two[1]]))
        .filter(|n| (1..=32).contains(n))
        .fold(0, |bits, n| bits | 1 << (n - 1))
}

impl Reports {
    fn three(&mut self, first: usize, payload: &[u8]) {
        for i in 0..3 {
            self.axes[first + i] = i16_at(payload, 2 * i);
        }
    }
}

impl Parse for Reports {
    fn take(&mut self, report: &[u8]) -> Result<(), Rejected> {
        let Some((&id, payload)) = report.split_first() else {
            return Err(Rejected::Unknown { report: 0 });
        };
        let wrong = |wanted| {
            Err(Rejected::Length {
                report: id,
                length: report.len(),
                wanted,
            })
        };
        let is_list = payload.len() % 2 == 0 && payload.len() <= 2 * LISTED;
        match (id, payload.len()) {
            (0x01, 6) => self.three(0, payload),
            (0x01, 12) => {
                self.three(0, payload);
                self.three(3, &payload[6..]);
            }
            (0x01, _) => return wrong("7 or 13"),
            (0x02, 6) => self.three(3, payload),
            (0x02, _) => return wrong("7"),
            (0x03, 1..=8) => {
                let mut bytes = [0; 4];
                let count = payload.len().min(4);
                bytes[..count].copy_from_slice(&payload[..count]);
                self.bits = u32::from_le_bytes(bytes);
            }
            (0x03, _) => return wrong("2 to 9"),
            (0x17, 1 | 2) => self.charge = Some(payload[0].min(100)),
            (0x17, _) => return wrong("2 or 3"),
            (0x1c, _) if is_list => self.listed = listed(payload),
            (0x1d, _) if is_list => self.long = listed(payload),
            (0x1c | 0x1d, _) => return wrong("an odd number up to 63"),
            _ => return Err(Rejected::Unknown { report: id }),
        }
        Ok(())
    }

    fn sample(&self) -> Sample {
        let mut axes = [0; 8];
        for (to, from) in axes.iter_mut().zip(self.axes) {
            *to = from.into();
        }
        Sample {
            axes,
            buttons: self.bits | self.listed | self.long,
            flags: self.charge.map_or(0, |c| HAS_CHARGE | u32::from(c)),
        }
    }
}
