//! What the writing thread does in a step.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use tools::haptics::gates::held;

use super::{Link, Order, SILENCE};
use crate::devices::clock::Clock;
use crate::devices::transport::{Transport, TransportError};

/// Failed writes in a row after which a device counts as gone.
const PATIENCE: u32 = 3;

/// Sends one output report.
pub type Out<'a> = dyn FnMut(&[u8]) -> Result<(), TransportError> + 'a;

/// Turns orders into output reports.
pub trait Compose: Send {
    /// Says what is ordered now. `now` is in seconds and only grows.
    ///
    /// # Errors
    /// Those of `out`.
    fn write(&mut self, order: &Order, now: f64, out: &mut Out) -> Result<(), TransportError>;

    /// Leaves the hand without force, whatever was said before. Goes on where a report fails.
    fn leave(&mut self, out: &mut Out);

    /// Time between two looks at what is ordered.
    fn pace(&self) -> Duration {
        Duration::from_micros(200)
    }
}

/// The writing half of a link. Dropped, by a panic also, it leaves the hand without force.
pub struct Writer {
    transport: Box<dyn Transport>,
    composer: Box<dyn Compose>,
    link: Arc<Link>,
    clock: Clock,
    /// Age of the last sample from which there is no force, s.
    silence: f64,
    failures: u32,
}

impl Writer {
    /// Writes to a device that tells where it is every `period` seconds.
    pub fn new(
        transport: Box<dyn Transport>,
        composer: Box<dyn Compose>,
        link: Arc<Link>,
        clock: Clock,
        period: f64,
    ) -> Self {
        Self {
            transport,
            composer,
            link,
            clock,
            silence: SILENCE.max(3.0 * period),
            failures: 0,
        }
    }

    /// What may be ordered now: less and less where no order follows, as the servo reckons with, and nothing where the device is silent.
    fn order(&self, now: f64) -> Order {
        let (Some((order, given)), Some((_, told))) = (self.link.order(), self.link.sample()) else {
            return Order::default();
        };
        let is_finite = order.force.iter().chain(&order.at).all(|v| v.is_finite());
        let share = match is_finite && now - told < self.silence {
            true => held(now - given),
            false => 0.0,
        };
        match share > 0.0 {
            true => Order {
                force: order.force.map(|v| v * share),
                ..order
            },
            false => Order {
                flags: order.flags,
                ..Order::default()
            },
        }
    }

    /// Says what is ordered. Whether there may be more to say.
    pub fn step(&mut self) -> bool {
        if self.link.must_end() || self.link.is_gone() {
            self.leave();
            return false;
        }
        let now = self.clock.now();
        let order = self.order(now);
        let transport = &mut self.transport;
        match self
            .composer
            .write(&order, now, &mut |report| transport.write(report))
        {
            Ok(()) => self.failures = 0,
            Err(e) => {
                self.link.failed.fetch_add(1, Ordering::Relaxed);
                self.failures += 1;
                if matches!(e, TransportError::Gone(_)) || self.failures >= PATIENCE {
                    self.link.lose();
                }
            }
        }
        true
    }

    /// Time between two steps.
    pub fn pace(&self) -> Duration {
        self.composer.pace()
    }

    fn leave(&mut self) {
        if self.link.has_left() {
            return;
        }
        let transport = &mut self.transport;
        self.composer.leave(&mut |report| transport.write(report));
        self.link.has_left.store(true, Ordering::Release);
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        self.leave();
    }
}
