//! What is shown beside the solids: no edit, and kept for the next window.

use super::*;
use crate::view::{Cells, Tint};
use crate::window::kept::{Kept, Theme};
use crate::window::show::Layer;

/// The panel, unfolded.
fn unfolded(home: &Path) -> Harness<'static, Modeler> {
    let mut window = window_with_clay(home);
    window.get_by_label("Show").click();
    window.run_steps(20);
    window
}

fn tick(window: &mut Harness<'_, Modeler>, label: &str) {
    window.get_by_label(label).click();
    window.run_steps(3);
}

/// What is told of a layer, once that is known.
fn told(window: &mut Harness<'_, Modeler>, layer: Layer) -> Result<String, String> {
    let start = Instant::now();
    loop {
        match window.state().bench().shown.words.get(&layer) {
            Some(word) if *word != Ok("…".into()) => return word.clone(),
            _ => assert!(
                start.elapsed() < Duration::from_secs(60),
                "nothing is told of {layer:?}"
            ),
        }
        std::thread::sleep(Duration::from_millis(10));
        window.step();
    }
}

#[test]
fn what_is_shown_is_kept_and_is_no_edit() {
    let home = tempfile::tempdir().unwrap();
    let mut window = unfolded(home.path());
    for label in ["Wireframe", "Floor and axes", "Scale bar"] {
        tick(&mut window, label);
    }
    let show = window.state().bench().look.show;
    assert!(show.wireframe && show.floor && !show.scale_bar && show.forces);
    assert_eq!((show.cells, show.tint), (Cells::Off, Tint::Off));
    assert!(window.state().bench().sheet.as_ref().unwrap().history.is_empty());
    drop(window);
    let next = window_with_clay(home.path());
    assert_eq!(next.state().bench().look.show, show);
}

/// What cannot be shown says why, and what to do; a second surface is made, and told of.
#[test]
fn what_cannot_be_shown_says_why() {
    let home = tempfile::tempdir().unwrap();
    let mut window = unfolded(home.path());
    tick(&mut window, "Input points");
    let why = told(&mut window, Layer::Points).unwrap_err();
    assert!(why.contains("clay was fitted to no file"), "{why}");
    tick(&mut window, "Input points");
    assert!(!window.state().bench().shown.words.contains_key(&Layer::Points));
    tick(&mut window, "Second surface");
    let made = told(&mut window, Layer::Second).unwrap();
    assert!(made.ends_with("triangles"), "{made}");
    let (name, density) = window.state().bench().shown.second.clone().unwrap();
    let sheet = window.state().bench().sheet.clone().unwrap();
    assert_eq!(name, "clay");
    assert!(density != sheet.objects[0].iso);
}

/// Volumes show it without triangles, of the density that is told below its box; other modes and other wishes leave it out.
#[test]
fn volumes_show_the_second_surface() {
    let home = tempfile::tempdir().unwrap();
    let mut window = unfolded(home.path());
    tick(&mut window, "Volume");
    assert_eq!(window.state().bench().second_in_volume(), None);
    tick(&mut window, "Second surface");
    let bench = window.state().bench();
    let (name, density) = bench.second_in_volume().expect("it is wished");
    assert_eq!(Some((name, density)), bench.shown.second);
    set(&mut window, ("Density", 0), "1.5");
    let shown = window.state().bench().second_in_volume();
    assert_eq!(shown, Some(("clay".into(), 1.5)));
    tick(&mut window, "Mesh");
    assert_eq!(window.state().bench().second_in_volume(), None);
}

/// A click in a plane takes the other two there; beside the scene the planes are still there, and the tools.
#[test]
fn slices_share_a_cursor_and_stand_beside_the_scene() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    choose(&mut window, "View/Windows", "Slices");
    window.key_press(egui::Key::Escape);
    window.run_steps(3);
    let cursor = |window: &Harness<'_, Modeler>| {
        let bench = window.state().bench();
        let sheet = bench.sheet.clone().unwrap();
        bench.slices.as_ref().unwrap().cursor(&sheet.objects[0])
    };
    let before = cursor(&window);
    // In the first, which is the axial one.
    click(&mut window, egui::pos2(270.0, 160.0));
    let after = cursor(&window);
    assert!(after.x != before.x && after.y != before.y, "{before} {after}");
    assert_eq!(after.z, before.z);
    tick(&mut window, "Four views");
    for plane in ["Axial", "Coronal", "Sagittal", "Carve C"] {
        assert!(window.query_by_label_contains(plane).is_some(), "{plane}");
    }
    assert!(window.state().bench().sheet.as_ref().unwrap().history.is_empty());
}

/// What is there already is replaced only if that is wished.
#[test]
fn pictures_replace_nothing_unasked() {
    let home = tempfile::tempdir().unwrap();
    let mut window = unfolded(home.path());
    tick(&mut window, "Picture…");
    let there = home.path().join("there.png");
    std::fs::write(&there, "mine").unwrap();
    write(
        &mut window,
        egui::accesskit::Role::TextInput,
        "File",
        there.to_str().unwrap(),
    );
    tick(&mut window, "Save picture");
    assert!(window.query_by_label("Replace").is_some());
    assert_eq!(window.state().bench().shot.wanted, None);
    tick(&mut window, "Cancel");
    assert_eq!(std::fs::read(&there).unwrap(), b"mine");
    // Without a graphics driver that is told.
    tick(&mut window, "Save picture");
    tick(&mut window, "Replace");
    let last = window.state().bench().messages.back().cloned();
    assert!(last.is_some_and(|(_, text, is_failure)| is_failure && text.contains("graphics driver")));
}

/// Where a window is as low as half of 1280 × 720, all that menus have is still within it.
#[test]
fn menus_fit_into_a_low_window() {
    let home = tempfile::tempdir().unwrap();
    let size = [640.0, 360.0];
    let mut window = window_of(home.path(), size);
    window.step();
    window.state().bench().order(Order::Clay);
    edits(&mut window, 0);
    window.run_steps(3);
    for (menus, last) in [
        ("File", "Quit"),
        ("Edit", "Shortcuts…"),
        ("View", "As the system"),
        ("View/Look from", "All"),
        ("View/Windows", "Picture…"),
    ] {
        for menu in menus.split('/') {
            window.get_by_label_contains(menu).click();
            window.run_steps(6);
        }
        let all = window.get_all_by_label_contains(last);
        let entry = all.map(|node| node.rect()).next_back().unwrap();
        assert!(
            entry.bottom() <= size[1] && entry.right() <= size[0],
            "{menus}: {last} at {entry}"
        );
        window.key_press(egui::Key::Escape);
        window.run_steps(4);
    }
}

/// A light window is followed by a light one, whether a menu or the palette of commands made it so.
#[test]
fn the_theme_is_kept() {
    let asks: [fn(&mut Window); 2] = [|w| choose(w, "View", "Light"), |w| command(w, "light")];
    for ask in asks {
        let home = tempfile::tempdir().unwrap();
        let mut window = window_with_clay(home.path());
        ask(&mut window);
        drop(window);
        // Windows of tests are dark in any case.
        let next = egui::Context::default();
        Kept::read(home.path()).theme.give(&next);
        assert_eq!(Theme::of(&next), Theme::Light);
    }
}
