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

mod panels;
mod show;

use super::desk::Desk;
use super::modeler::Modeler;
use super::orders::{News, Order, Sheet};
use super::tool::{Kind, Settings, Tool, Use};
use super::touch::{Held, Seen, Wanted};
use tools::haptics::Contact;

use crate::view::{Ray, pick};

/// A desk on its thread, without a window.
struct Bare {
    orders: Sender<Order>,
    news: Receiver<News>,
    desk: JoinHandle<()>,
    told: Vec<News>,
}

impl Bare {
    fn new(home: &Path) -> Self {
        let (orders, received) = channel();
        let (told, news) = channel();
        let cancel = Arc::new(Mutex::new(Cancel::new()));
        let desk = Desk::new(told, Arc::new(|| ()), cancel, home.into());
        Self {
            orders,
            news,
            desk: std::thread::spawn(move || desk.work(&received)),
            told: Vec::new(),
        }
    }

    fn order(&self, order: Order) {
        self.orders.send(order).unwrap();
    }

    /// The first news from now on that are looked for.
    fn wait<T>(&mut self, what: impl Fn(&News) -> Option<T>) -> T {
        let found = self.wait_for(Duration::from_secs(60), what);
        found.unwrap_or_else(|| panic!("nothing of the kind is told, but last {:?}", self.told.last()))
    }

    /// The same, if they come in time.
    fn wait_for<T>(&mut self, time: Duration, what: impl Fn(&News) -> Option<T>) -> Option<T> {
        let start = Instant::now();
        while let Some(rest) = time.checked_sub(start.elapsed()) {
            let news = self.news.recv_timeout(rest).ok()?;
            let found = what(&news);
            if let News::Failed(why) = &news {
                panic!("{why}");
            }
            self.told.push(news);
            if found.is_some() {
                return found;
            }
        }
        None
    }

    /// The sheet of so many edits, so many of them done.
    fn sheet(&mut self, all: usize, done: usize) -> Arc<Sheet> {
        self.wait(|news| match news {
            News::Sheet(sheet) if (sheet.history.len(), sheet.done) == (all, done) => Some(sheet.clone()),
            _ => None,
        })
    }

    /// What is in the hand, when it is there.
    fn held(&mut self) -> Held {
        self.wait(|news| match news {
            News::Held(held) => held.clone(),
            _ => None,
        })
    }

    /// The hand comes down from `above` to `pressed` and feels so much. After a stall, of a busy machine too, it feels nothing until it has
    /// been clear of the solid, so it is lifted and tries again.
    fn press(&mut self, put: impl Fn(DVec3), [above, pressed]: [DVec3; 2], force: f64) -> Seen {
        let seen = |is: fn(&Seen, f64) -> bool| {
            move |news: &News| match news {
                News::Seen(seen) if is(seen, force) => Some(*seen),
                _ => None,
            }
        };
        for _ in 0..20 {
            put(above);
            self.wait(seen(|seen, _| seen.contact == Contact::Free));
            put(pressed);
            let felt = self.wait_for(
                Duration::from_secs(5),
                seen(|seen, force| seen.force > 0.98 * force),
            );
            if let Some(felt) = felt {
                return felt;
            }
        }
        panic!("{force} N is not felt, but last {:?}", self.told.last());
    }

    /// Until the simulation has shown what the hand made.
    fn patches(&mut self) {
        self.wait(|news| matches!(news, News::Patches(_)).then_some(()));
    }

    /// What is still told, and the end.
    fn end(self) -> Vec<News> {
        drop(self.orders);
        self.desk.join().unwrap();
        self.told.into_iter().chain(self.news.iter()).collect()
    }
}

