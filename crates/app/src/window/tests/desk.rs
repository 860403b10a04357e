//! The desk on its thread, without a window.

use bspline::HierarchicalSpline;
use bspline::hierarchical::Lattice;
use document::Object;
use formats::field::FieldMeta;
use glam::DAffine3;

use super::*;
use crate::view::{Budget, Patch};

/// A desk on its thread, without a window.
pub struct Bare {
    orders: Sender<Order>,
    news: Receiver<News>,
    desk: JoinHandle<()>,
    told: Vec<News>,
}

impl Bare {
    pub fn new(home: &Path) -> Self {
        let (orders, received) = channel();
        let (told, news) = channel();
        let cancel = Arc::new(Mutex::new(Cancel::new()));
        let desk = Desk::new(told, Arc::new(|_| ()), cancel, home.into());
        Self {
            orders,
            news,
            desk: std::thread::spawn(move || desk.work(&received)),
            told: Vec::new(),
        }
    }

    pub fn order(&self, order: Order) {
        self.orders.send(order).unwrap();
    }

    /// The first news from now on that are looked for.
    pub fn wait<T>(&mut self, what: impl Fn(&News) -> Option<T>) -> T {
        let found = self.wait_for(Duration::from_secs(60), what);
        found.unwrap_or_else(|| panic!("nothing of the kind is told, but last {:?}", self.told.last()))
    }

