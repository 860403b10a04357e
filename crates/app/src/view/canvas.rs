//! The graphics card: triangles in, a picture out.

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};
use eframe::egui_wgpu::RenderState;
use eframe::egui_wgpu::wgpu::{self, util::DeviceExt};
use glam::{DMat4, DVec3};

use super::Camera;
use super::shape::{Patch, Vertex};

/// Samples of a pixel in a picture that stays.
const SAMPLES: u32 = 4;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Pictures are kept in linear light, and shown as the screen wants them.
const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;

/// How the scene is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// From where.
    pub camera: Camera,
    /// A place and a direction: what lies before it, that way, is cut off.
    pub cut: Option<(DVec3, DVec3)>,
    /// Whether painted stiffness shows.
    pub paint: bool,
}

/// See `shaders/surface.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Scene {
    clip_from_world: [[f32; 4]; 4],
    axes: [[f32; 4]; 4],
    cut_at: [f32; 4],
    cut_normal: [f32; 4],
    shows: [f32; 4],
}

/// Triangles on the card.
struct Held {
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    count: u32,
}

/// Where a picture is drawn to.
struct Target {
    size: [u32; 2],
    samples: u32,
    /// Of several samples; without it the picture itself is drawn to.
    rough: Option<wgpu::TextureView>,
    depth: wgpu::TextureView,
    picture: wgpu::Texture,
    shown: egui::TextureId,
}

/// How pictures of a number of samples are drawn.
struct Brush {
    surface: wgpu::RenderPipeline,
    paper: wgpu::RenderPipeline,
}

/// The graphics card with what it holds of a scene.
pub struct Canvas {
    state: RenderState,
    scene: wgpu::Buffer,
    bindings: wgpu::BindGroup,
    /// For one sample, and for [`SAMPLES`].
    brushes: [Brush; 2],
    held: BTreeMap<(String, [i32; 3]), Held>,
    target: Option<Target>,
    drawn: Option<(Look, [u32; 2], u32)>,
    /// The origin of the triangles in the world, and the size of all of them.
    origin: DVec3,
    radius: f64,
}

