//! Pens of an X server, through XInput2: raw events, which come to everybody whatever window has the pointer, on a connection of our own.

use std::sync::{Mutex, PoisonError, Weak};

use x11rb::connection::Connection;
use x11rb::errors::ReplyOrIdError;
use x11rb::protocol::Event;
use x11rb::protocol::xinput::{
    ConnectionExt as _, DeviceClassData, DeviceType, EventMask, Fp3232, RawMotionEvent, XIDeviceInfo,
    XIEventMask,
};
use x11rb::protocol::xproto::{Atom, ConnectionExt as _};
use x11rb::rust_connection::RustConnection;

use super::{Lately, Told};

/// All devices, the masters too.
const ALL: u16 = 0;

/// Tells of pens until nobody asks any more or the server ends. Where there is no pen it sleeps until one is plugged in; where there is no
/// server, or one without XInput 2, nothing is told.
pub(super) fn listen(to: Weak<Mutex<Lately>>) {
    let work = move || drop(follow(&to));
    // Without it there are mice still.
    let _ = std::thread::Builder::new().name("pens".into()).spawn(work);
}

fn follow(to: &Weak<Mutex<Lately>>) -> Result<(), ReplyOrIdError> {
    let Ok((server, screen)) = x11rb::connect(None) else {
        return Ok(());
    };
    let root = server.setup().roots[screen].root;
    // Since 2.1 raw events come to those too who do not hold the pointer.
    let version = server.xinput_xi_query_version(2, 2)?.reply()?;
    if (version.major_version, version.minor_version) < (2, 1) {
        return Ok(());
    }
    let label = server.intern_atom(false, b"Abs Pressure")?.reply()?.atom;
    select(&server, root, ALL, XIEventMask::HIERARCHY)?;
    let mut pens = find(&server, root, label)?;
    let mut is_new = true;
    loop {
        let Some(lately) = to.upgrade() else { return Ok(()) };
        if std::mem::take(&mut is_new) {
            lately.lock().unwrap_or_else(PoisonError::into_inner).is_there = !pens.is_empty();
        }
        drop(lately);
        let told = match server.wait_for_event()? {
            Event::XinputHierarchy(_) => {
                pens = find(&server, root, label)?;
                is_new = true;
                None
            }
            Event::XinputRawMotion(event) => of(&mut pens, event.deviceid).and_then(|pen| pen.moved(&event)),
            Event::XinputRawButtonPress(event) if event.detail == 1 => {
                of(&mut pens, event.deviceid).map(|pen| pen.down(&event))
            }
            Event::XinputRawButtonRelease(event) if event.detail == 1 => {
                of(&mut pens, event.deviceid).map(|_| Told::Up)
            }
            // A pen that was pulled out meanwhile, among others.
            _ => None,
        };
        if let (Some(told), Some(lately)) = (told, to.upgrade()) {
            lately.lock().unwrap_or_else(PoisonError::into_inner).tell(told);
        }
    }
}

fn of(pens: &mut [Pen], device: u16) -> Option<&mut Pen> {
    pens.iter_mut().find(|pen| pen.device == device)
}

fn select(server: &RustConnection, root: u32, device: u16, mask: XIEventMask) -> Result<(), ReplyOrIdError> {
    let mask = EventMask {
        deviceid: device,
        mask: vec![mask],
    };
    server.xinput_xi_select_events(root, &[mask])?;
    server.flush()?;
    Ok(())
}

/// The pens that are plugged in, each of which tells what it does from now on.
fn find(server: &RustConnection, root: u32, label: Atom) -> Result<Vec<Pen>, ReplyOrIdError> {
    let devices = server.xinput_xi_query_device(ALL)?.reply()?.infos;
    let pens: Vec<Pen> = devices
        .iter()
        .filter_map(|device| Pen::of(device, label))
        .collect();
    let what = XIEventMask::RAW_MOTION | XIEventMask::RAW_BUTTON_PRESS | XIEventMask::RAW_BUTTON_RELEASE;
    for pen in &pens {
        select(server, root, pen.device, what)?;
    }
    Ok(pens)
}

/// A device that knows how hard it is pressed.
#[derive(Clone, Debug, PartialEq)]
struct Pen {
    device: u16,
    /// Number of the valuator of the pressure, and its range.
    pressure: usize,
    range: [f64; 2],
    /// Where it is, in its own numbers.
    at: [f64; 2],
    press: f64,
}

impl Pen {
    /// A device, if it has a pressure. Masters have those of the devices that move them, which tell it themselves.
    fn of(device: &XIDeviceInfo, label: Atom) -> Option<Self> {
        if ![DeviceType::SLAVE_POINTER, DeviceType::FLOATING_SLAVE].contains(&device.type_) {
            return None;
        }
        let axes = device.classes.iter().filter_map(|class| match &class.data {
            DeviceClassData::Valuator(axis) => Some(axis),
            _ => None,
        });
        let axis = axes.into_iter().find(|axis| axis.label == label)?;
        let range = [axis.min, axis.max].map(number);
        (range[0] < range[1]).then_some(Self {
            device: device.deviceid,
            pressure: axis.number.into(),
            range,
            at: [f64::NAN; 2],
            press: 0.0,
        })
    }

    /// Where it goes, if it does; drivers tell of changes alone, and of some that move no pointer.
    fn moved(&mut self, event: &RawMotionEvent) -> Option<Told> {
        self.hear(event).then_some(Told::Moved(self.press))
    }

    fn down(&mut self, event: &RawMotionEvent) -> Told {
        self.hear(event);
        Told::Down(self.press)
    }

