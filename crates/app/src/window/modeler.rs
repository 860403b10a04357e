//! The window.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use egui::layers::ShapeIdx;
use egui::{Key, Modifiers, PointerButton, Pos2, Rect, Sense};
use fitting::Cancel;
use glam::{DVec2, DVec3};

use super::adjust::Adjust;
use super::bench::Bench;
use super::desk::Desk;
use super::gesture::{Gesture, Way};
use super::kept::Kept;
use super::orders::{News, Order};
use super::tool::{Kind, Tool};
use crate::cli::{desk_files, interrupt};
use crate::panels;
use crate::view::{Camera, Look, Paper, Ray, Screen, pick, scale_bar};

/// Time after which a picture in which nothing moves is drawn whole.
const STILL: Duration = Duration::from_millis(60);
/// Longest time that a picture waits for the desk. A dab takes 7 to 14 ms, more on a busy machine; a picture without a graphics card 40.
const MEETING: Duration = Duration::from_millis(30);

/// The window.
pub struct Modeler {
    pub(super) bench: Bench,
    news: Receiver<News>,
    /// What the desk wakes.
    context: Arc<Mutex<egui::Context>>,
    /// Whether the window waits for news, so that nobody has to wake it.
    is_listening: Arc<AtomicBool>,
    screen: Option<Screen>,
    gesture: Option<Gesture>,
    /// What the mouse sets.
    pub(super) adjust: Option<Adjust>,
    /// When something moved last.
    moved: Instant,
    desk: Option<JoinHandle<()>>,
    /// How things are looked at, as it is written in a directory.
    kept: Kept,
    home: PathBuf,
}

impl Modeler {
    /// Begins the desk, with files to open.
    pub fn new(context: &eframe::CreationContext<'_>, files: Vec<PathBuf>) -> Self {
        let screen = context.wgpu_render_state.clone().map(Screen::new);
        let modeler = Self::on(&context.egui_ctx, screen, desk_files::home());
        close_when_asked(modeler.context.clone());
        for file in files {
            modeler.bench.order(Order::Open(file));
        }
        modeler
    }

    /// Goes on in another window, on a card that is not lost.
    pub(super) fn resume(&mut self, context: &egui::Context, screen: Option<Screen>) {
        style(context);
        *self.context.lock().unwrap_or_else(PoisonError::into_inner) = context.clone();
        self.end_gesture();
        self.screen = screen;
        // Its pictures were the old window's.
        self.bench.slices = self.bench.slices.take().map(|_| panels::Slices::new());
        self.moved = Instant::now();
        self.bench.order(Order::Show);
    }

    /// Whether the graphics card is lost, so that the window has to be opened anew; as [`Screen::is_lost`].
    pub(super) fn is_lost(&self, waits: bool) -> bool {
        self.screen.as_ref().is_some_and(|screen| screen.is_lost(waits))
    }

    /// Ends the desk: a stroke that is under way becomes an edit.
    pub(super) fn close(mut self) {
        self.bench.cancel();
        let (nobody, _) = channel();
        // Its orders end, and with them the desk.
        self.bench.orders = nobody;
        if let Some(desk) = self.desk.take() {
            let _ = desk.join();
        }
    }

    /// With nothing open.
    pub(super) fn on(context: &egui::Context, screen: Option<Screen>, home: PathBuf) -> Self {
        style(context);
        let context = Arc::new(Mutex::new(context.clone()));
        let (orders, received) = channel();
        let (told, news) = channel();
        let cancel = Arc::new(Mutex::new(Cancel::new()));
        let is_listening = Arc::<AtomicBool>::default();
        let wake = wake(context.clone(), is_listening.clone());
        let desk = Desk::new(told, wake, cancel.clone(), home.clone());
        let desk = std::thread::Builder::new()
            .name("desk".into())
            .spawn(move || desk.work(&received))
            .expect("the system has threads enough");
        let kept = Kept::read(&home);
        Self {
            bench: Bench {
                sheet: None,
                tool: Tool {
                    kind: Kind::Carve,
                    radius: 0.08,
                    strength: 0.5,
                    inverted: false,
                },
                look: Look {
                    camera: Camera::onto(DVec3::ZERO, 1.0, DVec3::Y),
                    cut: None,
                    paint: true,
                    mode: kept.mode,
                    density: [0.0, 1.0],
                    paper: Paper::Dark,
                },
                scene: (DVec3::ZERO, 1.0),
                busy: None,
                messages: VecDeque::new(),
                triangles: 0,
                slices: None,
                asks: None,
                kept: desk_files::kept(&home),
                scratch: None,
                densities: None,
                can_cast: true,
                density_of: None,
                shows_log: false,
                measure: None,
                pins: false,
                touch: None,
                held: None,
                seen: None,
                told_tool: None,
                orders,
                cancel,
            },
            news,
            context,
            is_listening,
            screen,
            gesture: None,
            adjust: None,
            moved: Instant::now(),
            desk: Some(desk),
            kept,
            home,
        }
    }

