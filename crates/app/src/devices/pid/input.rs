//! Input reports of a force device.

use super::layout::Input;
use crate::devices::report::{Parse, Rejected, Sample};

/// What the reports told so far.
#[derive(Clone, Debug)]
pub struct Reports {
    input: Input,
    sample: Sample,
    /// Of a device whose reports have no numbers, with the 0 in front that they lack.
    whole: Vec<u8>,
}

impl Reports {
    /// Reads the reports of a layout.
    pub fn new(input: Input) -> Self {
        Self {
            input,
            sample: Sample::default(),
            whole: Vec::new(),
        }
    }

    fn read(&mut self, report: &[u8]) -> Result<(), Rejected> {
        let id = report[0];
        let known = self.input.lengths.iter().find(|(known, _)| *known == id);
        let Some((_, length)) = known else {
            return Err(Rejected::Unknown { report: id });
        };
        if *length != report.len() {
            return Err(Rejected::Length {
                report: id,
                length: report.len(),
                wanted: "as many as its descriptor says",
            });
        }
        for (to, slot) in self.sample.axes.iter_mut().zip(self.input.axes) {
            if let Some(value) = slot.filter(|s| s.report == id).and_then(|s| s.get(report)) {
                *to = value as i32;
            }
        }
        for (i, slot) in self.input.buttons.iter().enumerate() {
            if slot.report == id {
                let is_down = slot.get(report) == Some(1);
                self.sample.buttons = self.sample.buttons & !(1 << i) | u32::from(is_down) << i;
            }
        }
        Ok(())
    }
}

impl Parse for Reports {
    fn take(&mut self, report: &[u8]) -> Result<(), Rejected> {
        if report.is_empty() {
            return Err(Rejected::Unknown { report: 0 });
        }
        if self.input.is_numbered {
            return self.read(report);
        }
        let mut whole = std::mem::take(&mut self.whole);
        whole.clear();
        whole.push(0);
        whole.extend_from_slice(report);
        let taken = self.read(&whole);
        self.whole = whole;
        taken
    }

    fn sample(&self) -> Sample {
        self.sample
    }
}
