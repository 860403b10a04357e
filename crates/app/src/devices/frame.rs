//! Axes of devices and of the room that the hand is in.

use glam::DVec3;

/// Axes of HID controllers (right, towards the user, down) in those of the room (right, away from the user, up), and back: half a
/// turn about the first, so that turns by the right hand stay such.
pub fn room_from_hid(v: DVec3) -> DVec3 {
    DVec3::new(v.x, -v.y, -v.z)
}
