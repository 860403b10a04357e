//! The graphics card: triangles in, a picture out.

use std::collections::{BTreeMap, BTreeSet};

use bytemuck::{Pod, Zeroable};
use eframe::egui_wgpu::wgpu;
use glam::{DMat4, DVec3};

use super::beside::{Tinted, visible};
use super::brush::Brush;
use super::cast::Cast;
use super::held::{Held, draw};
use super::light_pass::LightPass;
use super::lights::{self, Lights};
use super::look::{Look, Mode};
use super::overlay::Overlay;
use super::rays::Solid;
use super::read;
use super::shape::Patch;
use super::target::{Drawn, SAMPLES, Target};
use super::{Camera, Tint};

/// Share of the pixels of a side that are drawn of triangles while something moves.
const ROUGH: f32 = 0.5;

/// See `shaders/surface.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Scene {
    clip_from_world: [[f32; 4]; 4],
    axes: [[f32; 4]; 4],
    cut_at: [f32; 4],
    cut_normal: [f32; 4],
    shows: [f32; 4],
    paper: [[f32; 4]; 2],
    picture: [f32; 4],
    density: [f32; 4],
    world_from_clip: [[f32; 4]; 4],
}

/// The graphics card with what it holds of a scene.
pub struct Canvas {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    scene: wgpu::Buffer,
    /// Maps of all lights.
    maps: wgpu::Buffer,
    pub(super) bindings: wgpu::BindGroup,
    pub(super) lights: Lights,
    light_pass: LightPass,
    /// For one sample, and for [`SAMPLES`].
    brushes: [Brush; 2],
    pub(super) held: BTreeMap<(String, [i32; 3]), Held>,
    /// What is drawn besides.
    pub(super) overlay: Overlay,
    /// What colours tell in place of paint.
    pub(super) tinted: Option<Tinted>,
    /// Objects that are not drawn, and what they are without triangles.
    pub(super) hidden: BTreeSet<String>,
    pub(super) aside: BTreeMap<String, Solid>,
    /// How many scenes there were.
    pub(super) scenes: u64,
    /// How often what is drawn became another.
    pub(super) changes: u64,
    /// What throws shadows in place of these.
    shades: Option<Held>,
    /// The same.
    targets: [Option<Target>; 2],
    /// The origin of the triangles in the world, and the size of all of them.
    pub(super) origin: DVec3,
    pub(super) radius: f64,
    /// What draws without triangles; none where the card cannot.
    pub(super) cast: Option<Box<Cast>>,
}

