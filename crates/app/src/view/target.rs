//! What pictures are drawn to.

use eframe::egui_wgpu::wgpu;

use super::Look;

/// Samples of a pixel in a picture that stays.
pub const SAMPLES: u32 = 4;
/// Of all depths.
pub const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Pictures are kept in linear light, and shown as the screen wants them.
pub const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;

/// Where a picture is drawn to.
pub struct Target {
    pub size: [u32; 2],
    /// Of several samples; without it the picture itself is drawn to.
    pub rough: Option<wgpu::TextureView>,
    pub depth: wgpu::Texture,
    pub picture: wgpu::Texture,
    /// What it shows.
    pub drawn: Option<Look>,
}

impl Target {
    /// Of so many samples.
    pub fn new(device: &wgpu::Device, size: [u32; 2], samples: u32) -> Self {
        let texture = |format, samples, usage| {
            device.create_texture(&wgpu::TextureDescriptor {
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
            attachment
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_SRC
                | wgpu::TextureUsages::COPY_DST,
        );
        let whole = wgpu::TextureViewDescriptor::default();
        let rough = (samples > 1).then(|| texture(COLOR, samples, attachment).create_view(&whole));
        let depth = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("depth"),
            size: picture.size(),
            mip_level_count: 1,
            sample_count: samples,
            dimension: wgpu::TextureDimension::D2,
            format: DEPTH,
            usage: attachment | wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        Self {
            size,
            rough,
            depth,
            picture,
            drawn: None,
        }
    }
}

/// A picture, or what there is of it.
pub struct Drawn {
    /// The pixels.
    pub picture: wgpu::Texture,
    /// Share of its rows, from the top, that are drawn.
    pub rows: f32,
    /// Whether it stays as it is.
    pub is_done: bool,
}
