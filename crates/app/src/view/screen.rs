//! Pictures of the scene in the window.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use eframe::egui_wgpu::{RenderState, wgpu};

use super::laid::{Laid, Layer};
use super::stereo::Eyes;
use super::target::Drawn;
use super::{Budget, Canvas, Look};
use crate::cli::ceiling::of_bricks;

/// Lights in the sky: more take longer than a picture should.
pub const SKY: usize = 16;

/// A picture for the window: see [`Drawn`].
pub struct Shown {
    /// The pixels.
    pub picture: Laid,
    /// Share of its rows, from the top, that are drawn.
    pub rows: f32,
    /// Whether it stays as it is.
    pub is_done: bool,
}

/// A canvas whose pictures the window shows.
pub struct Screen {
    /// What draws them.
    pub canvas: Canvas,
    /// Most triangles of a scene.
    pub triangles: Budget,
    device: wgpu::Device,
    is_lost: Arc<AtomicBool>,
    layer: Layer,
    eyes: Eyes,
    /// Whole and rough pictures.
    shown: [Option<(wgpu::Texture, Laid)>; 2],
}

impl Screen {
    /// On the card that egui uses.
    pub fn new(state: &RenderState) -> Self {
        let is_lost = Arc::new(AtomicBool::new(false));
        let told = is_lost.clone();
        state.device.set_device_lost_callback(move |_, _| {
            told.store(true, Ordering::Relaxed);
        });
        let triangles = match state.adapter.get_info().device_type {
            wgpu::DeviceType::Cpu => Budget::PROCESSOR,
            _ => Budget::CARD,
        };
        Self {
            is_lost,
            triangles,
            canvas: Canvas::new(&state.device, &state.queue, SKY, of_bricks()),
            device: state.device.clone(),
            layer: Layer::new(&state.device, state.target_format),
            eyes: Eyes::default(),
            shown: [None, None],
        }
    }

    /// Whether the card is lost. `waits` until it has done what it was told, without which it may not know yet.
    pub fn is_lost(&self, waits: bool) -> bool {
        let poll = match waits {
            true => wgpu::PollType::wait_indefinitely(),
            false => wgpu::PollType::Poll,
        };
        // That it fails is told by the callback.
        let _ = self.device.poll(poll);
        self.is_lost.load(Ordering::Relaxed)
    }

    /// As [`Canvas::draw`], for each eye if that is wished.
    pub fn draw(&mut self, look: &Look, size: [u32; 2], is_rough: bool) -> Shown {
        let Drawn {
            picture,
            rows,
            is_done,
        } = self.eyes.draw(&mut self.canvas, look, size, is_rough);
        let shown = &mut self.shown[usize::from(is_rough)];
        let laid = match shown.take() {
            Some((texture, laid)) if texture == picture => laid,
            _ => self.layer.laid(&self.device, &picture),
        };
        Shown {
            picture: shown.insert((picture, laid)).1.clone(),
            rows,
            is_done,
        }
    }
}
