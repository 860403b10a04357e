//! Pictures back from the card.

use std::sync::mpsc::channel;

use eframe::egui_wgpu::wgpu;

/// Rows of a copy begin at multiples of so many bytes.
const ALIGNED: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;

/// The bytes of a texture of four a pixel, rows from the top.
///
/// # Errors
/// That the card is lost or has no memory left.
pub fn bytes(device: &wgpu::Device, queue: &wgpu::Queue, texture: &wgpu::Texture) -> Result<Vec<u8>, String> {
    let lost = |why: String| format!("the graphics card gave no picture back ({why})");
    let row = 4 * texture.width();
    let padded = row.next_multiple_of(ALIGNED);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read back"),
        size: u64::from(padded) * u64::from(texture.height()),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded),
                rows_per_image: None,
            },
        },
        texture.size(),
    );
    queue.submit([encoder.finish()]);
    let (tell, told) = channel();
    buffer.slice(..).map_async(wgpu::MapMode::Read, move |mapped| {
        let _ = tell.send(mapped);
    });
    device
        .poll(wgpu::PollType::wait_indefinitely())
        .map_err(|e| lost(e.to_string()))?;
    told.recv()
        .map_err(|e| lost(e.to_string()))?
        .map_err(|e| lost(e.to_string()))?;
    let mapped = buffer
        .slice(..)
        .get_mapped_range()
        .map_err(|e| lost(e.to_string()))?;
    let rows = mapped.chunks_exact(padded as usize);
    Ok(rows
        .flat_map(|whole| whole[..row as usize].iter().copied())
        .collect())
}
