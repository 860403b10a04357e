//! The window.

mod keys;
mod news;
mod pointer;
mod viewport;

use std::collections::{BTreeSet, VecDeque};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use egui::Color32;
use fitting::Cancel;
use glam::DVec3;

use super::adjust::Adjust;
use super::arrange::Arrange;
use super::bench::Bench;
use super::desk::{Desk, Wake};
use super::docks::Docks;
use super::gesture::Gesture;
use super::kept::{Kept, Theme};
use super::keys::Keys;
use super::layout::Layout;
use super::limits::Limits;
use super::orders::{News, Order};
use super::pace::Pace;
use super::pen::{self, Pens};
use super::shot::Shot;
use super::show::{Beside, Shown};
use super::tool::{Kind, Settings, Tool};
use crate::cli::{desk_files, interrupt};
use crate::panels;
use crate::view::{Budget, Camera, LINE, Look, Paper, Ray, Screen};

/// The window.
pub struct Modeler {
    pub(super) bench: Bench,
    news: Receiver<News>,
    /// What the desk wakes.
    context: Arc<Mutex<egui::Context>>,
    /// Whether the window waits for news, so that nobody has to wake it.
    is_listening: Arc<AtomicBool>,
    pub(super) screen: Option<Screen>,
    gesture: Option<Gesture>,
    /// How fast the stroke is, if that counts.
    pace: Option<Pace>,
    /// When the last picture but one was, and the last, seconds.
    times: [f64; 2],
    /// What the mouse sets.
    pub(super) adjust: Option<Adjust>,
    /// The object that is being arranged.
    pub(super) arrange: Option<Arrange>,
    /// The line that is drawn for a tool that acts at once, in the world.
    drawn: Vec<DVec3>,
    /// Points of a lasso, with their lines of sight in the world of the chosen object, and whether it spares what is within.
    lassoed: (Vec<(egui::Pos2, Ray)>, bool),
    /// Where the desk was asked to show what a click would leave, and with which tool.
    tried: Option<(egui::Pos2, Tool)>,
    /// When something moved last that no button held: a turn of the view is over as the button comes up.
    moved: Instant,
    /// Whether the wheel moves the clipping plane.
    moves_plane: bool,
    desk: Option<JoinHandle<()>>,
    /// How things are looked at, as it is written in a directory.
    kept: Kept,
    home: PathBuf,
    /// What is shown beside the solids.
    pub(super) beside: Beside,
    /// Pictures that become files.
    pub(super) shot: Option<Shot>,
    /// The panels round the scene.
    pub(super) docks: Docks,
    /// Where they are, unless that is as at first.
    pub(super) layout: Option<Layout>,
    /// How hard they are pressed.
    pub(super) pens: Pens,
    /// What they did in the time of this picture.
    pen: pen::Moves,
    /// Where the scene was drawn last.
    #[cfg(test)]
    pub(super) drawn_in: egui::Rect,
}

impl Modeler {
    /// Begins the desk, with files to open.
    pub fn new(context: &eframe::CreationContext<'_>, files: Vec<PathBuf>) -> Self {
        let screen = context.wgpu_render_state.as_ref().map(Screen::new);
        let mut modeler = Self::on(&context.egui_ctx, screen, desk_files::home());
        modeler.bench.keys = Keys::read(&desk_files::settings());
        modeler.pens = Pens::listen(context);
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
        self.beside = Beside::default();
        // Its pictures were the old window's.
        self.bench.slices = self.bench.slices.take().map(|_| panels::Slices::new());
        self.moved = Instant::now();
        self.show_all();
    }

