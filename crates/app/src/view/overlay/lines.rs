//! Lines and dots of one width.

use bytemuck::{Pod, Zeroable};
use eframe::egui_wgpu::wgpu::{self, util::DeviceExt};

use crate::view::Patch;

/// A line in the world from the origin of the picture, or a dot where both ends are one.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Stretch {
    /// Where it begins.
    pub start: [f32; 3],
    /// Where it ends.
    pub end: [f32; 3],
    /// Red, green, blue as the screen has them, and how much it hides.
    pub color: [u8; 4],
}

/// As the shader reads them.
pub const STRETCH: wgpu::VertexBufferLayout<'_> = wgpu::VertexBufferLayout {
    array_stride: size_of::<Stretch>() as u64,
    step_mode: wgpu::VertexStepMode::Instance,
    attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Unorm8x4],
};

/// Of triangles: dark, so that the shading is seen between them.
const WIRE: [u8; 4] = [20, 12, 10, 130];

/// Lines on the card.
pub struct Lines {
    stretches: wgpu::Buffer,
    count: u32,
}

impl Lines {
    /// On a card.
    pub fn new(device: &wgpu::Device, stretches: &[Stretch]) -> Self {
        let contents = wgpu::util::BufferInitDescriptor {
            label: Some("lines"),
            contents: bytemuck::cast_slice(stretches),
            usage: wgpu::BufferUsages::VERTEX,
        };
        Self {
            stretches: device.create_buffer_init(&contents),
            count: stretches.len() as u32,
        }
    }

    /// Draws them.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>) {
        if self.count > 0 {
            pass.set_vertex_buffer(0, self.stretches.slice(..));
            pass.draw(0..6, 0..self.count);
        }
    }
}

/// Sides of triangles, each once.
pub fn edges(patch: &Patch) -> Vec<Stretch> {
    let sides = patch
        .indices
        .chunks_exact(3)
        .flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]);
    let mut sides: Vec<[u32; 2]> = sides.map(|[a, b]| [a.min(b), a.max(b)]).collect();
    sides.sort_unstable();
    sides.dedup();
    let place = |n: u32| patch.vertices[n as usize].at;
    let stretch = |[a, b]: [u32; 2]| Stretch {
        start: place(a),
        end: place(b),
        color: WIRE,
    };
    sides.into_iter().map(stretch).collect()
}
