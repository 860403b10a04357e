use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use document::{Command, Document, Options, State};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use fitting::{Cancel, Control};
use glam::DVec3;

mod arranging;
mod clicks;
mod desk;
mod docks;
mod files;
mod handles;
mod holds;
mod limits;
mod low;
mod matter;
mod pace;
mod panels;
mod pen;
mod performance;
mod planes;
mod scans;
mod shortcuts;
mod show;
mod stereo;
mod touch;
mod tree;
mod user;

use self::desk::{Bare, again, on_disk, opened};
use self::user::*;
use super::desk::Desk;
use super::modeler::Modeler;
use super::orders::{News, Order, Sheet};
use super::tool::{Kind, Settings, Tool, Use};
use super::touch::{Held, Seen, Wanted};
use tools::haptics::Contact;

use crate::view::{Ray, pick};

#[test]
fn the_first_minute_needs_no_file() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window(home.path());
    window.step();
    assert!(window.query_by_label_contains("Bunny").is_some());
    window.get_by_label("A block of clay").click();
    wait_for(&mut window, "History");
    assert!(window.query_by_label("clay").is_some());
    // Keys choose tools, unless a path is being written.
    window.key_press(egui::Key::S);
    window.step();
    assert_eq!(window.state().bench().tool.kind, Kind::Smooth);
    window.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::O);
    window.step();
    window.step();
    assert!(window.query_by_label("Browse…").is_some());
    window.key_press(egui::Key::C);
    window.step();
    assert_eq!(window.state().bench().tool.kind, Kind::Smooth);
}

/// A drag over the block is a stroke; the history undoes it.
#[test]
fn a_drag_is_a_stroke_and_the_history_undoes_it() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    window.hover_at(egui::pos2(620.0, 400.0));
    window.step();
    window.drag_at(egui::pos2(620.0, 400.0));
    window.step();
    for x in 0..12 {
        window.hover_at(egui::pos2(620.0 + 6.0 * x as f32, 400.0));
        window.step();
    }
    window.drop_at(egui::pos2(690.0, 400.0));
    window.step();
    assert!(edits(&mut window, 1).history[0].contains("carve on clay"));
    window.step();
    window.get_by_label("as it was").click();
    until(&mut window, "undone", |sheet| sheet.done == 0);
}

/// On a slow machine a picture holds a whole drag, from the press to the release: it is the same stroke.
#[test]
fn a_drag_within_one_picture_is_the_same_stroke() {
    let scratch = tempfile::tempdir().unwrap();
    let digests = [1, 40].map(|pictures| {
        let home = tempfile::tempdir().unwrap();
        let mut window = window_with_clay(home.path());
        let at = |n: usize| egui::pos2(620.0 + 2.0 * n as f32, 400.0);
        window.hover_at(at(0));
        window.step();
        let moves = (1..=40).map(|n| egui::Event::PointerMoved(at(n)));
        let events = [button(at(0), true)]
            .into_iter()
            .chain(moves)
            .chain([button(at(40), false)]);
        for (n, event) in events.enumerate() {
            window.input_mut().events.push(event);
            if pictures > 1 || n == 41 {
                window.step();
            }
        }
        let sheet = edits(&mut window, 1);
        let copy = scratch.path().join(format!("{pictures}.isoclay"));
        std::fs::copy(&sheet.path, &copy).unwrap();
        opened(&copy).state().sha256()
    });
    assert_eq!(digests[0], digests[1]);
}

/// A click pins the surface as the command would, and the panel frees it.
#[test]
fn clicks_pin_and_the_panel_frees() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    window.key_press(egui::Key::N);
    window.step();
    click(&mut window, egui::pos2(620.0, 400.0));
    let sheet = edits(&mut window, 1);
    assert_eq!(sheet.history[0], "hold on clay");
    let thing = &sheet.objects[0];
    let at = thing.holds[0].lines[0][0].0;
    assert_eq!(thing.holds[0].name, "pin 1");
    assert!(thing.field.value(at).abs() < 1e-6, "{at}");
    click(&mut window, egui::pos2(660.0, 400.0));
    assert_eq!(edits(&mut window, 2).objects[0].holds.len(), 2);
    window.step();
    window.get_by_label("Free all").click();
    assert!(edits(&mut window, 3).objects[0].holds.is_empty());
}