    /// Takes what the desk told.
    fn hear(&mut self) {
        while let Ok(news) = self.news.try_recv() {
            self.take(news);
        }
        self.bench.triangles = self.screen.as_ref().map_or(0, |s| s.canvas.triangles());
    }

    fn take(&mut self, news: News) {
        match news {
            News::Sheet(sheet) => self.bench.sheet = Some(sheet),
            News::Scene {
                origin,
                center,
                radius,
                up,
                is_finer,
            } => {
                self.bench.scene = (center, radius);
                if !is_finer {
                    self.bench.look.cut = None;
                    self.bench.look.camera.up = up;
                    self.bench.frame_all();
                }
                if let Some(Screen { canvas, .. }) = &mut self.screen {
                    canvas.begin(origin, center.distance(origin) + radius);
                }
            }
            News::Patches(patches) => {
                self.moved = Instant::now();
                if let Some(Screen { canvas, .. }) = &mut self.screen {
                    patches.iter().for_each(|patch| canvas.put(patch));
                }
            }
            News::Solid(object, solid) => {
                if let Some(Screen { canvas, .. }) = &mut self.screen {
                    canvas.put_solid(&object, *solid);
                }
            }
            News::Gone(object) => {
                if let Some(Screen { canvas, .. }) = &mut self.screen {
                    canvas.forget(&object);
                }
            }
            News::Empty => self.bench.sheet = None,
            News::Busy(busy) => self.bench.busy = busy,
            News::Size(name, size) => {
                if let Some(measure) = &mut self.bench.measure {
                    measure.size = Some((name, size));
                }
            }
            News::Held(held) => {
                self.bench.held = held;
                self.bench.seen = None;
            }
            News::Seen(seen) => self.bench.seen = Some(seen),
            News::Note(text) => self.bench.tell(text, false),
            News::Failed(text) => self.bench.tell(text, true),
        }
    }

    /// Waits a little for what the desk makes of a stroke: else the next picture would show it, not this one.
    fn meet_desk(&mut self) {
        self.is_listening.store(true, Ordering::SeqCst);
        let until = Instant::now() + MEETING;
        loop {
            let rest = until.saturating_duration_since(Instant::now());
            let Ok(news) = self.news.recv_timeout(rest) else {
                break;
            };
            let is_shown = matches!(news, News::Patches(_));
            self.take(news);
            if is_shown {
                break;
            }
        }
        self.is_listening.store(false, Ordering::SeqCst);
        // What was told meanwhile has woken nobody.
        self.hear();
    }

    /// The scene, and what the mouse does in it.
    fn viewport(&mut self, ui: &mut egui::Ui) {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        // What the mouse does now shows in this picture, which is painted below what is drawn over it.
        let below = ui.painter().add(egui::Shape::Noop);
        let over = response.hover_pos().or(response.interact_pointer_pos());
        if let Some(over) = over {
            self.pointer(ui, rect, &response, over);
        }
        let is_still = self.moved.elapsed() > STILL && self.gesture.is_none();
        self.bench.know_density();
        let is_done = self.draw(ui, below, rect, is_still);
        if !is_done {
            ui.ctx().request_repaint();
        }
        if !is_still {
            ui.ctx().request_repaint_after(STILL);
        }
        if let Some(thing) = self.bench.sheet.as_ref().and_then(|s| s.objects.get(s.chosen)) {
            let length_of_point = self.bench.look.camera.height / f64::from(rect.height());
            scale_bar(ui.painter(), rect, length_of_point, thing.unit);
        }
        self.draw_holds(ui, rect);
        self.draw_marks(ui, rect);
        self.draw_hand(ui, rect);
        if response.drag_stopped() || !ui.input(|i| i.pointer.any_down()) {
            self.end_gesture();
        }
    }

