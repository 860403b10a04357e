//! What a canvas shows beside the solids as they are: other colours, lines, a surface that is looked through; and what it hides.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use eframe::egui_wgpu::wgpu;
use glam::{DVec3, Vec3};

use super::canvas::Canvas;
use super::held::{Held, draw};
use super::look::Look;
use super::overlay::{Ink, Stretch};
use super::shape::Vertex;
use super::target::Target;
use super::{Mode, Patch, read};

/// Shares of a scale, from 0 to 1, at places of an object in the world; below 0 where nothing is known.
pub type Shares = Arc<dyn Fn(&str, &[DVec3]) -> Vec<f32> + Send + Sync>;

/// What colours tell in place of paint.
#[derive(Clone)]
pub struct Tinted(pub Shares);

impl Tinted {
    /// Triangles with shares in place of paint, given their origin.
    pub(super) fn patch(&self, patch: &Patch, origin: DVec3) -> Patch {
        let places: Vec<DVec3> = (patch.vertices.iter())
            .map(|v| origin + Vec3::from(v.at).as_dvec3())
            .collect();
        let shares = (self.0)(&patch.object, &places);
        let vertices = patch.vertices.iter().zip(shares);
        Patch {
            object: patch.object.clone(),
            part: patch.part,
            vertices: vertices.map(|(v, paint)| Vertex { paint, ..*v }).collect(),
            indices: patch.indices.clone(),
            rough: patch.rough.clone(),
            is_open: patch.is_open,
        }
    }
}

/// Triangles of objects that are not hidden, and whose they are.
pub(super) fn visible<'a>(
    held: &'a BTreeMap<(String, [i32; 3]), Held>,
    hidden: &'a BTreeSet<String>,
) -> impl Iterator<Item = (&'a str, &'a Held)> {
    let all = held.iter().map(|((name, _), held)| (name.as_str(), held));
    all.filter(|(name, _)| !hidden.contains(*name))
}

impl Canvas {
    /// How many scenes there were: what was put into one is not in the next.
    pub fn scenes(&self) -> u64 {
        self.scenes
    }

    /// Where the world's place 0 of all triangles is.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Most pixels that a side of a picture may have.
    pub fn most_pixels(&self) -> u32 {
        self.device.limits().max_texture_dimension_2d
    }

    /// As [`pixels`](Self::pixels), but no longer than one call of [`draw`](Self::draw) takes: none until the picture is whole.
    ///
    /// # Errors
    /// That the card is lost or has no memory left.
    pub fn pixels_so_far(&mut self, look: &Look, size: [u32; 2]) -> Result<Option<Vec<u8>>, String> {
        let drawn = self.draw(look, size, false);
        if !drawn.is_done {
            return Ok(None);
        }
        let bytes = read::bytes(&self.device, &self.queue, &drawn.picture)?;
        Ok(Some(
            bytes.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect(),
        ))
    }

    /// Puts lines in place of those that there were.
    pub fn put_lines(&mut self, ink: Ink, stretches: &[Stretch]) {
        self.overlay.put(ink, stretches);
        self.redraw();
    }

    /// Puts a second surface of an object in place of the one that there was: what is looked through, or what is seen within an object.
    /// By rays it is always looked through; volumes have no triangles, and show [theirs](Self::put_second).
    pub fn put_veil(&mut self, patches: &[Patch], within: Option<&str>) {
        let tinted = self.tinted.take();
        self.overlay.veil = patches.iter().map(|patch| self.hold(patch)).collect();
        self.overlay.within = within.map(str::to_owned);
        self.tinted = tinted;
        self.redraw();
    }

    /// Has volumes show the surface of another density in one object, looked through; none if missing.
    pub fn put_second(&mut self, second: Option<(String, f64)>) {
        if self
            .cast
            .as_mut()
            .is_some_and(|cast| cast.rays.show_second(second))
        {
            self.redraw();
        }
    }