    /// Takes what an event tells; whether the pen is elsewhere now.
    fn hear(&mut self, event: &RawMotionEvent) -> bool {
        let before = self.at;
        for (valuator, value) in values(&event.valuator_mask, &event.axisvalues) {
            if valuator == self.pressure {
                let [least, most] = self.range;
                self.press = ((value - least) / (most - least)).clamp(0.0, 1.0);
            } else if let Some(at) = self.at.get_mut(valuator) {
                *at = value;
            }
        }
        self.at != before
    }
}

/// Valuators that an event tells of, and their values.
fn values(mask: &[u32], values: &[Fp3232]) -> impl Iterator<Item = (usize, f64)> {
    let bits = (0..32 * mask.len()).filter(|n| mask[n / 32] >> (n % 32) & 1 == 1);
    bits.zip(values.iter().copied().map(number))
}

fn number(Fp3232 { integral, frac }: Fp3232) -> f64 {
    f64::from(integral) + f64::from(frac) / libm::exp2(32.0)
}

#[cfg(test)]
mod tests {
    use x11rb::protocol::xinput::{DeviceClass, DeviceClassDataValuator, DeviceClassType, ValuatorMode};

    use super::*;

    const LABEL: Atom = 77;

    fn fixed(n: f64) -> Fp3232 {
        let integral = n.floor();
        Fp3232 {
            integral: integral as i32,
            frac: ((n - integral) * libm::exp2(32.0)) as u32,
        }
    }

    fn axis(number: u16, label: Atom, min: f64, max: f64) -> DeviceClass {
        let axis = DeviceClassDataValuator {
            number,
            label,
            min: fixed(min),
            max: fixed(max),
            value: fixed(min),
            resolution: 1,
            mode: ValuatorMode::ABSOLUTE,
        };
        DeviceClass {
            len: 11,
            sourceid: 12,
            data: DeviceClassData::Valuator(axis),
        }
    }

    fn device(type_: DeviceType, pressure: Option<[f64; 2]>) -> XIDeviceInfo {
        let button = DeviceClass {
            len: 8,
            sourceid: 12,
            data: DeviceClassData::InvalidValue(DeviceClassType::KEY.into()),
        };
        let mut classes = vec![button, axis(0, 5, 0.0, 44704.0), axis(1, 6, 0.0, 27940.0)];
        classes.extend(pressure.map(|[min, max]| axis(2, LABEL, min, max)));
        XIDeviceInfo {
            deviceid: 12,
            type_,
            attachment: 2,
            enabled: true,
            name: b"a pen".to_vec(),
            classes,
        }
    }

    fn event(told: &[(usize, f64)]) -> RawMotionEvent {
        let mut mask = vec![0; 2];
        told.iter().for_each(|(n, _)| mask[n / 32] |= 1 << (n % 32));
        RawMotionEvent {
            response_type: 35,
            extension: 131,
            sequence: 1,
            length: 0,
            event_type: 17,
            deviceid: 12,
            time: 1,
            detail: 0,
            sourceid: 12,
            flags: 0u32.into(),
            valuator_mask: mask,
            axisvalues: told.iter().map(|(_, value)| fixed(*value)).collect(),
            axisvalues_raw: Vec::new(),
        }
    }

    #[test]
    fn values_belong_to_the_bits_of_the_mask_in_their_order() {
        let given = [(0, -2.25), (2, 65535.5), (33, 7.0)];
        let event = event(&given);
        let found: Vec<_> = values(&event.valuator_mask, &event.axisvalues).collect();
        assert_eq!(found, given);
        // More bits than values are those of a broken event.
        assert_eq!(values(&[7], &[fixed(1.0)]).count(), 1);
    }

    #[test]
    fn the_range_of_the_valuator_is_0_to_1() {
        let mut pen = Pen::of(&device(DeviceType::SLAVE_POINTER, Some([-100.0, 300.0])), LABEL).unwrap();
        for (raw, press) in [
            (-100.0, 0.0),
            (0.0, 0.25),
            (300.0, 1.0),
            (350.0, 1.0),
            (-200.0, 0.0),
        ] {
            assert_eq!(pen.down(&event(&[(2, raw)])), Told::Down(press));
        }
    }

    /// A press that changes in place is told with the next move, as the pointer moves only then.
    #[test]
    fn pens_move_where_they_go_elsewhere() {
        let mut pen = Pen::of(&device(DeviceType::SLAVE_POINTER, Some([0.0, 2048.0])), LABEL).unwrap();
        let all = event(&[(0, 5.0), (1, 6.0), (2, 512.0)]);
        assert_eq!(pen.moved(&all), Some(Told::Moved(0.25)));
        assert_eq!(pen.moved(&all), None);
        assert_eq!(pen.moved(&event(&[(2, 1024.0)])), None);
        assert_eq!(pen.moved(&event(&[(1, 7.0)])), Some(Told::Moved(0.5)));
    }

    #[test]
    fn mice_and_masters_are_no_pens() {
        assert_eq!(Pen::of(&device(DeviceType::SLAVE_POINTER, None), LABEL), None);
        assert_eq!(
            Pen::of(&device(DeviceType::SLAVE_POINTER, Some([0.0, 0.0])), LABEL),
            None
        );
        for type_ in [DeviceType::MASTER_POINTER, DeviceType::SLAVE_KEYBOARD] {
            assert_eq!(Pen::of(&device(type_, Some([0.0, 2047.0])), LABEL), None);
        }
        assert!(Pen::of(&device(DeviceType::FLOATING_SLAVE, Some([0.0, 2047.0])), LABEL).is_some());
    }
}