/// A stroke over the front of the block, seen from +z: so many lines of sight, in a row, or of an outline round about.
fn stroke(tool: Tool, count: usize) -> Vec<Order> {
    let place = |n: usize| match tool.kind.by() {
        Use::Outline => {
            let (sine, cosine) = (std::f64::consts::TAU * n as f64 / count as f64).sin_cos();
            DVec3::new(9.0 * cosine, 9.0 * sine, 200.0)
        }
        _ => DVec3::new(-8.0 + 0.8 * n as f64, 2.0, 200.0),
    };
    let ray = |n: usize| Ray {
        from: place(n),
        along: -DVec3::Z,
    };
    let begin = Order::Begin { tool, ray: ray(0) };
    let along = (1..count).map(|n| Order::Along(ray(n)));
    std::iter::once(begin).chain(along).chain([Order::End]).collect()
}

fn tool(kind: Kind) -> Tool {
    Tool {
        kind,
        radius: 4.0,
        strength: 0.5,
        inverted: false,
        settings: Settings::default(),
    }
}

fn opened(path: &Path) -> Document {
    Document::open(path, Options::default()).unwrap().document
}

/// What the journal leaves when all of it is done again by the commands in it.
fn again(document: &mut Document) -> State {
    let first = document.first_state().unwrap();
    (0..document.counts().unwrap().done).fold(first, |state, n| {
        let command: Command = serde_json::from_value(document.command(n).unwrap()).unwrap();
        command.apply(&state, &mut Control::default()).unwrap().0
    })
}

/// Copying is no edit, a lasso neither; the block has no air to bridge, and nothing in it is too fine; to bend all of it by forces takes
/// minutes.
const NOT_HERE: [Kind; 5] = [Kind::Copy, Kind::Lasso, Kind::Join, Kind::Simplify, Kind::Flex];

/// The state that the journal of a document in use has on the disk.
fn on_disk(sheet: &Sheet, scratch: &Path) -> Document {
    let copy = scratch.join("copy.isoclay");
    let _ = std::fs::remove_file(&copy);
    std::fs::copy(&sheet.path, &copy).unwrap();
    opened(&copy)
}

