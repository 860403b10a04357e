//! What is taken in the hand, how it may push, and what it feels.

use tools::haptics::Contact;
use tools::haptics::gates::Trip;

use super::over::over;
use crate::devices;
use crate::window::Bench;
use crate::window::orders::Order;
use crate::window::touch::{Seen, Wanted};

/// How a device is to be held.
pub struct TouchWish {
    /// The device by its name; the mouse if empty.
    device: String,
    may_push: bool,
    /// N.
    force: f64,
    /// N/m.
    stiffness: f64,
    /// How deep the mouse presses, in radii of the tool.
    pub press: f64,
    /// Names and kinds of what is plugged in.
    found: Vec<(&'static str, String)>,
}

impl TouchWish {
    /// With the mouse, and what is plugged in.
    pub fn new() -> Self {
        let all = devices::find().unwrap_or_default().devices;
        let found = all.into_iter().map(|device| match device.kind {
            devices::Kind::SpaceMouse(name) => ("spacemouse", name),
            devices::Kind::Board => ("haptikfabriken:polhem-1", "force board".into()),
            devices::Kind::Pid => ("pid", "force device".into()),
        });
        Self {
            device: String::new(),
            may_push: false,
            force: 2.0,
            stiffness: 500.0,
            press: 0.5,
            found: found.collect(),
        }
    }

    fn wanted(&self, bench: &Bench) -> Wanted {
        let device = self.device.trim();
        Wanted {
            device: (!device.is_empty()).then(|| device.into()),
            stiffness: self.stiffness,
            force: self.may_push.then_some(self.force),
            tool: bench.tool_in_hand(egui::Modifiers::NONE),
        }
    }
}

/// In a window of its own.
pub fn touch(context: &egui::Context, bench: &mut Bench) {
    let Some(mut wish) = bench.touch.take() else {
        return;
    };
    let mut is_open = true;
    over(context, "Touch", 730.0)
        .open(&mut is_open)
        .resizable(false)
        .show(context, |ui| {
            ui.set_width(250.0);
            match &bench.held {
                Some(held) => {
                    ui.strong(match held.mouse {
                        Some(_) => "The mouse leads the tool".into(),
                        None => format!("{} is in the hand", held.device),
                    });
                    if held.mouse.is_some() {
                        presses(ui, &mut wish.press);
                    }
                    ui.horizontal(|ui| {
                        if ui.button("Let go").clicked() {
                            bench.order(Order::LetGo);
                        }
                        let has_tripped = bench.seen.is_some_and(|seen| seen.trip.is_some());
                        if has_tripped && ui.button("Push again").clicked() {
                            bench.order(Order::Take(wish.wanted(bench)));
                        }
                    });
                    // Below the buttons: its lines come and go.
                    match &bench.seen {
                        Some(seen) => felt(ui, seen),
                        None => drop(ui.weak("It has not told where it is yet")),
                    }
                }
                None => choose(ui, bench, &mut wish),
            }
        });
    if is_open {
        bench.touch = Some(wish);
    } else if bench.held.is_some() {
        bench.order(Order::LetGo);
    }
}

fn choose(ui: &mut egui::Ui, bench: &Bench, wish: &mut TouchWish) {
    let shown = match wish.device.as_str() {
        "" => "Mouse",
        name => name,
    };
    egui::ComboBox::from_label("Device")
        .selected_text(shown)
        .show_ui(ui, |ui| {
            ui.selectable_value(&mut wish.device, String::new(), "Mouse");
            for (name, kind) in wish.found.clone() {
                ui.selectable_value(&mut wish.device, name.into(), format!("{name} ({kind})"));
            }
        });
    ui.horizontal(|ui| {
        let label = ui.label("or by name");
        ui.text_edit_singleline(&mut wish.device)
            .labelled_by(label.id)
            .on_hover_text("As `isoclay devices` lists it. Empty: the mouse");
    });
    if wish.device.is_empty() {
        presses(ui, &mut wish.press);
        ui.weak("The tool rests on the surface under the pointer and presses so deep. What would be felt is shown.");
    } else {
        ui.checkbox(&mut wish.may_push, "It may push")
            .on_hover_text("Hold it, and keep its room clear. Without this it only tells where it is");
        ui.add_enabled(
            wish.may_push,
            egui::Slider::new(&mut wish.force, 0.1..=10.0)
                .suffix(" N")
                .text("At most"),
        );
        ui.add(
            egui::Slider::new(&mut wish.stiffness, 50.0..=3000.0)
                .suffix(" N/m")
                .text("Stiffness"),
        );
    }
    let can_take = bench.sheet.is_some() && bench.busy.is_none();
    if ui
        .add_enabled(can_take, egui::Button::new("Take it in the hand"))
        .clicked()
    {
        bench.order(Order::Take(wish.wanted(bench)));
    }
}

fn presses(ui: &mut egui::Ui, press: &mut f64) {
    ui.add(
        egui::Slider::new(press, 0.0..=2.0)
            .max_decimals(2)
            .suffix(" radii")
            .text("Pressed"),
    );
}

fn felt(ui: &mut egui::Ui, seen: &Seen) {
    let contact = match seen.contact {
        Contact::Free => "in the air",
        Contact::Slides => "on the surface",
        Contact::Sticks => "held by friction",
        Contact::Attracted => "drawn to the surface",
        Contact::Inside => "inside: lead it out",
        Contact::Pulls => "pulls",
    };
    ui.label(format!("{:.2} N, {contact}", seen.force));
    if let Some(why) = seen.trip {
        ui.colored_label(ui.visuals().error_fg_color, stopped(why));
    } else if !seen.is_live {
        ui.weak("Its force is coming slowly");
    }
}

/// Why there is no force.
fn stopped(why: Trip) -> &'static str {
    match why {
        Trip::NotFinite => "No force: it told a place that is none",
        Trip::TooFast => "No force: it moved too fast",
        Trip::Stale => "No force: it told nothing for a while",
        Trip::Gone => "No force: it was unplugged",
        Trip::Writer => "No force: it takes none",
        Trip::Clock => "No force: the clock jumped",
    }
}
