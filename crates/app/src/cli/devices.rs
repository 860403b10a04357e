use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

use glam::DVec3;
use serde_json::{Value, json};
use tools::haptics::{Device, DeviceError, Reading};

use super::failure::{Failure, OrFail, Outcome};
use super::quantity::between;
use super::{interrupt, summary};
use crate::devices::{self, Everything, FORMS, Force, Found, Kind, Name, OpenError, UDEV_RULES};

/// Arguments of `isoclay devices`.
#[derive(clap::Args)]
pub struct Args {
    /// Open this device and show where it is for some seconds; asks before it pushes
    #[arg(long, value_name = "NAME", value_parser = str::parse::<Name>)]
    test: Option<Name>,
    /// Seconds of a test
    #[arg(long, value_name = "S", default_value_t = 5, value_parser = between::<u16>(1, 600), requires = "test")]
    seconds: u16,
    /// Print the rules that let users open these devices on Linux
    #[arg(long, conflicts_with = "test")]
    udev: bool,
    /// Print JSON: one object, or one for each look and one at the end of a test
    #[arg(long)]
    pub json: bool,
}

/// Lists devices, tests one, or prints the rules for them.
pub fn run(args: &Args) -> Outcome {
    if args.udev {
        return match args.json {
            true => summary::print(&json!({ "udev": UDEV_RULES }).to_string(), false),
            false => summary::print(UDEV_RULES.trim_end(), false),
        };
    }
    match &args.test {
        Some(name) => test(name, args),
        None => list(args.json),
    }
}

/// What helps a user who may not open a device.
const REMEDY: &str = "isoclay devices --udev | sudo tee /etc/udev/rules.d/70-isoclay.rules, then sudo udevadm control --reload \
                      && sudo udevadm trigger, and plug the device in again";

fn list(json: bool) -> Outcome {
    let found = devices::find().or_input()?;
    let notes = notes(&found);
    if json {
        let devices: Vec<Value> = found.devices.iter().map(object).collect();
        let forms: Vec<Value> = FORMS
            .iter()
            .map(|(form, what)| json!({ "name": form, "what": what }))
            .collect();
        let object = json!({
            "devices": devices, "others": found.others, "has_hidraw": found.has_hidraw, "names": forms, "notes": notes,
        });
        return summary::print(&object.to_string(), false);
    }
    let mut lines: Vec<String> = found.devices.iter().map(line).collect();
    lines.extend(notes.iter().map(|note| format!("note: {note}")));
    lines.push("\nNames for --device and --test:".into());
    lines.extend(FORMS.iter().map(|(form, what)| format!("  {form:46} {what}")));
    summary::print(&lines.join("\n"), false)
}

/// What a device is, the name that opens it, and what it can do.
fn told(found: &Found) -> (String, &'static str, &'static str) {
    match &found.kind {
        Kind::SpaceMouse(name) => (name.clone(), "spacemouse", "six axes, no force"),
        Kind::Board => (
            "force board, or any other board of this id".into(),
            "haptikfabriken:ARM",
            "three or six axes, force in three",
        ),
        Kind::Pid => ("force device".into(), "pid", "one to three axes that push"),
    }
}

fn line(found: &Found) -> String {
    let (what, name, abilities) = told(found);
    let identity = &found.identity;
    let access = if found.is_denied {
        ", may not be opened"
    } else {
        ""
    };
    format!(
        "{}  {} {:?}: {what}, {abilities}; --test {name}{access}",
        identity.ids(),
        identity.path,
        identity.name
    )
}

fn object(found: &Found) -> Value {
    let (what, name, abilities) = told(found);
    let identity = &found.identity;
    json!({
        "name": name, "what": what, "abilities": abilities, "may_open": !found.is_denied, "path": identity.path,
        "vendor": identity.vendor, "product": identity.product, "product_name": identity.name, "maker": identity.maker,
    })
}

fn notes(found: &Everything) -> Vec<String> {
    let mut notes = Vec::new();
    if !found.has_hidraw {
        notes.push(
            "this system has no raw HID devices (/sys/class/hidraw is empty or missing, as in most containers): nothing can be \
             plugged in here"
                .into(),
        );
    } else if found.devices.is_empty() {
        let others = match found.others {
            0 => "no HID device is plugged in".into(),
            1 => "the one HID device here has no driver for touch".into(),
            n => format!("none of the {n} HID devices here has a driver for touch"),
        };
        notes.push(others);
    }
    if found.devices.iter().any(|d| d.is_denied) {
        notes.push(format!("to open what may not be opened, once: {REMEDY}"));
    }
    notes
}

/// Sorts an error under an exit code.
fn failure(error: OpenError) -> Failure {
    match error {
        OpenError::Name(_) => Failure::usage(error),
        _ => Failure::input(error),
    }
}