impl Canvas {
    /// On a card that egui uses.
    pub fn new(state: RenderState) -> Self {
        let device = &state.device;
        let shader = device.create_shader_module(wgpu::include_wgsl!("../../../../shaders/surface.wgsl"));
        let scene = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("scene"),
            size: size_of::<Scene>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("scene"),
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Uniform,
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            }],
        });
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("scene"),
            layout: &layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: scene.as_entire_binding(),
            }],
        });
        let brushes = [1, SAMPLES].map(|samples| Brush::new(device, &shader, &layout, samples));
        Self {
            scene,
            bindings,
            brushes,
            held: BTreeMap::new(),
            target: None,
            drawn: None,
            origin: DVec3::ZERO,
            radius: 1.0,
            state,
        }
    }

    /// Forgets all triangles: those that come next lie about another origin.
    pub fn begin(&mut self, origin: DVec3, radius: f64) {
        (self.origin, self.radius) = (origin, radius);
        self.held.clear();
        self.drawn = None;
    }

    /// Forgets those of an object.
    pub fn forget(&mut self, object: &str) {
        self.held.retain(|(name, _), _| name != object);
        self.drawn = None;
    }

    /// Puts triangles in place of those that there were.
    pub fn put(&mut self, patch: &Patch) {
        let key = (patch.object.clone(), patch.part);
        self.drawn = None;
        if patch.indices.is_empty() {
            self.held.remove(&key);
            return;
        }
        let buffer = |label, contents: &[u8], usage| {
            let contents = wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents,
                usage,
            };
            self.state.device.create_buffer_init(&contents)
        };
        let held = Held {
            vertices: buffer(
                "vertices",
                bytemuck::cast_slice(&patch.vertices),
                wgpu::BufferUsages::VERTEX,
            ),
            indices: buffer(
                "indices",
                bytemuck::cast_slice(&patch.indices),
                wgpu::BufferUsages::INDEX,
            ),
            count: patch.indices.len() as u32,
        };
        self.held.insert(key, held);
    }

    /// Triangles that it holds.
    pub fn triangles(&self) -> usize {
        self.held.values().map(|held| held.count as usize / 3).sum()
    }

    /// A picture of so many pixels: rough while something moves. It is drawn anew only if it would be another.
    pub fn draw(&mut self, look: &Look, size: [u32; 2], is_rough: bool) -> egui::TextureId {
        let most = self.state.device.limits().max_texture_dimension_2d;
        let size = size.map(|n| n.clamp(1, most));
        let samples = if is_rough { 1 } else { SAMPLES };
        if self
            .target
            .as_ref()
            .is_none_or(|t| (t.size, t.samples) != (size, samples))
        {
            self.target = Some(self.new_target(size, samples));
            self.drawn = None;
        }
        let target = self.target.as_ref().expect("it was made");
        let now = (*look, size, samples);
        if self.drawn == Some(now) {
            return target.shown;
        }
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let scene = self.scene_of(look, aspect);
        self.state
            .queue
            .write_buffer(&self.scene, 0, bytemuck::bytes_of(&scene));
        let mut encoder = self
            .state
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
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
                    view: &target.depth,
                    depth_ops: Some(wgpu::Operations {
                        load: wgpu::LoadOp::Clear(1.0),
                        store: wgpu::StoreOp::Discard,
                    }),
                    stencil_ops: None,
                }),
                ..wgpu::RenderPassDescriptor::default()
            });
            let brush = &self.brushes[usize::from(!is_rough)];
            pass.set_bind_group(0, &self.bindings, &[]);
            pass.set_pipeline(&brush.paper);
            pass.draw(0..3, 0..1);
            pass.set_pipeline(&brush.surface);
            for held in self.held.values() {
                pass.set_vertex_buffer(0, held.vertices.slice(..));
                pass.set_index_buffer(held.indices.slice(..), wgpu::IndexFormat::Uint32);
                pass.draw_indexed(0..held.count, 0, 0..1);
            }
        }
        self.state.queue.submit([encoder.finish()]);
        self.drawn = Some(now);
        target.shown
    }

    fn scene_of(&self, look: &Look, aspect: f64) -> Scene {
        let camera = &look.camera;
        let reach = self.radius + camera.center.distance(self.origin);
        let columns = |m: DMat4| m.as_mat4().to_cols_array_2d();
        let [right, up, back] = camera.axes().map(|axis| axis.extend(0.0));
        let (cut_at, cut_normal) = look.cut.unwrap_or((DVec3::ZERO, DVec3::ZERO));
        let has_cut = f64::from(u8::from(look.cut.is_some()));
        Scene {
            clip_from_world: columns(camera.clip_from_world(self.origin, reach, aspect)),
            axes: columns(DMat4::from_cols(right, up, back, glam::DVec4::W)),
            cut_at: (cut_at - self.origin).extend(0.0).as_vec4().to_array(),
            cut_normal: cut_normal.extend(has_cut).as_vec4().to_array(),
            shows: [f32::from(u8::from(look.paint)), 0.0, 0.0, 0.0],
        }
    }

    fn new_target(&self, size: [u32; 2], samples: u32) -> Target {
        let texture = |format, samples, usage| {
            self.state.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("picture"),
                size: wgpu::Extent3d {
                    width: size[0],
                    height: size[1],
                    depth_or_array_layers: 1,
                },
                mip_level_count: 1,
                sample_count: samples,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage,
                view_formats: &[wgpu::TextureFormat::Rgba8Unorm],
            })
        };
        let attachment = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let picture = texture(
            COLOR,
            1,
            attachment | wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC,
        );
        let whole = wgpu::TextureViewDescriptor::default();
        let rough = (samples > 1).then(|| texture(COLOR, samples, attachment).create_view(&whole));
        let depth = self.state.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("depth"),
            size: picture.size(),
            mip_level_count: 1,
            sample_count: samples,
            dimension: wgpu::TextureDimension::D2,
            format: DEPTH,
            usage: attachment,
            view_formats: &[],
        });
        // egui takes pictures as the screen wants them.
        let shown = picture.create_view(&wgpu::TextureViewDescriptor {
            format: Some(wgpu::TextureFormat::Rgba8Unorm),
            ..wgpu::TextureViewDescriptor::default()
        });
        let mut renderer = self.state.renderer.write();
        if let Some(old) = &self.target {
            renderer.free_texture(&old.shown);
        }
        let shown = renderer.register_native_texture(&self.state.device, &shown, wgpu::FilterMode::Linear);
        Target {
            size,
            samples,
            rough,
            depth: depth.create_view(&whole),
            picture,
            shown,
        }
    }
}

impl Brush {
    fn new(
        device: &wgpu::Device,
        shader: &wgpu::ShaderModule,
        layout: &wgpu::BindGroupLayout,
        samples: u32,
    ) -> Self {
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("scene"),
            bind_group_layouts: &[Some(layout)],
            immediate_size: 0,
        });
        let vertices = wgpu::VertexBufferLayout {
            array_stride: size_of::<Vertex>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32, 3 => Float32],
        };
        let pipeline = |corner: &str, color: &str, buffers: &[Option<wgpu::VertexBufferLayout<'_>>]| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(color),
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
                    depth_compare: Some(wgpu::CompareFunction::LessEqual),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState {
                    count: samples,
                    ..wgpu::MultisampleState::default()
                },
                fragment: Some(wgpu::FragmentState {
                    module: shader,
                    entry_point: Some(color),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    targets: &[Some(COLOR.into())],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        Self {
            surface: pipeline("corner", "shade", &[Some(vertices)]),
            paper: pipeline("paper", "paper_color", &[]),
        }
    }
}
