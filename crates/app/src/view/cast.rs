//! Pictures by lines: behind all what triangles show, then row by row what lines meet, then once more what differs from pixel to pixel.

use std::cell::OnceCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use eframe::egui_wgpu::wgpu;

use super::canvas::Canvas;
use super::look::{Look, Mode};
use super::rays::{Eye, Pass, Passes, Prepared, Rays};
use super::target::{Drawn, Target};

/// Time from one strip of rows to the next, ms, that of the panels included: as long as the window may be without an answer.
const STRIP: f64 = 200.0;
/// Rows of the first, and the fewest and the most.
const ROWS: u32 = 48;
const LEAST: u32 = 4;
const MOST: u32 = 4096;
/// Time from one picture to the next while something moves, ms, that of the panels included, and the shares of the pixels of a side that it may have.
const MOVING: f64 = 160.0;
const SHARES: [f32; 4] = [0.5, 0.34, 0.25, 0.18];

/// Solids, and pictures of them that are under way.
pub struct Cast {
    pub rays: Rays,
    layouts: [wgpu::BindGroupLayout; 2],
    /// Made when they are needed first.
    passes: OnceCell<Passes>,
    /// Whole and rough ones.
    sheets: [Option<Sheet>; 2],
    strip: Clock,
    rows: u32,
    /// Time for a million pixels of a rough picture, ms.
    rough: Clock,
    rough_pixels: f64,
}

/// A picture that is under way.
struct Sheet {
    ground: Target,
    first: Target,
    last: Target,
    /// What is painted on triangles, if anything is.
    paints: Option<Target>,
    /// For the first look and the second.
    bindings: [wgpu::BindGroup; 2],
    look: Option<Look>,
    stage: Stage,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// So many rows have a first look.
    First(u32),
    /// So many a second one.
    Second(u32),
    Done,
}

/// How long it was from what the card was told last until that was done, as the next look at the card finds it.
struct Clock {
    micros: Arc<AtomicU64>,
}

/// Of a clock while the card is at work.
const AT_WORK: u64 = u64::MAX;

impl Clock {
    fn new() -> Self {
        Self {
            micros: Arc::new(AtomicU64::new(0)),
        }
    }

    /// Begins with what the queue was told just now.
    fn start(&self, queue: &wgpu::Queue) {
        let (start, micros) = (Instant::now(), self.micros.clone());
        micros.store(AT_WORK, Ordering::Relaxed);
        queue.on_submitted_work_done(move || {
            micros.store(start.elapsed().as_micros() as u64, Ordering::Relaxed);
        });
    }

    /// None while the card is at work.
    fn millis(&self) -> Option<f64> {
        let micros = self.micros.load(Ordering::Relaxed);
        (micros != AT_WORK).then_some(micros as f64 / 1e3)
    }
}

impl Cast {
    pub fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        layouts: [wgpu::BindGroupLayout; 2],
        budget: u64,
    ) -> Self {
        Self {
            rays: Rays::new(device, queue, budget),
            layouts,
            passes: OnceCell::new(),
            sheets: [None, None],
            strip: Clock::new(),
            rows: ROWS,
            rough: Clock::new(),
            rough_pixels: 0.0,
        }
    }

    /// What was drawn is old.
    pub fn renew(&mut self) {
        self.sheets
            .iter_mut()
            .flatten()
            .for_each(|sheet| sheet.look = None);
    }

    /// Depths of the rough picture.
    #[cfg(test)]
    pub fn depth(&self) -> Option<&wgpu::Texture> {
        Some(&self.sheets[1].as_ref()?.first.depth)
    }

    /// Share of the pixels of a side for pictures while something moves, in a window of so many.
    pub fn rough_share(&self, pixels: f64) -> f32 {
        let Some(millis) = self
            .rough
            .millis()
            .filter(|ms| *ms > 0.0 && self.rough_pixels > 0.0)
        else {
            return SHARES[2];
        };
        let of_pixel = millis / self.rough_pixels;
        let fits = |share: &f32| f64::from(share * share) * pixels * of_pixel < MOVING;
        SHARES.into_iter().find(fits).unwrap_or(SHARES[SHARES.len() - 1])
    }
}