    /// Has the desk show all, as the card can draw it.
    fn show_all(&self) {
        let of_screen = self.screen.as_ref().map(|screen| screen.triangles);
        let triangles = of_screen.unwrap_or(Budget::PROCESSOR);
        self.bench.order(Order::Show(triangles));
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
        let kept = Kept::read(&home);
        kept.theme.give(context);
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
        let modeler = Self {
            bench: Bench {
                sheet: None,
                tool: Tool {
                    kind: Kind::Carve,
                    radius: 0.08,
                    strength: 0.5,
                    inverted: false,
                    settings: Settings::default(),
                },
                look: Look {
                    camera: Camera::onto(DVec3::ZERO, 1.0, DVec3::Y),
                    cut: None,
                    paint: true,
                    mode: kept.mode,
                    density: [0.0, 1.0],
                    paper: Paper::Dark,
                    show: kept.show,
                    line: LINE,
                },
                scene: (DVec3::ZERO, 1.0),
                busy: None,
                messages: VecDeque::new(),
                triangles: 0,
                slices: None,
                asks: None,
                written: None,
                part: None,
                kept: desk_files::kept(&home),
                scratch: None,
                densities: None,
                can_cast: true,
                density_of: None,
                shows_log: false,
                measure: None,
                pins: false,
                arranging: false,
                arranges: None,
                adjusts: None,
                limits: Limits::default(),
                hidden: BTreeSet::new(),
                renames: None,
                keys: Keys::read(&home),
                commands: None,
                shortcuts: None,
                simulation: panels::Simulation::default(),
                performance: panels::Performance::default(),
                fill: panels::Fill::default(),
                sides: kept.sides,
                ignores_pens: kept.ignores_pens,
                by_speed: kept.by_speed,
                rearranges: None,
                has_pen: false,
                touch: None,
                held: None,
                seen: None,
                told_tool: None,
                shown: Shown::default(),
                shot: panels::Shots::default(),
                shown_tool: None,
                told_limits: Limits::default(),
                limits_of: None,
                orders,
                cancel,
            },
            docks: Docks::new(kept.layout.as_ref()),
            layout: kept.layout.clone(),
            news,
            context,
            is_listening,
            screen,
            gesture: None,
            pace: None,
            times: [0.0; 2],
            adjust: None,
            arrange: None,
            drawn: Vec::new(),
            lassoed: (Vec::new(), false),
            tried: None,
            moved: Instant::now(),
            moves_plane: false,
            desk: Some(desk),
            kept,
            home,
            beside: Beside::default(),
            shot: None,
            pens: Pens::default(),
            pen: pen::Moves::default(),
            #[cfg(test)]
            drawn_in: egui::Rect::ZERO,
        };
        modeler.show_all();
        modeler
    }

    /// What panels show.
    #[cfg(test)]
    pub fn bench(&self) -> &Bench {
        &self.bench
    }

    /// The line that is drawn for a tool that acts at once, in the world.
    pub(super) fn line_so_far(&self) -> &[DVec3] {
        &self.drawn
    }

    /// The points of a lasso that is drawn.
    pub(super) fn lasso_so_far(&self) -> &[(egui::Pos2, Ray)] {
        &self.lassoed.0
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
        self.times = [self.times[1], ui.input(|i| i.time)];
        (self.pen, self.bench.has_pen) = (self.pens.since_last(), self.pens.are_there());
        self.bench.can_cast = self.screen.as_ref().is_none_or(|screen| screen.canvas.can_cast());
        self.keys(ui);
        let dropped: Vec<PathBuf> = ui.input(|i| {
            let files = i.raw.dropped_files.iter();
            files.map(|file| file.path().to_path_buf()).collect()
        });
        for path in dropped {
            self.bench.open(path);
        }
        egui::Panel::top("menu").show(ui, |ui| panels::menu(ui, &mut self.bench));
        egui::Panel::bottom("status").show(ui, |ui| panels::status(ui, &self.bench));
        self.begin_adjust(ui);
        self.begin_arranging(ui);
        self.bench.performance.picture();
        egui::CentralPanel::no_frame().show(ui, |ui| self.docks(ui));
        panels::slices(ui.ctx(), &mut self.bench);
        panels::path_box(ui.ctx(), &mut self.bench);
        panels::written(ui.ctx(), &mut self.bench);
        panels::part(ui.ctx(), &mut self.bench);
        panels::touch(ui.ctx(), &mut self.bench);
        panels::measure(ui.ctx(), &mut self.bench);
        panels::picture(ui.ctx(), &mut self.bench);
        panels::shortcuts(ui.ctx(), &mut self.bench);
        panels::commands(ui.ctx(), &mut self.bench);
        self.bench.tell_tool();
        self.bench.tell_changes();
        let now = Kept {
            mode: self.bench.look.mode,
            show: self.bench.look.show,
            sides: self.bench.sides,
            ignores_pens: self.bench.ignores_pens,
            by_speed: self.bench.by_speed,
            layout: self.layout.clone(),
            theme: Theme::of(ui.ctx()),
        };
        if let Err(why) = self.kept.keep(now, &self.home) {
            self.bench.tell(why, true);
        }
        if self.bench.message().is_some() {
            ui.ctx().request_repaint_after(Duration::from_secs(1));
        }
    }
}

/// Hints are read too: egui's own are too faint for that.
fn style(context: &egui::Context) {
    context.all_styles_mut(|style| style.visuals.weak_text_alpha = 0.85);
    // On white its own warnings are as faint.
    context.style_mut_of(egui::Theme::Light, |style| {
        style.visuals.warn_fg_color = Color32::from_rgb(165, 75, 0);
        style.visuals.error_fg_color = Color32::from_rgb(185, 0, 0);
    });
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

fn wake(context: Arc<Mutex<egui::Context>>, is_listening: Arc<AtomicBool>) -> Wake {
    Arc::new(move |within| {
        if !is_listening.load(Ordering::SeqCst) {
            let context = context.lock().unwrap_or_else(PoisonError::into_inner);
            context.request_repaint_after(within);
        }
    })
}