    /// The same, if they come in time.
    pub fn wait_for<T>(&mut self, time: Duration, what: impl Fn(&News) -> Option<T>) -> Option<T> {
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
    pub fn sheet(&mut self, all: usize, done: usize) -> Arc<Sheet> {
        self.wait(|news| match news {
            News::Sheet(sheet) if (sheet.history.len(), sheet.done) == (all, done) => Some(sheet.clone()),
            _ => None,
        })
    }

    /// What is in the hand, when it is there.
    pub fn held(&mut self) -> Held {
        self.wait(|news| match news {
            News::Held(held) => held.clone(),
            _ => None,
        })
    }

    /// The hand comes down from `above` to `pressed` and feels so much. After a stall, of a busy machine too, it feels nothing until it has
    /// been clear of the solid, so it is lifted and tries again.
    pub fn press(&mut self, put: impl Fn(DVec3), [above, pressed]: [DVec3; 2], force: f64) -> Seen {
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
    pub fn patches(&mut self) {
        self.wait(|news| matches!(news, News::Patches(_)).then_some(()));
    }

    /// What is still told, and the end.
    pub fn end(self) -> Vec<News> {
        drop(self.orders);
        self.desk.join().unwrap();
        self.told.into_iter().chain(self.news.iter()).collect()
    }
}

/// A stroke over the front of the block, seen from +z: so many lines of sight, in a row, or of an outline round about.
pub fn stroke(tool: Tool, count: usize) -> Vec<Order> {
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
    let begin = Order::Begin {
        tool,
        ray: ray(0),
        press: None,
    };
    let along = (1..count).map(|n| Order::Along {
        ray: ray(n),
        press: None,
    });
    std::iter::once(begin).chain(along).chain([Order::End]).collect()
}

pub fn tool(kind: Kind) -> Tool {
    Tool {
        kind,
        radius: 4.0,
        strength: 0.5,
        inverted: false,
        settings: Settings::default(),
    }
}

pub fn opened(path: &Path) -> Document {
    Document::open(path, Options::default()).unwrap().document
}

/// What the journal leaves when all of it is done again by the commands in it.
pub fn again(document: &mut Document) -> State {
    let first = document.first_state().unwrap();
    (0..document.counts().unwrap().done).fold(first, |state, n| {
        let command: Command = serde_json::from_value(document.command(n).unwrap()).unwrap();
        command.apply(&state, &mut Control::default()).unwrap().0
    })
}

const NOT_HERE: [Kind; 5] = [Kind::Copy, Kind::Lasso, Kind::Join, Kind::Simplify, Kind::Flex];

/// The state that the journal of a document in use has on the disk.
pub fn on_disk(sheet: &Sheet, scratch: &Path) -> Document {
    let copy = scratch.join("copy.isoclay");
    let _ = std::fs::remove_file(&copy);
    std::fs::copy(&sheet.path, &copy).unwrap();
    opened(&copy)
}

/// Copying is no edit, a lasso neither; the block has no air to bridge, and nothing in it is too fine; to bend all of it by forces takes
/// minutes.
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
            desk.order(Order::Begin {
                tool,
                ray,
                press: None,
            });
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

/// An object of a formula, with so many cells of size 1 along each axis.
fn solid(cells: u32, formula: impl Fn(DVec3) -> f64 + Sync) -> Object {
    let lattice = Lattice {
        world_from_lattice: DAffine3::IDENTITY,
        cells: [cells; 3],
    };
    let field = HierarchicalSpline::<f32>::schoenberg(lattice, 1.0, formula).unwrap();
    let meta = FieldMeta {
        iso: Some(0.0),
        ..FieldMeta::default()
    };
    Object::of(field.into(), meta)
}

/// What has triangles that take long is seen in coarse ones first; the eye stays where it is as the finer ones come.
#[test]
fn heavy_fields_are_seen_coarse_first() {
    let home = tempfile::tempdir().unwrap();
    let ball = |p: DVec3| 40.0 - p.distance(DVec3::splat(50.0)) + 2.0 * p.x.sin() * p.y.sin();
    let state = State::new().with("ball", solid(100, ball)).unwrap();
    let path = home.path().join("ball.isoclay");
    drop(crate::cli::desk_files::create(&path, state).unwrap());
    let mut desk = Bare::new(home.path());
    desk.order(Order::Open(path));
    let scene = |wanted: bool| {
        move |news: &News| match news {
            News::Scene { is_finer, origin, .. } if *is_finer == wanted => Some(*origin),
            _ => None,
        }
    };
    let triangles = |news: &News| match news {
        News::Patches(patches) => Some(patches.iter().map(|p| p.indices.len()).sum::<usize>()),
        _ => None,
    };
    let first = desk.wait(scene(false));
    let coarse = desk.wait(triangles);
    assert_eq!(desk.wait(scene(true)), first);
    let fine = desk.wait(triangles);
    assert!(2 * coarse < fine, "{coarse}, then {fine}");
    desk.sheet(0, 0);
}

/// Objects share the triangles that are drawn: one that is left alone has all of them.
#[test]
fn what_is_left_alone_has_all_triangles() {
    let home = tempfile::tempdir().unwrap();
    let ball = |p: DVec3| 15.0 - p.distance(DVec3::splat(20.0)) + (2.0 * p.x).sin() * (2.0 * p.y).sin();
    let object = solid(40, ball);
    let state = State::new().with("left", object.clone()).unwrap();
    let state = state.with("right", object).unwrap();
    let path = home.path().join("two.isoclay");
    drop(crate::cli::desk_files::create(&path, state).unwrap());
    let mut desk = Bare::new(home.path());
    let all = Budget {
        still: 50_000,
        moving: 24_000,
    };
    desk.order(Order::Show(all));
    desk.order(Order::Open(path));
    let of = |wanted: &'static str| {
        move |news: &News| match news {
            News::Patches(patches) if patches[0].object == wanted => {
                let still = patches.iter().map(|p| p.indices.len() / 3).sum();
                let rough = |patch: &Patch| patch.rough.as_ref().unwrap_or(&patch.indices).len() / 3;
                let moving = patches.iter().map(rough).sum();
                Some(Budget { still, moving })
            }
            _ => None,
        }
    };
    let is_within = |found: Budget, all: Budget| {
        assert!(
            found.still > all.still / 4 && found.still <= all.still,
            "{found:?}"
        );
        assert!(
            found.moving > 0 && found.moving <= all.moving,
            "{found:?} of {all:?}"
        );
    };
    let half = Budget {
        still: all.still / 2,
        moving: all.moving / 2,
    };
    let left = desk.wait(of("left"));
    is_within(left, half);
    assert_eq!(desk.wait(of("right")), left);
    desk.order(Order::Command(Box::new(Command::Remove {
        object: "right".into(),
    })));
    desk.sheet(1, 1);
    let alone = desk.wait(of("left"));
    is_within(alone, all);
    assert!(alone.still > left.still, "{alone:?} after {left:?}");
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