    /// Draws the scene in place of a shape, or as much of it as there is time for; whether that is all.
    fn draw(&mut self, ui: &egui::Ui, below: ShapeIdx, rect: Rect, is_still: bool) -> bool {
        let Some(screen) = &mut self.screen else {
            return true;
        };
        let look = &self.bench.look;
        let pixels = rect.size() * ui.ctx().pixels_per_point();
        let rough = screen
            .canvas
            .rough_share(look.mode, f64::from(pixels.x * pixels.y));
        let mut draw = |is_rough: bool| {
            let pixels = if is_rough { pixels * rough } else { pixels }.round();
            screen.draw(look, [pixels.x as u32, pixels.y as u32], is_rough)
        };
        let whole = is_still.then(|| draw(false));
        // Until all rows are drawn the rough picture shows below them.
        let shown = match &whole {
            Some(whole) if whole.rows >= 1.0 => None,
            _ => Some(draw(true)),
        };
        let is_done = whole
            .as_ref()
            .or(shown.as_ref())
            .is_none_or(|drawn| drawn.is_done);
        let shown = shown.map(|drawn| (drawn.picture, 1.0));
        let whole = whole.map(|drawn| (drawn.picture, drawn.rows));
        let pictures = shown.into_iter().chain(whole).map(|(picture, rows)| {
            let corner = rect.min + egui::vec2(rect.width(), rows * rect.height());
            let part = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, rows));
            let rect = Rect::from_min_max(rect.min, corner);
            egui::Shape::image(picture, rect, part, egui::Color32::WHITE)
        });
        ui.painter().set(below, egui::Shape::Vec(pictures.collect()));
        is_done
    }

    fn end_gesture(&mut self) {
        if let Some(Gesture::Stroke(_)) = self.gesture.take() {
            self.bench.order(Order::End);
        }
    }

    fn pointer(&mut self, ui: &egui::Ui, rect: Rect, response: &egui::Response, over: Pos2) {
        if self.adjust(ui, rect, over) {
            return;
        }
        let (keys, scroll, pressed) = ui.input(|i| {
            let pressed = [
                PointerButton::Primary,
                PointerButton::Secondary,
                PointerButton::Middle,
            ]
            .into_iter()
            .find(|b| i.pointer.button_pressed(*b));
            (i.modifiers, i.smooth_scroll_delta().y, pressed)
        });
        if response.hovered() && scroll != 0.0 {
            let factor = (-0.003 * f64::from(scroll)).exp();
            self.bench.look.camera.zoom(factor, at(rect, over));
            self.moved = Instant::now();
        }
        let tool = self.bench.tool_in_hand(keys);
        // While a scan is read or a file is written strokes would have to wait.
        let is_free = self.bench.busy.is_none() && self.gesture.is_none();
        // A slow picture may hold a press, its way and even the release.
        let (start, moves) = ui.input(|i| since_press(&i.events));
        let start = start.unwrap_or(over);
        let under = is_free.then(|| self.under(rect, start)).flatten();
        if let Some(button) = pressed.filter(|_| response.hovered() && self.gesture.is_none()) {
            if let (PointerButton::Primary, Some((p, normal))) = (button, under) {
                if self.bench.measure.is_some() {
                    self.bench.mark(p, normal);
                    return;
                }
                if self.bench.pins {
                    self.bench.pin(p);
                    return;
                }
            }
            self.gesture = Some(match (button, keys.shift, keys.alt) {
                (PointerButton::Primary, _, false) if self.leads_by_mouse() && under.is_some() => {
                    Gesture::Hand
                }
                (PointerButton::Primary, _, false) if under.is_some() && self.bench.held.is_none() => {
                    let reach = self.pixels_of(rect, tool.radius);
                    self.bench.order(Order::Begin {
                        tool,
                        ray: self.ray(rect, start),
                    });
                    Gesture::Stroke(Way::new(start, (0.2 * reach).clamp(2.0, 24.0)))
                }
                (PointerButton::Middle, true, _) | (PointerButton::Secondary, ..) => Gesture::Pan,
                _ => Gesture::Orbit,
            });
            if !matches!(self.gesture, Some(Gesture::Stroke(_))) {
                return;
            }
        }
        let way = ui.input(|i| i.pointer.delta());
        let way = DVec2::new(f64::from(way.x), -f64::from(way.y)) / f64::from(rect.height());
        match &mut self.gesture {
            Some(Gesture::Stroke(path)) => {
                let steps: Vec<Pos2> = moves.into_iter().flat_map(|to| path.to(to)).collect();
                for step in &steps {
                    self.bench.order(Order::Along(self.ray(rect, *step)));
                }
                if !steps.is_empty() {
                    self.meet_desk();
                }
            }
            Some(Gesture::Orbit) if way != DVec2::ZERO => {
                self.bench.look.camera.orbit(way);
                self.moved = Instant::now();
            }
            Some(Gesture::Pan) if way != DVec2::ZERO => {
                self.bench.look.camera.pan(way);
                self.moved = Instant::now();
            }
            _ => {}
        }
        self.lead(rect, over);
        if let (Some((p, normal)), None, None) = (under, self.gesture, &self.bench.held) {
            self.ring(ui, rect, p, normal, &tool);
        }
    }

    fn leads_by_mouse(&self) -> bool {
        self.bench.held.as_ref().is_some_and(|held| held.mouse.is_some())
    }

    /// What a button that is down does.
    pub(super) fn gesture(&self) -> Option<Gesture> {
        self.gesture
    }

    pub(super) fn ray(&self, rect: Rect, over: Pos2) -> Ray {
        self.bench.look.camera.ray(at(rect, over))
    }

    pub(super) fn on_screen(&self, rect: Rect, p: DVec3) -> Pos2 {
        let place = self.bench.look.camera.place(p) * f64::from(rect.height());
        rect.center() + egui::vec2(place.x as f32, -place.y as f32)
    }

    pub(super) fn pixels_of(&self, rect: Rect, length: f64) -> f32 {
        (length / self.bench.look.camera.height) as f32 * rect.height()
    }

    /// Where the mouse is over the chosen object, and the normal there, in the world.
    pub(super) fn under(&self, rect: Rect, over: Pos2) -> Option<(DVec3, DVec3)> {
        let sheet = self.bench.sheet.as_ref()?;
        let thing = sheet.objects.get(sheet.chosen)?;
        let ray = self.ray(rect, over);
        let own = thing.world_from_object.inverse();
        let ray = Ray {
            from: own.transform_point3(ray.from),
            along: own.transform_vector3(ray.along).try_normalize()?,
        };
        let (p, normal) = pick(&*thing.field, thing.iso, &thing.own_box, &ray)?;
        let turned = own.matrix3.transpose() * normal;
        Some((
            thing.world_from_object.transform_point3(p),
            turned.normalize_or_zero(),
        ))
    }

    fn keys(&mut self, ui: &egui::Ui) {
        if ui.ctx().egui_wants_keyboard_input() {
            return;
        }
        let pressed = |keys: Modifiers, key| ui.input_mut(|i| i.consume_key(keys, key));
        let redo = Modifiers::COMMAND | Modifiers::SHIFT;
        if pressed(redo, Key::Z) || pressed(Modifiers::COMMAND, Key::Y) {
            self.bench.order(Order::Redo(1));
        } else if pressed(Modifiers::COMMAND, Key::Z) {
            self.bench.order(Order::Undo(1));
        }
        if pressed(Modifiers::COMMAND, Key::O) {
            self.bench.asks = Some(panels::PathBox::open());
        }
        if pressed(Modifiers::COMMAND, Key::S) {
            self.bench.asks = self
                .bench
                .sheet
                .as_ref()
                .map(|sheet| panels::PathBox::save(sheet));
        }
        // Menus have it else.
        if matches!(self.gesture, Some(Gesture::Stroke(_))) && pressed(Modifiers::NONE, Key::Escape) {
            self.gesture = None;
            self.bench.order(Order::Drop);
        }
        if pressed(Modifiers::NONE, Key::OpenBracket) {
            self.bench.tool.radius = (self.bench.tool.radius / 1.15).max(panels::RADII[0]);
        }
        if pressed(Modifiers::NONE, Key::CloseBracket) {
            self.bench.tool.radius = (self.bench.tool.radius * 1.15).min(panels::RADII[1]);
        }
        self.adjust_by_keys(ui);
        if pressed(Modifiers::NONE, Key::V) && self.bench.can_cast {
            self.bench.look.mode = panels::next_mode(self.bench.look.mode);
        }
        if pressed(Modifiers::NONE, Key::N) {
            self.bench.pins ^= true;
        }
        if pressed(Modifiers::NONE, Key::M) {
            self.bench.measure = match self.bench.measure {
                Some(_) => None,
                None => Some(Default::default()),
            };
        }
        for kind in Kind::ALL {
            if pressed(Modifiers::NONE, kind.key()) {
                self.bench.tool.kind = kind;
            }
        }
        let up = self.bench.look.camera.up;
        let front = if up == DVec3::Z { -DVec3::Y } else { DVec3::Z };
        for (key, axis) in [(Key::Num1, front), (Key::Num3, DVec3::X), (Key::Num7, up)] {
            if pressed(Modifiers::NONE, key) {
                self.bench.look.camera.look_from(axis);
                self.moved = Instant::now();
            }
        }
        if pressed(Modifiers::NONE, Key::Home) {
            self.bench.frame_all();
            self.moved = Instant::now();
        }
        if pressed(Modifiers::NONE, Key::Num5) {
            self.bench.look.camera.perspective ^= true;
            self.moved = Instant::now();
        }
    }
}

