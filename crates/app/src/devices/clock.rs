//! Time since a device was opened, of the machine or of a test.

#[cfg(test)]
use std::sync::Arc;
#[cfg(test)]
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// A clock that threads share.
#[derive(Clone, Debug)]
pub enum Clock {
    /// The machine's.
    Real(Instant),
    /// One that stands until it is set: the bits of its seconds.
    #[cfg(test)]
    Virtual(Arc<AtomicU64>),
}

impl Clock {
    /// The machine's, from now on.
    pub fn real() -> Self {
        Self::Real(Instant::now())
    }

    /// One that stands at 0.
    #[cfg(test)]
    pub fn standing() -> Self {
        Self::Virtual(Arc::default())
    }

    /// Sets a clock that stands.
    #[cfg(test)]
    pub fn set(&self, seconds: f64) {
        match self {
            Self::Real(_) => panic!("the machine's clock is not set"),
            Self::Virtual(bits) => bits.store(seconds.to_bits(), Ordering::Release),
        }
    }

    /// Seconds.
    pub fn now(&self) -> f64 {
        match self {
            Self::Real(start) => start.elapsed().as_secs_f64(),
            #[cfg(test)]
            Self::Virtual(bits) => f64::from_bits(bits.load(Ordering::Acquire)),
        }
    }
}
