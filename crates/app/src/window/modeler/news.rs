//! What the desk tells.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::Modeler;
use crate::panels;
use crate::view::Screen;
use crate::window::orders::News;

/// Longest time that a picture waits for the desk. A dab takes 7 to 14 ms, more on a busy machine; a picture without a graphics card 40.
const MEETING: Duration = Duration::from_millis(30);

impl Modeler {
    /// Takes what the desk told.
    pub(super) fn hear(&mut self) {
        while let Ok(news) = self.news.try_recv() {
            self.take(news);
        }
        let canvas = self.screen.as_ref().map(|s| &s.canvas);
        self.bench.triangles = canvas.map_or(0, |canvas| canvas.triangles());
        self.bench.performance.meshes = canvas.map_or(0, |canvas| canvas.mesh_bytes());
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
            News::Acting(acting) => self.bench.shown.acts(acting),
            News::Hide(name) => drop(self.bench.hidden.insert(name)),
            News::Touched(rate) => self.bench.performance.touched(rate),
            News::Step(seconds) => self.bench.performance.step(seconds),
            News::Written(path, told) => self.bench.written = panels::Written::of(path, &told),
            News::Moved(step) => self.bench.performance.moved(step),
            News::Note(text) => self.bench.tell(text, false),
            News::Failed(text) => self.bench.tell(text, true),
        }
    }

    /// Waits a little for what the desk makes of a stroke: else the next picture would show it, not this one.
    pub(super) fn meet_desk(&mut self) {
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
}
