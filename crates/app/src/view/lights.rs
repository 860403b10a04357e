//! What light reaches: the depth of the triangles as each light sees them, as [`crate::picture`] has it.

use bspline::Aabb;
use eframe::egui_wgpu::wgpu;
use glam::{DMat3, DMat4, DVec2, DVec3};

use super::brush::VERTEX;
use super::held::{Held, draw};
use super::target::DEPTH;

/// Most directions of the sky.
pub const MOST: usize = 64;
/// Pixels of the sun's map, and of each of the sky.
const SUN: u32 = 1024;
const SKY: u32 = 288;

/// The sun and the sky. The sun stands behind the viewer, wherever he goes; the sky is all round.
pub struct Lights {
    /// Directions of the sky.
    pub count: usize,
    sky: wgpu::Texture,
    sun: wgpu::Texture,
    /// For shaders that look up what light reaches.
    pub bindings: wgpu::BindGroup,
    /// Draws triangles as a light sees them, and nothing at all in place of them.
    shadow: wgpu::RenderPipeline,
    wipe: wgpu::RenderPipeline,
    /// Round which eye the maps of the sky were drawn, unless they are to be drawn again.
    seen_by: Option<Axes>,
    /// Round all triangles that are others since.
    stale: Option<Aabb>,
}

/// Axes, in the world: to the right, up and towards an eye.
pub type Axes = [DVec3; 3];

/// To the sun, in the axes of the eye.
const TO_SUN: DVec3 = DVec3::new(-0.45, 0.65, 0.62);

fn world_from([right, up, back]: Axes) -> DMat3 {
    DMat3::from_cols(right, up, back)
}

fn to_sun(axes: Axes) -> DVec3 {
    world_from(axes) * TO_SUN.normalize()
}

/// To so many parts of the sky: a spiral of equal areas over the sphere.
fn to_sky(count: usize) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |i| {
        let y = 1.0 - (2 * i + 1) as f64 / count as f64;
        let angle = std::f64::consts::PI * (3.0 - 5f64.sqrt()) * i as f64;
        let r = (1.0 - y * y).sqrt();
        DVec3::new(r * angle.cos(), y, r * angle.sin())
    })
}

/// Clip space of the map of a light, of a ball round the origin, from the way to it.
fn map(way: DVec3, radius: f64) -> DMat4 {
    let across = way.any_orthonormal_vector();
    let turn = DMat3::from_cols(across, way.cross(across), way).transpose();
    DMat4::from_translation(0.5 * DVec3::Z)
        * DMat4::from_scale(DVec3::new(1.0, 1.0, -0.5) / radius)
        * DMat4::from_mat3(turn)
}

/// Where in the map of a light, of pixels a side, a box is: left, top, width and height in whole pixels.
fn place(map: &DMat4, b: &Aabb, side: u32) -> [u32; 4] {
    let mut places = (0..8).map(|n| {
        let corner = DVec3::select(glam::BVec3::new(n & 1 > 0, n & 2 > 0, n & 4 > 0), b.max, b.min);
        let q = map.project_point3(corner);
        (DVec2::new(q.x, -q.y) * 0.5 + 0.5) * f64::from(side)
    });
    let first = places.next().unwrap_or_default();
    let (low, high) = places.fold((first, first), |(low, high), p| (low.min(p), high.max(p)));
    let [low, high] =
        [low.floor() - 1.0, high.ceil() + 1.0].map(|p| p.clamp(DVec2::ZERO, DVec2::splat(side.into())));
    let size = high - low;
    [low.x, low.y, size.x, size.y].map(|n| n as u32)
}

