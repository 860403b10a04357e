//! The panel of touch: what is taken in the hand, how it may push, and what it says of it.

use egui::accesskit::{Role, Toggled};
use egui_kittest::kittest::NodeT;
use tools::haptics::gates::Trip;

use super::*;

/// A block of clay with the panel open.
fn touching(home: &Path) -> Window {
    let mut window = window_with_clay(home);
    choose(&mut window, "View/Windows", "Touch");
    wait_for(&mut window, "Take it in the hand");
    window
}

/// Presses the button, and waits until something is in the hand.
fn take(window: &mut Window) -> Held {
    press(window, "Take it in the hand");
    steps_until(window, "in the hand", |window| {
        window.state().bench().held.is_some()
    });
    window.step();
    window.state().bench().held.clone().unwrap()
}

fn let_go(window: &mut Window) {
    press(window, "Let go");
    steps_until(window, "let go", |window| window.state().bench().held.is_none());
    wait_for(window, "Take it in the hand");
}

/// The force of the mouse where it presses, as soon as it is as hard as that. It comes there through the air before the block, below and on the
/// left of it; after a stall, of a busy machine too, nothing is felt until it has been clear of the solid, so it tries again.
fn felt(window: &mut Window, at: egui::Pos2, force: f64) -> Seen {
    for _ in 0..20 {
        window.hover_at(egui::pos2(at.x - 100.0, 740.0));
        steps_until(window, "in the air", |window| {
            window.query_by_label_contains("in the air").is_some()
        });
        window.hover_at(at);
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(3) {
            window.step();
            let seen = window.state().bench().seen;
            let seen = seen.filter(|seen| (0.98..1.03).contains(&(seen.force / force)));
            if let Some(seen) = seen {
                return seen;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }
    panic!(
        "{force} N is not felt, but last {:?}",
        window.state().bench().seen
    )
}

/// N of a mouse that presses so many radii deep.
fn of_press(held: &Held, press: f64) -> f64 {
    500.0 * 1e-3 * press * held.radius / held.workspace.scale
}

/// The mouse is taken by a click, feels as hard as it is pressed, and its drag is an edit that a script makes too; let go it is a mouse again.
#[test]
fn the_mouse_is_taken_presses_works_and_is_let_go() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = touching(home.path());
    let at = middle(&window);
    let held = take(&mut window);
    assert!(held.mouse.is_some());
    assert!(window.query_by_label("The mouse leads the tool").is_some());
    for press in ["0.5", "1"] {
        set(&mut window, ("Pressed", 0), press);
        let wished = of_press(&held, press.parse().unwrap());
        let seen = felt(&mut window, at, wished);
        assert_ne!(seen.contact, Contact::Free, "{seen:?}");
        // The words are those of this moment, or of one soon after it.
        steps_until(&mut window, "told", |window| {
            window.query_by_label_contains("N, on the surface").is_some()
                || window.query_by_label_contains("N, held by friction").is_some()
        });
    }
    set(&mut window, ("Pressed", 0), "0.5");
    felt(&mut window, at, of_press(&held, 0.5));
    window.drag_at(at);
    for n in 0..20 {
        window.hover_at(at + egui::vec2(3.0 * n as f32, 0.0));
        window.step();
        std::thread::sleep(Duration::from_millis(20));
    }
    window.drop_at(at + egui::vec2(57.0, 0.0));
    window.step();
    let sheet = edits(&mut window, 1);
    assert!(
        sheet.history[0].starts_with("carve on clay by hand"),
        "{:?}",
        sheet.history
    );
    let stroke = on_disk(&sheet, scratch.path()).command(0).unwrap()["stroke"].clone();
    assert_is_script(&sheet, scratch.path(), &[stroke]);

    let_go(&mut window);
    drag(&mut window);
    edits(&mut window, 2);
    assert!(window.state().bench().held.is_none());
    // To close the panel lets go too.
    take(&mut window);
    command(&mut window, "touch");
    steps_until(&mut window, "let go", |window| {
        window.state().bench().held.is_none()
    });
    assert!(window.query_by_label("Take it in the hand").is_none());
}

/// What was told last.
fn told(window: &Window) -> Option<(String, bool)> {
    let last = window.state().bench().messages.back();
    last.map(|(_, text, is_failure)| (text.clone(), *is_failure))
}

/// A device is named, its force is allowed or not, and its limits are set; what it cannot hold is told.
#[test]
fn a_simulated_device_is_armed_within_its_limits() {
    let home = tempfile::tempdir().unwrap();
    let mut window = touching(home.path());
    // The mouse pushes nobody: there is nothing to allow.
    assert!(window.query_by_label("It may push").is_none());
    write(&mut window, Role::TextInput, "or by name", "sim:omni");
    window.run_steps(2);
    let arm = |window: &Window| window.get_by_label("It may push").accesskit_node().toggled();
    assert_eq!(arm(&window), Some(Toggled::False));
    let force = |window: &Window| {
        let field = window.get_by_role_and_label(Role::SpinButton, "At most");
        (
            field.accesskit_node().is_disabled(),
            field.accesskit_node().numeric_value(),
        )
    };
    assert_eq!(force(&window), (true, Some(2.0)));
    press(&mut window, "It may push");
    assert_eq!(arm(&window), Some(Toggled::True));
    assert_eq!(force(&window), (false, Some(2.0)));
    // No more than may be asked for.
    set(&mut window, ("At most", 0), "50");
    assert_eq!(force(&window).1, Some(10.0));
    set(&mut window, ("At most", 0), "1.5");
    assert_eq!(force(&window).1, Some(1.5));

    set(&mut window, ("Stiffness", 0), "100");
    let before = window.state().bench().messages.len();
    let held = take(&mut window);
    assert!(held.mouse.is_none());
    assert!(window.query_by_label_contains("is in the hand").is_some());
    assert!(window.query_by_label("Pressed").is_none());
    assert_eq!(
        window.state().bench().messages.len(),
        before,
        "{:?}",
        told(&window)
    );
    let_go(&mut window);
    // Stiffer than it can be.
    set(&mut window, ("Stiffness", 0), "3000");
    take(&mut window);
    let (text, is_failure) = told(&window).unwrap();
    assert!(
        !is_failure && text.contains("3000 N/m was wished; the device holds"),
        "{text}"
    );
    let_go(&mut window);
    assert!(window.state().bench().sheet.as_ref().unwrap().history.is_empty());
}

/// What cannot be taken is told, and the panel asks again.
#[test]
fn what_cannot_be_in_the_hand_is_refused_in_words() {
    let home = tempfile::tempdir().unwrap();
    let mut window = touching(home.path());
    let refused = |window: &mut Window, words: &str| {
        press(window, "Take it in the hand");
        steps_until(window, words, |window| {
            told(window).is_some_and(|(text, is_failure)| is_failure && text.contains(words))
        });
        assert!(window.state().bench().held.is_none());
        assert!(window.query_by_label("Take it in the hand").is_some());
    };
    write(&mut window, Role::TextInput, "or by name", "plough");
    refused(&mut window, "\"plough\" names no device; there are spacemouse");
    write(&mut window, Role::TextInput, "or by name", "sim:plough");
    refused(&mut window, "sim:omni");
    write(&mut window, Role::TextInput, "or by name", "sim:omni");
    // Keys are letters until it is written.
    window.key_press(egui::Key::Enter);
    window.run_steps(2);
    command(&mut window, "stamp");
    refused(&mut window, "Stamp is a tool for the mouse alone");
    command(&mut window, "carve");
    take(&mut window);
    let_go(&mut window);
}

/// All that a hand may feel has words, and so has all that takes the force away; then it may push again.
#[test]
fn status_and_trips_are_told() {
    let home = tempfile::tempdir().unwrap();
    let mut window = touching(home.path());
    let held = take(&mut window);
    let_go(&mut window);
    let show = |window: &mut Window, contact: Contact, is_live: bool, trip: Option<Trip>| {
        let bench = &mut window.state_mut().bench;
        bench.held = Some(Held {
            device: "a board".into(),
            mouse: None,
            ..held.clone()
        });
        bench.seen = Some(Seen {
            hand: DVec3::ZERO,
            proxy: DVec3::ZERO,
            force: 1.25,
            contact,
            is_live,
            trip,
        });
        window.run_steps(2);
        assert!(window.query_by_label("a board is in the hand").is_some());
    };
    for (contact, words) in [
        (Contact::Free, "1.25 N, in the air"),
        (Contact::Slides, "1.25 N, on the surface"),
        (Contact::Sticks, "1.25 N, held by friction"),
        (Contact::Attracted, "1.25 N, drawn to the surface"),
        (Contact::Inside, "1.25 N, inside: lead it out"),
        (Contact::Pulls, "1.25 N, pulls"),
    ] {
        show(&mut window, contact, true, None);
        assert!(window.query_by_label(words).is_some(), "{contact:?}");
        assert!(window.query_by_label_contains("Its force").is_none());
        assert!(window.query_by_label_contains("No force").is_none());
        assert!(window.query_by_label("Push again").is_none());
    }
    show(&mut window, Contact::Slides, false, None);
    assert!(window.query_by_label("Its force is coming slowly").is_some());
    for (trip, words) in [
        (Trip::NotFinite, "told a place that is none"),
        (Trip::TooFast, "moved too fast"),
        (Trip::Stale, "told nothing for a while"),
        (Trip::Gone, "was unplugged"),
        (Trip::Writer, "takes none"),
        (Trip::Clock, "the clock jumped"),
    ] {
        show(&mut window, Contact::Free, false, Some(trip));
        let told = window.query_by_label_contains("No force");
        let told = told.and_then(|node| node.accesskit_node().value());
        assert!(
            told.as_ref().is_some_and(|told| told.contains(words)),
            "{trip:?}: {told:?}"
        );
    }
    press(&mut window, "Push again");
    wait_for(&mut window, "The mouse leads the tool");
    let_go(&mut window);
}