impl Canvas {
    /// On a card. Whole pictures have so many lights in the sky; bricks of splines take so many bytes at most.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, sky: usize, bricks: u64) -> Self {
        let shader = device.create_shader_module(wgpu::include_wgsl!("../../../../shaders/surface.wgsl"));
        let buffer = |label, size| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let scene = buffer("scene", size_of::<Scene>());
        let maps = buffer("lights", 5 * (lights::MOST + 1) * size_of::<[f32; 4]>());
        let entry = |binding| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("scene"),
            entries: &[entry(0), entry(1)],
        });
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("scene"),
            layout: &layout,
            entries: &[(0, &scene), (1, &maps)].map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            }),
        });
        let looked_up = Lights::layout(device);
        // As many as `shaders/rays.wgsl` reads.
        let can_cast = device.limits().max_storage_buffers_per_shader_stage >= 3;
        let layouts = [layout.clone(), looked_up.clone()];
        let light_pass = LightPass::new(device, layouts.clone());
        let lit = light_pass.layout();
        Self {
            cast: can_cast.then(|| Box::new(Cast::new(device, queue, layouts, bricks))),
            brushes: [1, SAMPLES].map(|n| Brush::new(device, &shader, [&layout, lit], n)),
            overlay: Overlay::new(device, [layout.clone(), lit.clone()]),
            light_pass,
            tinted: None,
            hidden: BTreeSet::new(),
            aside: BTreeMap::new(),
            scenes: 0,
            changes: 0,
            lights: Lights::new(device, [&layout, &looked_up], &shader, sky),
            scene,
            maps,
            bindings,
            held: BTreeMap::new(),
            shades: None,
            targets: [None, None],
            origin: DVec3::ZERO,
            radius: 1.0,
            device: device.clone(),
            queue: queue.clone(),
        }
    }

    /// What was drawn is old.
    pub(super) fn renew(&mut self) {
        self.lights.renew();
        self.redraw();
    }

    /// The same, but light falls as before.
    pub(super) fn redraw(&mut self) {
        self.changes += 1;
        self.targets.iter_mut().flatten().for_each(|t| t.drawn = None);
        self.cast.iter_mut().for_each(|cast| cast.renew());
    }

    /// Whether it can draw without triangles.
    pub fn can_cast(&self) -> bool {
        self.cast.is_some()
    }

    /// Share of the pixels of a side for pictures while something moves, of so many in all.
    pub fn rough_share(&self, mode: Mode, pixels: f64) -> f32 {
        match &self.cast {
            Some(cast) if mode != Mode::Mesh => cast.rough_share(pixels),
            _ => ROUGH,
        }
    }

    /// Whether all that was drawn without triangles is as fine as it is.
    #[cfg(test)]
    pub fn is_whole(&self) -> bool {
        self.cast.as_ref().is_some_and(|cast| cast.rays.is_whole())
    }

    /// Puts a spline in place of the one that an object was, to be drawn without triangles.
    pub fn put_solid(&mut self, object: &str, solid: Solid) {
        if self.hidden.contains(object) {
            self.aside.insert(object.into(), solid);
            return;
        }
        if let Some(cast) = &mut self.cast
            && cast.rays.put(object, solid)
        {
            cast.renew();
            self.changes += 1;
            if self.overlay.caps.forget(object) {
                self.redraw();
            }
        }
    }

    /// Forgets all triangles: those that come next lie about another origin.
    pub fn begin(&mut self, origin: DVec3, radius: f64) {
        (self.origin, self.radius) = (origin, radius);
        self.held.clear();
        self.overlay.clear();
        self.aside.clear();
        self.scenes += 1;
        self.cast.iter_mut().for_each(|cast| cast.rays.clear());
        self.renew();
    }

    /// Forgets those of an object.
    pub fn forget(&mut self, object: &str) {
        self.held.retain(|(name, _), _| name != object);
        self.aside.remove(object);
        self.overlay.caps.forget(object);
        self.cast.iter_mut().for_each(|cast| cast.rays.forget(object));
        self.renew();
    }

    /// Puts triangles in place of those that there were.
    pub fn put(&mut self, patch: &Patch) {
        let key = (patch.object.clone(), patch.part);
        let held = (!patch.vertices.is_empty()).then(|| self.hold(patch));
        held.iter().for_each(|held| self.lights.touch(held.within));
        let before = match held {
            None => self.held.remove(&key),
            Some(held) => self.held.insert(key, held),
        };
        before.iter().for_each(|held| self.lights.touch(held.within));
        self.redraw();
    }

    /// Has other triangles throw the shadows.
    pub fn shade_by(&mut self, patch: &Patch) {
        self.shades = Some(self.hold(patch));
        self.renew();
    }

    pub(super) fn hold(&self, patch: &Patch) -> Held {
        let tinted = self
            .tinted
            .as_ref()
            .map(|tinted| tinted.patch(patch, self.origin));
        Held::new(&self.device, patch, tinted.as_ref())
    }

    /// Triangles that it holds.
    pub fn triangles(&self) -> usize {
        self.held.values().map(Held::triangles).sum()
    }

    /// Bytes of them.
    pub fn mesh_bytes(&self) -> u64 {
        self.held.values().map(Held::bytes).sum()
    }

    /// A picture of so many pixels: rough while something moves. It is drawn anew only if it would be another. Without triangles a whole
    /// one takes several calls, each for some of its rows.
    pub fn draw(&mut self, look: &Look, size: [u32; 2], is_rough: bool) -> Drawn {
        let most = self.device.limits().max_texture_dimension_2d;
        let size = size.map(|n| n.clamp(1, most));
        if look.mode != Mode::Mesh
            && let Some(cast) = self.cast.take()
        {
            return self.draw_by_lines(cast, look, size, is_rough);
        }
        let which = usize::from(!is_rough);
        let target = match self.targets[which].take() {
            Some(target) if target.size == size => target,
            _ => Target::new(&self.device, size, if is_rough { 1 } else { SAMPLES }),
        };
        if target.drawn != Some(*look) {
            self.prepare_caps(look, is_rough);
            // What is cut off would still throw its shadow.
            let is_lit = !is_rough && look.cut.is_none();
            self.paint(&target, look, which, is_lit, |_| true);
            if !is_rough {
                self.held.values_mut().for_each(Held::was_seen);
            }
        }
        let target = Target {
            drawn: Some(*look),
            ..target
        };
        Drawn {
            picture: self.targets[which].insert(target).picture.clone(),
            rows: 1.0,
            is_done: true,
        }
    }

    /// Tells the card of a look, and where its lights stand.
    pub(super) fn tell(&self, look: &Look, size: [u32; 2]) {
        let scene = self.scene_of(look, size);
        self.queue
            .write_buffer(&self.scene, 0, bytemuck::bytes_of(&scene));
        let maps = self.lights.maps(look.camera.axes(), self.radius);
        self.queue
            .write_buffer(&self.maps, 0, bytemuck::cast_slice(&maps));
    }

    /// Draws the triangles of those objects that are `shown`; in the light that reaches them if `is_lit`.
    pub(super) fn paint(
        &mut self,
        target: &Target,
        look: &Look,
        which: usize,
        is_lit: bool,
        shown: impl Fn(&str) -> bool,
    ) {
        // What is looked through would still throw its shadow.
        let is_lit = is_lit && self.overlay.around(look).is_none();
        if is_lit {
            self.light_pass.fit(target.size);
        }
        let brush = &self.brushes[which];
        self.tell(look, target.size);
        let is_shared = self.paint_of(look) > 1.0;
        let around = self.overlay.around(look);
        let is_besides = is_shared || self.overlay.is_shown(look);
        let besides = is_besides.then(|| self.overlay.brushes(which, [1, SAMPLES][which]));
        let mut encoder = self
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        if is_lit {
            let triangles: Vec<&Held> = match &self.shades {
                Some(shades) => vec![shades],
                None => visible(&self.held, &self.hidden).map(|(_, held)| held).collect(),
            };
            let eye = (look.camera.axes(), self.radius);
            self.lights.draw(&mut encoder, &self.bindings, eye, &triangles);
        }
        let shown = self.visible().filter(|(name, _)| shown(name));
        let mut shown: Vec<&Held> = shown.map(|(_, held)| held).collect();
        // What comes first hides what is behind it before that is coloured.
        let [_, _, back] = look.camera.axes();
        let nearness = |held: &&Held| held.within.center().dot(back);
        shown.sort_by(|a, b| nearness(b).total_cmp(&nearness(a)));
        if is_lit {
            let from = [&self.bindings, &self.lights.bindings];
            self.light_pass.draw(&mut encoder, from, |pass| {
                draw(shown.iter().copied(), Held::coarse, pass, 0);
            });
        }
        let picture = target
            .picture
            .create_view(&wgpu::TextureViewDescriptor::default());
        let (view, resolve_target) = match &target.rough {
            Some(rough) => (rough, Some(&picture)),
            None => (&picture, None),
        };
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("scene"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view,
                    depth_slice: None,
                    resolve_target,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &target.depth.create_view(&wgpu::TextureViewDescriptor::default()),
                    depth_ops: Some(wgpu::Operations {
                        load: wgpu::LoadOp::Clear(1.0),
                        store: wgpu::StoreOp::Store,
                    }),
                    stencil_ops: None,
                }),
                ..wgpu::RenderPassDescriptor::default()
            });
            pass.set_bind_group(0, &self.bindings, &[]);
            let [surface, front, lit] = match besides.filter(|_| is_shared) {
                Some(brushes) => brushes.shared.each_ref(),
                None => [&brush.surface, &brush.front, &brush.lit],
            };
            let shows_insides = self.shows_insides(&look.camera);
            let hides_backs = look.cut.is_none() && around.is_none() && !shows_insides;
            pass.set_pipeline(if is_lit {
                lit
            } else if hides_backs {
                front
            } else {
                surface
            });
            if let Some(light) = self.light_pass.bindings().filter(|_| is_lit) {
                pass.set_bind_group(1, light, &[]);
            }
            let (veiled, bare): (Vec<&Held>, Vec<&Held>) =
                shown.iter().partition(|held| around == Some(&held.patch.object));
            let seen = |held: &Held| held.seen(which);
            draw(bare, seen, &mut pass, 0);
            if around.is_some() {
                draw(&self.overlay.veil, seen, &mut pass, 0);
            }
            if is_lit && shows_insides {
                pass.set_pipeline(&brush.inside);
                draw(shown.iter().copied(), Held::coarse, &mut pass, 0);
            }
            pass.set_pipeline(&brush.paper);
            pass.draw(0..3, 0..1);
            if let Some(brushes) = besides {
                self.overlay.draw(&mut pass, brushes, look, shown.iter().copied());
                // Lines come before it, and hide it.
                if self.overlay.has_veil(look) && look.mode != Mode::Rays {
                    let own = self.overlay.veil.iter().filter(|_| around.is_none());
                    let veil = own.chain(veiled.iter().copied());
                    self.overlay.draw_veil(&mut pass, brushes, veil);
                }
            }
        }
        self.queue.submit([encoder.finish()]);
    }

    /// How far all that is drawn reaches from what a camera goes round.
    fn reach(&self, camera: &Camera) -> f64 {
        self.radius + camera.center.distance(self.origin)
    }

    /// Whether a camera may see the backs of triangles: of open meshes, and of a solid that the eye may be in.
    fn shows_insides(&self, camera: &Camera) -> bool {
        let is_within = camera.perspective && camera.distance() < self.reach(camera);
        is_within || self.visible().any(|(_, held)| held.patch.is_open)
    }

    fn scene_of(&self, look: &Look, size: [u32; 2]) -> Scene {
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let camera = &look.camera;
        let reach = self.reach(camera);
        let columns = |m: DMat4| m.as_mat4().to_cols_array_2d();
        let clip_from_world = camera.clip_from_world(self.origin, reach, aspect);
        let [right, up, back] = camera.axes().map(|axis| axis.extend(0.0));
        let (cut_at, cut_normal) = look.cut.unwrap_or((DVec3::ZERO, DVec3::ZERO));
        let has_cut = f64::from(u8::from(look.cut.is_some()));
        Scene {
            clip_from_world: columns(clip_from_world),
            axes: columns(DMat4::from_cols(right, up, back, glam::DVec4::W)),
            cut_at: (cut_at - self.origin).extend(0.0).as_vec4().to_array(),
            cut_normal: cut_normal.extend(has_cut).as_vec4().to_array(),
            shows: [
                self.paint_of(look),
                self.lights.count as f32,
                self.radius as f32,
                0.0,
            ],
            paper: look.paper.light(),
            picture: [
                size[0] as f32,
                size[1] as f32,
                (look.line * size[1] as f32).max(1.0),
                (camera.height / f64::from(size[1])) as f32,
            ],
            density: [look.density[0] as f32, look.density[1] as f32, 0.0, 0.0],
            world_from_clip: columns(clip_from_world.inverse()),
        }
    }

    /// What paint is to shaders.
    pub(super) fn paint_of(&self, look: &Look) -> f32 {
        match look.show.tint {
            Tint::Off if look.paint => 1.0,
            Tint::Off => 0.0,
            _ if self.tinted.is_some() => 2.0,
            _ => 0.0,
        }
    }

    /// A picture as [`draw`](Self::draw) draws it: red, green, blue, rows from the top.
    ///
    /// # Errors
    /// That the card is lost or has no memory left.
    pub fn pixels(&mut self, look: &Look, size: [u32; 2], is_rough: bool) -> Result<Vec<u8>, String> {
        let picture = self.draw_all(look, size, is_rough);
        let bytes = read::bytes(&self.device, &self.queue, &picture)?;
        Ok(bytes.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect())
    }

    /// As [`draw`](Self::draw), until it is done.
    pub fn draw_all(&mut self, look: &Look, size: [u32; 2], is_rough: bool) -> wgpu::Texture {
        loop {
            let drawn = self.draw(look, size, is_rough);
            if drawn.is_done {
                return drawn.picture;
            }
            // It can only fail where the card is lost, and then nothing is to be waited for.
            let _ = self.device.poll(wgpu::PollType::wait_indefinitely());
        }
    }

    /// How far towards the eye, from its centre, a view without perspective shows the surface in each pixel; none where there is none.
    ///
    /// # Errors
    /// As [`pixels`](Self::pixels).
    #[cfg(test)]
    pub fn depths(&mut self, look: &Look, size: [u32; 2]) -> Result<Vec<Option<f64>>, String> {
        self.draw_all(look, size, true);
        let depth = match look.mode {
            Mode::Mesh => &self.targets[0].as_ref().expect("it was drawn").depth,
            _ => self
                .cast
                .as_ref()
                .and_then(|cast| cast.depth())
                .expect("it was drawn"),
        };
        let bytes = read::bytes(&self.device, &self.queue, depth)?;
        let reach = self.reach(&look.camera);
        let toward_eye = |depth: &f32| (*depth < 1.0).then(|| reach * (1.0 - 2.0 * f64::from(*depth)));
        Ok(bytemuck::cast_slice(&bytes).iter().map(toward_eye).collect())
    }
}
