//! How lines become pixels.

use std::cell::OnceCell;

use eframe::egui_wgpu::wgpu;

use super::eye::Eye;
use super::plan::Plan;
use crate::view::target::{COLOR, DEPTH};

/// What a pass finds, by the name that the shader has for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// The surface in all light, or where it reaches.
    Surface {
        /// Where it reaches.
        is_lit: bool,
        /// A second look at pixels that differ from those round them.
        is_again: bool,
    },
    /// The density.
    Volume,
}

impl Pass {
    const ALL: [&'static str; 5] = [
        "surface_plain",
        "surface_lit",
        "surface_plain_again",
        "surface_lit_again",
        "volume",
    ];

    fn number(self) -> usize {
        match self {
            Self::Surface { is_lit, is_again } => 2 * usize::from(is_again) + usize::from(is_lit),
            Self::Volume => 4,
        }
    }
}

/// Everything that passes need besides what they look at.
pub struct Passes {
    device: wgpu::Device,
    shader: wgpu::ShaderModule,
    layouts: [wgpu::BindGroupLayout; 4],
    eye: wgpu::Buffer,
    /// A picture of one clear pixel.
    nothing: wgpu::Texture,
    /// Made when they are needed first: that takes a while.
    pipelines: [OnceCell<wgpu::RenderPipeline>; Pass::ALL.len()],
}

impl Passes {
    /// With the layouts of the scene and of its lights.
    pub fn new(device: &wgpu::Device, [scene, lights]: [wgpu::BindGroupLayout; 2]) -> Self {
        let source = concat!(
            include_str!("../../../../../shaders/surface.wgsl"),
            include_str!("../../../../../shaders/rays.wgsl")
        );
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty,
            count: None,
        };
        let buffer = |binding, ty| {
            let ty = wgpu::BindingType::Buffer {
                ty,
                has_dynamic_offset: false,
                min_binding_size: None,
            };
            entry(binding, ty)
        };
        let texture = |binding, sample_type| {
            let ty = wgpu::BindingType::Texture {
                sample_type,
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled: false,
            };
            entry(binding, ty)
        };
        let layout = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(label),
                entries,
            })
        };
        let read = wgpu::BufferBindingType::Storage { read_only: true };
        let solids = layout(
            "solids",
            &[
                buffer(0, wgpu::BufferBindingType::Uniform),
                buffer(1, read),
                buffer(2, read),
                buffer(3, read),
            ],
        );
        let color = wgpu::TextureSampleType::Float { filterable: false };
        let ground = layout(
            "ground",
            &[
                texture(0, color),
                texture(1, wgpu::TextureSampleType::Depth),
                texture(2, color),
                texture(3, color),
            ],
        );
        Self {
            shader: device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some("rays"),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            }),
            eye: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("eye"),
                size: size_of::<Eye>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            // Pictures begin clear.
            nothing: device.create_texture(&wgpu::TextureDescriptor {
                label: Some("nothing"),
                size: wgpu::Extent3d::default(),
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: COLOR,
                usage: wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            }),
            layouts: [scene, lights, solids, ground],
            pipelines: Default::default(),
            device: device.clone(),
        }
    }

    /// A picture of one clear pixel.
    pub fn nothing(&self) -> &wgpu::Texture {
        &self.nothing
    }

    /// Tells the next passes of the eye.
    pub fn tell(&self, queue: &wgpu::Queue, eye: &Eye) {
        queue.write_buffer(&self.eye, 0, bytemuck::bytes_of(eye));
    }

    /// What passes know of solids.
    pub fn solids(&self, plan: &Plan, bricks: &wgpu::Buffer) -> wgpu::BindGroup {
        let all = [&self.eye, &plan.records, &plan.nodes, bricks];
        self.group(2, &all.map(|buffer| buffer.as_entire_binding()))
    }

    /// What passes know of what was drawn before: behind the solids, with its depths, at the first look, and the paint of triangles.
    pub fn ground(&self, drawn: [&wgpu::Texture; 4]) -> wgpu::BindGroup {
        let views = drawn.map(|t| t.create_view(&wgpu::TextureViewDescriptor::default()));
        self.group(3, &views.each_ref().map(wgpu::BindingResource::TextureView))
    }

    fn group(&self, number: usize, resources: &[wgpu::BindingResource]) -> wgpu::BindGroup {
        let entries = resources.iter().zip(0..);
        let entries: Vec<_> = entries
            .map(|(resource, binding)| wgpu::BindGroupEntry {
                binding,
                resource: resource.clone(),
            })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("rays"),
            layout: &self.layouts[number],
            entries: &entries,
        })
    }

    /// How a pass is done.
    pub fn pipeline(&self, pass: Pass) -> &wgpu::RenderPipeline {
        self.pipelines[pass.number()].get_or_init(|| self.made(pass))
    }

    fn made(&self, pass: Pass) -> wgpu::RenderPipeline {
        let [scene, lights, solids, ground] = self.layouts.each_ref();
        let layout = self
            .device
            .create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("rays"),
                bind_group_layouts: &[Some(scene), Some(lights), Some(solids), Some(ground)],
                immediate_size: 0,
            });
        let has_depth = matches!(pass, Pass::Surface { is_again: false, .. });
        self.device
            .create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some("rays"),
                layout: Some(&layout),
                vertex: wgpu::VertexState {
                    module: &self.shader,
                    entry_point: Some("paper"),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: has_depth.then(|| wgpu::DepthStencilState {
                    format: DEPTH,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(wgpu::CompareFunction::Always),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &self.shader,
                    entry_point: Some(Pass::ALL[pass.number()]),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    targets: &[Some(COLOR.into())],
                }),
                multiview_mask: None,
                cache: None,
            })
    }
}