#[test]
fn every_tool_leaves_an_edit_that_a_script_repeats_to_the_bit() {
    let (home, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut desk = Bare::new(home.path());
    desk.order(Order::Clay);
    let sheet = desk.sheet(0, 0);
    // A dent, which can be smoothed.
    for order in stroke(tool(Kind::Carve), 3) {
        desk.order(order);
    }
    desk.sheet(1, 1);
    for kind in Kind::ALL.iter().copied().filter(|kind| !NOT_HERE.contains(kind)) {
        eprintln!("{kind:?}");
        if kind == Kind::Paste {
            let ray = Ray {
                from: DVec3::new(6.0, 9.0, 200.0),
                along: -DVec3::Z,
            };
            let tool = tool(Kind::Copy);
            desk.order(Order::Begin { tool, ray });
            desk.order(Order::End);
        }
        let count = if kind.by() == Use::Outline { 12 } else { 4 };
        for order in stroke(tool(kind), count) {
            desk.order(order);
        }
        desk.sheet(2, 2);
        let mut document = on_disk(&sheet, scratch.path());
        assert_eq!(
            again(&mut document).sha256(),
            document.state().sha256(),
            "{kind:?}"
        );
        desk.order(Order::Undo(1));
        desk.sheet(2, 1);
    }
    // One that is dropped leaves nothing, and one that was not ended becomes an edit when the window closes.
    let mut dropped = stroke(tool(Kind::Carve), 3);
    *dropped.last_mut().unwrap() = Order::Drop;
    dropped.into_iter().for_each(|order| desk.order(order));
    let mut open = stroke(tool(Kind::Inflate), 3);
    open.pop();
    open.into_iter().for_each(|order| desk.order(order));
    let told = desk.end();
    assert!(
        !told.iter().any(|news| matches!(news, News::Failed(_))),
        "{told:?}"
    );
    let mut document = opened(&sheet.path);
    assert_eq!(document.counts().unwrap().done, 2);
    assert_eq!(again(&mut document).sha256(), document.state().sha256());
}

/// A document without a name goes when nothing was done in it, or when it gets one; what it was exported to is there.
#[test]
fn documents_without_a_name_leave_nothing_behind() {
    let home = tempfile::tempdir().unwrap();
    let elsewhere = tempfile::tempdir().unwrap();
    let mut desk = Bare::new(home.path());
    desk.order(Order::Clay);
    let first = desk.sheet(0, 0);
    assert!(first.is_untitled && first.path.exists());
    desk.order(Order::Clay);
    let second = desk.sheet(0, 0);
    assert!(!first.path.exists() || first.path == second.path);
    stroke(tool(Kind::Carve), 3)
        .into_iter()
        .for_each(|order| desk.order(order));
    desk.sheet(1, 1);
    let named = elsewhere.path().join("named.isoclay");
    desk.order(Order::Save(named.clone()));
    let saved = desk.sheet(1, 1);
    assert!(!saved.is_untitled && saved.path == named);
    desk.order(Order::Undo(1));
    desk.sheet(1, 0);
    let told = desk.end();
    assert!(
        !told.iter().any(|news| matches!(news, News::Failed(_))),
        "{told:?}"
    );
    assert_eq!(std::fs::read_dir(home.path()).unwrap().count(), 0);
    assert_eq!(opened(&named).counts().unwrap().undone, 1);
}

/// The triangles that are told add up to those of the shape as it is, and lie on it.
#[test]
fn patches_follow_the_surface() {
    let home = tempfile::tempdir().unwrap();
    let mut desk = Bare::new(home.path());
    desk.order(Order::Clay);
    desk.sheet(0, 0);
    stroke(tool(Kind::Carve), 6)
        .into_iter()
        .for_each(|order| desk.order(order));
    desk.sheet(1, 1);
    desk.order(Order::Undo(1));
    desk.sheet(1, 0);
    desk.order(Order::Redo(1));
    let sheet = desk.sheet(1, 1);
    let told = desk.end();
    let (mut held, mut origin) = (std::collections::BTreeMap::new(), DVec3::ZERO);
    for news in &told {
        match news {
            News::Scene { origin: at, .. } => origin = *at,
            News::Patches(patches) => {
                held.extend(patches.iter().map(|p| (p.part, p)));
            }
            _ => {}
        }
    }
    let field = &sheet.objects[0].field;
    let (mut corners, mut worst) = (0, 0.0_f64);
    let mut edges = std::collections::BTreeMap::new();
    for patch in held.values() {
        let place = |n: u32| patch.vertices[n as usize].at.map(f32::to_bits);
        for triangle in patch.indices.chunks_exact(3) {
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                let [a, b] = [place(triangle[a]), place(triangle[b])];
                *edges.entry((a.min(b), a.max(b))).or_insert(0) += if a < b { 1 } else { -1 };
            }
        }
        for vertex in &patch.vertices {
            let p = origin + glam::Vec3::from(vertex.at).as_dvec3();
            worst = worst.max(field.value(p).abs());
            corners += 1;
        }
    }
    assert!(corners > 5000, "{corners}");
    // The block's density falls by 1 a millimetre.
    assert!(worst < 0.05, "{worst} mm");
    // Closed across patches: every edge is gone along both ways.
    let open = edges.values().filter(|n| **n != 0).count();
    assert_eq!(open, 0, "of {} edges", edges.len());
}

