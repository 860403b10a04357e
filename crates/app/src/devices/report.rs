//! What a report says, in numbers of one fixed shape.

/// Axes and buttons as a device counts them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sample {
    /// Axes in the order of the device; those that it lacks are 0.
    pub axes: [i32; 8],
    /// Buttons that are down, from the lowest bit.
    pub buttons: u32,
    /// What else it says, by device.
    pub flags: u32,
}

/// Why a report was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Rejected {
    /// Too short or too long.
    #[error("report {report} has {length} bytes and not {wanted}")]
    Length {
        /// Its number, 0 without.
        report: u8,
        /// Bytes that came, the number of the report among them.
        length: usize,
        /// What it should have.
        wanted: &'static str,
    },
    /// No such report is known.
    #[error("report {report} is unknown")]
    Unknown {
        /// Its number.
        report: u8,
    },
}

/// Reads reports into a sample, in the order in which they come. Holds between two of them what the first one said.
pub trait Parse: Send {
    /// Takes a report as it was read: its number is the first byte where the device numbers its reports.
    ///
    /// # Errors
    /// [`Rejected`]; nothing has changed then.
    fn take(&mut self, report: &[u8]) -> Result<(), Rejected>;

    /// What the reports told so far.
    fn sample(&self) -> Sample;
}

/// A signed number of two bytes, the low one first, 0 where there are none.
pub fn i16_at(bytes: &[u8], at: usize) -> i16 {
    match bytes.get(at..at + 2) {
        Some(two) => i16::from_le_bytes([two[0], two[1]]),
        None => 0,
    }
}
