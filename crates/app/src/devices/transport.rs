//! How reports come and go, whatever carries them.

use std::time::Duration;

/// Who a device says it is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Where the system has it.
    pub path: String,
    /// Vendor by the list of the USB consortium.
    pub vendor: u16,
    /// Product, as the vendor counts them.
    pub product: u16,
    /// Page and usage of every collection that says what it is for, the outermost first.
    pub usages: Vec<(u16, u16)>,
    /// Name of its maker, as it tells it.
    pub maker: String,
    /// Name of the product, as it tells it.
    pub name: String,
}

impl Identity {
    /// Whether a collection of it has this page and usage.
    pub fn has(&self, page: u16, usage: u16) -> bool {
        self.usages.contains(&(page, usage))
    }

    /// Vendor and product as they are written: `256f:c635`.
    pub fn ids(&self) -> String {
        format!("{:04x}:{:04x}", self.vendor, self.product)
    }
}

/// What went wrong on the way to a device.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TransportError {
    /// It was unplugged.
    #[error("the device is gone: {0}")]
    Gone(String),
    /// The system does not let this user open it.
    #[error("{path} may not be opened by this user; install the rules that `isoclay devices --udev` prints")]
    Denied {
        /// Where the system has it.
        path: String,
    },
    /// Anything else.
    #[error("{0}")]
    Failed(String),
}

/// Carries reports. Everything here may wait, so that no tick may call it. A report begins with its number, which is 0 where the
/// device does not number them; of those, [`Transport::read`] leaves it away, as HID does.
pub trait Transport: Send {
    /// Waits for an input report and copies as much of it as there is room for. 0 if none came in time.
    ///
    /// # Errors
    /// [`TransportError`].
    fn read(&mut self, report: &mut [u8], timeout: Duration) -> Result<usize, TransportError>;

    /// Asks for an input report now; its number is the first byte. The bytes of it, that number among them.
    ///
    /// # Errors
    /// [`TransportError`].
    fn input(&mut self, report: &mut [u8]) -> Result<usize, TransportError>;

    /// Sends an output report.
    ///
    /// # Errors
    /// [`TransportError`].
    fn write(&mut self, report: &[u8]) -> Result<(), TransportError>;

    /// Asks for a feature report; its number is the first byte. The bytes of it, that number among them.
    ///
    /// # Errors
    /// [`TransportError`].
    fn feature(&mut self, report: &mut [u8]) -> Result<usize, TransportError>;

    /// Sends a feature report.
    ///
    /// # Errors
    /// [`TransportError`].
    fn set_feature(&mut self, report: &[u8]) -> Result<(), TransportError>;
}
