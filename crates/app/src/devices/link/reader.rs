//! What the reading thread does in a step.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use super::Link;
use crate::devices::clock::Clock;
use crate::devices::report::Parse;
use crate::devices::transport::Transport;

/// Longest report that is told from a longer one. Those of HID over full speed have 64 bytes, and HID allows more.
const LONGEST: usize = 1024;

/// Reports taken at once, at the most: the system keeps no more for a device that nobody read.
const QUEUED: usize = 64;

/// Longest wait for a report. The end of the link is seen that much later.
const WAIT: Duration = Duration::from_millis(2);

/// Silence after which the reader asks, s.
const ASKS_AFTER: f64 = 0.004;

/// The reading half of a link.
pub struct Reader {
    transport: Box<dyn Transport>,
    parser: Box<dyn Parse>,
    link: Arc<Link>,
    clock: Clock,
    buffer: Vec<u8>,
    /// Time of the last report that was taken.
    heard: f64,
    /// Number of the report to ask for.
    asks: Option<u8>,
}

impl Reader {
    /// Reads what comes from a device.
    pub fn new(transport: Box<dyn Transport>, parser: Box<dyn Parse>, link: Arc<Link>, clock: Clock) -> Self {
        let heard = clock.now();
        Self {
            transport,
            parser,
            link,
            clock,
            buffer: vec![0; LONGEST],
            heard,
            asks: None,
        }
    }

    /// Asks for this report where none comes by itself: most HID devices are silent while nothing changes, which is not to be
    /// told from a broken cable otherwise.
    pub fn asking(self, report: u8) -> Self {
        Self {
            asks: Some(report),
            ..self
        }
    }

    /// Waits for a report, takes all that are there, and tells what the last one says. Whether there may be more.
    pub fn step(&mut self) -> bool {
        if self.link.must_end() || self.link.is_gone() {
            return false;
        }
        let (mut has_news, mut wait) = (false, WAIT);
        for _ in 0..QUEUED {
            match self.transport.read(&mut self.buffer, wait) {
                Ok(0) => break,
                Ok(length) => has_news |= self.take(length),
                Err(_) => {
                    self.link.lose();
                    return false;
                }
            }
            wait = Duration::ZERO;
        }
        has_news = has_news || self.ask();
        if has_news {
            self.heard = self.clock.now();
            self.link.put_sample(&self.parser.sample(), self.heard);
        }
        true
    }

    fn take(&mut self, length: usize) -> bool {
        let report = &self.buffer[..length.min(LONGEST)];
        let is_taken = self.parser.take(report).is_ok();
        let count = if is_taken {
            &self.link.taken
        } else {
            &self.link.rejected
        };
        count.fetch_add(1, Ordering::Relaxed);
        is_taken
    }

    /// Asks for a report after a silence. Whether one came.
    fn ask(&mut self) -> bool {
        let Some(report) = self.asks else { return false };
        if self.clock.now() - self.heard < ASKS_AFTER {
            return false;
        }
        self.buffer[0] = report;
        match self.transport.input(&mut self.buffer) {
            // A device without numbers still has the 0 in front that its reports lack.
            Ok(length) if report == 0 && length > 0 => {
                self.buffer.copy_within(1..length.min(LONGEST), 0);
                self.take(length - 1)
            }
            Ok(length) => length > 0 && self.take(length),
            Err(_) => false,
        }
    }
}
