//! Reports of the board: seven numbers of 16 bits, the low byte first, at the beginning of 64 bytes. None is numbered.

use crate::devices::report::{Parse, Rejected, Sample, i16_at};

/// Bytes of a report.
pub const LENGTH: usize = 64;

/// What an output report asks for: currents.
const CURRENTS: i16 = 0;
/// What an output report asks for: to set the encoders.
const PRESET: i16 = 1;

/// Flag of a sample: the board asks to be calibrated.
pub const ASKS: u32 = 1;

/// The fourth encoder carries the button: it reads this much more while that is down.
const BUTTON: i16 = 10_000;
/// From here it must be the button.
const IS_BUTTON: i16 = 5_000;

/// What the reports told so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reports {
    sample: Sample,
}

impl Parse for Reports {
    fn take(&mut self, report: &[u8]) -> Result<(), Rejected> {
        if report.len() != LENGTH {
            return Err(Rejected::Length {
                report: 0,
                length: report.len(),
                wanted: "64",
            });
        }
        let mut encoders: [i16; 6] = std::array::from_fn(|i| i16_at(report, 2 * i));
        let is_down = encoders[3] > IS_BUTTON;
        if is_down {
            encoders[3] -= BUTTON;
        }
        let mut axes = [0; 8];
        for (to, from) in axes.iter_mut().zip(encoders) {
            *to = from.into();
        }
        self.sample = Sample {
            axes,
            buttons: is_down.into(),
            flags: if i16_at(report, 12) == 1 { ASKS } else { 0 },
        };
        Ok(())
    }

    fn sample(&self) -> Sample {
        self.sample
    }
}

/// An output report, with the 0 in front that stands for no number.
fn output(numbers: [i16; 7]) -> [u8; 1 + LENGTH] {
    let mut report = [0; 1 + LENGTH];
    for (two, n) in report[1..].chunks_exact_mut(2).zip(numbers) {
        two.copy_from_slice(&n.to_le_bytes());
    }
    report
}

/// Asks for currents, mA.
pub fn with_currents([a, b, c]: [i16; 3]) -> [u8; 1 + LENGTH] {
    output([a, b, c, CURRENTS, 0, 0, 0])
}

/// Sets the encoders.
pub fn with_preset([a, b, c, d, e, f]: [i16; 6]) -> [u8; 1 + LENGTH] {
    output([d, e, f, PRESET, a, b, c])
}
