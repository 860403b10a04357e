//! A picture for each eye: how it is chosen and kept, and where the mouse is.

use super::*;
use crate::view::{Pair, Stereo};

fn stereo(window: &Window) -> Stereo {
    window.state().bench().look.show.stereo
}

/// The menu and the panel choose it, the next window has it again, and the document knows nothing of it.
#[test]
fn stereo_is_chosen_kept_and_no_edit() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut window = with_clay(window_of(home.path(), TALL));
    let sheet = window.state().bench().sheet.clone().unwrap();
    let before = on_disk(&sheet, scratch.path()).state().sha256();
    assert_eq!(stereo(&window).pair, Pair::Off);
    choose(&mut window, "View/Stereo", "side by side");
    assert_eq!(stereo(&window).pair, Pair::Beside);
    choose(&mut window, "View/Stereo", "red and cyan");
    assert_eq!(stereo(&window).pair, Pair::Anaglyph);
    press(&mut window, "Show");
    assert!((stereo(&window).apart - 1.0 / 30.0).abs() < 1e-12);
    set(&mut window, ("Eyes apart", 0), "5");
    assert!((stereo(&window).apart - 0.05).abs() < 1e-12);
    // No eyes are so far apart.
    set(&mut window, ("Eyes apart", 0), "90");
    assert_eq!(stereo(&window).apart, Stereo::RANGE[1]);
    set(&mut window, ("Eyes apart", 0), "4");
    let sheet = window.state().bench().sheet.clone().unwrap();
    assert_eq!((sheet.history.len(), sheet.done), (0, 0));
    assert_eq!(on_disk(&sheet, scratch.path()).state().sha256(), before);
    let kept = stereo(&window);
    drop(window);
    let mut next = window_of(home.path(), TALL);
    next.step();
    assert_eq!(stereo(&next), kept);
    command(&mut next, "stereo off");
    assert_eq!(
        stereo(&next).pair,
        Pair::Anaglyph,
        "nothing is seen without a document"
    );
}

/// Where a click into the middle of each of some views pins the surface.
fn pinned(window: &mut Window, views: &[egui::Pos2]) -> Vec<DVec3> {
    window.key_press(egui::Key::N);
    window.step();
    let pins = views.iter().enumerate().map(|(n, at)| {
        click(window, *at);
        let sheet = edits(window, n + 1);
        sheet.objects[0].holds[n].lines[0][0].0
    });
    pins.collect()
}

/// In each half the mouse is where its eye sees it; in pictures over one another it is where the middle between the eyes does.
#[test]
fn the_mouse_works_where_the_eye_looks() {
    for pair in [Pair::Beside, Pair::Anaglyph] {
        let home = tempfile::tempdir().unwrap();
        let mut window = window_with_clay(home.path());
        let name = match pair {
            Pair::Beside => "side by side",
            _ => "red and cyan",
        };
        choose(&mut window, "View/Stereo", name);
        window.run_steps(3);
        let place = window.state().drawn_in;
        let views = match pair {
            Pair::Beside => {
                let quarter = egui::vec2(0.25 * place.width(), 0.0);
                vec![place.center() - quarter, place.center() + quarter]
            }
            _ => vec![place.center()],
        };
        let pins = pinned(&mut window, &views);
        let bench = window.state().bench();
        let camera = bench.look.camera;
        assert_eq!(camera.aside, 0.0);
        let sides = match pair {
            Pair::Beside => vec![-0.5, 0.5],
            _ => vec![0.0],
        };
        let thing = &bench.sheet.as_ref().unwrap().objects[0];
        for (pin, side) in pins.iter().zip(&sides) {
            let aside = side * stereo(&window).apart;
            let eye = crate::view::Camera { aside, ..camera };
            let (p, _) = thing.under(&eye.ray(glam::DVec2::ZERO)).unwrap();
            assert!(p.distance(*pin) < 1e-6, "{pair:?}, {side}: {pin} for {p}");
        }
        if let [left, right] = pins[..] {
            let way = (right - left).dot(camera.axes()[0]);
            assert!(way > 0.1, "{way}");
        }
    }
}

/// A stroke that begins in the left half goes on where the left eye sees it, also when the mouse comes into the right half.
#[test]
fn a_stroke_stays_with_the_eye_that_it_began_with() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    choose(&mut window, "View/Stereo", "side by side");
    window.run_steps(3);
    let place = window.state().drawn_in;
    let from = place.center() - egui::vec2(0.25 * place.width(), 0.0);
    let way: Vec<egui::Pos2> = (0..40).map(|n| from + egui::vec2(10.0 * n as f32, 0.0)).collect();
    assert!(way[39].x > place.center().x);
    draw(&mut window, &way);
    let sheet = edits(&mut window, 1);
    let scratch = tempfile::tempdir().unwrap();
    let mut document = on_disk(&sheet, scratch.path());
    let mut way = Vec::new();
    places(&document.command(0).unwrap()["stroke"], &mut way);
    let right = window.state().bench().look.camera.axes()[0];
    // In the right half the mouse comes over the block once more, from its left end on.
    assert!(way.len() > 3, "{way:?}");
    let goes_back = way.windows(2).find(|pair| (pair[1] - pair[0]).dot(right) < -1e-3);
    assert_eq!(goes_back, None);
    assert_eq!(again(&mut document).sha256(), document.state().sha256());
}

/// All that stands for a place in a stroke.
fn places(value: &serde_json::Value, all: &mut Vec<DVec3>) {
    use serde_json::Value;
    if let Ok(place) = serde_json::from_value::<[f64; 3]>(value.clone()) {
        return all.push(place.into());
    }
    match value {
        Value::Array(items) => items.iter().for_each(|item| places(item, all)),
        Value::Object(fields) => fields.values().for_each(|field| places(field, all)),
        _ => {}
    }
}