impl Canvas {
    /// [`draw`](Canvas::draw) by lines.
    pub(super) fn draw_by_lines(
        &mut self,
        mut cast: Box<Cast>,
        look: &Look,
        size: [u32; 2],
        is_rough: bool,
    ) -> Drawn {
        let prepared = cast.rays.prepare(look, self.origin, !is_rough);
        if prepared != Prepared::AsBefore {
            cast.renew();
        }
        let passes = cast
            .passes
            .get_or_init(|| Passes::new(&self.device, cast.layouts.clone()));
        let which = usize::from(is_rough);
        let mut sheet = match cast.sheets[which].take() {
            Some(sheet) if sheet.first.size == size => sheet,
            _ => self.new_sheet(passes, size),
        };
        let is_lit = !is_rough && look.cut.is_none() && look.mode == Mode::Rays;
        if sheet.look != Some(*look) {
            self.paint(&sheet.ground, look, 0, is_lit, |name| !cast.rays.holds(name));
            self.paint_sheet(passes, &mut sheet, look);
            (sheet.look, sheet.stage) = (Some(*look), Stage::First(0));
        }
        let was_done = sheet.stage == Stage::Done;
        // A whole picture waits until all is there.
        let is_ready = is_rough || prepared != Prepared::Begun;
        if is_ready && sheet.stage != Stage::Done {
            let clock = if is_rough { &cast.rough } else { &cast.strip };
            match clock.millis() {
                _ if is_rough => {
                    self.strip(&cast.rays, passes, &mut sheet, is_lit, None);
                    sheet.stage = Stage::Done;
                    cast.rough_pixels = f64::from(size[0]) * f64::from(size[1]);
                    clock.start(&self.queue);
                }
                Some(millis) => {
                    if millis > 0.0 {
                        let more = (STRIP / millis).clamp(0.25, 2.0);
                        cast.rows = ((f64::from(cast.rows) * more) as u32).clamp(LEAST, MOST);
                    }
                    self.strip(&cast.rays, passes, &mut sheet, is_lit, Some(cast.rows));
                    clock.start(&self.queue);
                }
                None => {}
            }
        }
        if !was_done && sheet.stage == Stage::Done {
            let drawn = if is_rough { &sheet.first } else { &sheet.last };
            self.veil_over([&drawn.picture, &sheet.first.depth], look);
        }
        let rows = match sheet.stage {
            Stage::First(rows) => rows as f32 / size[1] as f32,
            _ => 1.0,
        };
        // The second look begins with what the first left, and has nothing to show before.
        let is_first = is_rough
            || look.mode == Mode::Volume
            || matches!(sheet.stage, Stage::First(_) | Stage::Second(0));
        let drawn = Drawn {
            picture: if is_first { &sheet.first } else { &sheet.last }.picture.clone(),
            rows,
            is_done: sheet.stage == Stage::Done && prepared != Prepared::Begun,
        };
        cast.sheets[which] = Some(sheet);
        self.cast = Some(cast);
        drawn
    }

    fn new_sheet(&self, passes: &Passes, size: [u32; 2]) -> Sheet {
        let [ground, first, last] = std::array::from_fn(|_| Target::new(&self.device, size, 1));
        let bindings = bindings(passes, [&ground, &first], None);
        Sheet {
            ground,
            first,
            last,
            paints: None,
            bindings,
            look: None,
            stage: Stage::First(0),
        }
    }

