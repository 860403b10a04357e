//! Pictures of the scene in the window.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use eframe::egui_wgpu::{RenderState, wgpu};

use super::canvas::Drawn;
use super::{Canvas, Look};
use crate::cli::ceiling::of_bricks;

/// Lights in the sky: more take longer than a picture should.
pub const SKY: usize = 16;

/// A picture that egui shows: see [`Drawn`].
pub struct Shown {
    /// As egui knows it.
    pub picture: egui::TextureId,
    /// Share of its rows, from the top, that are drawn.
    pub rows: f32,
    /// Whether it stays as it is.
    pub is_done: bool,
}

/// A canvas whose pictures egui shows.
pub struct Screen {
    /// What draws them.
    pub canvas: Canvas,
    state: RenderState,
    is_lost: Arc<AtomicBool>,
    /// Whole and rough pictures, as egui knows them.
    shown: [Option<(wgpu::Texture, egui::TextureId)>; 2],
}

impl Screen {
    /// On the card that egui uses.
    pub fn new(state: RenderState) -> Self {
        let is_lost = Arc::new(AtomicBool::new(false));
        let told = is_lost.clone();
        state.device.set_device_lost_callback(move |_, _| {
            told.store(true, Ordering::Relaxed);
        });
        Self {
            is_lost,
            canvas: Canvas::new(&state.device, &state.queue, SKY, of_bricks()),
            state,
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
        let _ = self.state.device.poll(poll);
        self.is_lost.load(Ordering::Relaxed)
    }

    /// As [`Canvas::draw`].
    pub fn draw(&mut self, look: &Look, size: [u32; 2], is_rough: bool) -> Shown {
        let Drawn {
            picture,
            rows,
            is_done,
        } = self.canvas.draw(look, size, is_rough);
        let picture = self.known(picture, is_rough);
        Shown {
            picture,
            rows,
            is_done,
        }
    }

    /// A picture, as egui knows it.
    fn known(&mut self, picture: wgpu::Texture, is_rough: bool) -> egui::TextureId {
        let shown = &mut self.shown[usize::from(is_rough)];
        if let Some((texture, id)) = shown
            && *texture == picture
        {
            return *id;
        }
        // egui takes pictures as the screen wants them.
        let view = picture.create_view(&wgpu::TextureViewDescriptor {
            format: Some(wgpu::TextureFormat::Rgba8Unorm),
            ..wgpu::TextureViewDescriptor::default()
        });
        let mut renderer = self.state.renderer.write();
        if let Some((_, old)) = shown.take() {
            renderer.free_texture(&old);
        }
        let id = renderer.register_native_texture(&self.state.device, &view, wgpu::FilterMode::Linear);
        *shown = Some((picture, id));
        id
    }
}
