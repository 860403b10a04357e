//! Which devices are there.

use std::path::Path;

use super::hid;
use super::transport::{Identity, TransportError};
use super::{pid, rawhid, spacemouse};

/// What a device is, as far as it tells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A cap of 3Dconnexion, with its name.
    SpaceMouse(String),
    /// What may be a force board: the arm on it is for the user to name.
    Board,
    /// A force device by the class for physical interfaces.
    Pid,
}

/// A device that there is a driver for.
#[derive(Clone, Debug)]
pub struct Found {
    /// Who it says it is.
    pub identity: Identity,
    /// What it is.
    pub kind: Kind,
    /// Whether this user may not open it.
    pub is_denied: bool,
}

/// All that was found.
#[derive(Clone, Debug, Default)]
pub struct Everything {
    /// Devices that there is a driver for.
    pub devices: Vec<Found>,
    /// HID devices besides.
    pub others: usize,
    /// Whether the system has raw HID devices at all.
    pub has_hidraw: bool,
}

/// What a device is. None of one that there is no driver for.
pub fn recognize(identity: &Identity) -> Option<Kind> {
    if let Some(name) = spacemouse::ids::recognize(identity) {
        return Some(Kind::SpaceMouse(name.into()));
    }
    if rawhid::recognize(identity) {
        return Some(Kind::Board);
    }
    pid::recognize(identity).then_some(Kind::Pid)
}

/// Looks for devices. Opens none for longer than it takes to see whether it may.
///
/// # Errors
/// [`TransportError::Failed`] where the system does not tell.
pub fn find() -> Result<Everything, TransportError> {
    let all = hid::list()?;
    let count = all.len();
    let devices: Vec<Found> = all
        .into_iter()
        .filter_map(|identity| {
            let kind = recognize(&identity)?;
            let is_denied = hid::is_denied(&identity);
            Some(Found {
                identity,
                kind,
                is_denied,
            })
        })
        .collect();
    // The class is there as soon as the kernel has the driver; in a container it is empty.
    let class = Path::new("/sys/class/hidraw");
    let is_filled = std::fs::read_dir(class).is_ok_and(|mut entries| entries.next().is_some());
    Ok(Everything {
        others: count - devices.len(),
        devices,
        has_hidraw: count > 0 || is_filled || !cfg!(target_os = "linux"),
    })
}