/// Time between two lines.
const SHOWN: Duration = Duration::from_millis(100);

fn test(name: &Name, args: &Args) -> Outcome {
    if name.force().is_some() {
        // Nobody is asked about a device that is not there.
        devices::open(name, Force::Withheld).map_err(failure)?;
    }
    let force = match name.force() {
        Some(most) if asks_for_force(most * GENTLE, args.seconds)? => Force::Allowed,
        _ => Force::Withheld,
    };
    let mut device = devices::open(name, force).map_err(failure)?;
    let shown = show(&mut device, force, args);
    let counts = device.counts();
    // The motors are off before anything more is said.
    drop(device);
    let looks = shown?;
    let line = match args.json {
        true => json!({
            "looks": looks, "reports": counts.taken, "rejected": counts.rejected, "failed_writes": counts.failed,
        })
        .to_string(),
        false => format!(
            "{} reports, {} rejected, {} writes failed",
            counts.taken, counts.rejected, counts.failed
        ),
    };
    summary::print(&line, false)
}

/// Asks on the terminal. Only the word itself is a yes.
fn asks_for_force(most: f64, seconds: u16) -> Outcome<bool> {
    let mut err = io::stderr().lock();
    write!(
        err,
        "The device may push with up to {most:.2} N for {seconds} s, towards where it is now. Hold it, keep its room clear, and type \
         yes; anything else tests it without force: "
    )
    .and_then(|()| err.flush())
    .or_limit()?;
    let mut answer = String::new();
    io::stdin().read_line(&mut answer).or_limit()?;
    if !io::stdin().is_terminal() {
        writeln!(err).or_limit()?;
    }
    Ok(answer.trim() == "yes")
}

/// Share of the largest force that a test uses.
const GENTLE: f64 = 0.1;

/// The force of a test: a soft spring to where the device was, which rises in two seconds.
struct Gentle {
    most: f64,
    from: Option<DVec3>,
    has_run_away: bool,
}

impl Gentle {
    /// Stiffness, N/mm.
    const STIFFNESS: f64 = 0.05;
    /// Further from where it was than this, mm, the force has the wrong sign or nobody holds the device.
    const FURTHEST: f64 = 40.0;

    fn force(&mut self, reading: &Reading, seconds: f64) -> DVec3 {
        let way = *self.from.get_or_insert(reading.pose.at) - reading.pose.at;
        self.has_run_away |= way.length() > Self::FURTHEST;
        if self.has_run_away || reading.age > 0.01 {
            return DVec3::ZERO;
        }
        (way * Self::STIFFNESS).clamp_length_max(self.most) * (seconds / 2.0).min(1.0)
    }
}

/// Shows where a device is. How often it told.
fn show(device: &mut dyn Device, force: Force, args: &Args) -> Outcome<u64> {
    let cancel = interrupt::cancel();
    let mut gentle = Gentle {
        most: device.abilities().force * GENTLE,
        from: None,
        has_run_away: false,
    };
    let (start, mut last, mut looks) = (Instant::now(), None, 0);
    while start.elapsed() < Duration::from_secs(args.seconds.into()) {
        interrupt::check(&cancel)?;
        let seconds = start.elapsed().as_secs_f64();
        match device.read() {
            Ok(reading) => {
                looks += 1;
                let pushes = match force {
                    Force::Allowed => gentle.force(&reading, seconds),
                    Force::Withheld => DVec3::ZERO,
                };
                device.send(pushes, DVec3::ZERO).or_input()?;
                if last.is_none_or(|at: Instant| at.elapsed() >= SHOWN) {
                    last = Some(Instant::now());
                    tell(&reading, pushes, seconds, args.json)?;
                }
            }
            // It may need a moment, or a touch.
            Err(DeviceError::Silent(_)) => {}
            Err(e) => return Err(Failure::input(e)),
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    if looks == 0 {
        return Err(Failure::input(DeviceError::Silent(
            device.abilities().name.clone(),
        )));
    }
    Ok(looks)
}

fn tell(reading: &Reading, force: DVec3, seconds: f64, json: bool) -> Outcome {
    let (at, turn) = (reading.pose.at, reading.pose.turn.to_array());
    let line = match json {
        true => json!({
            "seconds": seconds, "at": at.to_array(), "turn": turn, "buttons": reading.buttons, "age": reading.age,
            "force": force.to_array(),
        })
        .to_string(),
        false => format!(
            "{seconds:6.2} s  at ({:8.2}, {:8.2}, {:8.2}) mm  turn ({:6.3}, {:6.3}, {:6.3}, {:6.3})  buttons {:b}  force {:.2} N",
            at.x,
            at.y,
            at.z,
            turn[0],
            turn[1],
            turn[2],
            turn[3],
            reading.buttons,
            force.length()
        ),
    };
    summary::print(&line, false)
}