/// F and a way to the side set the radius, Escape leaves it as it was.
#[test]
fn radius_and_strength_are_set_by_the_mouse() {
    let home = tempfile::tempdir().unwrap();
    let mut window = window_with_clay(home.path());
    let at = egui::pos2(620.0, 400.0);
    let set = |window: &mut Harness<'_, Modeler>, keys, key, way: f32| {
        window.hover_at(at);
        window.step();
        window.key_press_modifiers(keys, key);
        window.step();
        window.hover_at(at + egui::vec2(way, 0.0));
        window.step();
    };
    let before = window.state().bench().tool;
    set(&mut window, egui::Modifiers::NONE, egui::Key::F, 80.0);
    window.key_press(egui::Key::Escape);
    window.step();
    assert_eq!(window.state().bench().tool.radius, before.radius);
    set(&mut window, egui::Modifiers::NONE, egui::Key::F, 80.0);
    click(&mut window, at + egui::vec2(80.0, 0.0));
    let larger = window.state().bench().tool.radius;
    assert!((larger / before.radius - 0.5f64.exp()).abs() < 1e-3, "{larger}");
    set(&mut window, egui::Modifiers::SHIFT, egui::Key::F, 60.0);
    click(&mut window, at + egui::vec2(60.0, 0.0));
    let bench = window.state().bench();
    assert!((bench.tool.strength - before.strength - 0.25).abs() < 1e-3);
    // The clicks that ended it did nothing to the clay.
    assert_eq!(bench.sheet.as_ref().unwrap().history.len(), 0);
}

/// A card that is lost in the middle of a stroke: the stroke is on the disk, and the next window shows the same document.
#[test]
fn a_lost_card_loses_nothing() {
    use eframe::egui_wgpu::{RenderState, RendererOptions, WgpuConfiguration, wgpu};

    use crate::view::{Card, Screen};
    let screen = || {
        let setup = eframe::egui_wgpu::WgpuSetup::without_display_handle();
        let configuration = WgpuConfiguration {
            wgpu_setup: setup.clone(),
            ..WgpuConfiguration::default()
        };
        let instance = pollster::block_on(setup.new_instance());
        let state = RenderState::create(&configuration, &instance, None, RendererOptions::default());
        pollster::block_on(state).expect("a card was there before")
    };
    match Card::open() {
        Ok(_) => {}
        Err(why) if std::env::var_os("ISOCLAY_NEEDS_CARD").is_some() => panic!("{why}"),
        Err(why) => return eprintln!("SKIPPED a lost card: {why}"),
    }
    let home = tempfile::tempdir().unwrap();
    let context = egui::Context::default();
    let state = screen();
    let device: wgpu::Device = state.device.clone();
    let modeler = Modeler::on(&context, Some(Screen::new(&state)), home.path().to_path_buf());
    let mut window = Harness::builder()
        .with_size([1280.0, 800.0])
        .build_ui_state(|ui, modeler: &mut Modeler| modeler.show(ui), modeler);
    window.step();
    window.get_by_label("A block of clay").click();
    wait_for(&mut window, "History");
    window.hover_at(egui::pos2(620.0, 400.0));
    window.step();
    window.drag_at(egui::pos2(620.0, 400.0));
    for x in 0..8 {
        window.step();
        window.hover_at(egui::pos2(620.0 + 6.0 * x as f32, 400.0));
    }
    window.step();
    let triangles = window.state().bench().triangles;
    assert!(triangles > 1000, "{triangles}");
    device.destroy();
    assert!(window.state().is_lost(true));
    window.step();
    // The window closes here; what it worked on goes on in the next.
    let next = egui::Context::default();
    window.state_mut().resume(&next, Some(Screen::new(&screen())));
    assert!(!window.state().is_lost(true));
    steps_until(&mut window, "seen again", |window| {
        window.query_by_label_contains("carve on clay").is_some() && window.state().bench().triangles > 0
    });
    let path = window.state().bench().sheet.as_ref().unwrap().path.clone();
    let kept = home.path().join("kept.isoclay");
    std::fs::copy(path, &kept).unwrap();
    assert_eq!(opened(&kept).counts().unwrap().done, 1);
}

/// What is seen of a scan while it is fitted: a scene of its own under the name of the scan, with nothing in its history.
#[test]
fn a_coarse_solid_is_seen_under_the_name_of_its_scan() {
    let (name, object) = crate::cli::desk_files::clay_block().unwrap();
    let state = State::new().with(&name, object).unwrap();
    let told = super::preview::news(Path::new("scans/block.ply"), &state).unwrap();
    let [
        News::Scene { radius, is_finer, .. },
        News::Patches(patches),
        News::Solid(..),
        News::Sheet(sheet),
    ] = &told[..]
    else {
        panic!("{told:?}")
    };
    // Half the diagonal of a block of 40 mm, rounded.
    assert!(!is_finer && (30.0..36.0).contains(radius), "{radius}");
    assert!(patches.iter().map(|p| p.indices.len()).sum::<usize>() > 3000);
    assert_eq!(sheet.path, Path::new("scans/block.ply"));
    assert!(sheet.is_untitled && sheet.history.is_empty() && sheet.objects[0].name == name);
}
