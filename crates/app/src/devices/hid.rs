//! HID devices of the system, over `hidapi`.

use std::collections::BTreeMap;
use std::ffi::CString;
use std::time::Duration;

use hidapi::{HidApi, HidDevice, HidError};

use super::transport::{Identity, Transport, TransportError};

/// Largest descriptor that Linux takes (HID_MAX_DESCRIPTOR_SIZE).
const LARGEST_DESCRIPTOR: usize = 4096;

fn failed(e: HidError) -> TransportError {
    TransportError::Failed(e.to_string())
}

/// All HID devices that the system has, by where it has them. Tells also of those that this user may not open.
///
/// # Errors
/// [`TransportError::Failed`].
pub fn list() -> Result<Vec<Identity>, TransportError> {
    let api = HidApi::new().map_err(failed)?;
    let mut found: BTreeMap<String, Identity> = BTreeMap::new();
    // One entry for each usage of a device.
    for info in api.device_list() {
        let path = info.path().to_string_lossy().into_owned();
        let text = |s: Option<&str>| s.unwrap_or_default().trim().to_string();
        let identity = found.entry(path.clone()).or_insert_with(|| Identity {
            path,
            vendor: info.vendor_id(),
            product: info.product_id(),
            usages: Vec::new(),
            maker: text(info.manufacturer_string()),
            name: text(info.product_string()),
        });
        identity.usages.push((info.usage_page(), info.usage()));
    }
    Ok(found.into_values().collect())
}

/// A HID device that is open. Two of the same device share nothing: one may read while the other writes.
pub struct Hid {
    device: HidDevice,
}

impl Hid {
    /// Opens a device.
    ///
    /// # Errors
    /// [`TransportError`].
    pub fn open(identity: &Identity) -> Result<Self, TransportError> {
        if is_denied(identity) {
            let path = identity.path.clone();
            return Err(TransportError::Denied { path });
        }
        let api = HidApi::new().map_err(failed)?;
        let path = CString::new(identity.path.clone())
            .map_err(|_| TransportError::Failed("its path holds a zero byte".into()))?;
        let device = api
            .open_path(&path)
            .map_err(|e| TransportError::Gone(e.to_string()))?;
        Ok(Self { device })
    }

    /// The report descriptor.
    ///
    /// # Errors
    /// [`TransportError`].
    pub fn descriptor(&self) -> Result<Vec<u8>, TransportError> {
        let mut bytes = vec![0; LARGEST_DESCRIPTOR];
        let length = self.device.get_report_descriptor(&mut bytes).map_err(failed)?;
        bytes.truncate(length);
        Ok(bytes)
    }
}

/// Whether the system does not let this user read and write a device, which only a try tells for sure: groups, access lists and
/// containers all have a say.
pub fn is_denied(identity: &Identity) -> bool {
    let tried = std::fs::OpenOptions::new()
        .read(true)
        .write(true)
        .open(&identity.path);
    tried.is_err_and(|e| e.kind() == std::io::ErrorKind::PermissionDenied)
}

impl Transport for Hid {
    fn read(&mut self, report: &mut [u8], timeout: Duration) -> Result<usize, TransportError> {
        // Poll counts whole milliseconds; what is less is still no endless wait.
        let milliseconds = i32::try_from(timeout.as_millis()).unwrap_or(i32::MAX);
        self.device
            .read_timeout(report, milliseconds)
            .map_err(|e| TransportError::Gone(e.to_string()))
    }

    fn input(&mut self, report: &mut [u8]) -> Result<usize, TransportError> {
        self.device.get_input_report(report).map_err(failed)
    }

    fn write(&mut self, report: &[u8]) -> Result<(), TransportError> {
        let written = self.device.write(report).map_err(failed)?;
        if written < report.len() {
            let text = format!("{written} of {} bytes were written", report.len());
            return Err(TransportError::Failed(text));
        }
        Ok(())
    }

    fn feature(&mut self, report: &mut [u8]) -> Result<usize, TransportError> {
        self.device.get_feature_report(report).map_err(failed)
    }

    fn set_feature(&mut self, report: &[u8]) -> Result<(), TransportError> {
        self.device.send_feature_report(report).map_err(failed)
    }
}