impl Lights {
    /// How shaders find them.
    pub fn layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
        let map = |binding, view_dimension| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty: wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Depth,
                view_dimension,
                multisampled: false,
            },
            count: None,
        };
        device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("lights"),
            entries: &[
                map(0, wgpu::TextureViewDimension::D2Array),
                map(1, wgpu::TextureViewDimension::D2),
            ],
        })
    }

    /// With so many directions of the sky, [`MOST`] at most, for scenes that are bound so to a shader.
    pub fn new(
        device: &wgpu::Device,
        [scene, layout]: [&wgpu::BindGroupLayout; 2],
        shader: &wgpu::ShaderModule,
        count: usize,
    ) -> Self {
        let count = count.clamp(2, MOST);
        let map = |label, side, layers| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d {
                    width: side,
                    height: side,
                    depth_or_array_layers: layers,
                },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: DEPTH,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            })
        };
        let (sky, sun) = (map("sky", SKY, count as u32), map("sun", SUN, 1));
        let whole = wgpu::TextureViewDescriptor::default();
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("lights"),
            layout,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(&sky.create_view(&whole)),
                },
                wgpu::BindGroupEntry {
                    binding: 1,
                    resource: wgpu::BindingResource::TextureView(&sun.create_view(&whole)),
                },
            ],
        });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("lights"),
            bind_group_layouts: &[Some(scene)],
            immediate_size: 0,
        });
        let pipeline = |corner, buffers: &[_], compare| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some("lights"),
                layout: Some(&layout),
                vertex: wgpu::VertexState {
                    module: shader,
                    entry_point: Some(corner),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    buffers,
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: DEPTH,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(compare),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState::default(),
                fragment: None,
                multiview_mask: None,
                cache: None,
            })
        };
        Self {
            count,
            sky,
            sun,
            bindings,
            shadow: pipeline("lit", &[Some(VERTEX)], wgpu::CompareFunction::LessEqual),
            wipe: pipeline("paper", &[], wgpu::CompareFunction::Always),
            seen_by: None,
            stale: None,
        }
    }

    /// Has all of the sky drawn again.
    pub fn renew(&mut self) {
        self.seen_by = None;
    }

    /// Has the sky drawn again where a box throws shadows.
    pub fn touch(&mut self, b: Aabb) {
        self.stale = Some(self.stale.map_or(b, |stale| stale.hull(b)));
    }

    /// For each light the clip space of its map, of a ball round the origin, and after these the way to each: the sky as it stood round
    /// the eye for which it was drawn, the sun behind this one.
    pub fn maps(&self, axes: Axes, radius: f64) -> Vec<[f32; 4]> {
        let mut columns = vec![[0.0; 4]; 5 * (MOST + 1)];
        // The sun has the place after all that the sky might have.
        for (n, way) in self.to_sky(axes).enumerate().chain([(MOST, to_sun(axes))]) {
            let map = map(way, radius).as_mat4();
            columns[4 * n..4 * n + 4].copy_from_slice(&map.to_cols_array_2d());
            columns[4 * (MOST + 1) + n] = way.as_vec3().extend(0.0).to_array();
        }
        columns
    }

    /// The ways to the sky, which stays as it was drawn: that takes as long as all else, and nobody sees it turn.
    fn to_sky(&self, axes: Axes) -> impl Iterator<Item = DVec3> + use<> {
        let world_from = world_from(self.seen_by.unwrap_or(axes));
        to_sky(self.count).map(move |way| world_from * way)
    }

    /// Draws the map of the sun, and those of the sky where they are old, of triangles within a radius of the origin.
    pub fn draw(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        scene: &wgpu::BindGroup,
        (axes, radius): (Axes, f64),
        triangles: &[&Held],
    ) {
        let whole = |texture: &wgpu::Texture| [0, 0, texture.width(), texture.width()];
        let sky = self.to_sky(axes).enumerate().filter_map(|(n, way)| {
            let map = map(way, radius);
            let part = match (self.seen_by, &self.stale) {
                (None, _) => whole(&self.sky),
                (Some(_), Some(stale)) => place(&map, stale, SKY),
                (Some(_), None) => return None,
            };
            Some((&self.sky, n as u32, n as u32, map, part))
        });
        let sun = (
            &self.sun,
            0,
            MOST as u32,
            map(to_sun(axes), radius),
            whole(&self.sun),
        );
        for (texture, layer, light, map, [x, y, width, height]) in sky.chain([sun]) {
            if width == 0 || height == 0 {
                continue;
            }
            let view = texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer: layer,
                array_layer_count: Some(1),
                ..wgpu::TextureViewDescriptor::default()
            });
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("light"),
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &view,
                    depth_ops: Some(wgpu::Operations {
                        load: wgpu::LoadOp::Load,
                        store: wgpu::StoreOp::Store,
                    }),
                    stencil_ops: None,
                }),
                ..wgpu::RenderPassDescriptor::default()
            });
            pass.set_bind_group(0, scene, &[]);
            pass.set_scissor_rect(x, y, width, height);
            pass.set_pipeline(&self.wipe);
            pass.draw(0..3, 0..1);
            pass.set_pipeline(&self.shadow);
            let is_there = |held: &&&Held| {
                let [left, top, w, h] = place(&map, &held.within, texture.width());
                left < x + width && x < left + w && top < y + height && y < top + h
            };
            let there = triangles.iter().filter(is_there).copied();
            draw(there, Held::coarse, &mut pass, light);
        }
        self.seen_by.get_or_insert(axes);
        self.stale = None;
    }
}
