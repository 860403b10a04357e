//! Pictures of the scene in the window.

use eframe::egui_wgpu::{CallbackResources, CallbackTrait, wgpu};
use egui::{PaintCallbackInfo, Rect, Vec2};

use super::*;
use crate::view::laid::Layer;
use crate::view::read;

/// A picture of the size of its place has the same bytes there, whatever the window makes of the numbers that it is given.
#[test]
fn a_picture_stays_as_it_is_in_the_window() {
    let Some(card) = card("a picture in the window") else {
        return;
    };
    let object = Object::of(solid().into(), FieldMeta::default());
    let (mut canvas, look) = on_canvas(&card, &object);
    let picture = canvas.draw_all(&look, SIZE.map(|n| n as u32), false);
    let drawn = read::bytes(&card.device, &card.queue, &picture).unwrap();
    let colors = |bytes: &[u8]| bytes.iter().collect::<std::collections::BTreeSet<_>>().len();
    assert!(colors(&drawn) > 50);
    for format in [
        wgpu::TextureFormat::Rgba8Unorm,
        wgpu::TextureFormat::Rgba8UnormSrgb,
    ] {
        let window = card.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: picture.size(),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let mut encoder = card
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let place = Rect::from_min_size(egui::Pos2::ZERO, Vec2::new(SIZE[0] as f32, SIZE[1] as f32));
        let information = PaintCallbackInfo {
            viewport: place,
            clip_rect: place,
            pixels_per_point: 1.0,
            screen_size_px: SIZE.map(|n| n as u32),
        };
        let mut pass = encoder
            .begin_render_pass(&wgpu::RenderPassDescriptor {
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &window.create_view(&wgpu::TextureViewDescriptor::default()),
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations::default(),
                })],
                ..wgpu::RenderPassDescriptor::default()
            })
            .forget_lifetime();
        let laid = Layer::new(&card.device, format).laid(&card.device, &picture);
        laid.paint(information, &mut pass, &CallbackResources::default());
        drop(pass);
        card.queue.submit([encoder.finish()]);
        let seen = read::bytes(&card.device, &card.queue, &window).unwrap();
        let worst = drawn.iter().zip(&seen).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(
            worst <= Some(1) && seen.len() == drawn.len(),
            "{format:?}: {worst:?}"
        );
    }
}
