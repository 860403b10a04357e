//! What is shown beside the solids: made on a thread of its own, so that neither the window nor the desk waits for it.

mod make;
mod points;

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};

use glam::DVec3;
use tools::paint::Substance;

use self::make::{Done, Made, Wish, stiffness_legend};
use super::Bench;
use super::modeler::Modeler;
use super::orders::{Acting, Order};
use crate::view::{Cells, Histogram, Ink, Legend, Mode, Screen, Tint, floor};

/// What is made there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Layer {
    /// A surface of another density.
    Second,
    /// What colours tell.
    Tint,
    /// Cells of the fit.
    Cells,
    /// Points that were fitted.
    Points,
}

impl Layer {
    const ALL: [Self; 4] = [Self::Second, Self::Tint, Self::Cells, Self::Points];
}

/// What panels know of it.
#[derive(Default)]
pub struct Shown {
    /// Density of the second surface, once it is chosen, and of which object.
    pub second: Option<(String, f64)>,
    /// Densities that it may have.
    pub second_range: Option<[f64; 2]>,
    /// While it is dragged.
    pub second_dragged: Option<f64>,
    /// What was made, in words, or why it was not.
    pub words: BTreeMap<Layer, Result<String, String>>,
    legends: BTreeMap<Layer, Legend>,
    /// What a force tool does now, and the largest force of its stroke.
    pub(super) acting: Option<(Acting, f64)>,
    /// Files that were opened, the newest last.
    scans: RefCell<Vec<PathBuf>>,
}

impl Shown {
    /// Takes what a force tool does now; nothing when its stroke has ended.
    pub(super) fn acts(&mut self, acting: Option<Acting>) {
        let most = self.acting.map_or(0.0, |(_, most)| most);
        self.acting = acting.map(|acting| (acting, most.max(acting.force.length())));
    }

    /// Files that are opened may be scans whose points are asked for later.
    pub(super) fn remember(&self, order: &Order) {
        if let Order::Open(path) = order {
            self.scans.borrow_mut().push(path.clone());
        }
    }
}

/// The thread, once it is needed, and what was asked of it.
#[derive(Default)]
pub struct Beside {
    worker: Option<(Sender<Wish>, Receiver<Done>)>,
    asked: BTreeMap<Layer, Wish>,
    /// Of which scene the floor is.
    floor: Option<(u64, DVec3, f64)>,
}

impl Beside {
    fn ask(&mut self, wish: Wish, context: &egui::Context) {
        let (wishes, _) = self.worker.get_or_insert_with(|| {
            let (wishes, asked) = channel();
            let (tell, done) = channel();
            let context = context.clone();
            std::thread::Builder::new()
                .name("beside".into())
                .spawn(move || make::work(&asked, &tell, &|| context.request_repaint()))
                .expect("the system has threads enough");
            (wishes, done)
        });
        // A thread that has fallen makes nothing more; all else goes on.
        let _ = wishes.send(wish.clone());
        self.asked.insert(wish.layer, wish);
    }
}

impl Bench {
    /// Chooses a density for the second surface of the chosen object, if it has none yet: between that of the first and the end of all
    /// densities that is farther from it.
    fn know_second(&mut self) {
        let sheet = self.sheet.as_ref();
        let Some(thing) = sheet.and_then(|sheet| sheet.objects.get(sheet.chosen)) else {
            return;
        };
        let is_known = matches!(&self.shown.second, Some((name, _)) if *name == thing.name);
        if !is_known {
            let [low, high] = Histogram::new(&*thing.field, &thing.own_box).range;
            let end = if thing.iso - low < high - thing.iso {
                high
            } else {
                low
            };
            let density = thing.iso + 0.35 * (end - thing.iso);
            self.shown.second = Some((thing.name.clone(), density));
            self.shown.second_range = Some([low, high]);
        }
    }

    /// The second surface as volumes show it, at once while it is dragged, as it needs no triangles.
    pub(super) fn second_in_volume(&self) -> Option<(String, f64)> {
        let is_shown = self.look.show.second && self.look.mode == Mode::Volume;
        let (name, density) = self.shown.second.as_ref().filter(|_| is_shown)?;
        Some((name.clone(), self.shown.second_dragged.unwrap_or(*density)))
    }

    /// What is wished of a layer, if it is shown.
    fn wish(&self, layer: Layer, (scene, origin): (u64, DVec3)) -> Option<Wish> {
        let sheet = self.sheet.as_ref()?;
        let show = &self.look.show;
        let chosen = || sheet.objects.get(sheet.chosen).cloned().into_iter().collect();
        let (things, kind, density) = match layer {
            Layer::Second => {
                let (name, density) = self.shown.second.as_ref().filter(|_| show.second)?;
                let of = sheet.objects.iter().filter(|thing| thing.name == *name);
                (of.cloned().collect(), 0, *density)
            }
            Layer::Tint if show.tint == Tint::Off => return None,
            Layer::Tint => (sheet.objects.clone(), show.tint as u8, 0.0),
            Layer::Cells if show.cells == Cells::Off => return None,
            Layer::Cells => (chosen(), u8::from(show.cells == Cells::Error), 0.0),
            Layer::Points if !show.points => return None,
            Layer::Points => (chosen(), 0, 0.0),
        };
        let mut scans = self.shown.scans.borrow().clone();
        scans.extend(sheet.path.parent().map(PathBuf::from));
        Some(Wish {
            layer,
            things,
            kind,
            density,
            most: self.triangles,
            scans,
            scene,
            origin,
        })
    }

