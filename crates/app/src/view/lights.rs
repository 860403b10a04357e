//! What light reaches: the depth of the triangles as each light sees them, as [`crate::picture`] has it.

use eframe::egui_wgpu::wgpu;
use glam::{DMat3, DMat4, DVec3};

use super::canvas::DEPTH;

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
}

/// Axes, in the world: to the right, up and towards an eye.
pub type Axes = [DVec3; 3];

/// To the sun, in the axes of the eye.
const TO_SUN: DVec3 = DVec3::new(-0.45, 0.65, 0.62);

/// To so many parts of the sky: a spiral of equal areas over the sphere.
fn to_sky(count: usize) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |i| {
        let y = 1.0 - (2 * i + 1) as f64 / count as f64;
        let angle = std::f64::consts::PI * (3.0 - 5f64.sqrt()) * i as f64;
        let r = (1.0 - y * y).sqrt();
        DVec3::new(r * angle.cos(), y, r * angle.sin())
    })
}

/// For each light the clip space of its map, of a ball round the origin, and after these the way to each: the sky as it stood round
/// an eye, the sun behind another.
pub fn maps(count: usize, [of_sky, of_sun]: [Axes; 2], radius: f64) -> Vec<[f32; 4]> {
    let world_from = |[right, up, back]: Axes| DMat3::from_cols(right, up, back);
    let sky = to_sky(count).map(|d| world_from(of_sky) * d);
    let sun = world_from(of_sun) * TO_SUN.normalize();
    let mut columns = vec![[0.0; 4]; 5 * (MOST + 1)];
    // The sun has the place after all that the sky might have.
    for (place, way) in sky.enumerate().chain([(MOST, sun)]) {
        let across = way.any_orthonormal_vector();
        let turn = DMat3::from_cols(across, way.cross(across), way).transpose();
        let shrink = DMat4::from_translation(0.5 * DVec3::Z)
            * DMat4::from_scale(DVec3::new(1.0, 1.0, -0.5) / radius)
            * DMat4::from_mat3(turn);
        columns[4 * place..4 * place + 4].copy_from_slice(&shrink.as_mat4().to_cols_array_2d());
        columns[4 * (MOST + 1) + place] = way.as_vec3().extend(0.0).to_array();
    }
    columns
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

    /// With so many directions of the sky, [`MOST`] at most.
    pub fn new(device: &wgpu::Device, layout: &wgpu::BindGroupLayout, count: usize) -> Self {
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
        Self {
            count,
            sky,
            sun,
            bindings,
        }
    }

    /// Draws the map of the sun, and those of the sky if they are old; `triangles` draws them as light number n sees them.
    pub fn draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        is_sky_old: bool,
        triangles: impl Fn(&mut wgpu::RenderPass<'_>, u32),
    ) {
        let sky = if is_sky_old { self.count as u32 } else { 0 };
        let layers = (0..sky).map(|n| (&self.sky, n, n));
        for (texture, layer, light) in layers.chain([(&self.sun, 0, MOST as u32)]) {
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
                        load: wgpu::LoadOp::Clear(1.0),
                        store: wgpu::StoreOp::Store,
                    }),
                    stencil_ops: None,
                }),
                ..wgpu::RenderPassDescriptor::default()
            });
            triangles(&mut pass, light);
        }
    }
}