/// The mouse as a device: what it presses is felt, its button is a stroke, undo takes the document back for a moment, and closing in the
/// middle of a stroke loses nothing.
#[test]
fn a_hand_feels_works_and_loses_nothing() {
    let home = tempfile::tempdir().unwrap();
    let mut desk = Bare::new(home.path());
    desk.order(Order::Clay);
    let sheet = desk.sheet(0, 0);
    let tool = tool(Kind::Carve);
    let pick = pick(
        &*sheet.objects[0].field,
        0.0,
        &sheet.objects[0].own_box,
        &Ray {
            from: DVec3::new(1.0, 2.0, 200.0),
            along: -DVec3::Z,
        },
    );
    let (top, _) = pick.unwrap();
    let put = |held: &Held, over: DVec3, is_down: bool| {
        let at = (top + over - held.workspace.shift) / held.workspace.scale;
        held.mouse.as_ref().unwrap().lock().unwrap().put(at, is_down);
    };
    // To a millimetre deeper than where the ball rests.
    let down = [8.0 * DVec3::Z, 3.0 * DVec3::Z];
    desk.order(Order::Take(Wanted {
        device: None,
        stiffness: 500.0,
        force: None,
        tool,
    }));
    let held = desk.held();
    let force = 0.5 / held.workspace.scale;
    let seen = desk.press(|at| put(&held, at, false), down, force);
    assert!(seen.force < 1.02 * force, "{seen:?}, {force}");
    assert!((seen.proxy.z - top.z - 4.0).abs() < 0.02, "{seen:?}");
    for step in 0..10 {
        put(&held, DVec3::new(0.2 * f64::from(step), 0.0, 3.0), true);
        std::thread::sleep(Duration::from_millis(30));
    }
    desk.patches();
    put(&held, DVec3::new(2.0, 0.0, 8.0), false);
    let sheet = desk.sheet(1, 1);
    assert!(
        sheet.history[0].starts_with("carve on clay by hand"),
        "{:?}",
        sheet.history
    );
    desk.order(Order::Undo(1));
    desk.sheet(1, 0);
    let held = desk.held();
    desk.press(|at| put(&held, at, false), down, force);
    put(&held, down[1], true);
    desk.patches();
    let told = desk.end();
    assert!(
        !told.iter().any(|news| matches!(news, News::Failed(_))),
        "{told:?}"
    );
    let mut document = opened(&sheet.path);
    assert_eq!(document.counts().unwrap().done, 1);
    assert_ne!(
        document.state().sha256(),
        document.first_state().unwrap().sha256()
    );
    assert_eq!(again(&mut document).sha256(), document.state().sha256());
}

/// What is not there is told, and the document is as it was.
#[test]
fn a_device_that_is_not_there_is_refused_and_the_desk_goes_on() {
    let home = tempfile::tempdir().unwrap();
    let mut desk = Bare::new(home.path());
    let wanted = |device: &str| {
        Order::Take(Wanted {
            device: Some(device.into()),
            stiffness: 500.0,
            force: None,
            tool: tool(Kind::Carve),
        })
    };
    let failed = |desk: &mut Bare| loop {
        let news = desk.news.recv_timeout(Duration::from_secs(60));
        if let News::Failed(why) = news.expect("it is told") {
            break why;
        }
    };
    desk.order(wanted("sim:omni"));
    assert!(failed(&mut desk).contains("open something"));
    desk.order(Order::Clay);
    desk.sheet(0, 0);
    desk.order(wanted("plough"));
    assert!(failed(&mut desk).contains("plough"));
    stroke(tool(Kind::Carve), 3)
        .into_iter()
        .for_each(|order| desk.order(order));
    desk.sheet(1, 1);
    desk.order(wanted("sim:omni"));
    assert!(desk.held().mouse.is_none());
    desk.order(Order::LetGo);
    desk.wait(|news| matches!(news, News::Held(None)).then_some(()));
    desk.order(Order::Undo(1));
    desk.sheet(1, 0);
    desk.end();
}

/// Strokes without a hand are edits too, and another density is another surface.
#[test]
fn another_density_is_shown_and_undone() {
    let home = tempfile::tempdir().unwrap();
    let mut desk = Bare::new(home.path());
    desk.order(Order::Clay);
    desk.sheet(0, 0);
    let surface = serde_json::from_value(serde_json::json!({ "surface": { "iso": 2.0 } })).unwrap();
    desk.order(Order::Do(Box::new(surface)));
    let sheet = desk.sheet(1, 1);
    assert_eq!(sheet.objects[0].iso, 2.0);
    // All is shown anew: the surface is elsewhere everywhere.
    let is_anew = |news: &News| matches!(news, News::Gone(_)).then_some(());
    desk.wait(is_anew);
    desk.order(Order::Undo(1));
    assert_eq!(desk.sheet(1, 0).objects[0].iso, 0.0);
    desk.wait(is_anew);
    desk.end();
}