    /// What the colours in the scene mean, the lowest first.
    pub(super) fn legends(&self) -> Vec<Legend> {
        let is_stiff = |sheet: &super::orders::Sheet| {
            let painted = |thing: &super::orders::Thing| {
                thing.object.layers.contains_key(&Substance::Stiffness) && !self.hidden.contains(&thing.name)
            };
            sheet.objects.iter().any(painted)
        };
        let is_painted = self.look.paint && self.look.show.tint == Tint::Off;
        let shows_paint = is_painted && self.look.mode != Mode::Volume;
        let stiffness = (shows_paint && self.sheet.as_deref().is_some_and(is_stiff)).then(stiffness_legend);
        stiffness
            .into_iter()
            .chain(self.shown.legends.values().cloned())
            .collect()
    }
}

impl Modeler {
    /// Has all that is shown made, takes what is made, and forgets what is shown no more.
    pub(super) fn beside(&mut self, context: &egui::Context) {
        let canvas = self.screen.as_mut().map(|Screen { canvas, .. }| canvas);
        let scene = canvas
            .as_ref()
            .map_or((0, DVec3::ZERO), |c| (c.scenes(), c.origin()));
        if let Some(canvas) = canvas {
            canvas.hide(&self.bench.hidden);
            let (center, radius) = self.bench.scene;
            let of = (scene.0, center, radius);
            if self.bench.look.show.floor && self.beside.floor != Some(of) {
                let (lines, _) = floor::floor(center, radius, self.bench.look.camera.up, scene.1);
                canvas.put_lines(Ink::Floor, &lines);
                self.beside.floor = Some(of);
            }
        }
        if self.bench.look.show.second {
            self.bench.know_second();
        }
        let second = self.bench.second_in_volume();
        if let Some(Screen { canvas, .. }) = &mut self.screen {
            canvas.put_second(second);
        }
        for layer in Layer::ALL {
            match self.bench.wish(layer, scene) {
                Some(wish)
                    if self
                        .beside
                        .asked
                        .get(&layer)
                        .is_none_or(|asked| !asked.is_like(&wish)) =>
                {
                    self.bench.shown.words.insert(layer, Ok("…".into()));
                    // What was made of another scene is wrong now.
                    let asked = self.beside.asked.get(&layer);
                    if asked.is_some_and(|asked| asked.scene != wish.scene) {
                        self.lay(layer, &Made::Nothing);
                        self.bench.shown.legends.remove(&layer);
                    }
                    self.beside.ask(wish, context);
                }
                Some(_) => {}
                None => {
                    if self.beside.asked.remove(&layer).is_some() {
                        self.lay(layer, &Made::Nothing);
                        self.bench.shown.words.remove(&layer);
                        self.bench.shown.legends.remove(&layer);
                    }
                }
            }
        }
        let done: Vec<Done> = self
            .beside
            .worker
            .iter()
            .flat_map(|(_, done)| done.try_iter())
            .collect();
        for Done { wish, made } in done {
            let is_asked = self.beside.asked.get(&wish.layer);
            if is_asked.is_none_or(|asked| !asked.is_like(&wish)) {
                continue;
            }
            self.bench.shown.legends.remove(&wish.layer);
            let (made, words) = match made {
                Ok((made, legend, words)) => {
                    self.bench
                        .shown
                        .legends
                        .extend(legend.map(|legend| (wish.layer, legend)));
                    (made, Ok(words))
                }
                Err(why) => (Made::Nothing, Err(why)),
            };
            self.lay(wish.layer, &made);
            self.bench.shown.words.insert(wish.layer, words);
        }
    }

    /// Puts what was made of a layer in place of what there was.
    fn lay(&mut self, layer: Layer, made: &Made) {
        let Some(Screen { canvas, .. }) = &mut self.screen else {
            return;
        };
        match (layer, made) {
            (Layer::Second, Made::Patches(patches, within)) => canvas.put_veil(patches, within.as_deref()),
            (Layer::Second, _) => canvas.put_veil(&[], None),
            (Layer::Tint, Made::Tinted(tinted)) => canvas.tint_by(Some(tinted.clone())),
            (Layer::Tint, _) => canvas.tint_by(None),
            (Layer::Cells | Layer::Points, made) => {
                let ink = if layer == Layer::Cells {
                    Ink::Cells
                } else {
                    Ink::Points
                };
                match made {
                    Made::Lines(lines) => canvas.put_lines(ink, lines),
                    _ => canvas.put_lines(ink, &[]),
                }
            }
        }
    }
}
