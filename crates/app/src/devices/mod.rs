//! What a hand can hold: drivers of devices that tell where they are, some of which push back.
//!
//! Every driver has a pure part, which turns reports into poses and forces into reports, and is tested by recorded and synthetic
//! reports in virtual time. What carries the reports is behind [`transport::Transport`].

mod clock;
mod find;
mod forceless;
mod frame;
mod hid;
mod lag;
mod link;
mod mailbox;
#[cfg(feature = "window")]
mod mouse;
mod name;
mod open;
mod pid;
mod rawhid;
mod report;
mod scripted;
mod spacemouse;
mod transport;

#[cfg(test)]
mod fake;

pub use find::{Everything, Found, Kind, find};
pub use link::leave_all;
#[cfg(feature = "window")]
pub use mouse::{Mouse, mouse};
pub use name::{FORMS, Name};
pub use open::{Force, OpenError, open};

/// The rules that let users of a seat open these devices.
pub const UDEV_RULES: &str = include_str!("../../udev/70-isoclay.rules");