fn window(home: &Path) -> Harness<'static, Modeler> {
    let home = home.to_path_buf();
    let made = |ui: &mut egui::Ui, modeler: &mut Modeler| modeler.show(ui);
    let context = egui::Context::default();
    Harness::builder()
        .with_size([1280.0, 800.0])
        .build_ui_state(made, Modeler::on(&context, None, home))
}

/// Steps until something is there.
fn wait_for(window: &mut Harness<'_, Modeler>, what: &str) {
    let start = Instant::now();
    while window.query_by_label(what).is_none() {
        assert!(start.elapsed() < Duration::from_secs(60), "no {what:?}");
        std::thread::sleep(Duration::from_millis(10));
        window.step();
    }
}

/// One with a block of clay in it.
fn window_with_clay(home: &Path) -> Harness<'static, Modeler> {
    let mut window = window(home);
    window.step();
    window.get_by_label("A block of clay").click();
    wait_for(&mut window, "History");
    window
}

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
    let start = Instant::now();
    while window.query_by_label_contains("carve on clay").is_none() {
        let bench = window.state().bench();
        assert!(
            start.elapsed() < Duration::from_secs(10),
            "{:?} {:?}",
            bench.sheet,
            bench.messages
        );
        std::thread::sleep(Duration::from_millis(10));
        window.step();
    }
    window.get_by_label("as it was").click();
    let start = Instant::now();
    while window.state().bench().sheet.as_ref().is_some_and(|s| s.done > 0) {
        assert!(start.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(10));
        window.step();
    }
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
        let button = |at, pressed| egui::Event::PointerButton {
            pos: at,
            button: egui::PointerButton::Primary,
            pressed,
            modifiers: egui::Modifiers::NONE,
        };
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

/// Steps until the desk has made something so.
fn until(window: &mut Harness<'_, Modeler>, what: &str, is: impl Fn(&Sheet) -> bool) -> Arc<Sheet> {
    let start = Instant::now();
    loop {
        let bench = window.state().bench();
        if let Some(sheet) = bench.sheet.as_ref().filter(|sheet| is(sheet)) {
            return sheet.clone();
        }
        assert!(
            start.elapsed() < Duration::from_secs(60),
            "not {what}: {:?}",
            bench.messages
        );
        std::thread::sleep(Duration::from_millis(10));
        window.step();
    }
}

fn edits(window: &mut Harness<'_, Modeler>, count: usize) -> Arc<Sheet> {
    until(window, "edited", |sheet| sheet.history.len() == count)
}

fn click(window: &mut Harness<'_, Modeler>, at: egui::Pos2) {
    window.hover_at(at);
    window.step();
    window.drag_at(at);
    window.step();
    window.drop_at(at);
    window.step();
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
    let modeler = Modeler::on(&context, Some(Screen::new(state)), home.path().to_path_buf());
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
    window.state_mut().resume(&next, Some(Screen::new(screen())));
    assert!(!window.state().is_lost(true));
    let start = Instant::now();
    while window.query_by_label_contains("carve on clay").is_none() || window.state().bench().triangles == 0 {
        assert!(start.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(10));
        window.step();
    }
    let path = window.state().bench().sheet.as_ref().unwrap().path.clone();
    let kept = home.path().join("kept.isoclay");
    std::fs::copy(path, &kept).unwrap();
    assert_eq!(opened(&kept).counts().unwrap().done, 1);
}

/// What is seen of a scan while it is fitted: a scene of its own under the name of the scan, with nothing in its history.
#[test]
fn a_coarse_solid_is_seen_under_the_name_of_its_scan() {
    let (name, object) = crate::cli::desk_files::clay_block().unwrap();
    let told = super::preview::news(Path::new("scans/block.ply"), &name, object).unwrap();
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
