//! How triangles become pixels.

use eframe::egui_wgpu::wgpu;

use super::shape::Vertex;
use super::target::{COLOR, DEPTH};

/// How pictures of a number of samples a pixel are drawn.
pub struct Brush {
    /// Triangles in all light, cut, from both sides.
    pub surface: wgpu::RenderPipeline,
    /// Their fronts.
    pub front: wgpu::RenderPipeline,
    /// The same, in the light that reaches them.
    pub lit: wgpu::RenderPipeline,
    /// Their backs beside these, of coarser ones.
    pub inside: wgpu::RenderPipeline,
    /// What is behind them.
    pub paper: wgpu::RenderPipeline,
}

/// As shaders read corners.
pub const VERTEX: wgpu::VertexBufferLayout<'_> = wgpu::VertexBufferLayout {
    array_stride: size_of::<Vertex>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32, 3 => Float32],
};

/// A way to draw: from corners to colours, of so many samples a pixel.
fn pipeline(
    device: &wgpu::Device,
    shader: &wgpu::ShaderModule,
    layout: &wgpu::PipelineLayout,
    [corner, color]: [&str; 2],
    buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
    hides: Option<wgpu::Face>,
    samples: u32,
) -> wgpu::RenderPipeline {
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(corner),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module: shader,
            entry_point: Some(corner),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers,
        },
        primitive: wgpu::PrimitiveState {
            cull_mode: hides,
            ..wgpu::PrimitiveState::default()
        },
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
}

fn layout(device: &wgpu::Device, groups: &[Option<&wgpu::BindGroupLayout>]) -> wgpu::PipelineLayout {
    device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("scene"),
        bind_group_layouts: groups,
        immediate_size: 0,
    })
}

impl Brush {
    /// By a shader.
    pub fn new(
        device: &wgpu::Device,
        shader: &wgpu::ShaderModule,
        [scene, lights]: [&wgpu::BindGroupLayout; 2],
        samples: u32,
    ) -> Self {
        let lit = layout(device, &[Some(scene), Some(lights)]);
        let plain = layout(device, &[Some(scene)]);
        let made =
            |layout, ways, hides| pipeline(device, shader, layout, ways, &[Some(VERTEX)], hides, samples);
        let behind = ["paper", "paper_color"];
        Self {
            surface: made(&plain, ["corner", "shade"], None),
            front: made(&plain, ["corner", "shade_front"], Some(wgpu::Face::Back)),
            lit: made(&lit, ["corner", "shade_lit"], Some(wgpu::Face::Back)),
            inside: made(&plain, ["corner_inside", "shade_inside"], Some(wgpu::Face::Front)),
            paper: pipeline(device, shader, &plain, behind, &[], None, samples),
        }
    }
}