    /// Has lines find the paint of triangles, if a look shows any.
    fn paint_sheet(&self, passes: &Passes, sheet: &mut Sheet, look: &Look) {
        if look.mode != Mode::Rays || !self.is_painted(look) {
            if sheet.paints.take().is_some() {
                sheet.bindings = bindings(passes, [&sheet.ground, &sheet.first], None);
            }
            return;
        }
        if sheet.paints.is_none() {
            let paints = Target::new(&self.device, sheet.first.size, 1);
            sheet.bindings = bindings(passes, [&sheet.ground, &sheet.first], Some(&paints));
            sheet.paints = Some(paints);
        }
        if let Some(paints) = &sheet.paints {
            self.paint_alone(paints, look);
        }
    }

    /// Draws the next rows of a whole picture, or all of a rough one.
    fn strip(&mut self, rays: &Rays, passes: &Passes, sheet: &mut Sheet, is_lit: bool, rows: Option<u32>) {
        let (Some(look), Some(solids)) = (sheet.look, rays.bindings(passes)) else {
            return;
        };
        let size = sheet.first.size;
        // A whole picture may have room for all rows at once; it is no rougher for that.
        let (is_rough, rows) = (rows.is_none(), rows.unwrap_or(size[1]));
        self.tell(&look, size);
        let eye = Eye::new(&look, size, rays.count(), self.origin, self.radius, is_rough);
        passes.tell(&self.queue, &eye);
        let (start, is_again) = match sheet.stage {
            Stage::First(start) => (start, false),
            Stage::Second(start) => (start, true),
            Stage::Done => return,
        };
        let pass = match look.mode {
            Mode::Volume => Pass::Volume,
            _ => Pass::Surface { is_lit, is_again },
        };
        let end = (start + rows).min(size[1]);
        let mut encoder = self
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        if is_again && start == 0 {
            let [from, to] = [&sheet.first, &sheet.last].map(|target| target.picture.as_image_copy());
            encoder.copy_texture_to_texture(from, to, sheet.first.picture.size());
        }
        {
            let target = if is_again { &sheet.last } else { &sheet.first };
            let [picture, depth] = [&target.picture, &target.depth]
                .map(|texture| texture.create_view(&wgpu::TextureViewDescriptor::default()));
            let has_depth = matches!(pass, Pass::Surface { is_again: false, .. });
            let mut drawn = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("rays"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &picture,
                    depth_slice: None,
                    resolve_target: None,
                    ops: KEPT,
                })],
                depth_stencil_attachment: has_depth.then_some(wgpu::RenderPassDepthStencilAttachment {
                    view: &depth,
                    depth_ops: Some(wgpu::Operations {
                        load: wgpu::LoadOp::Load,
                        store: wgpu::StoreOp::Store,
                    }),
                    stencil_ops: None,
                }),
                ..wgpu::RenderPassDescriptor::default()
            });
            drawn.set_pipeline(passes.pipeline(pass));
            drawn.set_bind_group(0, &self.bindings, &[]);
            drawn.set_bind_group(1, &self.lights.bindings, &[]);
            drawn.set_bind_group(2, &solids, &[]);
            drawn.set_bind_group(3, &sheet.bindings[usize::from(is_again)], &[]);
            drawn.set_scissor_rect(0, start, size[0], end - start);
            drawn.draw(0..3, 0..1);
        }
        self.queue.submit([encoder.finish()]);
        sheet.stage = match (end == size[1], is_again || look.mode == Mode::Volume) {
            (true, true) => Stage::Done,
            (true, false) => Stage::Second(0),
            (false, _) if is_again => Stage::Second(end),
            (false, _) => Stage::First(end),
        };
    }
}

/// What is drawn before the first look and before the second, with paint, if there is some.
fn bindings(passes: &Passes, [ground, first]: [&Target; 2], paints: Option<&Target>) -> [wgpu::BindGroup; 2] {
    let paints = paints.map_or(passes.nothing(), |paints| &paints.picture);
    [ground, first].map(|before| passes.ground([&ground.picture, &ground.depth, &before.picture, paints]))
}

const KEPT: wgpu::Operations<wgpu::Color> = wgpu::Operations {
    load: wgpu::LoadOp::Load,
    store: wgpu::StoreOp::Store,
};
