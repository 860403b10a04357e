//! Pictures of the scene in the window. The shader that egui has for pictures also dithers and filters by hand: a processor that stands
//! in for a graphics card takes all of its branches, which took longer than the scene itself.

use eframe::egui_wgpu::{self, CallbackResources, CallbackTrait, wgpu};
use egui::{PaintCallbackInfo, Rect, Shape};

/// Lays pictures into the window.
pub struct Layer {
    pipeline: wgpu::RenderPipeline,
    sampler: wgpu::Sampler,
    /// As which colours pictures are read, so that they are written as they are.
    format: wgpu::TextureFormat,
}

/// A picture that can be laid into the window.
#[derive(Clone)]
pub struct Laid {
    pipeline: wgpu::RenderPipeline,
    bindings: wgpu::BindGroup,
}

impl Layer {
    /// For a window whose pixels are so.
    pub fn new(device: &wgpu::Device, pixels: wgpu::TextureFormat) -> Self {
        Self::of(device, pixels, wgpu::ColorWrites::ALL)
    }

    /// The same, for some of the colours alone.
    pub fn of(device: &wgpu::Device, pixels: wgpu::TextureFormat, colors: wgpu::ColorWrites) -> Self {
        let shader = device.create_shader_module(wgpu::include_wgsl!("../../../../shaders/window.wgsl"));
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("window"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &shader,
                entry_point: Some("corner"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &shader,
                entry_point: Some("color"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(wgpu::ColorTargetState {
                    write_mask: colors,
                    ..pixels.into()
                })],
            }),
            multiview_mask: None,
            cache: None,
        });
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        let format = match pixels.is_srgb() {
            true => wgpu::TextureFormat::Rgba8UnormSrgb,
            false => wgpu::TextureFormat::Rgba8Unorm,
        };
        Self {
            pipeline,
            sampler,
            format,
        }
    }

    /// A picture, to be laid into the window.
    pub fn laid(&self, device: &wgpu::Device, picture: &wgpu::Texture) -> Laid {
        let view = picture.create_view(&wgpu::TextureViewDescriptor {
            format: Some(self.format),
            ..wgpu::TextureViewDescriptor::default()
        });
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("window"),
            layout: &self.pipeline.get_bind_group_layout(0),
            entries: &[
                entry(0, wgpu::BindingResource::TextureView(&view)),
                entry(1, wgpu::BindingResource::Sampler(&self.sampler)),
            ],
        });
        Laid {
            pipeline: self.pipeline.clone(),
            bindings,
        }
    }
}

impl Laid {
    /// Over all of a place.
    pub fn over(self, place: Rect) -> Shape {
        egui_wgpu::Callback::new_paint_callback(place, self).into()
    }

    /// Over all of a pass's place.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        pass.draw(0..3, 0..1);
    }
}

impl CallbackTrait for Laid {
    fn paint(&self, _: PaintCallbackInfo, pass: &mut wgpu::RenderPass<'static>, _: &CallbackResources) {
        self.draw(pass);
    }
}