/// Hints are read too: egui's own are too faint for that.
fn style(context: &egui::Context) {
    context.all_styles_mut(|style| style.visuals.weak_text_alpha = 0.85);
}

/// Where a button went down last among the events of a picture, if one did, and the way from there, or from the beginning, until one
/// came up.
fn since_press(events: &[egui::Event]) -> (Option<Pos2>, Vec<Pos2>) {
    let pressed = events
        .iter()
        .enumerate()
        .rev()
        .find_map(|(n, event)| match event {
            egui::Event::PointerButton {
                pos, pressed: true, ..
            } => Some((n + 1, *pos)),
            _ => None,
        });
    let way = &events[pressed.map_or(0, |(n, _)| n)..];
    let is_release = |event: &egui::Event| matches!(event, egui::Event::PointerButton { pressed: false, .. });
    let until = way.iter().position(is_release).unwrap_or(way.len());
    let moves = way[..until].iter().filter_map(|event| match event {
        egui::Event::PointerMoved(to) => Some(*to),
        _ => None,
    });
    (pressed.map(|(_, at)| at), moves.collect())
}

/// Where a point of the screen is in the picture, in heights of it.
fn at(rect: Rect, p: Pos2) -> DVec2 {
    let way = p - rect.center();
    DVec2::new(f64::from(way.x), -f64::from(way.y)) / f64::from(rect.height())
}

