//! How what is besides the surfaces becomes pixels.

use eframe::egui_wgpu::wgpu;

use super::lines::STRETCH;
use crate::view::brush::VERTEX;
use crate::view::target::{COLOR, DEPTH};

/// Ways to draw pictures of a number of samples a pixel.
pub struct Brushes {
    /// Lines and dots.
    pub ink: wgpu::RenderPipeline,
    /// What is looked through: its far side, and its near one.
    pub veil: [wgpu::RenderPipeline; 2],
    /// The density on the cut.
    pub cap: wgpu::RenderPipeline,
    /// Paint without light.
    pub paint: wgpu::RenderPipeline,
    /// Surfaces whose colours tell shares of a scale, as [`crate::view::brush::Brush`] has surfaces, fronts and what is lit.
    pub shared: [wgpu::RenderPipeline; 3],
}

/// How one of them draws.
struct Way<'a> {
    corner: &'a str,
    color: &'a str,
    buffers: &'a [Option<wgpu::VertexBufferLayout<'a>>],
    /// The side that is left out.
    hides: Option<wgpu::Face>,
    /// Whether it lets through what is behind.
    is_clear: bool,
    hides_behind: bool,
}

impl Brushes {
    /// With the layouts of scenes, of caps and of lights.
    pub fn new(
        device: &wgpu::Device,
        [scene, cap, lights]: [&wgpu::BindGroupLayout; 3],
        samples: u32,
    ) -> Self {
        let source = concat!(
            include_str!("../../../../../shaders/surface.wgsl"),
            include_str!("../../../../../shaders/overlay.wgsl")
        );
        let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("overlay"),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let layout = |groups: &[Option<&wgpu::BindGroupLayout>]| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("overlay"),
                bind_group_layouts: groups,
                immediate_size: 0,
            })
        };
        let plain = layout(&[Some(scene)]);
        let [capped, lit] = [cap, lights].map(|second| layout(&[Some(scene), Some(second)]));
        let made = |layout: &wgpu::PipelineLayout, way: Way| made(device, &shader, layout, way, samples);
        let veil = |hides| Way {
            corner: "corner",
            color: "veil",
            buffers: &[Some(VERTEX)],
            hides: Some(hides),
            is_clear: true,
            hides_behind: false,
        };
        let opaque = Way {
            corner: "cap_corner",
            color: "cap_color",
            buffers: &[],
            hides: None,
            is_clear: false,
            hides_behind: true,
        };
        Self {
            ink: made(
                &plain,
                Way {
                    corner: "ink",
                    color: "ink_color",
                    buffers: &[Some(STRETCH)],
                    is_clear: true,
                    ..opaque
                },
            ),
            veil: [wgpu::Face::Front, wgpu::Face::Back].map(|hides| made(&plain, veil(hides))),
            paint: made(
                &plain,
                Way {
                    corner: "corner",
                    color: "paint_alone",
                    buffers: &[Some(VERTEX)],
                    ..opaque
                },
            ),
            shared: [
                (&plain, "shade_scale", None),
                (&plain, "shade_scale_front", Some(wgpu::Face::Back)),
                (&lit, "shade_scale_lit", Some(wgpu::Face::Back)),
            ]
            .map(|(layout, color, hides)| {
                made(
                    layout,
                    Way {
                        corner: "corner",
                        color,
                        buffers: &[Some(VERTEX)],
                        hides,
                        ..opaque
                    },
                )
            }),
            cap: made(&capped, opaque),
        }
    }
}

fn made(
    device: &wgpu::Device,
    shader: &wgpu::ShaderModule,
    layout: &wgpu::PipelineLayout,
    way: Way,
    samples: u32,
) -> wgpu::RenderPipeline {
    let blend = way.is_clear.then_some(wgpu::BlendState::ALPHA_BLENDING);
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(way.color),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module: shader,
            entry_point: Some(way.corner),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: way.buffers,
        },
        primitive: wgpu::PrimitiveState {
            cull_mode: way.hides,
            ..wgpu::PrimitiveState::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(way.hides_behind),
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
            entry_point: Some(way.color),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(wgpu::ColorTargetState {
                format: COLOR,
                blend,
                write_mask: wgpu::ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}
