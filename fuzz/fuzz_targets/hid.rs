#![no_main]
//! Any descriptor, whole devices with some bytes changed, and any reports: refused or taken, within their bounds.

// Drivers are part of the program, which is no library: the files without threads and devices are taken as they are.
#[path = "../../crates/app/src/devices/pid/descriptor.rs"]
#[allow(dead_code)]
mod descriptor;
#[path = "../../crates/app/src/devices/pid/effects.rs"]
#[allow(dead_code)]
mod effects;
#[path = "../../crates/app/src/devices/pid/input.rs"]
mod input;
#[path = "../../crates/app/src/devices/pid/layout.rs"]
#[allow(dead_code)]
mod layout;
#[path = "../../crates/app/src/devices/pid/makers.rs"]
#[allow(dead_code)]
mod makers;
#[path = "../../crates/app/src/devices/rawhid/report.rs"]
#[allow(dead_code)]
mod raw;
#[path = "../../crates/app/src/devices/report.rs"]
mod report;
#[path = "../../crates/app/src/devices/pid/slot.rs"]
#[allow(dead_code)]
mod slot;
#[path = "../../crates/app/src/devices/spacemouse/reports.rs"]
#[allow(dead_code)]
mod spacemouse;
#[path = "../../crates/app/src/devices/transport.rs"]
#[allow(dead_code)]
mod transport;

mod devices {
    pub(crate) use crate::{report, transport};
}

use descriptor::Descriptor;
use effects::{Kind, Spring};
use layout::Layout;
use libfuzzer_sys::fuzz_target;
use report::Parse;

/// Plays reports of a length each; one that is refused changes nothing.
fn play(parser: &mut dyn Parse, bytes: &[u8], length: usize) {
    for report in bytes.chunks(length.max(1)) {
        let before = parser.sample();
        if parser.take(report).is_err() {
            assert_eq!(parser.sample(), before);
        }
    }
}

/// The bytes of a device, some of which are changed: two bytes say where, one what.
fn damaged(mut device: Vec<u8>, changes: &[u8]) -> Vec<u8> {
    for change in changes.chunks_exact(3) {
        let at = usize::from(u16::from_le_bytes([change[0], change[1]])) % device.len();
        device[at] = change[2];
    }
    device
}

fuzz_target!(|bytes: &[u8]| {
    let [kind, split, length, rest @ ..] = bytes else { return };
    play(&mut spacemouse::Reports::default(), rest, usize::from(*length));
    play(&mut raw::Reports::default(), rest, raw::LENGTH);
    let (first, reports) = rest.split_at(rest.len().min(usize::from(*split)));
    let described = match kind % 3 {
        0 => rest.to_vec(),
        1 => damaged(makers::openffboard(), first),
        _ => damaged(makers::rhino(), first),
    };
    let Ok(descriptor) = Descriptor::parse(&described) else { return };
    let Ok(layout) = Layout::of(descriptor) else { return };
    play(&mut input::Reports::new(layout.input.clone()), reports, usize::from(*length));
    let value = f64::from(*length) / 100.0 - 1.3;
    let spring = Spring { centre: value, stiffness: [value, 1.0], saturation: 1.0 };
    let _ = layout.set_effect(i64::from(*split), Kind::Constant, [true; 3], 27_000, 200);
    let _ = layout.set_effect(-1, Kind::Spring, [true; 3], 0, 200);
    let _ = (layout.set_constant(1, value), layout.set_spring(1, 2, &spring));
    let _ = (layout.start(9), layout.full_gain(), layout.command(layout.control.disable));
});
