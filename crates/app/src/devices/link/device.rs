//! A device behind its two threads, as the haptic thread sees it.

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use glam::DVec3;
use tools::haptics::{Abilities, Device, DeviceError, Pose, Reading};

use super::{Counts, Link, Order, Reader, Writer, ends};
use crate::devices::clock::Clock;
use crate::devices::report::Sample;

/// What samples mean, and how a force is ordered: the part of a driver that has neither reports nor threads.
pub trait Model: Send {
    /// What the device can do.
    fn abilities(&self) -> &Abilities;

    /// Where the hand is, by the latest sample and the time when it was told, `now` in seconds. None before it is known.
    fn pose(&mut self, sample: Option<(&Sample, f64)>, now: f64) -> Option<Pose>;

    /// Whether a pose without a sample is a pose still: of a device that is silent while nobody touches it.
    fn holds(&self) -> bool {
        false
    }

    /// Buttons that are down, from the lowest bit.
    fn buttons(&self, sample: &Sample) -> u32 {
        sample.buttons
    }

    /// The order for a force on the hand, N, where the last pose was.
    fn order(&mut self, force: DVec3, torque: DVec3) -> Order;
}

/// Time that dropping waits for the writer.
const GRACE: Duration = Duration::from_millis(100);

/// A device behind a link.
pub struct Linked {
    model: Box<dyn Model>,
    link: Arc<Link>,
    clock: Clock,
    heard: Option<(Sample, f64)>,
    threads: Vec<JoinHandle<()>>,
}

impl Linked {
    /// The haptic side of a link whose halves somebody else moves on.
    pub fn new(model: Box<dyn Model>, link: Arc<Link>, clock: Clock) -> Self {
        Self {
            model,
            link,
            clock,
            heard: None,
            threads: Vec::new(),
        }
    }

    /// Begins the threads.
    ///
    /// # Errors
    /// [`DeviceError::Refused`] where the system has none left.
    pub fn begin(mut self, mut reader: Reader, mut writer: Writer) -> Result<Self, DeviceError> {
        ends::remember(&self.link);
        let named = |name: &str| std::thread::Builder::new().name(name.into());
        let refused = |e: std::io::Error| DeviceError::Refused {
            device: self.model.abilities().name.clone(),
            why: format!("no thread can be started for it ({e})"),
        };
        let writing = named("hid write").spawn(move || {
            while writer.step() {
                std::thread::sleep(writer.pace());
            }
        });
        self.threads.push(writing.map_err(refused)?);
        let reading = named("hid read").spawn(move || while reader.step() {});
        self.threads.push(reading.map_err(refused)?);
        Ok(self)
    }

    /// Reports so far.
    pub fn counts(&self) -> Counts {
        self.link.counts()
    }

    fn gone(&self) -> DeviceError {
        DeviceError::Gone(self.model.abilities().name.clone())
    }
}

impl Device for Linked {
    fn abilities(&self) -> &Abilities {
        self.model.abilities()
    }

    fn read(&mut self) -> Result<Reading, DeviceError> {
        if self.link.is_gone() || self.link.must_end() {
            return Err(self.gone());
        }
        let now = self.clock.now();
        // What was torn comes with the next tick.
        self.heard = self.link.sample().or(self.heard);
        let sample = self.heard.as_ref().map(|(sample, told)| (sample, *told));
        let Some(pose) = self.model.pose(sample, now) else {
            return Err(DeviceError::Silent(self.model.abilities().name.clone()));
        };
        let age = match self.heard {
            Some((_, told)) if !self.model.holds() => (now - told).max(0.0),
            _ => 0.0,
        };
        Ok(Reading {
            pose,
            buttons: sample.map_or(0, |(s, _)| self.model.buttons(s)),
            age,
        })
    }

    fn send(&mut self, force: DVec3, torque: DVec3) -> Result<(), DeviceError> {
        if self.link.is_gone() || self.link.must_end() {
            // Whoever looks later finds no force either.
            self.link.put_order(&Order::default(), self.clock.now());
            return Err(self.gone());
        }
        let is_finite = force.is_finite() && torque.is_finite();
        let mut order = match is_finite {
            true => self.model.order(force, torque),
            false => Order::default(),
        };
        order.flags = self.heard.map_or(0, |(sample, _)| sample.flags);
        self.link.put_order(&order, self.clock.now());
        Ok(())
    }
}

impl Drop for Linked {
    fn drop(&mut self) {
        self.link.end();
        let start = Instant::now();
        while start.elapsed() < GRACE && self.threads.iter().any(|t| !t.is_finished()) {
            std::thread::sleep(Duration::from_micros(200));
        }
        for thread in self.threads.drain(..) {
            // One that hangs in the system ends with it.
            if thread.is_finished() {
                let _ = thread.join();
            }
        }
    }
}