/// Closes the window on Ctrl-C and SIGTERM, as its own button does.
fn close_when_asked(context: Arc<Mutex<egui::Context>>) {
    let asked = interrupt::in_window();
    std::thread::spawn(move || {
        while !asked.is_cancelled() {
            std::thread::sleep(Duration::from_millis(50));
        }
        let context = context.lock().unwrap_or_else(PoisonError::into_inner);
        context.send_viewport_cmd(egui::ViewportCommand::Close);
        context.request_repaint();
    });
}

fn wake(context: Arc<Mutex<egui::Context>>, is_listening: Arc<AtomicBool>) -> Arc<dyn Fn() + Send + Sync> {
    Arc::new(move || {
        if !is_listening.load(Ordering::SeqCst) {
            let context = context.lock().unwrap_or_else(PoisonError::into_inner);
            context.request_repaint();
        }
    })
}

impl Modeler {
    /// What panels show.
    #[cfg(test)]
    pub fn bench(&self) -> &Bench {
        &self.bench
    }

    /// All of the window.
    pub fn show(&mut self, ui: &mut egui::Ui) {
        if self.is_lost(false) {
            // What is in the hand goes to the disk; the next window shows it.
            self.end_gesture();
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
            return;
        }
        self.hear();
        self.bench.can_cast = self.screen.as_ref().is_none_or(|screen| screen.canvas.can_cast());
        self.keys(ui);
        let dropped: Vec<PathBuf> = ui.input(|i| {
            let files = i.raw.dropped_files.iter();
            files.map(|file| file.path().to_path_buf()).collect()
        });
        for path in dropped {
            self.bench.order(Order::Open(path));
        }
        egui::Panel::top("menu").show(ui, |ui| panels::menu(ui, &mut self.bench));
        egui::Panel::bottom("status").show(ui, |ui| panels::status(ui, &self.bench));
        if self.bench.sheet.is_some() {
            egui::Panel::left("tools")
                .exact_size(196.0)
                .show(ui, |ui| panels::tools(ui, &mut self.bench));
            egui::Panel::right("document")
                .default_size(210.0)
                .show(ui, |ui| panels::document(ui, &mut self.bench));
        }
        egui::CentralPanel::no_frame().show(ui, |ui| match &self.bench.sheet {
            Some(_) => self.viewport(ui),
            None => panels::start(ui, &mut self.bench),
        });
        panels::slices(ui.ctx(), &mut self.bench);
        panels::path_box(ui.ctx(), &mut self.bench);
        panels::touch(ui.ctx(), &mut self.bench);
        panels::measure(ui.ctx(), &mut self.bench);
        panels::log(ui.ctx(), &mut self.bench);
        self.bench.tell_tool();
        if let Err(why) = self.kept.keep(self.bench.look.mode, &self.home) {
            self.bench.tell(why, true);
        }
        if self.bench.message().is_some() {
            ui.ctx().request_repaint_after(Duration::from_secs(1));
        }
    }
}