    /// Has colours tell something else than paint, or paint again.
    pub fn tint_by(&mut self, tinted: Option<Tinted>) {
        if tinted.is_none() && self.tinted.is_none() {
            return;
        }
        self.tinted = tinted;
        let patches = std::mem::take(&mut self.held).into_iter();
        let held: Vec<_> = patches.map(|(key, held)| (key, self.hold(&held.patch))).collect();
        self.held.extend(held);
        self.redraw();
    }

    /// Draws all objects but these.
    pub fn hide(&mut self, hidden: &BTreeSet<String>) {
        if self.hidden == *hidden {
            return;
        }
        let back: Vec<String> = self.hidden.difference(hidden).cloned().collect();
        for name in hidden.difference(&self.hidden) {
            if let Some(cast) = &mut self.cast
                && let Some(solid) = cast.rays.take(name)
            {
                self.aside.insert(name.clone(), solid);
            }
        }
        self.hidden.clone_from(hidden);
        for name in back {
            if let Some(solid) = self.aside.remove(&name) {
                self.put_solid(&name, solid);
            }
        }
        self.renew();
    }

    /// Triangles that are drawn, and whose they are.
    pub(super) fn visible(&self) -> impl Iterator<Item = (&str, &Held)> {
        visible(&self.held, &self.hidden)
    }

    /// Reads the densities on the cut, where triangles are cut.
    pub(super) fn prepare_caps(&mut self, look: &Look, is_rough: bool) {
        let (Some(plane), Some(cast)) = (look.cut, &self.cast) else {
            self.overlay.caps.clear();
            return;
        };
        let card = (&self.device, &self.queue);
        let solids = cast.rays.solids();
        self.overlay
            .caps
            .prepare(card, solids, plane, self.origin, is_rough);
    }

    /// Whether triangles carry paint that a look shows.
    pub(super) fn is_painted(&self, look: &Look) -> bool {
        self.paint_of(look) > 0.0 && self.visible().any(|(_, held)| held.is_painted)
    }

    /// Draws the paint of triangles alone.
    pub(super) fn paint_alone(&self, target: &Target, look: &Look) {
        self.tell(look, target.size);
        let mut encoder = self
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let textures = [&target.picture, &target.depth];
            let clear = wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT);
            let mut pass = self.pass(&mut encoder, textures, clear, wgpu::LoadOp::Clear(1.0));
            pass.set_pipeline(&self.overlay.brushes(0, 1).paint);
            let all = self.visible().map(|(_, held)| held);
            draw(all, |held| held.seen(0), &mut pass, 0);
        }
        self.queue.submit([encoder.finish()]);
    }

    /// Draws what is looked through over a picture of one sample a pixel.
    pub(super) fn veil_over(&self, [picture, depth]: [&wgpu::Texture; 2], look: &Look) {
        if look.mode != Mode::Rays || !self.overlay.has_veil(look) {
            return;
        }
        let mut encoder = self
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let load = wgpu::LoadOp::Load;
            let mut pass = self.pass(&mut encoder, [picture, depth], load, wgpu::LoadOp::Load);
            self.overlay
                .draw_veil(&mut pass, self.overlay.brushes(0, 1), self.overlay.veil.iter());
        }
        self.queue.submit([encoder.finish()]);
    }

    fn pass<'a>(
        &self,
        encoder: &'a mut wgpu::CommandEncoder,
        [picture, depth]: [&wgpu::Texture; 2],
        load: wgpu::LoadOp<wgpu::Color>,
        load_depth: wgpu::LoadOp<f32>,
    ) -> wgpu::RenderPass<'a> {
        let [picture, depth] =
            [picture, depth].map(|t| t.create_view(&wgpu::TextureViewDescriptor::default()));
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("beside"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &picture,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load,
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &depth,
                depth_ops: Some(wgpu::Operations {
                    load: load_depth,
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            ..wgpu::RenderPassDescriptor::default()
        });
        pass.set_bind_group(0, &self.bindings, &[]);
        pass
    }
}
