//! The light that reaches a whole picture, looked up once for every second pixel across and down: where many triangles share a pixel, each of
//! them would look it up, and what reaches a place is softer than pixels are.

use std::cell::OnceCell;

use eframe::egui_wgpu::wgpu;

use super::brush::VERTEX;
use super::target::DEPTH;

/// Outward normals, and 1 where there is a surface.
const NORMALS: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
/// A depth, as bits, and two shares.
const LIGHT: wgpu::TextureFormat = wgpu::TextureFormat::Rg32Uint;
/// No surface as far away as that is, and all light.
const NOTHING: wgpu::Color = wgpu::Color {
    r: 1.0_f32.to_bits() as f64,
    g: u32::MAX as f64,
    b: 0.0,
    a: 0.0,
};

/// What finds it.
pub struct LightPass {
    device: wgpu::Device,
    /// How scenes and the maps of lights are bound, what light is found from, and light.
    layouts: [wgpu::BindGroupLayout; 4],
    /// Made when they are needed first.
    pipelines: OnceCell<[wgpu::RenderPipeline; 2]>,
    sheet: Option<Sheet>,
}

/// Of a size.
struct Sheet {
    size: [u32; 2],
    normals: wgpu::TextureView,
    depth: wgpu::TextureView,
    light: wgpu::TextureView,
    /// What light is found from, and where surfaces find it.
    bindings: [wgpu::BindGroup; 2],
}

impl LightPass {
    /// With the layouts of scenes and of the maps of lights.
    pub fn new(device: &wgpu::Device, layouts: [wgpu::BindGroupLayout; 2]) -> Self {
        let sheet = |types: &[wgpu::TextureSampleType]| {
            let texture = |(binding, sample_type)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::FRAGMENT,
                ty: wgpu::BindingType::Texture {
                    sample_type,
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                },
                count: None,
            };
            let entries: Vec<_> = (0..).zip(types.iter().copied()).map(texture).collect();
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some("light"),
                entries: &entries,
            })
        };
        let numbers = wgpu::TextureSampleType::Float { filterable: false };
        let [scene, maps] = layouts;
        let from = sheet(&[numbers, wgpu::TextureSampleType::Depth]);
        let light = sheet(&[wgpu::TextureSampleType::Uint]);
        Self {
            device: device.clone(),
            layouts: [scene, maps, from, light],
            pipelines: OnceCell::new(),
            sheet: None,
        }
    }

    /// How surfaces find the light.
    pub fn layout(&self) -> &wgpu::BindGroupLayout {
        &self.layouts[3]
    }

    /// For surfaces, once it was drawn.
    pub fn bindings(&self) -> Option<&wgpu::BindGroup> {
        self.sheet.as_ref().map(|sheet| &sheet.bindings[1])
    }

    /// Makes room for the light of a picture of so many pixels.
    pub fn fit(&mut self, size: [u32; 2]) {
        if self.sheet.as_ref().is_none_or(|sheet| sheet.size != size) {
            self.sheet = Some(self.new_sheet(size));
        }
    }

    /// Finds the light of triangles that `triangles` draws, with a scene and the maps of its lights.
    pub fn draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        [scene, maps]: [&wgpu::BindGroup; 2],
        triangles: impl FnOnce(&mut wgpu::RenderPass<'_>),
    ) {
        let Some(sheet) = &self.sheet else { return };
        let [normals, light] = self.pipelines.get_or_init(|| self.new_pipelines());
        {
            let depth = wgpu::RenderPassDepthStencilAttachment {
                view: &sheet.depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(1.0),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            };
            let mut pass = begin(encoder, &sheet.normals, wgpu::Color::TRANSPARENT, Some(depth));
            let [width, height] = sheet.size.map(|n| 0.5 * n as f32);
            pass.set_viewport(0.0, 0.0, width, height, 0.0, 1.0);
            pass.set_pipeline(normals);
            pass.set_bind_group(0, scene, &[]);
            triangles(&mut pass);
        }
        let mut pass = begin(encoder, &sheet.light, NOTHING, None);
        pass.set_pipeline(light);
        pass.set_bind_group(0, scene, &[]);
        pass.set_bind_group(1, maps, &[]);
        pass.set_bind_group(2, &sheet.bindings[0], &[]);
        pass.draw(0..3, 0..1);
    }

    fn new_sheet(&self, size: [u32; 2]) -> Sheet {
        let texture = |format| {
            let texture = self.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("light"),
                size: wgpu::Extent3d {
                    width: size[0].div_ceil(2),
                    height: size[1].div_ceil(2),
                    depth_or_array_layers: 1,
                },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        let [normals, depth, light] = [NORMALS, DEPTH, LIGHT].map(texture);
        let bind = |layout, views: &[&wgpu::TextureView]| {
            let entry = |(binding, view)| wgpu::BindGroupEntry {
                binding,
                resource: wgpu::BindingResource::TextureView(view),
            };
            let entries: Vec<_> = (0..).zip(views.iter().copied()).map(entry).collect();
            self.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("light"),
                layout,
                entries: &entries,
            })
        };
        let [_, _, from, lit] = &self.layouts;
        let bindings = [bind(from, &[&normals, &depth]), bind(lit, &[&light])];
        Sheet {
            size,
            normals,
            depth,
            light,
            bindings,
        }
    }

    fn new_pipelines(&self) -> [wgpu::RenderPipeline; 2] {
        let source = concat!(
            include_str!("../../../../shaders/surface.wgsl"),
            include_str!("../../../../shaders/light.wgsl")
        );
        let shader = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("light"),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let [scene, maps, from, _] = self.layouts.each_ref();
        let of_triangles = wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::LessEqual),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        };
        let pipeline = |groups: &[Option<&wgpu::BindGroupLayout>],
                        [corner, color]: [&str; 2],
                        buffers: &[_],
                        depth_stencil,
                        format: wgpu::TextureFormat| {
            let layout = self
                .device
                .create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                    label: Some("light"),
                    bind_group_layouts: groups,
                    immediate_size: 0,
                });
            self.device
                .create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                    label: Some(color),
                    layout: Some(&layout),
                    vertex: wgpu::VertexState {
                        module: &shader,
                        entry_point: Some(corner),
                        compilation_options: wgpu::PipelineCompilationOptions::default(),
                        buffers,
                    },
                    primitive: wgpu::PrimitiveState::default(),
                    depth_stencil,
                    multisample: wgpu::MultisampleState::default(),
                    fragment: Some(wgpu::FragmentState {
                        module: &shader,
                        entry_point: Some(color),
                        compilation_options: wgpu::PipelineCompilationOptions::default(),
                        targets: &[Some(format.into())],
                    }),
                    multiview_mask: None,
                    cache: None,
                })
        };
        [
            pipeline(
                &[Some(scene)],
                ["corner", "normal_of"],
                &[Some(VERTEX)],
                Some(of_triangles),
                NORMALS,
            ),
            pipeline(
                &[Some(scene), Some(maps), Some(from)],
                ["paper", "light_of"],
                &[],
                None,
                LIGHT,
            ),
        ]
    }
}

fn begin<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    view: &wgpu::TextureView,
    clear: wgpu::Color,
    depth: Option<wgpu::RenderPassDepthStencilAttachment<'_>>,
) -> wgpu::RenderPass<'a> {
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("light"),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(clear),
                store: wgpu::StoreOp::Store,
            },
        })],
        depth_stencil_attachment: depth,
        ..wgpu::RenderPassDescriptor::default()
    })
}
